//! What the kernels are tested against: the same picture and the same sums, pixel by pixel in f64, as plainly as can be.

use std::collections::HashMap;

use nalgebra::{Isometry3, Point3};

use super::compare::Terms;
use super::lod::Lod;
use crate::observation::Level;

/// Depth by pixel (column, row), one pixel beyond the image included, metres.
pub(crate) type Picture = HashMap<(i32, i32), f64>;

/// Draws a mesh by barycentric coordinates; `slack` is how far outside of its edges a triangle is drawn, pixels.
pub(crate) fn picture(lod: &Lod, pose: &Isometry3<f32>, level: &Level, slack: f64) -> Picture {
    let vertex = |i: u32| {
        let (block, lane) = (i as usize / grip_sim::lanes::LANES, i as usize % grip_sim::lanes::LANES);
        let [x, y, z] = lod.blocks[block].map(|axis| f64::from(axis.0[lane]));
        let p = pose.cast::<f64>() * Point3::new(x, y, z);
        let (fx, fy) = (f64::from(level.fx), f64::from(level.fy));
        [p.x / p.z * fx + f64::from(level.cx), p.y / p.z * fy + f64::from(level.cy), 1.0 / p.z]
    };
    let mut picture = Picture::new();
    for [a, b, c] in lod.triangles.iter().map(|t| t.map(vertex)) {
        // Twice the signed area of a triangle of points.
        let area = |p: [f64; 3], q: [f64; 3], r: [f64; 3]| {
            (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        };
        let whole = area(a, b, c);
        if whole >= 0.0 {
            continue;
        }
        let length = |p: [f64; 3], q: [f64; 3]| (q[0] - p[0]).hypot(q[1] - p[1]);
        let range = |axis: usize, size: usize| {
            let (low, high) = [a, b, c]
                .iter()
                .fold((f64::MAX, f64::MIN), |(low, high), p| (low.min(p[axis]), high.max(p[axis])));
            (low.floor() as i32).max(-1)..=(high.ceil() as i32).min(size as i32)
        };
        for v in range(1, level.height) {
            for u in range(0, level.width) {
                let p = [f64::from(u), f64::from(v), 0.0];
                let parts = [area(p, b, c), area(a, p, c), area(a, b, p)];
                let sides = [length(b, c), length(c, a), length(a, b)];
                if parts.iter().zip(sides).any(|(part, side)| *part > slack * side) {
                    continue;
                }
                let w = (parts[0] * a[2] + parts[1] * b[2] + parts[2] * c[2]) / whole;
                let nearest = a[2].max(b[2]).max(c[2]);
                let z = 1.0 / w.min(nearest);
                let seen = picture.entry((u, v)).or_insert(z);
                *seen = seen.min(z);
            }
        }
    }
    picture
}

/// The sums of [`Terms`], one pixel at a time.
pub(crate) fn terms(picture: &Picture, level: &Level, kernel: f64) -> Terms {
    let mut sums = [0.0f64; 7];
    for (&(u, v), z) in picture {
        let i = level.index(u, v);
        let (w, seen) = (1.0 / z, f64::from(level.w[i]));
        sums[0] += 1.0;
        if seen <= 0.0 {
            sums[1] += 1.0;
            continue;
        }
        let q = (seen - w) / (kernel * f64::from(level.tol[i]) * w);
        if q >= 1.0 {
            sums[2] += 1.0;
        } else {
            sums[3] += f64::from(u8::from(q < -1.0));
            let inner = [(-1, 0), (1, 0), (0, -1), (0, 1)]
                .iter()
                .all(|(du, dv)| picture.contains_key(&(u + du, v + dv)));
            if !inner {
                sums[5] += 1.0;
                sums[6] += f64::from(level.edge[i]);
            }
        }
        sums[4] += (1.0 - q * q).max(0.0) * f64::from(level.weight[i]);
    }
    let [rendered, hole, occluded, violated, fit, rim, edge] = sums.map(|s| s as f32);
    Terms { rendered, hole, occluded, violated, fit, rim, edge }
}
