//! GRIP's second stage: iterated likelihood weighting over rendered pose hypotheses, on the CPU.
//!
//! Read in this order: [`settings`](GripSettings), `model` (an object, prepared), `propose`, [`crate::hypotheses`] (renders,
//! compares and moves them), `score`, `search` (one object), `joint` (all of them), `colour` (what depth cannot tell).
//!
//! DIFFERENCE to the paper: hypotheses are pulled towards the data by Gauss-Newton steps before they are weighed, weights
//! are tempered, resolution goes from coarse to fine, and independent restarts replace hundreds of iterations. The
//! principle, generate and weigh by rendering, is the same. `paper` is the method without these differences.

mod colour;
mod joint;
mod model;
mod paper;
mod propose;
mod resample;
mod resting;
mod score;
mod search;
mod settings;
mod solid;
mod trace;

use std::sync::Arc;
use std::time::Instant;

use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;
use grip_sim::pose::Pose;
use grip_sim::rng;
use nalgebra::{Isometry3, Vector3};
use rayon::prelude::*;

pub use self::colour::{ColourSettings, ColourVerdict};
pub use self::joint::JointSettings;
pub use self::paper::{Centre, Holes, PaperEstimator, PaperSettings, Ranking};
pub use self::settings::{GripSettings, SearchLevel};

pub(crate) use self::model::Model;
#[cfg(feature = "bench")]
pub(crate) use self::paper::Prepared;
#[cfg(feature = "bench")]
pub(crate) use self::propose::small_rotation;
#[cfg(test)]
pub(crate) use self::score::score;

use self::colour::Picture;
use self::joint::{Joint, Searched};
use self::model::{ModelCache, directions};
use self::propose::box_priors;
use self::search::{FINAL_TRIANGLES, Found, Hypothesis, Search, reach};
use crate::detector::{Detection, Detections, check_frame};
use crate::error::Result;
use crate::estimator::PoseEstimator;
use crate::hypotheses::{HypothesisRenderer, Observation};
use crate::posterior::PosePosterior;

/// Triangles at which the joint step draws, besides those of the levels.
const EXTRA_TRIANGLES: [usize; 2] = [500, FINAL_TRIANGLES];
/// Directions in which the spread of orientation is taken.
const SPREAD_DIRECTIONS: usize = 64;

/// The particle filter over rendered 6-D pose hypotheses.
///
/// Objects are searched independently and in parallel; then those that explain the same pixels as a better one are
/// searched again without these. Prepared models are kept between calls.
#[derive(Debug, Default)]
pub struct GripEstimator {
    settings: GripSettings,
    models: ModelCache,
    renderer: HypothesisRenderer,
}

impl GripEstimator {
    /// With these settings, on the CPU.
    ///
    /// # Errors
    /// [`crate::Error::Setting`] for a value out of range.
    pub fn new(settings: GripSettings) -> Result<Self> {
        settings.check()?;
        Ok(Self { settings, ..Self::default() })
    }

    /// With hypotheses rendered by `renderer`.
    #[must_use]
    pub fn with_renderer(mut self, renderer: HypothesisRenderer) -> Self {
        self.renderer = renderer;
        self
    }

    /// The settings in use.
    pub fn settings(&self) -> &GripSettings {
        &self.settings
    }

    fn search(
        &self,
        model: &Model,
        observation: &Observation,
        boxes: &[Detection],
        seed: u64,
        stream: &str,
    ) -> Result<Searched> {
        let start = Instant::now();
        let boxes = box_priors(boxes, observation);
        let mut rng = rng::stream(seed, stream);
        let mut renderer = self.renderer.session();
        let found = Search::new(model, observation, &boxes, &self.settings, &mut *renderer).run(&mut rng)?;
        Ok((found, start.elapsed().as_secs_f64()))
    }
}

impl PoseEstimator for GripEstimator {
    fn name(&self) -> &'static str {
        "grip"
    }

    fn estimate(
        &self,
        frame: &CameraFrame,
        detections: &Detections,
        objects: &[Arc<ObjectModel>],
        seed: u64,
    ) -> Result<Vec<PosePosterior>> {
        check_frame(frame)?;
        let mut counts: Vec<usize> = self.settings.levels.iter().map(|l| l.triangles).collect();
        counts.extend(EXTRA_TRIANGLES);
        let models: Vec<Arc<Model>> =
            objects.par_iter().map(|object| self.models.get(object, &counts)).collect::<Result<_>>()?;
        let observation = Observation::new(frame, &self.settings);
        let stream = |i: usize| stream("grip", &models, i);
        let mut results: Vec<Searched> = (0..models.len())
            .into_par_iter()
            .map(|i| {
                let boxes = detections.of(&models[i].name);
                self.search(&models[i], &observation, boxes, seed, &stream(i))
            })
            .collect::<Result<_>>()?;
        if let Some(joint) = &self.settings.joint {
            let search = |i: usize, seen: &Observation| {
                let boxes = detections.of(&models[i].name);
                self.search(&models[i], seen, boxes, seed, &format!("{}/again", stream(i)))
            };
            let (models, observation, settings) = (&models, &observation, &self.settings);
            Joint { models, observation, settings, search }.settle(&mut results, joint)?;
        }
        let colours = self.look_at_colours(frame, &models, &observation, detections, &mut results)?;
        Ok(models
            .iter()
            .zip(results)
            .map(|(model, (found, seconds))| posterior(model, found, seconds, &self.settings))
            .zip(colours)
            .map(|(belief, colour)| trace::closed(PosePosterior { colour, ..belief }))
            .collect())
    }
}

