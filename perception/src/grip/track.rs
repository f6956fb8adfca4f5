//! From frame to frame: the last posterior is the prior of the next one.
//!
//! The process model is the simplest there is: an object stays about where the camera saw it. Each mode is carried on by itself, pulled
//! to where it fits the new frame; what its mass was is remembered beside what the new frame says. A search is made only of
//! what was not sure, of what no longer fits, and of each object from time to time.

use nalgebra::{Isometry3, Vector3};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::places::{Place, same};
use super::search::Search;
use super::settings::TrackSettings;
use crate::error::Result;
use crate::hypotheses::Batch;
use crate::model::Model;
use crate::particles::{ScoredPose, SearchResult};
use crate::posterior::{Mode, PosePosterior};
use crate::sampling::small_rotation;

/// Another place becomes the answer when it has so many times the mass.
const SURER: f64 = 2.0;
/// Mass of a place that was none in the frame before.
const LEAST: f64 = 1e-6;

/// A mode of the frame before, in this one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Followed {
    /// Where it fits.
    pub best: ScoredPose,
    /// Its share of the masses of all modes, in the frame before.
    pub mass: f64,
}

/// What is known of an object from the frames before.
#[derive(Debug, Clone, Default)]
pub(super) struct Prior {
    /// That of the best pose first; none of what was not sure.
    pub modes: Vec<Followed>,
    /// Frames in which it was believed to be there, one after the other, before this one.
    pub frames: usize,
    /// Whether it is not searched for.
    pub enough: bool,
}

impl Prior {
    /// What `before` says of the frame of `search`.
    pub fn new(before: &PosePosterior, search: &mut Search<'_>, rng: &mut impl Rng) -> Result<Self> {
        let settings = &search.settings().track;
        if before.confidence < settings.least_confidence {
            return Ok(Self::default());
        }
        let modes = followed(before, search, rng)?;
        let keeps = modes
            .first()
            .is_some_and(|first| f64::from(first.best.score) >= before.score - settings.most_drop);
        let frames = before.followed + 1;
        Ok(Self { modes, frames, enough: keeps && !frames.is_multiple_of(settings.search_again) })
    }

    /// Whether a pose is that of one of its modes.
    pub fn holds(&self, pose: &Isometry3<f32>) -> bool {
        self.modes.iter().any(|mode| mode.best.pose == *pose)
    }

    /// What a search found, and beside it where the object was believed to be.
    pub fn added_to(&self, found: &mut SearchResult) {
        for mode in &self.modes {
            if mode.best.score > found.best.score {
                found.best = mode.best;
            }
            found.population.push(mode.best);
        }
        found.population.sort_by(|a, b| b.score.total_cmp(&a.score));
    }

    /// The places' masses by this frame and by those before; then the place that has most is the first.
    pub fn remembered_by(&self, places: &mut [Place], model: &Model, settings: &TrackSettings) {
        if self.modes.is_empty() || places.is_empty() {
            return;
        }
        let memory = 1.0 - 1.0 / (self.frames + 1).min(settings.memory) as f64;
        for place in &mut *places {
            let known = self.modes.iter().filter(|mode| same(model, &mode.best.pose, &place.best.pose));
            let before = known.map(|mode| mode.mass).sum::<f64>().max(LEAST);
            place.mass = (memory * before.ln() + (1.0 - memory) * place.mass.max(LEAST).ln()).exp();
        }
        let sum: f64 = places.iter().map(|place| place.mass).sum();
        places.iter_mut().for_each(|place| place.mass /= sum);
        // Where two are about as likely the answer does not go back and forth between them.
        let first = places[0].mass * SURER;
        let surer = places.iter().enumerate().filter(|(_, place)| place.mass > first);
        if let Some((most, _)) = surer.max_by(|a, b| a.1.mass.total_cmp(&b.1.mass)) {
            places[..=most].rotate_right(1);
        }
    }
}

/// The modes of `before` that have some mass, where they fit now, each found among hypotheses about where it was.
fn followed(before: &PosePosterior, search: &mut Search<'_>, rng: &mut impl Rng) -> Result<Vec<Followed>> {
    let (model, settings) = (search.model(), search.settings());
    // Beside the first no mode has the best pose but the wide one, which is nowhere.
    let placed = |i: usize, mode: &Mode| i == 0 || mode.pose != before.best;
    let kept: Vec<&Mode> = before
        .modes
        .iter()
        .enumerate()
        .filter(|(i, mode)| placed(*i, mode) && mode.mass >= settings.track.least_mass)
        .map(|(_, mode)| mode)
        .collect();
    let sum: f64 = kept.iter().map(|mode| mode.mass).sum();
    let mut modes: Vec<Followed> = Vec::new();
    // How the object has moved, by the mode that fits best so far.
    let mut motion: Option<(f32, Isometry3<f32>)> = None;
    for mode in kept {
        let old: Isometry3<f32> = mode.pose.iso().cast();
        let starts = std::iter::once(old).chain(motion.map(|(_, motion)| motion * old));
        let pose = search.about(starts.collect(), rng)?;
        let best = search.polished(vec![pose])?[0];
        if motion.is_none_or(|(score, _)| best.score > score) {
            motion = Some((best.score, best.pose * old.inverse()));
        }
        let mass = mode.mass / sum;
        match modes.iter_mut().find(|mode| same(model, &mode.best.pose, &best.pose)) {
            Some(known) => known.mass += mass,
            None => modes.push(Followed { best, mass }),
        }
    }
    Ok(modes)
}

impl Search<'_> {
    /// The best of hypotheses about the last of `poses`, and these, moved and weighed as in the levels of a search after the first.
    fn about(&mut self, mut poses: Vec<Isometry3<f32>>, rng: &mut impl Rng) -> Result<Isometry3<f32>> {
        let (model, settings) = (self.model(), self.settings());
        let TrackSettings { samples, motion_m, motion_rad, .. } = settings.track;
        let about = poses[poses.len() - 1];
        poses.resize_with(samples.max(poses.len()), || {
            let by = Vector3::from_fn(|_, _| StandardNormal.sample(rng)) * motion_m;
            let turn = small_rotation(motion_rad, rng);
            Isometry3::from_parts((about.translation.vector + by).into(), turn * about.rotation)
        });
        for level in settings.search.levels.iter().skip(1) {
            let batch = Batch {
                lod: model.lod(level.triangles),
                stride: self.stride(level),
                kernel: level.kernel,
                steps: level.steps,
                ..self.full_batch()
            };
            let scores = self.weigh(&batch, &mut poses)?;
            let mut order: Vec<usize> = (0..poses.len()).collect();
            order.sort_by(|&a, &b| scores[b].total_cmp(&scores[a]));
            order.truncate(poses.len().div_ceil(2));
            poses = order.into_iter().map(|i| poses[i]).collect();
        }
        Ok(poses[0])
    }
}
