//! How searches converge: the error of their best pose after each iteration (Fig. 3 of the GRIP paper).

use std::collections::{BTreeMap, BTreeSet};

use anyhow::Result;
use grip_perception::metrics::Surface;
use grip_perception::{PoseEstimator, TracePoint};
use grip_sim::bop::{Dataset, GroundTruth};
use schemars::JsonSchema;
use serde::Serialize;

use super::boxes::Boxes;
use super::estimates::{camera_frame, image_seed, targets};
use super::objects;
use crate::plot::{Axis, Curve, Figure, Panel};
use crate::progress::{Interrupted, Progress};

/// What of a point is drawn.
type Quantity = fn(&Measured) -> f64;

/// Points of a curve over time.
const TIMES: usize = 300;
/// What the paper's searches reach after about 150 iterations (Implementation), metres.
const PAPER_LEVEL_M: f64 = 0.005;

/// An estimator that keeps traces, with its name in the figure.
pub struct Contender {
    /// In the legend.
    pub name: String,
    /// Who estimates.
    pub estimator: Box<dyn PoseEstimator>,
}

/// What is searched.
pub struct Searches<'a> {
    /// The images.
    pub dataset: &'a Dataset,
    /// Scene and image.
    pub image: (u32, u32),
    /// Objects, by number; all that are asked for in the image where empty.
    pub objects: &'a [u32],
    /// Where to look.
    pub boxes: &'a Boxes,
    /// Seeds of everything random.
    pub seeds: std::ops::RangeInclusive<u64>,
}

/// One search for one object.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Search {
    /// Index of the contender.
    pub estimator: usize,
    /// Number of the object.
    pub obj_id: u32,
    /// As of `grip estimate`.
    pub seed: u64,
    /// After each iteration; empty where there was nothing to draw hypotheses from.
    pub points: Vec<Measured>,
}

/// The error of the best pose after an iteration.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub struct Measured {
    /// From 1.
    pub iteration: usize,
    /// Rendered and weighed by then.
    pub hypotheses: usize,
    /// Wall time by then, seconds.
    pub seconds: f64,
    /// ADD, metres.
    pub add_m: f64,
    /// ADD-S, metres.
    pub adds_m: f64,
}

/// All searches.
pub struct Convergence {
    /// By seed, contender and object.
    pub trials: Vec<Search>,
}

