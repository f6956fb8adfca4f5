//! `grip scenes`: a data set, and what to print of it.

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Result;
use grip_sim::bop::{self, Dataset};
use grip_sim::render;
use schemars::JsonSchema;
use serde::Serialize;

use super::Done;
use super::output::{self, Bar};
use crate::cli::ScenesArgs;
use crate::dataset::{self, Made, Plan, preview};
use crate::setup::{ADVERSARIAL, Setup};
use crate::{pictures, workers};

/// Version of what `--json` prints.
pub const SCHEMA: &str = "grip.scenes/1";

/// What `--json` prints.
#[derive(Serialize, JsonSchema)]
pub struct ScenesReport<'a> {
    schema: &'static str,
    /// The data set's folder.
    #[serde(serialize_with = "grip_sim::files::shown")]
    out: &'a Path,
    /// Scenes made now.
    scenes: u32,
    /// Scenes that were there before.
    kept: u32,
    /// Frames made now.
    frames: usize,
    /// Layouts thrown away.
    rejected_layouts: usize,
    wall_s: f64,
    frames_per_s: f64,
    worker_s: WorkerSeconds,
}

/// Seconds of all workers together, by what they did.
#[derive(Serialize, JsonSchema)]
struct WorkerSeconds {
    physics: f64,
    render: f64,
    sensor: f64,
    masks: f64,
    write: f64,
}

/// Makes the data set, its contact sheet, or both.
pub fn run(args: &ScenesArgs) -> Result<Done> {
    if args.preview && !args.resume && args.out.join(&args.split).is_dir() {
        return preview(&args.out, &args.split);
    }
    let mut setup = Setup::open(&args.scene.options(ADVERSARIAL, "base")?)?;
    let device = render::open(args.scene.renderer.into())?.device();
    let plan = Plan::new(&args.options(), &mut setup, device)?;
    plan.claim(&args.out, args.resume)?;
    let jobs = args.jobs.unwrap_or_else(|| workers::cores() as u32);

    let began = Instant::now();
    let progress = Bar::new("frames");
    let made = dataset::make(&setup, &plan, &args.out, jobs, args.scene.renderer.into(), &progress);
    progress.finish();
    let made = made?;
    report(args, &plan, &made, began.elapsed())?;
    if args.preview {
        preview(&args.out, &args.split)?;
    }
    Ok(Done::Fully)
}

fn report(args: &ScenesArgs, plan: &Plan, made: &Made, wall: Duration) -> Result<()> {
    let frames = made.scenes as usize * plan.views.len();
    let rate = frames as f64 / wall.as_secs_f64().max(1e-9);
    let seconds = |time: Duration| (time.as_secs_f64() * 1e3).round() / 1e3;
    let t = &made.timings;
    if args.json {
        output::json(&ScenesReport {
            schema: SCHEMA,
            out: &args.out,
            scenes: made.scenes,
            kept: made.kept,
            frames,
            rejected_layouts: made.rejected,
            wall_s: seconds(wall),
            frames_per_s: (rate * 100.0).round() / 100.0,
            worker_s: WorkerSeconds {
                physics: seconds(t.physics),
                render: seconds(t.render),
                sensor: seconds(t.sensor),
                masks: seconds(t.masks),
                write: seconds(t.write),
            },
        })?;
    } else {
        let per_frame = |time: Duration| 1e3 * time.as_secs_f64() / frames.max(1) as f64;
        output::data(format_args!(
            "{}: {} scenes made, {} kept, {frames} frames in {:.1} s, {rate:.1} frames/s; {} layouts rejected\n\
             worker time a frame, ms: physics {:.0}, render {:.0}, sensor {:.0}, masks {:.0}, write {:.0}",
            args.out.display(),
            made.scenes,
            made.kept,
            wall.as_secs_f64(),
            made.rejected,
            per_frame(t.physics),
            per_frame(t.render),
            per_frame(t.sensor),
            per_frame(t.masks),
            per_frame(t.write),
        ))?;
    }
    Ok(())
}

fn preview(out: &Path, split: &str) -> Result<Done> {
    let dataset = Dataset::open(out, Some(split))?;
    let path = out.join("preview.png");
    bop::write_atomic(&path, &pictures::rgb_png(&preview::sheet(&dataset)?)?)?;
    output::message(format_args!("contact sheet: {}", path.display()));
    Ok(Done::Fully)
}
