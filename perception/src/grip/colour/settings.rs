//! Settings of the colour step.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// When colour may decide between poses that depth cannot tell apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ColourSettings {
    /// A pose whose depth score, after polishing, is lower than the best one's by more is no equal of it. Two restarts
    /// that end at one place differ by about this.
    pub depth_margin: f32,
    /// Log-likelihood that a pose must gain, nats a visible point of the surface. Shading and highlights that the model does
    /// not know make 0.05 of plain objects.
    pub min_gain: f32,
    /// How consistent the patches of the image must be in this; see [`super::ColourVerdict::consistency`].
    pub min_consistency: f32,
    /// Visible points below which nothing is decided; of the whole surface there are about 4000.
    pub min_points: usize,
    /// Coarse turns about the axis of a body of revolution; the best are refined.
    pub revolution_steps: usize,
}

impl Default for ColourSettings {
    fn default() -> Self {
        Self {
            depth_margin: 0.03,
            min_gain: 0.07,
            min_consistency: 2.0,
            min_points: 100,
            revolution_steps: 24,
        }
    }
}

impl ColourSettings {
    /// Refuses values that decide nothing sensible.
    pub(crate) fn check(&self) -> Result<()> {
        let bad = |name, value: String, message: &str| {
            Err(Error::Setting { name, value, message: message.to_owned() })
        };
        if !(0.0..=1.0).contains(&self.depth_margin) {
            return bad("colour.depth_margin", self.depth_margin.to_string(), "0 to 1; try 0.03");
        }
        for (name, value) in
            [("colour.min_gain", self.min_gain), ("colour.min_consistency", self.min_consistency)]
        {
            if !(value > 0.0 && value.is_finite()) {
                return bad(name, value.to_string(), "must be positive and finite");
            }
        }
        if self.min_points < 10 {
            return bad("colour.min_points", self.min_points.to_string(), "at least 10; try 100");
        }
        if !(4..=360).contains(&self.revolution_steps) {
            return bad("colour.revolution_steps", self.revolution_steps.to_string(), "4 to 360; try 24");
        }
        Ok(())
    }
}
