//! GRIP's second stage as published (Chen et al. 2019, sections METHOD and EXPERIMENTS, Implementation): iterated likelihood
//! weighting with hard inliers, edge and planar features and diffusion that shrinks with the best weight.
//!
//! It is here for comparison: what the text leaves open, and the guards that it leaves out, are named in
//! [`PaperSettings`]. Each object is searched on its own, as in the paper.

mod features;
mod settings;
#[cfg(test)]
mod tests;
mod weight;

use std::sync::Arc;
use std::time::Instant;

use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;
use grip_sim::rng;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal, UnitSphere};
use rayon::prelude::*;

pub use self::settings::{Centre, Decay, Diffusion, FeatureMatch, Holes, PaperSettings, Ranking, Start};

use self::weight::{Likelihood, Scratch};
use crate::detector::{Detection, Detections};
use crate::error::{Error, Result};
use crate::estimator::PoseEstimator;
use crate::frame::{check_frame, is_reading};
use crate::model::{Model, ModelCache, stream};
use crate::observation::{Observation, ObservationSettings, Stride};
use crate::particles::{ScoredPose, SearchResult, Trace, nothing, summarized};
use crate::posterior::PosePosterior;
use crate::sampling::{sample_by, small_rotation, uniform_rotation};

/// The particle filter of the paper.
#[derive(Debug, Default)]
pub struct PaperEstimator {
    settings: PaperSettings,
    traced: bool,
    models: ModelCache,
}

impl PaperEstimator {
    /// With these settings.
    ///
    /// # Errors
    /// [`Error::Setting`] for a value out of range.
    pub fn new(settings: PaperSettings) -> Result<Self> {
        settings.validate().map_err(Error::Setting)?;
        Ok(Self { settings, ..Self::default() })
    }

    /// With [`PosePosterior::trace`], for pictures of its convergence.
    #[must_use]
    pub fn traced(mut self) -> Self {
        self.traced = true;
        self
    }
}

impl PoseEstimator for PaperEstimator {
    fn name(&self) -> &'static str {
        "paper"
    }

    fn estimate(
        &self,
        frame: &CameraFrame,
        detections: &Detections,
        objects: &[Arc<ObjectModel>],
        seed: u64,
    ) -> Result<Vec<PosePosterior>> {
        check_frame(frame)?;
        let settings = &self.settings;
        let models = self.models.all(objects, &[settings.triangles])?;
        let prepared = Prepared::new(settings, frame);
        Ok((0..models.len())
            .into_par_iter()
            .map(|i| {
                let start = Instant::now();
                let model = &models[i];
                let boxes = boxes(detections.of(&model.name), frame);
                let likelihood = prepared.likelihood(model, &boxes);
                let mut rng = rng::stream(seed, &stream("paper", &models, i));
                let found = filter(&likelihood, frame, Trace::new(self.traced), &mut rng);
                let Some(found) = found else { return nothing(model, start.elapsed().as_secs_f64()) };
                // All weights 0: nothing is known, all are equal.
                let sum: f64 = found.population.iter().map(|h| f64::from(h.score)).sum();
                let even = 1.0 / found.population.len() as f64;
                let share = |h: &ScoredPose| if sum > 0.0 { f64::from(h.score) / sum } else { even };
                let weights = found.population.iter().map(share).collect();
                // The paper tells objects that are there by the weight of the best pose.
                let confidence = f64::from(found.best.score).clamp(0.0, 1.0);
                summarized(model, found, weights, confidence, start.elapsed().as_secs_f64())
            })
            .collect())
    }
}

/// A frame with its features.
#[derive(Debug)]
pub(crate) struct Prepared<'a> {
    settings: &'a PaperSettings,
    observation: Observation,
    /// Kinds of pixels at the stride of the settings.
    features: Vec<u8>,
}

impl<'a> Prepared<'a> {
    /// Prepares a frame.
    pub fn new(settings: &'a PaperSettings, frame: &CameraFrame) -> Self {
        let prepared = ObservationSettings {
            epsilon_m: settings.epsilon_m,
            support: settings.support.clone(),
            ..ObservationSettings::default()
        };
        let observation = Observation::new(frame, &prepared, None);
        let features = features::observed(observation.level(settings.stride), settings);
        Self { settings, observation, features }
    }

