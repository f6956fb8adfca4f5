//! All settings of perception, as one tree.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::checks::{Checked, part};
use crate::detector::DetectorSettings;
use crate::grip::GripSettings;
use crate::paper::PaperSettings;

/// Settings of all detectors and estimators: the perception part of a settings file. What a file leaves out has its default.
///
/// ```
/// let settings: grip_perception::PerceptionSettings = toml::from_str(
///     "[grip.restarts]
///      most = 1
///      [grip.colour]
///      enabled = false",
/// )?;
/// assert_eq!((settings.grip.restarts.most, settings.grip.polish.steps), (1, 8));
/// assert!(settings.validate().is_ok());
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PerceptionSettings {
    /// The first stage.
    pub detector: DetectorSettings,
    /// The second stage.
    pub grip: GripSettings,
    /// The second stage as published.
    pub paper: PaperSettings,
    /// The same with guards that the paper leaves out ([`PaperSettings::guarded`]).
    pub paper_guarded: PaperSettings,
}

impl Default for PerceptionSettings {
    fn default() -> Self {
        Self {
            detector: DetectorSettings::default(),
            grip: GripSettings::default(),
            paper: PaperSettings::default(),
            paper_guarded: PaperSettings::guarded(),
        }
    }
}

impl PerceptionSettings {
    /// What is wrong with a value, if anything: its field with the parts that hold it, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        part("detector", self.detector.validate())?;
        part("grip", self.grip.validate())?;
        part("paper", self.paper.validate())?;
        part("paper_guarded", self.paper_guarded.validate())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::Stride;
    use crate::support::SupportSettings;
    use crate::{Holes, SearchLevel};

    fn read(text: &str) -> Result<PerceptionSettings, String> {
        toml::from_str(text).map_err(|error| error.to_string())
    }

    /// Differs from the defaults in each part, in numbers that are no short decimals.
    fn unusual() -> PerceptionSettings {
        let mut settings = PerceptionSettings::default();
        settings.detector.pyramid.octaves = 1.0 / 3.0;
        settings.detector.clusters.support.max_tilt_rad = SupportSettings::ANY_TILT;
        let grip = &mut settings.grip;
        grip.observation.support = SupportSettings::off();
        grip.observation.edge_slope_m = 0.1f32 + 0.2f32;
        grip.proposal.miss_weight = 1.0 / 3.0;
        grip.search.levels.push(SearchLevel { stride: Stride::One, ..grip.search.levels[0].clone() });
        grip.search.levels[1].diffusion_rad = [1.0 / 3.0, f32::MIN_POSITIVE];
        grip.polish.converged_m = 0.0;
        grip.restarts.most = 1;
        grip.near_symmetry.enabled = false;
        grip.near_symmetry.stride = Stride::Eight;
        grip.score.fit_weight = 2.0f32.sqrt();
        grip.joint.enabled = false;
        grip.colour.enabled = false;
        grip.belief.temperature = 2.0f64.sqrt();
        settings.paper =
            PaperSettings { holes: Holes::Origin, decay_exponent: 7, ..PaperSettings::guarded() };
        settings
    }

    #[test]
    fn the_tree_is_the_same_after_toml_and_json() {
        for settings in [PerceptionSettings::default(), unusual()] {
            assert_eq!(settings.validate(), Ok(()));
            let text = toml::to_string_pretty(&settings).unwrap();
            assert_eq!(read(&text).unwrap(), settings, "{text}");
            // As a table too, into which parts can be merged.
            let table = toml::Table::try_from(&settings).unwrap();
            assert_eq!(table.try_into::<PerceptionSettings>().unwrap(), settings);
            let json = serde_json::to_string(&settings).unwrap();
            assert_eq!(serde_json::from_str::<PerceptionSettings>(&json).unwrap(), settings);
        }
        let text = toml::to_string_pretty(&PerceptionSettings::default()).unwrap();
        assert!(text.contains("fit_weight = 0.6\n"), "{text}");
    }

    #[test]
    fn a_part_leaves_the_rest_as_it_is() {
        let settings = read("[grip.observation.support]\nenabled = false\n[paper]\nsamples = 60").unwrap();
        let mut expected = PerceptionSettings::default();
        expected.grip.observation.support.enabled = false;
        expected.paper.samples = 60;
        assert_eq!(settings, expected);
        assert_eq!(read("").unwrap(), PerceptionSettings::default());
    }

    #[test]
    fn what_is_wrong_is_said_with_its_field() {
        for (text, wanted) in [
            ("[grip.restart]\nmost = 1", "unknown field `restart`"),
            ("[grip.near_symmetry]\nstride = 3", "stride = 3: must be 1, 2, 4 or 8"),
            ("[paper]\nholes = \"none\"", "unknown variant `none`"),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.contains(wanted), "{message}");
        }
        type Change = fn(&mut PerceptionSettings);
        let changes: [(Change, &str); 9] = [
            (|s| s.detector.pyramid.octaves = 0.0, "detector.pyramid.octaves = 0: 0.1 to 4"),
            (|s| s.detector.clusters.reach_px = 0, "detector.clusters.reach_px = 0: 1 to 100 pixels"),
            (|s| s.grip.observation.support.draws = 0, "grip.observation.support.draws = 0: 1 to 100000"),
            (|s| s.grip.search.levels.clear(), "grip.search.levels = []: at least one level"),
            (|s| s.grip.search.levels[2].samples = 0, "grip.search.levels[2].samples = 0: 1 to 100000"),
            (|s| s.grip.score.edge_weight = f32::NAN, "grip.score.edge_weight = NaN: must be finite"),
            (|s| s.grip.belief.temperature = 0.0, "grip.belief.temperature = 0: must be positive"),
            (|s| s.paper.alpha_b = 0.5, "paper.alpha_* = [0.1, 0.5, 0.3, 0.25, 0.25]: each 0 to 1"),
            (|s| s.paper.support.inlier_m = 1.0, "paper.support.inlier_m = 1: 0.0001 to 0.1 metres"),
        ];
        for (change, wanted) in changes {
            let mut settings = PerceptionSettings::default();
            change(&mut settings);
            let message = settings.validate().unwrap_err();
            assert!(message.starts_with(wanted), "{message}");
        }
    }
}
