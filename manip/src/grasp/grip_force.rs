//! How firmly to hold an object.

use grip_sim::objects::{Fragility, ObjectInfo};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ranges::Ranges;

/// Standard gravity, m/s^2.
const GRAVITY: f64 = 9.81;

/// Settings of [`grip_force`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GripForceSettings {
    /// What the contacts carry, multiples of the object's weight, 1 to 10. Default 1.3: weight and acceleration.
    pub load: f64,
    /// Safety factor on that, 1 to 100. Default 4.
    pub safety: f64,
    /// Distance of the centre of mass from the pads at which the force is doubled, metres, 0.001 to 1. Default 0.02.
    pub lever_scale: f64,
    /// Least force on a sturdy object, newtons, 0 to 1000. Default 30.
    pub sturdy_least: f64,
    /// Least force on a delicate object, newtons, 0 to 1000. Default 20.
    pub delicate_least: f64,
    /// Least force on a fragile object, newtons, 0 to 1000. Default 10.
    pub fragile_least: f64,
    /// Share of the gripper's largest force that a delicate object bears, 0 to 1. Default 0.7.
    pub delicate_share: f64,
    /// Share of the gripper's largest force that a fragile object bears, 0 to 1. Default 0.4.
    pub fragile_share: f64,
}

impl Default for GripForceSettings {
    fn default() -> Self {
        Self {
            load: 1.3,
            safety: 4.0,
            lever_scale: 0.02,
            sturdy_least: 30.0,
            delicate_least: 20.0,
            fragile_least: 10.0,
            delicate_share: 0.7,
            fragile_share: 0.4,
        }
    }
}

impl GripForceSettings {
    /// What is wrong with a value, if anything: the first field out of its range, its value and the range.
    ///
    /// # Errors
    /// That.
    pub fn validate(&self) -> Result<(), String> {
        Ranges::default()
            .number("load", self.load, 1.0..=10.0, "multiples of the weight")
            .number("safety", self.safety, 1.0..=100.0, "a factor")
            .number("lever_scale", self.lever_scale, 0.001..=1.0, "metres")
            .number("sturdy_least", self.sturdy_least, 0.0..=1000.0, "newtons")
            .number("delicate_least", self.delicate_least, 0.0..=1000.0, "newtons")
            .number("fragile_least", self.fragile_least, 0.0..=1000.0, "newtons")
            .number("delicate_share", self.delicate_share, 0.0..=1.0, "a share")
            .number("fragile_share", self.fragile_share, 0.0..=1.0, "a share")
            .result()
    }
}

/// Force of each finger, newtons: two contacts carry weight and acceleration with a safety factor, more for a centre of mass
/// beside the pads (`lever`, metres), about which it would turn; at most `max_force`, and less for what breaks.
/// `pad_friction` is the pads' coefficient of friction; with the object's own the pair has their mean.
pub fn grip_force(
    info: &ObjectInfo,
    lever: f64,
    pad_friction: f64,
    max_force: f64,
    settings: &GripForceSettings,
) -> f64 {
    let friction = 0.5 * (pad_friction + info.friction);
    let load = settings.load * GRAVITY;
    let need = settings.safety * info.mass_kg * load / (2.0 * friction.max(0.1))
        * (1.0 + lever / settings.lever_scale);
    let (low, high) = match info.fragility {
        Fragility::Sturdy => (settings.sturdy_least, max_force),
        Fragility::Delicate => (settings.delicate_least, settings.delicate_share * max_force),
        Fragility::Fragile => (settings.fragile_least, settings.fragile_share * max_force),
    };
    need.clamp(low, high.max(low))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::box_model;

    fn force(info: &ObjectInfo, lever: f64) -> f64 {
        grip_force(info, lever, 0.9, 60.0, &GripForceSettings::default())
    }

    #[test]
    fn the_grip_carries_the_weight_four_times_over_and_spares_what_breaks() {
        let mut info = box_model("brick", [0.05; 3]).info.clone();
        (info.mass_kg, info.friction, info.fragility) = (1.0, 0.5, Fragility::Sturdy);
        // Mean friction 0.7, two pads: 4 * 1.3 g / (2 * 0.7).
        let force_n = force(&info, 0.0);
        assert!((force_n - 4.0 * 1.3 * 9.81 / 1.4).abs() < 1e-9, "{force_n}");
        assert!((force(&info, 0.01) - 1.5 * force_n).abs() < 1e-9, "a lever of a centimetre");
        assert_eq!(force(&info, 0.1), 60.0);
        info.fragility = Fragility::Fragile;
        assert_eq!(force(&info, 0.1), 24.0);
        info.mass_kg = 0.01;
        assert_eq!(force(&info, 0.0), 10.0);
    }
}
