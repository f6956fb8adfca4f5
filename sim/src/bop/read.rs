//! A data set on disk. Opening looks at folder names only; files are read when they are asked for, and the JSON files of a
//! scene are kept.

mod view;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::format::{
    self, CameraEntry, GtEntry, GtInfo, MILLIMETRE, ModelInfo, ModelsFile, SceneCamera, SceneGt, SceneGtInfo,
    Target, TargetImage,
};
use super::pictures::read_mask;
use nalgebra::Vector3;

use crate::camera::Intrinsics;
use crate::images::{DepthImage, Image, RgbImage};
use crate::mesh::Visual;
use crate::objects::mesh_io;
use crate::pictures;
use crate::pose::{Camera, Object, Pose, World};
use crate::{Error, Result};

use view::{camera, in_camera_file, read_depth};

pub use view::BopView;

/// Splits in the order in which one is chosen when none is asked for; any other comes after these, by name.
const SPLITS: [&str; 6] = ["test", "val", "train", "train_pbr", "train_real", "train_synt"];

/// One split of a data set.
#[derive(Debug)]
pub struct Dataset {
    root: PathBuf,
    split: String,
    /// By scene; a scene whose files are wrong is read again when it is asked for again.
    scenes: Mutex<BTreeMap<u32, Arc<SceneFiles>>>,
}

/// The JSON files of a scene.
#[derive(Debug)]
struct SceneFiles {
    camera: SceneCamera,
    /// `None` where the truth is withheld.
    gt: Option<SceneGt>,
    info: Option<SceneGtInfo>,
}

/// One image of a data set with what is known of it. Metres.
#[derive(Debug, Clone)]
pub struct BopFrame {
    /// Scene.
    pub scene_id: u32,
    /// Image of the scene.
    pub im_id: u32,
    /// Colour, 8-bit sRGB; grey pictures have three equal channels.
    pub rgb: RgbImage,
    /// Depth along the optical axis, metres; 0.0 is no reading.
    pub depth: DepthImage,
    /// Of both pictures.
    pub intrinsics: Intrinsics,
    /// Pose of the camera, where the data set has it.
    pub world_from_camera: Option<Pose<World, Camera>>,
    /// In the order of `scene_gt.json`: the position is the ground-truth index. `None` where the truth is withheld.
    pub ground_truths: Option<Vec<GroundTruth>>,
}

impl BopFrame {
    /// The truth.
    ///
    /// # Errors
    /// Where it is withheld.
    pub fn truth(&self) -> Result<&[GroundTruth]> {
        self.ground_truths.as_deref().ok_or_else(|| Error::invalid("scene_gt.json", NO_TRUTH))
    }
}

/// Of a split whose truth is not public.
const NO_TRUTH: &str = "is missing, so the split has no truth; test sets whose truth is withheld are scored by the benchmark's \
                        server alone: take a split with truth, and boxes that need none (--boxes pyramid, clusters or none)";

/// One instance in an image.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundTruth {
    /// The object.
    pub obj_id: u32,
    /// Its pose.
    pub camera_from_object: Pose<Camera, Object>,
    /// Counts and boxes, where the data set has them.
    pub info: Option<GtInfo>,
}

impl GroundTruth {
    /// Whether enough is seen of it to ask for it; where the data set does not tell, yes.
    pub fn is_target(&self) -> bool {
        self.info.is_none_or(|info| info.is_target())
    }
}

impl Dataset {
    /// Opens the data set at `root`. `split` is a folder such as `test` or `train_pbr`; without it the first of test, val,
    /// train, train_pbr, train_real, train_synt, else the first other folder that holds scenes.
    ///
    /// # Errors
    /// If there is no such folder, or no scene in it; the message lists the splits that were found.
    pub fn open(root: &Path, split: Option<&str>) -> Result<Self> {
        let mut found = Vec::new();
        for name in folder_names(root)? {
            if !numbered(&root.join(&name))?.is_empty() {
                found.push(name);
            }
        }
        found.sort_by_key(|name| SPLITS.iter().position(|known| known == name).unwrap_or(SPLITS.len()));
        let chosen = match split {
            Some(wanted) => found.iter().find(|name| *name == wanted),
            None => found.first(),
        };
        let Some(chosen) = chosen else {
            let listed = if found.is_empty() { "none".to_owned() } else { found.join(", ") };
            let wanted = split.map(|name| format!(" '{name}'")).unwrap_or_default();
            return Err(Error::invalid(
                root,
                format!(
                    "has no split{wanted} with scenes; splits found: {listed}; a split is a folder such as test or \
                     train_pbr that holds scenes such as 000001"
                ),
            ));
        };
        Ok(Self { root: root.to_path_buf(), split: chosen.clone(), scenes: Mutex::default() })
    }

