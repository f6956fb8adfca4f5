//! `grip estimate`: poses for every image of a data set.

use std::path::Path;
use std::time::Instant;

use crate::benchmark::{Boxes, Estimated, FrameEstimator, Run, asked_models, for_dataset};
use crate::estimators::{EstimatorKind, External, Perception, SecondStage};
use crate::workers;
use anyhow::Result;
use grip_perception::{HypothesisRenderer, PoseEstimator};
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
    #[schemars(with = "RunDescription<'_>")]
    settings: &'a Value,
    /// The results file.
    #[serde(serialize_with = "grip_sim::files::shown")]
    out: &'a Path,
    /// Estimated now.
    images: usize,
    /// Images that an earlier run had done.
    kept: usize,
    /// In the file.
    poses: usize,
    /// Images, of those estimated now, in which the estimator did wrong.
    failed: usize,
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
    /// Boxes of a lower confidence did not count, nor objects of which none was left.
    min_confidence: f64,
    /// Whether objects were followed from image to image.
    track: bool,
    /// How many objects were looked for in each image that are not there.
    absent: u32,
    seed: u64,
    estimator: String,
    /// Who renders hypotheses.
    hypotheses: String,
    /// The estimator's part of the tree of settings.
    settings: Value,
}

/// Who estimates.
enum Who {
    Ours(Box<dyn PoseEstimator>),
    Program(Box<External>),
}

/// All that estimates depend on, opened.
pub struct Opened {
    /// The images.
    pub dataset: Dataset,
    boxes: Boxes,
    estimator: Who,
    /// After how many images of a sequence boxes are looked for again at the latest, where objects are followed.
    pub track: Option<usize>,
    description: Value,
}

impl Opened {
    /// What poses depend on, as JSON.
    pub fn description(&self) -> &Value {
        &self.description
    }

    /// A run over all images.
    pub fn run<'a>(&'a self, args: &'a EstimateArgs) -> Run<'a> {
        Run {
            dataset: &self.dataset,
            boxes: &self.boxes,
            estimator: match &self.estimator {
                Who::Ours(estimator) => FrameEstimator::Ours(&**estimator),
                Who::Program(program) => FrameEstimator::Program(program),
            },
            track: self.track,
            absent: args.absent as usize,
            seed: args.seed,
            settings: self.description.to_string(),
            posteriors: args.posteriors.as_deref(),
            only: None,
            jobs: args.jobs.map_or_else(workers::cores, |jobs| jobs as usize),
        }
    }
}

/// Writes the results file.
pub fn run(args: &EstimateArgs) -> Result<Done> {
    let opened = open(args)?;
    let progress = Bar::new("images");
    let began = Instant::now();
    let estimated = opened.run(args).write(&args.out, args.resume, &progress);
    progress.finish();
    report(args, &opened, &estimated?, began.elapsed().as_secs_f64())?;
    Ok(Done::Fully)
}

/// Opens all that the options name.
pub fn open(args: &EstimateArgs) -> Result<Opened> {
    let dataset = Dataset::open(&args.dataset, args.split.as_deref())?;
    let settings = for_dataset(args.settings.load()?, &args.dataset);
    let ours = args.estimator == EstimatorKind::Grip;
    anyhow::ensure!(
        ours || args.hypotheses != Hypotheses::Gpu,
        "--hypotheses gpu: is for --estimator grip; leave it out"
    );
    anyhow::ensure!(
        ours || !args.track,
        "--track: other estimators look at one image at a time; leave it out, or use --estimator grip"
    );
    let program = matches!(args.estimator, EstimatorKind::Command { .. } | EstimatorKind::Given(_));
    let boxes_from = args.boxes.as_deref().unwrap_or(if program { "none" } else { "pyramid" });
    let boxes = Boxes::open(boxes_from, &settings.perception.detector, &args.network.options())?;
    let renderer =
        if ours { HypothesisRenderer::open(args.hypotheses.into())? } else { HypothesisRenderer::Cpu };
    let hypotheses = renderer.to_string();
    let again = settings.perception.grip.track.search_again;
    let (estimator, settings) = match (&args.estimator, args.estimator.second_stage()) {
        (_, Some(stage)) => {
            let (estimator, settings) = SecondStage::open(stage, &settings, renderer, None, false)?;
            (Who::Ours(estimator), settings)
        }
        (EstimatorKind::Command { command, .. }, _) => {
            let models = asked_models(&dataset, args.absent as usize, args.seed)?;
            let program = External::for_images(command, settings.trial.estimator_timeout_s, models)?;
            let description = program.description();
            (Who::Program(Box::new(program)), description)
        }
        (EstimatorKind::Given(given), _) => {
            let description = given.who.description();
            (Who::Program(Box::new(External::given_for_images(given.who.clone()))), description)
        }
        (other, _) => anyhow::bail!(
            "--estimator {}: has nothing to say of a data set; give grip, paper, paper-guarded or cmd:PROGRAM (grip eval \
             measures a results file)",
            other.name()
        ),
    };
    let described = RunDescription {
        dataset: &args.dataset,
        split: dataset.split(),
        boxes: boxes_from,
        boxes_sha256: boxes.sha256(),
        network: boxes.network(),
        min_confidence: boxes.min_confidence(),
        track: args.track,
        absent: args.absent,
        seed: args.seed,
        estimator: args.estimator.name(),
        hypotheses,
        settings,
    };
    let description = serde_json::to_value(&described)?;
    let track = args.track.then_some(again);
    Ok(Opened { dataset, boxes, estimator, track, description })
}

fn report(args: &EstimateArgs, opened: &Opened, estimated: &Estimated, wall_s: f64) -> Result<()> {
    let text = |field: &str| opened.description[field].as_str().unwrap_or_default();
    let out = &args.out;
    let Estimated { images, kept, poses, seconds, failed } = *estimated;
    if args.json {
        return output::json(&EstimateReport {
            schema: SCHEMA,
            settings: &opened.description,
            out,
            images,
            kept,
            poses,
            failed,
            wall_s: (wall_s * 1e3).round() / 1e3,
            image_s: seconds / images.max(1) as f64,
        });
    }
    let helped = matches!(text("boxes"), "gt" | "jittered");
    output::data(format_args!(
        "{}: {poses} poses in {images} images ({kept} more kept from before), {wall_s:.1} s, {:.0} ms an image{}{}{}\n\
         next: grip eval {} {}",
        out.display(),
        1e3 * seconds / images.max(1) as f64,
        match failed {
            0 => String::new(),
            failed => format!("; {failed} without poses, for the estimator did wrong"),
        },
        if helped { "; boxes from the TRUTH" } else { "" },
        match text("hypotheses") {
            "cpu" => String::new(),
            renderer => format!("; hypotheses on the {renderer}"),
        },
        args.dataset.display(),
        out.display(),
    ))
}
