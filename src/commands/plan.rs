//! `grip plan`: solves motion planning problems of MotionBenchMaker and checks the solutions.

use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result, ensure};
use grip_manip::benchmark::{MotionProblem, ProblemResult, ProblemStatus, find_problems, load_problem};
use grip_manip::{Planner, Trajectory};
use grip_sim::render::{self, RendererChoice};
use grip_sim::robot::RobotModel;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::Done;
use super::output::{self, Bar};
use crate::benchmark::quantile;
use crate::cli::PlanArgs;
use crate::pictures;
use crate::progress::Progress;
use crate::run_dir::RunDir;
use crate::trajectory::TrajectoryFile;

/// Version of what `--json` prints.
pub const SCHEMA: &str = "grip.plan/1";

/// What `--json` prints.
#[derive(Serialize, JsonSchema)]
pub struct PlanReport<'a> {
    schema: &'static str,
    #[serde(serialize_with = "grip_sim::files::shown")]
    urdf: &'a Path,
    seed: u64,
    jobs: usize,
    cover: CoverSummary,
    /// Of each set, and of all.
    summary: &'a [Summary],
    problems: &'a [ProblemResult],
}

/// The balls that cover the robot.
#[derive(Serialize, JsonSchema)]
struct CoverSummary {
    balls: usize,
    /// How far they stick out at most, metres.
    worst_m: f64,
    /// And in the mean, metres.
    mean_m: f64,
}

/// All problems of a folder, or those of a run.
#[derive(Debug, Serialize, JsonSchema)]
struct Summary {
    /// The folder's name, or `all`.
    set: String,
    problems: usize,
    /// Start and goal are free in our model.
    valid: usize,
    solved: usize,
    /// Of the solved: search and shortening together, milliseconds. Null where none is solved, as what follows.
    median_ms: Option<f64>,
    mean_ms: Option<f64>,
    p95_ms: Option<f64>,
    max_ms: Option<f64>,
    /// Medians of the parts, milliseconds: search, shortening, timing.
    parts_ms: [Option<f64>; 3],
    /// Median length of the shortened path, norm of joint values.
    median_length: Option<f64>,
    /// Median duration of the trajectory, seconds.
    median_duration_s: Option<f64>,
}

/// Solves, checks and prints.
pub fn run(args: &PlanArgs) -> Result<Done> {
    let folder = args.out.as_deref().map(RunDir::begin).transpose()?;
    let (urdf, robot, config) = args.robot.load()?;
    let (robot, config) = (Arc::new(robot), Arc::new(config));
    let problems = find_problems(&args.problems)?
        .iter()
        .map(|(request, scene)| load_problem(request, scene, &robot, &config))
        .collect::<Result<Vec<_>, _>>()?;
    let settings = args.settings.load()?.for_robot(&config);
    let hand = config.gripper.link;
    let planner = Planner::new(robot.clone(), config, settings.planner);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(args.jobs)
        .build()
        .context("cannot start the workers; try --jobs 1")?;
    let progress = Bar::new("problems");
    progress.begin(problems.len() as u64, 0);
    let (results, trajectories): (Vec<ProblemResult>, Vec<Option<Trajectory>>) = pool.install(|| {
        problems
            .par_iter()
            .map(|problem| {
                let solved = planner.solve(problem, args.seed);
                progress.advance(1);
                solved
            })
            .unzip()
    });
    progress.finish();

    let mut sets: Vec<&str> = results.iter().map(set_of).collect();
    sets.dedup();
    let mut summaries: Vec<Summary> =
        sets.iter().map(|set| summary(set, results.iter().filter(|r| set_of(r) == *set))).collect();
    summaries.push(summary("all", results.iter()));
    let cover = planner.robot().cover();
    let report = PlanReport {
        schema: SCHEMA,
        urdf: &urdf,
        seed: args.seed,
        jobs: args.jobs,
        cover: CoverSummary { balls: cover.balls, worst_m: cover.worst, mean_m: cover.mean },
        summary: &summaries,
        problems: &results,
    };
    if let Some(folder) = folder {
        folder.write("plan.json", serde_json::to_string_pretty(&report)?)?;
        let solved = problems.iter().zip(&trajectories).filter_map(|(p, t)| Some((p, t.as_ref()?)));
        save(&folder, &robot, hand, solved)?;
        let folder = folder.finish().context("--out")?;
        output::message(format_args!("trajectories: {}", folder.display()));
    }
    if args.json {
        output::json(&report)?;
    } else {
        output::data(format_args!("{}\n", table(&summaries)))?;
        output::data(format_args!(
            "robot covered by {} balls that stick out {:.0} mm in the mean and {:.0} mm at most; what touches one is checked exactly",
            cover.balls,
            1e3 * cover.mean,
            1e3 * cover.worst
        ))?;
        for r in results.iter().filter(|r| r.status != ProblemStatus::Solved) {
            output::data(format_args!("{}: {}", r.name, r.reason.as_deref().unwrap_or("no path")))?;
        }
    }
    let valid =
        |r: &&ProblemResult| !matches!(r.status, ProblemStatus::InvalidStart | ProblemStatus::InvalidGoal);
    let all = results.iter().filter(valid).all(|r| r.status == ProblemStatus::Solved);
    Ok(if all { Done::Fully } else { Done::Short })
}

