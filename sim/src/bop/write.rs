//! Scenes of a data set. Encoding an image is a pure function and may run on many threads; the scene's folder appears,
//! whole, when it is finished.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::coco::{self, Annotation, SceneAnnotations};
use super::format::{self, CameraEntry, GtEntry, GtInfo, SceneCamera, SceneGt, SceneGtInfo};
use super::gt_info::Extent;
use super::pictures;
use super::staging::Staging;
use crate::camera::Intrinsics;
use crate::images::{DepthImage, Image, RgbImage};
use crate::pose::{Camera, Object, Pose, World};
use crate::{Error, Result};

/// One image to be written, with its truth. Metres.
#[derive(Debug, Clone, Copy)]
pub struct FrameFiles<'a> {
    /// Number of the image in its scene.
    pub im_id: u32,
    /// Colour.
    pub rgb: &'a RgbImage,
    /// Depth, metres, 0.0 for no reading. What is too far for 16 bits of `depth_scale_mm` is written as no reading.
    pub depth: &'a DepthImage,
    /// Millimetres in a unit of the depth picture: 1.0 reaches 65 m, 0.1 reaches 6.5 m.
    pub depth_scale_mm: f64,
    /// Of all pictures.
    pub intrinsics: Intrinsics,
    /// Pose of the camera, if it shall be in the file.
    pub world_from_camera: Option<Pose<World, Camera>>,
    /// Instances; the position is the ground-truth index.
    pub objects: &'a [ObjectInFrame<'a>],
}

/// One instance in an image.
#[derive(Debug, Clone, Copy)]
pub struct ObjectInFrame<'a> {
    /// The object.
    pub obj_id: u32,
    /// Its pose.
    pub camera_from_object: Pose<Camera, Object>,
    /// The whole silhouette within the image, also where others hide it.
    pub mask: &'a Image<bool>,
    /// The part of it that is seen.
    pub mask_visib: &'a Image<bool>,
    /// From [`gt_info`](super::gt_info()).
    pub info: GtInfo,
}

/// An image as it goes to disk.
#[derive(Debug, Clone, PartialEq)]
pub struct EncodedFrame {
    im_id: u32,
    size: [usize; 2],
    /// Name in the scene's folder, and content.
    files: Vec<(String, Vec<u8>)>,
    camera: CameraEntry,
    gt: Vec<GtEntry>,
    info: Vec<GtInfo>,
    annotations: Vec<Option<Annotation>>,
}

impl EncodedFrame {
    /// The pictures: name in the scene's folder, and content.
    pub fn files(&self) -> &[(String, Vec<u8>)] {
        &self.files
    }
}

