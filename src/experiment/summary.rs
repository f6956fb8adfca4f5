//! What an experiment has shown, in figures: shares by scene, condition and estimator, and pairs of estimators.

use std::collections::BTreeMap;

use serde::Serialize;

use super::plan::Key;
use super::stats::{mcnemar, wilson};
use crate::outcome::{Outcome, TrialResult};

/// The trials of a scene and condition by one estimator.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cell {
    /// The scene's name.
    pub scene: String,
    /// The condition's name.
    pub condition: String,
    /// The estimator's name.
    pub estimator: String,
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

/// Two estimators on the same items.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Pairs {
    /// The scene's name.
    pub scene: String,
    /// The condition's name.
    pub condition: String,
    /// The estimators' names.
    pub estimators: [String; 2],
    /// Items that both were given: same seed, same place.
    pub items: usize,
    /// Packed by both, by the first alone, by the second alone, by none.
    pub counts: [usize; 4],
    /// Probability of so uneven a split by chance (McNemar, exact, two-sided).
    pub p: f64,
}

/// Trials by scene, condition and estimator, in the order of these names.
pub fn cells(trials: &[TrialResult]) -> Vec<Cell> {
    let mut groups: BTreeMap<[&str; 3], Vec<&TrialResult>> = BTreeMap::new();
    for trial in trials {
        groups.entry([&trial.scene, &trial.condition, &trial.estimator]).or_default().push(trial);
    }
    groups
        .into_iter()
        .map(|([scene, condition, estimator], trials)| {
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

/// Every two estimators on the items of each scene and condition that both were given.
pub fn pairs(trials: &[TrialResult]) -> Vec<Pairs> {
    type Items<'a> = BTreeMap<(u64, &'a str), bool>;
    let mut groups: BTreeMap<[&str; 2], BTreeMap<&str, Items<'_>>> = BTreeMap::new();
    for trial in trials {
        let Key { seed, .. } = Key::of(trial);
        let by_estimator = groups.entry([&trial.scene, &trial.condition]).or_default();
        let items = by_estimator.entry(&trial.estimator).or_default();
        items.extend(trial.items.iter().map(|i| ((seed, i.object.as_str()), i.outcome == Outcome::Packed)));
    }
    let mut found = Vec::new();
    for ([scene, condition], by_estimator) in groups {
        let estimators: Vec<_> = by_estimator.into_iter().collect();
        for (i, (first, a)) in estimators.iter().enumerate() {
            for (second, b) in &estimators[i + 1..] {
                let mut counts = [0; 4];
                for (item, packed) in a {
                    if let Some(other) = b.get(item) {
                        counts[usize::from(!packed) * 2 + usize::from(!other)] += 1;
                    }
                }
                found.push(Pairs {
                    scene: scene.into(),
                    condition: condition.into(),
                    estimators: [(*first).into(), (*second).into()],
                    items: counts.iter().sum(),
                    counts,
                    p: mcnemar(counts[1], counts[2]),
                });
            }
        }
    }
    found
}
