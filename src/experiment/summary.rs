//! What an experiment has shown, in figures: shares by scene, condition, estimator and grasp planner, and pairs of these two.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;

use super::plan::Key;
use super::stats::{mcnemar, wilson};
use crate::score::outcome::{Outcome, TrialResult, method};

/// The trials of a scene and condition by one estimator and one grasp planner.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Cell {
    /// The scene's name.
    pub scene: String,
    /// The condition's name.
    pub condition: String,
    /// The estimator's name.
    pub estimator: String,
    /// The grasp planner's name.
    pub grasper: String,
    /// Trials.
    pub trials: usize,
    /// Trials in which everything was packed.
    pub full: usize,
    /// Items asked for.
    pub items: usize,
    /// Items packed.
    pub packed: usize,
    /// Their share.
    pub share: f64,
    /// Its interval, 95 %, Wilson's: items count as independent, which those of one trial are not quite.
    pub interval: [f64; 2],
    /// Items that were not packed, by what became of them.
    pub failures: BTreeMap<String, usize>,
    /// Motions that were found in collision afterwards.
    pub collisions: usize,
}

/// Two estimators, or two grasp planners, on the same items.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Pairs {
    /// The scene's name.
    pub scene: String,
    /// The condition's name.
    pub condition: String,
    /// The estimators' names, each with that of a grasp planner behind it where that is not our own.
    pub estimators: [String; 2],
    /// Items that both were given: same seed, same place.
    pub items: usize,
    /// Packed by both, by the first alone, by the second alone, by none.
    pub counts: [usize; 4],
    /// Probability of so uneven a split by chance (McNemar, exact, two-sided).
    pub p: f64,
}

impl Cell {
    /// Who estimated, and who planned grasps where that is not our own planner.
    pub fn method(&self) -> String {
        method(&self.estimator, &self.grasper)
    }
}

/// Trials by scene, condition, estimator and grasp planner, in the order of these names.
pub fn cells(trials: &[TrialResult]) -> Vec<Cell> {
    let mut groups: BTreeMap<[&str; 4], Vec<&TrialResult>> = BTreeMap::new();
    for trial in trials {
        let names = [&*trial.scene, &trial.condition, &trial.estimator, &trial.grasper];
        groups.entry(names).or_default().push(trial);
    }
    groups
        .into_iter()
        .map(|([scene, condition, estimator, grasper], trials)| {
            let items: usize = trials.iter().map(|t| t.requested).sum();
            let packed: usize = trials.iter().map(|t| t.packed).sum();
            let mut failures = BTreeMap::new();
            for item in trials.iter().flat_map(|t| &t.items).filter(|i| i.outcome != Outcome::Packed) {
                *failures.entry(item.outcome.words().to_owned()).or_default() += 1;
            }
            Cell {
                scene: scene.into(),
                condition: condition.into(),
                estimator: estimator.into(),
                grasper: grasper.into(),
                trials: trials.len(),
                full: trials.iter().filter(|t| t.packed == t.requested).count(),
                items,
                packed,
                share: packed as f64 / items.max(1) as f64,
                interval: wilson(packed, items),
                failures,
                collisions: trials.iter().map(|t| t.motion_check.collisions.len()).sum(),
            }
        })
        .collect()
}

