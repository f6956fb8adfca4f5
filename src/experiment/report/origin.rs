//! What the folders of a page are: a single run, an experiment or a shard of one, a campaign, a sweep.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

use super::Sources;
use crate::experiment::plan::Shard;
use crate::scenario::program;

/// What a folder holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// A trial by `grip pack`.
    Trial,
    /// Trials by `grip trials`, or merged ones, which are the same.
    Trials {
        /// How many there are.
        trials: usize,
        /// How many there are to be, without those that cannot be laid out.
        of: usize,
        /// Which part they are, where they are one.
        shard: Option<Shard>,
    },
    /// Grasps by `grip sweep`.
    Sweep {
        /// How many.
        grasps: usize,
    },
    /// The units of a campaign.
    Campaign {
        /// Its name.
        name: String,
        /// Units that are done.
        done: usize,
        /// All units.
        units: usize,
        /// What they have come to.
        results: String,
        /// Models of the processors that did them.
        cpus: Vec<String>,
    },
}

/// A folder, and what made it.
#[derive(Debug, Clone, PartialEq)]
pub struct Origin {
    /// As it was given.
    pub folder: String,
    /// What it is.
    pub kind: Kind,
    /// The program that made it.
    pub program: String,
}

impl Origin {
    /// `about` is the file that tells of it: experiment.json, sweep.json or scenario.json.
    pub fn new(folder: &Path, kind: Kind, about: &Value) -> Self {
        let program = made_by(&about["program"]);
        Self { folder: folder.display().to_string(), kind, program }
    }

    /// Whether it was made by another program than this, as far as that is known.
    pub fn is_of_another_build(&self) -> bool {
        self.program != made_by(&serde_json::to_value(program()).unwrap_or_default())
    }

    /// In words, for the table of what a page is made of.
    pub fn what(&self) -> String {
        match &self.kind {
            Kind::Trial => "one trial (grip pack)".into(),
            Kind::Trials { trials, of, shard } => {
                let part = shard
                    .map_or_else(String::new, |s| format!("shard {}/{} of an experiment: ", s.index, s.of));
                format!("{part}{trials} of {of} trials (grip trials)")
            }
            Kind::Sweep { grasps } => format!("sweep: {grasps} grasps under pose errors (grip sweep)"),
            Kind::Campaign { name, done, units, results, cpus } => {
                let on = if cpus.is_empty() { String::new() } else { format!(", on {}", cpus.join("; ")) };
                format!("campaign {name}: {done} of {units} units done, {results}{on}")
            }
        }
    }
}

/// A program, as files say it.
fn made_by(program: &Value) -> String {
    let text = |name: &str| program[name].as_str().unwrap_or("unknown");
    if program.is_null() {
        return "unknown".to_owned();
    }
    format!("grip {}, commit {}, {}", text("version"), text("commit"), text("target"))
}

/// What a page is of, in words, and what it says of that: one trial is told from many, an experiment from a part of one and from a campaign.
pub fn title(sources: &Sources) -> (String, String) {
    let trials = sources.trials.len();
    let grasps: usize = sources.sweeps.iter().map(|s| s.lines.len()).sum();
    let count = |n: usize, one: &str| if n == 1 { format!("1 {one}") } else { format!("{n} {one}s") };
    let kinds = || sources.origins.iter().map(|origin| &origin.kind);
    let kind = match sources.origins.as_slice() {
        [one] => match &one.kind {
            Kind::Trial => "One trial".to_owned(),
            Kind::Trials { shard: None, trials, of } if trials < of => format!("Trials, {trials} of {of}"),
            Kind::Trials { shard: None, .. } => "Trials".to_owned(),
            Kind::Trials { shard: Some(Shard { index, of }), .. } => format!("Trials, shard {index} of {of}"),
            Kind::Sweep { .. } => "Sweep".to_owned(),
            Kind::Campaign { name, done, units, .. } => {
                let part = if done < units { format!(", {done} of {units} units") } else { String::new() };
                format!("Campaign {name}{part}")
            }
        },
        _ if kinds().all(|kind| *kind == Kind::Trial) => "Single trials".to_owned(),
        _ => {
            let name = |kind: &Kind| match kind {
                Kind::Trial => "single trials",
                Kind::Trials { .. } => "trials",
                Kind::Sweep { .. } => "sweeps",
                Kind::Campaign { .. } => "campaigns",
            };
            let names: BTreeSet<&str> = kinds().map(name).collect();
            format!("Several folders: {}", names.into_iter().collect::<Vec<_>>().join(", "))
        }
    };
    let packed = || {
        let packed: usize = sources.trials.iter().map(|trial| trial.packed).sum();
        let asked: usize = sources.trials.iter().map(|trial| trial.requested).sum();
        format!("{packed} of {asked} items packed")
    };
    let title = match (sources.trials.as_slice(), grasps) {
        ([one], 0) => format!(
            "{} of {} packed: scene {}, condition {}, estimator {}, seed {}",
            one.packed,
            one.requested,
            one.scene,
            one.condition,
            one.method(),
            one.seed
        ),
        (_, 0) => format!("{}, {}", count(trials, "trial"), packed()),
        ([], n) => format!("{} under pose errors", count(n, "grasp")),
        (_, n) => {
            format!("{}, {}; {} under pose errors", count(trials, "trial"), packed(), count(n, "grasp"))
        }
    };
    (kind, title)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::summary::tests::trial;

    #[test]
    fn titles_tell_one_trial_from_many_and_a_campaign_from_an_experiment() {
        let one = || trial(3, "dark", "grip", &[("can", true, None), ("box", false, None)]);
        let of = |kinds: &[Kind], trials: usize| {
            let origins = kinds.iter().map(|kind| Origin::new(Path::new("x"), kind.clone(), &Value::Null));
            let trials = (0..trials).map(|_| one()).collect();
            title(&Sources { origins: origins.collect(), trials, ..Sources::default() })
        };
        let trials = |shard| Kind::Trials { trials: 2, of: 2, shard };
        let campaign =
            |done| Kind::Campaign { name: "c".into(), done, units: 4, results: String::new(), cpus: vec![] };
        let is = |(kind, title): (String, String), k: &str, t: &str| assert_eq!((&*kind, &*title), (k, t));
        is(
            of(&[Kind::Trial], 1),
            "One trial",
            "1 of 2 packed: scene grocery, condition dark, estimator grip, seed 3",
        );
        is(of(&[trials(None)], 2), "Trials", "2 trials, 2 of 4 items packed");
        is(
            of(&[trials(Some(Shard { index: 2, of: 3 }))], 2),
            "Trials, shard 2 of 3",
            "2 trials, 2 of 4 items packed",
        );
        assert_eq!(of(&[Kind::Trials { trials: 2, of: 4, shard: None }], 2).0, "Trials, 2 of 4");
        is(of(&[campaign(4)], 2), "Campaign c", "2 trials, 2 of 4 items packed");
        assert_eq!(of(&[campaign(3)], 2).0, "Campaign c, 3 of 4 units");
        assert_eq!(of(&[Kind::Trial, Kind::Trial], 2).0, "Single trials");
        assert_eq!(of(&[trials(None), Kind::Sweep { grasps: 9 }], 2).0, "Several folders: sweeps, trials");
    }
}
