//! Plans as data: what to do step by step, or why there is no plan.

use grip_sim::pose::{Object, Pose, World};
use serde::{Deserialize, Serialize};

use crate::collision::InTheWay;
use crate::grasp::{Grasp, GraspCounters};
use crate::motion::Trajectory;
use crate::place::PlacePose;

/// What the gripper is told.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GripperCommand {
    /// Opens until the pads are `width` metres apart.
    Open {
        /// Metres between the pads.
        width: f64,
    },
    /// Closes and presses with `force_n` newtons a finger.
    Close {
        /// Newtons a finger.
        force_n: f64,
    },
    /// Keeps doing what it was told last.
    Hold,
}

/// The steps of a pick and place, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StepName {
    /// Open the gripper.
    Open,
    /// Free motion to the pre-grasp pose.
    ToPregrasp,
    /// Straight, slow and guarded to the grasp.
    Approach,
    /// Close on the object.
    Close,
    /// Straight up with the object.
    Lift,
    /// Free motion with the object to above its place.
    Carry,
    /// Straight down, slow and guarded.
    Lower,
    /// Open and let go.
    Release,
    /// Straight away from the object.
    Retreat,
    /// Free motion to the pose for looking.
    Home,
    /// Fast from side to side with the object, to see whether it holds.
    Shake,
    /// Straight and guarded along the table, with closed fingers, against an object.
    Push,
}

/// When a guarded motion stops.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Guard {
    /// Contact force above which it stops, newtons.
    pub force_n: f64,
    /// It counts as arrived when it stops with less than this left to go, metres.
    pub near: f64,
    /// What the gripper has left to go at each point of the trajectory, metres.
    pub left: Vec<f64>,
}

/// What a step does.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Action {
    /// Follows a trajectory.
    Move {
        /// The arm's motion.
        trajectory: Trajectory,
        /// Stops on contact.
        guard: Option<Guard>,
        /// An object is in the hand and must stay there.
        holding: bool,
    },
    /// Moves the fingers.
    Gripper {
        /// What they are told.
        command: GripperCommand,
        /// Expected distance of the pads afterwards, metres.
        width: f64,
    },
}

/// One step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlanStep {
    /// Which one.
    pub name: StepName,
    /// What it does.
    pub action: Action,
}

/// Picks one object and puts it into the bin.
#[derive(Debug, Clone, Serialize)]
pub struct PickPlacePlan {
    /// Index of the object in the belief.
    pub target: usize,
    /// Its name.
    pub object: String,
    /// How it is grasped.
    pub grasp: Grasp,
    /// Where it goes.
    pub place: PlacePose,
    /// Where it is believed to be when it is let go.
    pub world_from_object_released: Pose<World, Object>,
    /// What to do.
    pub steps: Vec<PlanStep>,
    /// Whole configuration after the last step.
    pub end: Vec<f64>,
    /// Work done.
    pub counters: PlanCounters,
}

impl PickPlacePlan {
    /// Where the object is believed to come to rest.
    pub fn world_from_object_placed(&self) -> Pose<World, Object> {
        self.place.world_from_object
    }

    /// Duration of all motions, seconds; the gripper's time comes on top.
    pub fn motion_seconds(&self) -> f64 {
        self.steps
            .iter()
            .map(|step| match &step.action {
                Action::Move { trajectory, .. } => trajectory.duration,
                Action::Gripper { .. } => 0.0,
            })
            .sum()
    }
}

/// How far planning came.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlanStage {
    /// The belief, the target or the configuration is unusable.
    Input,
    /// The robot is in collision where it stands, by belief, and cannot get out.
    StartInCollision,
    /// No antipodal grasp is free.
    NoGrasp,
    /// No free grasp is within reach without collision.
    NoIk,
    /// No grasp that can be reached can be approached straight.
    NoApproach,
    /// No grasp that can be approached can be lifted straight.
    NoLift,
    /// The bin has no room.
    NoPlacePose,
    /// No place can be reached with any grasp.
    NoPlaceIk,
    /// No free path to the grasp.
    NoApproachPath,
    /// No free path from the grasp to the place.
    NoTransitPath,
    /// No free path to the goal of a single motion.
    NoPath,
}

/// Work done while planning; everything but `seconds` repeats with the seed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct PlanCounters {
    /// Candidates and those left after each test.
    pub grasps: GraspCounters,
    /// Grasps whose inverse kinematics was tried.
    pub grasps_tried: usize,
    /// Arms that would have reached one of them, but ran into something.
    pub arms_blocked: InTheWay,
    /// Of the grasps tried, reached without collision.
    pub grasps_reached: usize,
    /// Of those, approached straight.
    pub grasps_approached: usize,
    /// Of those, lifted straight.
    pub grasps_lifted: usize,
    /// Places found by the height map.
    pub places: usize,
    /// Pairs of grasp and place tried.
    pub places_tried: usize,
    /// Of those, reached and lowered to.
    pub places_reached: usize,
    /// Searches in joint space.
    pub searches: usize,
    /// Their extensions.
    pub iterations: usize,
    /// Collision checks of those searches.
    pub checks: usize,
    /// Wall time, seconds.
    pub seconds: f64,
}

/// Why there is no plan.
#[derive(Debug, Clone, PartialEq, Serialize, thiserror::Error)]
#[error("{object}: {reason}")]
pub struct PlanFailure {
    /// How far it came.
    pub stage: PlanStage,
    /// The object's name, or the motion's.
    pub object: String,
    /// In words.
    pub reason: String,
    /// Work done.
    pub counters: Box<PlanCounters>,
}
