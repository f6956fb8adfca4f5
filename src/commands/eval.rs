//! `grip eval`: errors of results files, anyone's, against the truth of their data set.

use std::path::Path;

use anyhow::Result;
use grip_perception::metrics::ErrorKind;
use grip_sim::bop::results::read_results;
use grip_sim::bop::{self, Dataset};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use super::Done;
use super::output;
use crate::benchmark::{
    Area, Case, Credibilities, Credibility, Evaluation, Figures, Lacking, METHODS, PaperTable, Presence,
    Recall, accuracy_figure, credibility, evaluate, object_title,
};
use crate::cli::EvalArgs;
use crate::plot;

/// Version of what `--json` prints.
pub const SCHEMA: &str = "grip.eval/1";

/// What `--json` prints of a results file; of several a list of them.
#[derive(Serialize, JsonSchema)]
pub struct EvalReport<'a> {
    schema: &'static str,
    #[serde(serialize_with = "grip_sim::files::shown")]
    dataset: &'a Path,
    split: &'a str,
    #[serde(serialize_with = "grip_sim::files::shown")]
    results: &'a Path,
    /// Ends of the two areas under a curve, metres.
    thresholds_m: [f64; 2],
    #[serde(flatten)]
    evaluation: &'a Evaluation,
    /// With `--paper`.
    #[serde(skip_serializing_if = "Option::is_none")]
    paper: Option<&'a PaperTable>,
    /// With `--posteriors`.
    #[serde(skip_serializing_if = "Option::is_none")]
    credibility: Option<&'a Credibilities>,
}

/// Prints the figures.
pub fn run(args: &EvalArgs) -> Result<Done> {
    let many = args.results.len() > 1;
    anyhow::ensure!(
        !(many && args.errors.is_some()),
        "--errors {}: is for one results file; run grip eval for each",
        args.errors.as_deref().unwrap_or(Path::new("")).display()
    );
    anyhow::ensure!(
        !(many && args.posteriors.is_some()),
        "--posteriors {}: is for one results file; run grip eval for each",
        args.posteriors.as_deref().unwrap_or(Path::new("")).display()
    );
    if let Some(path) = &args.figure {
        plot::check_place(path)?;
        let (count, most) = (args.results.len(), plot::MOST_CURVES);
        anyhow::ensure!(count <= most, "--figure: has colours for {most} results files, not for {count}");
    }
    let dataset = Dataset::open(&args.dataset, args.split.as_deref())?;
    let mut evaluations = Vec::new();
    let mut summaries = Vec::new();
    for results in &args.results {
        let evaluation = evaluate(&dataset, &read_results(results)?)?;
        let paper = if args.paper { Some(PaperTable::new(&evaluation, dataset.root())?) } else { None };
        let credibility = args.posteriors.as_deref().map(|path| credibility(&dataset, path)).transpose()?;
        if let Some(path) = &args.errors {
            let mut text = format!("{}\n", Case::HEADER);
            text.extend(evaluation.cases.iter().map(Case::line));
            bop::write_atomic(path, text.as_bytes())?;
        }
        if evaluation.ignored > 0 {
            output::message(format_args!(
                "{}{} estimates are of images or objects that the data set does not ask for; they do not count",
                if many { format!("{}: ", results.display()) } else { String::new() },
                evaluation.ignored
            ));
        }
        if !evaluation.unknown.is_empty() {
            let ids: Vec<String> = evaluation.unknown.keys().map(u32::to_string).collect();
            output::message(format_args!(
                "{} of them are of objects that the data set has no model of: {}; check obj_id",
                evaluation.unknown.values().sum::<usize>(),
                ids.join(", ")
            ));
        }
        if let Some(text) = lacking(&evaluation.lacking) {
            output::message(format_args!("{text}"));
        }
        if args.json {
            summaries.push(serde_json::to_value(EvalReport {
                schema: SCHEMA,
                dataset: &args.dataset,
                split: dataset.split(),
                results,
                thresholds_m: crate::benchmark::THRESHOLDS,
                evaluation: &evaluation,
                paper: paper.as_ref(),
                credibility: credibility.as_ref(),
            })?);
        } else {
            if many {
                output::data(format_args!("{}", results.display()))?;
            }
            print(&evaluation, paper.as_ref())?;
            if let Some(credibility) = &credibility {
                print_credibility(credibility)?;
            }
        }
        evaluations.push(evaluation);
    }
    if args.json {
        let json = if many { Value::Array(summaries) } else { summaries.remove(0) };
        output::data(format_args!("{}", serde_json::to_string_pretty(&json)?))?;
    }
    if let Some(path) = &args.figure {
        let curves: Vec<(String, &[Case])> =
            names(args).into_iter().zip(&evaluations).map(|(n, e)| (n, e.cases.as_slice())).collect();
        let folder = args.dataset.file_name().unwrap_or(args.dataset.as_os_str()).to_string_lossy();
        plot::write(&accuracy_figure(&folder, &curves), path)?;
    }
    Ok(Done::Fully)
}

