//! The first hypotheses: importance sampling over boxes, then positions and rotations inside them.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

use super::settings::ProposalSettings;
use crate::detector::{Detection, iou};
use crate::hull::projected_bounds;
use crate::model::Model;
use crate::observation::{FlatPlane, Observation, Stride};
use crate::sampling::{gumbel_top, sample_by, small_rotation, uniform_rotation};

/// A box of the detector, ready for sampling.
#[derive(Debug, Clone)]
pub(crate) struct BoxPrior {
    pub bbox: [f64; 4],
    /// 0 to 1.
    pub confidence: f64,
    /// Share of the proposals that are drawn from it.
    pub share: f64,
    pub vague: bool,
    /// Observed points in it that may be an object's: optical frame, metres.
    points: Vec<Vector3<f32>>,
}

impl BoxPrior {
    /// Depths of the observed points in it, metres.
    pub fn depths(&self) -> impl Iterator<Item = f32> {
        self.points.iter().map(|p| p.z)
    }
}

/// The boxes of one object with the observed points in each, the most confident first, and last the whole image: an object is
/// anywhere with the probability that the best box does not have, and at least with that of the settings.
pub(crate) fn box_priors(
    detections: &[Detection],
    observation: &Observation,
    settings: &ProposalSettings,
) -> Vec<BoxPrior> {
    let k = &observation.intrinsics;
    let (width, height) = (k.width as f64, k.height as f64);
    let confidences: Vec<f64> = detections.iter().map(|d| d.confidence).collect();
    let (shares, elsewhere) = shares(&confidences, settings.anywhere);
    let prior = |bbox: [f64; 4], confidence: f64, share: f64| {
        let inside = points_inside(&bbox, observation, 0.5);
        BoxPrior {
            bbox,
            confidence,
            share,
            vague: (bbox[2] - bbox[0]) * (bbox[3] - bbox[1]) > settings.vague_share * width * height,
            points: if inside.is_empty() { points_inside(&bbox, observation, -1.0) } else { inside },
        }
    };
    let mut priors: Vec<BoxPrior> = detections
        .iter()
        .zip(confidences.iter().zip(shares))
        .map(|(d, (confidence, share))| prior(d.bbox, *confidence, share))
        .collect();
    priors.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
    priors.push(prior([0.0, 0.0, width - 1.0, height - 1.0], 0.0, elsewhere));
    priors
}

/// Shares of boxes with these confidences in the proposals, and that of the whole image; together 1.
fn shares(confidences: &[f64], anywhere: f64) -> (Vec<f64>, f64) {
    let (most, sum) = (confidences.iter().copied().fold(0.0, f64::max), confidences.iter().sum::<f64>());
    let elsewhere = if sum > 0.0 { (1.0 - most).max(anywhere) } else { 1.0 };
    let share = |c: &f64| if elsewhere < 1.0 { (1.0 - elsewhere) * c / sum } else { 0.0 };
    (confidences.iter().map(share).collect(), elsewhere)
}

/// Points of the level with stride 4 that lie in the box and weigh more than `weight`.
fn points_inside(bbox: &[f64; 4], observation: &Observation, weight: f32) -> Vec<Vector3<f32>> {
    let level = observation.level(Stride::Four);
    let low = |x: f64| ((x / 4.0).floor().max(0.0)) as usize;
    let mut points = Vec::new();
    for v in low(bbox[1])..(low(bbox[3]) + 1).min(level.height) {
        for u in low(bbox[0])..(low(bbox[2]) + 1).min(level.width) {
            let i = level.index(u as i32, v as i32);
            // Pixels that another object explains lie right before the lens.
            if level.w[i] > 0.0 && level.w[i] < 10.0 && level.weight[i] > weight {
                let z = 1.0 / level.w[i];
                let (x, y) = ((u as f32 - level.cx) / level.fx, (v as f32 - level.cy) / level.fy);
                points.push(Vector3::new(x * z, y * z, z));
            }
        }
    }
    points
}

