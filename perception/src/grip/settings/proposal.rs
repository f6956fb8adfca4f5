//! The first hypotheses.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::checks::{Checked, within};

/// How the first hypotheses are drawn from boxes. Figures in brackets are the defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ProposalSettings {
    /// Least share of proposals that are drawn from the whole image and not from boxes, 0 to 1 (0.1; the paper: 0). Where the
    /// best box is doubtful, it is what that box lacks to certainty: a detector that darkness fools is no hindrance then. The
    /// least share is for detectors that are sure and wrong; it gains nothing with ours.
    pub anywhere: f64,
    /// Proposals drawn for each that is kept by the overlap of its projection with its box, 1 to 1000 (8).
    pub oversampling: usize,
    /// Share of proposals in resting orientations on the support plane, 0 to 1 (0.5); the others are uniform over all
    /// rotations, so that leaning and stacked objects are found too. No plane, no resting proposals.
    pub resting_share: f64,
    /// Tilt of resting proposals, standard deviation about each axis, radians, 0 to 1 (0.03): supports and models are not
    /// exact.
    pub tilt_rad: f32,
    /// Scatter about a box's centre, as a share of its sides, 0 to 1 (0.15); half of the proposals are drawn so, the others
    /// through an observed point.
    pub centre_scatter: f32,
    /// A box that covers more of the image than this share says nothing about extent, and its overlap does not count, 0 to 1
    /// (0.5).
    pub vague_share: f64,
    /// Weight of a proposal whose projection misses its box altogether; one that fills it has 1 more. Over 0, to 1 (0.02).
    pub miss_weight: f32,
}

impl Default for ProposalSettings {
    fn default() -> Self {
        Self {
            anywhere: 0.1,
            oversampling: 8,
            resting_share: 0.5,
            tilt_rad: 0.03,
            centre_scatter: 0.15,
            vague_share: 0.5,
            miss_weight: 0.02,
        }
    }
}

impl ProposalSettings {
    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        within("anywhere", self.anywhere, 0.0..=1.0, "")?;
        within("oversampling", self.oversampling, 1..=1000, "")?;
        within("resting_share", self.resting_share, 0.0..=1.0, "")?;
        within("tilt_rad", self.tilt_rad, 0.0..=1.0, "radians")?;
        within("centre_scatter", self.centre_scatter, 0.0..=1.0, "")?;
        within("vague_share", self.vague_share, 0.0..=1.0, "")?;
        within("miss_weight", self.miss_weight, 1e-6..=1.0, "")
    }
}
