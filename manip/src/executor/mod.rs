//! Carries a plan out through a robot port, with what a real Fetch can sense: joints, fingers, forces.
//!
//! A small state machine, one step of the plan after the other. Guarded motions stop on contact; a grasp has missed
//! when the fingers close completely; an object is lost when they close further while it is carried.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::plan::{Action, PickPlacePlan, PlanStep, StepName};
use crate::timing::Trajectory;

mod run;

pub use crate::plan::GripperCommand;
use run::run;

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

/// Settings of [`execute`].
#[derive(Debug, Clone, PartialEq)]
pub struct ExecutorSettings {
    /// Contact force that stops a free motion, newtons beside what was felt at its start. Default 60.
    pub free_force: f64,
    /// Control periods in a row for which a force must last to stop a motion. Default 2.
    pub force_periods: u32,
    /// Longest wait for the joints to arrive after a motion, seconds. Default 0.6.
    pub settle: f64,
    /// Joints this near to their target have arrived, radians or metres. Default 0.005.
    pub arrived: f64,
    /// Joints farther than this from their target after the wait have failed, radians or metres. Default 0.05.
    pub lost: f64,
    /// Longest wait for the fingers, seconds. Default 3.0.
    pub grip_timeout: f64,
    /// The fingers stand still when they move less than this in 0.1 s, metres. Default 0.0002.
    pub still: f64,
    /// Fingers closer together than this share of the expected width have missed. Default 0.3.
    pub miss_share: f64,
    /// ... or than this, metres. Default 0.001.
    pub miss_width: f64,
    /// Change of the width while carrying that counts as lost, metres. Default 0.010.
    pub slip_limit: f64,
    /// A lowering motion that meets something with less than this left lets go there, metres. Default 0.1: on what
    /// stands in its way in the bin, rather than to carry it about. The hand then draws back the way it came.
    pub early_release: f64,
    /// Share of the planned speed when backing off. Default 0.5.
    pub back_off: f64,
    /// Most of a guarded motion that is taken back to relieve a contact, seconds of the plan. Default 0.3.
    pub relief: f64,
}

impl Default for ExecutorSettings {
    fn default() -> Self {
        Self {
            free_force: 60.0,
            force_periods: 2,
            settle: 0.6,
            arrived: 0.005,
            lost: 0.05,
            grip_timeout: 3.0,
            still: 0.0002,
            miss_share: 0.3,
            miss_width: 0.001,
            slip_limit: 0.010,
            early_release: 0.1,
            back_off: 0.5,
            relief: 0.3,
        }
    }
}

/// Where an execution failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ExecStage {
    /// On the way to the object.
    Approach,
    /// Closing on it.
    Grasp,
    /// Lifting it.
    Lift,
    /// Carrying it to the bin.
    Carry,
    /// Lowering it, letting go, or drawing back.
    Place,
}

impl From<StepName> for ExecStage {
    fn from(name: StepName) -> Self {
        match name {
            StepName::Open | StepName::ToPregrasp | StepName::Approach => Self::Approach,
            StepName::Close => Self::Grasp,
            StepName::Lift => Self::Lift,
            StepName::Carry | StepName::Shake | StepName::Home => Self::Carry,
            StepName::Lower | StepName::Release | StepName::Retreat => Self::Place,
        }
    }
}

/// What an execution failed of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ExecCause {
    /// The arm, the hand or what it holds met something, or the robot stopped itself.
    Contact,
    /// The fingers closed on nothing.
    Missed,
    /// What was held is no longer in the hand.
    Lost,
    /// The joints are not where they should be.
    Astray,
}

/// How an execution ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ExecOutcome {
    /// All steps are done, as far as the robot can tell.
    Done,
    /// A step failed.
    Failed {
        /// Where.
        stage: ExecStage,
        /// What of.
        cause: ExecCause,
        /// In words.
        reason: String,
    },
}

/// One step as it went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepReport {
    /// Which one.
    pub name: StepName,
    /// Beginning, seconds of the port's time.
    pub begin_s: f64,
    /// End, seconds of the port's time.
    pub end_s: f64,
    /// Largest force felt beside what was felt when it began, newtons.
    pub peak_contact_n: f64,
    /// The motion stopped on contact before its end.
    pub stopped_early: bool,
}

/// What happened, as the robot itself could tell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExecutionReport {
    /// The steps begun, in order.
    pub steps: Vec<StepReport>,
    /// How it ended.
    pub outcome: ExecOutcome,
    /// Distance of the pads after closing, metres.
    pub grasp_width_m: Option<f64>,
    /// Largest change of that distance while the object was held, metres.
    pub slip_m: f64,
    /// Largest contact force of all steps, newtons.
    pub peak_contact_n: f64,
    /// Largest force of the finger drives, newtons.
    pub peak_grip_n: f64,
}

impl ExecutionReport {
    /// Stage, cause and reason when it failed.
    pub fn failure(&self) -> Option<(ExecStage, ExecCause, &str)> {
        match &self.outcome {
            ExecOutcome::Done => None,
            ExecOutcome::Failed { stage, cause, reason } => Some((*stage, *cause, reason)),
        }
    }

    /// From the first step's beginning to the last one's end, seconds.
    pub fn seconds(&self) -> f64 {
        match (self.steps.first(), self.steps.last()) {
            (Some(first), Some(last)) => last.end_s - first.begin_s,
            _ => 0.0,
        }
    }
}

/// Sees every control period of an execution.
pub trait Observer {
    /// Called after each period with the step and the port's time.
    fn tick(&mut self, _step: StepName, _time: f64) {}
    /// Called after each step.
    fn step_done(&mut self, _report: &StepReport) {}
}

impl Observer for () {}

/// Carries out a pick and place.
///
/// When it fails on the way to the object or at the grasp the gripper opens and draws back the way it came; when an
/// object is lost the robot stands where it is. Either way the report tells, and the caller plans the way home.
pub fn execute(
    port: &mut impl RobotPort,
    plan: &PickPlacePlan,
    settings: &ExecutorSettings,
    observer: &mut impl Observer,
) -> ExecutionReport {
    run(port, &plan.steps, settings, observer)
}

/// Carries out steps that are not a whole pick and place, in the same way.
pub fn execute_steps(
    port: &mut impl RobotPort,
    steps: &[PlanStep],
    settings: &ExecutorSettings,
    observer: &mut impl Observer,
) -> ExecutionReport {
    run(port, steps, settings, observer)
}

/// Carries out a single free motion, such as the one home, with the gripper as it is.
pub fn execute_motion(
    port: &mut impl RobotPort,
    trajectory: &Trajectory,
    settings: &ExecutorSettings,
    observer: &mut impl Observer,
) -> ExecutionReport {
    let step = PlanStep {
        name: StepName::Home,
        action: Action::Move { trajectory: trajectory.clone(), guard: None, holding: false },
    };
    run(port, &[step], settings, observer)
}

#[cfg(test)]
mod tests;
