//! The search for one object: levels of generate, move and weigh, restarted until two searches agree.

use std::collections::BTreeMap;

use grip_sim::camera::Intrinsics;
use nalgebra::{Isometry3, Translation3, Vector3};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::model::{Model, directions};
use super::propose::{BoxPrior, propose, small_rotation};
use super::resample::{gumbel_top, systematic, temperature};
use super::score::{Parts, parts};
use super::settings::{GripSettings, SearchLevel};
use super::trace::Trace;
use crate::detector::iou;
use crate::error::Result;
use crate::hypotheses::{Batch, Extent, FlatPlane, Hypotheses, Observation, Rendered};
use crate::posterior::TracePoint;

/// Directions in which two hulls are compared.
const HULL_CHECKS: usize = 64;

/// Restarts after which a search may be given up.
const HOPELESS_RESTARTS: usize = 3;

/// A step of the polish that moves no point farther ends it, metres: a tenth of what the noise leaves.
const CONVERGED_M: f32 = 1e-4;

/// A pose and how well it explains the frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hypothesis {
    pub pose: Isometry3<f32>,
    pub score: f32,
}

/// What a search found.
#[derive(Debug, Clone)]
pub(crate) struct Found {
    pub best: Hypothesis,
    /// Polished hypotheses of all restarts, with their scores at full resolution.
    pub population: Vec<Hypothesis>,
    /// Further instances.
    pub others: Vec<Found>,
    pub restarts: usize,
    /// Restarts that ended at the best one's place, itself included.
    pub agreeing: usize,
    pub hypotheses: usize,
    /// Confidence of the best box, 0 to 1.
    pub believed: f64,
    /// The answer after each iteration of each level and restart, after each polish and after the twins.
    pub trace: Vec<TracePoint>,
}

impl Found {
    /// The score as a sign that the object is there: the box term counts for as much as the best box is believed, since a detector
    /// that darkness fools says nothing against an object. (The search itself compares plain scores.)
    pub fn evidence(&self, settings: &GripSettings) -> f64 {
        let others = settings.fit_weight + settings.edge_weight;
        let whole = f64::from(others + settings.box_weight);
        let reachable = f64::from(others) + f64::from(settings.box_weight) * self.believed;
        f64::from(self.best.score) * whole / reachable
    }
}

