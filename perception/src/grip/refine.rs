//! Gauss-Newton on the depth residual: point to plane at the same pixel.

use nalgebra::{Isometry3, Matrix6, Translation3, UnitQuaternion, Vector3, Vector6};

use super::observation::{LANES, Level};
use super::raster::{Tile, lanes};

/// The kernel of the refinement is at least this many epsilons wide, or it could not pull from anywhere.
const MIN_KERNEL: f32 = 2.0;
/// A step never turns farther, radians, nor moves farther, metres: beyond, the linearisation means nothing.
const MAX_TURN: f32 = 0.4;
const MAX_MOVE: f32 = 0.05;

/// Normal equations of one step, sums over pixels: the upper triangle of `J^T W J`, row by row, then `J^T W r`.
/// Unknowns are rotation (times the object's radius) and translation.
pub(crate) type Sums = [f32; 27];

/// Sums the normal equations over a tile rendered at a pose whose translation is `centre`.
///
/// The rendered surface at a pixel is the plane `n . p = 1` with `n = (fx w_u, fy w_v, w - w_u (u - cx) - w_v (v - cy))`,
/// w_u and w_v the differences of rendered inverse depth; the residual is the distance of the observed point of the same
/// pixel from it, `(w / w' - 1) / |n|`. Tukey's weight `(1 - q^2)^2` times the plane weight; everything that is not an
/// inlier is set to zero by selection, not by multiplication: NaN times 0 is NaN.
pub(crate) fn accumulate(tile: &Tile, level: &Level, kernel: f32, centre: &Vector3<f32>, radius: f32) -> Sums {
    let kernel = kernel.max(MIN_KERNEL);
    let mut sums = [[0.0f32; LANES]; 27];
    let (inverse_fx, inverse_fy) = (1.0 / level.fx, 1.0 / level.fy);
    let scale = 1.0 / radius;
    for y in 0..tile.height {
        let dv = (tile.v0 + y as i32) as f32 - level.cy;
        for x in (0..tile.width).step_by(LANES) {
            let t = tile.index(x, y);
            let o = level.index(tile.u0 + x as i32, tile.v0 + y as i32);
            let w = lanes(&tile.w, t);
            let (left, right) = (lanes(&tile.w, t - 1), lanes(&tile.w, t + 1));
            let (up, down) = (lanes(&tile.w, t - tile.pitch), lanes(&tile.w, t + tile.pitch));
            let (seen, tol, weight) = (lanes(&level.w, o), lanes(&level.tol, o), lanes(&level.weight, o));
            let mut j = [[0.0f32; LANES]; 6];
            let mut pull = [0.0f32; LANES];
            let mut residual = [0.0f32; LANES];
            let first = (tile.u0 + x as i32) as f32 - level.cx;
            let mut any = 0.0;
            for i in 0..LANES {
                let safe = if w[i] > 0.0 { w[i] } else { 1.0 };
                let read = if seen[i] > 0.0 { seen[i] } else { 1.0 };
                let q = (read - safe) / (kernel * tol[i] * safe);
                let inside = 1.0 - q * q;
                let has_u = left[i] + right[i] > 0.0;
                let has_v = up[i] + down[i] > 0.0;
                let usable = (w[i] > 0.0) & (seen[i] > 0.0) & (inside > 0.0) & has_u & has_v;
                let k = if usable { inside * inside * weight[i] } else { 0.0 };
                // Central differences, one-sided at the rim.
                let before = if left[i] > 0.0 { left[i] } else { safe };
                let after = if right[i] > 0.0 { right[i] } else { safe };
                let both = if (left[i] > 0.0) & (right[i] > 0.0) { 0.5 } else { 1.0 };
                let wu = (after - before) * both;
                let before = if up[i] > 0.0 { up[i] } else { safe };
                let after = if down[i] > 0.0 { down[i] } else { safe };
                let both = if (up[i] > 0.0) & (down[i] > 0.0) { 0.5 } else { 1.0 };
                let wv = (after - before) * both;
                let du = first + i as f32;
                let n = [level.fx * wu, level.fy * wv, safe - wu * du - wv * dv];
                let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
                let length = if length > 1e-6 { length } else { 1.0 };
                let inverse = 1.0 / length;
                let n = [n[0] * inverse, n[1] * inverse, n[2] * inverse];
                let depth = 1.0 / safe;
                let arm = [
                    (du * inverse_fx * depth - centre.x) * scale,
                    (dv * inverse_fy * depth - centre.y) * scale,
                    (depth - centre.z) * scale,
                ];
                j[0][i] = arm[1] * n[2] - arm[2] * n[1];
                j[1][i] = arm[2] * n[0] - arm[0] * n[2];
                j[2][i] = arm[0] * n[1] - arm[1] * n[0];
                j[3][i] = n[0];
                j[4][i] = n[1];
                j[5][i] = n[2];
                residual[i] = (safe / read - 1.0) * inverse;
                pull[i] = k;
                any += k;
            }
            if any == 0.0 {
                continue;
            }
            let mut slot = 0;
            for a in 0..6 {
                let mut pulled = [0.0f32; LANES];
                for i in 0..LANES {
                    pulled[i] = pull[i] * j[a][i];
                }
                for other in &j[a..6] {
                    for i in 0..LANES {
                        sums[slot][i] += pulled[i] * other[i];
                    }
                    slot += 1;
                }
                for i in 0..LANES {
                    sums[21 + a][i] += pulled[i] * residual[i];
                }
            }
        }
    }
    sums.map(|s| s.iter().sum())
}

/// The pose after one damped step; the same pose when there is nothing to go by.
pub(crate) fn step(pose: &Isometry3<f32>, sums: &Sums, radius: f32, damping: f32) -> Isometry3<f32> {
    let mut h = Matrix6::zeros();
    let mut slot = 0;
    for a in 0..6 {
        for b in a..6 {
            h[(a, b)] = sums[slot];
            h[(b, a)] = sums[slot];
            slot += 1;
        }
    }
    let g = Vector6::from_column_slice(&sums[21..27]);
    let trace = h.trace();
    if !(trace > 0.0 && trace.is_finite()) {
        return *pose;
    }
    for a in 0..6 {
        // Relative damping, and a floor for directions that depth does not see, such as a can's turn about its axis.
        h[(a, a)] += damping * h[(a, a)] + 1e-4 * trace;
    }
    let Some(cholesky) = h.cholesky() else {
        return *pose;
    };
    let x = cholesky.solve(&g);
    let turn = limited(x.fixed_rows::<3>(0) / radius, MAX_TURN);
    let shift = limited(x.fixed_rows::<3>(3).into_owned(), MAX_MOVE);
    if !turn.iter().chain(shift.iter()).all(|x| x.is_finite()) {
        return *pose;
    }
    let mut rotation = UnitQuaternion::from_scaled_axis(turn) * pose.rotation;
    rotation.renormalize();
    Isometry3::from_parts(Translation3::from(pose.translation.vector + shift), rotation)
}

fn limited(v: Vector3<f32>, most: f32) -> Vector3<f32> {
    let length = v.norm();
    if length > most { v * (most / length) } else { v }
}
