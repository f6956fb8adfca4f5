//! One tree of settings for everything: what `--settings FILE` reads, and what records say.
//!
//! A file has any part of the tree, in TOML:
//!
//! ```toml
//! [success]
//! slip_m = 0.01
//!
//! [planner.grasp]
//! at = "best"
//! ```
//!
//! What a file leaves out is as in [`Settings::default`]. A name that is not in the tree, or a value out of its range, is an
//! error that names it.

mod success;
mod trial;

use std::collections::BTreeSet;
use std::path::Path;

use anyhow::{Context, Result, anyhow};
use grip_manip::{ExecutorSettings, PlannerSettings};
use grip_perception::PerceptionSettings;
use grip_physics::PhysicsSettings;
use grip_sim::names::suggestion_in;
use grip_sim::robot::RobotConfig;
use grip_sim::sensor::SensorSettings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

pub use self::success::{ScoreSettings, SuccessCriteria};
pub use self::trial::{BeliefSettings, SweepSettings, TrialSettings};

/// Everything that decides results and is no input of its own (scene, condition, objects, robot, seed).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Detectors and estimators.
    pub perception: PerceptionSettings,
    /// When an estimate is believed.
    pub belief: BeliefSettings,
    /// Choice of grasps and places, and motion planning.
    pub planner: PlannerSettings,
    /// How plans are carried out.
    pub executor: ExecutorSettings,
    /// The camera's sensors.
    pub sensor: SensorSettings,
    /// The physics world.
    pub physics: PhysicsSettings,
    /// How a trial goes.
    pub trial: TrialSettings,
    /// What counts as a success.
    pub success: SuccessCriteria,
    /// Bounds of the score card.
    pub score: ScoreSettings,
    /// Grasps under known pose errors.
    pub sweep: SweepSettings,
    /// What a file has said.
    #[serde(skip)]
    named: Named,
}

/// Paths of what a file names, such as `physics.fingers.pad_friction`. Settings are the same, whoever said them.
#[derive(Debug, Clone, Default)]
struct Named(BTreeSet<String>);

impl PartialEq for Named {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Named {
    fn of(changes: &Table) -> Self {
        fn add(paths: &mut BTreeSet<String>, before: &str, table: &Table) {
            for (name, value) in table {
                let path = format!("{before}{name}");
                match value {
                    Value::Table(inner) => add(paths, &format!("{path}."), inner),
                    _ => {
                        paths.insert(path);
                    }
                }
            }
        }
        let mut paths = BTreeSet::new();
        add(&mut paths, "", changes);
        Self(paths)
    }
}

impl Settings {
    /// The defaults with what `file` says.
    ///
    /// # Errors
    /// When the file cannot be read, is no TOML, has a name that is not in the tree, or a value that does not fit: names
    /// file, field and value.
    pub fn load(file: &Path) -> Result<Self> {
        let text = grip_sim::files::read_to_string(file).context("--settings")?;
        Self::parse(&text).with_context(|| format!("--settings {}", file.display()))
    }

    /// The defaults with what this TOML text says.
    ///
    /// # Errors
    /// As [`Settings::load`].
    pub fn parse(text: &str) -> Result<Self> {
        let changes: Table = toml::from_str(text).map_err(|e| anyhow!("{}", e.to_string().trim_end()))?;
        let named = Named::of(&changes);
        let mut tree = Value::try_from(Self::default()).context("the defaults")?;
        merge(&mut tree, Value::Table(changes));
        let read: Self = serde_path_to_error::deserialize(tree.clone()).map_err(|error| {
            let message = error.inner().to_string().trim_end().replace('\n', " ");
            anyhow!("{}: {message}{}", error.path(), suggestion_in(&message))
        })?;
        grip_sim::files::lists_fit::<Self>(&tree).map_err(|message| anyhow!(message))?;
        let settings = Self { named, ..read };
        settings.validate()?;
        Ok(settings)
    }

