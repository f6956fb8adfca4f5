//! Cameras for pictures that people look at.

use grip_sim::camera::Intrinsics;
use grip_sim::pose::{Camera, Pose, World};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

/// Free room about what is to be seen, as a share of the picture.
const MARGIN: f64 = 0.04;

/// A lens for pictures of this size, pixels, as wide as it says, degrees.
pub fn lens([width, height]: [usize; 2], wide_deg: f64) -> Intrinsics {
    let f = 0.5 * width as f64 / (0.5 * wide_deg.to_radians()).tan();
    let (cx, cy) = (0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0));
    Intrinsics { width, height, fx: f, fy: f, cx, cy }
}

/// A camera at `eye` that looks at `target`, upright.
pub fn looking(eye: Vector3<f64>, target: Vector3<f64>) -> Pose<World, Camera> {
    let forward = (target - eye).normalize();
    let right = forward.cross(&Vector3::z()).try_normalize(1e-6).unwrap_or_else(Vector3::y);
    let axes = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Pose::new(Isometry3::from_parts(Point3::from(eye).into(), rotation))
}

/// A camera in `direction` from the points, as near as shows all of them, what is shown in the middle.
pub fn fitted(points: &[Point3<f64>], direction: Vector3<f64>, lens: &Intrinsics) -> Pose<World, Camera> {
    let sum: Vector3<f64> = points.iter().map(|p| p.coords).sum();
    let mut target = sum / points.len().max(1) as f64;
    let mut distance = 2.0;
    let [width, height] = [lens.width, lens.height].map(|n| (1.0 - 2.0 * MARGIN) * n as f64);
    for _ in 0..30 {
        let camera = looking(target + direction * distance, target);
        let Some([low, high]) = bounds(points, &camera, lens) else {
            distance *= 2.0;
            continue;
        };
        let off = [0.5 * (low[0] + high[0]) - lens.cx, 0.5 * (low[1] + high[1]) - lens.cy];
        let metres = distance / lens.fx;
        target += camera.transform_vector(&Vector3::new(off[0] * metres, off[1] * metres, 0.0));
        let fill = ((high[0] - low[0]) / width).max((high[1] - low[1]) / height);
        distance *= fill.clamp(0.5, 2.0);
    }
    looking(target + direction * distance, target)
}

/// Where points are in the picture: its lowest and highest pixels; `None` where one is behind the camera.
pub fn bounds(
    points: &[Point3<f64>],
    camera: &Pose<World, Camera>,
    lens: &Intrinsics,
) -> Option<[[f64; 2]; 2]> {
    let from_world = camera.inverse();
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for p in points {
        let pixel = lens.project(&from_world.transform_point(p))?;
        for axis in 0..2 {
            low[axis] = low[axis].min(pixel[axis]);
            high[axis] = high[axis].max(pixel[axis]);
        }
    }
    Some([low, high])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_sees_what_it_looks_at_in_the_middle_and_the_world_upright() {
        let camera = looking(Vector3::new(2.0, 0.5, 1.5), Vector3::new(0.5, 0.0, 0.7));
        let seen = |x: f64, y: f64, z: f64| camera.inverse().transform_point(&Point3::new(x, y, z));
        let target = seen(0.5, 0.0, 0.7);
        assert!(target.x.abs() < 1e-9 && target.y.abs() < 1e-9 && target.z > 1.0);
        assert!(seen(0.5, 0.0, 0.9).y < 0.0, "what is higher is higher in the picture");
        assert!(seen(0.5, 0.3, 0.7).x > 0.0, "seen from beyond, the robot's left is on the right");
    }

    #[test]
    fn what_is_fitted_fills_the_picture_and_no_more() {
        let lens = lens([640, 480], 40.0);
        for scale in [0.05, 3.0] {
            let corner = |k: usize| [0, 1, 2].map(|a| if k >> a & 1 == 1 { scale } else { -0.2 * scale });
            let points: Vec<Point3<f64>> = (0..8).map(|k| Point3::from(corner(k))).collect();
            let camera = fitted(&points, Vector3::new(0.6, -0.5, 0.62).normalize(), &lens);
            let [low, high] = bounds(&points, &camera, &lens).unwrap();
            assert!(low[0] > 20.0 && low[1] > 15.0 && high[0] < 620.0 && high[1] < 465.0, "{low:?} {high:?}");
            let share = ((high[0] - low[0]) / 640.0).max((high[1] - low[1]) / 480.0);
            assert!((share - 0.92).abs() < 0.02, "{share}");
        }
    }
}
