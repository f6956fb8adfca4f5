//! `grip estimate`: poses for every image of a data set.

use std::path::Path;
use std::time::Instant;

use anyhow::Result;
use grip::benchmark::{Boxes, Estimated, FrameEstimatorKind, Run, for_dataset, frame_estimator};
use grip::workers;
use grip_perception::HypothesisRenderer;
use grip_sim::bop::Dataset;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use super::Done;
use super::output::{self, Bar};
use crate::cli::{EstimateArgs, Hypotheses};

/// Version of what `--json` prints.
pub const SCHEMA: &str = "grip.estimate/1";

/// What `--json` prints.
#[derive(Serialize, JsonSchema)]
pub struct EstimateReport<'a> {
    schema: &'static str,
    settings: &'a RunDescription<'a>,
    /// The results file.
    #[serde(serialize_with = "grip_sim::files::shown")]
    out: &'a Path,
    /// Estimated now.
    images: usize,
    /// Images that an earlier run had done.
    kept: usize,
    /// In the file.
    poses: usize,
    wall_s: f64,
    /// In the mean of the images estimated now.
    image_s: f64,
}

/// All that the poses depend on; a run that goes on must have the same.
#[derive(Serialize, JsonSchema)]
struct RunDescription<'a> {
    #[serde(serialize_with = "grip_sim::files::shown")]
    dataset: &'a Path,
    split: &'a str,
    /// Where boxes came from.
    boxes: &'a str,
    /// Of the file of boxes, where it is one.
    boxes_sha256: Option<&'a str>,
    /// The detector's, and what runs it.
    network: Option<String>,
    /// Whether objects were followed from image to image.
    track: bool,
    /// How many objects were looked for in each image that are not there.
    absent: u32,
    seed: u64,
    estimator: &'static str,
    /// Who renders hypotheses.
    hypotheses: String,
    /// The estimator's part of the tree of settings.
    settings: Value,
}

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
    anyhow::ensure!(
        kind == FrameEstimatorKind::Grip || !args.track,
        "--track: the paper's filter looks at one image at a time; leave it out, or use --estimator grip"
    );
    let renderer = match kind {
        FrameEstimatorKind::Grip => HypothesisRenderer::open(args.hypotheses.into())?,
        _ => HypothesisRenderer::Cpu,
    };
    let hypotheses = renderer.to_string();
    let again = settings.perception.grip.track.search_again;
    let (estimator, settings) = frame_estimator(kind, &settings, renderer, false)?;
    let described = RunDescription {
        dataset: &args.dataset,
        split: dataset.split(),
        boxes: &args.boxes,
        boxes_sha256: boxes.sha256(),
        network: boxes.network(),
        track: args.track,
        absent: args.absent,
        seed: args.seed,
        estimator: estimator.name(),
        hypotheses,
        settings,
    };
    let run = Run {
        dataset: &dataset,
        boxes: &boxes,
        estimator: &*estimator,
        track: args.track.then_some(again),
        absent: args.absent as usize,
        seed: args.seed,
        settings: serde_json::to_value(&described)?.to_string(),
        posteriors: args.posteriors.as_deref(),
        jobs: args.jobs.map_or_else(workers::cores, |jobs| jobs as usize),
    };
    let progress = Bar::new("images");
    let began = Instant::now();
    let estimated = run.write(&args.out, args.resume, &progress);
    progress.finish();
    report(args, &described, &estimated?, began.elapsed().as_secs_f64())?;
    Ok(Done::Fully)
}

fn report(args: &EstimateArgs, run: &RunDescription<'_>, estimated: &Estimated, wall_s: f64) -> Result<()> {
    let out = &args.out;
    let Estimated { images, kept, poses, seconds } = *estimated;
    if args.json {
        return output::json(&EstimateReport {
            schema: SCHEMA,
            settings: run,
            out,
            images,
            kept,
            poses,
            wall_s: (wall_s * 1e3).round() / 1e3,
            image_s: seconds / images.max(1) as f64,
        });
    }
    let helped = matches!(args.boxes.as_str(), "gt" | "jittered");
    output::data(format_args!(
        "{}: {poses} poses in {images} images ({kept} more kept from before), {wall_s:.1} s, {:.0} ms an image{}{}\n\
         next: grip eval {} {}",
        out.display(),
        1e3 * seconds / images.max(1) as f64,
        if helped { "; boxes from the TRUTH" } else { "" },
        match run.hypotheses.as_str() {
            "cpu" => String::new(),
            renderer => format!("; hypotheses on the {renderer}"),
        },
        args.dataset.display(),
        out.display(),
    ))
}
