//! Instance masks in COCO's format: `scene_gt_coco.json` a scene, as the toolkit's `calc_gt_coco` makes it, and one
//! `coco.json` for a whole split.
//!
//! As there, an image's id is its number in the scene, categories are object ids (with the objects' names, where the toolkit has their
//! numbers again), the segmentation is that of the visible
//! part and the box that of the whole silhouette within the image ("amodal"), counted in pixels (one more than the
//! boxes of `scene_gt_info.json`). Instances without a visible pixel have no annotation. Dates are left empty, so that
//! the same scene makes the same file.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::format;
use super::gt_info::Extent;
use super::staging::write_atomic;
use crate::images::Image;
use crate::{Error, Result};

/// Instances of which less is visible are marked to be ignored (the toolkit's figure).
const IGNORED_BELOW: f64 = 0.1;

/// A COCO file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Coco {
    /// About the set.
    pub info: Info,
    /// Always empty.
    pub licenses: Vec<String>,
    /// The set's objects.
    pub categories: Vec<Category>,
    /// Images.
    pub images: Vec<ImageEntry>,
    /// Instances.
    pub annotations: Vec<Annotation>,
}

/// About the set.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[expect(missing_docs, reason = "COCO's own names")]
pub struct Info {
    pub description: String,
    pub url: String,
    pub version: String,
    pub year: u32,
    pub contributor: String,
    pub date_created: String,
}

/// An object.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Category {
    /// Object id.
    pub id: u32,
    /// The object's name.
    pub name: String,
    /// The data set.
    pub supercategory: String,
}

/// An image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[expect(missing_docs, reason = "COCO's own names")]
pub struct ImageEntry {
    pub id: u32,
    /// Path of the picture, seen from the folder of the COCO file.
    pub file_name: String,
    pub width: usize,
    pub height: usize,
    pub date_captured: String,
    pub license: u32,
    pub coco_url: String,
    pub flickr_url: String,
}

/// An instance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Annotation {
    /// From 1.
    pub id: u32,
    /// The image's id.
    pub image_id: u32,
    /// Object id.
    pub category_id: u32,
    /// Always 0.
    pub iscrowd: u32,
    /// Visible pixels.
    pub area: u64,
    /// Box of the silhouette within the image: x, y, and width and height in pixels.
    pub bbox: [i32; 4],
    /// The visible part.
    pub segmentation: Rle,
    /// Columns of the image.
    pub width: usize,
    /// Rows of the image.
    pub height: usize,
    /// Less than a tenth is visible.
    pub ignore: bool,
}

/// A mask as run lengths, column after column from the top left; the first run is of pixels that are not set.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Rle {
    /// Lengths of the runs.
    pub counts: Vec<u32>,
    /// Rows and columns.
    pub size: [usize; 2],
}

impl Rle {
    /// The runs of a mask.
    pub fn encode(mask: &Image<bool>) -> Self {
        let (width, height) = (mask.width(), mask.height());
        let (mut counts, mut length, mut current) = (Vec::new(), 0, false);
        for u in 0..width {
            for v in 0..height {
                if *mask.at(u, v) != current {
                    counts.push(length);
                    (length, current) = (0, !current);
                }
                length += 1;
            }
        }
        counts.push(length);
        Self { counts, size: [height, width] }
    }

    /// The mask; `None` when the runs do not fill it exactly.
    pub fn decode(&self) -> Option<Image<bool>> {
        let [height, width] = self.size;
        let total = self.counts.iter().try_fold(0_usize, |sum, &count| sum.checked_add(count as usize))?;
        if total != height.checked_mul(width)? {
            return None;
        }
        let mut mask = Image::filled(width, height, false);
        let mut at = 0;
        for (index, &count) in self.counts.iter().enumerate() {
            let run = at..at + count as usize;
            at = run.end;
            if index % 2 == 1 {
                run.for_each(|i| *mask.at_mut(i / height, i % height) = true);
            }
        }
        Some(mask)
    }
}

/// The annotation of one instance, without ids; `None` when nothing of it is visible.
pub(super) fn annotation(
    obj_id: u32,
    mask: &Image<bool>,
    mask_visib: &Image<bool>,
    visib_fract: f64,
) -> Option<Annotation> {
    let area = Extent::of(mask_visib).count();
    let bbox = Extent::of(mask).coco_bbox().filter(|_| area > 0)?;
    Some(Annotation {
        id: 0,
        image_id: 0,
        category_id: obj_id,
        iscrowd: 0,
        area,
        bbox,
        segmentation: Rle::encode(mask_visib),
        width: mask_visib.width(),
        height: mask_visib.height(),
        ignore: visib_fract < IGNORED_BELOW,
    })
}

/// What a scene's COCO file is made of: the size and the annotations of each image.
pub(super) type SceneAnnotations = BTreeMap<u32, ([usize; 2], Vec<Option<Annotation>>)>;

/// The COCO file of a scene of the data set called `name`, in which there are these objects.
pub(super) fn scene(name: &str, objects: &BTreeMap<u32, String>, frames: &SceneAnnotations) -> Coco {
    let category = |(id, object): (&u32, &String)| Category {
        id: *id,
        name: object.clone(),
        supercategory: name.to_owned(),
    };
    let mut coco = Coco {
        info: Info {
            description: name.to_owned(),
            url: "https://github.com/thodan/bop_toolkit".into(),
            version: "0.1.0".into(),
            ..Info::default()
        },
        licenses: vec![],
        categories: objects.iter().map(category).collect(),
        images: vec![],
        annotations: vec![],
    };
    for (&im_id, ([width, height], annotations)) in frames {
        coco.images.push(ImageEntry {
            id: im_id,
            file_name: format!("rgb/{im_id:06}.png"),
            width: *width,
            height: *height,
            date_captured: String::new(),
            license: 1,
            coco_url: String::new(),
            flickr_url: String::new(),
        });
        for annotation in annotations.iter().flatten() {
            let id = coco.annotations.len() as u32 + 1;
            coco.annotations.push(Annotation { id, image_id: im_id, ..annotation.clone() });
        }
    }
    coco
}

