//! Convex hulls by their extreme points, and how far they reach.

use grip_sim::camera::Intrinsics;
use nalgebra::{Isometry3, Vector3};

/// Evenly spread unit vectors (Fibonacci lattice).
pub(crate) fn directions(count: usize) -> impl Iterator<Item = Vector3<f32>> {
    let golden = std::f32::consts::PI * (3.0 - 5.0f32.sqrt());
    (0..count).map(move |i| {
        let z = 1.0 - (2 * i + 1) as f32 / count as f32;
        let r = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = (golden * i as f32).sin_cos();
        Vector3::new(r * cos, r * sin, z)
    })
}

/// The points that are farthest in some direction.
pub(crate) fn extreme_points(points: &[Vector3<f32>], count: usize) -> Vec<Vector3<f32>> {
    let mut kept: Vec<usize> = directions(count)
        .chain([Vector3::x(), Vector3::y(), Vector3::z(), -Vector3::x(), -Vector3::y(), -Vector3::z()])
        .filter_map(|d| (0..points.len()).max_by(|&a, &b| points[a].dot(&d).total_cmp(&points[b].dot(&d))))
        .collect();
    kept.sort_unstable();
    kept.dedup();
    kept.into_iter().map(|i| points[i]).collect()
}

/// Support function of the posed hull: how far it reaches in direction `d`.
pub(crate) fn reach(hull: &[Vector3<f32>], pose: &Isometry3<f32>, d: &Vector3<f32>) -> f32 {
    let local = pose.rotation.inverse() * d;
    hull.iter().map(|p| p.dot(&local)).fold(f32::MIN, f32::max) + pose.translation.vector.dot(d)
}

/// Bounds `[u0, v0, u1, v1]` of the projected points, clipped to the image; `None` when one is behind the camera.
pub(crate) fn projected_bounds(
    points: &[Vector3<f32>],
    pose: &Isometry3<f32>,
    k: &Intrinsics,
) -> Option<[f64; 4]> {
    let r = pose.rotation.to_rotation_matrix();
    let (fx, fy, cx, cy) = (k.fx as f32, k.fy as f32, k.cx as f32, k.cy as f32);
    let mut b = [f32::MAX, f32::MAX, f32::MIN, f32::MIN];
    for p in points {
        let q = r * p + pose.translation.vector;
        if q.z < 0.05 {
            return None;
        }
        let (u, v) = (fx * q.x / q.z + cx, fy * q.y / q.z + cy);
        b = [b[0].min(u), b[1].min(v), b[2].max(u), b[3].max(v)];
    }
    let clip = |x: f32, most: usize| f64::from(x).clamp(0.0, most as f64 - 1.0);
    Some([clip(b[0], k.width), clip(b[1], k.height), clip(b[2], k.width), clip(b[3], k.height)])
}
