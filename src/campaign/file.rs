//! The file that says what a campaign is: TOML.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// Most units of a campaign: as many as an indexed Job of Kubernetes has.
pub const MOST_UNITS: u64 = 100_000;

/// What is run, and in how many units. Exactly one of the verbs is given, with its options as on the command line, `_` in place of `-`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CampaignFile {
    /// The campaign itself.
    pub campaign: Header,
    /// Options of `grip trials`. An item is a seed.
    pub trials: Option<Map<String, Value>>,
    /// Options of `grip sweep`. An item is a seed, with all objects and errors.
    pub sweep: Option<Map<String, Value>>,
    /// Options of `grip scenes`. An item is a scene.
    pub scenes: Option<Map<String, Value>>,
    /// Options of `grip estimate`. An item is an image; with `track` a scene. `posteriors` is true or false.
    pub estimate: Option<Map<String, Value>>,
}

/// The campaign itself.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// For people.
    pub name: String,
    /// In how many units the work is cut; this or `items_per_unit`. At most 100 000, and at most as many as there are items.
    pub units: Option<u64>,
    /// How many items a unit has, the last one perhaps fewer.
    pub items_per_unit: Option<u64>,
    /// Whether to keep pictures of the first seed's trials and of failures, half a megabyte each.
    #[serde(default)]
    pub films: bool,
}

/// Which verb a campaign runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Verb {
    /// `grip trials`
    Trials,
    /// `grip sweep`
    Sweep,
    /// `grip scenes`
    Scenes,
    /// `grip estimate`
    Estimate,
}

impl Verb {
    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Trials => "trials",
            Self::Sweep => "sweep",
            Self::Scenes => "scenes",
            Self::Estimate => "estimate",
        }
    }

    /// What its items are, for people.
    pub fn items(self) -> &'static str {
        match self {
            Self::Trials | Self::Sweep => "seeds",
            Self::Scenes => "scenes",
            Self::Estimate => "images",
        }
    }
}

/// Options that a campaign decides itself, and what to do instead.
const DECIDED: [(&str, &str); 6] = [
    ("out", "grip campaign merge names the folder"),
    ("resume", "units are always gone on with"),
    ("shard", "grip campaign run takes units"),
    ("json", "grip campaign merge prints what there is"),
    ("jobs", "give it to grip campaign run"),
    ("preview", "grip scenes --preview makes it of the merged set"),
];

impl CampaignFile {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// When it cannot be read, is no TOML, or says something that is not to be said: names file, field and value.
    pub fn load(path: &Path) -> Result<Self> {
        let text = grip_sim::files::read_to_string(path)?;
        Self::parse(&text).with_context(|| path.display().to_string())
    }

    /// The same of the file's text.
    ///
    /// # Errors
    /// As [`CampaignFile::load`].
    pub fn parse(text: &str) -> Result<Self> {
        let file: Self = grip_sim::files::from_toml(text).map_err(anyhow::Error::msg)?;
        let (verb, options) = file.work()?;
        for (option, instead) in DECIDED {
            ensure!(
                !options.contains_key(option),
                "[{}] {option}: the campaign decides it; leave it out ({instead})",
                verb.name()
            );
        }
        if let Some(value) = options.get("posteriors") {
            ensure!(
                value.is_boolean(),
                "[estimate] posteriors = {value}: must be true or false; grip campaign merge names the file"
            );
        }
        ensure!(!file.campaign.name.trim().is_empty(), "campaign.name: is empty; give the campaign a name");
        ensure!(
            !file.campaign.films || verb == Verb::Trials,
            "campaign.films: only trials have films; leave it out"
        );
        Ok(file)
    }