/// Draws `oversampling` times `count` hypotheses and keeps `count`: as many of the whole image as is its share, and of boxes those
/// whose projection overlaps their box.
pub(crate) fn propose<R: Rng>(
    model: &Model,
    observation: &Observation,
    boxes: &[BoxPrior],
    planes: &[FlatPlane],
    settings: &ProposalSettings,
    count: usize,
    rng: &mut R,
) -> Vec<Isometry3<f32>> {
    // Poses and the logarithms of their weights, of boxes and of vague ones.
    let mut drawn: [(Vec<Isometry3<f32>>, Vec<f32>); 2] = Default::default();
    for _ in 0..count * settings.oversampling {
        let Some(chosen) = sample_by(boxes, |b| b.share, rng) else {
            break;
        };
        let Some(pose) = draw(model, observation, chosen, planes, settings, rng) else {
            continue;
        };
        let Some(bounds) = projected_bounds(&model.outline, &pose, &observation.intrinsics) else {
            continue;
        };
        let overlap = if chosen.vague { 1.0 } else { iou(&chosen.bbox, &bounds) as f32 };
        let (poses, weights) = &mut drawn[usize::from(chosen.vague)];
        poses.push(pose);
        weights.push((settings.miss_weight + overlap * overlap).ln());
    }
    let share: f64 = boxes.iter().filter(|b| b.vague).map(|b| b.share).sum();
    let vague = ((share * count as f64).round() as usize).min(count);
    let mut kept = Vec::with_capacity(count);
    for ((poses, weights), count) in drawn.iter().zip([count - vague, vague]) {
        kept.extend(gumbel_top(weights, count, rng).into_iter().map(|i| poses[i]));
    }
    kept
}

fn draw<R: Rng>(
    model: &Model,
    observation: &Observation,
    chosen: &BoxPrior,
    planes: &[FlatPlane],
    settings: &ProposalSettings,
    rng: &mut R,
) -> Option<Isometry3<f32>> {
    let point = chosen.points.get(rng.random_range(0..chosen.points.len().max(1)))?;
    // The ray through an observed point, or through somewhere near the box's centre.
    let k = &observation.intrinsics;
    let mut ray = point / point.z;
    if rng.random::<bool>() {
        let b = chosen.bbox.map(|x| x as f32);
        let mut scatter = |a: f32, b: f32| {
            let normal: f32 = StandardNormal.sample(rng);
            0.5 * (a + b) + settings.centre_scatter * (b - a) * normal
        };
        ray.x = (scatter(b[0], b[2]) - k.cx as f32) / k.fx as f32;
        ray.y = (scatter(b[1], b[3]) - k.cy as f32) / k.fy as f32;
    }
    let plane = match planes {
        [] => None,
        [plane] => Some(plane),
        // On which one it stands is not known.
        _ => Some(&planes[rng.random_range(0..planes.len())]),
    };
    if let Some((up, offset)) = plane
        && rng.random::<f64>() < settings.resting_share
        && let Some(rest) = sample_by(&model.resting, |r| f64::from(r.weight), rng)
    {
        // Where the ray is as high over the plane as the origin of the resting object.
        let z = (rest.height - offset) / up.dot(&ray);
        if z > 0.1 && z < 20.0 {
            let down = -up;
            let level = UnitQuaternion::rotation_between(&rest.down, &down)
                .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&orthogonal(up), std::f32::consts::PI));
            let yaw = rng.random::<f32>() * std::f32::consts::TAU;
            let turn = UnitQuaternion::from_axis_angle(&UnitVector3::new_normalize(*up), yaw);
            let rotation = small_rotation(settings.tilt_rad, rng) * turn * level;
            return Some(Isometry3::from_parts(Translation3::from(ray * z), rotation));
        }
    }
    // The surface is seen, the centre lies behind it.
    let push = rng.random::<f32>() * model.radius;
    let position = ray * (point.z + push / ray.norm());
    Some(Isometry3::from_parts(Translation3::from(position), uniform_rotation(rng)))
}

/// Some unit vector orthogonal to `v`.
fn orthogonal(v: &Vector3<f32>) -> UnitVector3<f32> {
    let other = if v.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    UnitVector3::new_normalize(v.cross(&other))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_boxes_leave_in_doubt_is_looked_for_anywhere() {
        let close = |(shares, elsewhere): (Vec<f64>, f64), boxes: &[f64], rest: f64| {
            assert!((elsewhere - rest).abs() < 1e-12, "{elsewhere} {rest}");
            assert!(shares.iter().zip(boxes).all(|(a, b)| (a - b).abs() < 1e-12), "{shares:?} {boxes:?}");
            assert!((shares.iter().sum::<f64>() + elsewhere - 1.0).abs() < 1e-12);
        };
        close(shares(&[1.0, 1.0], 0.0), &[0.5, 0.5], 0.0);
        close(shares(&[1.0, 1.0], 0.1), &[0.45, 0.45], 0.1);
        close(shares(&[0.3, 0.1], 0.1), &[0.225, 0.075], 0.7);
        close(shares(&[0.0, 0.0], 0.1), &[0.0, 0.0], 1.0);
        close(shares(&[], 0.1), &[], 1.0);
    }
}
