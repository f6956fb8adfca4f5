//! What the robot's camera delivers, and all that perception and planning ever get to see.

use crate::camera::Intrinsics;
use crate::images::{DepthImage, RgbImage};
use crate::pose::{Camera, Pose, World};

/// One registered RGB-D frame. By design no field holds truth: labels are a separate product of the renderer.
#[derive(Debug, Clone)]
pub struct CameraFrame {
    /// Colour, 8-bit sRGB.
    pub rgb: RgbImage,
    /// Depth registered to the colour image, metres along the optical axis, 0.0 for no reading.
    pub depth: DepthImage,
    /// Shared by both images.
    pub intrinsics: Intrinsics,
    /// The camera's pose as the robot knows it, from forward kinematics.
    pub world_from_camera: Pose<World, Camera>,
}
