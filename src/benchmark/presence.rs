//! Whether confidences mean anything: objects that are there against objects that are not, and confidence against
//! correctness.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::Result;
use grip_sim::bop::Dataset;
use grip_sim::bop::results::Estimate;
use schemars::JsonSchema;
use serde::Serialize;

use super::case::Case;

/// An estimate is right when its ADD-S is below this, metres.
pub const RIGHT_M: f64 = 0.01;
/// Confidence from which an object is said to be there.
pub const THERE: f64 = 0.5;
/// Share of absent objects that may be said to be there in [`Presence::found_at_5_percent`].
const FALSE_ALARMS: f64 = 0.05;
/// Bins of confidence.
const BINS: usize = 10;

/// How well confidence tells objects that are there from objects that are not. Estimates of objects that are not in an image
/// (`grip estimate --absent`) are what they are compared with.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Presence {
    /// Estimates of objects that are there,
    pub present: usize,
    /// and of objects that are not.
    pub absent: usize,
    /// Area under the ROC curve: how often a present object has more confidence than an absent one; ties count half. Null
    /// without absent objects.
    pub auroc: Option<f64>,
    /// Share of present objects that are found at the confidence that 5 % of the absent ones reach.
    pub found_at_5_percent: Option<f64>,
    /// Share of present, and of absent objects with a confidence of 0.5 or more.
    pub said_there: [f64; 2],
    /// The ROC curve: shares of absent and of present objects at least so confident, from the most confident on.
    pub roc: Vec<[f64; 2]>,
    /// Confidence against the share of estimates that are right (ADD-S below 1 cm); bins without estimates are left out.
    pub calibration: Vec<Bin>,
    /// Expected calibration error: mean distance of the two over the bins, weighed by their estimates (Guo 2017).
    pub calibration_error: f64,
}

/// Estimates of about the same confidence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Bin {
    /// How many.
    pub estimates: usize,
    /// Mean confidence.
    pub confidence: f64,
    /// Share that is right.
    pub right: f64,
}

/// Estimates of objects that are not in the image, of images and objects that the data set has.
///
/// # Errors
/// When the truth cannot be read.
pub fn of_absent_objects<'a>(dataset: &Dataset, estimates: &'a [Estimate]) -> Result<Vec<&'a Estimate>> {
    let mut there: BTreeMap<(u32, u32), BTreeSet<u32>> = BTreeMap::new();
    for scene_id in dataset.scenes()? {
        for im_id in dataset.images(scene_id)? {
            there.insert((scene_id, im_id), BTreeSet::new());
        }
    }
    let images: BTreeSet<(u32, u32)> = estimates.iter().map(|e| (e.scene_id, e.im_id)).collect();
    for image in images {
        if let Some(objects) = there.get_mut(&image) {
            objects.extend(dataset.ground_truths(image.0, image.1)?.iter().map(|truth| truth.obj_id));
        }
    }
    let known: BTreeSet<u32> = dataset.model_ids()?.into_iter().collect();
    let absent = |e: &&Estimate| {
        let objects = there.get(&(e.scene_id, e.im_id));
        known.contains(&e.obj_id) && objects.is_some_and(|objects| !objects.contains(&e.obj_id))
    };
    Ok(estimates.iter().filter(absent).collect())
}

/// Of the estimates of a results file: `cases` are those that were asked for, `absent` those of objects that are not there.
pub fn presence(absent: &[&Estimate], cases: &[Case]) -> Presence {
    let absent: Vec<f64> = absent.iter().map(|estimate| estimate.score).collect();
    let present: Vec<(f64, bool)> =
        cases.iter().filter_map(|case| Some((case.score?, case.adds < RIGHT_M))).collect();
    figures(&present, &absent)
}

