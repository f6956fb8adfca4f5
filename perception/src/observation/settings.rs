//! How a frame is prepared for the filters.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::checks::{Checked, part, within};
use crate::support::SupportSettings;

/// Settings of [`super::Observation`]. Figures in brackets are the defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ObservationSettings {
    /// A rendered point this far from the observed one is no inlier, metres, 0.0001 to 0.1 (0.007; the paper: 0.005). On
    /// synthetic depth 0.005 is best by a little; real depth is off by up to 8 mm at the true pose, and 0.008 is best there.
    pub epsilon_m: f64,
    /// Points lower than 0.4 times this over the support plane explain nothing, those higher than 1.4 times fully, metres,
    /// 0.0001 to 0.1 (0.003: the noise of the plane).
    pub plane_band_m: f64,
    /// Depth jumps larger than this between neighbouring readings are edges, metres, 0.0001 to 1 (0.010: thrice the noise at
    /// 1 m).
    pub edge_jump_m: f64,
    /// Standard deviation of the distance from a silhouette to a depth edge, pixels of the level's resolution, 0.1 to 100
    /// (1.5).
    pub edge_sigma_px: f64,
    /// Depth edges are looked for across holes of up to this many pixels, 1 to 1000 (12: the projector's shadow of a near
    /// object).
    pub edge_reach_px: usize,
    /// A wide hole may hide a slope: each pixel of it adds this to the jump that makes an edge, metres, 0 to 1 (0.002).
    pub edge_slope_m: f32,
    /// Readings of a block of pixels that are farther from each other belong to two surfaces, metres, 0.0001 to 1 (0.015).
    pub block_spread_m: f32,
    /// How the support plane is found; switched off, all points may be an object's.
    pub support: SupportSettings,
}

impl Default for ObservationSettings {
    fn default() -> Self {
        Self {
            epsilon_m: 0.007,
            plane_band_m: 0.003,
            edge_jump_m: 0.010,
            edge_sigma_px: 1.5,
            edge_reach_px: 12,
            edge_slope_m: 0.002,
            block_spread_m: 0.015,
            support: SupportSettings::default(),
        }
    }
}

impl ObservationSettings {
    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        within("epsilon_m", self.epsilon_m, 1e-4..=0.1, "metres")?;
        within("plane_band_m", self.plane_band_m, 1e-4..=0.1, "metres")?;
        within("edge_jump_m", self.edge_jump_m, 1e-4..=1.0, "metres")?;
        within("edge_sigma_px", self.edge_sigma_px, 0.1..=100.0, "pixels")?;
        within("edge_reach_px", self.edge_reach_px, 1..=1000, "pixels")?;
        within("edge_slope_m", self.edge_slope_m, 0.0..=1.0, "metres")?;
        within("block_spread_m", self.block_spread_m, 1e-4..=1.0, "metres")?;
        part("support", self.support.validate())
    }
}
