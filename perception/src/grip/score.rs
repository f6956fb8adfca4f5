//! How well a rendered hypothesis explains the frame.
//!
//! DIFFERENCE to the paper's W (its equation "weight"): the hard inlier test is a soft kernel; a hypothesis in front of
//! what is seen (which the camera would have to look through) is penalised while one behind it is merely occluded; points of
//! the support plane explain nothing; edges are compared along the silhouette. In the same search W finds .92 of the poses
//! where this score finds .97.

use super::lanes::{F8, LANES, per_machine};
use super::observation::Level;
use super::raster::Tile;
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

per_machine! {
    /// Compares a tile with a level. With `q = (w' - w) / (kernel tol w)`, w' observed and w rendered inverse depth, the
    /// fit is `max(0, 1 - q^2)`; |q| = 1 is where the two points are kernel times epsilon apart.
    pub(crate) fn compare(tile: &Tile, level: &Level, kernel: f32) -> Terms => compare_body
}

#[inline(always)]
pub(super) fn compare_body(tile: &Tile, level: &Level, kernel: f32) -> Terms {
    let (zero, one, kernel) = (F8::ZERO, F8::all(1.0), F8::all(kernel));
    let (values, pitch) = (tile.values(), tile.pitch());
    let mut sums = [F8::ZERO; 7];
    for y in 0..tile.height {
        let row = tile.index(0, y);
        let observed = level.index(tile.u0, tile.v0 + y as i32);
        for x in (0..tile.width).step_by(LANES) {
            let (t, o) = (row + x, observed + x);
            let w = F8::load(values, t);
            let rendered = w.positive(one, zero);
            if rendered == zero {
                continue;
            }
            let safe = w.positive(w, one);
            let seen = F8::load(&level.w, o);
            let read = seen.positive(rendered, zero);
            let q = (seen - safe) / (kernel * F8::load(&level.tol, o) * safe);
            let fit = (one - q * q).max(zero);
            let visible = one.above(q, read, zero);
            let across = F8::load(values, t - 1).min(F8::load(values, t + 1));
            let along = F8::load(values, t - pitch).min(F8::load(values, t + pitch));
            let rim = across.min(along).positive(zero, visible);
            sums[0] += rendered;
            sums[1] += rendered - read;
            sums[2] += read - visible;
            sums[3] += (zero - q).above(one, read, zero);
            sums[4] += fit * F8::load(&level.weight, o) * read;
            sums[5] += rim;
            sums[6] += rim * F8::load(&level.edge, o);
        }
    }
    let [rendered, hole, occluded, violated, fit, rim, edge] = sums.map(F8::sum);
    Terms { rendered, hole, occluded, violated, fit, rim, edge }
}

impl Terms {
    /// The score: 1 is a perfect explanation. `box_support` is the largest confidence times overlap of a box, 0 to 1;
    /// `lowest` the height of the lowest point over the support plane, if there is one.
    pub fn score(
        &self,
        settings: &GripSettings,
        stride: usize,
        box_support: f32,
        lowest: Option<f32>,
    ) -> f32 {
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
        let gain =
            settings.fit_weight * fit + settings.edge_weight * edge + settings.box_weight * box_support;
        let most = settings.fit_weight + settings.edge_weight + settings.box_weight;
        let score = (gain - settings.plane_weight * penetration) / most;
        if score.is_finite() { score } else { 0.0 }
    }
}
