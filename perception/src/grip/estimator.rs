//! The estimator `grip`: every object searched or followed, then all looked at together, then each with its colours.

use std::sync::Arc;
use std::time::Instant;

use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;
use grip_sim::rng;
use rayon::prelude::*;

use super::belief::posterior;
use super::colour::{self, Picture};
use super::joint::{self, Joint, Searched};
use super::places::{places, places_at};
use super::proposal::{BoxPrior, box_priors};
use super::search::Search;
use super::settings::GripSettings;
use super::track::Prior;
use crate::detector::Detections;
use crate::error::{Error, Result};
use crate::estimator::PoseEstimator;
use crate::frame::check_frame;
use crate::hypotheses::{Hypotheses, HypothesisRenderer};
use crate::model::{Model, ModelCache, stream};
use crate::observation::Observation;
use crate::particles::{closed, nothing};
use crate::posterior::PosePosterior;
use crate::workspace::Workspace;

/// The particle filter over rendered 6-D pose hypotheses.
///
/// Objects are searched independently and in parallel; then those that explain the same pixels as a better one are
/// searched again without these. Prepared models are kept between calls.
#[derive(Debug, Default)]
pub struct GripEstimator {
    settings: GripSettings,
    workspace: Option<Workspace>,
    traced: bool,
    models: ModelCache,
    renderer: HypothesisRenderer,
}

impl GripEstimator {
    /// With these settings, everywhere, on the CPU.
    ///
    /// # Errors
    /// [`Error::Setting`] for a value out of range.
    pub fn new(settings: GripSettings) -> Result<Self> {
        settings.validate().map_err(Error::Setting)?;
        Ok(Self { settings, ..Self::default() })
    }

    /// With hypotheses rendered by `renderer`.
    #[must_use]
    pub fn with_renderer(mut self, renderer: HypothesisRenderer) -> Self {
        self.renderer = renderer;
        self
    }

    /// Of objects in `workspace` alone: no point outside of it is theirs.
    #[must_use]
    pub fn within(mut self, workspace: Workspace) -> Self {
        self.workspace = Some(workspace);
        self
    }

    /// With [`PosePosterior::trace`], for pictures of its convergence.
    #[must_use]
    pub fn traced(mut self) -> Self {
        self.traced = true;
        self
    }

    /// The settings in use.
    pub fn settings(&self) -> &GripSettings {
        &self.settings
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
        self.follow(&vec![None; objects.len()], frame, detections, objects, seed)
    }

    fn follow(
        &self,
        before: &[Option<PosePosterior>],
        frame: &CameraFrame,
        detections: &Detections,
        objects: &[Arc<ObjectModel>],
        seed: u64,
    ) -> Result<Vec<PosePosterior>> {
        check_frame(frame)?;
        let GripSettings { search, polish, near_symmetry, joint, proposal, .. } = &self.settings;
        let mut counts: Vec<usize> = search.levels.iter().map(|l| l.triangles).collect();
        counts.extend([polish.triangles, near_symmetry.triangles, joint::TRIANGLES]);
        let models = self.models.all(objects, &counts)?;
        let observation = Observation::new(frame, &self.settings.observation, self.workspace.as_ref());
        let boxes =
            models.par_iter().map(|model| box_priors(detections.of(&model.name), &observation, proposal));
        let boxes = boxes.collect();
        let picture = if self.settings.colour.enabled { Picture::new(frame) } else { None };
        let look = Look { estimator: self, models, observation, boxes, picture, seed };
        let all = 0..look.models.len();
        let (mut results, mut priors): (Vec<Searched>, Vec<Prior>) = all
            .into_par_iter()
            .map(|i| look.found(i, before.get(i).and_then(Option::as_ref)))
            .collect::<Result<Vec<_>>>()?
            .into_iter()
            .unzip();
        if joint.enabled {
            let search = |i: usize, seen: &Observation| {
                let boxes = box_priors(detections.of(&look.models[i].name), seen, proposal);
                look.searched(i, seen, &boxes, "/again")
            };
            let (models, observation, settings) = (&look.models, &look.observation, &self.settings);
            Joint { models, observation, settings, search }.settle(&mut results, joint)?;
            // What was searched for again is not where it was.
            for (prior, (found, _)) in priors.iter_mut().zip(&results) {
                if found.as_ref().is_none_or(|found| !prior.holds(&found.best.pose)) {
                    prior.enough = false;
                }
            }
        }
        let results = results.into_par_iter().zip(priors).enumerate();
        let before = |i: usize| before.get(i).and_then(Option::as_ref);
        results.map(|(i, (found, prior))| look.believed(i, found, &prior, before(i)).map(closed)).collect()
    }
}

