//! The print of an object as the camera would see it at a pose.

use grip_sim::lanes::LANES;
use nalgebra::{Isometry3, Point3, Vector3};

use crate::model::{Print, PrintedPoint};
use crate::observation::Level;

/// Side of a [cell](super::agreement), pixels: two of these make one of the wider kind.
pub(super) const CELL: usize = LANES;
/// Points that face away more than this (cosine) are too slanted to be read.
const SLANTED: f32 = 0.1;
/// Of two points in one pixel the farther is hidden when it is more than this many spacings behind.
const HIDDEN: f32 = 3.0;
/// A reading that differs by more than this many epsilons is of something else.
const SEEN: f32 = 3.0;

/// An image of the print. Pixels that are not drawn, or where the depth image shows something else, are 0 in all planes.
#[derive(Debug, Default)]
pub(super) struct Sheet {
    /// Pixel of the level at the first column and row; multiples of twice [`CELL`].
    pub u0: i32,
    pub v0: i32,
    /// Pixels a row and rows, multiples of twice [`CELL`], too.
    pub width: usize,
    pub height: usize,
    /// 1 where it is drawn.
    pub mask: Vec<f32>,
    pub looks: [Vec<f32>; 3],
    /// Outward normals of the surface, optical frame.
    pub normals: [Vec<f32>; 3],
    /// Pixels drawn.
    pub pixels: usize,
}

/// A point of the print in the image.
struct Projected {
    u: i32,
    v: i32,
    z: f32,
    normal: Vector3<f32>,
    look: [f32; 3],
}

impl Sheet {
    /// Draws one point in `every` at a pose; `None` where nothing of it is seen.
    pub fn draw(print: &Print, pose: &Isometry3<f32>, level: &Level, every: usize) -> Option<Self> {
        let r = pose.rotation.to_rotation_matrix();
        let (right, bottom) = (level.width as f32 - 0.5, level.height as f32 - 0.5);
        // Where the camera is, in the object's frame: half of the points face away, and are not even turned.
        let eye = pose.inverse_transform_point(&Point3::origin()).coords;
        let project = |point: &PrintedPoint| {
            let ray = eye - point.position;
            let facing = point.normal.dot(&ray);
            if facing <= 0.0 || facing * facing < SLANTED * SLANTED * ray.norm_squared() {
                return None;
            }
            let p = r * point.position + pose.translation.vector;
            let w = 1.0 / p.z;
            let (u, v) = (level.fx * p.x * w + level.cx, level.fy * p.y * w + level.cy);
            if !(p.z > 0.0 && u > -0.5 && v > -0.5 && u < right && v < bottom) {
                return None;
            }
            let (u, v) = ((u + 0.5) as i32, (v + 0.5) as i32);
            Some(Projected { u, v, z: p.z, normal: r * point.normal, look: point.look })
        };
        let points: Vec<Projected> = print.points.iter().step_by(every).filter_map(project).collect();
        let cell = 2 * CELL as i32;
        let range = |of: fn(&Projected) -> i32| {
            let (least, most) = (points.iter().map(of).min()?, points.iter().map(of).max()?);
            let first = least.div_euclid(cell) * cell;
            Some((first, ((most - first) as usize + 1).next_multiple_of(2 * CELL)))
        };
        let ((u0, width), (v0, height)) = (range(|p| p.u)?, range(|p| p.v)?);
        let mut sheet = Self { u0, v0, width, height, ..Self::default() };
        let size = width * height;
        let index = |p: &Projected| (p.v - v0) as usize * width + (p.u - u0) as usize;
        let mut nearest = vec![f32::MAX; size];
        for p in &points {
            let i = index(p);
            nearest[i] = nearest[i].min(p.z);
        }
        let reach = HIDDEN * print.spacing * (every as f32).sqrt();
        sheet.mask = vec![0.0; size];
        for plane in sheet.looks.iter_mut().chain(&mut sheet.normals) {
            *plane = vec![0.0; size];
        }
        for p in points.iter().filter(|p| p.z <= nearest[index(p)] + reach) {
            let i = index(p);
            sheet.mask[i] += 1.0;
            for c in 0..3 {
                sheet.looks[c][i] += p.look[c];
                sheet.normals[c][i] += p.normal[c];
            }
        }
        for v in 0..height {
            for u in 0..width {
                let i = v * width + u;
                let count = sheet.mask[i];
                if count == 0.0 {
                    continue;
                }
                let w = 1.0 / nearest[i];
                let at = level.index(u0 + u as i32, v0 + v as i32);
                let read = level.w[at];
                let shown = read <= 0.0 || (read - w).abs() < SEEN * level.tol[at] * w;
                let (mask, share) = if shown { (1.0, 1.0 / count) } else { (0.0, 0.0) };
                sheet.mask[i] = mask;
                sheet.pixels += usize::from(shown);
                for c in 0..3 {
                    sheet.looks[c][i] *= share;
                    sheet.normals[c][i] *= share;
                }
            }
        }
        (sheet.pixels > 0).then_some(sheet)
    }
}