    /// The verb and its options.
    ///
    /// # Errors
    /// When it is none or several.
    pub fn work(&self) -> Result<(Verb, &Map<String, Value>)> {
        let all = [
            (Verb::Trials, &self.trials),
            (Verb::Sweep, &self.sweep),
            (Verb::Scenes, &self.scenes),
            (Verb::Estimate, &self.estimate),
        ];
        let mut given = all.into_iter().filter_map(|(verb, options)| Some((verb, options.as_ref()?)));
        match (given.next(), given.next()) {
            (Some(work), None) => Ok(work),
            (None, _) => bail!("says nothing to run; give one of [trials], [sweep], [scenes], [estimate]"),
            (Some((a, _)), Some((b, _))) => {
                bail!("[{}] and [{}]: a campaign runs one verb; write a file for each", a.name(), b.name())
            }
        }
    }
}

impl Header {
    /// How many items the units of so many items have: all as many, but for one at most.
    ///
    /// # Errors
    /// When it is not said, or there would be more units than items or than are allowed.
    pub fn cut(&self, items: u64) -> Result<Vec<u64>> {
        ensure!(items > 0, "there is nothing to run");
        let units = match (self.units, self.items_per_unit) {
            (Some(units), None) => {
                ensure!(
                    (1..=items).contains(&units),
                    "campaign.units = {units}: must be 1 to {items}, the number of items"
                );
                units
            }
            (None, Some(each)) => {
                ensure!(
                    (1..=items).contains(&each),
                    "campaign.items_per_unit = {each}: must be 1 to {items}, the number of items"
                );
                items.div_ceil(each)
            }
            _ => bail!("campaign: give units or items_per_unit, one of them"),
        };
        ensure!(
            units <= MOST_UNITS,
            "campaign: {units} units; at most {MOST_UNITS}, give each more items (there are {items})"
        );
        Ok(match self.items_per_unit {
            Some(each) => (0..units).map(|unit| each.min(items - unit * each)).collect(),
            None => (0..units).map(|unit| items * (unit + 1) / units - items * unit / units).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        format!("{:#}", CampaignFile::parse(text).unwrap_err())
    }

    #[test]
    fn a_file_says_one_verb_and_nothing_that_the_campaign_decides() {
        let head = "[campaign]\nname = \"a\"\nunits = 3\n";
        let file = CampaignFile::parse(&format!("{head}[sweep]\nseeds = 9\nfriction = 0.5\n")).unwrap();
        let (verb, options) = file.work().unwrap();
        assert_eq!((verb, options["seeds"].as_u64(), options.len()), (Verb::Sweep, Some(9), 2));
        assert!(error(head).contains("nothing to run"));
        assert!(error(&format!("{head}[sweep]\n[trials]\n")).contains("one verb"));
        assert!(error(&format!("{head}[trials]\nout = \"x\"\n")).contains("out: the campaign decides it"));
        assert!(error(&format!("{head}[trials]\njobs = 2\n")).contains("grip campaign run"));
        assert!(error(&format!("{head}films = true\n[sweep]\n")).contains("only trials"));
        assert!(error(&format!("{head}[estimate]\nposteriors = \"x\"\n")).contains("true or false"));
        assert!(error(&format!("{head}unit = 3\n[sweep]\n")).contains("unit"));
    }

    #[test]
    fn units_are_of_almost_the_same_size_and_hold_all_items() {
        let header = |units, items_per_unit| Header { name: "a".into(), units, items_per_unit, films: false };
        for items in 1..60 {
            for units in 1..=items {
                let cut = header(Some(units), None).cut(items).unwrap();
                assert_eq!((cut.len() as u64, cut.iter().sum::<u64>()), (units, items));
                assert!(cut.iter().max().unwrap() - cut.iter().min().unwrap() <= 1);
                let cut = header(None, Some(units)).cut(items).unwrap();
                assert_eq!(cut.iter().sum::<u64>(), items);
                assert!(cut[..cut.len() - 1].iter().all(|&n| n == units) && *cut.last().unwrap() > 0);
            }
        }
        assert!(header(Some(5), None).cut(4).unwrap_err().to_string().contains("1 to 4"));
        assert!(header(None, None).cut(4).is_err() && header(Some(1), Some(1)).cut(4).is_err());
        assert!(header(None, Some(1)).cut(200_000).unwrap_err().to_string().contains("at most"));
    }
}
