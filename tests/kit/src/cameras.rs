//! Poses of cameras and things. Optical frames: z forward, x right, y down; the world's z is up. Metres, radians.

use grip_sim::pose::{Camera, Pose, World};
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// A thing at `xyz`, turned about the vertical by `yaw`.
pub fn at(xyz: [f64; 3], yaw: f64) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::new(xyz[0], xyz[1], xyz[2]),
        UnitQuaternion::from_euler_angles(0.0, 0.0, yaw),
    )
}

/// A camera `height` up that looks `down` radians below the horizon along world x.
pub fn looking_down(height: f64, down: f64) -> Pose<World, Camera> {
    let forward = Vector3::new(down.cos(), 0.0, -down.sin());
    let right = Vector3::new(0.0, -1.0, 0.0);
    let columns = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
    Pose::new(Isometry3::from_parts(
        Translation3::new(0.0, 0.0, height),
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(columns)),
    ))
}

/// A camera at `eye` that looks at `target`, upright.
pub fn look_at(eye: [f64; 3], target: [f64; 3]) -> Pose<World, Camera> {
    let (eye, target) = (Vector3::from(eye), Vector3::from(target));
    let z = (target - eye).normalize();
    let x = z.cross(&Vector3::z()).normalize();
    let y = z.cross(&x);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, z]));
    Pose::new(Isometry3::from_parts(Translation3::from(eye), UnitQuaternion::from_rotation_matrix(&rotation)))
}

/// The Fetch's head camera, roughly.
pub fn head_camera() -> Pose<World, Camera> {
    look_at([0.10, 0.0, 1.18], [0.75, 0.0, 0.70])
}
