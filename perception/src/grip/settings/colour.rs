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
    /// What an agreement with the picture of 1 (see [`ColourVerdict::agreement`](crate::ColourVerdict::agreement)) is worth, in
    /// units of the depth score, 0 to 10 (0.35).
    pub weight: f32,
    /// By how much score and weighted agreement of a pose must be better together than those of the present one, 0 to 1 (0.02).
    pub margin: f32,
    /// Errors of depth at which its score counts for half, metres, over 0 (0.001): what does not average out within a
    /// [window](crate::UncertaintySettings) is 0.1 mm in our own scenes, 0.7 in hard ones.
    pub noise_m: f64,
    /// A pose whose depth score, after polishing, is lower than that of the present one by more is no equal of it, whatever its
    /// print, 0 to 1 (0.1).
    pub depth_margin: f32,
    /// How well the print at a pose must agree with the picture, -1 to 1 (0.1: with noise it does nearly as well).
    pub min_agreement: f32,
    /// Pixels below which nothing is decided, 10 or more (60); an object has 1000 to 4000 at the resolution at
    /// which it is compared.
    pub min_pixels: usize,
    /// The print of an object and its shape, colour and depth image are so many pixels apart at most, 0 to 8 (6).
    pub most_shift_px: f32,
    /// Coarse turns about the axis of a body of revolution, 4 to 360 (24); the best are refined.
    pub revolution_steps: usize,
    /// Poses of the population that are looked at besides the symmetric ones, 0 to 1000 (6): more would be noise of the search.
    pub most_modes: usize,
    /// Two of these are one when they are turned against each other by less, radians, 0 to pi (0.35).
    pub same_mode_rad: f32,
    /// Winners that geometry may refuse before colour gives up, 1 to 1000 (4): each costs a polish.
    pub finalists: usize,
}

impl Default for ColourSettings {
    fn default() -> Self {
        Self {
            enabled: true,
            weight: 0.35,
            margin: 0.02,
            noise_m: 0.001,
            depth_margin: 0.1,
            min_agreement: 0.1,
            min_pixels: 60,
            most_shift_px: 6.0,
            revolution_steps: 24,
            most_modes: 6,
            same_mode_rad: 0.35,
            finalists: 4,
        }
    }
}

impl ColourSettings {
    /// Depth alone.
    pub fn off() -> Self {
        Self { enabled: false, ..Self::default() }
    }

    /// How far differences of the depth score are believed where depth is off by `noise_m`.
    pub(crate) fn trust(&self, noise_m: f64) -> f32 {
        (1.0 / (1.0 + noise_m / self.noise_m)) as f32
    }

    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        within("weight", self.weight, 0.0..=10.0, "")?;
        within("margin", self.margin, 0.0..=1.0, "")?;
        positive("noise_m", self.noise_m)?;
        within("min_agreement", self.min_agreement, -1.0..=1.0, "")?;
        within("depth_margin", self.depth_margin, 0.0..=1.0, "")?;
        within("min_pixels", self.min_pixels, 10..=100_000, "pixels")?;
        within("most_shift_px", self.most_shift_px, 0.0..=8.0, "pixels")?;
        within("revolution_steps", self.revolution_steps, 4..=360, "")?;
        within("most_modes", self.most_modes, 0..=1000, "")?;
        within("same_mode_rad", self.same_mode_rad, 0.0..=std::f32::consts::PI, "radians")?;
        within("finalists", self.finalists, 1..=1000, "")
    }
}
