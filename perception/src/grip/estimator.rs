//! The estimator `grip`: every object searched, then all looked at together, then colour.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;
use grip_sim::rng;
use rayon::prelude::*;

use super::belief::posterior;
use super::colour::{self, Picture};
use super::joint::{self, Joint, Searched};
use super::places::places;
use super::proposal::box_priors;
use super::search::Search;
use super::settings::GripSettings;
use crate::detector::{Detection, Detections};
use crate::error::{Error, Result};
use crate::estimator::PoseEstimator;
use crate::frame::check_frame;
use crate::hypotheses::HypothesisRenderer;
use crate::model::{Model, ModelCache, stream};
use crate::observation::Observation;
use crate::particles::{closed, nothing};
use crate::posterior::{ColourVerdict, PosePosterior};
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

    fn search(
        &self,
        model: &Model,
        observation: &Observation,
        boxes: &[Detection],
        seed: u64,
        stream: &str,
    ) -> Result<Searched> {
        let start = Instant::now();
        let boxes = box_priors(boxes, observation, &self.settings.proposal);
        let mut rng = rng::stream(seed, stream);
        let mut renderer = self.renderer.session();
        let search = Search::new(model, observation, &boxes, &self.settings, &mut *renderer);
        let found = search.traced(self.traced).run(&mut rng)?;
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
        let GripSettings { search, polish, near_symmetry, joint, .. } = &self.settings;
        let mut counts: Vec<usize> = search.levels.iter().map(|l| l.triangles).collect();
        counts.extend([polish.triangles, near_symmetry.triangles, joint::TRIANGLES]);
        let models = self.models.all(objects, &counts)?;
        let observation = Observation::new(frame, &self.settings.observation, self.workspace.as_ref());
        let stream = |i: usize| stream("grip", &models, i);
        let mut results: Vec<Searched> = (0..models.len())
            .into_par_iter()
            .map(|i| {
                let boxes = detections.of(&models[i].name);
                self.search(&models[i], &observation, boxes, seed, &stream(i))
            })
            .collect::<Result<_>>()?;
        if joint.enabled {
            let search = |i: usize, seen: &Observation| {
                let boxes = detections.of(&models[i].name);
                self.search(&models[i], seen, boxes, seed, &format!("{}/again", stream(i)))
            };
            let (models, observation, settings) = (&models, &observation, &self.settings);
            Joint { models, observation, settings, search }.settle(&mut results, joint)?;
        }
        let picture = if self.settings.colour.enabled { Picture::new(frame) } else { None };
        let picture = picture.as_ref();
        let colours = self.look_at_colours(picture, &models, &observation, detections, &mut results)?;
        let terms = self.explained(&models, &observation, detections, &results)?;
        let beliefs = self.believed(picture, &models, &observation, detections, results, seed)?;
        let explained = colours.into_iter().zip(terms);
        Ok(beliefs
            .into_iter()
            .zip(explained)
            .map(|(belief, (colour, terms))| closed(PosePosterior { colour, terms, ..belief }))
            .collect())
    }
}

impl GripEstimator {
    /// Where else each object may be, and how far off.
    fn believed(
        &self,
        picture: Option<&Picture>,
        models: &[Arc<Model>],
        observation: &Observation,
        detections: &Detections,
        results: Vec<Searched>,
        seed: u64,
    ) -> Result<Vec<PosePosterior>> {
        let believed = |(i, (found, seconds)): (usize, Searched)| {
            let model = &*models[i];
            let Some(found) = found else { return Ok(nothing(model, seconds)) };
            let start = Instant::now();
            let boxes = box_priors(detections.of(&model.name), observation, &self.settings.proposal);
            let mut renderer = self.renderer.session();
            let mut search = Search::new(model, observation, &boxes, &self.settings, &mut *renderer);
            let places = std::iter::once(&found)
                .chain(&found.others)
                .map(|found| places(model, found, observation, picture, &mut search))
                .collect::<Result<Vec<_>>>()?;
            let mut rng = rng::stream(seed, &format!("{}/posterior", stream("grip", models, i)));
            let mut belief = posterior(model, found, &places, seconds, &self.settings, &mut rng);
            belief.seconds += start.elapsed().as_secs_f64();
            Ok(belief)
        };
        results.into_par_iter().enumerate().map(believed).collect()
    }
}

impl GripEstimator {
    /// Lets colour decide between poses that depth cannot tell apart.
    fn look_at_colours(
        &self,
        picture: Option<&Picture>,
        models: &[Arc<Model>],
        observation: &Observation,
        detections: &Detections,
        results: &mut [Searched],
    ) -> Result<Vec<Option<ColourVerdict>>> {
        let settings = &self.settings.colour;
        let decided = |(model, (found, seconds)): (&Arc<Model>, &mut Searched)| {
            let (Some(picture), Some(found)) = (picture, found) else { return Ok(None) };
            let start = Instant::now();
            let boxes = box_priors(detections.of(&model.name), observation, &self.settings.proposal);
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
            let boxes = box_priors(detections.of(&model.name), observation, &self.settings.proposal);
            let mut renderer = self.renderer.session();
            Search::new(model, observation, &boxes, &self.settings, &mut *renderer).terms(&found.best.pose)
        };
        models.par_iter().zip(results).map(terms).collect()
    }
}
