//! What a detector's boxes are worth, as COCO measures it.
//!
//! A box of the truth is that of the whole silhouette within the image, as in the BOP challenge's detection task. Instances of
//! which less than a tenth is seen are neither hits nor misses. Of each object and image the 100 most confident boxes count.

use std::collections::BTreeMap;

use anyhow::Result;
use grip_sim::bop::BopFrame;
use grip_sim::objects::ObjectModel;
use schemars::JsonSchema;
use serde::Serialize;

use super::boxes::known_or_measured;

/// COCO's ten thresholds of intersection over union, to the last bit.
const OVERLAPS: [f64; 10] = [0.50, 0.55, 0.60, 0.65, 0.70, 0.75, 0.80, 0.85, 0.899_999_999_999_999_9, 0.95];
/// Boxes of an object that count, an image.
pub const MOST_BOXES: usize = 100;
/// Precision is read at so many recalls from 0 to 1, and averaged. They are COCO's to the last bit: 0.7 is a little more than 7 of
/// 10.
const RECALLS: usize = 101;

/// Left, top, width and height, pixels.
pub type Box2 = [f64; 4];

/// One object in one image: what is there, and what was said to be.
#[derive(Debug, Clone, Default)]
pub struct ObjectImage {
    /// The object's number.
    pub object: u32,
    /// The boxes of the truth, and whether each is to be ignored.
    pub truth: Vec<(Box2, bool)>,
    /// Boxes with their confidences.
    pub found: Vec<(Box2, f64)>,
}

/// The boxes of an object in an image, and whether each is to be ignored, from the truth of its data set. Where that does not tell
/// how much is seen it is measured.
///
/// # Errors
/// When the frame's camera and depth picture differ in size.
pub fn truth_boxes(frame: &BopFrame, object: &ObjectModel) -> Result<Vec<(Box2, bool)>> {
    let size = [f64::from(frame.rgb.width()), f64::from(frame.rgb.height())];
    let within = |[x, y, w, h]: [f64; 4]| {
        let (left, top) = (x.clamp(0.0, size[0]), y.clamp(0.0, size[1]));
        // Boxes of scene_gt_info.json reach from the first pixel to the last one: one less than they count.
        [left, top, (x + w + 1.0).clamp(left, size[0]) - left, (y + h + 1.0).clamp(top, size[1]) - top]
    };
    let asked = frame.truth()?.iter().filter(|truth| truth.obj_id == object.info.bop_id);
    let boxes = asked.map(|truth| {
        let info = known_or_measured(truth, object, frame)?;
        Ok((within(info.bbox_obj.map(f64::from)), !info.is_target()))
    });
    boxes.collect()
}

/// Figures of some images.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct DetectionFigures {
    /// Instances that count.
    pub instances: usize,
    /// Average precision at an overlap of 0.5, mean of the objects that are there.
    pub ap50: Option<f64>,
    /// The same, mean over overlaps of 0.5 to 0.95.
    pub ap: Option<f64>,
    /// Share of instances that one of the 100 most confident boxes overlaps by 0.5 or more, mean of the objects.
    pub recall50: Option<f64>,
    /// The same, mean over overlaps of 0.5 to 0.95: COCO's AR at 100.
    pub ar: Option<f64>,
    /// Share of instances that the single most confident box of their object overlaps by 0.5 or more, mean of the objects.
    pub top1: Option<f64>,
}