impl Searches<'_> {
    /// Estimates the image by each contender. On a pool of one thread each object's time is its own.
    ///
    /// # Errors
    /// When there is no such scene, image or object, or one of their files cannot be read.
    pub fn run(&self, contenders: &[Contender], progress: &dyn Progress) -> Result<Convergence> {
        let (scene_id, im_id) = self.image;
        let asked = self.asked()?;
        let bop = self.dataset.frame(scene_id, im_id)?;
        let frame = camera_frame(&bop);
        // Boxes are drawn for all of them in turn, as grip estimate does.
        let all = asked.iter().map(|id| objects::load(self.dataset, *id)).collect::<Result<Vec<_>>>()?;
        let chosen = |id: u32| self.objects.is_empty() || self.objects.contains(&id);
        let searched: Vec<_> = all.iter().filter(|model| chosen(model.info.bop_id)).cloned().collect();
        let mut surfaces = BTreeMap::new();
        for model in &searched {
            let points = self.dataset.load_evaluation_model(model.info.bop_id)?.mesh.positions.clone();
            surfaces.insert(model.info.bop_id, Surface::new(points.iter().map(|p| p.cast()).collect()));
        }
        progress.begin((contenders.len() * self.seeds.clone().count()) as u64, 0);
        let truths = bop.truth()?;
        let mut trials = Vec::new();
        for seed in self.seeds.clone() {
            let of_image = image_seed(seed, self.image);
            let detections = self.boxes.of(&bop, &frame, &all, of_image)?;
            let looked_for = self.boxes.looked_for(&detections, &searched);
            let searched: Vec<_> = searched
                .iter()
                .cloned()
                .zip(looked_for)
                .filter_map(|(model, is)| is.then_some(model))
                .collect();
            for (estimator, contender) in contenders.iter().enumerate() {
                anyhow::ensure!(!progress.cancelled(), Interrupted);
                let beliefs = contender.estimator.estimate(&frame, &detections, &searched, of_image)?;
                for (model, belief) in searched.iter().zip(beliefs) {
                    let obj_id = model.info.bop_id;
                    let points = errors(&belief.trace, &surfaces[&obj_id], truths, obj_id);
                    trials.push(Search { estimator, obj_id, seed, points });
                }
                progress.advance(1);
            }
        }
        Ok(Convergence { trials })
    }

    /// The objects that are asked for in the image, as often as there are instances.
    fn asked(&self) -> Result<Vec<u32>> {
        let root = self.dataset.root().display();
        let (scene_id, im_id) = self.image;
        let list = |ids: &[u32]| ids.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
        let scenes = self.dataset.scenes()?;
        anyhow::ensure!(
            scenes.contains(&scene_id),
            "{root}: has no scene {scene_id} in {}; it has {}",
            self.dataset.split(),
            list(&scenes)
        );
        let images = self.dataset.images(scene_id)?;
        anyhow::ensure!(
            images.contains(&im_id),
            "{root}: scene {scene_id} has no image {im_id}; it has {}",
            list(&images)
        );
        let known: BTreeSet<u32> =
            self.dataset.ground_truths(scene_id, im_id)?.iter().map(|truth| truth.obj_id).collect();
        let asked: BTreeMap<u32, u32> = targets(self.dataset)?
            .iter()
            .filter(|t| (t.scene_id, t.im_id) == self.image && known.contains(&t.obj_id))
            .map(|t| (t.obj_id, t.inst_count))
            .collect();
        anyhow::ensure!(
            !asked.is_empty(),
            "{root}: scene {scene_id}, image {im_id} has no truth to measure errors with; choose another image or split"
        );
        if let Some(id) = self.objects.iter().find(|id| !asked.contains_key(id)) {
            let ids: Vec<u32> = asked.into_keys().collect();
            anyhow::bail!(
                "{root}: scene {scene_id}, image {im_id} has no object {id}; it has {}",
                list(&ids)
            );
        }
        let repeated = |(id, count): (u32, u32)| std::iter::repeat_n(id, count as usize);
        Ok(asked.into_iter().flat_map(repeated).collect())
    }
}

/// The errors of a trace; of more instances of the object the nearest one counts.
fn errors(trace: &[TracePoint], surface: &Surface, truths: &[GroundTruth], obj_id: u32) -> Vec<Measured> {
    // An answer stands for many iterations: its errors are taken once.
    let mut last: Option<(&TracePoint, [f64; 2])> = None;
    (1..)
        .zip(trace)
        .map(|(iteration, point)| {
            let measured = || {
                let to = |truth: &GroundTruth| {
                    let truth = &truth.camera_from_object;
                    [surface.adds(truth, &point.best), surface.add(truth, &point.best)]
                };
                truths
                    .iter()
                    .filter(|truth| truth.obj_id == obj_id)
                    .map(to)
                    .min_by(|a, b| a[0].total_cmp(&b[0]))
                    .unwrap_or([f64::INFINITY; 2])
            };
            let known = last.filter(|(before, _)| before.best == point.best).map(|(_, errors)| errors);
            let [adds_m, add_m] = known.unwrap_or_else(measured);
            last = Some((point, [adds_m, add_m]));
            Measured { iteration, hypotheses: point.hypotheses, seconds: point.seconds, add_m, adds_m }
        })
        .collect()
}

/// What searches of one contender came to.
#[derive(Debug, Serialize, JsonSchema)]
pub struct SearchSummary {
    /// Searches.
    pub searches: usize,
    /// Searches that had nothing to draw hypotheses from; they are left out of all that follows and of the figure.
    pub empty: usize,
    /// Mean of iterations.
    pub iterations: f64,
    /// Mean of hypotheses rendered and weighed.
    pub hypotheses: f64,
    /// Mean wall time, seconds.
    pub seconds: f64,
    /// Mean ADD-S at the end, metres.
    pub adds_m: f64,
    /// Mean ADD at the end, metres.
    pub add_m: f64,
    /// Share of searches with ADD-S under 5 mm at the end, the paper's level.
    pub under_5_mm: f64,
}

