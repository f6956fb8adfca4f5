//! The score: the only place where truth meets belief.
//!
//! A [`Watch`] follows one attempt step by step in the physics world and fills the clauses of success; [`pose_errors`]
//! compares an estimate with where the object really is. Nothing here flows back to perception or planning.

use grip_perception::metrics;
use grip_sim::objects::ObjectModel;
use grip_sim::physics::World;
use grip_sim::pose::{Camera, Object, Pose};
use grip_sim::scene::Scene;
use nalgebra::{Isometry3, Point3};

use crate::outcome::Clauses;

/// A finger counts as pressing from this force on, newtons.
const PRESSING_N: f64 = 1.0;
/// A lifted object's lowest point must rise by this much, metres.
const LIFT_M: f64 = 0.03;
/// An item counts as lost when it is this far below the table's top, metres.
const FALLEN_M: f64 = 0.05;

/// What one attempt at an object did, as physics saw it.
#[derive(Debug, Clone)]
pub struct Watch {
    object: usize,
    gripper_link: usize,
    start_lowest: f64,
    /// The clauses of success that concern the way of the object.
    pub clauses: Clauses,
    /// Gripper from object when the fingers had closed, for slip.
    held_at: Option<Isometry3<f64>>,
    /// Farthest that the object's origin moved in the hand while it was pinched, metres.
    pub slip_m: Option<f64>,
    /// Another object that the fingers pinched.
    pub wrong_object: Option<usize>,
}

impl Watch {
    /// Begins to watch an attempt at `object`.
    pub fn begin(world: &World, object: usize, gripper_link: usize) -> Self {
        Self {
            object,
            gripper_link,
            start_lowest: world.lowest_point(object),
            clauses: Clauses::default(),
            held_at: None,
            slip_m: None,
            wrong_object: None,
        }
    }

    /// The fingers have closed; the lift begins.
    pub fn closed(&mut self, world: &World) {
        self.clauses.opposing_contacts = world.contacts(self.object).pinched(PRESSING_N);
        self.held_at = Some(self.gripper_from_object(world));
        self.wrong_object = (0..world.object_count())
            .find(|&other| other != self.object && world.contacts(other).pinched(PRESSING_N));
    }

    /// A step of lifting or carrying is done.
    pub fn held(&mut self, world: &World) {
        if !world.contacts(self.object).pinched(PRESSING_N) {
            return;
        }
        if let Some(held_at) = self.held_at {
            let moved = (held_at.inverse() * self.gripper_from_object(world)).translation.vector.norm();
            self.slip_m = Some(self.slip_m.unwrap_or(0.0).max(moved));
        }
        let risen = world.lowest_point(self.object) - self.start_lowest;
        self.clauses.lifted_clear |= risen >= LIFT_M && self.is_clear(world);
    }

    /// The carry is over.
    pub fn carried(&mut self, world: &World) {
        self.clauses.held_after_carry =
            world.contacts(self.object).pinched(PRESSING_N) && self.is_clear(world);
    }

    /// Whether the object touches nothing but the hand.
    fn is_clear(&self, world: &World) -> bool {
        let contacts = world.contacts(self.object);
        contacts.fixtures.is_empty() && contacts.objects.is_empty()
    }

    fn gripper_from_object(&self, world: &World) -> Isometry3<f64> {
        world.link_pose(self.gripper_link).inverse() * world.truth(self.object).iso()
    }
}

/// ADD and ADD-S of an estimate against the truth, metres.
pub fn pose_errors(
    model: &ObjectModel,
    truth: &Pose<Camera, Object>,
    estimate: &Pose<Camera, Object>,
) -> (f64, f64) {
    let points = model_points(model);
    (metrics::add(&points, truth, estimate), metrics::adds(&points, truth, estimate))
}

/// Vertices of the model, thinned to at most a thousand, evenly over the list.
fn model_points(model: &ObjectModel) -> Vec<Point3<f64>> {
    const MOST: usize = 1000;
    let vertices = &model.visual.mesh.positions;
    let step = vertices.len().div_ceil(MOST).max(1);
    vertices.iter().step_by(step).map(|p| p.cast()).collect()
}

/// Whether object `index` is inside the bin: the centre of its bounding box between the walls and not above their edge by
/// more than half of its size, and nothing but the bin and its content touched.
pub fn in_bin(world: &World, scene: &Scene, index: usize) -> bool {
    let centre = Point3::from(world.truth(index).translation());
    let margin = world.object(index).diameter / 2.0;
    scene.bin.contains(&centre, margin)
}

/// Whether object `index` lies on the floor: fallen off everything it should stand on.
pub fn has_fallen(world: &World, scene: &Scene, index: usize) -> bool {
    let lowest_floor = scene.table.height.min(scene.bin.base_height);
    world.lowest_point(index) < lowest_floor - FALLEN_M
}

/// Where every item is, to see later what was knocked out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Whereabouts {
    /// On the table.
    Table,
    /// In the bin.
    Bin,
    /// On the floor or anywhere else.
    Lost,
}

/// Where all items are.
pub fn whereabouts(world: &World, scene: &Scene) -> Vec<Whereabouts> {
    (0..world.object_count())
        .map(|i| {
            let p = world.truth(i).translation();
            if in_bin(world, scene, i) {
                Whereabouts::Bin
            } else if scene.table.holds(p.x, p.y) && !has_fallen(world, scene, i) {
                Whereabouts::Table
            } else {
                Whereabouts::Lost
            }
        })
        .collect()
}

/// Items other than `handled` that left the table for the floor, or the bin for anywhere.
pub fn knocked_out(before: &[Whereabouts], after: &[Whereabouts], handled: usize) -> Vec<usize> {
    (0..before.len())
        .filter(|&i| i != handled && before[i] != Whereabouts::Lost)
        .filter(|&i| {
            after[i] == Whereabouts::Lost || (before[i] == Whereabouts::Bin && after[i] != Whereabouts::Bin)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use Whereabouts::{Bin, Lost, Table};

    #[test]
    fn knocked_out_means_off_the_table_or_out_of_the_bin() {
        assert_eq!(knocked_out(&[Table, Table, Bin], &[Bin, Table, Bin], 0), Vec::<usize>::new());
        assert_eq!(knocked_out(&[Table, Table, Bin], &[Bin, Lost, Bin], 0), vec![1]);
        assert_eq!(knocked_out(&[Table, Table, Bin], &[Table, Table, Table], 0), vec![2]);
        // What is handled itself is judged by its own clauses.
        assert_eq!(knocked_out(&[Table], &[Lost], 0), Vec::<usize>::new());
    }
}
