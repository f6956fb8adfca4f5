//! The score of a hypothesis.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::checks::{Checked, not_negative, positive, within};

/// What counts in a score, and how much. Figures in brackets are the defaults; the score is divided by the sum of the first
/// three weights.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ScoreSettings {
    /// Weight of the depth fit, over 0 (0.6; the paper: alpha_r).
    pub fit_weight: f32,
    /// Weight of the silhouette term, 0 or more (0.4; the paper: alpha_e, in another form).
    pub edge_weight: f32,
    /// Weight of a box's confidence times overlap, 0 or more (0.3; the paper: alpha_box + alpha_b = 0.2). Exact boxes deserve
    /// 0.6, sloppy ones 0.1.
    pub box_weight: f32,
    /// Weight of the penetration of the support plane, 0 or more (0.3).
    pub plane_weight: f32,
    /// What a pixel costs where the camera looks through the hypothesis, as a share of what an inlier gains, 0 or more (0.5).
    pub violation: f32,
    /// Share of occluded pixels that is taken out of the denominator, 0 to 1 (0.7): below 1, since what hides behind others
    /// explains nothing.
    pub occlusion_discount: f32,
    /// The denominator is at least this share of the rendered pixels, over 0, to 1 (0.15).
    pub min_visible: f32,
    /// A hypothesis that covers fewer full-resolution pixels is rejected, 0 or more (60): slivers fit anything.
    pub min_pixels: f32,
    /// Penetration of the plane up to this is free, metres, 0 to 1 (0.012): real models sink by up to 12 mm under the fitted
    /// plane.
    pub penetration_free_m: f64,
    /// Penetration beyond that which costs the full weight, metres, over 0, to 1 (0.02).
    pub penetration_full_m: f64,
}

impl Default for ScoreSettings {
    fn default() -> Self {
        Self {
            fit_weight: 0.6,
            edge_weight: 0.4,
            box_weight: 0.3,
            plane_weight: 0.3,
            violation: 0.5,
            occlusion_discount: 0.7,
            min_visible: 0.15,
            min_pixels: 60.0,
            penetration_free_m: 0.012,
            penetration_full_m: 0.02,
        }
    }
}

impl ScoreSettings {
    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        positive("fit_weight", self.fit_weight)?;
        not_negative("edge_weight", self.edge_weight)?;
        not_negative("box_weight", self.box_weight)?;
        not_negative("plane_weight", self.plane_weight)?;
        not_negative("violation", self.violation)?;
        within("occlusion_discount", self.occlusion_discount, 0.0..=1.0, "")?;
        within("min_visible", self.min_visible, 1e-6..=1.0, "")?;
        not_negative("min_pixels", self.min_pixels)?;
        within("penetration_free_m", self.penetration_free_m, 0.0..=1.0, "metres")?;
        within("penetration_full_m", self.penetration_full_m, 1e-6..=1.0, "metres")
    }
}
