//! `grip estimate`: poses for every image of a data set.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result};
use grip_perception::{
    ClusterSettings, Clusters, GripEstimator, GripSettings, HypothesisRenderer, PaperEstimator,
    PaperSettings, PlaneSettings, PoseEstimator,
};
use grip_sim::bop::Dataset;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::Done;
use crate::benchmark::{Boxes, Estimated, Run};
use crate::cli::{EstimateArgs, EstimatorChoice, Hypotheses};
use crate::{output, workers};

/// Writes the results file.
pub fn run(args: &EstimateArgs) -> Result<Done> {
    let dataset = Dataset::open(&args.dataset, args.split.as_deref())?;
    let plane = plane(&args.dataset);
    let clusters = Clusters::new(ClusterSettings { plane: plane.clone(), ..ClusterSettings::default() });
    let boxes = Boxes::open(&args.boxes, clusters, &args.network)?;
    anyhow::ensure!(
        args.estimator == EstimatorChoice::Grip || args.hypotheses != Hypotheses::Gpu,
        "--hypotheses gpu: the paper's filter renders on the CPU only; leave it out, or use --estimator grip"
    );
    let renderer = match args.estimator {
        EstimatorChoice::Grip => HypothesisRenderer::open(args.hypotheses.into())?,
        _ => HypothesisRenderer::Cpu,
    };
    let hypotheses = renderer.to_string();
    let (estimator, settings) = estimator(args.estimator, args.settings.as_deref(), plane, renderer, false)?;
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
    let progress = bar("images");
    let began = Instant::now();
    let estimated = run.write(&args.out, args.resume, &progress);
    progress.finish_and_clear();
    report(args, &described, &estimated?, began.elapsed().as_secs_f64())?;
    Ok(Done::Fully)
}

/// How the support plane is found in the images of a data set.
pub(super) fn plane(dataset: &Path) -> PlaneSettings {
    // Where up is in the world is known of our own sets alone: others leave the world's axes open.
    if dataset.join("dataset.json").is_file() {
        PlaneSettings::default()
    } else {
        PlaneSettings { max_tilt_rad: None, ..PlaneSettings::default() }
    }
}

/// The estimator that was asked for, with the changes of a settings file, and its settings.
pub(super) fn estimator(
    choice: EstimatorChoice,
    changes: Option<&Path>,
    plane: PlaneSettings,
    renderer: HypothesisRenderer,
    trace: bool,
) -> Result<(Box<dyn PoseEstimator>, Value)> {
    match choice {
        EstimatorChoice::Grip => {
            let settings =
                changed(GripSettings { plane: Some(plane), trace, ..GripSettings::default() }, changes)?;
            let shown = json!(&settings);
            Ok((Box::new(GripEstimator::new(settings)?.with_renderer(renderer)), shown))
        }
        EstimatorChoice::Paper | EstimatorChoice::PaperGuarded => {
            let settings = match choice {
                EstimatorChoice::PaperGuarded => {
                    PaperSettings { plane: Some(plane), ..PaperSettings::guarded() }
                }
                _ => PaperSettings::default(),
            };
            let settings = changed(PaperSettings { trace, ..settings }, changes)?;
            let shown = json!(&settings);
            Ok((Box::new(PaperEstimator::new(settings)?), shown))
        }
    }
}

/// `settings` with those fields that the file of `--settings` has.
fn changed<T: Serialize + DeserializeOwned>(settings: T, changes: Option<&Path>) -> Result<T> {
    let Some(path) = changes else { return Ok(settings) };
    let text = std::fs::read_to_string(path).with_context(|| format!("--settings {}", path.display()))?;
    let wrong = || format!("--settings {}: not settings of this estimator", path.display());
    let changes: serde_json::Map<String, Value> = serde_json::from_str(&text).with_context(wrong)?;
    let mut value = serde_json::to_value(settings)?;
    for (name, change) in changes {
        value[&name] = change;
    }
    serde_path_to_error::deserialize(value).with_context(wrong)
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

/// The progress of so many of these.
pub(super) fn bar(what: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(&format!(
        "{{bar:32}} {{pos}}/{{len}} {what}, {{per_sec}}, {{eta}} left"
    ));
    ProgressBar::new(0).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
