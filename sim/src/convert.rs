//! Our geometry (nalgebra, f64) as parry's (glam, f32), and back. Rapier uses the same types.

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use parry3d::math::{Pose as ParryPose, Rotation, Vector};
use parry3d::shape::SharedShape;

use crate::shape::{CollisionShape, Convex};

/// A vector in single precision.
pub fn vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x as f32, v.y as f32, v.z as f32)
}

/// A point in single precision.
pub fn point(p: &Point3<f64>) -> Vector {
    vector(&p.coords)
}

/// A vector in double precision.
pub fn from_vector(v: Vector) -> Vector3<f64> {
    Vector3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z))
}

/// A rigid transform in single precision.
pub fn pose(iso: &Isometry3<f64>) -> ParryPose {
    let (t, q) = (iso.translation.vector, iso.rotation);
    let rotation = Rotation::from_xyzw(q.i as f32, q.j as f32, q.k as f32, q.w as f32).normalize();
    ParryPose::from_parts(vector(&t), rotation)
}

/// A rigid transform in double precision, its quaternion normalised again.
pub fn from_pose(pose: &ParryPose) -> Isometry3<f64> {
    let q = pose.rotation;
    Isometry3::from_parts(
        Translation3::from(from_vector(pose.translation)),
        UnitQuaternion::from_quaternion(Quaternion::new(
            f64::from(q.w),
            f64::from(q.x),
            f64::from(q.y),
            f64::from(q.z),
        )),
    )
}

/// The solid and its pose in the parent frame, for parry and rapier.
///
/// Their cylinders stand along y, ours along z; the difference is folded into the pose. `None` for a hull whose points
/// have no volume.
pub fn solid(shape: &CollisionShape) -> Option<(ParryPose, SharedShape)> {
    let at = pose(&shape.pose);
    Some(match &shape.geometry {
        Convex::Cuboid { half } => (at, SharedShape::cuboid(half.x as f32, half.y as f32, half.z as f32)),
        Convex::Sphere { radius } => (at, SharedShape::ball(*radius as f32)),
        Convex::Cylinder { half_height, radius } => {
            let y_to_z = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
            let upright = shape.pose * Isometry3::from_parts(Translation3::identity(), y_to_z);
            (pose(&upright), SharedShape::cylinder(*half_height as f32, *radius as f32))
        }
        Convex::Hull { points } => {
            let points: Vec<Vector> = points.iter().map(point).collect();
            (at, SharedShape::convex_hull(&points)?)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_survive_the_round_trip() {
        let iso = Isometry3::from_parts(
            Translation3::new(0.3, -1.2, 0.8),
            UnitQuaternion::from_euler_angles(0.3, -1.0, 2.0),
        );
        let back = from_pose(&pose(&iso));
        assert!((back.translation.vector - iso.translation.vector).norm() < 1e-6);
        assert!(back.rotation.angle_to(&iso.rotation) < 1e-6);
    }

    #[test]
    fn our_cylinders_stand_along_z() {
        let shape = CollisionShape {
            pose: Isometry3::identity(),
            geometry: Convex::Cylinder { half_height: 0.5, radius: 0.1 },
        };
        let (at, solid) = solid(&shape).unwrap();
        let bounds = solid.compute_aabb(&at);
        assert!((bounds.maxs.z - 0.5).abs() < 1e-5 && (bounds.maxs.x - 0.1).abs() < 1e-5);
    }
}
