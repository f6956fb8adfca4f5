//! `grip estimate`: poses for every image of a data set.

use std::time::Instant;

use anyhow::Result;
use grip::benchmark::{Boxes, Estimated, FrameEstimatorKind, Run, for_dataset, frame_estimator};
use grip::workers;
use grip_perception::HypothesisRenderer;
use grip_sim::bop::Dataset;
use serde_json::{Value, json};

use super::Done;
use super::output::{self, Bar};
use crate::cli::{EstimateArgs, Hypotheses};

/// Writes the results file.
pub fn run(args: &EstimateArgs) -> Result<Done> {
    let dataset = Dataset::open(&args.dataset, args.split.as_deref())?;
    let settings = for_dataset(args.settings.load()?, &args.dataset);
    let boxes = Boxes::open(&args.boxes, &settings.perception.detector, &args.network.options())?;
    let kind = args.estimator.into();
    anyhow::ensure!(
        kind == FrameEstimatorKind::Grip || args.hypotheses != Hypotheses::Gpu,
        "--hypotheses gpu: the paper's filter renders on the CPU only; leave it out, or use --estimator grip"
    );
    let renderer = match kind {
        FrameEstimatorKind::Grip => HypothesisRenderer::open(args.hypotheses.into())?,
        _ => HypothesisRenderer::Cpu,
    };
    let hypotheses = renderer.to_string();
    let (estimator, settings) = frame_estimator(kind, &settings, renderer, false)?;
    let described = json!({
        "dataset": args.dataset,
        "split": dataset.split(),
        "boxes": args.boxes,
        "boxes_sha256": boxes.sha256(),
        "network": boxes.network(),
        "absent": args.absent,
        "seed": args.seed,
        "estimator": estimator.name(),
        "hypotheses": hypotheses,
        "settings": settings,
    });
    let run = Run {
        dataset: &dataset,
        boxes: &boxes,
        estimator: &*estimator,
        absent: args.absent as usize,
        seed: args.seed,
        settings: described.to_string(),
        jobs: args.jobs.map_or_else(workers::cores, |jobs| jobs as usize),
    };
    let progress = Bar::new("images");
    let began = Instant::now();
    let estimated = run.write(&args.out, args.resume, &progress);
    progress.finish();
    report(args, &described, &estimated?, began.elapsed().as_secs_f64())?;
    Ok(Done::Fully)
}

fn report(args: &EstimateArgs, settings: &Value, estimated: &Estimated, wall_s: f64) -> Result<()> {
    let out = &args.out;
    let Estimated { images, kept, poses, seconds } = *estimated;
    if args.json {
        let summary = json!({
            "schema": "grip.estimate/1",
            "settings": settings,
            "out": out,
            "images": images,
            "kept": kept,
            "poses": poses,
            "wall_s": (wall_s * 1e3).round() / 1e3,
            "image_s": seconds / images.max(1) as f64,
        });
        return output::data(format_args!("{}", serde_json::to_string_pretty(&summary)?));
    }
    let helped = matches!(args.boxes.as_str(), "gt" | "jittered");
    output::data(format_args!(
        "{}: {poses} poses in {images} images ({kept} more kept from before), {wall_s:.1} s, {:.0} ms an image{}{}\n\
         next: grip eval {} {}",
        out.display(),
        1e3 * seconds / images.max(1) as f64,
        if helped { "; boxes from the TRUTH" } else { "" },
        match settings["hypotheses"].as_str() {
            Some(renderer) if renderer != "cpu" => format!("; hypotheses on the {renderer}"),
            _ => String::new(),
        },
        args.dataset.display(),
        out.display(),
    ))
}
