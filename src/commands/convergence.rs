//! `grip convergence`: how near the best pose is to the truth after each iteration.

use std::path::Path;

use crate::benchmark::{Boxes, Contender, Convergence, Search, SearchSummary, Searches, for_dataset};
use crate::estimators::SecondStage;
use crate::plot;
use crate::settings::Settings;
use anyhow::{Context, Result};
use grip_perception::HypothesisRenderer;
use grip_sim::bop::Dataset;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use super::Done;
use super::output::{self, Bar};
use crate::cli::{ConvergenceArgs, SearchChoice};

/// Version of what `--json` prints.
pub const SCHEMA: &str = "grip.convergence/1";

/// What `--json` prints.
#[derive(Serialize, JsonSchema)]
pub struct ConvergenceReport<'a> {
    schema: &'static str,
    #[serde(serialize_with = "grip_sim::files::shown")]
    dataset: &'a Path,
    split: &'a str,
    scene_id: u32,
    im_id: u32,
    /// Where boxes came from.
    boxes: &'a str,
    /// The figure.
    #[serde(serialize_with = "grip_sim::files::shown")]
    out: &'a Path,
    estimators: Vec<EstimatorSummary<'a>>,
    trials: &'a [Search],
}

/// An estimator and how its searches went.
#[derive(Serialize, JsonSchema)]
struct EstimatorSummary<'a> {
    name: &'a str,
    /// Its part of the tree of settings.
    settings: &'a Value,
    summary: &'a SearchSummary,
}

/// What was searched, by whom, with which settings.
pub struct Drawn {
    dataset: Dataset,
    contenders: Vec<Contender>,
    settings: Vec<Value>,
    found: Convergence,
}

/// Draws the figure and says what came out.
pub fn run(args: &ConvergenceArgs) -> Result<Done> {
    let Drawn { dataset, contenders, settings, found } = draw(args)?;
    report(args, &dataset, &contenders, &settings, &found)?;
    Ok(Done::Fully)
}

/// Draws the figure.
pub fn draw(args: &ConvergenceArgs) -> Result<Drawn> {
    plot::check_place(&args.out)?;
    anyhow::ensure!(
        args.estimator.len() <= plot::MOST_CURVES,
        "--estimator: a figure has colours for {} of them",
        plot::MOST_CURVES
    );
    let dataset = Dataset::open(&args.dataset, args.split.as_deref())?;
    let detector = for_dataset(Settings::default(), &args.dataset).perception.detector;
    let boxes = Boxes::open(&args.boxes, &detector, &args.network.options())?;
    let (mut contenders, mut settings) = (Vec::new(), Vec::new());
    for choice in &args.estimator {
        let changed = for_dataset(choice.settings.load()?, &args.dataset);
        let (estimator, used) =
            SecondStage::from(choice.estimator).open(&changed, HypothesisRenderer::Cpu, None, true)?;
        contenders.push(Contender { name: name(choice), estimator });
        settings.push(used);
    }
    let searches = Searches {
        dataset: &dataset,
        image: (args.scene, args.image),
        objects: &args.object,
        boxes: &boxes,
        seeds: 1..=args.seeds,
    };
    let progress = Bar::new("estimates");
    // On one thread, or the times of searches could not be compared.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().context("cannot start a thread")?;
    let found = pool.install(|| searches.run(&contenders, &progress));
    progress.finish();
    let found = found?;
    let title = format!("Convergence: scene {}, image {}, boxes {}", args.scene, args.image, args.boxes);
    plot::write(&found.figure(title, &contenders), &args.out)?;
    Ok(Drawn { dataset, contenders, settings, found })
}

/// In the figure: the estimator, and its settings file where it has one.
fn name(choice: &SearchChoice) -> String {
    let name = choice.estimator.name();
    let file = choice
        .settings
        .settings
        .as_ref()
        .and_then(|file| file.file_stem())
        .map(|stem| stem.to_string_lossy());
    file.map_or_else(|| name.to_owned(), |file| format!("{name} ({file})"))
}

fn report(
    args: &ConvergenceArgs,
    dataset: &Dataset,
    contenders: &[Contender],
    settings: &[Value],
    found: &Convergence,
) -> Result<()> {
    let summaries: Vec<_> = (0..contenders.len()).map(|i| found.summary(i)).collect();
    if args.json {
        let estimators = contenders
            .iter()
            .zip(settings)
            .zip(&summaries)
            .map(|((c, settings), summary)| EstimatorSummary { name: &c.name, settings, summary });
        return output::json(&ConvergenceReport {
            schema: SCHEMA,
            dataset: &args.dataset,
            split: dataset.split(),
            scene_id: args.scene,
            im_id: args.image,
            boxes: &args.boxes,
            out: &args.out,
            estimators: estimators.collect(),
            trials: &found.trials,
        });
    }
    let header = [
        "",
        "searches",
        "iterations",
        "ms",
        "hypotheses",
        "ADD-S mm",
        "ADD mm",
        "ADD-S < 5 mm",
        "nothing drawn",
    ];
    let rows = contenders.iter().zip(&summaries).map(|(contender, s)| {
        [
            contender.name.clone(),
            s.searches.to_string(),
            format!("{:.1}", s.iterations),
            format!("{:.0}", 1e3 * s.seconds),
            format!("{:.0}", s.hypotheses),
            format!("{:.1}", 1e3 * s.adds_m),
            format!("{:.1}", 1e3 * s.add_m),
            format!("{:.0} %", 100.0 * s.under_5_mm),
            s.empty.to_string(),
        ]
    });
    let helped = matches!(args.boxes.as_str(), "gt" | "jittered");
    output::data(format_args!(
        "{}\n{}: means over the searches, one thread each{}",
        output::table(header, &[1, 2, 3, 4, 5, 6, 7, 8], rows),
        args.out.display(),
        if helped { "; boxes from the TRUTH" } else { "" },
    ))
}
