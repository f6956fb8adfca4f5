//! What measures poses in an image: the camera and its depth picture, as far as a data set has them.

use super::{Dataset, camera, depth_path, in_camera_file, intrinsics, read_depth, rgb_path, same_size};
use crate::bop::format::{self, CameraFile};
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
        let depth_path = depth_path(&folder, im_id);
        let depth = if depth_path.is_file() { Some(read_depth(&folder, im_id, camera)?) } else { None };
        let mut size = depth.as_ref().map(|depth| [depth.width(), depth.height()]);
        if let Ok(rgb_path) = rgb_path(&folder, im_id) {
            // Its header tells.
            let (width, height) = image::image_dimensions(&rgb_path)
                .map_err(|error| Error::invalid(&rgb_path, format!("not a picture: {error}")))?;
            let of_rgb = [width as usize, height as usize];
            same_size(&depth_path, size.unwrap_or(of_rgb), &rgb_path, of_rgb)?;
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