    /// The data set's folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The split that was chosen.
    pub fn split(&self) -> &str {
        &self.split
    }

    /// The scenes of the split, ascending.
    ///
    /// # Errors
    /// If the folder cannot be read.
    pub fn scenes(&self) -> Result<Vec<u32>> {
        numbered(&self.root.join(&self.split))
    }

    /// The images of a scene, ascending: those of its `scene_camera.json`.
    ///
    /// # Errors
    /// If a JSON file of the scene is missing or wrong.
    pub fn images(&self, scene_id: u32) -> Result<Vec<u32>> {
        Ok(self.scene(scene_id)?.camera.keys().copied().collect())
    }

    /// What an evaluation asks for, from `test_targets_bop19.json`; `None` without that file.
    ///
    /// # Errors
    /// If the file is wrong.
    pub fn targets(&self) -> Result<Option<Vec<Target>>> {
        optional(&self.root.join("test_targets_bop19.json"), &["target"])
    }

    /// The images that an evaluation by the rules of 2024 asks for, from `test_targets_bop24.json`, which names no objects; `None`
    /// without that file.
    ///
    /// # Errors
    /// If the file is wrong.
    pub fn target_images(&self) -> Result<Option<Vec<TargetImage>>> {
        optional(&self.root.join("test_targets_bop24.json"), &["target"])
    }

    /// The targets that an evaluation of everything asks for: from the truth, all instances that are seen by at least
    /// [`TARGET_VISIBLE`](super::format::TARGET_VISIBLE), in order of scene, image and object.
    ///
    /// # Errors
    /// If the truth is missing or wrong.
    pub fn targets_of_truth(&self) -> Result<Vec<Target>> {
        let mut targets = Vec::new();
        for scene_id in self.scenes()? {
            for im_id in self.images(scene_id)? {
                let mut counts: BTreeMap<u32, u32> = BTreeMap::new();
                for truth in self.ground_truths(scene_id, im_id)?.iter().filter(|truth| truth.is_target()) {
                    *counts.entry(truth.obj_id).or_default() += 1;
                }
                targets.extend(counts.into_iter().map(|(obj_id, inst_count)| Target {
                    scene_id,
                    im_id,
                    obj_id,
                    inst_count,
                }));
            }
        }
        Ok(targets)
    }

    /// Numbers of the models, ascending.
    ///
    /// # Errors
    /// If there is no models folder.
    pub fn model_ids(&self) -> Result<Vec<u32>> {
        let folder = self.models_folder()?;
        let mut ids: Vec<u32> = entries(&folder)?
            .iter()
            .filter_map(|name| name.strip_prefix("obj_")?.strip_suffix(".ply")?.parse().ok())
            .collect();
        ids.sort_unstable();
        Ok(ids)
    }

    /// Sizes and symmetries of the models, from `models_info.json`.
    ///
    /// # Errors
    /// If the file is missing, or an object in it is wrong: object, field, value.
    pub fn models_info(&self) -> Result<BTreeMap<u32, ModelInfo>> {
        let path = self.models_folder()?.join("models_info.json");
        let file: ModelsFile = format::load(&path, &["object"])?;
        file.iter()
            .map(|(id, info)| match info.checked() {
                Ok(info) => Ok((*id, info)),
                Err(message) => Err(Error::invalid(&path, format!("object {id}, {message}"))),
            })
            .collect()
    }

    /// The model of an object, metres.
    ///
    /// # Errors
    /// If its file or texture is missing or wrong.
    pub fn load_model(&self, obj_id: u32) -> Result<Visual> {
        self.sized_model(&self.models_folder()?, obj_id)
    }

    /// The model that errors are measured with, metres: of `models_eval` where the data set has it.
    ///
    /// # Errors
    /// If its file is missing or wrong.
    pub fn load_evaluation_model(&self, obj_id: u32) -> Result<Visual> {
        let folder = self.root.join("models_eval");
        if model_path(&folder, obj_id).is_file() {
            self.sized_model(&folder, obj_id)
        } else {
            self.load_model(obj_id)
        }
    }