    fn likelihood<'b>(&'b self, model: &'b Model, boxes: &'b [Detection]) -> Likelihood<'b> {
        Likelihood {
            settings: self.settings,
            observation: &self.observation,
            features: &self.features,
            lod: model.lod(self.settings.triangles),
            boxes,
        }
    }

    /// The largest W of poses with a box, weighed in parallel as in an iteration.
    #[cfg(feature = "bench")]
    pub fn iteration(&self, model: &Model, boxes: &[Detection], poses: &[Isometry3<f32>]) -> f32 {
        let likelihood = self.likelihood(model, boxes);
        let weigh = |scratch: &mut Scratch, pose| likelihood.weigh(scratch, pose, 0).total(self.settings);
        poses.par_iter().map_init(Scratch::default, weigh).reduce(|| 0.0, f32::max)
    }
}

/// The boxes of an object; without any, the whole image.
fn boxes(detections: &[Detection], frame: &CameraFrame) -> Vec<Detection> {
    let k = &frame.intrinsics;
    if detections.is_empty() {
        let bbox = [0.0, 0.0, k.width as f64 - 1.0, k.height as f64 - 1.0];
        return vec![Detection { bbox, confidence: 1.0 }];
    }
    detections.iter().map(|d| Detection { bbox: d.bbox, confidence: d.confidence }).collect()
}

/// A pose, its box and its weight.
#[derive(Debug, Clone, Copy)]
struct Sample {
    pose: Isometry3<f32>,
    index: usize,
    weight: f32,
}

/// Iterated likelihood weighting; `None` when no box holds a reading.
fn filter(
    likelihood: &Likelihood<'_>,
    frame: &CameraFrame,
    mut trace: Trace,
    rng: &mut impl Rng,
) -> Option<SearchResult> {
    let settings = likelihood.settings;
    let spaces: Vec<Option<Space>> =
        likelihood.boxes.iter().map(|b| likelihood.space(&b.bbox, frame)).collect();
    let confidence = |i: &usize| if spaces[*i].is_some() { likelihood.boxes[*i].confidence } else { 0.0 };
    let indices: Vec<usize> = (0..spaces.len()).collect();
    let mut samples: Vec<Sample> = (0..settings.samples)
        .map_while(|_| {
            let &index = sample_by(&indices, confidence, rng)?;
            let position = spaces[index].as_ref()?.draw(frame, rng);
            let pose = Isometry3::from_parts(position.cast::<f32>().coords.into(), uniform_rotation(rng));
            Some(Sample { pose, index, weight: 0.0 })
        })
        .collect();
    let mut hypotheses = 0;
    // The largest weight so far.
    let mut running = 0.0_f32;
    for iteration in 0..settings.iterations {
        if iteration > 0 {
            let best = match settings.decay_by {
                Decay::Current => samples[0].weight,
                Decay::Running => running,
            };
            let lambda = decay(best, settings);
            samples = resampled(&samples, lambda, settings, likelihood.boxes.len(), rng);
        }
        samples.par_iter_mut().for_each_init(Scratch::default, |scratch, sample| {
            sample.weight = likelihood.weigh(scratch, &sample.pose, sample.index).total(settings);
        });
        hypotheses += samples.len();
        // Best first; equal ones stay in order.
        samples.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        trace.iteration(hypotheses, samples.first().map(|best| &best.pose));
        running = running.max(samples.first()?.weight);
        if samples.first()?.weight >= settings.converged {
            break;
        }
    }
    let population: Vec<ScoredPose> =
        samples.iter().map(|s| ScoredPose { pose: s.pose, score: s.weight }).collect();
    Some(SearchResult {
        best: *population.first()?,
        population,
        others: Vec::new(),
        restarts: 1,
        agreeing: 1,
        hypotheses,
        box_confidence: 1.0,
        trace: trace.take(),
    })
}

/// Where samples of a box begin.
#[derive(Debug, PartialEq)]
enum Space {
    /// Anywhere that projects into the box between the nearest and the farthest reading in it, metres.
    Frustum { bbox: [f64; 4], near: f64, far: f64 },
    /// At these readings, camera frame.
    Readings(Vec<Point3<f64>>),
}

impl Likelihood<'_> {
    /// `None` for a box without readings.
    fn space(&self, bbox: &[f64; 4], frame: &CameraFrame) -> Option<Space> {
        let level = self.observation.level(Stride::One);
        // What lies on the support is no object's.
        let with_plane = self.observation.plane().is_some();
        let own = |u: usize, v: usize| !with_plane || level.weight[level.index(u as i32, v as i32)] > 0.5;
        match self.settings.start {
            Start::Frustum => Space::frustum(bbox, frame),
            // Where all is support, anywhere.
            Start::Readings => Space::readings(bbox, frame, own).or_else(|| Space::frustum(bbox, frame)),
        }
    }
}

