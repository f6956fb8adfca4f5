//! How objects are followed from frame to frame.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::checks::{Checked, within};

/// How the last posterior is the prior of the next frame. Figures in brackets are the defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TrackSettings {
    /// An object is followed while it is believed to be there with this confidence, 0 to 1 (0.5),
    pub least_confidence: f64,
    /// and explains the frame no worse than the last one by more of the score, 0 to 10 (0.05). Else it is searched for.
    pub most_drop: f64,
    /// After so many frames it is searched for in any case, beside where it is believed to be, 1 to 100000 (10).
    pub search_again: usize,
    /// Hypotheses of each mode, 1 to 1000 (24): its pose, and others about it; half of them at each finer level.
    pub samples: usize,
    /// Standard deviation of what an object moves by between two frames, in each direction, metres, 0 to 1 (0.01),
    pub motion_m: f32,
    /// and turns by, as the camera sees it, radians, 0 to 3 (0.03).
    pub motion_rad: f32,
    /// Frames that follow each other err alike: masses are by the mean of the evidence of so many of them, 1 to 100000 (20), and
    /// never surer than that of one.
    pub memory: usize,
    /// Modes with less mass are not followed, 0 to 1 (0.001).
    pub least_mass: f64,
}

impl Default for TrackSettings {
    fn default() -> Self {
        Self {
            least_confidence: 0.5,
            most_drop: 0.05,
            search_again: 10,
            samples: 24,
            motion_m: 0.01,
            motion_rad: 0.03,
            memory: 20,
            least_mass: 0.001,
        }
    }
}

impl TrackSettings {
    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        within("least_confidence", self.least_confidence, 0.0..=1.0, "")?;
        within("most_drop", self.most_drop, 0.0..=10.0, "")?;
        within("search_again", self.search_again, 1..=100_000, "")?;
        within("samples", self.samples, 1..=1000, "")?;
        within("motion_m", self.motion_m, 0.0..=1.0, "metres")?;
        within("motion_rad", self.motion_rad, 0.0..=3.0, "radians")?;
        within("memory", self.memory, 1..=100_000, "frames")?;
        within("least_mass", self.least_mass, 0.0..=1.0, "")
    }
}
