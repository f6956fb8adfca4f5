//! Picking: a whole pick and place, and tests of single grasps.

mod grasp_test;
mod pick_place;

pub use grasp_test::GraspTest;
pub use pick_place::{Risk, snapped_to_ground};
