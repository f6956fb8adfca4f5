//! Where an estimator is told to look.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result};
use grip_perception::{
    Clusters, Detection, Detections, Detector, DetectorSettings, PyramidOrClusters, WholeImage,
};
use grip_sim::bop::{self, BopFrame, GroundTruth, GtInfo};
use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;
use grip_sim::rng;
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::estimators::{DetectorOptions, tell_unknown};

/// Standard deviation by which each side of a jittered box moves, as a share of the box's width or height.
const JITTER: f64 = 0.1;
/// False boxes beside each jittered one.
const FALSE_BOXES: usize = 4;

/// Boxes, and which of them count.
pub struct Boxes {
    source: Source,
    /// Boxes of a lower confidence do not count, and an object of which none is left is not looked for.
    min_confidence: f64,
}

/// Who proposes boxes.
enum Source {
    /// The truth's.
    Truth,
    /// The truth's with their sides moved, among false ones that are believed as much: what a mediocre detector says.
    Jittered,
    /// PyramidCNN's; of objects that it does not know, whatever stands on the support plane.
    Pyramid(Box<PyramidOrClusters>),
    /// Whatever stands on the support plane.
    Clusters(Clusters),
    /// The whole image.
    None,
    /// Those of a file.
    File {
        /// By scene and image.
        boxes: HashMap<(u32, u32), Vec<FileBox>>,
        /// Of the file's content.
        sha256: String,
    },
}

/// One entry of a detection file in COCO's result format, as BOP's default detections are.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
pub struct FileBox {
    /// Number of the scene.
    pub scene_id: u32,
    /// Number of the image in it.
    pub image_id: u32,
    /// The object's number.
    pub category_id: u32,
    /// Left, top, width, height, pixels.
    pub bbox: [f64; 4],
    /// Confidence.
    pub score: f64,
}

impl FileBox {
    /// A detection of object `category_id`, to a hundredth of a pixel.
    pub fn new((scene_id, image_id): (u32, u32), category_id: u32, detection: &Detection) -> Self {
        // From the centres of the first and the last pixel to the edges.
        let [u0, v0, u1, v1] = detection.bbox;
        let bbox = [u0, v0, u1 - u0 + 1.0, v1 - v0 + 1.0].map(|x| (100.0 * x).round() / 100.0);
        Self { scene_id, image_id, category_id, bbox, score: detection.confidence }
    }

    /// The same box as [`Detection::bbox`]; not a number where a side is negative, which no detection may be.
    fn corners(&self) -> [f64; 4] {
        let [x, y, w, h] = self.bbox;
        let last = |at: f64, side: f64| if side >= 0.0 { at + (side - 1.0).max(0.0) } else { f64::NAN };
        [x, y, last(x, w), last(y, h)]
    }
}

impl Boxes {
    /// `pyramid`, `clusters`, `none`, `gt`, `jittered`, or the path of a file.
    ///
    /// # Errors
    /// When it is none of these, the file cannot be read, or the network not be loaded.
    pub fn open(name: &str, settings: &DetectorSettings, options: &DetectorOptions) -> Result<Self> {
        options.check_used(name == "pyramid", "--boxes pyramid")?;
        let source = match name {
            "pyramid" => Source::Pyramid(Box::new(PyramidOrClusters::new(
                options.open(&settings.pyramid)?,
                Clusters::new(settings.clusters.clone())?,
            ))),
            "gt" => Source::Truth,
            "jittered" => Source::Jittered,
            "clusters" => Source::Clusters(Clusters::new(settings.clusters.clone())?),
            "none" => Source::None,
            file => {
                let path = PathBuf::from(file);
                anyhow::ensure!(
                    path.extension().is_some(),
                    "--boxes {file}: must be pyramid, clusters, none, gt, jittered, or a .json file of detections"
                );
                read(&path)?
            }
        };
        Ok(Self { source, min_confidence: options.min_confidence })
    }

    /// The least confidence of a box that counts.
    pub fn min_confidence(&self) -> f64 {
        self.min_confidence
    }

    /// Which of `objects` are looked for: all, unless low confidences do not count and these are the `detections` that do.
    pub fn looked_for(&self, detections: &Detections, objects: &[Arc<ObjectModel>]) -> Vec<bool> {
        let has = |object: &Arc<ObjectModel>| !detections.of(&object.info.name).is_empty();
        objects.iter().map(|object| self.min_confidence == 0.0 || has(object)).collect()
    }

    /// Which network proposes them, and who runs it.
    pub fn network(&self) -> Option<String> {
        match &self.source {
            Source::Pyramid(network) => Some(network.to_string()),
            _ => None,
        }
    }

    /// Whether it takes long to find them.
    pub fn are_detected(&self) -> bool {
        matches!(self.source, Source::Pyramid(_) | Source::Clusters(_))
    }

    /// SHA-256 of the file that they are from, if they are.
    pub fn sha256(&self) -> Option<&str> {
        match &self.source {
            Source::File { sha256, .. } => Some(sha256),
            _ => None,
        }
    }

