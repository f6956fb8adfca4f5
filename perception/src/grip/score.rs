//! How well a rendered hypothesis explains the frame.
//!
//! DIFFERENCE to the paper's W (its equation "weight"): the hard inlier test is a soft kernel; a hypothesis in front of
//! what is seen (which the camera would have to look through) is penalised while one behind it is merely occluded; points of
//! the support plane explain nothing; edges are compared along the silhouette. In the same search W finds .92 of the poses
//! where this score finds .97.

use super::settings::ScoreSettings;
use crate::hypotheses::Terms;

/// What each term gives to the score; 1 in all is a perfect explanation.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Parts {
    /// Depth that fits, less free space that is violated.
    pub fit: f32,
    /// Depth edges along the silhouette.
    pub edge: f32,
    /// Agreement with a box.
    pub boxes: f32,
    /// Penetration of the support plane; not positive.
    pub plane: f32,
    /// Pixels of the full resolution that are explained, in units of the kernel; no part of the score.
    pub explained: f32,
}

impl Parts {
    /// The score. 0 where the parts are not finite.
    pub fn score(&self) -> f32 {
        let sum = self.fit + self.edge + self.boxes + self.plane;
        if sum.is_finite() { sum } else { 0.0 }
    }

    /// By the names that people see.
    pub fn named(&self) -> [(&'static str, f32); 4] {
        [("fit", self.fit), ("edge", self.edge), ("box", self.boxes), ("plane", self.plane)]
    }
}

/// Weighs a hypothesis. `box_support` is the largest confidence times overlap of a box, 0 to 1; `lowest` the height of the
/// lowest point over the support plane, if there is one. Too few pixels are worth nothing.
pub(crate) fn parts(
    terms: &Terms,
    settings: &ScoreSettings,
    stride: usize,
    box_support: f32,
    lowest: Option<f32>,
) -> Parts {
    if terms.rendered * ((stride * stride) as f32) < settings.min_pixels {
        return Parts::default();
    }
    let explained = terms.rendered - terms.hole - settings.occlusion_discount * terms.occluded;
    let denominator = explained.max(settings.min_visible * terms.rendered);
    let fit = (terms.fit - settings.violation * terms.violated) / denominator;
    let edge = if terms.rim > 0.0 { terms.edge / terms.rim } else { 0.0 };
    let penetration = lowest.map_or(0.0, |lowest| {
        let depth = -lowest - settings.penetration_free_m as f32;
        (depth / settings.penetration_full_m as f32).clamp(0.0, 1.0)
    });
    let most = settings.fit_weight + settings.edge_weight + settings.box_weight;
    Parts {
        fit: settings.fit_weight * fit / most,
        edge: settings.edge_weight * edge / most,
        boxes: settings.box_weight * box_support / most,
        plane: -settings.plane_weight * penetration / most,
        explained: terms.fit * (stride * stride) as f32,
    }
}
