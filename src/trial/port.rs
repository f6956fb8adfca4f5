//! The robot port over the physics world: the only door through which the executor moves the robot, and the score's
//! window on what happens meanwhile.

use std::cell::RefCell;

use grip_manip::executor::{ControlTarget, Observer, ProtectiveStop, RobotPort, StepReport};
use grip_manip::{GripperCommand, StepName};
use grip_physics::{Grip, STEP_HZ, World};
use nalgebra::Vector3;

use super::film::Film;
use crate::score::{GraspMonitor, JointLog};

/// A world that the port moves and the observer looks at in turn.
pub type SharedWorld<'a> = RefCell<&'a mut World>;

/// Drives the world's robot.
pub struct WorldPort<'a, 'w> {
    world: &'a SharedWorld<'w>,
    /// What the gripper was told last, for [`GripperCommand::Hold`].
    grip: Grip,
}

impl<'a, 'w> WorldPort<'a, 'w> {
    /// A port; a protective stop of before is cleared, as an operator would.
    pub fn new(world: &'a SharedWorld<'w>) -> Self {
        let grip = {
            let mut world = world.borrow_mut();
            world.clear_stop();
            world.hold().1
        };
        Self { world, grip }
    }
}

impl RobotPort for WorldPort<'_, '_> {
    fn time(&self) -> f64 {
        self.world.borrow().time()
    }

    fn period(&self) -> f64 {
        1.0 / f64::from(STEP_HZ)
    }

    fn joints(&self) -> Vec<f64> {
        self.world.borrow().joints().to_vec()
    }

    fn fingers(&self) -> [f64; 2] {
        self.world.borrow().finger_positions()
    }

    fn grip_force(&self) -> f64 {
        self.world.borrow().grip_force()
    }

    fn hand_force(&self) -> Vector3<f64> {
        self.world.borrow().hand_force()
    }

    fn link_force(&self) -> f64 {
        self.world.borrow().link_force()
    }

    fn step(&mut self, target: &ControlTarget<'_>) -> Result<(), ProtectiveStop> {
        self.grip = match target.gripper {
            GripperCommand::Open { width } => Grip::Open { width },
            GripperCommand::Close { force_n } => Grip::Close { force_n },
            GripperCommand::Hold => self.grip,
        };
        let mut world = self.world.borrow_mut();
        world.step(target.joints, self.grip);
        match world.stop() {
            Some(stop) => Err(ProtectiveStop { reason: stop.to_string() }),
            None => Ok(()),
        }
    }
}

/// Looks at the world after every control period: for the score, and to check the motion afterwards.
pub struct TrialObserver<'a, 'w, 'f> {
    /// The world.
    pub world: &'a SharedWorld<'w>,
    /// Follows an attempt at an object.
    pub monitor: Option<GraspMonitor>,
    /// Where the joints were.
    pub joints: &'a mut JointLog,
    /// The camera outside.
    pub film: &'a mut Film<'f>,
}

impl Observer for TrialObserver<'_, '_, '_> {
    fn tick(&mut self, step: StepName, time: f64) {
        let world = self.world.borrow();
        self.joints.push(time, world.joints());
        self.film.tick(&world);
        let Some(monitor) = &mut self.monitor else { return };
        match step {
            StepName::Close | StepName::Lift | StepName::Carry | StepName::Shake => monitor.step(&world),
            StepName::Release | StepName::Retreat => monitor.falling(&world),
            _ => {}
        }
    }

    fn step_done(&mut self, report: &StepReport) {
        self.film.step_done(&self.world.borrow(), report.name);
        let Some(monitor) = &mut self.monitor else { return };
        match report.name {
            StepName::Close => monitor.closed(&self.world.borrow()),
            // Where there is a shake, its last motion counts.
            StepName::Carry | StepName::Shake => monitor.carried(),
            StepName::Lower => monitor.lowered(&self.world.borrow()),
            _ => {}
        }
    }
}
