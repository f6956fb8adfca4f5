//! Where in the image an object may be, and who says so.

use std::collections::BTreeMap;
use std::sync::Arc;

use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;
use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use crate::error::{Error, Result};
use crate::sampling::sample_by;

/// A box in the image and how much a detector believes that the object is in it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Detection {
    /// `[u0, v0, u1, v1]`, pixels, `u0 <= u1`, `v0 <= v1`.
    pub bbox: [f64; 4],
    /// How likely the object is in it, 0 to 1. Boxes are drawn in proportion to it.
    pub confidence: f64,
}

impl Detection {
    /// What is wrong with it, if anything: which number, its value and what is allowed.
    ///
    /// # Errors
    /// That.
    pub fn validate(&self) -> std::result::Result<(), String> {
        let [u0, v0, u1, v1] = self.bbox;
        let shown = format!("bbox = [{u0}, {v0}, {u1}, {v1}]");
        if !self.bbox.iter().all(|x| x.is_finite()) {
            return Err(format!("{shown}: must be finite, pixels"));
        }
        if u0 > u1 || v0 > v1 {
            return Err(format!("{shown}: [u0, v0, u1, v1] needs u0 <= u1 and v0 <= v1"));
        }
        if !(0.0..=1.0).contains(&self.confidence) {
            return Err(format!("confidence = {}: must be 0 to 1; scale it", self.confidence));
        }
        Ok(())
    }

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
///
/// Every box in it is finite and in order, and every confidence 0 to 1, however it came to be: also what is read from a
/// file is checked.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
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
    /// [`Error::Detection`] for a box that is not finite or not in order, or a confidence outside 0 to 1.
    pub fn push(&mut self, object: &str, detection: Detection) -> Result<()> {
        detection.validate().map_err(|problem| Error::Detection { object: object.to_owned(), problem })?;
        self.by_object.entry(object.to_owned()).or_default().push(detection);
        Ok(())
    }

    /// All boxes of an object; empty when the detector said nothing about it.
    pub fn of(&self, object: &str) -> &[Detection] {
        self.by_object.get(object).map_or(&[], Vec::as_slice)
    }

    /// Without the boxes of a lower confidence: hard detections. An object of which no box is left has none, as one about which
    /// the detector said nothing.
    #[must_use]
    pub fn at_least(mut self, confidence: f64) -> Self {
        self.by_object.retain(|_, boxes| {
            boxes.retain(|detection| detection.confidence >= confidence);
            !boxes.is_empty()
        });
        self
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

impl<'de> Deserialize<'de> for Detections {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        let mut detections = Self::new();
        for (object, boxes) in BTreeMap::<String, Vec<Detection>>::deserialize(deserializer)? {
            // An object without boxes is one of which nothing is known.
            detections.by_object.entry(object.clone()).or_default();
            for detection in boxes {
                detections.push(&object, detection).map_err(serde::de::Error::custom)?;
            }
        }
        Ok(detections)
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
    fn a_threshold_takes_boxes_and_objects_without_any() {
        let mut detections = Detections::new();
        for (object, u0, confidence) in [("can", 0.0, 0.5), ("can", 20.0, 0.499), ("mug", 40.0, 0.1)] {
            detections.push(object, boxed(u0, confidence)).unwrap();
        }
        assert_eq!(detections.clone().at_least(0.0), detections);
        let hard = detections.at_least(0.5);
        assert_eq!(hard.iter().collect::<Vec<_>>(), [("can", &[boxed(0.0, 0.5)][..])]);
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
    fn boxes_that_are_none_are_refused_however_they_come() {
        let mut detections = Detections::new();
        for (bad, wanted) in [
            (Detection { bbox: [5.0, 0.0, 1.0, 3.0], confidence: 1.0 }, "needs u0 <= u1"),
            (boxed(0.0, -1.0), "confidence = -1: must be 0 to 1"),
            (boxed(0.0, 1.5), "confidence = 1.5: must be 0 to 1"),
            (boxed(0.0, f64::NAN), "confidence = NaN"),
            (boxed(f64::NAN, 1.0), "must be finite"),
            (boxed(f64::INFINITY, 1.0), "must be finite"),
        ] {
            let message = detections.push("can", bad).unwrap_err().to_string();
            assert!(message.contains(wanted) && message.contains("'can'"), "{message}");
        }
        assert_eq!(detections, Detections::new());
        let read = |text: &str| serde_json::from_str::<Detections>(text).map_err(|error| error.to_string());
        let good = r#"{"can": [{"bbox": [0, 0, 9, 9], "confidence": 0.5}], "mug": []}"#;
        assert_eq!(read(good).unwrap().of("can").len(), 1);
        for (text, wanted) in [
            (r#"{"can": [{"bbox": [9, 0, 0, 9], "confidence": 0.5}]}"#, "'can': bbox = [9, 0, 0, 9]"),
            (r#"{"can": [{"bbox": [0, 0, 9, 9], "confidence": 2}]}"#, "confidence = 2: must be 0 to 1"),
            (r#"{"can": [{"bbox": [0, 0, 1e999, 9], "confidence": 1}]}"#, "out of range"),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.contains(wanted), "{message}");
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
