//! Picking: a whole pick and place, a push where nothing can be picked, and tests of single grasps.

mod given;
mod grasp_test;
mod pick_place;
mod push;

pub use grasp_test::GraspTest;
pub use pick_place::{Risk, snapped_to_ground};
pub use push::PushSettings;
