//! The command that runs one trial of an experiment again.

use grip_sim::files;
use serde_json::Value;

use crate::estimators::{DetectorKind, EstimatorKind};
use crate::graspers::{GRIP, GrasperKind};
use crate::provenance::command_line;
use crate::scenario::program;
use crate::score::outcome::TrialResult;
use crate::settings::Settings;

/// What stands for a file or folder that nobody has written down.
pub const UNKNOWN: [&str; 4] = ["SCENE-", "TABLE.toml", "FOLDER", "SETTINGS.toml"];

/// Of a trial that is told of by `about`: experiment.json, or scenario.json of a single run. What the program was given as a file and
/// nobody has written down stands in capitals.
pub fn command(trial: &TrialResult, about: &Value) -> String {
    let mut words = vec!["grip".to_owned(), "pack".to_owned()];
    let scenarios = about["scenarios"].as_array().map_or(std::slice::from_ref(about), Vec::as_slice);
    let scenario = scenarios.iter().find(|s| s["scene"]["name"] == *trial.scene).unwrap_or(&Value::Null);
    if trial.scene != "grocery" {
        let built_in = format!("scenes/{}.toml", trial.scene);
        let known = files::exists(&files::builtin_path(&built_in));
        words.push(if known { built_in } else { format!("SCENE-{}.toml", trial.scene) });
    }
    let mut give = |option: &str, value: String| words.extend([option.to_owned(), value]);
    if trial.condition != "base" {
        give("--condition", trial.condition.clone());
    }
    let described =
        |many: &str, one: &str| about[many].as_array().cloned().unwrap_or_else(|| vec![about[one].clone()]);
    if trial.estimator != GRIP {
        let word = word(&trial.estimator, &described("estimators", "estimator"), |text| {
            Some(text.parse::<EstimatorKind>().ok()?.name())
        });
        give("--estimator", word);
    }
    if trial.grasper != GRIP {
        let word = word(&trial.grasper, &described("graspers", "grasper"), |text| {
            Some(text.parse::<GrasperKind>().ok()?.name())
        });
        give("--grasper", word);
    }
    if trial.detector != "none" && trial.detector != DetectorKind::Pyramid.name() {
        give("--detector", trial.detector.clone());
    }
    if let Some(path) = scenario["grasps"]["path"].as_str() {
        give("--grasps", path.to_owned());
    }
    if trial.object_set.ends_with("own") {
        give("--objects", "TABLE.toml".to_owned());
    }
    if trial.object_set.starts_with("ycb") || trial.object_set.starts_with("bop") {
        give("--ycb", "FOLDER".to_owned());
    }
    let usual = || serde_json::to_value(Settings::default()).unwrap_or_default();
    // Another build may have had other defaults.
    let ours = about["program"]["commit"] == program().commit;
    if ours && scenario["settings"].is_object() && scenario["settings"] != usual() {
        give("--settings", "SETTINGS.toml".to_owned());
    }
    // An experiment packs all that there is.
    if let Some(items) = about["items"].as_u64() {
        give("--items", items.to_string());
    }
    if trial.hypotheses.starts_with("gpu") {
        give("--hypotheses", "gpu".to_owned());
    }
    give("--renderer", trial.renderer.clone());
    give("--seed", trial.seed.to_string());
    command_line(&words)
}

/// What the command line calls somebody of this name: a file or a program by what it was, which the descriptions tell.
fn word(name: &str, described: &[Value], name_of: impl Fn(&str) -> Option<String>) -> String {
    let programs = described.iter().filter_map(|one| {
        let file = one["path"].as_str().map(|path| format!("csv:{path}"));
        file.or_else(|| Some(format!("cmd:{}", one["command"].as_str()?)))
    });
    let mut others: Vec<String> = Vec::new();
    for program in programs {
        if name_of(&program).as_deref() == Some(name) {
            return program;
        }
        others.push(program);
    }
    // A name of its own: whose it is can be told where there is one alone.
    match others.as_slice() {
        [one] if one.starts_with("cmd:") && !["paper", "paper-guarded", "truth"].contains(&name) => {
            format!("{name}={one}")
        }
        _ => name.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::summary::tests::trial;
    use serde_json::json;

    #[test]
    fn a_command_gives_what_is_not_the_default() {
        let mut failed = trial(7, "base", "grip", &[("can", false, None)]);
        failed.detector = "pyramid".into();
        let usual =
            json!({ "scenarios": [{ "scene": { "name": "grocery" }, "settings": Settings::default() }] });
        assert_eq!(command(&failed, &usual), "grip pack --renderer cpu --seed 7");
        failed.scene = "shelf".into();
        failed.condition = "dark".into();
        failed.estimator = "mine".into();
        failed.detector = "none".into();
        let mut about = json!({
            "scenarios": [{ "scene": { "name": "shelf" }, "settings": Settings::default() }],
            "program": program(),
            "estimators": [{ "name": "truth" }, { "name": "cmd", "command": "python3 a.py" }],
        });
        let again = "grip pack scenes/shelf.toml --condition dark --estimator 'mine=cmd:python3 a.py' --renderer cpu --seed 7";
        assert_eq!(command(&failed, &about), again);
        about["scenarios"][0]["settings"]["success"]["slip_m"] = json!(0.01);
        failed.estimator = "a".into();
        let again = command(&failed, &about);
        assert!(again.contains("--estimator 'cmd:python3 a.py' --settings SETTINGS.toml "), "{again}");
    }
}
