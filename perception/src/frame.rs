//! Which camera frames can be used.

use grip_sim::frame::CameraFrame;

use crate::error::{Error, Result};

/// Refuses frames that cannot be used: disagreeing sizes, bad intrinsics, no depth reading at all.
pub(crate) fn check_frame(frame: &CameraFrame) -> Result<()> {
    let (k, depth) = (&frame.intrinsics, &frame.depth);
    if let Some(problem) = k.problem() {
        return Err(Error::Frame(format!("intrinsics: {problem}")));
    }
    if (depth.width(), depth.height()) != (k.width, k.height) {
        return Err(Error::Frame(format!(
            "depth image is {}x{} but the intrinsics say {}x{}; use the intrinsics of the registered depth",
            depth.width(),
            depth.height(),
            k.width,
            k.height
        )));
    }
    if !frame.world_from_camera.is_finite() {
        return Err(Error::Frame("world_from_camera is not finite".into()));
    }
    if !depth.data().iter().any(|&z| is_reading(z)) {
        return Err(Error::Frame(
            "the depth image has no reading between 0.1 and 20 m; check the sensor's range and that depth is in metres".into(),
        ));
    }
    Ok(())
}

/// Whether a depth value is a usable reading: 0.0 means none, and NaN, negative or absurd values are treated alike.
pub(crate) fn is_reading(z: f32) -> bool {
    (0.1..20.0).contains(&z)
}
