//! The symmetry group of an object as depth sees it: the rotations that keep its convex hull, nearly.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::hull::{directions, reach};

/// Directions in which hulls are compared.
const CHECKS: usize = 64;
/// A turn that changes the hull by more, as a share of the object's radius, cannot be confused with none. Generous: the depth
/// score decides later.
const KEEPS: f32 = 0.12;
/// Of a body of revolution no turn changes the hull by more. Half a millimetre to 3 mm is what dents and the finite number
/// of hull points make.
const KEEPS_ALWAYS: f32 = 0.05;
/// Turns about an axis that are tried for that, radians; no two differ by a simple fraction of a circle.
const TRIED: [f32; 6] = [0.3, 0.7, 1.1, 1.9, 2.6, 3.7];

/// Rotations about the middle of the smallest box around the object that keep its convex hull, nearly.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SymmetryGroup {
    /// The axis of that box about which every turn keeps the hull, if there is just one (a ball has more).
    pub revolution: Option<Unit<Vector3<f32>>>,
    /// Of a body of revolution: no turn, and one that swaps its ends if that keeps the hull. Else all turns by quarters about
    /// its axes that do, without the identity.
    pub discrete: Vec<UnitQuaternion<f32>>,
}

impl SymmetryGroup {
    /// From extreme points of the object, the frame of the smallest box around it, and its radius, metres.
    pub fn new(hull: &[Vector3<f32>], oriented_box: &Isometry3<f32>, radius: f32) -> Self {
        let boxed = |p: &Vector3<f32>| oriented_box.inverse_transform_point(&Point3::from(*p)).coords;
        let boxed: Vec<Vector3<f32>> = hull.iter().map(boxed).collect();
        // A turn in the object's own frame.
        let own = |q: UnitQuaternion<f32>| oriented_box.rotation * q * oriented_box.rotation.inverse();
        let still: Vec<f32> = directions(CHECKS).map(|d| reach(&boxed, &Isometry3::identity(), &d)).collect();
        let keeps = |q: &UnitQuaternion<f32>, share: f32| {
            let turned = Isometry3::from_parts(Translation3::identity(), *q);
            directions(CHECKS)
                .zip(&still)
                .all(|(d, reached)| (reach(&boxed, &turned, &d) - reached).abs() < share * radius)
        };
        let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
        let mut round = axes.iter().enumerate().filter(|(_, axis)| {
            TRIED.iter().all(|&angle| keeps(&UnitQuaternion::from_axis_angle(axis, angle), KEEPS_ALWAYS))
        });
        if let (Some((i, axis)), None) = (round.next(), round.next()) {
            let swap = UnitQuaternion::from_axis_angle(&axes[(i + 1) % 3], std::f32::consts::PI);
            let mut discrete = vec![UnitQuaternion::identity()];
            discrete.extend(keeps(&swap, KEEPS).then_some(own(swap)));
            return Self { revolution: Some(oriented_box.rotation * axis), discrete };
        }
        let discrete = quarter_turns().into_iter().filter(|q| keeps(q, KEEPS)).map(own).collect();
        Self { revolution: None, discrete }
    }
}

impl SymmetryGroup {
    /// That of the equal orientations of a pose which is nearest to `other`'s. The body of revolution turns about the axis
    /// through its middle, which is taken to be where its origin is.
    pub fn nearest(&self, pose: &Isometry3<f32>, other: &Isometry3<f32>) -> Isometry3<f32> {
        let turned = |q: &UnitQuaternion<f32>| {
            let rotation = pose.rotation * q;
            // From this orientation to the other one, the part about the axis is free.
            let free = self.revolution.map_or_else(UnitQuaternion::identity, |axis| {
                let rest = rotation.inverse() * other.rotation;
                let along = rest.coords.xyz().dot(&axis);
                UnitQuaternion::from_axis_angle(&axis, 2.0 * along.atan2(rest.w))
            });
            Isometry3::from_parts(pose.translation, rotation * free)
        };
        let still = turned(&UnitQuaternion::identity());
        let distance = |p: &Isometry3<f32>| p.rotation.angle_to(&other.rotation);
        let nearest = self.discrete.iter().map(turned).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.filter(|p| distance(p) < distance(&still)).unwrap_or(still)
    }
}

/// The 23 rotations, besides none, that take a cube to itself.
fn quarter_turns() -> Vec<UnitQuaternion<f32>> {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let signed = || axes.into_iter().flat_map(|a| [a, -a]);
    signed()
        .flat_map(|x| signed().filter(move |y| x.dot(y) == 0.0).map(move |y| [x, y, x.cross(&y)]))
        .map(|columns| {
            let r = nalgebra::Matrix3::from_columns(&columns);
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(r))
        })
        .filter(|q| q.angle() > 0.1)
        .collect()
}

/// The pose of an object that is first turned about its middle.
pub(crate) fn turned_about(
    pose: &Isometry3<f32>,
    middle: &Vector3<f32>,
    q: &UnitQuaternion<f32>,
) -> Isometry3<f32> {
    let middle = Translation3::from(*middle);
    pose * middle * q * middle.inverse()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::symmetry::oriented_box;

    fn cuboid(size: [f32; 3]) -> Vec<Vector3<f32>> {
        (0..8).map(|i| Vector3::from_fn(|a, _| size[a] * ((i >> a & 1) as f32 - 0.5) + 0.01)).collect()
    }

    fn group(hull: &[Vector3<f32>]) -> SymmetryGroup {
        SymmetryGroup::new(hull, &oriented_box(hull), hull.iter().map(|p| p.norm()).fold(0.0, f32::max))
    }

    #[test]
    fn boxes_have_the_turns_that_keep_their_sides() {
        assert_eq!(group(&cuboid([0.06, 0.16, 0.21])).discrete.len(), 3);
        assert_eq!(group(&cuboid([0.1, 0.1, 0.2])).discrete.len(), 7);
        let cube = group(&cuboid([0.1, 0.1, 0.1]));
        assert_eq!((cube.discrete.len(), cube.revolution), (23, None));
    }

    #[test]
    fn a_can_is_round_about_its_axis_and_a_mug_is_not() {
        let rim = |r: f32, z: f32| {
            (0..40).map(move |i| {
                let a = std::f32::consts::TAU * i as f32 / 40.0;
                Vector3::new(r * a.cos() + 0.01, r * a.sin() + 0.01, z + 0.01)
            })
        };
        let can: Vec<_> = rim(0.034, -0.05).chain(rim(0.034, 0.05)).collect();
        let found = group(&can);
        assert_eq!(found.revolution, Some(Vector3::z_axis()));
        assert_eq!(found.discrete.len(), 2);
        let bowl: Vec<_> = rim(0.03, -0.02).chain(rim(0.08, 0.02)).collect();
        assert_eq!(group(&bowl).discrete.len(), 1);
        let mut mug = can;
        mug.push(Vector3::new(0.075, 0.01, 0.01));
        assert_eq!(group(&mug).revolution, None);
    }
}