/// Makes the pictures and entries of an image; the same input makes the same bytes.
///
/// # Errors
/// [`Error::Invalid`] that names the picture, when sizes differ, a mask disagrees with its counts, the visible part leaves
/// the silhouette, or a pose or the depth's unit is no number.
pub fn encode_frame(frame: &FrameFiles) -> Result<EncodedFrame> {
    let im_id = frame.im_id;
    let Intrinsics { width, height, fx, fy, cx, cy } = frame.intrinsics;
    let in_camera =
        |message: String| Error::invalid("scene_camera.json", format!("image {im_id}, {message}"));
    if let Some(problem) = frame.intrinsics.problem() {
        return Err(in_camera(problem));
    }
    let unit_mm = frame.depth_scale_mm;
    if !(unit_mm.is_finite() && unit_mm > 0.0) {
        return Err(in_camera(format!("depth_scale = {unit_mm}: must be positive, such as 0.1 (mm)")));
    }
    let camera_from_world = frame.world_from_camera.map(|pose| pose.inverse());
    if camera_from_world.is_some_and(|pose| !pose.is_finite()) {
        return Err(in_camera("the camera's pose is not finite".into()));
    }
    let sized = |name: &str, found: [usize; 2]| {
        if found == [width, height] {
            return Ok(());
        }
        let message =
            format!("is {}x{} pixels, but the intrinsics are of {width}x{height}", found[0], found[1]);
        Err(Error::invalid(name, message))
    };
    let mut files = Vec::with_capacity(2 + 2 * frame.objects.len());

    let name = format!("rgb/{im_id:06}.png");
    sized(&name, [frame.rgb.width() as usize, frame.rgb.height() as usize])?;
    let bytes = pictures::encode_rgb(Path::new(&name), frame.rgb)?;
    files.push((name, bytes));

    let name = format!("depth/{im_id:06}.png");
    sized(&name, [frame.depth.width(), frame.depth.height()])?;
    let bytes = pictures::encode_depth(Path::new(&name), frame.depth, unit_mm)?;
    files.push((name, bytes));

    let mut annotations = Vec::with_capacity(frame.objects.len());
    let mut gt = Vec::with_capacity(frame.objects.len());
    for (index, object) in frame.objects.iter().enumerate() {
        for (kind, mask) in [("mask", object.mask), ("mask_visib", object.mask_visib)] {
            let name = format!("{kind}/{im_id:06}_{index:06}.png");
            sized(&name, [mask.width(), mask.height()])?;
            let bytes = pictures::encode_mask(Path::new(&name), mask)?;
            files.push((name, bytes));
        }
        if let Some(problem) = disagreement(object) {
            let message = format!("image {im_id}, ground truth {index}, {problem}");
            return Err(Error::invalid("scene_gt_info.json", message));
        }
        if !object.camera_from_object.is_finite() {
            let message = format!("image {im_id}, ground truth {index}: the pose is not finite");
            return Err(Error::invalid("scene_gt.json", message));
        }
        let (r_m2c, t_m2c) = format::matrix(object.camera_from_object.iso());
        gt.push(GtEntry { r_m2c, t_m2c, obj_id: object.obj_id });
        let visible = object.info.visib_fract;
        annotations.push(coco::annotation(object.obj_id, object.mask, object.mask_visib, visible));
    }
    let w2c = camera_from_world.map(|pose| format::matrix(pose.iso()));
    Ok(EncodedFrame {
        im_id,
        size: [width, height],
        files,
        camera: CameraEntry {
            k: [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
            depth_scale: unit_mm,
            r_w2c: w2c.map(|(r, _)| r),
            t_w2c: w2c.map(|(_, t)| t),
        },
        gt,
        info: frame.objects.iter().map(|object| object.info).collect(),
        annotations,
    })
}

/// Where an instance's masks and counts contradict each other.
fn disagreement(object: &ObjectInFrame) -> Option<String> {
    let pairs = || object.mask.data().iter().zip(object.mask_visib.data());
    let outside = pairs().filter(|(whole, seen)| **seen && !**whole).count();
    if outside > 0 {
        return Some(format!("mask_visib: {outside} visible pixels lie outside of the silhouette"));
    }
    let (seen, inside) = (Extent::of(object.mask_visib), Extent::of(object.mask).count());
    let GtInfo { px_count_all, px_count_visib, bbox_visib, visib_fract, .. } = object.info;
    if px_count_visib != seen.count() || bbox_visib != seen.bbox() {
        return Some(format!(
            "px_count_visib = {px_count_visib}, bbox_visib = {bbox_visib:?}: the mask has {} pixels in {:?}",
            seen.count(),
            seen.bbox()
        ));
    }
    if px_count_all < inside || !(0.0..=1.0).contains(&visib_fract) {
        return Some(format!(
            "px_count_all = {px_count_all}, visib_fract = {visib_fract}: the silhouette has {inside} pixels in the image"
        ));
    }
    None
}

/// The files of one scene under construction; removed when dropped before [`SceneWriter::finish`].
///
/// Images may be added from many threads in any order: files list them by number.
#[derive(Debug)]
pub struct SceneWriter {
    staging: Staging,
    frames: Mutex<Frames>,
    /// Name of the data set and its objects by their numbers, if a COCO file is wanted.
    coco: Option<(String, BTreeMap<u32, String>)>,
}

#[derive(Debug, Default)]
struct Frames {
    camera: SceneCamera,
    gt: SceneGt,
    info: SceneGtInfo,
    annotations: SceneAnnotations,
}

impl SceneWriter {
    /// Begins the scene that will be `split_folder/SSSSSS`. Until it is finished, it grows in a hidden folder beside that.
    ///
    /// # Errors
    /// If the scene exists already, its number has more than six digits, or the folder cannot be made.
    pub fn begin(split_folder: &Path, scene_id: u32) -> Result<Self> {
        if scene_id > 999_999 {
            return Err(Error::invalid(split_folder, format!("scene_id = {scene_id}: at most 999999")));
        }
        let staging = Staging::begin(&split_folder.join(format!("{scene_id:06}")))?;
        ["rgb", "depth", "mask", "mask_visib"].iter().try_for_each(|name| staging.folder(name))?;
        Ok(Self { staging, frames: Mutex::default(), coco: None })
    }

    /// Has `scene_gt_coco.json` written too, for the data set called `name` with all its objects: numbers and names.
    #[must_use]
    pub fn with_coco<'o>(mut self, name: &str, objects: impl IntoIterator<Item = (u32, &'o str)>) -> Self {
        let objects = objects.into_iter().map(|(id, name)| (id, name.to_owned()));
        self.coco = Some((name.to_owned(), objects.collect()));
        self
    }

    /// Encodes an image and adds it.
    ///
    /// # Errors
    /// As [`encode_frame`] and [`add_encoded`](Self::add_encoded).
    pub fn add_frame(&self, frame: &FrameFiles) -> Result<()> {
        self.add_encoded(encode_frame(frame)?)
    }

    /// Writes the pictures of an image and remembers its entries.
    ///
    /// # Errors
    /// If there is such an image already, or a file cannot be written.
    pub fn add_encoded(&self, frame: EncodedFrame) -> Result<()> {
        let EncodedFrame { im_id, size, files, camera, gt, info, annotations } = frame;
        {
            let mut frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
            if frames.camera.contains_key(&im_id) || im_id > 999_999 {
                let message = format!("image {im_id}: numbers are unique and have at most six digits");
                return Err(Error::invalid(self.staging.target(), message));
            }
            frames.camera.insert(im_id, camera);
            frames.gt.insert(im_id, gt);
            frames.info.insert(im_id, info);
            frames.annotations.insert(im_id, (size, annotations));
        }
        files.iter().try_for_each(|(name, bytes)| self.staging.write(name, bytes))
    }

    /// Writes a file that BOP does not know into the scene's folder.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add_file(&self, name: &str, bytes: &[u8]) -> Result<()> {
        self.staging.write(name, bytes)
    }

    /// Writes the JSON files and puts the scene in its place, which it returns.
    ///
    /// # Errors
    /// If a file cannot be written, or the scene has come to exist meanwhile.
    pub fn finish(self) -> Result<PathBuf> {
        let frames = self.frames.into_inner().unwrap_or_else(PoisonError::into_inner);
        self.staging.write("scene_camera.json", text("scene_camera.json", &frames.camera)?.as_bytes())?;
        self.staging.write("scene_gt.json", text("scene_gt.json", &frames.gt)?.as_bytes())?;
        self.staging.write("scene_gt_info.json", text("scene_gt_info.json", &frames.info)?.as_bytes())?;
        if let Some((name, obj_ids)) = &self.coco {
            let file = "scene_gt_coco.json";
            let coco = coco::scene(name, obj_ids, &frames.annotations);
            self.staging.write(file, format::to_json(Path::new(file), &coco)?.as_bytes())?;
        }
        self.staging.finish()
    }
}

fn text<T: serde::Serialize>(name: &str, map: &BTreeMap<u32, T>) -> Result<String> {
    format::lines(Path::new(name), map)
}
