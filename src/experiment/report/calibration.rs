//! Whether a sweep's curve predicts the grasps that held in trials, whose errors are an estimator's own.

use super::{Sources, grasp_held};
use crate::experiment::stats::{brier, wilson};
use crate::experiment::sweep::fits::results;

/// Edges of the bins of predicted chances.
const EDGES: [f64; 8] = [0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0];

/// Predictions against what happened.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Items whose object the sweep knows, tried once by an estimator that errs.
    pub grasps: usize,
    /// Share of them that held.
    pub held: f64,
    /// Mean of what was predicted.
    pub predicted: f64,
    /// Brier score of the predictions.
    pub brier: f64,
    /// Brier score of the share that held, said of every one of them: what a prediction must beat.
    pub brier_of_share: f64,
    /// Mean prediction, grasps, share that held and its interval, by predicted chance.
    pub bins: Vec<(f64, usize, f64, [f64; 2])>,
}

/// Of the curves over ADD-S of the sweep `which`, if its errors are random and there are trials that it can be held against.
pub fn calibration(sources: &Sources, which: usize) -> Option<Calibration> {
    let sweep = &sources.sweeps[which];
    // Errors along axes are not how estimators err, and other contacts or objects than the trials' say nothing of them.
    let comparable = sweep.lines.iter().all(|line| line.error.axis.is_none())
        && sweep.manifest["friction"].is_null()
        && sweep.manifest["force_n"].is_null()
        && sources.trials.iter().all(|trial| sweep.manifest["object_set"] == trial.object_set.as_str());
    if !comparable {
        return None;
    }
    let objects = results(&sweep.lines);
    let cases: Vec<(f64, bool)> = sources
        .trials
        .iter()
        .filter(|trial| !trial.estimator.starts_with("truth"))
        .flat_map(|trial| &trial.items)
        .filter_map(|item| {
            let fall = objects.iter().find(|o| o.object == item.object)?.adds.as_ref()?;
            Some((fall.chance(item.adds_m?), grasp_held(item)?))
        })
        .collect();
    let (predicted, held): (Vec<f64>, Vec<bool>) = cases.iter().copied().unzip();
    if cases.is_empty() {
        return None;
    }
    let n = cases.len() as f64;
    let share = held.iter().filter(|h| **h).count() as f64 / n;
    let bins = EDGES
        .windows(2)
        .filter_map(|edge| {
            let last = edge[1] == 1.0;
            let inside: Vec<&(f64, bool)> =
                cases.iter().filter(|(p, _)| *p >= edge[0] && (*p < edge[1] || last)).collect();
            let good = inside.iter().filter(|(_, h)| *h).count();
            let count = inside.len();
            let mean = inside.iter().map(|(p, _)| p).sum::<f64>() / count.max(1) as f64;
            (count > 0).then(|| (mean, count, good as f64 / count as f64, wilson(good, count)))
        })
        .collect();
    Some(Calibration {
        grasps: cases.len(),
        held: share,
        predicted: predicted.iter().sum::<f64>() / n,
        brier: brier(&predicted, &held),
        brier_of_share: brier(&vec![share; cases.len()], &held),
        bins,
    })
}
