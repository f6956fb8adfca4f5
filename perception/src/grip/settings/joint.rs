//! All objects of a frame together.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::checks::{Checked, within};

/// How objects are looked at together, after each was searched on its own. Figures of scores, which are about 0 to 1, unless
/// said; those in brackets are the defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct JointSettings {
    /// Whether they are (true; the paper: not).
    pub enabled: bool,
    /// Two objects that explain the same pixels, by more than this share of either one's inliers, are in conflict: the
    /// one with the lower score is searched again without those pixels. 0 to 1 (0.5).
    pub conflict_share: f64,
    /// A pixel is explained when the surfaces are this many epsilons apart at most, 0.1 to 100 (2).
    pub claim_kernel: f32,
    /// Instances of each object that are looked for, at most, 0 to 1000 (1); those after the first are further modes of the
    /// posterior. (The paper finds one, and names that as its limit.)
    pub instances: usize,
    /// A pose that scores less than the best one by more is no alternative to it, 0 to 10 (0.05).
    pub margin: f32,
    /// Poses of the population that are looked at, besides the best, 0 to 100000 (12).
    pub alternatives: usize,
    /// What an overlap of bodies costs, at most, 0 to 10 (0.1).
    pub overlap_weight: f32,
    /// Overlap that is free, metres, 0 to 10 (0.006): of estimates that are a little off, and of simplified meshes;
    pub overlap_free_m: f32,
    /// and that costs the full weight (0.02).
    pub overlap_full_m: f32,
    /// What hanging in the air costs, 0 to 10 (0.03).
    pub afloat_weight: f32,
    /// Farther from the support plane and from all other objects than this is in the air, metres, 0 to 10 (0.015).
    pub afloat_m: f32,
}

impl Default for JointSettings {
    fn default() -> Self {
        Self {
            enabled: true,
            conflict_share: 0.5,
            claim_kernel: 2.0,
            instances: 1,
            margin: 0.05,
            alternatives: 12,
            overlap_weight: 0.1,
            overlap_free_m: 0.006,
            overlap_full_m: 0.020,
            afloat_weight: 0.03,
            afloat_m: 0.015,
        }
    }
}

impl JointSettings {
    /// Each object on its own.
    pub fn off() -> Self {
        Self { enabled: false, ..Self::default() }
    }

    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        within("conflict_share", self.conflict_share, 0.0..=1.0, "")?;
        within("claim_kernel", self.claim_kernel, 0.1..=100.0, "epsilons")?;
        within("instances", self.instances, 0..=1000, "")?;
        within("margin", self.margin, 0.0..=10.0, "")?;
        within("alternatives", self.alternatives, 0..=100_000, "")?;
        within("overlap_weight", self.overlap_weight, 0.0..=10.0, "")?;
        within("overlap_free_m", self.overlap_free_m, 0.0..=10.0, "metres")?;
        within("overlap_full_m", self.overlap_full_m, 0.0..=10.0, "metres")?;
        within("afloat_weight", self.afloat_weight, 0.0..=10.0, "")?;
        within("afloat_m", self.afloat_m, 0.0..=10.0, "metres")
    }
}
