//! Near-symmetries: motions after which an object nearly lies on itself. A box the wrong way round, a clamp on its other side, a
//! mug whatever its handle says. Found once from the surface alone; which of them depth can tell apart is for the search to say.

use std::f32::consts::TAU;

use grip_sim::mesh::Mesh;
use grip_sim::rng;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rstar::RTree;

/// Turns about each axis of the object's box, none included.
const TURNS: usize = 16;
/// Points of the surface, dense enough to tell near from far, and one of how many is laid on them.
const POINTS: usize = 2000;
const LAID_ON: usize = 20;
/// Rounds in which the turned surface is moved onto the unturned one.
const ROUNDS: usize = 6;
/// Points that are farther from the other surface do not pull, as a share of the radius, in the first round and the last: a
/// handle must not pull a mug.
const PULL: [f32; 2] = [0.4, 0.12];
/// Nearer than this share of the radius, surfaces lie on each other.
const NEAR: f32 = 0.08;
/// Share of the surface that must: a box turned about the normal of its largest face has half; half turns are kept whatever.
const SHARE: f32 = 0.7;
/// With less than this share after so many rounds it will not.
const HOPELESS: (f32, usize) = (0.2, 2);

/// The near-symmetries, in the object's frame: a pose times one of them is what it is taken for. Turns about the `revolution` of a body of
/// revolution are left out, since nothing tells them apart.
pub(crate) fn near_symmetries(
    mesh: &Mesh,
    oriented_box: &Isometry3<f32>,
    radius: f32,
    revolution: Option<Vector3<f32>>,
) -> Vec<Isometry3<f32>> {
    let sampled = mesh.sample_surface(POINTS, &mut rng::stream(0, "alike"));
    let points: Vec<Vector3<f32>> =
        sampled.iter().map(|p| (oriented_box.inverse() * p.cast::<f32>()).coords).collect();
    let tree = RTree::bulk_load(points.iter().map(|p| [p.x, p.y, p.z]).collect());
    let revolution = revolution.map(|axis| oriented_box.rotation.inverse() * axis);
    let mut found = Vec::new();
    for axis in [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()] {
        if revolution.is_some_and(|r| r.dot(&axis).abs() > 0.9) {
            continue;
        }
        for k in 1..TURNS {
            let turn = UnitQuaternion::from_axis_angle(&axis, TAU * k as f32 / TURNS as f32);
            let turned: Vec<Vector3<f32>> = points.iter().step_by(LAID_ON).map(|p| turn * p).collect();
            let (shift, share) = laid_on(&turned, &tree, radius);
            if share >= SHARE || 2 * k == TURNS {
                let here = Isometry3::from_parts(Translation3::from(shift), turn);
                found.push(oriented_box * here * oriented_box.inverse());
            }
        }
    }
    found
}

/// The shift that lays points on a surface, as far as they fit it, and the share of them that lie on it then.
fn laid_on(points: &[Vector3<f32>], surface: &RTree<[f32; 3]>, radius: f32) -> (Vector3<f32>, f32) {
    let mut shift = Vector3::zeros();
    let mut near = 0.0;
    let offset = |p: &Vector3<f32>, shift: &Vector3<f32>| {
        let moved = p + shift;
        let nearest = surface.nearest_neighbor([moved.x, moved.y, moved.z]);
        nearest.map_or_else(Vector3::zeros, |q| Vector3::from(*q) - moved)
    };
    for round in 0..=ROUNDS {
        let offsets: Vec<Vector3<f32>> = points.iter().map(|p| offset(p, &shift)).collect();
        let within = |reach: f32| {
            let close = offsets.iter().filter(|d| d.norm() < reach);
            (close.clone().sum::<Vector3<f32>>(), close.count() as f32)
        };
        near = within(NEAR * radius).1 / points.len().max(1) as f32;
        if round == ROUNDS || (round == HOPELESS.1 && near < HOPELESS.0) {
            break;
        }
        let part = round as f32 / (ROUNDS - 1) as f32;
        let (sum, count) = within(radius * (PULL[0] + (PULL[1] - PULL[0]) * part));
        shift += sum / count.max(1.0);
    }
    (shift, near)
}

#[cfg(test)]
mod tests {
    use crate::model::fixtures::{can, mug, skew_box};

    #[test]
    fn a_box_lies_on_itself_after_half_turns_alone() {
        let model = skew_box([0.06, 0.16, 0.21]);
        let angles: Vec<f32> =
            model.near_symmetries().iter().map(|turn| turn.rotation.angle().to_degrees()).collect();
        // A small turn leaves much where it was.
        let far: Vec<f32> = angles.iter().copied().filter(|angle| *angle > 30.0).collect();
        assert_eq!(far.len(), 3, "{angles:?}");
        assert!(far.iter().all(|angle| (angle - 180.0).abs() < 0.1), "{angles:?}");
    }

    #[test]
    fn a_mug_lies_on_itself_wherever_its_handle_is() {
        let model = mug(0.04, 0.1);
        let upright = |turn: &&nalgebra::Isometry3<f32>| (turn.rotation * nalgebra::Vector3::z()).z > 0.99;
        let turns: Vec<_> = model.near_symmetries().iter().filter(upright).collect();
        assert_eq!(turns.len(), super::TURNS - 1);
        for turn in turns {
            // The box's middle is beside the axis of the cylinder, which stays where it is all the same.
            let off = turn.translation.vector.norm();
            assert!(off < 0.010, "{off} m, turned by {} rad", turn.rotation.angle());
        }
        // Of a can nothing tells them apart.
        assert!(
            can(0.04, 0.1)
                .near_symmetries()
                .iter()
                .all(|turn| (turn.rotation * nalgebra::Vector3::z()).z < 0.99)
        );
    }
}