    /// A model, of the size that `models_info.json` beside it says, if there is one.
    fn sized_model(&self, folder: &Path, obj_id: u32) -> Result<Visual> {
        let path = model_path(folder, obj_id);
        let model = mesh_io::load_ply(&path, MILLIMETRE)?;
        let infos: ModelsFile = optional(&folder.join("models_info.json"), &["object"])?.unwrap_or_default();
        if let (Some(info), Some((low, high))) = (infos.get(&obj_id), model.mesh.bounds()) {
            // The largest distance between vertices is at least an edge of their bounding box and at most its diagonal.
            let extents = (high - low) / MILLIMETRE;
            let fits = (info.diameter >= extents.max() / SLACK) && (info.diameter <= extents.norm() * SLACK);
            if !fits {
                return Err(Error::invalid(
                    path,
                    format!(
                        "is {:.4} x {:.4} x {:.4} across, but models_info.json gives it the diameter {}; both are millimetres",
                        extents.x, extents.y, extents.z, info.diameter
                    ),
                ));
            }
        }
        Ok(model)
    }

    /// One image with its truth.
    ///
    /// # Errors
    /// If there is no such image, or one of its pictures or entries is missing or wrong: file, image, ground-truth index,
    /// field and value.
    pub fn frame(&self, scene_id: u32, im_id: u32) -> Result<BopFrame> {
        let scene = self.scene(scene_id)?;
        let folder = self.scene_folder(scene_id);
        let camera = camera(&folder, &scene, im_id)?;
        let in_image = |message: String| in_camera_file(&folder, im_id, &message);
        let rgb_path = needed_picture_path(&folder, LOOKS, im_id)?;
        let rgb = pictures::stored(&rgb_path)?;
        let size = [rgb.width() as usize, rgb.height() as usize];
        let depth_path = needed_picture_path(&folder, DEPTH, im_id)?;
        let depth = read_depth(&depth_path, &folder, im_id, camera)?;
        same_size(&depth_path, [depth.width(), depth.height()], &rgb_path, size)?;
        Ok(BopFrame {
            scene_id,
            im_id,
            rgb,
            depth,
            intrinsics: intrinsics(camera, size).map_err(in_image)?,
            world_from_camera: world_from_camera(camera).map_err(in_image)?,
            ground_truths: scene
                .gt
                .as_ref()
                .map(|gt| ground_truths(&folder, &scene, gt, im_id))
                .transpose()?,
        })
    }

    /// The truth about one image, without its pictures.
    ///
    /// # Errors
    /// If there is no such image, its truth is withheld, or one of its entries is wrong.
    pub fn ground_truths(&self, scene_id: u32, im_id: u32) -> Result<Vec<GroundTruth>> {
        let (folder, scene) = (self.scene_folder(scene_id), self.scene(scene_id)?);
        camera(&folder, &scene, im_id)?;
        let gt = scene.gt.as_ref().ok_or_else(|| Error::invalid(folder.join("scene_gt.json"), NO_TRUTH))?;
        ground_truths(&folder, &scene, gt, im_id)
    }

    /// The silhouette of an instance within the image, also where others hide it; `None` where the data set has no such
    /// picture.
    ///
    /// # Errors
    /// If there is no such image or instance, or the picture is broken or of another size than the image.
    pub fn mask(&self, scene_id: u32, im_id: u32, gt_index: usize) -> Result<Option<Image<bool>>> {
        self.read_mask("mask", scene_id, im_id, gt_index)
    }

    /// The visible part of an instance; see [`mask`](Self::mask).
    ///
    /// # Errors
    /// As [`mask`](Self::mask).
    pub fn mask_visib(&self, scene_id: u32, im_id: u32, gt_index: usize) -> Result<Option<Image<bool>>> {
        self.read_mask("mask_visib", scene_id, im_id, gt_index)
    }

    fn read_mask(&self, kind: &str, scene_id: u32, im_id: u32, index: usize) -> Result<Option<Image<bool>>> {
        let scene = self.scene(scene_id)?;
        let folder = self.scene_folder(scene_id);
        let count = scene.gt.as_ref().and_then(|gt| gt.get(&im_id)).map_or(0, Vec::len);
        if index >= count {
            let path = folder.join("scene_gt.json");
            let message =
                format!("image {im_id} has {count} ground truths, so there is none of index {index}");
            return Err(Error::invalid(path, message));
        }
        let path = folder.join(format!("{kind}/{im_id:06}_{index:06}.png"));
        if !path.exists() {
            return Ok(None);
        }
        let mask = read_mask(&path)?;
        let rgb = needed_picture_path(&folder, LOOKS, im_id)?;
        same_size(&path, [mask.width(), mask.height()], &rgb, pictures::size(&rgb)?)?;
        Ok(Some(mask))
    }

