//! Colour where depth cannot decide.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::checks::{Checked, positive, within};

/// When colour may decide between poses that depth cannot tell apart. Figures in brackets are the defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ColourSettings {
    /// Whether it may (true; the paper: not). Switched off, poses are left as depth has them.
    pub enabled: bool,
    /// A pose whose depth score, after polishing, is lower than the best one's by more is no equal of it, 0 to 1 (0.03: two
    /// restarts that end at one place differ by about this).
    pub depth_margin: f32,
    /// Log-likelihood that a pose must gain, nats a visible point of the surface, over 0 (0.07). Shading and highlights that
    /// the model does not know make 0.05 of plain objects.
    pub min_gain: f32,
    /// How consistent the patches of the image must be in this, over 0 (2); see
    /// [`ColourVerdict::consistency`](crate::ColourVerdict::consistency).
    pub min_consistency: f32,
    /// Visible points below which nothing is decided, 10 or more (100); of the whole surface there are about 4000.
    pub min_points: usize,
    /// Coarse turns about the axis of a body of revolution, 4 to 360 (24); the best are refined.
    pub revolution_steps: usize,
    /// Poses of the population that are looked at besides the symmetric ones, 0 to 1000 (6): more would be noise of the search.
    pub most_modes: usize,
    /// Two of these are one when they are turned against each other by less, radians, 0 to pi (0.35).
    pub same_mode_rad: f32,
    /// Winners that geometry may refuse before colour gives up, 1 to 1000 (4): each costs a polish.
    pub finalists: usize,
    /// Share of the contrast of a winner's print that must be better than none of it, over 0, to 1 (0.3).
    pub faded_contrast: f32,
}

impl Default for ColourSettings {
    fn default() -> Self {
        Self {
            enabled: true,
            depth_margin: 0.03,
            min_gain: 0.07,
            min_consistency: 2.0,
            min_points: 100,
            revolution_steps: 24,
            most_modes: 6,
            same_mode_rad: 0.35,
            finalists: 4,
            faded_contrast: 0.3,
        }
    }
}

impl ColourSettings {
    /// Depth alone.
    pub fn off() -> Self {
        Self { enabled: false, ..Self::default() }
    }

    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        within("depth_margin", self.depth_margin, 0.0..=1.0, "")?;
        positive("min_gain", self.min_gain)?;
        positive("min_consistency", self.min_consistency)?;
        within("min_points", self.min_points, 10..=100_000, "points")?;
        within("revolution_steps", self.revolution_steps, 4..=360, "")?;
        within("most_modes", self.most_modes, 0..=1000, "")?;
        within("same_mode_rad", self.same_mode_rad, 0.0..=std::f32::consts::PI, "radians")?;
        within("finalists", self.finalists, 1..=1000, "")?;
        within("faded_contrast", self.faded_contrast, 1e-3..=1.0, "")
    }
}
