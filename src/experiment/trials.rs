//! Runs the trials of an experiment that are not done yet, on as many threads as asked for.
//!
//! A trial depends on its own scene, condition, estimator, grasp planner and seed alone, so that its result is the same on any thread, in
//! any order and in any shard.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard};

use anyhow::{Result, ensure};
use grip_sim::bop;
use grip_sim::render::{self, RendererChoice};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::journal::{self, Journal};
use super::plan::{Case, Key, LEFT_OUT, Plan, Stage, TIMINGS, TRIALS};
use crate::pictures;
use crate::progress::{Part, Progress};
use crate::score::outcome::{Timing, TrialResult};
use crate::trial::{self, Pictures, TrialOptions, film};
use crate::workers::{self, Stop};

/// How long a trial took: a line of timings.jsonl.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TimingLine {
    /// Which trial.
    #[serde(flatten)]
    pub key: Key,
    /// Wall times.
    #[serde(flatten)]
    pub timing: Timing,
}

/// A trial without a result, because its objects could not be laid out: a line of left_out.jsonl.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LeftOut {
    /// Which trial.
    #[serde(flatten)]
    pub key: Key,
    /// What was tried.
    pub reason: String,
}

/// What is written as trials end.
struct Journals {
    trials: Journal,
    timings: Journal,
    skipped: Journal,
    done: Vec<TrialResult>,
    left_out: Vec<LeftOut>,
}

/// What an experiment has come to.
pub struct Ran {
    /// All results, in their order.
    pub results: Vec<TrialResult>,
    /// How many of them were there before.
    pub kept: usize,
    /// Trials without a result, in their order.
    pub left_out: Vec<LeftOut>,
}

/// Runs what `out` lacks of the plan, in `jobs` threads. A trial whose objects cannot be laid out is left out with a warning.
///
/// # Errors
/// When a trial cannot be run, or a result cannot be written; results that are written by then stay.
pub fn run(
    plan: &Plan,
    out: &Path,
    jobs: usize,
    renderer: RendererChoice,
    progress: &dyn Progress,
) -> Result<Ran> {
    run_cases(plan, &plan.cases(), out, jobs, renderer, progress)
}

/// The same of some of the plan's trials.
///
/// # Errors
/// As [`run`].
pub fn run_cases(
    plan: &Plan,
    cases: &[Case],
    out: &Path,
    jobs: usize,
    renderer: RendererChoice,
    progress: &dyn Progress,
) -> Result<Ran> {
    let (trials, done) = Journal::open::<TrialResult>(&out.join(TRIALS))?;
    let (timings, _) = Journal::open::<TimingLine>(&out.join(TIMINGS))?;
    let (skipped, left_out) = Journal::open::<LeftOut>(&out.join(LEFT_OUT))?;
    let known: BTreeSet<Key> =
        done.iter().map(Key::of).chain(left_out.iter().map(|line| line.key.clone())).collect();
    let missing: Vec<&Case> = cases.iter().filter(|case| !known.contains(&case.key)).collect();
    let kept = done.len();
    progress.begin(cases.len() as u64, known.len() as u64);

    let next = AtomicUsize::new(0);
    let journals = Mutex::new(Journals { trials, timings, skipped, done, left_out });
    let worker = |stop: &Stop<'_>| {
        let mut renderer = render::open(renderer)?;
        ensure!(
            renderer.name() == plan.renderer,
            "the graphics adapter cannot be opened once for each of {jobs} jobs; give fewer --jobs, or --renderer cpu"
        );
        while !stop.is_asked_for() {
            let Some(case) = missing.get(next.fetch_add(1, Ordering::Relaxed)) else { break };
            let Key { seed, estimator, .. } = &case.key;
            let Stage { planner, estimators, graspers, .. } = &plan.stages[case.scene];
            let setup = plan.setup(case);
            let film_all = *seed == plan.first_seed;
            let options = TrialOptions {
                estimator: estimator.clone(),
                grasper: graspers[case.grasper].clone(),
                items: None,
                grasps: plan.grasps.clone(),
                pictures: match (plan.films, film_all) {
                    (false, _) => Pictures::None,
                    (true, true) => Pictures::Film,
                    (true, false) => Pictures::FilmOfFailures,
                },
                record: plan.record,
            };
            let estimator = &estimators[case.estimator];
            let ran = trial::run(&setup, estimator, planner, renderer.as_mut(), options, &Part(progress));
            let which = || {
                let Key { seed, scene, condition, .. } = &case.key;
                format!("scene {scene}, condition {condition}, {}, seed {seed}", case.key.method())
            };
            let trial = match ran {
                Ok(trial) => trial,
                Err(error) if matches!(error.downcast_ref(), Some(grip_physics::Error::NoLayout(_))) => {
                    progress.warn(&format!("left out: {}: {error}", which()));
                    let line = LeftOut { key: case.key.clone(), reason: error.to_string() };
                    let mut journals = lock(&journals);
                    journals.skipped.append(&line)?;
                    journals.left_out.push(line);
                    progress.advance(1);
                    continue;
                }
                Err(error) => return Err(error.context(which())),
            };
            if !trial.strips.is_empty() {
                let film = pictures::jpeg(&film::sheet(&trial.strips))?;
                bop::write_atomic(&out.join(case.key.film()), &film)?;
            }
            if let Some(recording) = &trial.recording {
                recording.write(&out.join(case.key.record()))?;
            }
            let mut result = trial.result;
            let timing = result.timing.take();
            let mut journals = lock(&journals);
            // The result last: with it the trial is done.
            if let Some(timing) = timing {
                journals.timings.append(&TimingLine { key: case.key.clone(), timing })?;
            }
            journals.trials.append(&result)?;
            journals.done.push(result);
            progress.message(&so_far(&journals.done));
            progress.advance(1);
        }
        Ok(())
    };
    workers::run(jobs.clamp(1, missing.len().max(1)), progress, worker)?;

    let Journals { trials, timings, skipped, done: mut results, mut left_out } =
        journals.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    results.sort_by_key(Key::of);
    left_out.sort_by(|a, b| a.key.cmp(&b.key));
    // In order of the trials, not of their ends: the same bytes from every run.
    journal::write_whole(&out.join(TRIALS), &results)?;
    journal::write_whole(&out.join(LEFT_OUT), &left_out)?;
    let mut seconds: BTreeMap<Key, TimingLine> = BTreeMap::new();
    let lines = journal::read::<TimingLine>(&out.join(TIMINGS))?;
    seconds.extend(lines.into_iter().map(|line| (line.key.clone(), line)));
    journal::write_whole(&out.join(TIMINGS), &seconds.into_values().collect::<Vec<_>>())?;
    drop((trials, timings, skipped));
    Ok(Ran { results, kept, left_out })
}

fn lock(journals: &Mutex<Journals>) -> MutexGuard<'_, Journals> {
    journals.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// Shares of items packed until now, by estimator and grasp planner.
fn so_far(done: &[TrialResult]) -> String {
    let methods: BTreeSet<String> = done.iter().map(TrialResult::method).collect();
    let shares: Vec<String> = methods
        .into_iter()
        .map(|method| {
            let of = done.iter().filter(|trial| trial.method() == method);
            let (packed, requested) =
                of.fold((0, 0), |(packed, requested), t| (packed + t.packed, requested + t.requested));
            format!("{method} {:.1} % packed", 100.0 * packed as f64 / requested.max(1) as f64)
        })
        .collect();
    shares.join(", ")
}
