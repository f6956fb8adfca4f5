//! Plans and carries out picks and places of a robot arm with a parallel gripper, from estimated poses.
//!
//! Nothing here knows the truth: a plan depends on a [`BeliefScene`] (what perception said, and table, bin and base, which
//! were measured once) and on measured joints alone. Metres, radians, seconds, newtons; whole configurations hold all movable
//! joints in the robot model's order.
//!
//! # A pick from an estimated pose
//!
//! ```
//! use grip_manip::belief::bin_fixtures;
//! use grip_manip::{BeliefScene, BelievedObject, BinGeometry, Planner, PlannerSettings, Risk};
//! # use grip_sim::objects::{ObjectLibrary, ObjectSet};
//! # use grip_sim::pose::Pose;
//! # use grip_sim::robot::{RobotConfig, RobotModel};
//! # use grip_sim::shape::{CollisionShape, Convex};
//! # use nalgebra::{Isometry3, Vector3};
//! # use std::{path::Path, sync::Arc};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
//! # let robot = RobotModel::load(&root.join("robots/fetch/fetch.urdf"), &[])?;
//! # let (robot, config) = RobotConfig::load(&root.join("robots/fetch/fetch.toml"), robot)?;
//! # let (robot, config) = (Arc::new(robot), Arc::new(config));
//! # let library = ObjectLibrary::open(&root.join("scenes/objects.toml"), ObjectSet::BuiltIn)?;
//! # let soup = library.load("005_tomato_soup_can")?;
//! # let table = CollisionShape {
//! #     pose: Isometry3::translation(0.64, -0.05, 0.63),
//! #     geometry: Convex::Cuboid { half: Vector3::new(0.30, 0.60, 0.02) },
//! # };
//! // The workcell: a table 0.65 m high and a bin on it, the robot at the world's origin.
//! let bin = BinGeometry::new(Pose::from_xyz_rpy([0.52, -0.42, 0.658], [0.0; 3]), [0.30, 0.40], 0.12);
//! let fixtures = [vec![table], bin_fixtures(&bin, 0.008)].concat();
//! let mut belief = BeliefScene::new(fixtures, 0.65, bin, Pose::identity());
//! // What perception says of the object.
//! let world_from_soup = Pose::from_xyz_rpy([0.60, 0.05, 0.65 - soup.min.z], [0.0; 3]);
//! belief.objects.push(BelievedObject::new(soup, world_from_soup));
//!
//! let ready = config.configuration(&robot, "ready")?;
//! let planner = Planner::new(robot, config, PlannerSettings::default());
//! let plan = planner.plan_pick_place(&belief, 0, &ready, Risk::Tolerant, 1)?;
//! println!("{} steps, {:.1} s of motion, grasp {:.1}", plan.steps.len(), plan.motion_seconds(), plan.grasp.score);
//! # assert_eq!(plan.steps.len(), 9);
//! # Ok(())
//! # }
//! ```
//!
//! [`execute`] carries such a plan out on whatever implements [`RobotPort`].
//!
//! # Where things are
//!
//! | module | what it holds |
//! |---|---|
//! | [`belief`] | what the planner knows: fixtures, bin, estimated objects, base |
//! | [`collision`] | collision checks; depth readings that nothing believed explains, as obstacles |
//! | [`motion`] | inverse kinematics, straight motions, search in joint space, timing |
//! | [`surface`], [`grasp`] | grasps of an object, their ranking in a scene and over a posterior, grasps as files |
//! | [`stable`], [`place`] | how an object can stand, and where to put it in the bin |
//! | [`settings`], [`planner`], [`plan`] | the planner, its settings, and its plans as data |
//! | [`order`], [`pick`] | which object first, a whole pick and place, pushes, tests of single grasps |
//! | [`executor`] | carries plans out through a robot port |
//! | [`benchmark`] | motion planning problems of others, and how they are solved |

pub mod belief;
pub mod benchmark;
pub mod collision;
pub mod executor;
pub mod grasp;
pub mod motion;
pub mod order;
pub mod pick;
pub mod place;
pub mod plan;
pub mod planner;
mod ranges;
pub mod settings;
pub mod stable;
pub mod surface;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

pub use belief::{BeliefScene, BelievedObject, BinGeometry};
pub use executor::{
    ExecOutcome, ExecStage, ExecutionReport, ExecutorSettings, RobotPort, execute, execute_motion,
    release_in_place,
};
pub use grasp::{GivenGrasp, Grasp};
pub use motion::Trajectory;
pub use pick::{GraspTest, Risk};
pub use place::PlacePose;
pub use plan::{
    Action, GripperCommand, PickPlacePlan, PlanCounters, PlanFailure, PlanStage, PlanStep, StepName,
};
pub use planner::Planner;
pub use settings::PlannerSettings;
