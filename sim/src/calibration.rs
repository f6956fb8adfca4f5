//! How far a robot is off from what it believes of itself: errors of calibration, as a condition states them and a run draws them.
//!
//! They are told apart from noise: one draw a run, which no second look averages out.

use nalgebra::{UnitQuaternion, UnitVector3, Vector3};
use rand::{Rng, RngExt};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pose::{Camera, Pose};
use crate::range::{Range, within};

/// How far off the mounting of a camera is from where the robot believes it to be: what a hand-eye calibration leaves. One
/// displacement a run, in any direction, drawn from its seed. The table of a Fetch was seen tilted by 0.07 to 1.1 degrees (0.0012
/// to 0.019 rad) by its own calibration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CameraError {
    /// Of its position, metres.
    pub shift: Range,
    /// Of its orientation, radians.
    pub turn: Range,
}

impl Default for CameraError {
    fn default() -> Self {
        Self { shift: Range::exactly(0.0), turn: Range::exactly(0.0) }
    }
}

impl CameraError {
    /// Whether the camera is where it is believed to be.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// From where the camera is believed to be to where it is.
    pub fn draw(&self, random: &mut impl Rng) -> Pose<Camera, Camera> {
        // Even over the sphere: heights are even (Archimedes).
        let mut direction = || {
            let (z, about) =
                (2.0 * random.random::<f64>() - 1.0, std::f64::consts::TAU * random.random::<f64>());
            let across = (1.0 - z * z).sqrt();
            UnitVector3::new_normalize(Vector3::new(across * about.cos(), across * about.sin(), z))
        };
        let (to, axis) = (direction(), direction());
        let (shift, turn) = (self.shift.draw(random), self.turn.draw(random));
        let rotation = UnitQuaternion::from_axis_angle(&axis, turn);
        Pose::new(nalgebra::Isometry3::from_parts((to.into_inner() * shift).into(), rotation))
    }

    /// What is wrong with it, if anything; `field` is what it is in its file.
    pub(crate) fn problem(&self, field: &str) -> Option<String> {
        ranges_problem(field, [("shift", self.shift, 0.0, 0.1), ("turn", self.turn, 0.0, 0.3)])
    }
}

/// What a robot does not know of itself. Each run draws its own.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CalibrationError {
    /// Of where the head camera is mounted, beside what the scene says of it.
    pub camera: CameraError,
    /// How much more than it is the encoder of each turning joint of arm and head reads, radians; each joint draws its own.
    pub joints: Range,
    /// What depth is multiplied by.
    pub depth_scale: Range,
    /// How late measured joints, fingers and forces are, seconds: a contact is felt that much later.
    pub latency: Range,
}

impl Default for CalibrationError {
    fn default() -> Self {
        Self {
            camera: CameraError::default(),
            joints: Range::exactly(0.0),
            depth_scale: Range::exactly(1.0),
            latency: Range::exactly(0.0),
        }
    }
}

impl CalibrationError {
    /// What is wrong with it, if anything; `field` is what it is in its file.
    pub(crate) fn problem(&self, field: &str) -> Option<String> {
        let ranges = [
            ("joints", self.joints, -0.1, 0.1),
            ("depth_scale", self.depth_scale, 0.8, 1.25),
            ("latency", self.latency, 0.0, 1.0),
        ];
        self.camera.problem(&format!("{field}.camera")).or_else(|| ranges_problem(field, ranges))
    }
}

fn ranges_problem<const N: usize>(
    field: &str,
    ranges: [(&'static str, Range, f64, f64); N],
) -> Option<String> {
    ranges.into_iter().find_map(|(name, range, low, high)| {
        let problem = range.problem().map(|problem| format!("{name} = {problem}"));
        let outside =
            || [range.min, range.max].into_iter().find_map(|end| within(name, end, low, high).err());
        Some(format!("{field}.{}", problem.or_else(outside)?))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_calibration_is_off_by_as_much_as_asked_in_any_direction() {
        let error = CameraError { shift: Range { min: 0.002, max: 0.004 }, turn: Range::exactly(0.01) };
        let mut sum = Vector3::zeros();
        for seed in 0..400 {
            let pose = error.draw(&mut crate::rng::stream(seed, "calibration"));
            let shift = pose.translation();
            assert!((0.002..=0.004).contains(&shift.norm()), "{shift}");
            assert!((pose.iso().rotation.angle() - 0.01).abs() < 1e-9);
            sum += shift.normalize() / 400.0;
        }
        assert!(sum.norm() < 0.15, "{sum}");
        let none = CameraError::default();
        assert!(none.is_none() && none.problem("camera").is_none());
        assert_eq!(
            none.draw(&mut crate::rng::stream(1, "calibration")).iso(),
            Pose::<Camera, Camera>::identity().iso()
        );
    }

    #[test]
    fn errors_beyond_what_a_robot_has_are_refused_by_field() {
        let problem = |text: &str| {
            let error: CalibrationError = toml::from_str(text).unwrap();
            error.problem("calibration_error").unwrap_or_default()
        };
        assert_eq!(problem("joints = { min = -0.01, max = 0.01 }\nlatency = 0.1\ndepth_scale = 1.02"), "");
        assert!(problem("camera = { turn = 1.0 }").starts_with("calibration_error.camera.turn = 1: must be"));
        assert!(problem("joints = 0.5").starts_with("calibration_error.joints = 0.5: must be"));
        assert!(problem("depth_scale = 0.0").starts_with("calibration_error.depth_scale = 0: must be"));
        assert!(problem("latency = { min = 0.2, max = 0.1 }").contains("latency = { min = 0.2, max = 0.1 }"));
    }
}
