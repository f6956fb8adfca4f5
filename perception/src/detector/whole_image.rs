//! The detector `none`: it says nothing.

use std::sync::Arc;

use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;

use super::detections::{Detection, Detections, Detector};
use crate::error::Result;
use crate::frame::check_frame;

/// The detector `none`: one box, the whole image, for every object.
#[derive(Debug, Clone, Copy, Default)]
pub struct WholeImage;

impl Detector for WholeImage {
    fn name(&self) -> &'static str {
        "none"
    }

    fn detect(&self, frame: &CameraFrame, objects: &[Arc<ObjectModel>]) -> Result<Detections> {
        check_frame(frame)?;
        let bbox = [0.0, 0.0, frame.intrinsics.width as f64 - 1.0, frame.intrinsics.height as f64 - 1.0];
        let mut detections = Detections::new();
        for object in objects {
            detections.push(&object.info.name, Detection { bbox, confidence: 1.0 })?;
        }
        Ok(detections)
    }
}