/// A frame, ready to be looked at.
struct Look<'a> {
    estimator: &'a GripEstimator,
    models: Vec<Arc<Model>>,
    observation: Observation,
    /// Of each object.
    boxes: Vec<Vec<BoxPrior>>,
    picture: Option<Picture>,
    seed: u64,
}

impl Look<'_> {
    /// Object number `i` as it is found on its own, and what is known of it from before.
    fn found(&self, i: usize, before: Option<&PosePosterior>) -> Result<(Searched, Prior)> {
        let start = Instant::now();
        let mut prior = Prior::default();
        // Of several instances it is not known which is which.
        let alone = self.estimator.settings.joint.instances < 2;
        if let Some(before) = before.filter(|_| alone) {
            let mut renderer = self.estimator.renderer.session();
            let mut search = self.search(i, &mut *renderer);
            let mut rng = rng::stream(self.seed, &format!("{}/follow", stream("grip", &self.models, i)));
            prior = Prior::new(before, &mut search, &mut rng)?;
            if let Some(first) = prior.modes.first().filter(|_| prior.enough) {
                let population = prior.modes.iter().map(|mode| mode.best).collect();
                let found = search.result(first.best, population);
                return Ok(((Some(found), start.elapsed().as_secs_f64()), prior));
            }
        }
        let (mut found, _) = self.searched(i, &self.observation, &self.boxes[i], "")?;
        if let Some(found) = &mut found {
            prior.added_to(found);
        }
        Ok(((found, start.elapsed().as_secs_f64()), prior))
    }

    /// Object number `i` searched for; `again` sets the random numbers of a second search apart.
    fn searched(
        &self,
        i: usize,
        observation: &Observation,
        boxes: &[BoxPrior],
        again: &str,
    ) -> Result<Searched> {
        let start = Instant::now();
        let mut rng = rng::stream(self.seed, &format!("{}{again}", stream("grip", &self.models, i)));
        let mut renderer = self.estimator.renderer.session();
        let search =
            Search::new(&self.models[i], observation, boxes, &self.estimator.settings, &mut *renderer);
        let found = search.traced(self.estimator.traced).run(&mut rng)?;
        Ok((found, start.elapsed().as_secs_f64()))
    }

    fn search<'a>(&'a self, i: usize, renderer: &'a mut dyn Hypotheses) -> Search<'a> {
        Search::new(&self.models[i], &self.observation, &self.boxes[i], &self.estimator.settings, renderer)
    }

    /// What is believed of object number `i`: lets colour decide between poses that depth cannot tell apart, then asks where else it
    /// may be, and how far off. One that is only followed is where it was, at one of its modes.
    fn believed(
        &self,
        i: usize,
        (found, seconds): Searched,
        prior: &Prior,
        before: Option<&PosePosterior>,
    ) -> Result<PosePosterior> {
        let model = &*self.models[i];
        let Some(mut found) = found else { return Ok(nothing(model, seconds)) };
        let start = Instant::now();
        let Self { observation, estimator: GripEstimator { settings, .. }, .. } = self;
        let picture = self.picture.as_ref();
        let mut renderer = self.estimator.renderer.session();
        let mut search = self.search(i, &mut *renderer);
        let (mut places, colour) = if prior.enough {
            let poses = prior.modes.iter().map(|mode| mode.best);
            // One mode has all the mass, whatever it looks like.
            let picture = picture.filter(|_| prior.modes.len() > 1);
            let places = places_at(model, poses, observation, picture, settings);
            (vec![places], before.and_then(|before| before.colour))
        } else {
            let decide = |picture| {
                colour::decide(model, &mut found, observation, picture, &mut search, &settings.colour)
            };
            let verdict = picture.and_then(decide).transpose()?;
            let places = std::iter::once(&found)
                .chain(&found.others)
                .map(|found| places(model, found, observation, picture, &mut search))
                .collect::<Result<Vec<_>>>()?;
            (places, verdict)
        };
        if let Some(places) = places.first_mut() {
            prior.remembered_by(places, model, &settings.track);
            if let Some(first) = places.first() {
                found.best = first.best;
            }
        }
        let terms = search.terms(&found.best.pose)?;
        let mut rng = rng::stream(self.seed, &format!("{}/posterior", stream("grip", &self.models, i)));
        let seconds = seconds + start.elapsed().as_secs_f64();
        let belief = posterior(model, found, &places, seconds, settings, &mut rng);
        Ok(PosePosterior { colour, terms, followed: prior.frames, ..belief })
    }
}
