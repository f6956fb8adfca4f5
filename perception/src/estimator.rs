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

    /// The same in a frame that follows one in which `before` was believed, of each of `objects` in their order: what the camera
    /// saw somewhere is now about there. An object of which nothing was believed is searched for, and so is every object by an
    /// estimator that does not follow.
    ///
    /// # Errors
    /// As [`PoseEstimator::estimate`].
    fn follow(
        &self,
        before: &[Option<PosePosterior>],
        frame: &CameraFrame,
        detections: &Detections,
        objects: &[Arc<ObjectModel>],
        seed: u64,
    ) -> Result<Vec<PosePosterior>> {
        let _ = before;
        self.estimate(frame, detections, objects, seed)
    }
}
