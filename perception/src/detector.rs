//! The first stage: where in the image may an object be?

use std::collections::BTreeMap;
use std::sync::Arc;

use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;
use nalgebra::Point3;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// A box in the image and how much a detector believes that the object is in it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Detection {
    /// `[u0, v0, u1, v1]`, pixels, `u0 <= u1`, `v0 <= v1`.
    pub bbox: [f64; 4],
    /// How likely the object is in it, 0 to 1. Boxes are drawn in proportion to it, so any other non-negative number will do for
    /// that; in scores, what is over 1 counts as 1.
    pub confidence: f64,
}

impl Detection {
    /// Area of the intersection over area of the union of two boxes, 0 to 1.
    pub fn iou(&self, other: &[f64; 4]) -> f64 {
        iou(&self.bbox, other)
    }
}

/// Intersection over union of two boxes `[u0, v0, u1, v1]`.
pub(crate) fn iou(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    let area = |r: &[f64; 4]| (r[2] - r[0]).max(0.0) * (r[3] - r[1]).max(0.0);
    let both = area(&[a[0].max(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].min(b[3])]);
    let union = area(a) + area(b) - both;
    if union > 0.0 { both / union } else { 0.0 }
}

/// For each object the whole distribution over boxes: GRIP applies no threshold, so that a weak but true detection is
/// never lost to a strong false one.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Detections {
    by_object: BTreeMap<String, Vec<Detection>>,
}

impl Detections {
    /// Nothing about anything.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a box for `object`.
    ///
    /// # Errors
    /// When the box is not finite and in order or the confidence is not finite and non-negative.
    pub fn push(&mut self, object: &str, detection: Detection) -> Result<()> {
        let [u0, v0, u1, v1] = detection.bbox;
        let finite = detection.bbox.iter().all(|x| x.is_finite());
        if !finite || u0 > u1 || v0 > v1 || !(0.0..f64::MAX).contains(&detection.confidence) {
            return Err(Error::Object {
                object: object.to_owned(),
                message: format!(
                    "detection [{u0}, {v0}, {u1}, {v1}] with confidence {}: need u0 <= u1, v0 <= v1, finite, and a confidence of at least 0",
                    detection.confidence
                ),
            });
        }
        self.by_object.entry(object.to_owned()).or_default().push(detection);
        Ok(())
    }

    /// All boxes of an object; empty when the detector said nothing about it.
    pub fn of(&self, object: &str) -> &[Detection] {
        self.by_object.get(object).map_or(&[], Vec::as_slice)
    }

    /// Names and boxes, in the names' order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &[Detection])> {
        self.by_object.iter().map(|(name, boxes)| (name.as_str(), boxes.as_slice()))
    }

    /// Draws a box of `object` with probability in proportion to its confidence (uniform when all are zero); `None` when
    /// it has none.
    pub fn sample<R: Rng>(&self, object: &str, rng: &mut R) -> Option<&Detection> {
        let boxes = self.of(object);
        sample_by(boxes, |d| d.confidence, rng)
    }
}

/// Draws an item with probability in proportion to its weight, uniformly when no weight is positive.
pub(crate) fn sample_by<'a, T, R: Rng>(
    items: &'a [T],
    weight: impl Fn(&T) -> f64,
    rng: &mut R,
) -> Option<&'a T> {
    let total: f64 = items.iter().map(&weight).sum();
    let draw = rng.random::<f64>();
    if !(total > 0.0 && total.is_finite()) {
        return items.get(((draw * items.len() as f64) as usize).min(items.len().saturating_sub(1)));
    }
    let mut rest = draw * total;
    let mut last = None;
    for item in items {
        let w = weight(item);
        if w <= 0.0 {
            continue;
        }
        last = Some(item);
        rest -= w;
        if rest < 0.0 {
            break;
        }
    }
    last
}

/// The part of the world that holds the objects, an axis-aligned box in the world frame, metres: what the robot knows
/// of its cell (its table, not what is on it).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Workspace {
    /// Lower corner.
    pub min: [f64; 3],
    /// Upper corner.
    pub max: [f64; 3],
}

impl Workspace {
    /// Whether a point of the world is inside.
    pub fn contains(&self, point: &Point3<f64>) -> bool {
        (0..3).all(|i| point[i] >= self.min[i] && point[i] <= self.max[i])
    }
}

/// Finds where objects may be.
pub trait Detector: Send + Sync {
    /// Short name for reports, such as `clusters`.
    fn name(&self) -> &'static str;

