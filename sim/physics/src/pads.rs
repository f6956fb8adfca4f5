//! What the patch holds in which a soft pad touches an object.
//!
//! The engine touches a flat face at the corners of what two faces have in common, with one friction for all of them and a twist that
//! knows nothing of it. Rubber presses evenly, and what its friction bears is lost to twisting: force and torque lie on an ellipsoid,
//! the limit surface (Howe and Cutkosky, "Practical force-motion models for sliding manipulation", 1996).

use rapier3d::prelude::*;

use crate::contacts::{Body, BodyContact};

/// Share of a patch's torsional friction that is left beside the force that it bears.
pub(crate) fn left_for_torsion(friction: f64, contact: &BodyContact) -> f64 {
    let most = friction * contact.force.norm();
    let used = if most > 0.0 { contact.friction.norm() / most } else { 0.0 };
    (1.0 - used * used).max(0.0).sqrt()
}

/// Largest torque of the patch about a point or an edge, N m: what its contact points do not give. `arm` is that of a point's patch.
pub(crate) fn torsion(friction: f64, arm: f64, contact: &BodyContact) -> f64 {
    let missing = (arm - f64::from(OF_LINE) * contact.spread()).max(0.0);
    friction * contact.force.norm() * missing * left_for_torsion(friction, contact)
}

/// Moves the points of contacts between pads and objects to where their friction has the arm of an evenly pressed patch.
pub(crate) struct EvenPads {
    /// Of each object and finger, [`left_for_torsion`].
    left: Vec<[f32; 2]>,
}

impl EvenPads {
    pub(crate) fn new(left: Vec<[f32; 2]>) -> Self {
        Self { left }
    }
}

/// Points that are farther from touching than this do not belong to the patch, metres.
const TOUCHING: f32 = 2e-4;
/// Points that are nearer to each other than this are one, metres.
const SAME: f32 = 5e-4;
/// Points that span less than this across, as a share of what they span along, are a line.
const LINE: f32 = 0.1;
/// Mean distance from the middle of a line, as a share of that of its ends.
const OF_LINE: f32 = 0.5;
/// The same of a rectangle and its corners: 0.50 to 0.54, by its sides.
const OF_FACE: f32 = 0.53;
/// The points also hold the object straight: they stay apart by this share.
const LEAST: f32 = 0.1;

impl PhysicsHooks for EvenPads {
    fn modify_solver_contacts(&self, context: &mut ContactModificationContext<'_>) {
        let tag = |handle| context.colliders.get(handle).map(|collider| Body::from_tag(collider.user_data));
        let left = match (tag(context.collider1), tag(context.collider2)) {
            (Some(Body::Finger(side)), Some(Body::Object(i)))
            | (Some(Body::Object(i)), Some(Body::Finger(side))) => self.left[i][side],
            _ => return,
        };
        let Some(manifold) = context.rigid_mut() else { return };
        let normal = *manifold.normal;
        // The engine gives an end of a cylinder's line several points, which would bear more than the other end.
        let mut index = 0;
        while index < manifold.solver_contacts.len() {
            let point = manifold.solver_contacts[index].anchor1;
            let same = |other: &SolverContact| (other.anchor1 - point).length() < SAME;
            if manifold.solver_contacts[..index].iter().any(same) {
                manifold.solver_contacts.remove(index);
            } else {
                index += 1;
            }
        }
        let touching = |contact: &&mut SolverContact| contact.dist < TOUCHING;
        let points: Vec<Vector> =
            manifold.solver_contacts.iter_mut().filter(touching).map(|contact| contact.anchor1).collect();
        let Some((middle, even)) = patch(&points, normal) else { return };
        let share = (even * left).max(LEAST);
        for contact in manifold.solver_contacts.iter_mut().filter(touching) {
            let out = contact.anchor1 - middle;
            let inwards = (out - normal * out.dot(normal)) * (share - 1.0);
            contact.anchor1 += inwards;
            contact.anchor2 += inwards;
        }
    }
}

/// The middle of the patch that points across `normal` span, and the mean distance from it of an evenly pressed one, as a share of
/// theirs. None for a single point.
fn patch(points: &[Vector], normal: Vector) -> Option<(Vector, f32)> {
    let pairs = points.iter().enumerate().flat_map(|(i, a)| points[..i].iter().map(move |b| *a - *b));
    let longest = pairs.max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
    let along = (longest - normal * longest.dot(normal)).try_normalize()?;
    let across = normal.cross(along);
    let [(mid, length), (side, width)] = [along, across].map(|axis| {
        let places = points.iter().map(|point| point.dot(axis));
        let (low, high) =
            places.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        ((low + high) / 2.0, high - low)
    });
    let middle = along * mid + across * side + normal * points[0].dot(normal);
    Some((middle, if width < LINE * length { OF_LINE } else { OF_FACE }))
}
