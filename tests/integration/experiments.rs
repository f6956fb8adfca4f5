//! Experiments as a user runs them: killed, resumed, split, merged, reported.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{self, code, edited_scene, grip, root, stderr, stdout};
use serde_json::Value;

fn run(args: &[&str]) -> String {
    let output = grip(args);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    stdout(&output)
}

/// What an error says, with exit code 2.
fn error(args: &[&str]) -> String {
    let output = grip(args);
    assert_eq!(code(&output), 2, "{}", stdout(&output));
    stderr(&output)
}

/// The default scene with two objects.
fn small_scene(folder: &Path) -> PathBuf {
    edited_scene(folder, |text| {
        let (begin, end) = (text.find("names = [").unwrap(), text.find("]\ncenter = [0.60").unwrap());
        format!("{}names = [\"005_tomato_soup_can\", \"011_banana\"{}", &text[..begin], &text[end..])
    })
}

fn start(args: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_grip"))
        .args(args)
        .current_dir(root())
        .env_remove("GRIP_YCB_DIR")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// Runs until `file` has `lines` lines and a moment more, then kills without a warning.
fn run_and_kill(args: &[&str], file: &Path, lines: usize, moment: Duration) {
    let mut child = start(args);
    let begun = Instant::now();
    let written = || std::fs::read(file).map_or(0, |bytes| bytes.iter().filter(|&&b| b == b'\n').count());
    while written() < lines && child.try_wait().unwrap().is_none() {
        assert!(begun.elapsed() < Duration::from_secs(300), "nothing happens");
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(moment);
    let _ = child.kill();
    child.wait().unwrap();
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn trials_killed_and_split_are_the_trials_undisturbed() {
    let folder = tempfile::tempdir().unwrap();
    let scene = small_scene(folder.path());
    let scene = scene.to_str().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (whole, killed, merged, page) = (at("whole"), at("killed"), at("merged"), at("report.html"));
    let common = [
        "trials",
        "--scene",
        scene,
        "--trials",
        "2",
        "--seed",
        "3",
        "--conditions",
        "base,dark",
        "--estimators",
        "truth",
    ];
    let with = |out: &Path, more: &[&str]| {
        let mut args: Vec<String> = common.iter().map(|s| (*s).to_owned()).collect();
        args.extend(["--out".to_owned(), out.to_str().unwrap().to_owned()]);
        args.extend(more.iter().map(|s| (*s).to_owned()));
        args
    };
    let strs = |args: &[String]| -> Vec<&'static str> {
        args.iter().map(|s| &*Box::leak(s.clone().into_boxed_str())).collect()
    };

    let printed: Value = serde_json::from_str(&run(&strs(&with(&whole, &["--json"])))).unwrap();
    assert_eq!(printed["trials"], 4);
    let cells = printed["cells"].as_array().unwrap();
    assert_eq!(cells.len(), 2);
    assert!(
        cells.iter().all(|cell| cell["items"] == 4 && cell["packed"].as_u64().unwrap() >= 3),
        "{printed}"
    );
    let trials = text(&whole.join("trials.jsonl"));
    assert_eq!(trials.lines().count(), 4);
    assert!(!trials.contains("wall_s"), "what differs from run to run is kept apart");

    // Killed on the way and once more, then to the end on one thread.
    let file = killed.join("trials.jsonl");
    run_and_kill(&strs(&with(&killed, &[])), &file, 1, Duration::from_millis(700));
    let resumed = strs(&with(&killed, &["--resume", "--jobs", "1"]));
    run_and_kill(&resumed, &file, 2, Duration::from_millis(100));
    run(&resumed);
    assert_eq!(text(&file), trials);
    // Nothing is left to do, and nothing changes.
    run(&resumed);
    assert_eq!(text(&file), trials);

    // Shards, one of which is given twice.
    let shards: Vec<PathBuf> = (1..=2)
        .map(|i| {
            let out = at(&format!("shard{i}"));
            run(&strs(&with(&out, &["--shard", &format!("{i}/2")])));
            out
        })
        .collect();
    let paths = [&shards[1], &shards[0], &shards[1]].map(|p| p.to_str().unwrap());
    run(&["merge", paths[0], paths[1], paths[2], "--out", merged.to_str().unwrap()]);
    assert_eq!(text(&merged.join("trials.jsonl")), trials);
    assert_eq!(
        std::fs::read(merged.join("items.parquet")).unwrap(),
        std::fs::read(whole.join("items.parquet")).unwrap()
    );
    common::python("check_items.py", "pyarrow", &[&whole]);

    // A shard alone says that it is a part, and one folder twice is not two.
    let part = at("part");
    run(&["merge", paths[1], "--out", part.to_str().unwrap()]);
    run(&["report", part.to_str().unwrap(), "--out", page.to_str().unwrap()]);
    assert!(
        text(&page).contains("2 of 4 trials") && text(&page).contains("<p class=kind>Trials, 2 of 4</p>")
    );
    let twice = error(&["report", paths[0], paths[0], "--out", at("y.html").to_str().unwrap()]);
    assert!(twice.contains("more than one"), "{twice}");

    // What goes wrong is said.
    let has = error(&strs(&with(&whole, &[])));
    assert!(has.contains("--resume"), "{has}");
    let other = at("other.toml");
    std::fs::write(&other, "[planner.grasp]\nkeep = 20\n").unwrap();
    let other = strs(&with(&whole, &["--resume", "--settings", other.to_str().unwrap()]));
    assert!(error(&other).contains("settings.planner.grasp.keep"), "{}", error(&other));
    let mixed = error(&[
        "merge",
        paths[0],
        root().join("docs").to_str().unwrap(),
        "--out",
        at("x").to_str().unwrap(),
    ]);
    assert!(mixed.contains("experiment.json"), "{mixed}");
    assert!(!at("x").exists());

    // The page needs nothing else.
    run(&["report", whole.to_str().unwrap(), "--out", page.to_str().unwrap()]);
    let html = text(&page);
    assert!(html.contains("<svg") && html.contains("4 trials") && html.contains("data:image/jpeg"));
    assert!(html.contains("<p class=kind>Trials</p>") && html.contains("4 of 4 trials (grip trials)"));
    // Why is asked before anything is drawn.
    assert!(html.find("Why did it fail?").unwrap() < html.find("<svg").unwrap());
    assert!(!html.contains("are there; the others"), "nothing is missing");
    assert!(!html.contains("src='http") && !html.contains("href="));
    let items = text(&at("report.items.csv"));
    assert_eq!(items.lines().count(), 1 + 8);
}

#[test]
fn a_sweep_that_was_killed_is_the_sweep_undisturbed() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (whole, killed, page) = (at("whole"), at("killed"), at("report.html"));
    let sweep = |out: &Path, more: &[&'static str]| -> Vec<String> {
        let fixed =
            ["sweep", "005_tomato_soup_can", "--axes", "y", "--samples", "5", "--seeds", "3", "--out"];
        let args = fixed.iter().map(|s| (*s).to_owned()).chain([out.to_str().unwrap().to_owned()]);
        args.chain(more.iter().map(|s| (*s).to_owned())).collect()
    };
    let call = |args: &[String]| run(&args.iter().map(String::as_str).collect::<Vec<_>>());

    let printed: Value = serde_json::from_str(&call(&sweep(&whole, &["--json"]))).unwrap();
    let object = &printed["objects"][0];
    let shares = object["axes"][0]["shares"].as_array().unwrap();
    assert_eq!(shares.len(), 5);
    // Physics: the right grasp holds, one that is 40 mm beside a can of 67 mm does not.
    assert!(object["without_error"]["share"].as_f64().unwrap() > 0.6, "{object}");
    assert!(shares[0]["held"] == 0 && shares[4]["held"] == 0, "{object}");

    let grasps = text(&whole.join("grasps.jsonl"));
    assert_eq!(grasps.lines().count(), 15);
    let args = sweep(&killed, &["--jobs", "2"]);
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    run_and_kill(&args, &killed.join("grasps.jsonl"), 4, Duration::from_millis(30));
    call(&sweep(&killed, &["--resume", "--jobs", "1"]));
    assert_eq!(text(&killed.join("grasps.jsonl")), grasps);

    run(&["report", whole.to_str().unwrap(), "--out", page.to_str().unwrap()]);
    let html = text(&page);
    assert!(
        html.contains("<p class=kind>Sweep</p>") && html.contains("Errors along y, the closing direction")
    );
    // A figure for the one axis, with a dot for each error tried.
    assert_eq!((html.matches("<svg").count(), html.matches("<circle").count()), (1, 5));
    assert_eq!(text(&at("report.sweep.csv")).lines().count(), 1 + 5);
}

/// Five objects have no room side by side in so small a region, but can be heaped there.
#[test]
fn a_trial_that_cannot_be_laid_out_is_left_out_and_said() {
    let folder = tempfile::tempdir().unwrap();
    let scene =
        edited_scene(folder.path(), |text| text.replace("\nsize = [0.30, 0.42]", "\nsize = [0.15, 0.20]"));
    let (out, page) = (folder.path().join("out"), folder.path().join("page.html"));
    let (scene, out, page) = (scene.to_str().unwrap(), out.to_str().unwrap(), page.to_str().unwrap());
    let trials = |conditions, more: &[&str]| {
        let args = ["trials", "--scene", scene, "--trials", "1", "--seed", "5", "--estimators", "truth"];
        grip(&[&args[..], &["--conditions", conditions, "--out", out], more].concat())
    };
    for more in [&[][..], &["--resume"]] {
        let output = trials("base,clutter-1", more);
        assert_eq!(code(&output), 1, "{}", stderr(&output));
        assert!(stderr(&output).contains("1 trials have no result"), "{}", stderr(&output));
        assert_eq!(text(&Path::new(out).join("trials.jsonl")).lines().count(), 1);
        let left_out: Value = serde_json::from_str(&text(&Path::new(out).join("left_out.jsonl"))).unwrap();
        assert_eq!((&left_out["seed"], &left_out["condition"]), (&Value::from(5), &Value::from("base")));
        assert!(left_out["reason"].as_str().unwrap().contains("no layout of 5 objects"), "{left_out}");
    }
    run(&["report", out, "--out", page]);
    assert!(text(Path::new(page)).contains("1 of 2 trials have no result"));
    // Nothing at all is an error of the scene.
    std::fs::remove_dir_all(out).unwrap();
    let output = trials("base", &[]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("no layout of 5 objects"), "{}", stderr(&output));
}

#[test]
fn what_cannot_be_run_is_said_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let out = out.to_str().unwrap();
    for (args, words) in [
        (vec!["trials", "--shard", "3/2"], "3/2"),
        (vec!["trials", "--estimators", "magic"], "magic"),
        (vec!["trials", "--estimators", "truth,truth"], "two are called truth"),
        (vec!["trials", "--estimators", "truth", "--conditions", "base,base"], "two are called base"),
        (vec!["trials", "--estimators", "truth", "--conditions", "moonlight"], "moonlight"),
        (vec!["trials", "--estimators", "csv:none.csv"], "none.csv"),
        (vec!["trials", "--estimators", "truth", "--scene", "none.toml"], "none.toml"),
        (vec!["trials", "--trials", "0"], "--trials"),
        (vec!["trials", "--estimators", "truth", "--seed", "18446744073709551615"], "too large"),
        (vec!["sweep", "no_such_object"], "no_such_object"),
        (vec!["sweep", "--range", "40"], "--range"),
        (vec!["sweep", "--range", "nan,4"], "--range"),
        (vec!["sweep", "--friction", "0"], "--friction"),
        (vec!["sweep", "--force", "100"], "--force"),
        (vec!["sweep", "--axes", "x,x"], "--axes"),
        (vec!["sweep", "--mode", "isotropic", "--axes", "x"], "--axes"),
        (vec!["sweep", "005_tomato_soup_can", "005_tomato_soup_can"], "twice"),
        (vec!["report", "docs"], "experiment.json"),
    ] {
        let mut args = args;
        args.extend(["--out", out]);
        let said = error(&args);
        assert!(said.contains(words), "{args:?}: {said}");
        assert!(!Path::new(out).exists(), "{args:?}");
    }
}