    /// Boxes for each of `objects`.
    ///
    /// # Errors
    /// When the frame is not usable.
    fn detect(&self, frame: &CameraFrame, objects: &[Arc<ObjectModel>]) -> Result<Detections>;
}

/// The detector `none`: one box, the whole image, for every object.
#[derive(Debug, Clone, Copy, Default)]
pub struct WholeImage;

impl Detector for WholeImage {
    fn name(&self) -> &'static str {
        "none"
    }

    fn detect(&self, frame: &CameraFrame, objects: &[Arc<ObjectModel>]) -> Result<Detections> {
        check_frame(frame)?;
        let bbox = [0.0, 0.0, frame.intrinsics.width as f64 - 1.0, frame.intrinsics.height as f64 - 1.0];
        let mut detections = Detections::new();
        for object in objects {
            detections.push(&object.info.name, Detection { bbox, confidence: 1.0 })?;
        }
        Ok(detections)
    }
}

/// Refuses frames that cannot be used: disagreeing sizes, bad intrinsics, no depth reading at all.
pub(crate) fn check_frame(frame: &CameraFrame) -> Result<()> {
    let (k, depth) = (&frame.intrinsics, &frame.depth);
    if let Some(problem) = k.problem() {
        return Err(Error::Frame(format!("intrinsics: {problem}")));
    }
    if (depth.width(), depth.height()) != (k.width, k.height) {
        return Err(Error::Frame(format!(
            "depth image is {}x{} but the intrinsics say {}x{}; use the intrinsics of the registered depth",
            depth.width(),
            depth.height(),
            k.width,
            k.height
        )));
    }
    if !frame.world_from_camera.is_finite() {
        return Err(Error::Frame("world_from_camera is not finite".into()));
    }
    if !depth.data().iter().any(|&z| is_reading(z)) {
        return Err(Error::Frame(
            "the depth image has no reading between 0.1 and 20 m; check the sensor's range and that depth is in metres".into(),
        ));
    }
    Ok(())
}

/// Whether a depth value is a usable reading: 0.0 means none, and NaN, negative or absurd values are treated alike.
pub(crate) fn is_reading(z: f32) -> bool {
    (0.1..20.0).contains(&z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use grip_sim::rng;

    fn boxed(u0: f64, confidence: f64) -> Detection {
        Detection { bbox: [u0, 0.0, u0 + 10.0, 10.0], confidence }
    }

    #[test]
    fn samples_boxes_in_proportion_to_confidence() {
        let mut detections = Detections::new();
        for (u0, c) in [(0.0, 0.1), (20.0, 0.6), (40.0, 0.0), (60.0, 0.3)] {
            detections.push("can", boxed(u0, c)).unwrap();
        }
        let mut rng = rng::stream(5, "test");
        let mut counts = [0usize; 4];
        for _ in 0..20_000 {
            let d = detections.sample("can", &mut rng).unwrap();
            counts[(d.bbox[0] / 20.0) as usize] += 1;
        }
        for (count, share) in counts.iter().zip([0.1, 0.6, 0.0, 0.3]) {
            assert!((*count as f64 / 20_000.0 - share).abs() < 0.015, "{counts:?}");
        }
        assert!(detections.sample("mug", &mut rng).is_none());
    }

    #[test]
    fn all_zero_confidence_is_a_uniform_prior() {
        let mut detections = Detections::new();
        detections.push("can", boxed(0.0, 0.0)).unwrap();
        detections.push("can", boxed(20.0, 0.0)).unwrap();
        let mut rng = rng::stream(6, "test");
        let right = (0..4000).filter(|_| detections.sample("can", &mut rng).unwrap().bbox[0] > 1.0).count();
        assert!((1800..2200).contains(&right), "{right}");
    }

    #[test]
    fn refuses_boxes_that_are_none() {
        let mut detections = Detections::new();
        for bad in [
            Detection { bbox: [5.0, 0.0, 1.0, 3.0], confidence: 1.0 },
            boxed(0.0, -1.0),
            boxed(f64::NAN, 1.0),
            boxed(0.0, f64::NAN),
        ] {
            assert!(detections.push("can", bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn intersection_over_union_closed_form() {
        let a = boxed(0.0, 1.0);
        assert!((a.iou(&[5.0, 0.0, 15.0, 10.0]) - 50.0 / 150.0).abs() < 1e-12);
        assert_eq!(a.iou(&[20.0, 0.0, 30.0, 10.0]), 0.0);
        assert_eq!(a.iou(&a.bbox), 1.0);
    }
}
