//! How the support plane is searched.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::checks::{Checked, not_negative, within};

/// Settings of [`super::Supports`]. Figures in brackets are the defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SupportSettings {
    /// Whether a support plane is looked for at all (true).
    pub enabled: bool,
    /// Largest angle between the plane's normal and the world's up direction as the robot knows it, radians, 0 to pi (0.1:
    /// support planes are horizontal, and a head camera's tilt is known to a degree or two). With
    /// [`SupportSettings::ANY_TILT`], pi, `world_from_camera` does not count: for frames that come without one.
    pub max_tilt_rad: f64,
    /// Points within this distance are the plane's, metres, 0.0001 to 0.1 (0.005: three sigma of a structured-light camera
    /// at 1 m).
    pub inlier_m: f64,
    /// RANSAC draws, 1 to 100000 (500: with 20 % inliers 500 draws of three points fail once in 55).
    pub draws: usize,
    /// A plane needs this share of the points that were looked at, 0 to 1 (0.08: less is an object's face).
    pub min_share: f64,
    /// A plane above the largest one is preferred when it has at least this share of its points, 0 to 1 (0.35): a table
    /// holds the objects even where more of the floor is in view.
    pub higher_share: f64,
    /// And when it is so large, square metres (0.08): more than the face of any object that a gripper holds. (A cracker box
    /// that lies near the camera fills as much of the image as the table around it, with 0.034.)
    pub higher_area_m2: f64,
    /// Other planes that are parallel and as large as that are supports, too, when they are at most so far above or below,
    /// metres, 0 to 10 (0.4: steps and shelves, but not the floor below a table); 0 for one support alone.
    pub levels_m: f64,
    /// What is beyond the outline of the support by more than this does not stand on it, metres (0.04): objects may overhang.
    pub overhang_m: f64,
}

impl Default for SupportSettings {
    fn default() -> Self {
        Self {
            enabled: true,
            max_tilt_rad: 0.1,
            inlier_m: 0.005,
            draws: 500,
            min_share: 0.08,
            higher_share: 0.35,
            higher_area_m2: 0.08,
            levels_m: 0.4,
            overhang_m: 0.04,
        }
    }
}

impl SupportSettings {
    /// A [`SupportSettings::max_tilt_rad`] that allows every plane.
    pub const ANY_TILT: f64 = std::f64::consts::PI;

    /// No support plane.
    pub fn off() -> Self {
        Self { enabled: false, ..Self::default() }
    }

    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        within("max_tilt_rad", self.max_tilt_rad, 0.0..=Self::ANY_TILT, "radians")?;
        within("inlier_m", self.inlier_m, 1e-4..=0.1, "metres")?;
        within("draws", self.draws, 1..=100_000, "")?;
        within("min_share", self.min_share, 0.0..=1.0, "")?;
        within("higher_share", self.higher_share, 0.0..=1.0, "")?;
        not_negative("higher_area_m2", self.higher_area_m2)?;
        within("levels_m", self.levels_m, 0.0..=10.0, "metres")?;
        not_negative("overhang_m", self.overhang_m)
    }
}