    /// Whether boxes of these objects can be proposed, and whether those of a file are of these images.
    ///
    /// # Errors
    /// When an object has the number of another one that the network knows, or none of the file's boxes is of what is asked for.
    pub fn check<'a>(
        &self,
        models: impl IntoIterator<Item = &'a Arc<ObjectModel>>,
        images: &HashSet<(u32, u32)>,
    ) -> Result<()> {
        match &self.source {
            Source::Pyramid(network) => {
                let models: Vec<_> = models.into_iter().cloned().collect();
                tell_unknown(&network.unknown(&models)?);
                Ok(())
            }
            Source::File { boxes, .. } => {
                let ids: HashSet<u32> = models.into_iter().map(|model| model.info.bop_id).collect();
                let all: usize = boxes.values().map(Vec::len).sum();
                let asked =
                    boxes.iter().filter(|(image, _)| images.contains(image)).flat_map(|(_, boxes)| boxes);
                let used = asked.filter(|entry| ids.contains(&entry.category_id)).count();
                anyhow::ensure!(
                    all == 0 || used > 0,
                    "none of the {all} boxes is of an image and object that is asked for; are they of another data set?"
                );
                if used < all {
                    log::warn!(
                        "{} of {all} boxes are of images or objects that are not asked for",
                        all - used
                    );
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// The boxes of one image for `objects` that count.
    ///
    /// # Errors
    /// When the frame is not usable, or a box of the file is none.
    pub fn of(
        &self,
        bop: &BopFrame,
        frame: &CameraFrame,
        objects: &[Arc<ObjectModel>],
        seed: u64,
    ) -> Result<Detections> {
        Ok(self.source.of(bop, frame, objects, seed)?.at_least(self.min_confidence))
    }
}

impl Source {
    /// All boxes of one image for `objects`.
    fn of(
        &self,
        bop: &BopFrame,
        frame: &CameraFrame,
        objects: &[Arc<ObjectModel>],
        seed: u64,
    ) -> Result<Detections> {
        let mut detections = Detections::new();
        let mut add = |object: &ObjectModel, bbox: [f64; 4], confidence: f64| {
            detections.push(&object.info.name, Detection { bbox, confidence })
        };
        match self {
            Self::Pyramid(network) => return Ok(network.detect(frame, objects)?),
            Self::Clusters(clusters) => return Ok(clusters.detect(frame, objects)?),
            Self::None => return Ok(WholeImage.detect(frame, objects)?),
            Self::Truth | Self::Jittered => {
                let mut random = rng::stream(seed, "boxes");
                let size = [frame.intrinsics.width as f64, frame.intrinsics.height as f64];
                let mut seen: Vec<[f64; 4]> = Vec::new();
                let truths = bop.truth()?;
                for truth in truths {
                    let Some(object) = objects.iter().find(|o| o.info.bop_id == truth.obj_id) else {
                        continue;
                    };
                    let Some(bbox) = true_box(truth, object, bop)? else { continue };
                    seen.push(bbox);
                    if matches!(self, Self::Truth) {
                        add(object, bbox, 1.0)?;
                        continue;
                    }
                    add(object, jittered(&bbox, &size, &mut random), 1.0)?;
                    for _ in 0..FALSE_BOXES {
                        add(object, elsewhere(&bbox, &size, &mut random), 1.0)?;
                    }
                }
                // A detector takes other objects for one that is not there.
                let there =
                    |object: &ObjectModel| truths.iter().any(|truth| truth.obj_id == object.info.bop_id);
                for object in objects.iter().filter(|object| !there(object)) {
                    for _ in 0..=FALSE_BOXES {
                        let Some(bbox) = seen.get(random.random_range(0..seen.len().max(1))) else {
                            break;
                        };
                        add(object, jittered(bbox, &size, &mut random), 1.0)?;
                    }
                }
            }
            Self::File { boxes, .. } => {
                for entry in boxes.get(&(bop.scene_id, bop.im_id)).into_iter().flatten() {
                    let Some(object) = objects.iter().find(|o| o.info.bop_id == entry.category_id) else {
                        continue;
                    };
                    add(object, entry.corners(), entry.score).with_context(|| {
                        format!(
                            "bbox {:?}, score {} of scene {}, image {}",
                            entry.bbox, entry.score, bop.scene_id, bop.im_id
                        )
                    })?;
                }
            }
        }
        Ok(detections)
    }
}

fn read(path: &Path) -> Result<Source> {
    let text = grip_sim::files::read_to_string(path).context("detections: give a COCO-style .json")?;
    let list: Vec<FileBox> = serde_json::from_str(&text).with_context(|| {
        format!(
            "{}: must be a list of {{scene_id, image_id, category_id, bbox: [left, top, width, height], score}}",
            path.display()
        )
    })?;
    for (number, FileBox { scene_id, image_id, bbox, score, .. }) in list.iter().enumerate() {
        let wrong = bbox.iter().any(|value| !value.is_finite()) || bbox[2] < 0.0 || bbox[3] < 0.0;
        anyhow::ensure!(
            !wrong && (0.0..=1.0).contains(score),
            "{}: entry {number} (scene {scene_id}, image {image_id}): bbox {bbox:?}, score {score}: must be left, top, width and \
             height in pixels, and 0 to 1",
            path.display()
        );
    }
    anyhow::ensure!(
        list.is_empty() || list.iter().any(|entry| entry.bbox.iter().any(|value| *value > 1.0)),
        "{}: no box reaches beyond one pixel: they seem to be shares of the picture; give pixels",
        path.display()
    );
    let mut by_image: HashMap<_, Vec<FileBox>> = HashMap::new();
    for entry in list {
        by_image.entry((entry.scene_id, entry.image_id)).or_default().push(entry);
    }
    Ok(Source::File { boxes: by_image, sha256: format!("{:x}", Sha256::digest(text.as_bytes())) })
}

/// The box of what is seen of an instance, measured where the data set does not tell; `None` where it is out of sight.
fn true_box(truth: &GroundTruth, object: &ObjectModel, frame: &BopFrame) -> Result<Option<[f64; 4]>> {
    let info = known_or_measured(truth, object, frame)?;
    // BOP's boxes reach from the first pixel to the last one; what is out of sight has -1.
    let [x, y, w, h] = info.bbox_visib.map(f64::from);
    Ok((w >= 0.0 && h >= 0.0).then_some([x, y, x + w, y + h]))
}

/// What `scene_gt_info.json` says of an instance, measured where there is no such file.
pub(super) fn known_or_measured(
    truth: &GroundTruth,
    object: &ObjectModel,
    frame: &BopFrame,
) -> Result<GtInfo> {
    Ok(match truth.info {
        Some(info) => info,
        None => bop::estimated_gt_info(
            &object.visual.mesh,
            &truth.camera_from_object,
            &frame.depth,
            &frame.intrinsics,
        )?,
    })
}

/// The box with each side moved by a normal step.
fn jittered([u0, v0, u1, v1]: &[f64; 4], [width, height]: &[f64; 2], random: &mut impl Rng) -> [f64; 4] {
    let mut moved = |at: f64, side: f64, most: f64| {
        let normal: f64 = StandardNormal.sample(random);
        (at + JITTER * side * normal).clamp(0.0, most - 1.0)
    };
    let (w, h) = (u1 - u0, v1 - v0);
    let (a, b) = (moved(*u0, w, *width), moved(*u1, w, *width));
    let (c, d) = (moved(*v0, h, *height), moved(*v1, h, *height));
    [a.min(b), c.min(d), a.max(b), c.max(d)]
}

/// A box of about the same size anywhere in the image.
fn elsewhere([u0, v0, u1, v1]: &[f64; 4], [width, height]: &[f64; 2], random: &mut impl Rng) -> [f64; 4] {
    let mut place = |side: f64, most: f64| {
        let side = (side * random.random_range(0.7..1.4)).min(most - 1.0);
        let start = random.random_range(0.0..=most - 1.0 - side);
        (start, start + side)
    };
    let ((a, b), (c, d)) = (place(u1 - u0, *width), place(v1 - v0, *height));
    [a, c, b, d]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_of_a_file_is_the_detection_that_was_written() {
        let detection = Detection { bbox: [10.25, 20.5, 49.75, 20.5], confidence: 0.25 };
        let written = FileBox::new((3, 4), 5, &detection);
        assert_eq!(written.bbox, [10.25, 20.5, 40.5, 1.0]);
        assert_eq!((written.corners(), written.score), (detection.bbox, 0.25));
        let negative = FileBox { bbox: [10.0, 20.0, -3.0, 4.0], ..written };
        assert!(negative.corners()[2].is_nan());
    }

    #[test]
    fn jitter_has_its_spread_and_stays_in_the_picture() {
        let mut random = rng::stream(1, "t");
        let size = [640.0, 480.0];
        let n = 4000;
        let mut squares = 0.0;
        for _ in 0..n {
            let b = jittered(&[200.0, 100.0, 300.0, 180.0], &size, &mut random);
            squares += (b[0] - 200.0_f64).powi(2);
            let edge = jittered(&[0.0, 0.0, 639.0, 479.0], &size, &mut random);
            assert!(edge[0] >= 0.0 && edge[1] >= 0.0 && edge[2] <= 639.0 && edge[3] <= 479.0);
            let false_box = elsewhere(&[200.0, 100.0, 300.0, 180.0], &size, &mut random);
            assert!(false_box[0] >= 0.0 && false_box[2] <= 639.0 && false_box[0] < false_box[2]);
        }
        let sigma = (squares / f64::from(n)).sqrt();
        assert!((sigma - 10.0).abs() < 0.5, "{sigma}");
    }
}
