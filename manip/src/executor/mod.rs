//! Carries a plan out through a robot port, with what a real Fetch can sense: joints, fingers, forces.
//!
//! A small state machine, one step of the plan after the other. Guarded motions stop on contact; a grasp has missed
//! when the fingers close completely; an object is lost when they close further while it is carried.

mod port;
mod report;
mod run;
mod settings;

pub use port::{ControlTarget, ProtectiveStop, RobotPort};
pub use report::{ExecCause, ExecOutcome, ExecStage, ExecutionReport, Observer, StepReport};
pub use settings::ExecutorSettings;

use crate::motion::Trajectory;
use crate::plan::{Action, PickPlacePlan, PlanStep, StepName};

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
    run::run(port, &plan.steps, settings, observer)
}

/// Carries out steps that are not a whole pick and place, in the same way.
pub fn execute_steps(
    port: &mut impl RobotPort,
    steps: &[PlanStep],
    settings: &ExecutorSettings,
    observer: &mut impl Observer,
) -> ExecutionReport {
    run::run(port, steps, settings, observer)
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
    run::run(port, &[step], settings, observer)
}

/// Opens the gripper a little where it stands, so that nothing is carried about after a failure: the arm is told to stay where
/// it is measured, for [`ExecutorSettings::release_time`].
///
/// The time passes even when the robot stops itself meanwhile, which the report then tells.
pub fn release_in_place(
    port: &mut impl RobotPort,
    settings: &ExecutorSettings,
    observer: &mut impl Observer,
) -> ExecutionReport {
    run::release_in_place(port, settings, observer)
}

#[cfg(test)]
mod tests;