    fn scene_folder(&self, scene_id: u32) -> PathBuf {
        self.root.join(&self.split).join(format!("{scene_id:06}"))
    }

    /// The scene's files, read the first time.
    fn scene(&self, scene_id: u32) -> Result<Arc<SceneFiles>> {
        let lock = || self.scenes.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(files) = lock().get(&scene_id) {
            return Ok(Arc::clone(files));
        }
        let folder = self.scene_folder(scene_id);
        let truth = folder.join("scene_gt.json");
        let gt: Option<SceneGt> = optional(&truth, &["image", "ground truth"])?;
        let places = gt.iter().flat_map(BTreeMap::values).flatten().map(|entry| entry.t_m2c);
        if let Some(message) = format::in_metres("cam_t_m2c", places.map(|t| Vector3::from(t) * MILLIMETRE)) {
            return Err(Error::invalid(truth, message));
        }
        let files = Arc::new(SceneFiles {
            camera: format::load(&folder.join("scene_camera.json"), &["image"])?,
            gt,
            info: optional(&folder.join("scene_gt_info.json"), &["image", "ground truth"])?,
        });
        lock().insert(scene_id, Arc::clone(&files));
        Ok(files)
    }

    /// `models`, else the first `models_*` that is not `_eval`, else any.
    fn models_folder(&self) -> Result<PathBuf> {
        let mut names = folder_names(&self.root)?;
        names.retain(|name| name == "models" || name.starts_with("models_"));
        names.sort_by_key(|name| (name != "models", name.ends_with("_eval"), name.clone()));
        names.first().map(|name| self.root.join(name)).ok_or_else(|| {
            Error::invalid(
                &self.root,
                "has no folder models; unpack the set's models (SET_models.zip) into it",
            )
        })
    }
}

/// Simplified models may be this many times smaller or larger than the one whose diameter was measured.
const SLACK: f64 = 1.5;

fn model_path(folder: &Path, obj_id: u32) -> PathBuf {
    folder.join(format!("obj_{obj_id:06}.ply"))
}

fn ground_truths(folder: &Path, scene: &SceneFiles, gt: &SceneGt, im_id: u32) -> Result<Vec<GroundTruth>> {
    let entries = gt.get(&im_id).map_or(&[][..], Vec::as_slice);
    let infos = scene.info.as_ref().map(|info| info.get(&im_id).map_or(&[][..], Vec::as_slice));
    if let Some(infos) = infos
        && infos.len() != entries.len()
    {
        let message = format!(
            "image {im_id} has {} entries, but {} in scene_gt.json; make both files together",
            infos.len(),
            entries.len()
        );
        return Err(Error::invalid(folder.join("scene_gt_info.json"), message));
    }
    let one = |(index, entry): (usize, &GtEntry)| {
        let iso = format::isometry(&entry.r_m2c, &entry.t_m2c).map_err(|reason| {
            let message = format!("image {im_id}, ground truth {index}, cam_R_m2c = {reason}");
            Error::invalid(folder.join("scene_gt.json"), message)
        })?;
        let info = infos.and_then(|infos| infos.get(index).copied());
        Ok(GroundTruth { obj_id: entry.obj_id, camera_from_object: Pose::new(iso), info })
    };
    entries.iter().enumerate().map(one).collect()
}

fn intrinsics(camera: &CameraEntry, size: [usize; 2]) -> std::result::Result<Intrinsics, String> {
    let [fx, skew, cx, zero, fy, cy, last @ ..] = camera.k;
    if skew != 0.0 || zero != 0.0 || last != [0.0, 0.0, 1.0] {
        return Err(format!(
            "cam_K = {:?}: must be fx 0 cx, 0 fy cy, 0 0 1 row by row; skewed cameras are not supported",
            camera.k
        ));
    }
    let intrinsics = Intrinsics { width: size[0], height: size[1], fx, fy, cx, cy };
    intrinsics.problem().map_or(Ok(intrinsics), |problem| Err(format!("cam_K: {problem}")))
}

