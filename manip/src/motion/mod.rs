//! Motions of the arm: inverse kinematics, straight motions of the hand, search in joint space, timing.

mod cartesian;
mod ik;
mod joint_space;
mod reach;
mod rrt;
mod segment_check;
mod smooth;
mod timing;

pub use cartesian::{CartesianFailure, CartesianPath, glide, straight_line, translate};
pub use ik::IkSolver;
pub use joint_space::{Axis, JointSpace, wrap};
pub use reach::{ReachParams, ReachScore, grasp_orientation, reach_score};
pub use rrt::{PathSearch, RrtSettings, SearchStatus, Validity, rrt_connect, shortcut};
pub use segment_check::SegmentCheck;
pub use smooth::{PathPiece, SmoothPath};
pub use timing::{MotionLimits, Trajectory, TrajectoryPoint, time_path};
