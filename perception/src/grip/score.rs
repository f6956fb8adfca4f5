//! How well a rendered hypothesis explains the frame.
//!
//! DIFFERENCE to the paper's W (its equation "weight"): the hard inlier test is a soft kernel; a hypothesis in front of
//! what is seen (which the camera would have to look through) is penalised while one behind it is merely occluded; points of
//! the support plane explain nothing; edges are compared along the silhouette. In the same search W finds .92 of the poses
//! where this score finds .97.

use super::observation::{LANES, Level};
use super::raster::{Tile, lanes};
use super::settings::GripSettings;

/// Sums over a rendered tile.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Terms {
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

/// Compares a tile with a level. With `q = (w' - w) / (kernel tol w)`, w' observed and w rendered inverse depth, the
/// fit is `max(0, 1 - q^2)`; |q| = 1 is where the two points are kernel times epsilon apart.
pub(crate) fn compare(tile: &Tile, level: &Level, kernel: f32) -> Terms {
    let mut sums = [[0.0f32; LANES]; 7];
    for y in 0..tile.height {
        for x in (0..tile.width).step_by(LANES) {
            let t = tile.index(x, y);
            let o = level.index(tile.u0 + x as i32, tile.v0 + y as i32);
            let w = lanes(&tile.w, t);
            let (left, right) = (lanes(&tile.w, t - 1), lanes(&tile.w, t + 1));
            let (up, down) = (lanes(&tile.w, t - tile.pitch), lanes(&tile.w, t + tile.pitch));
            let (seen, tol) = (lanes(&level.w, o), lanes(&level.tol, o));
            let (weight, edge) = (lanes(&level.weight, o), lanes(&level.edge, o));
            for i in 0..LANES {
                let rendered = if w[i] > 0.0 { 1.0 } else { 0.0 };
                let safe = if w[i] > 0.0 { w[i] } else { 1.0 };
                let read = if seen[i] > 0.0 { rendered } else { 0.0 };
                let q = (seen[i] - safe) / (kernel * tol[i] * safe);
                let fit = 1.0 - q * q;
                let fit = if fit > 0.0 { fit } else { 0.0 };
                let visible = if q < 1.0 { read } else { 0.0 };
                let across = if left[i] < right[i] { left[i] } else { right[i] };
                let along = if up[i] < down[i] { up[i] } else { down[i] };
                let least = if across < along { across } else { along };
                let rim = if least > 0.0 { 0.0 } else { visible };
                sums[0][i] += rendered;
                sums[1][i] += rendered - read;
                sums[2][i] += read - visible;
                sums[3][i] += if q <= -1.0 { read } else { 0.0 };
                sums[4][i] += fit * weight[i] * read;
                sums[5][i] += rim;
                sums[6][i] += rim * edge[i];
            }
        }
    }
    let [rendered, hole, occluded, violated, fit, rim, edge] = sums.map(|s| s.iter().sum());
    Terms {
        rendered,
        hole,
        occluded,
        violated,
        fit,
        rim,
        edge,
    }
}

impl Terms {
    /// The score: 1 is a perfect explanation. `box_support` is the largest confidence times overlap of a box, 0 to 1;
    /// `lowest` the height of the lowest point over the support plane, if there is one.
    pub fn score(&self, settings: &GripSettings, stride: usize, box_support: f32, lowest: Option<f32>) -> f32 {
        if self.rendered * ((stride * stride) as f32) < settings.min_pixels {
            return 0.0;
        }
        let explained = self.rendered - self.hole - settings.occlusion_discount * self.occluded;
        let denominator = explained.max(settings.min_visible * self.rendered);
        let fit = (self.fit - settings.violation * self.violated) / denominator;
        let edge = if self.rim > 0.0 { self.edge / self.rim } else { 0.0 };
        let penetration = lowest.map_or(0.0, |lowest| {
            let depth = -lowest - settings.penetration_free_m as f32;
            (depth / settings.penetration_full_m as f32).clamp(0.0, 1.0)
        });
        let score = settings.fit_weight * fit + settings.edge_weight * edge
            + settings.box_weight * box_support
            - settings.plane_weight * penetration;
        if score.is_finite() { score } else { 0.0 }
    }
}