/// Everything that weighing a hypothesis needs.
pub(crate) struct Search<'a> {
    model: &'a Model,
    observation: &'a Observation,
    boxes: &'a [BoxPrior],
    plane: Option<FlatPlane>,
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
        let plane = observation.flat_plane();
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
            plane,
            settings,
            renderer,
            rendered: 0,
            trace: Trace::new(settings.trace),
            side_px,
        }
    }

    /// The stride of a level for this object.
    fn stride(&self, level: &SearchLevel) -> usize {
        let mut stride = level.stride;
        while stride > 1 && self.side_px / (stride as f32) < self.settings.least_side_px {
            stride /= 2;
        }
        stride
    }

    /// Restarts until one is sure, or the best score was reached twice at the same place.
    pub fn run<R: Rng>(&mut self, rng: &mut R) -> Result<Option<Found>> {
        let mut ends: Vec<Hypothesis> = Vec::new();
        let mut population = Vec::new();
        let mut best: Option<Hypothesis> = None;
        for _ in 0..self.settings.max_restarts {
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
            let hopeless = ends.len() >= HOPELESS_RESTARTS
                && best.is_none_or(|b| b.score < self.settings.hopeless_score);
            if agreed || hopeless || end.score >= self.settings.sure_score {
                break;
            }
        }
        let Some(found) = best else { return Ok(None) };
        let agreeing = ends.iter().filter(|e| self.same(e, &found)).count();
        let best = self.best_of_turned(found, &mut population)?;
        if self.settings.twins {
            self.trace.answer(self.rendered, &best.pose);
        }
        population.sort_by(|a, b| b.score.total_cmp(&a.score));
        let trace = self.trace.take();
        Ok(Some(Found {
            best,
            population,
            others: Vec::new(),
            restarts: ends.len(),
            agreeing,
            hypotheses: self.rendered,
            believed: self.boxes.iter().filter(|b| !b.vague).map(|b| b.confidence).fold(0.0, f64::max),
            trace,
        }))
    }

    /// One pass through the levels and the polish; the survivors, best first.
    fn descend<R: Rng>(&mut self, rng: &mut R) -> Result<Vec<Hypothesis>> {
        let settings = self.settings;
        let mut population: Vec<Hypothesis> = Vec::new();
        for (depth, level) in settings.levels.iter().enumerate() {
            if depth == 0 {
                population = propose(
                    self.model,
                    self.observation,
                    self.boxes,
                    self.plane.as_ref(),
                    settings,
                    level.samples,
                    rng,
                )
                .into_iter()
                .map(|pose| Hypothesis { pose, score: 0.0 })
                .collect();
            } else {
                population = thin_out(&population, level.samples, settings.ess, rng);
            }
            let last = depth + 1 == settings.levels.len();
            let ess = if last { settings.last_ess } else { settings.ess };
            for iteration in 0..level.iterations {
                if iteration > 0 {
                    population = diffuse(&population, level, iteration - 1, ess, rng);
                }
                self.advance(&mut population, level)?;
                self.trace.iteration(self.rendered, population.first().map(|h| &h.pose));
            }
        }
        population.truncate(settings.finalists);
        self.polished(population.iter().map(|h| h.pose).collect())
    }

    /// Moves and weighs every hypothesis of a level.
    fn advance(&mut self, population: &mut [Hypothesis], level: &SearchLevel) -> Result<()> {
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
            *h = Hypothesis { pose, score };
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
            lod: self.model.lod(FINAL_TRIANGLES),
            radius: self.model.radius,
            observation: self.observation,
            stride: 1,
            kernel: self.settings.final_kernel,
            steps: 0,
            damping: self.settings.damping,
            converged_m: 0.0,
        }
    }

    /// The poses after Gauss-Newton steps at full resolution, or as they were where these did not help; best first.
    pub fn polished(&mut self, mut poses: Vec<Isometry3<f32>>) -> Result<Vec<Hypothesis>> {
        let still = self.full_batch();
        let before = self.weigh(&still, &mut poses.clone())?;
        let mut out: Vec<Hypothesis> =
            poses.iter().zip(before).map(|(&pose, score)| Hypothesis { pose, score }).collect();
        let moving = Batch { steps: self.settings.final_steps, converged_m: CONVERGED_M, ..still };
        let after = self.weigh(&moving, &mut poses)?;
        for ((h, pose), score) in out.iter_mut().zip(poses).zip(after) {
            if score > h.score {
                *h = Hypothesis { pose, score };
            }
        }
        out.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(out)
    }

    /// Moves poses as the batch says; their scores then, 0 for one that cannot be seen whole enough to be judged.
    fn weigh(&mut self, batch: &Batch<'_>, poses: &mut [Isometry3<f32>]) -> Result<Vec<f32>> {
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
            let lowest = observation.plane.is_some().then_some(extent.lowest);
            parts(terms, settings, batch.stride, support, lowest)
        };
        Ok(rendered.iter().zip(poses.iter()).map(|(r, pose)| judged(r, pose)).collect())
    }

    /// Whether two results are one: near in score, position and surface. Hulls are compared by their support functions,
    /// whose largest difference is the Hausdorff distance; so a turned can is the same can.
    fn same(&self, a: &Hypothesis, b: &Hypothesis) -> bool {
        let s = self.settings;
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
fn box_support(boxes: &[BoxPrior], extent: &Extent, stride: usize, k: &Intrinsics) -> f32 {
    let s = stride as f64;
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

/// Triangles of the mesh that the final scores are made with.
pub(crate) const FINAL_TRIANGLES: usize = 1000;

/// Support function of the posed hull: how far it reaches in direction `d`.
pub(crate) fn reach(hull: &[Vector3<f32>], pose: &Isometry3<f32>, d: &Vector3<f32>) -> f32 {
    let local = pose.rotation.inverse() * d;
    hull.iter().map(|p| p.dot(&local)).fold(f32::MIN, f32::max) + pose.translation.vector.dot(d)
}

/// Bounds `[u0, v0, u1, v1]` of the projected points, clipped to the image; `None` when one is behind the camera.
pub(crate) fn to_camera_bounds(
    points: &[Vector3<f32>],
    pose: &Isometry3<f32>,
    k: &Intrinsics,
) -> Option<[f64; 4]> {
    let r = pose.rotation.to_rotation_matrix();
    let (fx, fy, cx, cy) = (k.fx as f32, k.fy as f32, k.cx as f32, k.cy as f32);
    let mut b = [f32::MAX, f32::MAX, f32::MIN, f32::MIN];
    for p in points {
        let q = r * p + pose.translation.vector;
        if q.z < 0.05 {
            return None;
        }
        let (u, v) = (fx * q.x / q.z + cx, fy * q.y / q.z + cy);
        b = [b[0].min(u), b[1].min(v), b[2].max(u), b[3].max(v)];
    }
    let clip = |x: f32, most: usize| f64::from(x).clamp(0.0, most as f64 - 1.0);
    Some([clip(b[0], k.width), clip(b[1], k.height), clip(b[2], k.width), clip(b[3], k.height)])
}

/// `count` different hypotheses drawn by tempered weight; the best is always among them.
fn thin_out<R: Rng>(population: &[Hypothesis], count: usize, ess: f64, rng: &mut R) -> Vec<Hypothesis> {
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
    population: &[Hypothesis],
    level: &SearchLevel,
    round: usize,
    ess: f64,
    rng: &mut R,
) -> Vec<Hypothesis> {
    let scores: Vec<f32> = population.iter().map(|h| h.score).collect();
    let t = temperature(&scores, ess);
    let rounds = level.iterations.saturating_sub(2).max(1) as f32;
    let between = |[from, to]: [f32; 2]| {
        if from > 0.0 && to > 0.0 { from * (to / from).powf(round as f32 / rounds) } else { from }
    };
    let (shift, turn) = (between(level.diffusion_m), between(level.diffusion_rad));
    let mut out: Vec<Hypothesis> = systematic(&scores, t, population.len(), rng)
        .into_iter()
        .map(|i| {
            let h = population[i];
            let mut normal = || -> f32 { StandardNormal.sample(rng) };
            let offset = Vector3::new(normal(), normal(), normal()) * shift;
            let rotation = small_rotation(turn, rng) * h.pose.rotation;
            Hypothesis {
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
