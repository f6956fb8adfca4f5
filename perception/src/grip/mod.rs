//! GRIP's second stage: iterated likelihood weighting over rendered pose hypotheses, on the CPU.
//!
//! Read in this order: [`settings`](GripSettings), `model` (an object, prepared), `propose`, [`crate::hypotheses`] (renders,
//! compares and moves them), `score`, `search` (one object), `joint` (all of them), `colour` (what depth cannot tell).
//!
//! DIFFERENCE to the paper: hypotheses are pulled towards the data by Gauss-Newton steps before they are weighed, weights
//! are tempered, resolution goes from coarse to fine, and independent restarts replace hundreds of iterations. The
//! principle, generate and weigh by rendering, is the same. `paper` is the method without these differences.

mod alike;
mod belief;
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
mod tight_box;
mod trace;
mod turned;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;
use grip_sim::rng;
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
pub(crate) use self::score::parts;

use self::belief::{belief, posterior};
use self::colour::Picture;
use self::joint::{Joint, Searched};
use self::model::ModelCache;
use self::propose::box_priors;
use self::search::{FINAL_TRIANGLES, Search};
use crate::detector::{Detection, Detections, check_frame};
use crate::error::Result;
use crate::estimator::PoseEstimator;
use crate::hypotheses::{HypothesisRenderer, Observation};
use crate::posterior::PosePosterior;

/// Triangles at which the joint step draws, besides those of the levels.
const EXTRA_TRIANGLES: [usize; 2] = [500, FINAL_TRIANGLES];

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
        let boxes = box_priors(boxes, observation, self.settings.anywhere);
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
        let models = self.models.all(objects, &counts)?;
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
        let terms = self.explained(&models, &observation, detections, &results)?;
        Ok(models
            .iter()
            .zip(results)
            .map(|(model, (found, seconds))| posterior(model, found, seconds, &self.settings))
            .zip(colours)
            .zip(terms)
            .map(|((belief, colour), terms)| trace::closed(PosePosterior { colour, terms, ..belief }))
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
            let boxes = box_priors(detections.of(&model.name), observation, self.settings.anywhere);
            let mut renderer = self.renderer.session();
            let mut search = Search::new(model, observation, &boxes, &self.settings, &mut *renderer);
            let verdict = colour::decide(model, found, observation, picture, &mut search, settings);
            *seconds += start.elapsed().as_secs_f64();
            verdict.transpose()
        };
        models.par_iter().zip(results).map(decided).collect()
    }
}

impl GripEstimator {
    /// What the terms of the score give to each best pose.
    fn explained(
        &self,
        models: &[Arc<Model>],
        observation: &Observation,
        detections: &Detections,
        results: &[Searched],
    ) -> Result<Vec<BTreeMap<String, f64>>> {
        let terms = |(model, (found, _)): (&Arc<Model>, &Searched)| {
            let Some(found) = found else { return Ok(BTreeMap::new()) };
            let boxes = box_priors(detections.of(&model.name), observation, self.settings.anywhere);
            let mut renderer = self.renderer.session();
            Search::new(model, observation, &boxes, &self.settings, &mut *renderer).terms(&found.best.pose)
        };
        models.par_iter().zip(results).map(terms).collect()
    }
}

/// The random stream of object `index`: two of the same kind draw from two streams, or they would be the same search.
fn stream(estimator: &str, models: &[Arc<Model>], index: usize) -> String {
    let name = &models[index].name;
    let before = models[..index].iter().filter(|m| m.name == *name).count();
    format!("{estimator}/{name}/{before}")
}
