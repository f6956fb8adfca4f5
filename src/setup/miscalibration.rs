//! What a run's robot does not know of itself, as drawn: where its camera and joints really are.

use grip_sim::condition::Condition;
use grip_sim::pose::{Camera, Pose};
use grip_sim::rng;
use grip_sim::robot::JointKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::cell::Cell;

/// The errors of calibration of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Miscalibration {
    /// From where the camera is believed to be mounted to where it is.
    pub camera: Pose<Camera, Camera>,
    /// What depth is multiplied by.
    pub depth_scale: f64,
    /// How late measurements are, seconds.
    pub latency_s: f64,
    /// How much more than it is each joint reads, radians; empty where none does.
    joints: Vec<f64>,
}

/// How far a trial's robot was off from what it believed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CalibrationRecord {
    /// Of the camera's mounting, metres.
    pub camera_shift_m: f64,
    /// Radians.
    pub camera_turn_rad: f64,
    /// The largest of a joint's encoder, radians.
    pub joint_rad: f64,
    /// What depth was multiplied by.
    pub depth_scale: f64,
    /// How late measurements were, seconds.
    pub latency_s: f64,
}

impl Default for Miscalibration {
    fn default() -> Self {
        Self { camera: Pose::identity(), depth_scale: 1.0, latency_s: 0.0, joints: Vec::new() }
    }
}

impl Miscalibration {
    /// Of the scene's camera and the condition, in a run with `seed`.
    pub(super) fn draw(cell: &Cell, condition: &Condition, seed: u64) -> Self {
        let of_scene = cell.scene.camera.calibration_error.draw(&mut rng::stream(seed, "calibration"));
        let Some(error) = &condition.calibration_error else {
            return Self { camera: of_scene, ..Self::default() };
        };
        let mut random = rng::stream(seed, "calibration error");
        let camera = of_scene * error.camera.draw(&mut random);
        let (depth_scale, latency_s) = (error.depth_scale.draw(&mut random), error.latency.draw(&mut random));
        let config = &cell.config;
        let turning = |joint: &usize| cell.robot.joints()[*joint].kind != JointKind::Prismatic;
        let mut joints = vec![0.0; cell.robot.joints().len()];
        let head = config.head.iter().flat_map(|head| [&head.pan, &head.tilt]);
        for &joint in config.arm.iter().chain(head).filter(|j| turning(j)) {
            joints[joint] = error.joints.draw(&mut random);
        }
        if joints.iter().all(|offset| *offset == 0.0) {
            joints.clear();
        }
        Self { camera, depth_scale, latency_s, joints }
    }

    /// What the encoders say of joints at `q`.
    pub fn measured(&self, q: &[f64]) -> Vec<f64> {
        let mut q = q.to_vec();
        self.joints.iter().zip(&mut q).for_each(|(offset, position)| *position += offset);
        q
    }

    /// Where joints are of which the encoders say `q`.
    pub fn actual(&self, q: &[f64]) -> Vec<f64> {
        let mut q = q.to_vec();
        self.joints.iter().zip(&mut q).for_each(|(offset, position)| *position -= offset);
        q
    }

    /// For a trial's result; none where all is what it is believed to be.
    pub fn record(&self) -> Option<CalibrationRecord> {
        (*self != Self::default()).then(|| CalibrationRecord {
            camera_shift_m: self.camera.translation().norm(),
            camera_turn_rad: self.camera.iso().rotation.angle(),
            joint_rad: self.joints.iter().fold(0.0, |most, offset| most.max(offset.abs())),
            depth_scale: self.depth_scale,
            latency_s: self.latency_s,
        })
    }
}
