//! The search for one object: levels of generate, move and weigh, restarted until two searches agree.

use std::collections::BTreeMap;

use grip_sim::camera::Intrinsics;
use nalgebra::{Isometry3, Translation3, Vector3};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::proposal::{BoxPrior, propose};
use super::score::{Parts, parts};
use super::settings::{GripSettings, SearchLevel};
use crate::detector::iou;
use crate::error::Result;
use crate::hull::{directions, reach};
use crate::hypotheses::{Batch, Extent, Hypotheses, Rendered};
use crate::model::Model;
use crate::observation::{FlatPlane, Observation, Stride};
use crate::particles::{ScoredPose, SearchResult, Trace};
use crate::sampling::{gumbel_top, small_rotation, systematic, temperature};

/// Directions in which two hulls are compared.
const HULL_CHECKS: usize = 64;

/// Everything that weighing a hypothesis needs.
pub(crate) struct Search<'a> {
    model: &'a Model,
    observation: &'a Observation,
    boxes: &'a [BoxPrior],
    /// What objects stand on, the lowest first.
    planes: Vec<FlatPlane>,
    settings: &'a GripSettings,
    renderer: &'a mut dyn Hypotheses,
    rendered: usize,
    trace: Trace,
    /// Pixels across the object, about.
    side_px: f32,
}

/// The distance of an object is about the median depth in the most confident boxes, which together have this share of the
/// proposals that are drawn from boxes.
const DEPTH_SHARE: f64 = 0.9;

impl<'a> Search<'a> {
    /// Ready to weigh hypotheses of `model`.
    pub fn new(
        model: &'a Model,
        observation: &'a Observation,
        boxes: &'a [BoxPrior],
        settings: &'a GripSettings,
        renderer: &'a mut dyn Hypotheses,
    ) -> Self {
        let planes = observation.flat_planes();
        let precise = || boxes.iter().filter(|b| !b.vague);
        let mut rest = DEPTH_SHARE * precise().map(|b| b.share).sum::<f64>();
        let mut depths: Vec<f32> = Vec::new();
        for b in precise() {
            depths.extend(b.depths());
            rest -= b.share;
            if rest <= 0.0 {
                break;
            }
        }
        if depths.is_empty() {
            depths = boxes.iter().flat_map(BoxPrior::depths).collect();
        }
        let middle = depths.len() / 2;
        let depth =
            if depths.is_empty() { 1.0 } else { *depths.select_nth_unstable_by(middle, f32::total_cmp).1 };
        let side_px = 2.0 * model.radius * observation.intrinsics.fx as f32 / depth;
        Self {
            model,
            observation,
            boxes,
            planes,
            settings,
            renderer,
            rendered: 0,
            trace: Trace::new(false),
            side_px,
        }
    }

    /// Takes down what is believed after each iteration.
    pub fn traced(mut self, on: bool) -> Self {
        self.trace = Trace::new(on);
        self
    }

    /// The stride of a level for this object.
    pub fn stride(&self, level: &SearchLevel) -> Stride {
        let mut stride = level.stride;
        while let Some(finer) = stride.finer()
            && self.side_px / (stride.pixels() as f32) < self.settings.search.least_side_px
        {
            stride = finer;
        }
        stride
    }

    /// Restarts until one is sure, or the best score was reached twice at the same place.
    pub fn run<R: Rng>(&mut self, rng: &mut R) -> Result<Option<SearchResult>> {
        let mut ends: Vec<ScoredPose> = Vec::new();
        let mut population = Vec::new();
        let mut best: Option<ScoredPose> = None;
        for _ in 0..self.settings.restarts.most {
            let candidates = self.descend(rng)?;
            let Some(end) = candidates.first().copied() else {
                continue;
            };
            population.extend(candidates);
            let agreed = best.is_some_and(|b| self.same(&end, &b));
            if best.is_none_or(|b| end.score > b.score) {
                best = Some(end);
                self.trace.answer(self.rendered, &end.pose);
            } else {
                self.trace.iteration(self.rendered, None);
            }
            ends.push(end);
            let hopeless = ends.len() >= self.settings.restarts.hopeless_after
                && best.is_none_or(|b| b.score < self.settings.restarts.hopeless_score);
            if agreed || hopeless || end.score >= self.settings.restarts.sure_score {
                break;
            }
        }
        let Some(found) = best else { return Ok(None) };
        let agreeing = ends.iter().filter(|e| self.same(e, &found)).count();
        let best = self.best_of_near_symmetric(found, &mut population)?;
        if self.settings.near_symmetry.enabled {
            self.trace.answer(self.rendered, &best.pose);
        }
        population.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(Some(SearchResult { restarts: ends.len(), agreeing, ..self.result(best, population) }))
    }