fn world_from_camera(camera: &CameraEntry) -> std::result::Result<Option<Pose<World, Camera>>, String> {
    match (&camera.r_w2c, &camera.t_w2c) {
        (None, None) => Ok(None),
        (Some(r), Some(t)) => {
            let camera_from_world =
                format::isometry(r, t).map_err(|reason| format!("cam_R_w2c = {reason}"))?;
            Ok(Some(Pose::<Camera, World>::new(camera_from_world).inverse()))
        }
        (r, _) => {
            let (has, lacks) = if r.is_some() { ("R", "t") } else { ("t", "R") };
            Err(format!("cam_{lacks}_w2c is missing beside cam_{has}_w2c; give both or none"))
        }
    }
}

/// Kinds of the pictures with colour or grey values, and of depth: names of folders.
const LOOKS: &[&str] = &["rgb", "gray"];
const DEPTH: &[&str] = &["depth"];

/// A picture of an image in the first of `kinds` that has it, in any format that is read; `None` where there is none in any.
///
/// # Errors
/// Where there is one, but in no format that is read.
fn picture_path(folder: &Path, kinds: &[&str], im_id: u32) -> Result<Option<PathBuf>> {
    let stem = format!("{im_id:06}.");
    let places =
        kinds.iter().flat_map(|kind| ENDINGS.map(|ending| folder.join(kind).join(stem.clone() + ending)));
    if let Some(path) = places.into_iter().find(|path| path.is_file()) {
        return Ok(Some(path));
    }
    let other = kinds.iter().find_map(|kind| {
        let names = entries(&folder.join(kind)).ok()?;
        names.into_iter().find(|name| name.starts_with(&stem)).map(|name| folder.join(kind).join(name))
    });
    match other {
        None => Ok(None),
        Some(other) => Err(Error::invalid(
            other,
            format!("is in a format that is not read, only .{} are; convert it", ENDINGS.join(", .")),
        )),
    }
}

/// Endings of the formats that are read.
const ENDINGS: [&str; 5] = ["png", "jpg", "jpeg", "tif", "tiff"];

/// A picture that there must be.
fn needed_picture_path(folder: &Path, kinds: &[&str], im_id: u32) -> Result<PathBuf> {
    picture_path(folder, kinds, im_id)?.ok_or_else(|| {
        let also: String = kinds[1..].iter().map(|kind| format!(", nor one in {kind}/")).collect();
        let message = format!(
            "no such file, nor a .{}{also}; unpack the set's images, or leave this image out",
            ENDINGS[1..].join(", .")
        );
        Error::invalid(folder.join(kinds[0]).join(format!("{im_id:06}.{}", ENDINGS[0])), message)
    })
}

fn same_size(path: &Path, size: [usize; 2], other: &Path, wanted: [usize; 2]) -> Result<()> {
    if size == wanted {
        return Ok(());
    }
    let message = format!(
        "is {}x{} pixels, but {} is {}x{}; all pictures of an image have one size",
        size[0],
        size[1],
        other.display(),
        wanted[0],
        wanted[1]
    );
    Err(Error::invalid(path, message))
}

/// A JSON file that may be absent.
fn optional<T: serde::de::DeserializeOwned>(path: &Path, levels: &[&str]) -> Result<Option<T>> {
    if path.exists() { format::load(path, levels).map(Some) } else { Ok(None) }
}

/// `3 images from 1 to 9`.
fn span<'a>(mut keys: impl ExactSizeIterator<Item = &'a u32> + DoubleEndedIterator) -> String {
    let count = keys.len();
    match (keys.next(), keys.next_back()) {
        (Some(first), Some(last)) => format!("{count} images from {first} to {last}"),
        (Some(only), None) => format!("image {only} alone"),
        _ => "none".to_owned(),
    }
}

/// Names of the files and folders in `folder`, sorted.
fn entries(folder: &Path) -> Result<Vec<String>> {
    let listing = std::fs::read_dir(folder).map_err(|source| Error::io(folder, source))?;
    let mut names: Vec<String> =
        listing.flatten().filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.sort();
    Ok(names)
}

fn folder_names(folder: &Path) -> Result<Vec<String>> {
    let mut names = entries(folder)?;
    names.retain(|name| !name.starts_with('.') && folder.join(name).is_dir());
    Ok(names)
}

/// Six-digit folder names as numbers, ascending.
fn numbered(folder: &Path) -> Result<Vec<u32>> {
    let names = folder_names(folder)?.into_iter();
    let digits = names.filter(|name| name.len() == 6 && name.bytes().all(|byte| byte.is_ascii_digit()));
    Ok(digits.filter_map(|name| name.parse().ok()).collect())
}
