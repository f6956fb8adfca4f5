//! The score: the only place where truth meets belief.
//!
//! | file | what it holds |
//! |---|---|
//! | `outcome` | the score as plain data: result.json |
//! | `record` | what is known of each item while a trial goes on, and the verdict that it leaves |
//! | `monitor` | [`GraspMonitor`]: follows one attempt step by step |
//! | `bodies` | which body an item is, where several are of a kind |
//! | `location` | where items are: on the table, in the bin, lost |
//! | `card` | fills the score card: what a trial was like beside what was packed |
//! | `motion_check` | collisions of all motions, by the exact checker |
//!
//! [`pose_errors`] compares an estimate with where the object really is. Nothing here flows back to perception or planning.

mod bodies;
mod card;
mod location;
mod monitor;
mod motion_check;
pub mod outcome;
pub(crate) mod record;

use grip_perception::metrics;
use grip_physics::World;
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Camera, Object, Pose};
use nalgebra::{Point3, Vector3};

pub use self::bodies::Bodies;
pub(crate) use self::card::fill;
pub use self::location::{Location, below_edge_m, in_bin, knocked_out, locations};
pub use self::monitor::GraspMonitor;
pub use self::motion_check::{JointLog, Meeting, MotionCheck};
use crate::settings::SuccessCriteria;

/// ADD and ADD-S of an estimate against the truth, metres.
pub fn pose_errors(
    model: &ObjectModel,
    truth: &Pose<Camera, Object>,
    estimate: &Pose<Camera, Object>,
) -> (f64, f64) {
    let points = model_points(model);
    (metrics::add(&points, truth, estimate), metrics::adds(&points, truth, estimate))
}

/// Vertices of the model, thinned to at most a thousand, evenly over the list; metres, its own frame.
pub fn model_points(model: &ObjectModel) -> Vec<Point3<f64>> {
    const MOST: usize = 1000;
    let vertices = &model.visual.mesh.positions;
    let step = vertices.len().div_ceil(MOST).max(1);
    vertices.iter().step_by(step).map(|p| p.cast()).collect()
}

/// The angle between the z axis of object `index` and the vertical, degrees.
pub fn tilt_deg(world: &World, index: usize) -> f64 {
    world.truth(index).transform_vector(&Vector3::z()).angle(&Vector3::z()).to_degrees()
}

/// Whether object `index` stands within the bound of upright, or is one that need not.
pub fn upright(world: &World, index: usize, criteria: &SuccessCriteria) -> bool {
    !world.object(index).info.upright || tilt_deg(world, index) <= criteria.tilt_deg
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::setup::{Setup, SetupOptions};

    /// The default scene with the robot, but no objects.
    pub fn empty() -> (Setup, World) {
        let setup = Setup::load(&SetupOptions::default()).unwrap();
        let world = setup.empty_world(setup.cell.start.clone()).unwrap();
        (setup, world)
    }

    #[test]
    fn an_item_that_must_stand_may_not_lie() {
        let (setup, mut world) = empty();
        let criteria = &setup.settings.success;
        let mug = setup.library.load("025_mug").unwrap();
        for roll in [0.0, 1.4] {
            let at = Pose::from_xyz_rpy([0.6, 0.1, 0.75], [roll, 0.0, 0.0]);
            world.add_object(mug.clone(), &at).unwrap();
        }
        assert!(upright(&world, 0, criteria) && !upright(&world, 1, criteria));
        let can = setup.models.iter().find(|m| m.info.name == "005_tomato_soup_can").unwrap();
        world.add_object(can.clone(), &Pose::from_xyz_rpy([0.6, 0.3, 0.75], [1.4, 0.0, 0.0])).unwrap();
        assert!(upright(&world, 2, criteria), "a can may lie");
    }
}