/// `present` are confidences of objects that are there, and whether their poses are right.
fn figures(present: &[(f64, bool)], absent: &[f64]) -> Presence {
    let share = |count: usize, whole: usize| if whole == 0 { 0.0 } else { count as f64 / whole as f64 };
    let roc = roc(present, absent);
    let auroc = (!present.is_empty() && !absent.is_empty()).then(|| {
        // Trapezoids: ties make slanted steps, which counts them half.
        roc.windows(2).map(|w| (w[1][0] - w[0][0]) * 0.5 * (w[0][1] + w[1][1])).sum()
    });
    let found_at_5_percent = auroc.is_some().then(|| {
        roc.iter().filter(|[alarms, _]| *alarms <= FALSE_ALARMS).map(|[_, found]| *found).fold(0.0, f64::max)
    });
    let all = || present.iter().copied().chain(absent.iter().map(|&confidence| (confidence, false)));
    let bin = |i: usize| {
        let of_bin: Vec<(f64, bool)> =
            all().filter(|(c, _)| ((c * BINS as f64) as usize).min(BINS - 1) == i).collect();
        let right = of_bin.iter().filter(|(_, right)| *right).count();
        let sum: f64 = of_bin.iter().map(|(c, _)| c).sum();
        Bin {
            estimates: of_bin.len(),
            confidence: sum / of_bin.len().max(1) as f64,
            right: share(right, of_bin.len()),
        }
    };
    let calibration: Vec<Bin> = (0..BINS).map(bin).filter(|bin| bin.estimates > 0).collect();
    let whole = (present.len() + absent.len()).max(1) as f64;
    let calibration_error =
        calibration.iter().map(|b| b.estimates as f64 * (b.confidence - b.right).abs()).sum::<f64>() / whole;
    Presence {
        present: present.len(),
        absent: absent.len(),
        auroc,
        found_at_5_percent,
        said_there: [
            share(present.iter().filter(|(c, _)| *c >= THERE).count(), present.len()),
            share(absent.iter().filter(|c| **c >= THERE).count(), absent.len()),
        ],
        roc,
        calibration,
        calibration_error,
    }
}

fn roc(present: &[(f64, bool)], absent: &[f64]) -> Vec<[f64; 2]> {
    if present.is_empty() || absent.is_empty() {
        return Vec::new();
    }
    let mut marks: Vec<(f64, usize)> =
        absent.iter().map(|c| (*c, 0)).chain(present.iter().map(|(c, _)| (*c, 1))).collect();
    marks.sort_by(|a, b| b.0.total_cmp(&a.0));
    let sizes = [absent.len() as f64, present.len() as f64];
    let mut counts = [0.0; 2];
    let mut curve = vec![[0.0, 0.0]];
    for equal in marks.chunk_by(|a, b| a.0 == b.0) {
        for (_, which) in equal {
            counts[*which] += 1.0;
        }
        curve.push([counts[0] / sizes[0], counts[1] / sizes[1]]);
    }
    curve
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_and_its_area_in_closed_form() {
        let present = [(0.9, true), (0.6, true), (0.4, false)];
        let absent = [0.6, 0.1];
        let p = figures(&present, &absent);
        // Pairs: 0.9 beats both, 0.6 ties and beats, 0.4 loses and beats: 1 + 1 + 0.5 + 1 + 0 + 1 of 6.
        assert!((p.auroc.unwrap() - 4.5 / 6.0).abs() < 1e-12, "{p:?}");
        assert_eq!(p.found_at_5_percent, Some(1.0 / 3.0));
        assert_eq!(p.said_there, [2.0 / 3.0, 0.5]);
        assert_eq!(p.roc.first(), Some(&[0.0, 0.0]));
        assert_eq!(p.roc.last(), Some(&[1.0, 1.0]));
    }

    #[test]
    fn confidence_that_means_what_it_says_has_no_calibration_error() {
        let present: Vec<(f64, bool)> = (0..100).map(|i| (0.75, i < 75)).collect();
        let p = figures(&present, &[]);
        assert_eq!(p.calibration, [Bin { estimates: 100, confidence: 0.75, right: 0.75 }]);
        assert!(p.calibration_error < 1e-12 && p.auroc.is_none() && p.roc.is_empty());
        // Absent objects are never right.
        let p = figures(&present, &[0.75; 100]);
        assert!((p.calibration_error - 0.375).abs() < 1e-12);
    }
}