/// Each solved problem's trajectory: JSON, ROS's YAML and a picture.
fn save<'a>(
    folder: &RunDir,
    robot: &RobotModel,
    hand: usize,
    solved: impl Iterator<Item = (&'a MotionProblem, &'a Trajectory)>,
) -> Result<()> {
    let mut renderer = render::open(RendererChoice::Auto)?;
    let mut names = HashSet::new();
    for (problem, trajectory) in solved {
        let name = &problem.name;
        ensure!(
            names.insert(name),
            "two problems are called {name}; name a folder with one of them, or do without --out"
        );
        let file = TrajectoryFile::new(name, robot, trajectory);
        folder.write(&format!("{name}.json"), serde_json::to_string(&file)?)?;
        folder.write(&format!("{name}.yaml"), file.to_ros_yaml())?;
        let picture = pictures::plan(robot, hand, problem, trajectory, renderer.as_mut())?;
        folder.write(&format!("{name}.png"), pictures::rgb_png(&picture)?)?;
    }
    Ok(())
}

fn set_of(result: &ProblemResult) -> &str {
    result.name.split('/').next().unwrap_or_default()
}

fn summary<'a>(set: &str, results: impl Iterator<Item = &'a ProblemResult> + Clone) -> Summary {
    let solved: Vec<&ProblemResult> = results.clone().filter(|r| r.status == ProblemStatus::Solved).collect();
    let invalid =
        |r: &&ProblemResult| matches!(r.status, ProblemStatus::InvalidStart | ProblemStatus::InvalidGoal);
    let sorted = |f: &dyn Fn(&ProblemResult) -> f64| {
        let mut values: Vec<f64> = solved.iter().map(|r| f(r)).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let quantile = |values: &[f64], q| (!values.is_empty()).then(|| quantile(values, q));
    let total = sorted(&|r| r.search_ms + r.simplify_ms);
    let problems = results.clone().count();
    Summary {
        set: set.to_string(),
        problems,
        valid: problems - results.filter(invalid).count(),
        solved: solved.len(),
        median_ms: quantile(&total, 0.5),
        mean_ms: (!total.is_empty()).then(|| total.iter().sum::<f64>() / total.len() as f64),
        p95_ms: quantile(&total, 0.95),
        max_ms: total.last().copied(),
        parts_ms: [
            quantile(&sorted(&|r| r.search_ms), 0.5),
            quantile(&sorted(&|r| r.simplify_ms), 0.5),
            quantile(&sorted(&|r| r.timing_ms), 0.5),
        ],
        median_length: quantile(&sorted(&|r| r.path_length[1]), 0.5),
        median_duration_s: quantile(&sorted(&|r| r.duration_s), 0.5),
    }
}

fn table(summaries: &[Summary]) -> String {
    let header = [
        "problems",
        "all",
        "valid",
        "solved",
        "median ms",
        "mean",
        "p95",
        "max",
        "search",
        "shorten",
        "timing",
        "length",
        "motion s",
    ];
    let right: Vec<usize> = (1..header.len()).collect();
    let rows = summaries.iter().map(|s| {
        let shown =
            |value: Option<f64>, digits: usize| value.map_or("-".to_owned(), |v| format!("{v:.digits$}"));
        let ms = |value| shown(value, 2);
        [
            s.set.clone(),
            s.problems.to_string(),
            s.valid.to_string(),
            s.solved.to_string(),
            ms(s.median_ms),
            ms(s.mean_ms),
            ms(s.p95_ms),
            ms(s.max_ms),
            ms(s.parts_ms[0]),
            ms(s.parts_ms[1]),
            ms(s.parts_ms[2]),
            ms(s.median_length),
            shown(s.median_duration_s, 1),
        ]
    });
    output::table(header, &right, rows)
}
