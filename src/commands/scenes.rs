//! `grip scenes`: a data set, and what to print of it.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use grip_sim::bop::{self, Dataset};
use grip_sim::objects::ObjectModel;
use grip_sim::render;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::Done;
use crate::cli::ScenesArgs;
use crate::dataset::{self, Made, Plan, preview};
use crate::setup::Setup;
use crate::{output, pictures};

/// Makes the data set, its contact sheet, or both.
pub fn run(args: &ScenesArgs) -> Result<Done> {
    if args.preview && !args.resume && args.out.join(&args.split).is_dir() {
        return preview(&args.out, &args.split);
    }
    let mut setup = Setup::open(&args.scene, "scenes/adversarial.toml", "base")?;
    if !args.objects.is_empty() {
        choose(&mut setup, &args.objects)?;
    }
    let device = render::open(args.scene.renderer.into())?.device();
    let plan = Plan::new(args, &setup, device)?;
    plan.claim(&args.out, args.resume)?;
    let jobs = args.jobs.unwrap_or_else(|| crate::workers::cores() as u32);

    let began = Instant::now();
    let progress = bar();
    let made = dataset::make(&setup, &plan, &args.out, jobs, args.scene.renderer.into(), &progress);
    progress.finish_and_clear();
    let made = made?;
    report(args, &plan, &made, began.elapsed())?;
    if args.preview {
        preview(&args.out, &args.split)?;
    }
    Ok(Done::Fully)
}

/// Reduces the scene to the objects named.
fn choose(setup: &mut Setup, names: &[String]) -> Result<()> {
    let models: Vec<Arc<ObjectModel>> =
        names.iter().map(|name| setup.library.load(name).context("--objects")).collect::<Result<_>>()?;
    for (i, name) in names.iter().enumerate() {
        anyhow::ensure!(
            !names[..i].contains(name),
            "--objects: '{name}' stands twice; each object may stand once"
        );
    }
    if let Some(count) = &mut setup.scene.objects.count {
        count.min = count.min.min(names.len());
        count.max = count.max.min(names.len());
    }
    setup.scene.objects.names = names.to_vec();
    setup.scene.objects.placed.retain(|placed| names.contains(&placed.name));
    setup.models = models;
    Ok(())
}

fn report(args: &ScenesArgs, plan: &Plan, made: &Made, wall: Duration) -> Result<()> {
    let frames = made.scenes as usize * plan.views.len();
    let rate = frames as f64 / wall.as_secs_f64().max(1e-9);
    let seconds = |time: Duration| (time.as_secs_f64() * 1e3).round() / 1e3;
    let t = &made.timings;
    if args.json {
        let summary = json!({
            "schema": "grip.scenes/1",
            "out": args.out,
            "scenes": made.scenes,
            "kept": made.kept,
            "frames": frames,
            "rejected_layouts": made.rejected,
            "wall_s": seconds(wall),
            "frames_per_s": (rate * 100.0).round() / 100.0,
            "worker_s": {
                "physics": seconds(t.physics),
                "render": seconds(t.render),
                "sensor": seconds(t.sensor),
                "masks": seconds(t.masks),
                "write": seconds(t.write),
            },
        });
        output::data(format_args!("{}", serde_json::to_string_pretty(&summary)?))?;
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

fn bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:32} {pos}/{len} frames, {per_sec}, {eta} left");
    ProgressBar::new(0).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