/// Names of the curves: those of the files, with their folders where these are not enough.
fn names(args: &EvalArgs) -> Vec<String> {
    let stems: Vec<String> = args
        .results
        .iter()
        .map(|path| path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned())
        .collect();
    let whole = |(path, stem): (&std::path::PathBuf, &String)| {
        let alone = stems.iter().filter(|other| *other == stem).count() == 1;
        if alone { stem.clone() } else { path.display().to_string() }
    };
    args.results.iter().zip(&stems).map(whole).collect()
}

fn print(evaluation: &Evaluation, paper: Option<&PaperTable>) -> Result<()> {
    if let Some(paper) = paper {
        return print_paper(paper);
    }
    let header = [
        "",
        "instances",
        "estimated",
        "ADD-S AUC 4 cm",
        "95 %",
        "ADD(-S) AUC 4 cm",
        "95 %",
        "ADD-S AUC 10 cm",
        "ADD(-S) AUC 10 cm",
        "< 0.1 d",
        "median ADD-S mm",
        "AR",
    ];
    let rows = evaluation
        .objects
        .iter()
        .map(|(id, figures)| row(&object_title(&evaluation.names, *id), figures))
        .chain(evaluation.conditions.iter().map(|(name, figures)| row(&format!("view {name}"), figures)))
        .chain([row("all", &evaluation.all)]);
    output::data(format_args!("{}", output::table(header, &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11], rows)))?;
    output::data(format_args!("{}\n", kinds(evaluation)))?;
    output::data(format_args!("{}", recall(&evaluation.all.bop)))?;
    output::data(format_args!("{}", confidences(&evaluation.presence)))
}

/// How instances are found and missed: a row an object, a column for each kind that occurs.
fn kinds(evaluation: &Evaluation) -> String {
    let all = &evaluation.all.kinds;
    let occur = || ErrorKind::ALL.into_iter().filter(|kind| all.contains_key(kind));
    let cells = |name: &str, cell: &dyn Fn(ErrorKind) -> String| {
        std::iter::once(name.to_owned()).chain(occur().map(cell)).collect::<Vec<String>>()
    };
    let counts = |name: &str, figures: &Figures| {
        let count = |kind: ErrorKind| figures.kinds.get(&kind).map_or(0, |k| k.instances);
        cells(name, &|kind| if count(kind) == 0 { String::new() } else { count(kind).to_string() })
    };
    let mean = |kind: ErrorKind| all[&kind].confidence.map_or_else(|| "-".to_owned(), |c| format!("{c:.2}"));
    let rows = (evaluation.objects.iter())
        .map(|(id, figures)| counts(&object_title(&evaluation.names, *id), figures))
        .chain([
            counts("all", &evaluation.all),
            cells("mean confidence", &mean),
            cells("of these 0.5 or more", &|kind| all[&kind].sure.to_string()),
        ]);
    let header: Vec<String> = cells("", &|kind| kind.name().replace('_', " "));
    let right: Vec<usize> = (1..header.len()).collect();
    output::table_of(header, &right, rows.collect())
}

/// Which of the BOP challenge's figures there are not, and why.
fn lacking(lacking: &Lacking) -> Option<String> {
    let Lacking { images, depth, width } = *lacking;
    let mut text = Vec::new();
    if depth > 0 {
        text.push(format!(
            "{depth} of {images} images have no depth picture (depth/NNNNNN.png): no VSD where they count, and no AR"
        ));
    }
    if width > 0 {
        text.push(format!(
            "{width} of {images} images have no picture at all, and there is no camera.json to tell their width: no MSPD where \
             they count, and no AR"
        ));
    }
    (!text.is_empty()).then(|| text.join("\n"))
}