/// Every two estimators and grasp planners on the items of each scene and condition that both were given.
pub fn pairs(trials: &[TrialResult]) -> Vec<Pairs> {
    type Items<'a> = BTreeMap<(u64, &'a str, u32), bool>;
    let mut groups: BTreeMap<[&str; 2], BTreeMap<String, Items<'_>>> = BTreeMap::new();
    for trial in trials {
        let Key { seed, .. } = Key::of(trial);
        let by_method = groups.entry([&trial.scene, &trial.condition]).or_default();
        let items = by_method.entry(trial.method()).or_default();
        for item in &trial.items {
            items.insert((seed, &item.object, item.instance), item.outcome == Outcome::Packed);
        }
    }
    let mut found = Vec::new();
    for ([scene, condition], by_method) in groups {
        let methods: Vec<_> = by_method.into_iter().collect();
        for (i, (first, a)) in methods.iter().enumerate() {
            for (second, b) in &methods[i + 1..] {
                let mut counts = [0; 4];
                for (item, packed) in a {
                    if let Some(other) = b.get(item) {
                        counts[usize::from(!packed) * 2 + usize::from(!other)] += 1;
                    }
                }
                found.push(Pairs {
                    scene: scene.into(),
                    condition: condition.into(),
                    estimators: [first.clone(), second.clone()],
                    items: counts.iter().sum(),
                    counts,
                    p: mcnemar(counts[1], counts[2]),
                });
            }
        }
    }
    found
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::score::outcome::{Clauses, FirstAttempt, ItemResult, Measures, Stage, TRIAL_SCHEMA};

    /// An item by hand: its name, whether it was packed, and its first grasp: at which ADD-S, metres, and whether it held.
    pub type Item<'a> = (&'a str, bool, Option<(f64, bool)>);

    /// A trial by hand.
    pub fn trial(seed: u64, condition: &str, estimator: &str, items: &[Item<'_>]) -> TrialResult {
        let item = |&(object, packed, first): &Item<'_>| ItemResult {
            instance: 1,
            object: object.into(),
            outcome: if packed { Outcome::Packed } else { Outcome::Missed },
            stage: Stage::Done,
            reason: String::new(),
            attempts: 1,
            add_m: None,
            adds_m: None,
            slip_m: None,
            peak_force_n: 0.0,
            peak_impulse_n_s: 0.0,
            harmless_impulse_n_s: 0.0,
            others_moved_m: 0.0,
            first_attempt: first.map(|(m, held)| FirstAttempt { add_m: Some(m), adds_m: Some(m), held }),
            failed_attempts: Vec::new(),
            clauses: Clauses::default(),
            measures: Measures::default(),
        };
        TrialResult {
            schema: TRIAL_SCHEMA.into(),
            scenario: String::new(),
            seed,
            scene: "grocery".into(),
            condition: condition.into(),
            estimator: estimator.into(),
            grasper: "grip".into(),
            detector: "none".into(),
            object_set: "built-in".into(),
            renderer: "cpu".into(),
            hypotheses: "cpu".into(),
            requested: items.len(),
            packed: items.iter().filter(|i| i.1).count(),
            sim_s: 0.0,
            calibration: None,
            score: crate::score::outcome::ScoreCard::default(),
            motion_check: crate::score::MotionCheck::default(),
            items: items.iter().map(item).collect(),
            state_hash: String::new(),
            timing: None,
        }
    }

    #[test]
    fn cells_count_their_own_trials_and_items() {
        let trials = [
            trial(1, "base", "grip", &[("can", true, None), ("box", true, None)]),
            trial(2, "base", "grip", &[("can", true, None), ("box", false, None)]),
            trial(1, "dark", "grip", &[("can", false, None)]),
        ];
        let cells = cells(&trials);
        assert_eq!(cells.len(), 2);
        let base = &cells[0];
        assert_eq!((base.condition.as_str(), base.trials, base.full), ("base", 2, 1));
        assert_eq!((base.items, base.packed, base.share), (4, 3, 0.75));
        assert_eq!(base.interval, wilson(3, 4));
        assert_eq!(base.failures, BTreeMap::from([("missed".to_owned(), 1)]));
        assert_eq!((cells[1].packed, cells[1].items), (0, 1));
    }

    #[test]
    fn pairs_are_the_items_that_both_were_given() {
        let trials = [
            trial(1, "base", "grip", &[("can", true, None), ("box", true, None)]),
            trial(2, "base", "grip", &[("can", false, None), ("box", false, None)]),
            trial(3, "base", "grip", &[("can", false, None)]),
            trial(1, "base", "truth", &[("box", true, None), ("can", false, None)]),
            trial(2, "base", "truth", &[("can", true, None), ("box", false, None)]),
            // The same seed in another condition is another scene.
            trial(3, "dark", "truth", &[("can", true, None)]),
        ];
        let pairs = pairs(&trials);
        assert_eq!(pairs.len(), 1);
        assert_eq!(pairs[0].estimators, ["grip", "truth"]);
        // Both: the box of 1; grip alone: the can of 1; truth alone: the can of 2; none: the box of 2.
        assert_eq!((pairs[0].items, pairs[0].counts, pairs[0].p), (4, [1, 1, 1, 1], 1.0));
    }
}
