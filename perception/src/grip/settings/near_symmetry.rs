//! A result against its near-symmetric poses.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::checks::{Checked, not_negative, positive, within};
use crate::observation::Stride;

/// How a result is compared with itself, turned so that it nearly lies on itself: boxes, clamps, mugs, whose scores differ
/// little then. Figures in brackets are the defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NearSymmetrySettings {
    /// Whether it is (true).
    pub enabled: bool,
    /// A turned one that scores less than the result by more is not looked at further, 0 or more (0.1).
    pub margin: f32,
    /// What explaining twice as many pixels of the image is worth among these, in units of the score, 0 or more (0.3).
    pub explained_weight: f32,
    /// The resolution at which they are pulled into place and compared: 1, 2, 4 or 8 (2),
    pub stride: Stride,
    /// with a model of this many triangles, 4 to 100000 (200),
    pub triangles: usize,
    /// and this kernel, in epsilons, over 0 (3),
    pub kernel: f32,
    /// by so many Gauss-Newton steps, 0 to 1000 (2).
    pub steps: usize,
    /// Of those turned against each other by less than this, radians, 0 to pi (0.6), one is polished,
    pub apart_rad: f32,
    /// and so many of all, 1 to 1000 (4).
    pub finalists: usize,
}

impl Default for NearSymmetrySettings {
    fn default() -> Self {
        Self {
            enabled: true,
            margin: 0.1,
            explained_weight: 0.3,
            stride: Stride::Two,
            triangles: 200,
            kernel: 3.0,
            steps: 2,
            apart_rad: 0.6,
            finalists: 4,
        }
    }
}

impl NearSymmetrySettings {
    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        not_negative("margin", self.margin)?;
        not_negative("explained_weight", self.explained_weight)?;
        within("triangles", self.triangles, 4..=100_000, "")?;
        positive("kernel", self.kernel)?;
        within("steps", self.steps, 0..=1000, "")?;
        within("apart_rad", self.apart_rad, 0.0..=std::f32::consts::PI, "radians")?;
        within("finalists", self.finalists, 1..=1000, "")
    }
}