/// Measures boxes by object, in the order of their numbers, and all together.
pub fn measure<'a>(
    images: impl IntoIterator<Item = &'a ObjectImage>,
) -> (BTreeMap<u32, DetectionFigures>, DetectionFigures) {
    let mut by_object: BTreeMap<u32, Vec<&ObjectImage>> = BTreeMap::new();
    for image in images {
        by_object.entry(image.object).or_default().push(image);
    }
    let figures: BTreeMap<u32, DetectionFigures> =
        by_object.into_iter().map(|(object, images)| (object, of_object(&images))).collect();
    let mean = |value: fn(&DetectionFigures) -> Option<f64>| {
        let values: Vec<f64> = figures.values().filter_map(value).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    let all = DetectionFigures {
        instances: figures.values().map(|f| f.instances).sum(),
        ap50: mean(|f| f.ap50),
        ap: mean(|f| f.ap),
        recall50: mean(|f| f.recall50),
        ar: mean(|f| f.ar),
        top1: mean(|f| f.top1),
    };
    (figures, all)
}

fn of_object(images: &[&ObjectImage]) -> DetectionFigures {
    let instances: usize =
        images.iter().map(|image| image.truth.iter().filter(|(_, ignored)| !ignored).count()).sum();
    if instances == 0 {
        return DetectionFigures { instances, ap50: None, ap: None, recall50: None, ar: None, top1: None };
    }
    let curves = OVERLAPS.map(|overlap| curve(images, overlap, MOST_BOXES, instances));
    let mean = |value: fn(&(f64, f64)) -> f64| curves.iter().map(value).sum::<f64>() / curves.len() as f64;
    DetectionFigures {
        instances,
        ap50: Some(curves[0].0),
        ap: Some(mean(|c| c.0)),
        recall50: Some(curves[0].1),
        ar: Some(mean(|c| c.1)),
        top1: Some(curve(images, OVERLAPS[0], 1, instances).1),
    }
}

/// Average precision and recall of one object at one overlap.
fn curve(images: &[&ObjectImage], overlap: f64, most: usize, instances: usize) -> (f64, f64) {
    // Confidence and whether it is a hit, of all boxes that are not ignored.
    let mut verdicts: Vec<(f64, bool)> = Vec::new();
    for image in images {
        let mut found = image.found.clone();
        found.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut taken = vec![false; image.truth.len()];
        for (bbox, confidence) in found.iter().take(most) {
            // The free instance that it overlaps most; one to be ignored only where there is no other.
            let best = |ignored: bool| {
                let free = (0..image.truth.len()).filter(|i| image.truth[*i].1 == ignored && !taken[*i]);
                free.map(|i| (i, iou(bbox, &image.truth[i].0)))
                    .filter(|(_, share)| *share >= overlap)
                    .max_by(|a, b| a.1.total_cmp(&b.1))
            };
            match best(false).or_else(|| best(true)) {
                Some((i, _)) => {
                    taken[i] = true;
                    if !image.truth[i].1 {
                        verdicts.push((*confidence, true));
                    }
                }
                None => verdicts.push((*confidence, false)),
            }
        }
    }
    verdicts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut hits, mut points) = (0usize, Vec::with_capacity(verdicts.len()));
    for (i, (_, hit)) in verdicts.iter().enumerate() {
        hits += usize::from(*hit);
        points.push((hits as f64 / instances as f64, hits as f64 / (i + 1) as f64));
    }
    // Precision at a recall is the best at that recall or a larger one.
    for i in (1..points.len()).rev() {
        points[i - 1].1 = points[i - 1].1.max(points[i].1);
    }
    let at = |recall: f64| {
        let i = points.partition_point(|(r, _)| *r < recall);
        points.get(i).map_or(0.0, |p| p.1)
    };
    let precision = (0..RECALLS).map(|i| at((i as f64 * 0.01).min(1.0))).sum::<f64>() / RECALLS as f64;
    (precision, hits as f64 / instances as f64)
}

