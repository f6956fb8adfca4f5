//! The robot port: what the executor tells a robot, and what a real Fetch can sense.

use nalgebra::Vector3;

use crate::plan::GripperCommand;

/// What the robot is told for one control period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlTarget<'a> {
    /// Positions of all movable joints in the model's order, radians or metres. Those of the fingers are to be ignored:
    /// the gripper's command rules them.
    pub joints: &'a [f64],
    /// What the gripper does.
    pub gripper: GripperCommand,
}

/// The robot refuses to move on: too much force, or too far behind its target.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("protective stop: {reason}")]
pub struct ProtectiveStop {
    /// Why.
    pub reason: String,
}

/// A robot, simulated or real, that follows joint targets.
pub trait RobotPort {
    /// Time, seconds.
    fn time(&self) -> f64;
    /// Length of a control period, seconds.
    fn period(&self) -> f64 {
        1.0 / 240.0
    }
    /// Measured positions of all movable joints, in the model's order.
    fn joints(&self) -> Vec<f64>;
    /// Measured positions of the fingers (right, left), metres; 0 is closed, the pads' distance is their sum.
    fn fingers(&self) -> [f64; 2];
    /// Force with which the finger drives press, newtons a finger.
    fn grip_force(&self) -> f64;
    /// Net external force on the hand, newtons, world frame, as joint torque sensing gives: what the fingers press against
    /// each other or an object between them cancels, the weight of what they hold does not.
    fn hand_force(&self) -> Vector3<f64>;
    /// Largest external force on any other link, newtons.
    fn link_force(&self) -> f64;
    /// Goes on for one control period.
    ///
    /// # Errors
    /// When the robot has stopped itself.
    fn step(&mut self, target: &ControlTarget<'_>) -> Result<(), ProtectiveStop>;
}