/// The readings in a box: pixel and metres along the optical axis.
fn readings<'a>(
    &[u0, v0, u1, v1]: &[f64; 4],
    frame: &'a CameraFrame,
) -> impl Iterator<Item = ([usize; 2], f64)> + use<'a> {
    let k = &frame.intrinsics;
    let range = |low: f64, high: f64, size: usize| {
        low.ceil().max(0.0) as usize..((high.floor().max(-1.0) + 1.0) as usize).min(size)
    };
    let columns = range(u0, u1, k.width);
    let pixels = range(v0, v1, k.height).flat_map(move |v| columns.clone().map(move |u| [u, v]));
    let reading = |[u, v]: [usize; 2]| ([u, v], *frame.depth.at(u, v));
    pixels.map(reading).filter(|(_, z)| is_reading(*z)).map(|(at, z)| (at, f64::from(z)))
}

impl Space {
    fn frustum(bbox: &[f64; 4], frame: &CameraFrame) -> Option<Self> {
        let (near, far) =
            readings(bbox, frame).fold((f64::MAX, 0.0_f64), |(near, far), (_, z)| (near.min(z), far.max(z)));
        (far > 0.0).then_some(Self::Frustum { bbox: *bbox, near, far })
    }

    /// Those of the readings that are `own`.
    fn readings(bbox: &[f64; 4], frame: &CameraFrame, own: impl Fn(usize, usize) -> bool) -> Option<Self> {
        let points: Vec<Point3<f64>> = readings(bbox, frame)
            .filter(|([u, v], _)| own(*u, *v))
            .map(|([u, v], z)| frame.intrinsics.back_project(u as f64, v as f64, z))
            .collect();
        (!points.is_empty()).then_some(Self::Readings(points))
    }

    fn draw(&self, frame: &CameraFrame, rng: &mut impl Rng) -> Point3<f64> {
        match self {
            Self::Readings(points) => points[rng.random_range(0..points.len())],
            Self::Frustum { bbox, near, far } => {
                let mut between = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
                let (u, v) = (between(bbox[0], bbox[2]), between(bbox[1], bbox[3]));
                let z = between(near.powi(3), far.powi(3)).cbrt();
                frame.intrinsics.back_project(u, v, z)
            }
        }
    }
}

/// The factor of the diffusion (lambda_t) at the weight of the best sample.
fn decay(best: f32, settings: &PaperSettings) -> f32 {
    let share = (1.0 - best) / (1.0 - settings.decay_from);
    share.clamp(0.0, 1.0).powi(settings.decay_exponent)
}

/// Draws with replacement by weight, and diffuses; `samples` are sorted, best first.
fn resampled(
    samples: &[Sample],
    lambda: f32,
    settings: &PaperSettings,
    boxes: usize,
    rng: &mut impl Rng,
) -> Vec<Sample> {
    let best = samples[0];
    let (shift, turn) = (lambda * settings.sigma_m, lambda * settings.sigma_rad);
    let mut cumulative = Vec::with_capacity(samples.len());
    let mut sum = 0.0_f64;
    for sample in samples {
        sum += f64::from(sample.weight.max(0.0)).powf(f64::from(settings.resampling_exponent));
        cumulative.push(sum);
    }
    (0..samples.len())
        .map(|i| {
            if i == 0 && settings.keep_best {
                return best;
            }
            // All weights 0: all are equal.
            let drawn = if sum > 0.0 {
                let mark = rng.random::<f64>() * sum;
                cumulative.partition_point(|&c| c <= mark).min(samples.len() - 1)
            } else {
                rng.random_range(0..samples.len())
            };
            let Sample { pose, mut index, .. } = samples[drawn];
            let (offset, rotation) = match settings.diffusion {
                Diffusion::Axes => (gaussian(rng) * shift, small_rotation(turn, rng)),
                Diffusion::Length => {
                    let mut step = |sigma: f32| {
                        let length: f32 = StandardNormal.sample(rng);
                        let direction: [f32; 3] = UnitSphere.sample(rng);
                        Vector3::from(direction) * (length * sigma)
                    };
                    (step(shift), UnitQuaternion::from_scaled_axis(step(turn)))
                }
            };
            let rotation = rotation * pose.rotation;
            if rng.random::<f64>() < settings.box_jump {
                index = rng.random_range(0..boxes);
            }
            let moved = Isometry3::from_parts(Translation3::from(pose.translation.vector + offset), rotation);
            Sample { pose: moved, index, weight: 0.0 }
        })
        .collect()
}

/// A vector of standard normals.
fn gaussian(rng: &mut impl Rng) -> Vector3<f32> {
    let mut normal = || -> f32 { StandardNormal.sample(rng) };
    Vector3::new(normal(), normal(), normal())
}
