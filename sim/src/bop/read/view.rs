//! What measures poses in an image: the camera and its depth picture, as far as a data set has them.

use std::path::Path;

use super::{DEPTH, Dataset, LOOKS, SceneFiles, intrinsics, picture_path, same_size, span};
use crate::bop::format::{self, CameraEntry, CameraFile};
use crate::bop::pictures;
use crate::camera::Intrinsics;
use crate::images::DepthImage;
use crate::{Error, Result};

/// An image without its colours.
#[derive(Debug, Clone)]
pub struct BopView {
    /// Of the picture; `None` where neither a picture nor `camera.json` tells its size.
    pub intrinsics: Option<Intrinsics>,
    /// Depth along the optical axis, metres; 0.0 is no reading. `None` where the image has no depth picture.
    pub depth: Option<DepthImage>,
}

impl Dataset {
    /// The camera and the depth of an image, whose pictures may be missing.
    ///
    /// # Errors
    /// If there is no such image, or what is there of it is wrong: file, image, field and value.
    pub fn view(&self, scene_id: u32, im_id: u32) -> Result<BopView> {
        let scene = self.scene(scene_id)?;
        let folder = self.scene_folder(scene_id);
        let camera = camera(&folder, &scene, im_id)?;
        let depth_path = picture_path(&folder, DEPTH, im_id)?;
        let depth = depth_path.as_ref().map(|path| read_depth(path, &folder, im_id, camera)).transpose()?;
        let mut size = depth.as_ref().map(|depth| [depth.width(), depth.height()]);
        if let Some(rgb_path) = picture_path(&folder, LOOKS, im_id)? {
            // Its header tells.
            let of_rgb = crate::pictures::size(&rgb_path)?;
            if let (Some(depth_path), Some(size)) = (&depth_path, size) {
                same_size(depth_path, size, &rgb_path, of_rgb)?;
            }
            size = Some(of_rgb);
        }
        let file = self.root().join("camera.json");
        if size.is_none() && file.is_file() {
            let sensor: CameraFile = format::load(&file, &[])?;
            size = Some([sensor.width, sensor.height]);
        }
        let intrinsics = size.map(|size| intrinsics(camera, size)).transpose();
        let intrinsics = intrinsics.map_err(|message| in_camera_file(&folder, im_id, &message))?;
        Ok(BopView { intrinsics, depth })
    }
}

/// What `scene_camera.json` says of an image.
pub(super) fn camera<'a>(folder: &Path, scene: &'a SceneFiles, im_id: u32) -> Result<&'a CameraEntry> {
    scene.camera.get(&im_id).ok_or_else(|| {
        let message = format!("has no image {im_id}; it has {}", span(scene.camera.keys()));
        Error::invalid(folder.join("scene_camera.json"), message)
    })
}

pub(super) fn in_camera_file(folder: &Path, im_id: u32, message: &str) -> Error {
    Error::invalid(folder.join("scene_camera.json"), format!("image {im_id}, {message}"))
}

pub(super) fn read_depth(path: &Path, folder: &Path, im_id: u32, camera: &CameraEntry) -> Result<DepthImage> {
    if camera.depth_scale <= 0.0 {
        let message = format!("depth_scale = {}: must be positive", camera.depth_scale);
        return Err(in_camera_file(folder, im_id, &message));
    }
    pictures::read_depth(path, camera.depth_scale)
}
