//! The first hypotheses: importance sampling over boxes, then positions and rotations inside them.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, UnitVector3, Vector3};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

use super::model::Model;
use super::resample::gumbel_top;
use super::search::to_camera_bounds;
use super::settings::GripSettings;
use crate::detector::{Detection, iou, sample_by};
use crate::hypotheses::{FlatPlane, Observation};

/// A box that covers more of the image says nothing about extent, and its overlap is not counted.
const VAGUE_SHARE: f64 = 0.5;
/// Weight of a proposal whose projection misses its box altogether.
const FLOOR: f32 = 0.02;
/// Scatter about the box's centre, as a share of its sides.
const CENTRE_SCATTER: f32 = 0.15;
/// Tilt of resting proposals, radians: supports and models are not exact.
const TILT: f32 = 0.03;

/// A box of the detector, ready for sampling.
#[derive(Debug, Clone)]
pub(crate) struct BoxPrior {
    pub bbox: [f64; 4],
    /// Relative to the best box of the object, 0 to 1.
    pub confidence: f64,
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

/// The boxes of one object with the observed points in each. Without any box the whole image is one.
pub(crate) fn box_priors(detections: &[Detection], observation: &Observation) -> Vec<BoxPrior> {
    let k = &observation.intrinsics;
    let whole = Detection { bbox: [0.0, 0.0, k.width as f64 - 1.0, k.height as f64 - 1.0], confidence: 1.0 };
    let detections = if detections.is_empty() { std::slice::from_ref(&whole) } else { detections };
    let most = detections.iter().map(|d| d.confidence).fold(0.0, f64::max);
    let image = (k.width * k.height) as f64;
    detections
        .iter()
        .map(|d| {
            let [u0, v0, u1, v1] = d.bbox;
            let inside = points_inside(&d.bbox, observation, 0.5);
            BoxPrior {
                bbox: d.bbox,
                confidence: if most > 0.0 { d.confidence / most } else { 1.0 },
                vague: (u1 - u0) * (v1 - v0) > VAGUE_SHARE * image,
                points: if inside.is_empty() { points_inside(&d.bbox, observation, -1.0) } else { inside },
            }
        })
        .collect()
}

/// Points of the level with stride 4 that lie in the box and weigh more than `weight`.
fn points_inside(bbox: &[f64; 4], observation: &Observation, weight: f32) -> Vec<Vector3<f32>> {
    let level = observation.level(4);
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

/// A rotation drawn uniformly from all rotations: four normal numbers, normalised.
pub(crate) fn uniform_rotation<R: Rng>(rng: &mut R) -> UnitQuaternion<f32> {
    loop {
        let mut normal = || -> f32 { StandardNormal.sample(rng) };
        let q = Quaternion::new(normal(), normal(), normal(), normal());
        if q.norm() > 1e-3 {
            return UnitQuaternion::from_quaternion(q);
        }
    }
}

/// A small random rotation with this standard deviation about each axis, radians.
pub(crate) fn small_rotation<R: Rng>(sigma: f32, rng: &mut R) -> UnitQuaternion<f32> {
    let mut normal = || -> f32 { StandardNormal.sample(rng) };
    UnitQuaternion::from_scaled_axis(Vector3::new(normal(), normal(), normal()) * sigma)
}

/// Draws `oversampling` times `count` hypotheses and keeps `count` by how their projection overlaps their box.
pub(crate) fn propose<R: Rng>(
    model: &Model,
    observation: &Observation,
    boxes: &[BoxPrior],
    plane: Option<&FlatPlane>,
    settings: &GripSettings,
    count: usize,
    rng: &mut R,
) -> Vec<Isometry3<f32>> {
    let mut poses = Vec::with_capacity(count * settings.oversampling);
    let mut weights = Vec::with_capacity(poses.capacity());
    for _ in 0..count * settings.oversampling {
        let Some(chosen) = sample_by(boxes, |b| b.confidence, rng) else {
            break;
        };
        let Some(pose) = draw(model, observation, chosen, plane, settings, rng) else {
            continue;
        };
        let overlap = match to_camera_bounds(&model.outline, &pose, &observation.intrinsics) {
            Some(bounds) if !chosen.vague => iou(&chosen.bbox, &bounds) as f32,
            Some(_) => 0.5,
            None => continue,
        };
        weights.push((FLOOR + overlap * overlap).ln());
        poses.push(pose);
    }
    gumbel_top(&weights, count, rng).into_iter().map(|i| poses[i]).collect()
}

fn draw<R: Rng>(
    model: &Model,
    observation: &Observation,
    chosen: &BoxPrior,
    plane: Option<&FlatPlane>,
    settings: &GripSettings,
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
            0.5 * (a + b) + CENTRE_SCATTER * (b - a) * normal
        };
        ray.x = (scatter(b[0], b[2]) - k.cx as f32) / k.fx as f32;
        ray.y = (scatter(b[1], b[3]) - k.cy as f32) / k.fy as f32;
    }
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
            let rotation = small_rotation(TILT, rng) * turn * level;
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
    use grip_sim::rng;
    use nalgebra::Matrix3;

    #[test]
    fn rotations_are_uniform() {
        let mut rng = rng::stream(1, "test");
        let n = 20_000;
        let (mut mean, mut square) = (Matrix3::<f64>::zeros(), Matrix3::<f64>::zeros());
        for _ in 0..n {
            let r = uniform_rotation(&mut rng).to_rotation_matrix().matrix().cast::<f64>();
            mean += r / f64::from(n);
            square += r.component_mul(&r) / f64::from(n);
        }
        // Every entry has mean 0 and variance 1/3 under the uniform distribution.
        assert!(mean.abs().max() < 0.02, "{mean}");
        assert!((square.add_scalar(-1.0 / 3.0)).abs().max() < 0.02, "{square}");
    }
}
