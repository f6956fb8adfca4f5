//! Whether a sweep's curve predicts the grasps that held in trials, whose errors are an estimator's own.

use super::Sources;
use crate::experiment::stats::{brier, wilson};
use crate::experiment::sweep::Strategy;
use crate::experiment::sweep::fits::results;
use crate::graspers::GRIP;

/// Edges of the bins of predicted chances.
const EDGES: [f64; 8] = [0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0];

/// Predictions against what happened.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// First grasps of items whose object the sweep knows, by an estimator that errs.
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
    // Errors along axes are not how estimators err, and other grasps, contacts or objects than the trials' say nothing of them.
    let comparable = sweep.lines.iter().all(|line| line.error.axis.is_none())
        && sweep.manifest["strategy"] == serde_json::json!(Strategy::Planned)
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
        .filter(|trial| !trial.estimator.starts_with("truth") && trial.grasper == GRIP)
        .flat_map(|trial| &trial.items)
        .filter_map(|item| {
            let fall = objects.iter().find(|o| o.object == item.object)?.adds.as_ref()?;
            let first = item.first_attempt?;
            Some((fall.chance(first.adds_m?), first.held))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::report::SweepSource;
    use crate::experiment::summary::tests::trial;
    use crate::experiment::sweep::GraspLine;
    use crate::experiment::sweep::errors::isotropic;
    use crate::experiment::sweep::layout::GraspOutcome;
    use serde_json::json;

    /// Random errors of which grasps forgive 10 mm.
    fn sweep() -> SweepSource {
        let cases = isotropic(0.02, 0.1, 40);
        let line = |seed: u64, case: usize| {
            let error = cases[case].at(seed);
            let adds_m = error.size()[0];
            let held = adds_m < 0.010;
            GraspLine {
                object: "can".into(),
                seed,
                case,
                error,
                add_m: adds_m,
                adds_m,
                outcome: if held { GraspOutcome::Held } else { GraspOutcome::Missed },
                opposing_contacts: held,
                lifted_clear: held,
                held_after_shake: held,
                slip_within: held,
                slip_m: None,
                slip_deg: None,
                motion: None,
            }
        };
        let lines = (1..=5).flat_map(|seed| (0..cases.len()).map(move |case| (seed, case)));
        let manifest =
            json!({ "strategy": "planned", "friction": null, "force_n": null, "object_set": "built-in" });
        SweepSource {
            name: "s".into(),
            manifest,
            lines: lines.map(|(seed, case)| line(seed, case)).collect(),
        }
    }

    #[test]
    fn first_grasps_are_held_against_what_the_sweep_says() {
        let can = |adds_m: f64, held: bool, packed: bool| [("can", packed, Some((adds_m, held)))];
        let mut sources = Sources { sweeps: vec![sweep()], ..Sources::default() };
        sources.trials = vec![
            trial(1, "base", "grip", &can(0.001, true, true)),
            trial(2, "base", "grip", &can(0.002, true, true)),
            // A second attempt packed it: the first grasp is what counts.
            trial(3, "base", "grip", &can(0.019, false, true)),
            // No attempt, another object, a ceiling: nothing to be predicted.
            trial(4, "base", "grip", &[("can", false, None), ("box", true, Some((0.001, true)))]),
            trial(1, "base", "truth", &can(0.0, true, true)),
        ];
        let good = calibration(&sources, 0).unwrap();
        assert_eq!(good.grasps, 3);
        assert!((good.held - 2.0 / 3.0).abs() < 1e-12 && good.brier < 0.02, "{good:?}");
        assert!((good.brier_of_share - 2.0 / 9.0).abs() < 1e-12);
        let counted: usize = good.bins.iter().map(|bin| bin.1).sum();
        assert_eq!(counted, 3);
        // What the sweep tried must be what the trials did.
        for (field, value) in
            [("strategy", json!("fixed")), ("friction", json!(0.3)), ("object_set", json!("ycb"))]
        {
            let mut other = sweep();
            other.manifest[field] = value;
            sources.sweeps[0] = other;
            assert_eq!(calibration(&sources, 0), None, "{field}");
        }
    }
}