/// Mean and quartiles over the searches, where all of them had an answer.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Spread {
    x: f64,
    mean: f64,
    quartiles: [f64; 2],
}

impl Convergence {
    /// The searches of one contender that had something to search.
    fn of(&self, estimator: usize) -> Vec<&[Measured]> {
        let mine = self.trials.iter().filter(|trial| trial.estimator == estimator);
        mine.map(|trial| trial.points.as_slice()).filter(|points| !points.is_empty()).collect()
    }

    /// Figures of one contender.
    pub fn summary(&self, estimator: usize) -> SearchSummary {
        let searches = self.trials.iter().filter(|trial| trial.estimator == estimator).count();
        let ends: Vec<&Measured> = self.of(estimator).iter().filter_map(|points| points.last()).collect();
        let mean = |value: Quantity| ends.iter().map(|e| value(e)).sum::<f64>() / ends.len().max(1) as f64;
        SearchSummary {
            searches,
            empty: searches - ends.len(),
            iterations: mean(|e| e.iteration as f64),
            hypotheses: mean(|e| e.hypotheses as f64),
            seconds: mean(|e| e.seconds),
            adds_m: mean(|e| e.adds_m),
            add_m: mean(|e| e.add_m),
            under_5_mm: mean(|e| f64::from(u8::from(e.adds_m < PAPER_LEVEL_M))),
        }
    }

    /// ADD-S and ADD, against iterations and time.
    pub fn figure(&self, title: String, contenders: &[Contender]) -> Figure {
        let millimetres: [(&str, Quantity); 2] = [("ADD-S", |e| 1e3 * e.adds_m), ("ADD", |e| 1e3 * e.add_m)];
        let keys: [(&str, &str, Quantity); 2] =
            [("iteration", "iterations", |e| e.iteration as f64), ("time, ms", "ms", |e| 1e3 * e.seconds)];
        let mut panels = Vec::new();
        for (metric, error) in millimetres {
            for (axis, unit, key) in keys {
                let curve = |(index, contender): (usize, &Contender)| {
                    let searches = self.of(index);
                    let spreads = spreads(&searches, &places(&searches, key, unit == "ms"), key, error);
                    let end = spreads.last().map_or_else(
                        || "nothing to search".to_owned(),
                        |end| format!("{:.1} mm after at most {:.0} {unit}", end.mean, end.x),
                    );
                    Curve {
                        label: format!("{}: {end}", contender.name),
                        points: spreads.iter().map(|s| (s.x, s.mean)).collect(),
                        band: spreads.iter().map(|s| (s.x, s.quartiles[0], s.quartiles[1])).collect(),
                        ..Curve::default()
                    }
                };
                let curves: Vec<Curve> = contenders.iter().enumerate().map(curve).collect();
                let xs = curves.iter().flat_map(|c| c.points.iter().map(|p| p.0));
                let level = 1e3 * PAPER_LEVEL_M;
                let means = curves.iter().flat_map(|c| c.points.iter().map(|p| p.1));
                let bands = curves.iter().flat_map(|c| c.band.iter().flat_map(|b| [b.1, b.2]));
                panels.push(Panel {
                    title: format!("{metric} by {}", if unit == "ms" { "time" } else { "iteration" }),
                    x: Axis::log(axis, xs.collect::<Vec<_>>()),
                    y: Axis::log(
                        &format!("{metric}, mm: mean, quartiles"),
                        means.chain(bands).chain([level]).collect::<Vec<_>>(),
                    ),
                    curves,
                    level: Some((level, "5 mm: the paper's own, after about 150 iterations".to_owned())),
                });
            }
        }
        Figure { title, columns: 2, panels }
    }
}

