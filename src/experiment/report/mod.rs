//! `grip report`: one page, and CSV files, of any experiments, campaigns, sweeps and single runs.

mod calibration;
mod figures;
mod origin;
mod page;
mod replay;
mod sources;
mod sweep_figures;
mod why;

use anyhow::Result;

pub use self::origin::{Kind, Origin};
pub use self::page::{html, p_value};
pub use self::sources::{Sources, SweepSource};
use super::{summary, sweep};

/// The figures of the page as CSV files: each with its name and content.
///
/// # Errors
/// When a value cannot be written as text.
pub fn tables(sources: &Sources) -> Result<Vec<(&'static str, String)>> {
    let mut files = Vec::new();
    if !sources.trials.is_empty() {
        let mut text =
            String::from("scene,condition,estimator,grasper,trials,full,items,packed,share,low,high\n");
        for c in summary::cells(&sources.trials) {
            let names = [&c.scene, &c.condition, &c.estimator, &c.grasper].map(|name| quoted(name));
            text += &format!(
                "{},{},{},{},{},{},{},{}\n",
                names.join(","),
                c.trials,
                c.full,
                c.items,
                c.packed,
                c.share,
                c.interval[0],
                c.interval[1]
            );
        }
        files.push(("trials", text));
        let mut text = String::from(
            "seed,scene,condition,estimator,grasper,object,instance,outcome,attempts,add_m,adds_m,slip_m,camera_shift_m,camera_turn_rad\n",
        );
        for (trial, item) in sources.trials.iter().flat_map(|t| t.items.iter().map(move |i| (t, i))) {
            let number = |v: Option<f64>| v.map_or(String::new(), |v| v.to_string());
            text += &format!(
                "{},{},{},{},{},{},{},{},{},{},{},{},{},{}\n",
                trial.seed,
                quoted(&trial.scene),
                quoted(&trial.condition),
                quoted(&trial.estimator),
                quoted(&trial.grasper),
                quoted(&item.object),
                item.instance,
                quoted(item.outcome.words()),
                item.attempts,
                number(item.add_m),
                number(item.adds_m),
                number(item.slip_m),
                number(trial.calibration.map(|record| record.camera_shift_m)),
                number(trial.calibration.map(|record| record.camera_turn_rad)),
            );
        }
        files.push(("items", text));
    }
    if !sources.sweeps.is_empty() {
        let mut text = String::from("sweep,object,axis,value,tried,held,share,low,high\n");
        for sweep in &sources.sweeps {
            for object in sweep::fits::results(&sweep.lines) {
                for axis in &object.axes {
                    for s in &axis.shares {
                        text += &format!(
                            "{},{},{},{},{},{},{},{},{}\n",
                            quoted(&sweep.name),
                            quoted(&object.object),
                            axis.axis.name(),
                            s.value,
                            s.tried,
                            s.held,
                            s.share,
                            s.interval[0],
                            s.interval[1]
                        );
                    }
                }
            }
        }
        files.push(("sweep", text));
    }
    Ok(files)
}

/// A text as a field of a CSV file.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