/// The average recall and what it is the mean of, in a line.
fn recall(recall: &Recall) -> String {
    let average = &recall.average;
    let range = recall.ar_interval.map_or_else(String::new, |range| format!(" ({})", interval(range)));
    let [ar, vsd, mspd] = [average.ar, average.ar_vsd, average.ar_mspd].map(share);
    let mssd = percent(average.ar_mssd);
    format!("BOP challenge: average recall AR {ar}{range}, mean of VSD {vsd}, MSSD {mssd} and MSPD {mspd}")
}

/// What the confidences are worth, in a line or two.
fn confidences(p: &Presence) -> String {
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let mut text = format!(
        "confidence: off by {} on average; {} of {} estimates of present objects have 0.5 or more",
        percent(p.calibration_error),
        percent(p.said_there[0]),
        p.present
    );
    if let (Some(auroc), Some(found)) = (p.auroc, p.found_at_5_percent) {
        text += &format!(
            ", and {} of {} of absent ones\nthere or not: area under the ROC curve {auroc:.4}; {} of present objects found at 5 % false alarms",
            percent(p.said_there[1]),
            p.absent,
            percent(found)
        );
    }
    text
}

/// Where the truth lies in the posteriors.
fn print_credibility(found: &Credibilities) -> Result<()> {
    let header = [
        "posteriors",
        "cases",
        "within 50 %",
        "within 90 %",
        "ranks by tenths",
        "best mode's mass",
        "std mm",
    ];
    let row = |name: &str, c: &Credibility| {
        let ranks: Vec<String> = c.ranks.iter().map(|share| format!("{:.0}", 100.0 * share)).collect();
        [
            name.to_owned(),
            c.cases.to_string(),
            percent(c.within[0]),
            percent(c.within[1]),
            ranks.join(" "),
            percent(c.best_mass),
            format!("{:.1}", 1e3 * c.median_position_std_m),
        ]
    };
    let views = found.conditions.iter().map(|(name, c)| row(&format!("view {name}"), c));
    let rows = views.chain([row("all", &found.all)]);
    output::data(format_args!("\n{}", output::table(header, &[1, 2, 3, 5, 6], rows)))
}

fn row(name: &str, f: &Figures) -> [String; 12] {
    let none = || "-".to_owned();
    [
        name.to_owned(),
        f.instances.to_string(),
        f.estimated.to_string(),
        percent(f.auc_adds[0]),
        f.auc_adds_interval.map_or_else(none, interval),
        percent(f.auc_add_or_adds[0]),
        f.auc_add_or_adds_interval.map_or_else(none, interval),
        percent(f.auc_adds[1]),
        percent(f.auc_add_or_adds[1]),
        percent(f.found),
        f.median_adds_m.map_or_else(none, |m| format!("{:.1}", 1e3 * m)),
        share(f.bop.average.ar),
    ]
}

fn share(share: Option<f64>) -> String {
    share.map_or_else(|| "-".to_owned(), percent)
}

fn percent(share: f64) -> String {
    format!("{:.1}", 100.0 * share)
}

fn interval([low, high]: [f64; 2]) -> String {
    format!("{}-{}", percent(low), percent(high))
}

fn print_paper(table: &PaperTable) -> Result<()> {
    let [dope, posecnn, grip] = METHODS.map(|method| format!("{method}, paper"));
    for group in &table.groups {
        let title = format!("{} ({})", group.name, group.views.join(", "));
        let header = [&title, "metric", "instances", "AUC 4 cm", "95 %", &grip, &posecnn, &dope];
        let row = |name: &str, metric: &str, area: &Area| {
            let [dope, posecnn, grip] = area.published.map(share);
            let range = area.interval.map_or_else(|| "-".to_owned(), interval);
            let instances = area.instances.to_string();
            [name.to_owned(), metric.to_owned(), instances, share(area.auc), range, grip, posecnn, dope]
        };
        let overall = format!("overall: {} of {} objects", group.overall.objects, group.objects.len());
        let rows = group.objects.iter().map(|r| row(r.object, r.metric, &r.area));
        let rows = rows.chain([row(&overall, "", &group.overall.area)]);
        output::data(format_args!("{}\n", output::table(header, &[2, 3, 4, 5, 6, 7], rows)))?;
    }
    output::data(format_args!(
        "Per cent. Columns marked paper: {}, on its own 40 scenes; their overall is over the same objects.",
        table.source
    ))
}