/// Where a curve has its points: at each iteration, or at times that are evenly spaced on a logarithmic axis.
fn places(searches: &[&[Measured]], key: Quantity, continuous: bool) -> Vec<f64> {
    let first = searches.iter().filter_map(|points| points.first()).map(key).fold(0.0, f64::max);
    let last = searches.iter().filter_map(|points| points.last()).map(key).fold(first, f64::max);
    if !continuous {
        return (first as usize..=last as usize).map(|i| i as f64).collect();
    }
    (0..=TIMES).map(|i| first * (last / first).powf(i as f64 / TIMES as f64)).collect()
}

/// Over all searches at each of `xs`; one that has ended keeps its last error.
fn spreads(searches: &[&[Measured]], xs: &[f64], key: Quantity, error: Quantity) -> Vec<Spread> {
    // Powers of ten through logarithms are off in their last digits.
    let reached = |x: f64| x * (1.0 + 1e-12);
    let at = |points: &[Measured], x: f64| {
        let count = points.partition_point(|point| key(point) <= reached(x));
        count.checked_sub(1).map(|i| error(&points[i]))
    };
    let spread = |&x: &f64| {
        let mut errors = searches.iter().map(|points| at(points, x)).collect::<Option<Vec<f64>>>()?;
        errors.sort_by(f64::total_cmp);
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        (!errors.is_empty()).then(|| Spread {
            x,
            mean,
            quartiles: [0.25, 0.75].map(|q| quantile(&errors, q)),
        })
    };
    xs.iter().filter_map(spread).collect()
}

/// Linear between the ranks of sorted values, of which there is at least one.
pub fn quantile(sorted: &[f64], q: f64) -> f64 {
    let rank = q * (sorted.len() - 1) as f64;
    let (below, share) = (rank.floor() as usize, rank.fract());
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + share * (sorted[above] - sorted[below])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn search(errors: &[f64], seconds: f64) -> Vec<Measured> {
        (1..)
            .zip(errors)
            .map(|(i, &adds_m)| Measured {
                iteration: i,
                hypotheses: 10 * i,
                seconds: seconds * i as f64,
                add_m: 2.0 * adds_m,
                adds_m,
            })
            .collect()
    }

    #[test]
    fn a_search_that_ended_keeps_its_error_and_the_mean_begins_when_all_have_one() {
        let (a, b) = (search(&[8.0, 4.0], 1.0), search(&[6.0, 3.0, 1.0], 3.0));
        let searches = [a.as_slice(), b.as_slice()];
        let iteration = |e: &Measured| e.iteration as f64;
        let xs = places(&searches, iteration, false);
        let found = spreads(&searches, &xs, iteration, |e| e.adds_m);
        let expected = [(1.0, 7.0, [6.5, 7.5]), (2.0, 3.5, [3.25, 3.75]), (3.0, 2.5, [1.75, 3.25])];
        assert_eq!(found, expected.map(|(x, mean, quartiles)| Spread { x, mean, quartiles }));

        let seconds = |e: &Measured| e.seconds;
        let times = places(&searches, seconds, true);
        assert!((times[0] - 3.0).abs() < 1e-12 && (times[TIMES] - 9.0).abs() < 1e-9);
        let found = spreads(&searches, &times, seconds, |e| e.adds_m);
        assert_eq!((found.len(), found[0].mean, found[TIMES].mean), (TIMES + 1, 5.0, 2.5));
        assert!(spreads(&searches, &[2.9], seconds, |e| e.adds_m).is_empty());
        assert!(spreads(&[], &[1.0], seconds, |e| e.adds_m).is_empty());
    }

    #[test]
    fn empty_searches_are_counted_and_left_out() {
        let trial = |points| Search { estimator: 0, obj_id: 1, seed: 1, points };
        let trials = vec![trial(search(&[0.02, 0.004], 1.0)), trial(vec![]), trial(search(&[0.008], 1.0))];
        let summary = Convergence { trials }.summary(0);
        assert_eq!((summary.searches, summary.empty, summary.under_5_mm), (3, 1, 0.5));
        assert!((summary.adds_m - 0.006).abs() < 1e-12 && (summary.add_m - 0.012).abs() < 1e-12);
        assert_eq!((summary.iterations, summary.seconds), (1.5, 1.5));
    }
}
