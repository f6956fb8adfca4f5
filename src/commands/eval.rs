//! `grip eval`: errors of a results file, anyone's, against the truth of its data set.

use anyhow::Result;
use grip_sim::bop::results::read_results;
use grip_sim::bop::{self, Dataset};
use serde_json::json;

use super::Done;
use crate::benchmark::{Case, Figures, Presence, evaluate};
use crate::cli::EvalArgs;
use crate::output;

/// Prints the figures.
pub fn run(args: &EvalArgs) -> Result<Done> {
    let dataset = Dataset::open(&args.dataset, args.split.as_deref())?;
    let evaluation = evaluate(&dataset, &read_results(&args.results)?)?;
    if let Some(path) = &args.errors {
        let mut text = format!("{}\n", Case::HEADER);
        text.extend(evaluation.cases.iter().map(Case::line));
        bop::write_atomic(path, text.as_bytes())?;
    }
    if evaluation.ignored > 0 {
        output::message(format_args!(
            "{} estimates are of images or objects that the data set does not ask for; they do not count",
            evaluation.ignored
        ));
    }
    if args.json {
        let json = json!({
            "schema": "grip.eval/1",
            "dataset": args.dataset,
            "split": dataset.split(),
            "results": args.results,
            "thresholds_m": crate::benchmark::THRESHOLDS,
            "ignored": evaluation.ignored,
            "all": evaluation.all,
            "objects": evaluation.objects,
            "conditions": evaluation.conditions,
            "presence": evaluation.presence,
        });
        output::data(format_args!("{}", serde_json::to_string_pretty(&json)?))?;
        return Ok(Done::Fully);
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
    ];
    let rows = evaluation
        .objects
        .iter()
        .map(|(id, figures)| row(&format!("object {id}"), figures))
        .chain(evaluation.conditions.iter().map(|(name, figures)| row(&format!("view {name}"), figures)))
        .chain([row("all", &evaluation.all)]);
    output::data(format_args!("{}", output::table(header, &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10], rows)))?;
    output::data(format_args!("{}", confidences(&evaluation.presence)))?;
    Ok(Done::Fully)
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

fn row(name: &str, f: &Figures) -> [String; 11] {
    let percent = |share: f64| format!("{:.1}", 100.0 * share);
    let interval = |[low, high]: [f64; 2]| format!("{}-{}", percent(low), percent(high));
    [
        name.to_owned(),
        f.instances.to_string(),
        f.estimated.to_string(),
        percent(f.auc_adds[0]),
        interval(f.auc_adds_interval),
        percent(f.auc_add_or_adds[0]),
        interval(f.auc_add_or_adds_interval),
        percent(f.auc_adds[1]),
        percent(f.auc_add_or_adds[1]),
        percent(f.found),
        f.median_adds_m.map_or_else(|| "-".to_owned(), |m| format!("{:.1}", 1e3 * m)),
    ]
}
