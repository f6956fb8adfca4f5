//! The robot port over the physics world: the only door through which the executor moves the robot.

use grip_manip::executor::{ControlTarget, GripperCommand, ProtectiveStop, RobotPort};
use grip_sim::physics::{Grip, STEP_HZ, World};

use crate::score::Watch;

/// Drives the world and lets the score watch.
pub struct WorldPort<'a> {
    /// The world.
    pub world: &'a mut World,
    /// Who watches the attempt; `None` on the way to a look.
    pub watch: Option<&'a mut Watch>,
}
