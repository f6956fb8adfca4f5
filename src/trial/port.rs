//! The robot port over the physics world: the only door through which the executor moves the robot, and the score's
//! window on what happens meanwhile.

use std::cell::RefCell;
use std::collections::VecDeque;

use grip_manip::executor::{ControlTarget, Observer, ProtectiveStop, RobotPort, StepReport};
use grip_manip::{GripperCommand, StepName};
use grip_physics::{Grip, STEP_HZ, World};
use nalgebra::Vector3;

use super::film::Film;
use crate::record::Recorder;
use crate::score::{GraspMonitor, JointLog};
use crate::setup::Miscalibration;

/// A world that the port moves and the observer looks at in turn.
pub type SharedWorld<'a> = RefCell<&'a mut World>;

/// Drives the world's robot, which is not all that it believes to be.
pub struct WorldPort<'a, 'w> {
    world: &'a SharedWorld<'w>,
    miscalibration: &'a Miscalibration,
    /// What was measured, the oldest first, which is what is known now.
    measured: VecDeque<Measured>,
    /// What the gripper was told last, for [`GripperCommand::Hold`].
    grip: Grip,
}

/// What a robot measures at a moment.
struct Measured {
    joints: Vec<f64>,
    fingers: [f64; 2],
    grip_force: f64,
    hand_force: Vector3<f64>,
    link_force: f64,
}

impl Measured {
    fn now(world: &World, miscalibration: &Miscalibration) -> Self {
        Self {
            joints: miscalibration.measured(world.joints()),
            fingers: world.finger_positions(),
            grip_force: world.grip_force(),
            hand_force: world.hand_force(),
            link_force: world.link_force(),
        }
    }
}

impl<'a, 'w> WorldPort<'a, 'w> {
    /// A port; a protective stop of before is cleared, as an operator would.
    pub fn new(world: &'a SharedWorld<'w>, miscalibration: &'a Miscalibration) -> Self {
        let grip = {
            let mut world = world.borrow_mut();
            world.clear_stop();
            world.hold().1
        };
        let measured = VecDeque::from([Measured::now(&world.borrow(), miscalibration)]);
        Self { world, miscalibration, measured, grip }
    }

    fn measured(&self) -> &Measured {
        // There is one from the beginning on.
        &self.measured[0]
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
        self.measured().joints.clone()
    }

    fn fingers(&self) -> [f64; 2] {
        self.measured().fingers
    }

    fn grip_force(&self) -> f64 {
        self.measured().grip_force
    }

    fn hand_force(&self) -> Vector3<f64> {
        self.measured().hand_force
    }

    fn link_force(&self) -> f64 {
        self.measured().link_force
    }

    fn step(&mut self, target: &ControlTarget<'_>) -> Result<(), ProtectiveStop> {
        self.grip = match target.gripper {
            GripperCommand::Open { width } => Grip::Open { width },
            GripperCommand::Close { force_n } => Grip::Close { force_n },
            GripperCommand::Hold => self.grip,
        };
        let mut world = self.world.borrow_mut();
        world.step(&self.miscalibration.actual(target.joints), self.grip);
        self.measured.push_back(Measured::now(&world, self.miscalibration));
        let periods = (self.miscalibration.latency_s * f64::from(STEP_HZ)).round() as usize;
        while self.measured.len() > periods + 1 {
            self.measured.pop_front();
        }
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
    /// Takes down what happens.
    pub recorder: &'a mut Recorder,
}

impl Observer for TrialObserver<'_, '_, '_> {
    fn tick(&mut self, step: StepName, time: f64) {
        let world = self.world.borrow();
        self.joints.push(time, world.joints());
        self.film.tick(&world);
        self.recorder.tick(&world, step, self.monitor.as_ref());
        let Some(monitor) = &mut self.monitor else { return };
        match step {
            StepName::Close | StepName::Lift | StepName::Carry | StepName::Shake => monitor.step(&world),
            StepName::Release | StepName::Retreat => monitor.falling(&world),
            _ => {}
        }
    }

    fn step_done(&mut self, report: &StepReport) {
        self.film.step_done(&self.world.borrow(), report.name);
        self.recorder.step_done(report);
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