/// The way for estimators of others: frames out, poses in.
#[test]
fn poses_of_others_pack_what_their_frames_show() {
    let folder = tempfile::tempdir().unwrap();
    let scene = small_scene(folder.path());
    let scene = scene.to_str().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (first, csv, second) = (at("first"), at("poses.csv"), at("second"));
    // No poses at all: the trial ends after looking, and its frames are there.
    std::fs::write(&csv, "scene_id,im_id,obj_id,score,R,t,time\n").unwrap();
    let estimator = format!("csv:{csv}");
    let pack = |out: &str| {
        let output =
            grip(&["pack", scene, "--seed", "3", "--estimator", &estimator, "--bop", "--json", "--out", out]);
        (
            code(&output),
            serde_json::from_str::<Value>(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output))),
        )
    };
    let (exit, nothing) = pack(&first);
    assert_eq!((exit, &nothing["packed"]), (1, &Value::from(0)), "{nothing}");
    assert!(nothing["items"].as_array().unwrap().iter().all(|item| item["outcome"] == "not_perceived"));
    // Another program's estimates of those frames: here our own, from the data set alone.
    let set = format!("{first}/bop");
    run(&["estimate", &set, "--boxes", "clusters", "--out", &csv]);
    let (_, some) = pack(&second);
    assert!(some["packed"].as_u64().unwrap() >= 1, "{some}");
    assert_eq!(some["estimator"], "csv-poses");
}