impl GripEstimator {
    /// Lets colour decide between poses that depth cannot tell apart.
    fn look_at_colours(
        &self,
        frame: &CameraFrame,
        models: &[Arc<Model>],
        observation: &Observation,
        detections: &Detections,
        results: &mut [Searched],
    ) -> Result<Vec<Option<ColourVerdict>>> {
        let picture =
            self.settings.colour.as_ref().and_then(|settings| Some((settings, Picture::new(frame)?)));
        let decided = |(model, (found, seconds)): (&Arc<Model>, &mut Searched)| {
            let (Some((settings, picture)), Some(found)) = (&picture, found) else { return Ok(None) };
            let start = Instant::now();
            let boxes = box_priors(detections.of(&model.name), observation);
            let mut renderer = self.renderer.session();
            let mut search = Search::new(model, observation, &boxes, &self.settings, &mut *renderer);
            let verdict = colour::decide(model, found, observation, picture, &mut search, settings);
            *seconds += start.elapsed().as_secs_f64();
            verdict.transpose()
        };
        models.par_iter().zip(results).map(decided).collect()
    }
}

/// The random stream of object `index`: two of the same kind draw from two streams, or they would be the same search.
fn stream(estimator: &str, models: &[Arc<Model>], index: usize) -> String {
    let name = &models[index].name;
    let before = models[..index].iter().filter(|m| m.name == *name).count();
    format!("{estimator}/{name}/{before}")
}

/// Weights and confidence of what a search found.
fn posterior(model: &Model, found: Option<Found>, seconds: f64, settings: &GripSettings) -> PosePosterior {
    let score = found.as_ref().map_or(0.0, |found| f64::from(found.best.score));
    let presence = 1.0 / (1.0 + (-(score - settings.presence_score) / settings.presence_scale).exp());
    // One restart that nobody confirms is worth half, unless it is sure.
    let confirmed = found.as_ref().is_some_and(|found| {
        found.agreeing >= 2 || settings.max_restarts == 1 || found.best.score >= settings.sure_score
    });
    let confidence = if confirmed { presence } else { 0.5 * presence };
    let weights = found
        .as_ref()
        .map_or_else(Vec::new, |found| weights(&found.population, settings.posterior_temperature));
    belief(model, found, weights, confidence, seconds)
}

/// What is believed after a search; `weights` are those of the population.
fn belief(
    model: &Model,
    found: Option<Found>,
    weights: Vec<f64>,
    confidence: f64,
    seconds: f64,
) -> PosePosterior {
    let Some(found) = found else {
        // No hypothesis could be drawn, so nothing is known: a point at the camera with no confidence.
        return PosePosterior {
            object: model.name.clone(),
            best: Pose::identity(),
            particles: vec![(Pose::identity(), 1.0)],
            score: 0.0,
            confidence: 0.0,
            position_std_m: f64::INFINITY,
            rotation_std_rad: f64::INFINITY,
            restarts: 0,
            hypotheses: 0,
            seconds,
            colour: None,
            trace: Vec::new(),
        };
    };
    let (position_std_m, rotation_std_rad) = spread(model, &found, &weights);
    let typed = |h: &Hypothesis| Pose::new(widened(&h.pose));
    PosePosterior {
        object: model.name.clone(),
        best: typed(&found.best),
        particles: found.population.iter().map(typed).zip(weights).collect(),
        score: f64::from(found.best.score),
        confidence,
        position_std_m,
        rotation_std_rad,
        restarts: found.restarts,
        hypotheses: found.hypotheses,
        seconds,
        colour: None,
        trace: found.trace,
    }
}

fn weights(population: &[Hypothesis], temperature: f64) -> Vec<f64> {
    let best = population.iter().map(|h| h.score).fold(f32::MIN, f32::max);
    let raw: Vec<f64> = population.iter().map(|h| (f64::from(h.score - best) / temperature).exp()).collect();
    let sum: f64 = raw.iter().sum();
    raw.iter().map(|w| w / sum).collect()
}

fn spread(model: &Model, found: &Found, weights: &[f64]) -> (f64, f64) {
    let positions = || found.population.iter().map(|h| h.pose.translation.vector.cast::<f64>());
    let mean = positions().zip(weights).fold(Vector3::zeros(), |m, (p, w)| m + p * *w);
    let variance: f64 = positions().zip(weights).map(|(p, w)| w * (p - mean).norm_squared()).sum();
    let only_turned =
        |pose: &Isometry3<f32>| Isometry3::from_parts(nalgebra::Translation3::identity(), pose.rotation);
    let reference = only_turned(&found.best.pose);
    let base: Vec<f32> = directions(SPREAD_DIRECTIONS).map(|d| reach(&model.hull, &reference, &d)).collect();
    let mut change = 0.0;
    for (h, w) in found.population.iter().zip(weights) {
        let turned = only_turned(&h.pose);
        let sum: f32 = directions(SPREAD_DIRECTIONS)
            .zip(&base)
            .map(|(d, b)| (reach(&model.hull, &turned, &d) - b).powi(2))
            .sum();
        change += w * f64::from(sum) / SPREAD_DIRECTIONS as f64;
    }
    (variance.sqrt(), change.sqrt() / f64::from(model.radius))
}

fn widened(pose: &Isometry3<f32>) -> Isometry3<f64> {
    let q = nalgebra::UnitQuaternion::from_quaternion(pose.rotation.into_inner().cast());
    Isometry3::from_parts(pose.translation.vector.cast::<f64>().into(), q)
}
