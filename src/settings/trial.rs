//! How a trial goes, when an estimate is believed in it, and how grasps are tried in a sweep.

use grip_sim::range::within;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a trial goes, whoever perceives and plans.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TrialSettings {
    /// An item is given up after this many attempts; 1 to 100. Default 3.
    pub max_attempts: u32,
    /// Looks in a row after which nothing could be planned end the trial; 1 to 100. Default 2.
    pub max_fruitless_looks: u32,
    /// How often an item is put aside on the table in a trial, because it cannot be packed as it lies without a risk; 0 to 100. Default 1.
    pub max_put_aside: u32,
    /// How often the robot pushes what is in a trial, where nothing can be picked; 0 to 100. Default 3.
    pub max_pushes: u32,
    /// How long an estimator of others may take for an answer, seconds, and five times as long for its first one; 0.01 to 3600. Default
    /// 60. After that the trial ends with `estimator_failed`.
    pub estimator_timeout_s: f64,
    /// The same for a grasp planner of others: after that the trial ends with `grasper_failed`; 0.01 to 3600. Default 60.
    pub grasper_timeout_s: f64,
    /// When an item may lie in a second way, with at least this share of the belief, the robot looks from elsewhere before it
    /// plans; 0 to 0.5. Default 0: never.
    pub second_look_mass: f64,
    /// How high the torso is there, metres over its lower stop; 0 to 1. Default 0.1. The head looks at that item; what the
    /// camera no longer sees stays where it was believed to be.
    pub second_look_torso_m: f64,
    /// Simulated seconds after an attempt for what still rolls to come to rest; 0 to 60. Default 2.
    pub calm_s: f64,
    /// Simulated seconds at the end of the trial for everything to come to rest; 0 to 60. Default 8.
    pub final_settle_s: f64,
    /// Simulated seconds after that in which nothing should move any more; 0 to 60. Default 1.
    pub drift_s: f64,
}

impl Default for TrialSettings {
    fn default() -> Self {
        Self {
            max_attempts: 3,
            max_fruitless_looks: 2,
            max_put_aside: 1,
            max_pushes: 3,
            estimator_timeout_s: 60.0,
            grasper_timeout_s: 60.0,
            second_look_mass: 0.0,
            second_look_torso_m: 0.1,
            calm_s: 2.0,
            final_settle_s: 8.0,
            drift_s: 1.0,
        }
    }
}

impl TrialSettings {
    /// # Errors
    /// The first field that is out of its range, with its value and its range.
    pub fn validate(&self) -> std::result::Result<(), String> {
        within("max_attempts", f64::from(self.max_attempts), 1.0, 100.0)?;
        within("max_fruitless_looks", f64::from(self.max_fruitless_looks), 1.0, 100.0)?;
        within("max_put_aside", f64::from(self.max_put_aside), 0.0, 100.0)?;
        within("max_pushes", f64::from(self.max_pushes), 0.0, 100.0)?;
        within("estimator_timeout_s", self.estimator_timeout_s, 0.01, 3600.0)?;
        within("grasper_timeout_s", self.grasper_timeout_s, 0.01, 3600.0)?;
        within("second_look_mass", self.second_look_mass, 0.0, 0.5)?;
        within("second_look_torso_m", self.second_look_torso_m, 0.0, 1.0)?;
        within("calm_s", self.calm_s, 0.0, 60.0)?;
        within("final_settle_s", self.final_settle_s, 0.0, 60.0)?;
        within("drift_s", self.drift_s, 0.0, 60.0)
    }
}

/// When an estimate is believed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BeliefSettings {
    /// Below this confidence an estimate is no target, only an obstacle; 0 to 1. Default 0.25.
    pub least_confidence: f64,
    /// Whether what was believed at one look is where to look in the next; else each look is as if it were the first. Default
    /// false.
    pub follow: bool,
    /// How far off the camera may be from where the joints have it, one standard deviation in each direction: its position,
    /// metres, 0 to 0.1. Default 0. The spread of positions holds it;
    pub calibration_m: f64,
    /// and its orientation, radians, 0 to 0.3. Default 0.
    pub calibration_rad: f64,
    /// Of an item in the bin at least this share must be within the picture for its estimated pose to be believed; else it is where it was
    /// put; 0 to 1. Default 0.9.
    pub in_view: f64,
    /// An item in the bin is not believed to have moved farther than this from where it was put, metres; 0 to 1. Default 0.12.
    pub moved_in_bin_m: f64,
    /// An estimated centre up to so far above the edge of the bin's walls is in the bin, metres; 0 to 1. Default 0.1.
    pub over_bin_m: f64,
}

impl Default for BeliefSettings {
    fn default() -> Self {
        Self {
            least_confidence: 0.25,
            follow: false,
            calibration_m: 0.0,
            calibration_rad: 0.0,
            in_view: 0.9,
            moved_in_bin_m: 0.12,
            over_bin_m: 0.1,
        }
    }
}

impl BeliefSettings {
    /// # Errors
    /// The first field that is out of its range, with its value and its range.
    pub fn validate(&self) -> std::result::Result<(), String> {
        within("least_confidence", self.least_confidence, 0.0, 1.0)?;
        within("calibration_m", self.calibration_m, 0.0, 0.1)?;
        within("calibration_rad", self.calibration_rad, 0.0, 0.3)?;
        within("in_view", self.in_view, 0.0, 1.0)?;
        within("moved_in_bin_m", self.moved_in_bin_m, 0.0, 1.0)?;
        within("over_bin_m", self.over_bin_m, 0.0, 1.0)
    }
}

/// Numbers of a sweep that are no part of its question.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SweepSettings {
    /// Layouts of a seed that are tried until one has a grasp within reach; 1 to 1000. Default 30.
    pub layouts: u32,
    /// Simulated seconds before the approach; 0 to 10. Default 0.15.
    pub wait_s: f64,
    /// How far the object may move meanwhile, metres; 0 to 0.1. Default 0.003: a hand that begins inside it throws it.
    pub thrown_m: f64,
}

impl Default for SweepSettings {
    fn default() -> Self {
        Self { layouts: 30, wait_s: 0.15, thrown_m: 0.003 }
    }
}

impl SweepSettings {
    /// # Errors
    /// The first field that is out of its range, with its value and its range.
    pub fn validate(&self) -> std::result::Result<(), String> {
        within("layouts", f64::from(self.layouts), 1.0, 1000.0)?;
        within("wait_s", self.wait_s, 0.0, 10.0)?;
        within("thrown_m", self.thrown_m, 0.0, 0.1)
    }
}
