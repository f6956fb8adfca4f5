//! Where the flat pads of a parallel gripper touch an object: rays from the pads give the points where they first meet it,
//! and thus the width, the contact normals and the share of the pad in contact.

use nalgebra::{Isometry3, Matrix2, Point3, Vector2, Vector3};

use crate::surface::{Surface, SurfacePoint};

/// Where two flat pads would touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PadContact {
    /// Distance of the pads, metres.
    pub width: f64,
    /// Middle between the pads along the closing axis, gripper frame, metres.
    pub center: f64,
    /// Lesser share of a pad in contact.
    pub share: f64,
    /// Largest angle between a mean contact normal and the closing axis, radians.
    pub cone_angle: f64,
    /// Middle of the contacts along the fingers, gripper frame, metres.
    pub depth: f64,
    /// How far the contacts spread in the direction in which they do least, one standard deviation, metres: 0 for a line,
    /// about which the object would turn. The lesser of both sides.
    pub spread: f64,
}

/// Depth of the contact patch, metres: what a flat pad covers of a slightly curved surface.
const PATCH: f64 = 0.0015;

/// Contacts of the two pads whose middles are farther apart than this, along the pads, do not face each other, metres.
const FACING: f64 = 0.015;

/// Rays of [`pad_contact`] along and across a pad. A coarse grid is enough to refuse a grasp; only a fine one (every 3 mm)
/// sees the rim of a can.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RayGrid {
    /// 5 by 3.
    Coarse,
    /// 21 by 9.
    Fine,
}

/// Closes flat pads from `opening` on the object at `object_from_gripper`; none when a pad meets nothing.
pub fn pad_contact(
    surface: &Surface,
    pad_half: &Vector3<f64>,
    object_from_gripper: &Isometry3<f64>,
    opening: f64,
    grid: RayGrid,
) -> Option<PadContact> {
    let closing = object_from_gripper * Vector3::y();
    let right = pad_side(surface, pad_half, object_from_gripper, opening, closing, grid)?;
    let left = pad_side(surface, pad_half, object_from_gripper, opening, -closing, grid)?;
    // Contacts that do not face each other make a couple that turns the object.
    let apart = (left.center - right.center).norm();
    let width = left.height + right.height;
    (apart < FACING && width > 0.001).then(|| PadContact {
        width,
        center: 0.5 * (right.height - left.height),
        share: left.share.min(right.share),
        cone_angle: left.angle.max(right.angle),
        depth: 0.5 * (left.center.x + right.center.x),
        spread: left.spread.min(right.spread),
    })
}

/// What one pad touches.
struct PadSide {
    /// Height of the surface towards the pad over the middle between the pads, metres.
    height: f64,
    /// Share of the pad in contact.
    share: f64,
    /// Between the mean normal and the closing axis, radians.
    angle: f64,
    /// Middle of the contacts on the pad, along and across, metres.
    center: Vector2<f64>,
    /// Standard deviation of the contacts in the direction in which they spread least, metres.
    spread: f64,
}

/// What the pad on the side `out` of the object's middle meets first.
fn pad_side(
    surface: &Surface,
    pad_half: &Vector3<f64>,
    object_from_gripper: &Isometry3<f64>,
    opening: f64,
    out: Vector3<f64>,
    grid: RayGrid,
) -> Option<PadSide> {
    let counts: [usize; 2] = match grid {
        RayGrid::Coarse => [5, 3],
        RayGrid::Fine => [21, 9],
    };
    let place = |i: usize, n: usize| (2.0 * i as f64 + 1.0) / n as f64 - 1.0;
    let mut hits: Vec<(f64, SurfacePoint, Vector2<f64>)> = Vec::with_capacity(counts[0] * counts[1]);
    for i in 0..counts[0] {
        for j in 0..counts[1] {
            let at = Vector2::new(place(i, counts[0]) * pad_half.x, place(j, counts[1]) * pad_half.z);
            let from = object_from_gripper * Point3::new(at.x, 0.0, at.y) + out * (0.5 * opening);
            if let Some(hit) = surface.enter(&from, &-out, opening) {
                hits.push((0.5 * opening - (hit.point - from).norm(), hit, at));
            }
        }
    }
    let found = hits.len();
    if grid == RayGrid::Fine {
        // What is narrower than the grid, such as a rim, has edges.
        let axes = object_from_gripper.rotation.to_rotation_matrix();
        let [x, z] = [0, 2].map(|axis| axes.matrix().column(axis).into_owned());
        let origin = object_from_gripper.translation.vector;
        for vertex in surface.edges() {
            let p = vertex.point.coords - origin;
            let height = p.dot(&out);
            if height <= 0.0 || height > 0.5 * opening {
                continue;
            }
            let at = Vector2::new(p.dot(&x), p.dot(&z));
            if at.x.abs() <= pad_half.x && at.y.abs() <= pad_half.z {
                hits.push((height, *vertex, at));
            }
        }
    }
    let height = hits.iter().map(|h| h.0).fold(f64::NEG_INFINITY, f64::max);
    if !height.is_finite() {
        return None;
    }
    let rays = counts[0] * counts[1];
    let share = hits.iter().take(found).filter(|h| h.0 >= height - PATCH).count() as f64 / rays as f64;
    hits.retain(|h| h.0 >= height - PATCH);
    let count = hits.len() as f64;
    let normal: Vector3<f64> = hits.iter().map(|h| h.1.normal).sum();
    let center = hits.iter().map(|h| h.2).sum::<Vector2<f64>>() / count;
    let scatter: Matrix2<f64> =
        hits.iter().map(|h| (h.2 - center) * (h.2 - center).transpose()).sum::<Matrix2<f64>>() / count;
    Some(PadSide {
        height,
        share,
        angle: normal.angle(&out),
        center,
        spread: scatter.symmetric_eigenvalues().min().max(0.0).sqrt(),
    })
}
