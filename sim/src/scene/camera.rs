//! The head camera, and cameras that look from anywhere around.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::calibration::CameraError;
use crate::camera::Intrinsics;
use crate::pose::{Camera, Pose, World};
use crate::range::Range;

/// The camera that the robot sees by: its own, which a head may point, unless `place` says otherwise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraSetup {
    /// Which of the robot's `[camera.intrinsics.NAME]`, such as `fetch` or `grip-paper`, or a file relative to the scene's: a ROS
    /// calibration (`NAME.yaml`) or BOP's `camera.json`; or numbers; left out, the robot's default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intrinsics: Option<IntrinsicsChoice>,
    /// Where a camera of the scene's own is: fixed in the room or on a link of the robot. Left out, it is the robot's camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<CameraPlace>,
    /// Depth noise preset, such as `carmine-109` or `none`.
    pub depth_noise: String,
    /// How far off the robot believes the camera to be, in trials.
    #[serde(default, skip_serializing_if = "CameraError::is_none")]
    pub calibration_error: CameraError,
    /// Where a camera on a sphere stands, for training data.
    #[serde(default)]
    pub sphere: Sphere,
}

/// Which intrinsics a camera has.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "a name, a file, or { width, height, fx, fy, cx, cy }")]
pub enum IntrinsicsChoice {
    /// A name, or a file.
    Named(String),
    /// As they are.
    Numbers(Intrinsics),
}

impl CameraSetup {
    pub(super) fn problem(&self) -> Option<String> {
        let of_place = || self.place.as_ref().and_then(CameraPlace::problem);
        let wrong = || match self.intrinsics {
            Some(IntrinsicsChoice::Numbers(own)) => Some(format!("camera.intrinsics: {}", own.problem()?)),
            _ => None,
        };
        self.calibration_error
            .problem("camera.calibration_error")
            .or_else(|| self.sphere.problem())
            .or_else(of_place)
            .or_else(wrong)
    }
}

/// A further camera, for data sets: like the scene's but for where it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FurtherCamera {
    /// Its frames are called after it.
    pub name: String,
    /// Where it is.
    pub place: CameraPlace,
}

impl FurtherCamera {
    pub(super) fn problem(&self, others: &[Self]) -> Option<String> {
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '-';
        let Self { name, place } = self;
        if name.is_empty() || !name.chars().all(plain) || others.iter().any(|other| other.name == *name) {
            return Some(format!(
                "cameras.name = \"{name}\": must be of letters, digits and '-', and each camera's own"
            ));
        }
        place.problem().map(|problem| problem.replace("camera.place", &format!("cameras.place of '{name}'")))
    }
}

/// Where a camera is. In the room: `eye` and `target`. On the robot: `link`, and `xyz` and `rpy` in it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CameraPlace {
    /// Where it stands in the room, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub eye: Option<[f64; 3]>,
    /// The point that it looks at from there, metres; upright.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<[f64; 3]>,
    /// The link of the robot that carries it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
    /// Its optical frame (x right, y down, z forward) in that link: origin, metres ...
    #[serde(skip_serializing_if = "Option::is_none")]
    pub xyz: Option<[f64; 3]>,
    /// ... and roll, pitch and yaw as in a URDF, radians.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rpy: Option<[f64; 3]>,
}

impl CameraPlace {
    fn problem(&self) -> Option<String> {
        let Self { eye, target, link, xyz, rpy } = self;
        let sound = [eye, target, xyz, rpy]
            .into_iter()
            .flatten()
            .flatten()
            .all(|value| value.is_finite() && value.abs() <= 20.0);
        if !sound {
            return Some("camera.place: numbers must be from -20 to 20, metres and radians".into());
        }
        match (eye, target, link, xyz, rpy) {
            (Some(eye), Some(target), None, None, None) => {
                let [dx, dy] = [0, 1].map(|axis| target[axis] - eye[axis]);
                (dx.hypot(dy) < 1e-3).then(|| {
                    format!(
                        "camera.place: from eye {eye:?} to target {target:?} is straight up or down, where up in the picture is not \
                         defined; move one aside by a millimetre"
                    )
                })
            }
            (None, None, Some(_), Some(_), Some(_)) => None,
            _ => Some(
                "camera.place: give eye and target for a camera in the room, or link, xyz and rpy for one on the robot".into(),
            ),
        }
    }

    /// World from camera, of one in the room.
    pub fn in_room(&self) -> Option<Pose<World, Camera>> {
        let (eye, target) = (Point3::from(self.eye?), Point3::from(self.target?));
        // The optical frame: z towards the target, y down.
        let rotation = UnitQuaternion::face_towards(&(target - eye), &-Vector3::z());
        Some(Pose::new(Isometry3::from_parts(eye.coords.into(), rotation)))
    }

    /// The link that carries it, and link from camera, of one on the robot.
    pub fn on_robot(&self) -> Option<(&str, Isometry3<f64>)> {
        let [roll, pitch, yaw] = self.rpy?;
        let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let [x, y, z] = self.xyz?;
        Some((self.link.as_deref()?, Isometry3::from_parts(Vector3::new(x, y, z).into(), rotation)))
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
