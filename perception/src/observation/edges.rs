//! Depth edges, and how near each pixel is to one.

use grip_sim::frame::CameraFrame;

use super::settings::ObservationSettings;
use crate::frame::is_reading;

/// Pixels at full resolution with a reading whose next reading to some side is farther by the jump: the near
/// side of depth edges.
pub(super) fn near_edges(frame: &CameraFrame, settings: &ObservationSettings) -> Vec<bool> {
    let (depth, width, height) = (frame.depth.data(), frame.intrinsics.width, frame.intrinsics.height);
    let jump = settings.edge_jump_m as f32;
    let mut edges = vec![false; depth.len()];
    // The last reading in the row, and those in the columns: indices.
    const NONE: usize = usize::MAX;
    let mut above = vec![NONE; width];
    for v in 0..height {
        let mut left = NONE;
        for (u, above) in above.iter_mut().enumerate() {
            let i = v * width + u;
            if !is_reading(depth[i]) {
                continue;
            }
            for (before, step) in [(left, 1), (*above, width)] {
                if before == NONE {
                    continue;
                }
                let gap = (i - before) / step;
                let difference = depth[i] - depth[before];
                if gap <= settings.edge_reach_px
                    && difference.abs() > jump + settings.edge_slope_m * (gap - 1) as f32
                {
                    edges[if difference > 0.0 { before } else { i }] = true;
                }
            }
            left = i;
            *above = i;
        }
    }
    edges
}

/// `exp(-d^2 / 2 sigma^2)` with d the Euclidean distance to the nearest marked pixel, exact up to three sigma.
pub(super) fn soft_distance(marked: &[bool], pitch: usize, sigma: f32) -> Vec<f32> {
    let reach = (3.0 * sigma).ceil() as usize;
    let far = (reach + 1) as f32;
    let rows = marked.len() / pitch;
    // Squared distance along the row, by a sweep each way.
    let mut along = vec![far * far; marked.len()];
    for (row, out) in marked.chunks_exact(pitch).zip(along.chunks_exact_mut(pitch)) {
        let mut d = far;
        for (m, o) in row.iter().zip(out.iter_mut()) {
            d = if *m { 0.0 } else { (d + 1.0).min(far) };
            *o = d * d;
        }
        d = far;
        for (m, o) in row.iter().zip(out.iter_mut()).rev() {
            d = if *m { 0.0 } else { (d + 1.0).min(far) };
            *o = o.min(d * d);
        }
    }
    // Then the least over the rows near by.
    let mut best = vec![far * far; marked.len()];
    for v in 0..rows {
        for other in v.saturating_sub(reach)..(v + reach + 1).min(rows) {
            let dv = (other as f32 - v as f32).powi(2);
            let source = &along[other * pitch..(other + 1) * pitch];
            for (o, a) in best[v * pitch..(v + 1) * pitch].iter_mut().zip(source) {
                *o = o.min(a + dv);
            }
        }
    }
    // Most pixels are far from any edge: spare them the exponential.
    let scale = -0.5 / (sigma * sigma);
    for b in &mut best {
        *b = if *b >= far * far { 0.0 } else { (*b * scale).exp() };
    }
    best
}
