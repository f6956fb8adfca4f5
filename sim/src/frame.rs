//! What the robot's camera delivers, and all that perception and planning ever get to see.

use crate::camera::Intrinsics;
use crate::images::{DepthImage, RgbImage};
use crate::pose::{Camera, Pose, World};
use nalgebra::Point3;

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

impl CameraFrame {
    /// The depth readings as points of the world, metres, row by row.
    pub fn points(&self) -> impl Iterator<Item = Point3<f64>> + '_ {
        let columns = self.depth.width();
        self.depth.data().iter().enumerate().filter(|(_, z)| **z > 0.0).map(move |(i, &z)| {
            let (u, v) = ((i % columns) as f64, (i / columns) as f64);
            self.world_from_camera.transform_point(&self.intrinsics.back_project(u, v, f64::from(z)))
        })
    }
}
