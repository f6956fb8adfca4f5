//! A rendered hypothesis against the frame, pixel by pixel.

use super::raster::Tile;
use crate::observation::Level;
use grip_sim::lanes::{F8, LANES, blocks, in_memory, per_machine};

/// Sums over a rendered tile.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Terms {
    /// Rendered pixels,
    pub rendered: f32,
    /// of these: without a reading,
    pub hole: f32,
    /// with a reading in front,
    pub occluded: f32,
    /// with a reading behind: free space is violated.
    pub violated: f32,
    /// Sum of the kernel over inliers, weighted by height over the plane.
    pub fit: f32,
    /// Silhouette pixels that are read and not occluded,
    pub rim: f32,
    /// and the sum of depth edge evidence over them.
    pub edge: f32,
}

per_machine! {
    /// Compares a tile with a level. With `q = (w' - w) / (kernel tol w)`, w' observed and w rendered inverse depth, the
    /// fit is `max(0, 1 - q^2)`; |q| = 1 is where the two points are kernel times epsilon apart.
    pub(crate) fn compare(tile: &Tile, level: &Level, kernel: f32) -> Terms => compare_body
}

#[inline(always)]
pub(crate) fn compare_body(tile: &Tile, level: &Level, kernel: f32) -> Terms {
    let (zero, one, kernel) = (F8::ZERO, F8::all(1.0), F8::all(kernel));
    let (values, pitch) = (tile.values(), tile.pitch());
    let mut sums = [F8::ZERO; 7];
    for y in 0..tile.height {
        let row = tile.index(0, y);
        let observed = level.index(tile.u0, tile.v0 + y as i32);
        let count = tile.width.div_ceil(LANES);
        let [here, left, right, above, below] =
            [row, row - 1, row + 1, row - pitch, row + pitch].map(|at| blocks(values, at, count));
        let [seen, tol, weight, evidence] =
            [&level.w, &level.tol, &level.weight, &level.edge].map(|values| blocks(values, observed, count));
        for b in 0..count {
            let w = F8(here[b]);
            if w == zero {
                continue;
            }
            let rendered = w.positive(one, zero);
            let safe = w.positive(w, one);
            let seen = F8(seen[b]);
            let read = seen.positive(rendered, zero);
            let q = (seen - safe) / (kernel * F8(tol[b]) * safe);
            let fit = (one - q * q).max(zero) * F8(weight[b]) * read;
            let visible = one.above(q, read, zero);
            let across = F8(left[b]).min(F8(right[b]));
            let along = F8(above[b]).min(F8(below[b]));
            let rim = across.min(along).positive(zero, visible);
            let violated = (zero - q).above(one, read, zero);
            let sums = in_memory(&mut sums);
            sums[0] += rendered;
            sums[1] += read;
            sums[2] += visible;
            sums[3] += violated;
            sums[4] += fit;
            sums[5] += rim;
            sums[6] += rim * F8(evidence[b]);
        }
    }
    let [rendered, read, visible, violated, fit, rim, edge] = sums.map(F8::sum);
    Terms { rendered, hole: rendered - read, occluded: read - visible, violated, fit, rim, edge }
}