    /// `best` and `population` as found by one search that is sure.
    pub fn result(&mut self, best: ScoredPose, population: Vec<ScoredPose>) -> SearchResult {
        SearchResult {
            best,
            population,
            others: Vec::new(),
            restarts: 1,
            agreeing: 2,
            hypotheses: self.rendered,
            box_confidence: self.boxes.iter().filter(|b| !b.vague).map(|b| b.confidence).fold(0.0, f64::max),
            trace: self.trace.take(),
        }
    }

    /// One pass through the levels and the polish; the survivors, best first.
    fn descend<R: Rng>(&mut self, rng: &mut R) -> Result<Vec<ScoredPose>> {
        let settings = self.settings;
        let mut population: Vec<ScoredPose> = Vec::new();
        for (depth, level) in settings.search.levels.iter().enumerate() {
            if depth == 0 {
                population = propose(
                    self.model,
                    self.observation,
                    self.boxes,
                    &self.planes,
                    &settings.proposal,
                    level.samples,
                    rng,
                )
                .into_iter()
                .map(|pose| ScoredPose { pose, score: 0.0 })
                .collect();
            } else {
                population = thin_out(&population, level.samples, settings.search.ess, rng);
            }
            let last = depth + 1 == settings.search.levels.len();
            let ess = if last { settings.search.last_ess } else { settings.search.ess };
            for iteration in 0..level.iterations {
                if iteration > 0 {
                    population = diffuse(&population, level, iteration - 1, ess, rng);
                }
                self.advance(&mut population, level)?;
                self.trace.iteration(self.rendered, population.first().map(|h| &h.pose));
            }
        }
        population.truncate(settings.polish.finalists);
        self.polished(population.iter().map(|h| h.pose).collect())
    }

    /// Moves and weighs every hypothesis of a level.
    fn advance(&mut self, population: &mut [ScoredPose], level: &SearchLevel) -> Result<()> {
        let batch = Batch {
            lod: self.model.lod(level.triangles),
            stride: self.stride(level),
            kernel: level.kernel,
            steps: level.steps,
            ..self.full_batch()
        };
        let mut poses: Vec<Isometry3<f32>> = population.iter().map(|h| h.pose).collect();
        let scores = self.weigh(&batch, &mut poses)?;
        for ((h, pose), score) in population.iter_mut().zip(poses).zip(scores) {
            *h = ScoredPose { pose, score };
        }
        population.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(())
    }

    /// Of what it searches,
    pub fn model(&self) -> &'a Model {
        self.model
    }

    /// and how.
    pub fn settings(&self) -> &'a GripSettings {
        self.settings
    }

    /// Full resolution, no steps.
    pub fn full_batch(&self) -> Batch<'a> {
        Batch {
            lod: self.model.lod(self.settings.polish.triangles),
            radius: self.model.radius,
            observation: self.observation,
            stride: Stride::One,
            kernel: self.settings.polish.kernel,
            steps: 0,
            damping: self.settings.search.damping,
            converged_m: 0.0,
        }
    }

    /// The poses after Gauss-Newton steps at full resolution, or as they were where these did not help; best first.
    pub fn polished(&mut self, mut poses: Vec<Isometry3<f32>>) -> Result<Vec<ScoredPose>> {
        let still = self.full_batch();
        let before = self.weigh(&still, &mut poses.clone())?;
        let mut out: Vec<ScoredPose> =
            poses.iter().zip(before).map(|(&pose, score)| ScoredPose { pose, score }).collect();
        let moving = Batch {
            steps: self.settings.polish.steps,
            converged_m: self.settings.polish.converged_m,
            ..still
        };
        let after = self.weigh(&moving, &mut poses)?;
        for ((h, pose), score) in out.iter_mut().zip(poses).zip(after) {
            if score > h.score {
                *h = ScoredPose { pose, score };
            }
        }
        out.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(out)
    }

    /// Moves poses as the batch says; their scores then, 0 for one that cannot be seen whole enough to be judged.
    pub fn weigh(&mut self, batch: &Batch<'_>, poses: &mut [Isometry3<f32>]) -> Result<Vec<f32>> {
        Ok(self.judged(batch, poses)?.iter().map(Parts::score).collect())
    }

    /// What the terms of the final score give to a pose, by name.
    pub fn terms(&mut self, pose: &Isometry3<f32>) -> Result<BTreeMap<String, f64>> {
        let batch = self.full_batch();
        let parts = self.judged(&batch, &mut [*pose])?;
        Ok(parts[0].named().map(|(name, part)| (name.to_owned(), f64::from(part))).into())
    }

    /// Moves poses as the batch says; what they are worth then.
    pub fn judged(&mut self, batch: &Batch<'_>, poses: &mut [Isometry3<f32>]) -> Result<Vec<Parts>> {
        self.rendered += poses.len();
        let Self { settings, observation, boxes, .. } = *self;
        let planes = &self.planes;
        let rendered = self.renderer.advance(batch, poses)?;
        let k = &observation.intrinsics;
        let judged = |rendered: &Option<Rendered>, pose: &Isometry3<f32>| {
            // The centre must be in the image: slivers at the border fit anything.
            let centre = nalgebra::Point3::from(pose.translation.vector.cast::<f64>());
            let seen = k.project(&centre).is_some_and(|p| {
                (0.0..k.width as f64).contains(&p.x) && (0.0..k.height as f64).contains(&p.y)
            });
            let Some(Rendered { terms, extent }) = rendered.as_ref().filter(|_| seen) else {
                return Parts::default();
            };
            let support = box_support(boxes, extent, batch.stride, k);
            // Over the plane that it is above; that over the lowest one was measured.
            let lowest =
                planes.first().map(|base| extent.lowest - observation.rise(base, &pose.translation.vector));
            parts(terms, &settings.score, batch.stride.pixels(), support, lowest)
        };
        Ok(rendered.iter().zip(poses.iter()).map(|(r, pose)| judged(r, pose)).collect())
    }

    /// Whether two results are one: near in score, position and surface. Hulls are compared by their support functions,
    /// whose largest difference is the Hausdorff distance; so a turned can is the same can.
    fn same(&self, a: &ScoredPose, b: &ScoredPose) -> bool {
        let s = &self.settings.restarts;
        (a.score - b.score).abs() < s.same_score
            && (a.pose.translation.vector - b.pose.translation.vector).norm() < s.same_position_m
            && directions(HULL_CHECKS).all(|d| {
                (reach(&self.model.hull, &a.pose, &d) - reach(&self.model.hull, &b.pose, &d)).abs()
                    < s.same_hull_m
            })
    }
}

