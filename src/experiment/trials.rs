//! Runs the trials of an experiment that are not done yet, on as many threads as asked for.
//!
//! A trial depends on its own scene, condition, estimator and seed alone, so that its result is the same on any thread, in
//! any order and in any shard.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use anyhow::{Context, Result, ensure};
use grip_sim::bop;
use grip_sim::render::{self, RendererChoice};
use indicatif::ProgressBar;
use serde::{Deserialize, Serialize};

use super::journal::{self, Journal};
use super::plan::{Case, Key, Plan, Stage, TIMINGS, TRIALS};
use crate::outcome::{Timing, TrialResult};
use crate::trial::{self, Pictures, Spec};
use crate::{film, pictures};

/// How long a trial took: a line of timings.jsonl.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TimingLine {
    /// Which trial.
    #[serde(flatten)]
    pub key: Key,
    /// Wall times.
    #[serde(flatten)]
    pub timing: Timing,
}

/// What is written as trials end.
struct Ledger {
    trials: Journal,
    timings: Journal,
    done: Vec<TrialResult>,
}

/// Runs what `out` lacks of the plan, in `jobs` threads; returns all results in their order, and how many were there before.
///
/// # Errors
/// When a trial cannot be run, or a result cannot be written; results that are written by then stay.
pub fn run(
    plan: &Plan,
    out: &Path,
    jobs: usize,
    renderer: RendererChoice,
    progress: &ProgressBar,
) -> Result<(Vec<TrialResult>, usize)> {
    let (trials, done) = Journal::open::<TrialResult>(&out.join(TRIALS))?;
    let (timings, _) = Journal::open::<TimingLine>(&out.join(TIMINGS))?;
    let known: BTreeSet<Key> = done.iter().map(Key::of).collect();
    let missing: Vec<&Case> = plan.cases.iter().filter(|case| !known.contains(&case.key)).collect();
    let kept = done.len();
    progress.set_length(plan.cases.len() as u64);
    progress.set_position(kept as u64);
    progress.reset_eta();

    let next = AtomicUsize::new(0);
    let stop = AtomicBool::new(false);
    let ledger = Mutex::new(Ledger { trials, timings, done });
    let worker = || -> Result<()> {
        let mut renderer = render::open(renderer)?;
        ensure!(
            renderer.name() == plan.options.renderer,
            "the graphics adapter cannot be opened once for each of {jobs} jobs; give fewer --jobs, or --renderer cpu"
        );
        let _stop_others = StopOnPanic(&stop);
        while !stop.load(Ordering::Relaxed) {
            let Some(case) = missing.get(next.fetch_add(1, Ordering::Relaxed)) else { break };
            let Key { seed, scene, condition, estimator } = &case.key;
            let setup = plan.setup(case);
            let film_all = *seed == plan.first_seed;
            let spec = Spec {
                estimator: estimator.clone(),
                items: setup.models.len(),
                pictures: if film_all { Pictures::Film } else { Pictures::FilmOfFailures },
            };
            let Stage { planner, perceptions, .. } = &plan.stages[case.scene];
            let perception = &perceptions[case.estimator];
            let quiet = ProgressBar::hidden();
            let trial =
                trial::run(&setup, &spec, &plan.options, planner, perception, renderer.as_mut(), &quiet)
                    .with_context(|| {
                        format!("scene {scene}, condition {condition}, {estimator}, seed {seed}")
                    })?;
            if !trial.strips.is_empty() {
                let film = pictures::jpeg(&film::sheet(&trial.strips))?;
                bop::write_atomic(&out.join(case.key.film()), &film)?;
            }
            let mut result = trial.result;
            let timing = result.timing.take();
            let mut ledger = ledger.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            // The result last: with it the trial is done.
            if let Some(timing) = timing {
                ledger.timings.append(&TimingLine { key: case.key.clone(), timing })?;
            }
            ledger.trials.append(&result)?;
            ledger.done.push(result);
            progress.set_message(so_far(&ledger.done));
            progress.inc(1);
        }
        Ok(())
    };
    let workers = jobs.clamp(1, missing.len().max(1));
    std::thread::scope(|scope| {
        let handles: Vec<_> = (0..workers)
            .map(|_| scope.spawn(|| worker().inspect_err(|_| stop.store(true, Ordering::Relaxed))))
            .collect();
        handles.into_iter().try_for_each(|handle| match handle.join() {
            Ok(result) => result,
            Err(panic) => std::panic::resume_unwind(panic),
        })
    })?;

    let Ledger { trials, timings, mut done } =
        ledger.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    done.sort_by_key(Key::of);
    // In order of the trials, not of their ends: the same bytes from every run.
    journal::write_whole(&out.join(TRIALS), &done)?;
    let mut seconds: BTreeMap<Key, TimingLine> = BTreeMap::new();
    let lines = journal::read::<TimingLine>(&out.join(TIMINGS))?;
    seconds.extend(lines.into_iter().map(|line| (line.key.clone(), line)));
    journal::write_whole(&out.join(TIMINGS), &seconds.into_values().collect::<Vec<_>>())?;
    drop((trials, timings));
    Ok((done, kept))
}

/// Has the other threads stop when this one panics, rather than at the end of all work.
pub struct StopOnPanic<'a>(pub &'a AtomicBool);

impl Drop for StopOnPanic<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.store(true, Ordering::Relaxed);
        }
    }
}

/// Shares of items packed until now, by estimator.
fn so_far(done: &[TrialResult]) -> String {
    let estimators: BTreeSet<&str> = done.iter().map(|trial| trial.estimator.as_str()).collect();
    let shares: Vec<String> = estimators
        .into_iter()
        .map(|estimator| {
            let of = done.iter().filter(|trial| trial.estimator == estimator);
            let (packed, requested) =
                of.fold((0, 0), |(packed, requested), t| (packed + t.packed, requested + t.requested));
            format!("{estimator} {:.1} % packed", 100.0 * packed as f64 / requested.max(1) as f64)
        })
        .collect();
    shares.join(", ")
}
