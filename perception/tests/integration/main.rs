//! The second stage on whole frames, as one program: each would link all of the crate.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

mod gpu;
mod joint;
mod real_frame;
mod robust;
mod synthetic;
mod track;

use grip_perception::metrics;
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Camera, Object, Pose};

/// ADD-S over 1000 points of the surface, metres.
fn adds(model: &ObjectModel, truth: &Pose<Camera, Object>, estimate: &Pose<Camera, Object>) -> f64 {
    let points = metrics::sample_points(&model.visual.mesh.positions, 1000);
    metrics::adds(&points, truth, estimate)
}
