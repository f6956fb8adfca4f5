//! Gauss-Newton on the depth residual: point to plane at the same pixel.

use nalgebra::{Isometry3, Matrix6, Translation3, UnitQuaternion, Vector3, Vector6};

use super::raster::Tile;
use crate::observation::Level;
use grip_sim::lanes::{F8, LANES, blocks, per_machine};

/// The kernel of the refinement is at least this many epsilons wide, or it could not pull from anywhere.
const MIN_KERNEL: f32 = 2.0;
/// A step never turns farther, radians, nor moves farther, metres: beyond, the linearisation means nothing.
const MAX_TURN: f32 = 0.4;
const MAX_MOVE: f32 = 0.05;

/// Of a tile that has many rows this many at least pull, and one in [`SPARSEST`] at least: neighbouring rows say the same.
const PULLING_ROWS: usize = 12;
const SPARSEST: usize = 3;

/// Normal equations of one step, sums over pixels: the upper triangle of `J^T W J`, row by row, then `J^T W r`.
/// Unknowns are rotation (times the object's radius) and translation.
pub(crate) type Sums = [f32; 27];

per_machine! {
    /// Sums the normal equations over a tile rendered at a pose whose translation is `centre`.
    ///
    /// The rendered surface at a pixel is the plane `n . p = 1` with `n = (fx w_u, fy w_v, w - w_u (u - cx) - w_v (v - cy))`,
    /// w_u and w_v the differences of rendered inverse depth; the residual is the distance of the observed point of the
    /// same pixel from it, `(w / w' - 1) / |n|`. Tukey's weight `(1 - q^2)^2` times the plane weight; everything that is
    /// not an inlier is set to zero by selection, not by multiplication: NaN times 0 is NaN. Of many rows every second or
    /// third serves.
    pub(crate) fn accumulate(
        tile: &Tile,
        level: &Level,
        kernel: f32,
        centre: &Vector3<f32>,
        radius: f32,
    ) -> Sums => accumulate_body
}

/// Central difference at a pixel of value `at`, one-sided at the rim.
#[inline(always)]
fn difference(before: F8, at: F8, after: F8) -> F8 {
    let both = before.min(after).positive(F8::all(0.5), F8::all(1.0));
    (after.positive(after, at) - before.positive(before, at)) * both
}

#[inline(always)]
pub(super) fn accumulate_body(
    tile: &Tile,
    level: &Level,
    kernel: f32,
    centre: &Vector3<f32>,
    radius: f32,
) -> Sums {
    let (zero, one) = (F8::ZERO, F8::all(1.0));
    let kernel = F8::all(kernel.max(MIN_KERNEL));
    let (fx, fy) = (F8::all(level.fx), F8::all(level.fy));
    let (inverse_fx, inverse_fy) = (F8::all(1.0 / level.fx), F8::all(1.0 / level.fy));
    let (scale, centre) = (F8::all(1.0 / radius), centre.map(F8::all));
    let (values, pitch) = (tile.values(), tile.pitch());
    let mut sums = [F8::ZERO; 27];
    let every = (tile.height / PULLING_ROWS).clamp(1, SPARSEST);
    for y in (0..tile.height).step_by(every) {
        let row = tile.index(0, y);
        let observed = level.index(tile.u0, tile.v0 + y as i32);
        let dv = F8::all((tile.v0 + y as i32) as f32 - level.cy);
        let count = tile.width.div_ceil(LANES);
        let [here, left, right, up, down] =
            [row, row - 1, row + 1, row - pitch, row + pitch].map(|at| blocks(values, at, count));
        let [seen, tol, weight] =
            [&level.w, &level.tol, &level.weight].map(|values| blocks(values, observed, count));
        for b in 0..count {
            let w = F8(here[b]);
            let safe = w.positive(w, one);
            let seen = F8(seen[b]);
            let read = seen.positive(seen, one);
            let width = kernel * F8(tol[b]);
            // One division for three: they are most of the work.
            let product = one / (safe * read * width);
            let q = (read - safe) * (product * read);
            let inside = one - q * q;
            let pull = inside.positive(inside * inside * F8(weight[b]), zero);
            let pull = w.positive(seen.positive(pull, zero), zero);
            let (left, right) = (F8(left[b]), F8(right[b]));
            let (up, down) = (F8(up[b]), F8(down[b]));
            // A pixel with no neighbour in a row or column has no normal.
            let pull = left.max(right).min(up.max(down)).positive(pull, zero);
            if pull == zero {
                continue;
            }
            let (wu, wv) = (difference(left, safe, right), difference(up, safe, down));
            let du = F8::INDEX + F8::all((tile.u0 + (b * LANES) as i32) as f32 - level.cx);
            // The normal as it comes: its length is in both factors of every sum, so its square is taken out of the weight.
            let n = [fx * wu, fy * wv, safe - wu * du - wv * dv];
            let squared = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
            let pull = pull / squared.max(F8::all(1e-12));
            let depth = product * read * width;
            let arm = [
                (du * inverse_fx * depth - centre.x) * scale,
                (dv * inverse_fy * depth - centre.y) * scale,
                (depth - centre.z) * scale,
            ];
            let j = [
                arm[1] * n[2] - arm[2] * n[1],
                arm[2] * n[0] - arm[0] * n[2],
                arm[0] * n[1] - arm[1] * n[0],
                n[0],
                n[1],
                n[2],
            ];
            let residual = (safe - read) * (product * safe * width);
            let mut slot = 0;
            for a in 0..6 {
                let pulled = pull * j[a];
                for other in &j[a..6] {
                    sums[slot] += pulled * *other;
                    slot += 1;
                }
                sums[21 + a] += pulled * residual;
            }
        }
    }
    sums.map(F8::sum)
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
