//! What every second stage offers.

use std::sync::Arc;

use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;

use crate::detector::Detections;
use crate::error::Result;
use crate::posterior::PosePosterior;

/// Estimates object poses from one frame.
pub trait PoseEstimator: Send + Sync {
    /// Short name for reports, such as `grip`.
    fn name(&self) -> &'static str;

    /// One posterior for each of `objects`, in their order. An object that is not in view gets a posterior too, with a
    /// low [`PosePosterior::confidence`]. Equal arguments give equal results (but for the wall time), whatever the
    /// number of threads.
    ///
    /// # Errors
    /// When the frame holds no depth, an object has no triangles, a setting is out of range, or a graphics device fails.
    fn estimate(
        &self,
        frame: &CameraFrame,
        detections: &Detections,
        objects: &[Arc<ObjectModel>],
        seed: u64,
    ) -> Result<Vec<PosePosterior>>;
}
