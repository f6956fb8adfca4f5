//! The smallest box around an object: the axes about which it may look like itself. Scans come in whatever orientation the
//! turntable had.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};

/// Turns about one axis that are tried at first, radians: from minus to plus a quarter turn's half.
const COARSE: f32 = std::f32::consts::PI / 180.0;
/// Halvings of that step: to 0.03 degrees.
const HALVINGS: usize = 5;
/// Rounds over the three axes.
const ROUNDS: usize = 4;
/// A box that is not smaller by this share is none the better: round bodies keep the axes of their frame.
const GAIN: f32 = 0.01;

/// The frame of the box in that of the points: origin in its middle, axes along its sides, as near to those of the points as
/// the box allows. A local search from these: turns about one axis at a time.
pub(crate) fn oriented_box(points: &[Vector3<f32>]) -> Isometry3<f32> {
    let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
    let mut best = (UnitQuaternion::identity(), volume(points, &UnitQuaternion::identity()));
    for _ in 0..ROUNDS {
        let before = best.1;
        for axis in &axes {
            let turned = turned_about(points, &best.0, axis);
            if turned.1 < best.1 * (1.0 - GAIN) {
                best = turned;
            }
        }
        if best.1 == before {
            break;
        }
    }
    let rotation = upright(&best.0);
    let (low, high) = bounds(points, &rotation);
    Isometry3::from_parts(Translation3::from(rotation * ((low + high) / 2.0)), rotation)
}

/// The rotation from `start` by a turn about an axis of the box that makes it smallest, and the volume.
fn turned_about(
    points: &[Vector3<f32>],
    start: &UnitQuaternion<f32>,
    axis: &Unit<Vector3<f32>>,
) -> (UnitQuaternion<f32>, f32) {
    let at = |angle: f32| {
        let rotation = start * UnitQuaternion::from_axis_angle(axis, angle);
        (angle, rotation, volume(points, &rotation))
    };
    let less = |a: &(f32, UnitQuaternion<f32>, f32), b: &(f32, UnitQuaternion<f32>, f32)| a.2.total_cmp(&b.2);
    let mut best = at(0.0);
    for tried in (-45..=45).map(|degrees| at(degrees as f32 * COARSE)) {
        if less(&tried, &best).is_lt() {
            best = tried;
        }
    }
    let mut step = COARSE;
    for _ in 0..HALVINGS {
        step /= 2.0;
        for tried in [at(best.0 - step), at(best.0 + step)] {
            if less(&tried, &best).is_lt() {
                best = tried;
            }
        }
    }
    (best.1, best.2)
}

/// Bounds along the axes of a rotated frame.
fn bounds(points: &[Vector3<f32>], rotation: &UnitQuaternion<f32>) -> (Vector3<f32>, Vector3<f32>) {
    let back = rotation.inverse().to_rotation_matrix();
    let none = (Vector3::repeat(f32::MAX), Vector3::repeat(f32::MIN));
    points.iter().map(|p| back * p).fold(none, |(low, high), p| (low.inf(&p), high.sup(&p)))
}

fn volume(points: &[Vector3<f32>], rotation: &UnitQuaternion<f32>) -> f32 {
    let (low, high) = bounds(points, rotation);
    (high - low).product()
}

/// The same box with its axes named after those of the frame that they are nearest to.
fn upright(rotation: &UnitQuaternion<f32>) -> UnitQuaternion<f32> {
    let columns: Matrix3<f32> = rotation.to_rotation_matrix().into_inner();
    let nearest = |axis: usize, taken: Option<usize>| {
        let open = (0..3).filter(|i| Some(*i) != taken);
        let found = open.max_by(|a, b| columns[(axis, *a)].abs().total_cmp(&columns[(axis, *b)].abs()));
        let found = found.unwrap_or(axis);
        (found, columns.column(found) * columns[(axis, found)].signum())
    };
    let (first, x) = nearest(0, None);
    let (_, y) = nearest(1, Some(first));
    let z = x.cross(&y);
    let axes = Matrix3::from_columns(&[x, y, z]);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cuboid(size: [f32; 3]) -> Vec<Vector3<f32>> {
        (0..8).map(|i| Vector3::from_fn(|a, _| size[a] * ((i >> a & 1) as f32 - 0.5))).collect()
    }

    #[test]
    fn the_box_of_a_turned_box_is_that_box() {
        let size = [0.14, 0.10, 0.04];
        for turn in [[0.0, 0.0, 0.58], [0.1, -0.2, 0.5], [0.0, 0.3, 0.0], [0.0; 3]] {
            let truth = Isometry3::new(Vector3::new(0.01, 0.02, -0.03), Vector3::from(turn));
            let points: Vec<_> =
                cuboid(size).iter().map(|p| (truth * nalgebra::Point3::from(*p)).coords).collect();
            let found = oriented_box(&points);
            assert!((found.translation.vector - truth.translation.vector).norm() < 2e-4, "{found}");
            // To a degree, and with the axes in their order.
            assert!(found.rotation.angle_to(&truth.rotation) < 0.02, "{turn:?}: {found}");
        }
    }

    #[test]
    fn a_can_keeps_its_axes() {
        let rim = |z: f32| {
            (0..40).map(move |i| {
                let a = std::f32::consts::TAU * i as f32 / 40.0;
                Vector3::new(0.034 * a.cos(), 0.034 * a.sin(), z)
            })
        };
        let can: Vec<_> = rim(-0.05).chain(rim(0.05)).collect();
        assert!(oriented_box(&can).rotation.angle() < 1e-6);
    }
}