    /// With what a robot says of its own pads, but for what a file has named.
    #[must_use]
    pub fn for_robot(mut self, config: &RobotConfig) -> Self {
        if let Some(friction) = config.gripper.pad_friction {
            self.take_pads(friction);
        }
        self
    }

    fn take_pads(&mut self, friction: f64) {
        let named = |path: &str| self.named.0.contains(path);
        let (world, planner) =
            (named("physics.fingers.pad_friction"), named("planner.grasp.antipodal.pad_friction"));
        if !world {
            self.physics.fingers.pad_friction = friction;
        }
        if !planner {
            self.planner.grasp.antipodal.pad_friction = friction;
        }
    }

    /// # Errors
    /// When a value is out of its range: names the part of the tree, field, value and range.
    pub fn validate(&self) -> Result<()> {
        let parts = [
            ("perception", self.perception.validate()),
            ("belief", self.belief.validate()),
            ("trial", self.trial.validate()),
            ("sensor", self.sensor.validate()),
            ("planner", self.planner.validate()),
            ("executor", self.executor.validate()),
            ("physics", self.physics.validate()),
            ("success", self.success.validate()),
            ("score", self.score.validate()),
            ("sweep", self.sweep.validate()),
        ];
        parts.into_iter().try_for_each(|(part, valid)| valid.map_err(|problem| anyhow!("{part}.{problem}")))
    }

    /// The whole tree, to be edited.
    ///
    /// # Errors
    /// Never, unless a setting cannot be written as TOML.
    pub fn to_toml(&self) -> Result<String> {
        Ok(toml::to_string_pretty(self)?)
    }
}

/// Puts `changes` into `tree`, table by table.
fn merge(tree: &mut Value, changes: Value) {
    match (tree, changes) {
        (Value::Table(tree), Value::Table(changes)) => {
            for (name, change) in changes {
                match tree.get_mut(&name) {
                    Some(part) => merge(part, change),
                    None => {
                        tree.insert(name, change);
                    }
                }
            }
        }
        (tree, change) => *tree = change,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_whole_tree_is_written_and_read_back() {
        let settings = Settings::default();
        assert_eq!(Settings::parse(&settings.to_toml().unwrap()).unwrap(), settings);
        assert_eq!(Settings::parse("").unwrap(), settings);
    }

    #[test]
    fn a_part_changes_what_it_names_and_nothing_else() {
        let changed =
            Settings::parse("[success]\nslip_m = 0.01\n[perception.paper_guarded]\nsamples = 100").unwrap();
        let mut expected = Settings::default();
        expected.success.slip_m = 0.01;
        expected.perception.paper_guarded.samples = 100;
        assert_eq!(changed, expected);
    }

    #[test]
    fn a_robot_says_what_its_pads_are_and_a_file_has_the_last_word() {
        let taken = |text: &str| {
            let mut settings = Settings::parse(text).unwrap();
            settings.take_pads(0.5);
            (settings.physics.fingers.pad_friction, settings.planner.grasp.antipodal.pad_friction)
        };
        assert_eq!(taken(""), (0.5, 0.5));
        assert_eq!(taken("[physics.fingers]\npad_friction = 0.9"), (0.9, 0.5));
        assert_eq!(taken("[planner.grasp.antipodal]\npad_friction = 0.8"), (0.5, 0.8));
    }

    #[test]
    fn what_is_wrong_is_named() {
        let message = |text: &str| format!("{:#}", Settings::parse(text).unwrap_err());
        let unknown = message("[success]\nslipp_m = 0.01");
        assert!(unknown.contains("success") && unknown.contains("slipp_m"), "{unknown}");
        let kind = message("[trial]\nmax_attempts = \"three\"");
        assert!(kind.contains("trial.max_attempts"), "{kind}");
        let range = message("[trial]\ncalm_s = -1.0");
        assert!(range.contains("trial.calm_s = -1") && range.contains("0 to 60"), "{range}");
        assert!(message("[nothing]").contains("nothing"));
        assert!(message("success").contains("line 1"));
    }
}
