//! What is said to programs of others alike: poses, boxes, object models.

use std::path::{Path, PathBuf};

use grip_perception::Workspace;
use grip_sim::frame::CameraFrame;
use grip_sim::pose::{Camera, Pose, World};
use nalgebra::Isometry3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Pictures;

/// A pose: x' = R x + t.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Transform {
    /// Rotation matrix, row by row.
    #[serde(rename = "R")]
    pub rotation: [f64; 9],
    /// Translation, metres.
    #[serde(rename = "t")]
    pub translation: [f64; 3],
}

impl From<&Isometry3<f64>> for Transform {
    fn from(iso: &Isometry3<f64>) -> Self {
        let m = iso.rotation.to_rotation_matrix();
        Self {
            rotation: std::array::from_fn(|i| m[(i / 3, i % 3)]),
            translation: iso.translation.vector.into(),
        }
    }
}

/// A box whose sides are along the axes of the world, metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Space {
    /// Lowest corner.
    pub min: [f64; 3],
    /// Highest corner.
    pub max: [f64; 3],
}

/// An object.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Model {
    /// Its number in BOP's data sets.
    pub obj_id: u32,
    /// Its name.
    pub name: String,
    /// PLY in millimetres, as BOP has it, with a texture of the same name (.png) where it has one.
    pub mesh: PathBuf,
    /// Largest distance of two of its points, metres.
    pub diameter: f64,
}

/// What the camera saw.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct View<'a> {
    /// Columns of all pictures.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Camera matrix (fx, 0, cx; 0, fy, cy; 0, 0, 1), pixels; the middle of the first pixel is (0, 0).
    #[serde(rename = "K")]
    pub intrinsics: [f64; 9],
    /// From the camera's frame (x right, y down, z forward) to the world's (z up), by the robot's joints. Null in a data set that
    /// does not say it.
    pub world_from_camera: Option<Transform>,
    /// The part of the world in which the objects are. Null in a data set.
    pub space: Option<Space>,
    /// NPY, height x width x 3, uint8: sRGB.
    pub rgb: &'a Path,
    /// NPY, height x width, float32: metres along the optical axis, 0 where there is no reading.
    pub depth: &'a Path,
}

impl<'a> View<'a> {
    /// Of a frame whose pictures are in these files, and what is known of where it was taken.
    pub(crate) fn new(
        frame: &CameraFrame,
        world_from_camera: Option<&Pose<World, Camera>>,
        space: Option<Workspace>,
        pictures: &'a Pictures,
    ) -> Self {
        let k = &frame.intrinsics;
        Self {
            width: k.width,
            height: k.height,
            intrinsics: [k.fx, 0.0, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0],
            world_from_camera: world_from_camera.map(|pose| pose.iso().into()),
            space: space.map(|Workspace { min, max }| Space { min, max }),
            rgb: &pictures.rgb,
            depth: &pictures.depth,
        }
    }
}

/// Where a translation is not finite.
pub(crate) fn finite(translation: &[f64; 3]) -> Result<(), String> {
    if translation.iter().any(|t| !t.is_finite()) {
        return Err(format!("t {translation:?}: must be finite, metres"));
    }
    Ok(())
}

/// What a greeting's version is worth.
pub(crate) fn same_version(theirs: u32, ours: u32) -> Result<(), String> {
    if theirs != ours {
        return Err(format!("it speaks protocol {theirs}, and this program {ours}"));
    }
    Ok(())
}
