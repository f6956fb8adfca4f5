//! Estimators of others, live: `cmd:PROGRAM`. Their programs are Python without packages.

use std::path::Path;

use serde_json::Value;

use crate::common::{code, grip, has_python, script, small_scene, stderr, stdout, trials};

#[test]
fn a_program_that_is_asked_at_each_look_packs_what_it_sees() {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let scene = small_scene(folder.path());
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let pack = |estimator: &str, out: &str, more: &[&str]| -> Value {
        let mut args =
            vec!["pack", &scene, "--seed", "3", "--renderer", "cpu", "--estimator", estimator, "--json"];
        args.extend(["--out", out]);
        args.extend(more);
        let output = grip(&args);
        assert!(code(&output) <= 1, "{}", stderr(&output));
        serde_json::from_str(&stdout(&output)).unwrap()
    };
    // The template sees nothing, and its frames are there.
    let template = format!("cmd:python3 {}", script("examples/estimators/template.py"));
    let nothing = pack(&template, &at("first"), &["--bop"]);
    assert_eq!(nothing["estimator"], "template");
    assert_eq!(nothing["items"][0]["outcome"], "not_perceived", "{nothing}");
    // What other estimates of them say, by a program.
    let (set, csv) = (format!("{}/bop", at("first")), at("poses.csv"));
    let output = grip(&["estimate", &set, "--boxes", "clusters", "--out", &csv]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let recorded = format!("live=cmd:python3 {} '{csv}'", script("tests/estimators/recorded.py"));
    let some = pack(&recorded, &at("second"), &[]);
    assert_eq!(some["estimator"], "live");
    assert!(some["packed"].as_u64().unwrap() >= 1, "{some}");
    // What is picked first is where the file has it, too; later looks are from a hair beside.
    let of_file = pack(&format!("csv:{csv}"), &at("third"), &[]);
    let errors = |trial: &Value| -> Vec<f64> {
        let items = trial["items"].as_array().unwrap().iter();
        items.map(|item| item["first_attempt"]["add_m"].as_f64().unwrap_or(f64::INFINITY)).collect()
    };
    let (live, file) = (errors(&some), errors(&of_file));
    assert!(live.iter().zip(&file).any(|(a, b)| (a - b).abs() < 1e-9), "{live:?} {file:?}");
}

#[test]
fn what_a_program_does_wrong_ends_its_trial_and_no_other() {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let scene = small_scene(folder.path());
    let settings = folder.path().join("settings.toml");
    std::fs::write(&settings, "[trial]\nestimator_timeout_s = 5.0\n").unwrap();
    let run = |how: &str, out: &str, more: &[&str]| {
        let out = folder.path().join(out);
        let command = format!("cmd:python3 {} 7 1 {how}", script("tests/estimators/faulty.py"));
        let mut args = vec!["trials", "--scene", &scene, "--trials", "3", "--seed", "6", "--renderer", "cpu"];
        args.extend(["--estimators", &command]);
        if how == "hang" {
            args.extend(["--settings", settings.to_str().unwrap()]);
        }
        args.extend(["--out", out.to_str().unwrap()]);
        args.extend(more);
        let output = grip(&args);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        out
    };
    for (how, words) in [("crash", "nearly"), ("hang", "no answer within 5 s"), ("nonsense", "protocol")] {
        let whole = trials(&run(how, how, &[]));
        assert_eq!(whole.len(), 3);
        for trial in &whole {
            for item in trial["items"].as_array().unwrap() {
                let failed = trial["seed"] == 7;
                let expected = if failed { "estimator_failed" } else { "not_perceived" };
                assert_eq!(item["outcome"], expected, "{item}");
                assert!(!failed || item["reason"].as_str().unwrap().contains(words), "{item}");
            }
        }
    }
    // What cannot even greet is a wrong command, and leaves nothing.
    let none = folder.path().join("none");
    let args = [
        "trials",
        "--scene",
        &scene,
        "--estimators",
        "cmd:/no/such/program",
        "--out",
        none.to_str().unwrap(),
    ];
    let output = grip(&args);
    assert!(code(&output) == 2 && stderr(&output).contains("cannot be started"), "{}", stderr(&output));
    assert!(!none.exists());
    // In parts, the first of them once more, and put together: the same.
    let parts: Vec<_> =
        ["1/2", "2/2"].map(|part| run("crash", &part.replace('/', "-"), &["--shard", part])).into();
    run("crash", "1-2", &["--shard", "1/2", "--resume"]);
    let merged = folder.path().join("merged");
    let [first, second, merged_path] = [&parts[0], &parts[1], &merged].map(|path| path.to_str().unwrap());
    let output = grip(&["merge", first, second, "--out", merged_path]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let bytes = |path: &Path| std::fs::read(path.join("trials.jsonl")).unwrap();
    assert!(bytes(&merged) == bytes(&folder.path().join("crash")));
}
