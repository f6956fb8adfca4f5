//! `grip trials`: an experiment of many trials, and what to print of it.

use std::time::Instant;

use anyhow::{Result, bail};
use grip_sim::render;
use schemars::JsonSchema;
use serde::Serialize;

use super::Done;
use super::output::{self, Bar};
use crate::cli::TrialsArgs;
use crate::experiment::items;
use crate::experiment::plan::Plan;
use crate::experiment::report::p_value;
use crate::experiment::summary::{Cell, Pairs, cells, pairs};
use crate::experiment::trials::{self, LeftOut, Ran};
use crate::score::outcome::TrialResult;
use crate::workers;

/// Version of what `--json` prints.
pub const SUMMARY_SCHEMA: &str = "grip.experiment.summary/1";

/// What `--json` prints.
#[derive(Serialize, JsonSchema)]
pub struct ExperimentSummary {
    schema: &'static str,
    trials: usize,
    /// Of each scene, condition, estimator and grasp planner.
    cells: Vec<Cell>,
    /// Of each two estimators or grasp planners of the same trials.
    pairs: Vec<Pairs>,
}

/// Runs what is missing, prints the figures of all.
pub fn run(args: &TrialsArgs) -> Result<Done> {
    let began = Instant::now();
    // Its name alone: every thread opens its own.
    let renderer = render::open(args.renderer.into())?.name();
    let plan = Plan::new(&args.options()?, renderer)?;
    plan.begin(&args.out, args.resume)?;
    let progress = Bar::new("trials");
    let jobs = args.jobs.map_or_else(workers::cores, |jobs| jobs as usize);
    let done = trials::run(&plan, &args.out, jobs, args.renderer.into(), &progress);
    progress.finish();
    let Ran { results, kept, left_out } = done?;
    if let (true, Some(LeftOut { key, reason })) = (results.is_empty(), left_out.first()) {
        bail!("seed {}, scene {}, condition {}: {reason}", key.seed, key.scene, key.condition);
    }
    items::write(&results, &args.out)?;
    print(&results, args.json)?;
    let (run, seconds) = (results.len() - kept, began.elapsed().as_secs_f64());
    let hourly = 3600.0 * run as f64 / seconds.max(1e-9);
    output::message(format_args!(
        "{run} trials in {seconds:.0} s, {hourly:.0} an hour, {kept} kept from before: {}",
        args.out.display()
    ));
    if !left_out.is_empty() {
        output::message(format_args!(
            "{} trials have no result: the scene's objects could not be laid out from their seeds",
            left_out.len()
        ));
        return Ok(Done::Short);
    }
    Ok(Done::Fully)
}

/// The figures of an experiment: a table, or JSON.
pub fn print(results: &[TrialResult], json: bool) -> Result<()> {
    let (cells, pairs) = (cells(results), pairs(results));
    if json {
        let trials = results.len();
        return output::json(&ExperimentSummary { schema: SUMMARY_SCHEMA, trials, cells, pairs });
    }
    let percent = |share: f64| format!("{:.1}", 100.0 * share);
    let rows = cells.iter().map(|cell| {
        let failures: Vec<String> = cell.failures.iter().map(|(what, n)| format!("{n} {what}")).collect();
        [
            cell.scene.clone(),
            cell.condition.clone(),
            cell.method(),
            cell.trials.to_string(),
            cell.full.to_string(),
            format!("{} of {}", cell.packed, cell.items),
            percent(cell.share),
            cell.interval.map(percent).join("-"),
            failures.join(", "),
        ]
    });
    let header =
        ["scene", "condition", "estimator", "trials", "full", "items packed", "%", "95 %", "failures"];
    output::data(format_args!("{}", output::table(header, &[3, 4, 5, 6, 7], rows)))?;
    if cells.iter().any(|cell| cell.estimator == "truth") {
        output::data(format_args!("[estimator truth: a ceiling and no result]"))?;
    }
    for pair in &pairs {
        let [both, first, second, none] = pair.counts;
        let [a, b] = &pair.estimators;
        output::data(format_args!(
            "{} {}: of {} items {a} and {b} both pack {both}, {a} alone {first}, {b} alone {second}, none {none}; \
             McNemar p {}",
            pair.scene,
            pair.condition,
            pair.items,
            p_value(pair.p)
        ))?;
    }
    let collisions: usize = cells.iter().map(|cell| cell.collisions).sum();
    if collisions > 0 {
        output::data(format_args!(
            "{collisions} motions were found in collision: see motion_check in trials.jsonl"
        ))?;
    }
    Ok(())
}