impl Coco {
    /// Adds the images and annotations of another file. Its ids are moved up past ours, and `folder` (with `/`, such as
    /// `test/000003`) is put before its file names.
    pub fn merge(&mut self, other: Self, folder: &str) {
        for category in other.categories {
            if !self.categories.iter().any(|known| known.id == category.id) {
                self.categories.push(category);
            }
        }
        self.categories.sort_by_key(|category| category.id);
        let image_offset = self.images.iter().map(|image| image.id + 1).max().unwrap_or(0);
        let annotation_offset = self.annotations.iter().map(|annotation| annotation.id).max().unwrap_or(0);
        self.images.extend(other.images.into_iter().map(|image| ImageEntry {
            id: image.id + image_offset,
            file_name: format!("{folder}/{}", image.file_name),
            ..image
        }));
        self.annotations.extend(other.annotations.into_iter().map(|annotation| Annotation {
            id: annotation.id + annotation_offset,
            image_id: annotation.image_id + image_offset,
            ..annotation
        }));
    }
}

/// Merges the `scene_gt_coco.json` of all scenes of a split into `root/coco.json`, with file names seen from `root`, and
/// returns its path. Image ids are new; the file name tells scene and image.
///
/// # Errors
/// If the split has no scene, a scene has no such file or a wrong one, or the file cannot be written.
pub fn write_set(root: &Path, split: &str) -> Result<PathBuf> {
    let set = super::Dataset::open(root, Some(split))?;
    let mut merged: Option<Coco> = None;
    for scene_id in set.scenes()? {
        let folder = format!("{split}/{scene_id:06}");
        let path = root.join(&folder).join("scene_gt_coco.json");
        let scene: Coco = format::load(&path, &[])?;
        let whole = merged.get_or_insert_with(|| Coco {
            info: scene.info.clone(),
            licenses: vec![],
            categories: vec![],
            images: vec![],
            annotations: vec![],
        });
        whole.merge(scene, &folder);
    }
    let path = root.join("coco.json");
    let merged = merged.ok_or_else(|| Error::invalid(&path, format!("split {split} has no scenes")))?;
    write_atomic(&path, format::to_json(&path, &merged)?.as_bytes())?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(rows: [&str; 3]) -> Image<bool> {
        let data = rows.concat().bytes().map(|byte| byte == b'#').collect();
        Image::from_vec(rows[0].len(), 3, data).unwrap()
    }

    #[test]
    fn runs_go_down_the_columns_and_back() {
        let corner = mask(["##..", "#...", "...#"]);
        let rle = Rle::encode(&corner);
        assert_eq!(rle, Rle { counts: vec![0, 2, 1, 1, 7, 1], size: [3, 4] });
        assert_eq!(rle.decode().unwrap(), corner);
        let nothing = Rle::encode(&mask(["....", "....", "...."]));
        assert_eq!(nothing.counts, [12]);
        for counts in [vec![3], vec![13], vec![u32::MAX; 5], vec![]] {
            assert!(Rle { counts, size: [3, 4] }.decode().is_none());
        }
    }

    #[test]
    fn boxes_count_pixels_and_are_of_the_whole_silhouette() {
        let whole = mask(["....", ".###", ".###"]);
        let seen = mask(["....", "...#", "...#"]);
        let annotation = annotation(7, &whole, &seen, 0.09).unwrap();
        assert_eq!((annotation.bbox, annotation.area, annotation.ignore), ([1, 1, 3, 2], 2, true));
        assert!(super::annotation(7, &whole, &mask(["....", "....", "...."]), 0.0).is_none());
    }

    #[test]
    fn merging_makes_ids_unique_and_names_relative() {
        let one = mask([".#", ".#", ".."]);
        let frames: SceneAnnotations =
            [1, 4].map(|im| (im, ([2, 3], vec![annotation(5, &one, &one, 1.0), None]))).into();
        let named =
            |ids: &[u32]| ids.iter().map(|id| (*id, format!("object {id}"))).collect::<BTreeMap<_, _>>();
        let mut whole = scene("set", &named(&[5]), &frames);
        assert_eq!(
            whole.annotations.iter().map(|a| (a.id, a.image_id)).collect::<Vec<_>>(),
            [(1, 1), (2, 4)]
        );
        whole.merge(scene("set", &named(&[3, 5]), &frames), "test/000002");
        assert_eq!(whole.images.iter().map(|i| i.id).collect::<Vec<_>>(), [1, 4, 6, 9]);
        assert_eq!(whole.images[3].file_name, "test/000002/rgb/000004.png");
        assert_eq!(
            whole.annotations.iter().map(|a| (a.id, a.image_id)).collect::<Vec<_>>()[2..],
            [(3, 6), (4, 9)]
        );
        let categories: Vec<_> = whole.categories.iter().map(|c| (c.id, c.name.as_str())).collect();
        assert_eq!(categories, [(3, "object 3"), (5, "object 5")]);
    }
}
