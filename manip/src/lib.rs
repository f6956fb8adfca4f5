//! Belief scene, grasp and place planning, inverse kinematics, motion planning, timing and execution.
//!
//! | module | what it holds |
//! |---|---|
//! | [`belief`] | what the planner knows: fixtures, bin, estimated objects, base |
//! | [`seen`] | depth readings that nothing believed explains, as obstacles |
//! | [`collision`], [`edge`] | collision checks of configurations and motions |
//! | [`space`], [`rrt`] | joint spaces, RRT-Connect and shortcutting |
//! | [`ik`], [`cartesian`] | inverse kinematics with many seeds, straight motions of the gripper |
//! | [`smooth`], [`timing`] | rounded corners and time-optimal timing within limits |
//! | [`surface`], [`antipodal`], [`grasp`], [`expected`] | grasps of an object, their ranking in a scene and over a posterior |
//! | [`grasp_set`] | grasps as files |
//! | [`stable`], [`heightmap`], [`place`] | how an object can stand, and where to put it in the bin |
//! | [`settings`], [`plan`], [`planner`], [`pick`] | the planner, and its plans as data |
//! | [`grasp_test`] | a grasp on its own, for experiments |
//! | [`executor`] | carries plans out through a robot port |
//! | [`moveit`], [`solve`] | motion planning problems of others, and how they are solved |
//! | [`reach`] | how well a table, a bin and a robot's place suit each other |
//!
//! Nothing here knows the truth: a plan depends on a [`BeliefScene`] and on measured joints alone.

pub mod antipodal;
pub mod belief;
pub mod cartesian;
pub mod collision;
pub mod edge;
pub mod executor;
pub mod expected;
pub mod grasp;
pub mod grasp_set;
pub mod grasp_test;
pub mod heightmap;
pub mod ik;
pub mod moveit;
pub mod pick;
pub mod place;
pub mod plan;
pub mod planner;
pub mod reach;
pub mod rrt;
pub mod seen;
pub mod settings;
pub mod smooth;
pub mod solve;
pub mod space;
pub mod stable;
pub mod surface;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
pub mod timing;

pub use belief::{BeliefScene, BelievedObject, BinGeometry};
pub use executor::{
    ExecOutcome, ExecStage, ExecutionReport, ExecutorSettings, RobotPort, execute, execute_motion,
};
pub use grasp::{Grasp, GraspAt};
pub use pick::{Care, pick_order};
pub use place::PlacePose;
pub use plan::{
    Action, GripperCommand, PickPlacePlan, PlanCounters, PlanFailure, PlanStage, PlanStep, StepName,
};
pub use planner::Planner;
pub use settings::PlannerSettings;
pub use timing::Trajectory;