fn iou(a: &Box2, b: &Box2) -> f64 {
    let overlap = |i: usize| ((a[i] + a[i + 2]).min(b[i] + b[i + 2]) - a[i].max(b[i])).max(0.0);
    let both = overlap(0) * overlap(1);
    let union = a[2] * a[3] + b[2] * b[3] - both;
    if union > 0.0 { both / union } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: Box2 = [0.0, 0.0, 10.0, 10.0];
    const FAR: Box2 = [100.0, 0.0, 10.0, 10.0];

    fn image(truth: &[Box2], found: &[(Box2, f64)]) -> ObjectImage {
        ObjectImage { object: 1, truth: truth.iter().map(|b| (*b, false)).collect(), found: found.to_vec() }
    }

    fn figures(images: &[ObjectImage]) -> DetectionFigures {
        measure(images).1
    }

    #[test]
    fn perfect_boxes_score_one_and_none_score_zero() {
        let perfect = figures(&[image(&[A], &[(A, 0.9)]), image(&[FAR], &[(FAR, 0.1)])]);
        assert_eq!(
            (perfect.ap50, perfect.ap, perfect.ar, perfect.top1),
            (Some(1.0), Some(1.0), Some(1.0), Some(1.0))
        );
        let nothing = figures(&[image(&[A], &[])]);
        assert_eq!((nothing.ap50, nothing.recall50), (Some(0.0), Some(0.0)));
    }

    #[test]
    fn a_more_confident_false_box_halves_precision() {
        // One instance, found at rank two: precision is 1/2 at every recall.
        let one = figures(&[image(&[A], &[(FAR, 0.9), (A, 0.5)])]);
        assert!((one.ap50.unwrap() - 0.5).abs() < 1e-12, "{one:?}");
        assert_eq!((one.recall50, one.top1), (Some(1.0), Some(0.0)));
        // A less confident one costs nothing.
        assert_eq!(figures(&[image(&[A], &[(FAR, 0.1), (A, 0.5)])]).ap50, Some(1.0));
    }

    #[test]
    fn seven_of_ten_is_less_than_the_recall_of_seventy_per_cent() {
        let images: Vec<ObjectImage> =
            (0..10).map(|i| image(&[A], if i < 7 { &[(A, 0.9)] } else { &[] })).collect();
        // Recalls 0 to 0.69: COCO's 0.7 is 0.7000000000000001.
        assert!((figures(&images).ap50.unwrap() - 70.0 / 101.0).abs() < 1e-12);
    }

    #[test]
    fn a_second_box_of_one_instance_is_false() {
        let twice = figures(&[image(&[A], &[(A, 0.9), (A, 0.8)]), image(&[A], &[(A, 0.1)])]);
        // Ranks: hit, miss, hit of two instances: precision 1 up to recall 1/2, then 2/3: (51 + 50 * 2/3) / 101.
        assert!((twice.ap50.unwrap() - (51.0 + 50.0 * 2.0 / 3.0) / 101.0).abs() < 1e-12, "{twice:?}");
    }

    #[test]
    fn overlap_decides() {
        // 10 x 10 against 10 x 8 inside it: 0.8, so it is a hit at 7 of the ten overlaps.
        let inside = figures(&[image(&[A], &[([0.0, 0.0, 10.0, 8.0], 0.9)])]);
        assert!((inside.ap.unwrap() - 0.7).abs() < 1e-12 && inside.ap50 == Some(1.0), "{inside:?}");
    }

    #[test]
    fn what_is_hidden_neither_counts_nor_harms() {
        let mut hidden = image(&[A, FAR], &[(FAR, 0.9), (A, 0.5)]);
        hidden.truth[1].1 = true;
        let figures = figures(&[hidden]);
        assert_eq!((figures.instances, figures.ap50), (1, Some(1.0)));
    }

    #[test]
    fn objects_count_alike_and_absent_ones_not_at_all() {
        let other =
            |object, truth: &[Box2], found: &[(Box2, f64)]| ObjectImage { object, ..image(truth, found) };
        let images = [
            other(1, &[A], &[(A, 0.9)]),
            other(1, &[A], &[(A, 0.9)]),
            other(2, &[A], &[]),
            other(3, &[], &[(A, 0.9)]),
        ];
        let (by_object, all) = measure(&images);
        assert_eq!(
            (by_object[&1].ap50, by_object[&2].ap50, by_object[&3].ap50),
            (Some(1.0), Some(0.0), None)
        );
        assert_eq!((all.ap50, all.instances), (Some(0.5), 3));
    }
}
