//! Estimators of others, live: `cmd:PROGRAM`. Their programs are Python without packages.

use std::path::Path;

use serde_json::Value;

use crate::common::{code, grip, has_python, script, small_scene, stderr, stdout, trials};
use crate::estimate::{data_set, truth};

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
    // Nobody looks at the pictures.
    let camera = folder.path().join("small.yaml");
    std::fs::write(&camera, "{width: 80, height: 60, K: [70.0, 0.0, 39.5, 0.0, 70.0, 29.5, 0.0, 0.0, 1.0]}")
        .unwrap();
    let text = std::fs::read_to_string(&scene).unwrap();
    std::fs::write(&scene, text.replace("intrinsics = \"fetch\"", "intrinsics = \"small.yaml\"")).unwrap();
    // It sees nothing, and is asked again.
    let settings = folder.path().join("settings.toml");
    std::fs::write(&settings, "[trial]\nmax_fruitless_looks = 4\nestimator_timeout_s = 5.0\n").unwrap();
    let run = |how: &str, out: &str, more: &[&str]| {
        let out = folder.path().join(out);
        // At look 3 of the seventh trial.
        let command = format!("cmd:python3 {} 7 3 {how}", script("tests/estimators/faulty.py"));
        let (trials, seed) = if how == "crash" { ("20", "1") } else { ("3", "6") };
        let mut args = vec!["trials", "--scene", &scene, "--trials", trials, "--seed", seed];
        args.extend(["--renderer", "cpu", "--estimators", &command]);
        args.extend(["--settings", settings.to_str().unwrap()]);
        args.extend(["--out", out.to_str().unwrap()]);
        args.extend(more);
        let output = grip(&args);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        out
    };
    for (how, words) in [("crash", "nearly"), ("hang", "no answer within 5 s"), ("nonsense", "protocol")] {
        let whole = trials(&run(how, how, &[]));
        assert_eq!(whole.len(), if how == "crash" { 20 } else { 3 });
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

#[test]
fn of_a_data_set_a_program_is_asked_image_by_image() {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let set = data_set(folder.path());
    let (poses, csv) = (folder.path().join("truth.csv"), folder.path().join("out.csv"));
    std::fs::write(&poses, truth(&set, 3.0)).unwrap();
    let estimate = |estimator: &str, more: &[&str]| -> Value {
        let [set, csv] = [&set, &csv].map(|path| path.to_str().unwrap());
        let args = ["estimate", set, "--estimator", estimator, "--out", csv, "--json"];
        let output = grip(&[&args[..], more].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        serde_json::from_str(&stdout(&output)).unwrap()
    };
    // What it says is what the file says, whoever proposes boxes.
    let recorded = format!("cmd:python3 {} '{}'", script("tests/estimators/recorded.py"), poses.display());
    let rows = |path: &Path| -> Vec<Vec<f64>> {
        let text = std::fs::read_to_string(path).unwrap();
        let numbers = |line: &str| line.split([',', ' ']).map(|x| x.parse().unwrap()).collect::<Vec<f64>>();
        let mut rows: Vec<Vec<f64>> = text.lines().skip(1).map(numbers).collect();
        rows.iter_mut().for_each(|row| row.truncate(16));
        rows.sort_by(|a, b| a.partial_cmp(b).unwrap());
        rows
    };
    for boxes in [&[][..], &["--boxes", "gt", "--jobs", "1"]] {
        assert_eq!(estimate(&recorded, boxes)["failed"], 0);
        let (file, said) = (rows(&poses), rows(&csv));
        assert_eq!(file.len(), said.len());
        for (a, b) in file.iter().flatten().zip(said.iter().flatten()) {
            assert!((a - b).abs() < 1e-5, "{a} {b}");
        }
    }
    // A crash costs one image, and is told.
    let faulty = format!("cmd:python3 {} 1 1 crash", script("tests/estimators/faulty.py"));
    let report = estimate(&faulty, &[]);
    assert_eq!((&report["images"], &report["failed"]), (&2.into(), &1.into()), "{report}");
    // Those that have nothing to say of images are refused.
    for other in ["truth", "csv:poses.csv"] {
        let output = grip(&["estimate", set.to_str().unwrap(), "--estimator", other]);
        assert!(code(&output) == 2 && stderr(&output).contains("cmd:PROGRAM"), "{}", stderr(&output));
    }
}

#[test]
fn the_filter_of_the_paper_is_an_estimator_of_trials_with_its_settings() {
    let folder = tempfile::tempdir().unwrap();
    let scene = small_scene(folder.path());
    let settings = folder.path().join("settings.toml");
    // A few iterations: whether it sees anything is not asked here.
    std::fs::write(&settings, "[perception.paper]\niterations = 2\n[trial]\nmax_attempts = 1\n").unwrap();
    let out = folder.path().join("out");
    let args = ["pack", &scene, "--seed", "3", "--renderer", "cpu", "--estimator", "paper", "--json"];
    let more = ["--settings", settings.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let output = grip(&[&args[..], &more].concat());
    assert!(code(&output) <= 1, "{}", stderr(&output));
    let trial: Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!((&trial["estimator"], &trial["detector"]), (&"paper".into(), &"pyramid".into()));
    let scenario: Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("scenario.json")).unwrap()).unwrap();
    assert_eq!(scenario["settings"]["perception"]["paper"]["iterations"], 2);
}