/// Less support of a box is not looked for: it would change no score by as much as rendering does.
const NO_SUPPORT: f64 = 1e-3;

/// The largest confidence times overlap of a box with what is rendered at a stride; the most confident boxes come first.
fn box_support(boxes: &[BoxPrior], extent: &Extent, stride: Stride, k: &Intrinsics) -> f32 {
    let s = stride.pixels() as f64;
    let pixel = |x: f32, most: usize| (f64::from(x) * s + (s - 1.0) / 2.0).clamp(0.0, most as f64 - 1.0);
    let [u0, v0, u1, v1] = extent.bounds;
    let bounds = [pixel(u0, k.width), pixel(v0, k.height), pixel(u1, k.width), pixel(v1, k.height)];
    let mut most = 0.0_f64;
    for b in boxes.iter().filter(|b| !b.vague) {
        // No later one can be worth more.
        if b.confidence <= most.max(NO_SUPPORT) {
            break;
        }
        most = (b.confidence * iou(&b.bbox, &bounds)).max(most);
    }
    most as f32
}

/// `count` different hypotheses drawn by tempered weight; the best is always among them.
fn thin_out<R: Rng>(population: &[ScoredPose], count: usize, ess: f64, rng: &mut R) -> Vec<ScoredPose> {
    if population.len() <= count {
        return population.to_vec();
    }
    let scores: Vec<f32> = population.iter().map(|h| h.score).collect();
    let t = temperature(&scores, ess);
    let weights: Vec<f32> = scores.iter().map(|s| s / t).collect();
    let mut kept = gumbel_top(&weights, count, rng);
    // Sorted by score, so the best is number 0.
    if !kept.contains(&0)
        && let Some(last) = kept.last_mut()
    {
        *last = 0;
    }
    kept.into_iter().map(|i| population[i]).collect()
}

/// Resampling with replacement and diffusion; the best stays as it is. DIFFERENCE to the paper: its step widths decay
/// with the best weight, ours by schedule.
fn diffuse<R: Rng>(
    population: &[ScoredPose],
    level: &SearchLevel,
    round: usize,
    ess: f64,
    rng: &mut R,
) -> Vec<ScoredPose> {
    let scores: Vec<f32> = population.iter().map(|h| h.score).collect();
    let t = temperature(&scores, ess);
    let rounds = level.iterations.saturating_sub(2).max(1) as f32;
    let between = |[from, to]: [f32; 2]| {
        if from > 0.0 && to > 0.0 { from * (to / from).powf(round as f32 / rounds) } else { from }
    };
    let (shift, turn) = (between(level.diffusion_m), between(level.diffusion_rad));
    let mut out: Vec<ScoredPose> = systematic(&scores, t, population.len(), rng)
        .into_iter()
        .map(|i| {
            let h = population[i];
            let mut normal = || -> f32 { StandardNormal.sample(rng) };
            let offset = Vector3::new(normal(), normal(), normal()) * shift;
            let rotation = small_rotation(turn, rng) * h.pose.rotation;
            ScoredPose {
                pose: Isometry3::from_parts(Translation3::from(h.pose.translation.vector + offset), rotation),
                score: h.score,
            }
        })
        .collect();
    if let (Some(first), Some(best)) = (out.first_mut(), population.first()) {
        *first = *best;
    }
    out
}
