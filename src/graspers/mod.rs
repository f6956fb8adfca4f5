//! Who plans grasps in a trial: `grip` itself, from the shape of the objects, or a program of anyone.
//!
//! A grasp planner of others is a [`GraspPlanner`]: it is handed what the camera saw, and what was estimated from it if it wants to know
//! ([`GraspQuestion`]). Where the gripper goes is what it says, and nothing else: there is no other grasp where its own lead to no plan.

mod external;
pub mod protocol;
// Their planners are shell scripts.
#[cfg(test)]
#[cfg(unix)]
mod tests;

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use anyhow::Result;
use grip_manip::place::PlaceWish;
use grip_sim::frame::CameraFrame;
use grip_sim::images::LabelImage;
use grip_sim::pose::{Camera, Gripper, Object, Pose};
use serde_json::{Value, json};

pub use self::external::{External, checked};
pub use self::protocol::Want;
use crate::external::{CommandLine, Given, named_command};
use crate::setup::Setup;

/// The name of our own.
pub const GRIP: &str = "grip";

/// What a grasp planner of others did wrong: the end of a trial, and no fault of ours.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GrasperFailed(pub String);

impl fmt::Display for GrasperFailed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for GrasperFailed {}

/// An object on the table.
#[derive(Debug, Clone)]
pub struct Target {
    /// Its position in the trial's list.
    pub index: usize,
    /// Its number in BOP's data sets.
    pub obj_id: u32,
    /// Whether it is to be picked.
    pub wanted: bool,
    /// Where it is believed to be; none without confidence.
    pub pose: Option<Pose<Camera, Object>>,
}

/// What a grasp planner is told of one look of the robot.
pub struct GraspQuestion<'a> {
    /// What the camera saw, and where it was by the joints' encoders.
    pub frame: &'a CameraFrame,
    /// The number of the look, from 0 on.
    pub look: usize,
    /// What is on the table.
    pub targets: &'a [Target],
    /// Where each of them should be seen by its believed pose, 1 + `index`; none where nobody wants it.
    pub segmentation: Option<&'a LabelImage>,
    /// The trial's seed.
    pub seed: u64,
}

/// A grasp by someone else.
#[derive(Debug, Clone, PartialEq)]
pub struct ForeignGrasp {
    /// The gripper: origin in the middle between the pads, x out along the fingers, y along the closing direction.
    pub camera_from_gripper: Pose<Camera, Gripper>,
    /// How far the fingers open for it, metres; as far as there is room where nothing is said.
    pub width: Option<f64>,
    /// Larger is better.
    pub score: f64,
    /// The object that it is meant for ([`Target::index`]); the one that is believed to be between the fingers where nothing is said.
    pub index: Option<usize>,
    /// Where the object is to be put; our planner's choice where nothing is said.
    pub place: Option<PlaceWish>,
}

/// Plans grasps from what the camera saw.
pub trait GraspPlanner: Send + Sync + fmt::Debug {
    /// What it wants to know beside the frame.
    fn wants(&self) -> &[Want];

    /// Grasps, in any order.
    ///
    /// # Errors
    /// [`GrasperFailed`] ends the trial and no more; any other error ends everything.
    fn grasps(&self, question: &GraspQuestion<'_>) -> Result<Vec<ForeignGrasp>>;

    /// For scenario.json: what its grasps depend on.
    fn description(&self) -> Value;
}

/// Who says how to grip.
#[derive(Debug, Clone, Default)]
pub enum Grasper {
    /// The planner's own grasps of each object's shape.
    #[default]
    Grip,
    /// Someone else.
    Other {
        /// As in outputs.
        name: String,
        /// Who.
        planner: Arc<dyn GraspPlanner>,
    },
}

impl Grasper {
    /// Opens what `kind` names, for the cell and settings of `setup`.
    ///
    /// # Errors
    /// When a program does not greet.
    pub fn open(setup: &Setup, kind: &GrasperKind) -> Result<Self> {
        Ok(match kind {
            GrasperKind::Grip => Self::Grip,
            GrasperKind::Command { command, .. } => {
                Self::Other { name: kind.name(), planner: Arc::new(External::open(setup, command)?) }
            }
            GrasperKind::Given(given) => Self::Other { name: kind.name(), planner: given.who.clone() },
        })
    }

    /// As in outputs.
    pub fn name(&self) -> &str {
        match self {
            Self::Grip => GRIP,
            Self::Other { name, .. } => name,
        }
    }

    /// For scenario.json.
    pub fn description(&self) -> Value {
        match self {
            Self::Grip => json!({ "name": GRIP }),
            Self::Other { planner, .. } => planner.description(),
        }
    }
}

/// Names a grasp planner of a trial: `grip`, or `cmd:PROGRAM ARGUMENTS`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum GrasperKind {
    /// Our own.
    #[default]
    Grip,
    /// A program that is asked after each look.
    Command {
        /// As in outputs, where one is given.
        name: Option<String>,
        /// What is run.
        command: CommandLine,
    },
    /// Someone in this process; the command line has no word for it.
    Given(Given<dyn GraspPlanner>),
}

impl GrasperKind {
    /// As in outputs: of a program the name given or that of its script.
    pub fn name(&self) -> String {
        match self {
            Self::Grip => GRIP.into(),
            Self::Command { name, command } => name.clone().unwrap_or_else(|| command.name()),
            Self::Given(given) => given.name.clone(),
        }
    }
}

impl FromStr for GrasperKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some((name, command)) = named_command(text, &[GRIP])? {
            return Ok(Self::Command { name, command });
        }
        match text {
            GRIP => Ok(Self::Grip),
            _ => Err("give grip, or cmd: and a program with its arguments".into()),
        }
    }
}
