//! A box or a cylinder in place of a mesh, if its surface is one.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::mesh::Mesh;
use crate::objects::collision_error;
use crate::rng;
use crate::shape::{CollisionShape, Convex};

/// A primitive may be this far from the mesh's surface on average, metres.
const MEAN_LIMIT: f64 = 1.5e-3;
/// And this far anywhere, metres.
const MAX_LIMIT: f64 = 8e-3;
/// Samples to fit to.
const SAMPLES: usize = 4000;
/// Steps of a quarter turn when looking for a box's yaw.
const YAW_STEPS: usize = 360;
/// A sample belongs to a face if its normal is within this cosine of the face's.
const FACING: f64 = 0.9;
/// A box's face lies where this part of its samples is behind it: near the outermost, but single bumps do not move it.
const BOX_BEHIND: f64 = 0.9;
/// The same for a cylinder's ends. A can stands on its rim, which is a small part of the lid.
const END_BEHIND: f64 = 0.98;
/// Rounds of turning the box's axes to the mean normals of its faces.
const TURNS: usize = 5;

/// A surface sample and its unit normal.
type Sample = (Point3<f64>, Vector3<f64>);

/// The better one of an oriented box and a cylinder along x, y or z, if either is within the limits.
pub(super) fn fit(mesh: &Mesh) -> Option<CollisionShape> {
    let samples: Vec<Sample> = mesh
        .sample_surface_indexed(SAMPLES, &mut rng::stream(0, "primitive fit"))
        .into_iter()
        .filter_map(|(point, triangle)| {
            let [a, b, c] = mesh.corners(triangle);
            Some((point, (b - a).cross(&(c - a)).try_normalize(0.0)?))
        })
        .collect();
    let x_to_z = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
    let y_to_z = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -std::f64::consts::FRAC_PI_2);
    let candidates = [
        cuboid(&samples),
        cylinder(&samples, UnitQuaternion::identity()),
        cylinder(&samples, x_to_z),
        cylinder(&samples, y_to_z),
    ];
    candidates
        .into_iter()
        .flatten()
        .map(|shape| (collision_error::between(mesh, std::slice::from_ref(&shape)), shape))
        .filter(|(error, _)| error.mean_m < MEAN_LIMIT && error.max_m < MAX_LIMIT)
        .min_by(|(a, _), (b, _)| a.mean_m.total_cmp(&b.mean_m))
        .map(|(_, shape)| shape)
}

/// Where a face towards `direction` lies along it, with the part `behind` of its samples behind it. `None` if hardly any
/// sample faces there.
fn face(samples: &[Sample], direction: &Vector3<f64>, behind: f64) -> Option<f64> {
    let facing = samples.iter().filter(|(_, normal)| normal.dot(direction) > FACING);
    let along = facing.map(|(point, _)| point.coords.dot(direction)).collect();
    quantile(along, behind)
}

fn quantile(mut values: Vec<f64>, part: f64) -> Option<f64> {
    if values.len() < 20 {
        return None;
    }
    values.sort_by(f64::total_cmp);
    values.get((part * (values.len() - 1) as f64).round() as usize).copied()
}

/// A box, turned so that its faces face the way that the samples do.
fn cuboid(samples: &[Sample]) -> Option<CollisionShape> {
    // Scans stand on z: the turn about it with the smallest footprint, from extents over all samples.
    let extent = |direction: Vector3<f64>| {
        let along = samples.iter().map(|(point, _)| point.coords.dot(&direction));
        let (low, high) =
            along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        high - low
    };
    let yaw = (0..YAW_STEPS)
        .map(|step| step as f64 / YAW_STEPS as f64 * std::f64::consts::FRAC_PI_2)
        .map(|yaw| {
            let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw);
            (extent(turn * Vector3::x()) * extent(turn * Vector3::y()), yaw)
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))?
        .1;
    let mut turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
    // They may lean a little, though.
    for _ in 0..TURNS {
        let axis_of = |axis: usize| -> Vector3<f64> {
            let old = turn * Vector3::ith(axis, 1.0);
            let normals = samples.iter().map(|(_, normal)| normal * normal.dot(&old).signum());
            normals
                .filter(|normal| normal.dot(&old) > FACING)
                .sum::<Vector3<f64>>()
                .try_normalize(0.0)
                .unwrap_or(old)
        };
        let axes = Matrix3::from_columns(&[axis_of(0), axis_of(1), axis_of(2)]);
        // The rotation nearest to the three axes.
        turn = UnitQuaternion::from_matrix_eps(&axes, 1e-9, 100, turn);
    }
    let (mut center, mut half) = (Vector3::zeros(), Vector3::zeros());
    for axis in 0..3 {
        let direction = turn * Vector3::ith(axis, 1.0);
        let (high, low) = (face(samples, &direction, BOX_BEHIND)?, -face(samples, &-direction, BOX_BEHIND)?);
        center += direction * (high + low) / 2.0;
        half[axis] = (high - low) / 2.0;
    }
    (half.min() > 0.0).then(|| CollisionShape {
        pose: Isometry3::from_parts(Translation3::from(center), turn),
        geometry: Convex::Cuboid { half },
    })
}

/// A cylinder along the z axis of the frame turned by `turn`.
fn cylinder(samples: &[Sample], turn: UnitQuaternion<f64>) -> Option<CollisionShape> {
    let back = turn.inverse();
    let local: Vec<Sample> = samples.iter().map(|(point, normal)| (back * point, back * normal)).collect();
    let (high, low) = (face(&local, &Vector3::z(), END_BEHIND)?, -face(&local, &-Vector3::z(), END_BEHIND)?);
    let side: Vec<Point3<f64>> = local.iter().filter(|(_, n)| n.z.abs() < 0.3).map(|(p, _)| *p).collect();
    // A circle through the side: x² + y² = 2 a x + 2 b y + c, least squares (Kåsa, 1976).
    let (mut normal_matrix, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for p in &side {
        let row = Vector3::new(2.0 * p.x, 2.0 * p.y, 1.0);
        normal_matrix += row * row.transpose();
        right += row * (p.x * p.x + p.y * p.y);
    }
    let solution = normal_matrix.try_inverse()? * right;
    let (a, b) = (solution.x, solution.y);
    let radius = quantile(side.iter().map(|p| (p.x - a).hypot(p.y - b)).collect(), 0.5)?;
    (radius > 0.0 && high > low).then(|| CollisionShape {
        pose: Isometry3::from_parts(Translation3::identity(), turn)
            * Translation3::new(a, b, (high + low) / 2.0),
        geometry: Convex::Cylinder { half_height: (high - low) / 2.0, radius },
    })
}
