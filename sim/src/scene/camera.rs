//! The head camera, and cameras that look from anywhere around.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::calibration::CameraError;
use crate::pose::{Camera, Pose, World};
use crate::range::Range;

/// The head camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraSetup {
    /// Which of the robot's `[camera.intrinsics.NAME]`, such as `fetch` or `grip-paper`, or a file relative to the scene's: a ROS
    /// calibration (`NAME.yaml`) or BOP's `camera.json`; left out, the robot's default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intrinsics: Option<String>,
    /// Depth noise preset, such as `carmine-109` or `none`.
    pub depth_noise: String,
    /// How far off the robot believes the camera to be, in trials.
    #[serde(default, skip_serializing_if = "CameraError::is_none")]
    pub calibration_error: CameraError,
    /// Where a camera on a sphere stands, for training data.
    #[serde(default)]
    pub sphere: Sphere,
}

impl CameraSetup {
    pub(super) fn problem(&self) -> Option<String> {
        self.calibration_error.problem("camera.calibration_error").or_else(|| self.sphere.problem())
    }
}

/// What is wrong with a range that must lie within others, if anything.
fn outside(range: Range, low: f64, high: f64) -> Option<String> {
    range.problem().or_else(|| {
        (range.min < low || range.max > high)
            .then(|| format!("{{ min = {}, max = {} }}: must be from {low} to {high}", range.min, range.max))
    })
}

/// A camera that looks from anywhere around at the middle of the objects' region.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Sphere {
    /// From that point, metres.
    pub distance: Range,
    /// Above the horizon, radians.
    pub elevation: Range,
    /// About the vertical from the world's -x axis, radians: 0 stands where the robot stands.
    pub azimuth: Range,
    /// How far off that point it looks, along each axis, metres.
    pub aim: Range,
}

impl Default for Sphere {
    fn default() -> Self {
        use std::f64::consts::PI;
        Self {
            distance: Range { min: 0.5, max: 1.1 },
            elevation: Range { min: 0.45, max: 1.35 },
            azimuth: Range { min: -PI, max: PI },
            aim: Range { min: -0.06, max: 0.06 },
        }
    }
}

impl Sphere {
    fn problem(&self) -> Option<String> {
        let limits = [
            ("distance", self.distance, 0.1, 10.0),
            // From straight above the picture's up is not defined.
            ("elevation", self.elevation, -1.5, 1.5),
            ("azimuth", self.azimuth, -7.0, 7.0),
            ("aim", self.aim, -5.0, 5.0),
        ];
        limits.into_iter().find_map(|(field, range, low, high)| {
            Some(format!("camera.sphere.{field} = {}", outside(range, low, high)?))
        })
    }

    /// World from camera, looking at `center`, upright.
    pub fn draw(&self, center: &Point3<f64>, random: &mut impl Rng) -> Pose<World, Camera> {
        let [distance, elevation, azimuth] =
            [self.distance, self.elevation, self.azimuth].map(|range| range.draw(random));
        let target = center + Vector3::from([0, 1, 2].map(|_: usize| self.aim.draw(random)));
        let away =
            Vector3::new(-elevation.cos() * azimuth.cos(), -elevation.cos() * azimuth.sin(), elevation.sin());
        // The optical frame: z towards the target, y down.
        let rotation = UnitQuaternion::face_towards(&-away, &-Vector3::z());
        Pose::new(Isometry3::from_parts((target + away * distance).coords.into(), rotation))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_on_the_sphere_looks_at_the_objects() {
        let center = Point3::new(0.6, 0.1, 0.7);
        let sphere = Sphere { aim: Range::exactly(0.0), ..Sphere::default() };
        for seed in 0..50 {
            let camera = sphere.draw(&center, &mut crate::rng::stream(seed, "camera"));
            let seen = camera.inverse().transform_point(&center);
            assert!(seen.x.abs() < 1e-9 && seen.y.abs() < 1e-9 && (0.5..=1.1).contains(&seen.z), "{seen}");
            // Upright: what is higher in the world is higher in the picture, and the x axis is level.
            assert!(camera.inverse().transform_vector(&Vector3::z()).y < 0.0);
            assert!(camera.transform_vector(&Vector3::x()).z.abs() < 1e-9);
            assert!(camera.translation().z > 0.7);
        }
        let at_robot = Sphere { azimuth: Range::exactly(0.0), ..sphere };
        assert!(at_robot.draw(&center, &mut crate::rng::stream(1, "camera")).translation().x < 0.6);
    }
}
