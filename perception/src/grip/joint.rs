//! Two objects cannot be in one place: the light joint step after the independent searches.

use nalgebra::Isometry3;

use super::model::Model;
use crate::hypotheses::{Observation, Raster, render};

/// Stride and triangles at which claims are drawn.
const STRIDE: usize = 2;
const TRIANGLES: usize = 500;
/// A pixel is explained when the surfaces are this many epsilons apart at most.
const KERNEL: f32 = 2.0;

/// Marks the pixels (of the padded level with stride 2) that a posed object explains: rendered there, and where the
/// reading is.
pub(crate) fn explained(model: &Model, pose: &Isometry3<f32>, observation: &Observation) -> Vec<bool> {
    let level = observation.level(STRIDE);
    let mut marks = vec![false; level.w.len()];
    let mut raster = Raster::default();
    if render(&mut raster, model.lod(TRIANGLES), pose, level, None).is_none() {
        return marks;
    }
    for (u, v, w) in raster.tile.pixels() {
        let i = level.index(u, v);
        let close = (level.w[i] - w).abs() < KERNEL * level.tol[i] * w;
        marks[i] = level.w[i] > 0.0 && close && level.weight[i] > 0.0;
    }
    marks
}

/// The share of the smaller of two sets of pixels that is in both; 0 when one is empty.
pub(crate) fn overlap(a: &[bool], b: &[bool]) -> f64 {
    let count = |m: &[bool]| m.iter().filter(|x| **x).count();
    let both = a.iter().zip(b).filter(|(x, y)| **x && **y).count();
    let smaller = count(a).min(count(b));
    if smaller == 0 { 0.0 } else { both as f64 / smaller as f64 }
}

/// Adds the marks of `b`, grown by one pixel, to `a`: the rim of an object is explained by it, too.
pub(crate) fn claim(a: &mut [bool], b: &[bool], pitch: usize) {
    for i in pitch + 1..a.len().saturating_sub(pitch + 1) {
        let grown = b[i] || b[i - 1] || b[i + 1] || b[i - pitch] || b[i + pitch];
        a[i] |= grown;
    }
}
