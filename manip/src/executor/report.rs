//! What became of an execution, and who sees it happen.

use serde::{Deserialize, Serialize};

use crate::plan::StepName;

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
            StepName::Open | StepName::ToPregrasp | StepName::Approach | StepName::Push => Self::Approach,
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
