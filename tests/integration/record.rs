//! Recordings: they change nothing, say what happened, and are read by the tools that own their formats.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::common::{self, code, python, script, small_scene, stderr};

fn result_of(folder: &Path) -> Value {
    let text = std::fs::read_to_string(folder.join("result.json")).unwrap();
    let mut result: Value = serde_json::from_str(&text).unwrap();
    result.as_object_mut().unwrap().remove("timing");
    result
}

#[test]
fn a_recording_changes_nothing_and_its_page_can_be_turned_and_scrubbed() {
    let folder = tempfile::tempdir().unwrap();
    let scene = small_scene(folder.path());
    let run = |level: &str| {
        let out = folder.path().join(level);
        let args =
            ["pack", &scene, "--seed", "2", "--estimator", "truth", "--renderer", "cpu", "--record", level];
        let done = common::grip(&[&args[..], &["--out", out.to_str().unwrap()]].concat());
        assert_eq!(code(&done), 0, "{}", stderr(&done));
        out
    };
    let [none, events, full] = ["none", "events", "full"].map(run);
    assert_eq!(result_of(&none), result_of(&events));
    assert_eq!(result_of(&none), result_of(&full));
    assert!(!none.join("record").exists());
    let size = |path: &Path| path.metadata().unwrap().len();
    let lines = std::fs::read_to_string(events.join("record/events.jsonl")).unwrap();
    assert_eq!(lines, std::fs::read_to_string(full.join("record/events.jsonl")).unwrap());
    let kind =
        |line: &str| serde_json::from_str::<Value>(line).unwrap()["event"].as_str().unwrap().to_owned();
    let kinds: Vec<String> = lines.lines().map(kind).collect();
    for (kind, least) in
        [("look", 2), ("estimate", 3), ("plan", 2), ("attempt", 2), ("step", 18), ("rest", 4)]
    {
        let count = kinds.iter().filter(|of| *of == kind).count();
        assert!(count >= least, "{count} of {kind}");
    }
    assert!(!events.join("record/poses.parquet").exists() && !events.join("record/replay.glb").exists());
    assert!(size(&full.join("record/replay.glb")) < 4_000_000);
    python("check_recording.py", "pyarrow, numpy, trimesh, PIL", &[&full]);
    looked_at(&full.join("report.html"), folder.path());
}

/// Opens a page in a browser at two moments: no error, a picture, and another one later.
fn looked_at(page: &Path, folder: &Path) {
    let known = ["chromium", "chromium-browser", "google-chrome"];
    let browser = known.into_iter().find(|name| Command::new(name).arg("--version").output().is_ok());
    let Some(browser) = browser else {
        assert!(
            std::env::var_os("GRIP_REQUIRE_CHROMIUM").is_none(),
            "GRIP_REQUIRE_CHROMIUM is set but there is no chromium"
        );
        println!("SKIPPED: no chromium");
        return;
    };
    let shot = |seconds: &str| {
        let picture = folder.join(format!("at-{seconds}.png"));
        let output = Command::new(browser)
            .args(["--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"])
            .args(["--enable-logging=stderr", "--virtual-time-budget=8000", "--window-size=1200,4000"])
            .arg(format!("--user-data-dir={}", folder.join("profile").display()))
            .arg(format!("--screenshot={}", picture.display()))
            .arg(format!("file://{}#t={seconds}", page.display()))
            .output()
            .unwrap();
        let said = stderr(&output);
        let console: Vec<&str> = said.lines().filter(|line| line.contains("CONSOLE")).collect();
        assert!(console.is_empty(), "{console:?}");
        image::open(&picture).unwrap_or_else(|error| panic!("{error}: {said}")).to_rgb8()
    };
    let (first, later) = (shot("0"), shot("12"));
    let differ: Vec<(u32, u32)> = first
        .enumerate_pixels()
        .filter(|(x, y, pixel)| {
            let other = later.get_pixel(*x, *y);
            pixel.0.iter().zip(other.0).any(|(a, b)| a.abs_diff(b) > 24)
        })
        .map(|(x, y, _)| (x, y))
        .collect();
    assert!(differ.len() > 5000, "the arm has moved, but {} pixels differ", differ.len());
    // What moved is a part of a picture of many colours, not a page that is laid out in another way.
    let top = differ.iter().map(|at| at.1).min().unwrap();
    let bottom = differ.iter().map(|at| at.1).max().unwrap();
    assert!(bottom - top < 700, "rows {top} to {bottom}");
    let mut colours: Vec<[u8; 3]> = differ.iter().map(|at| first.get_pixel(at.0, at.1).0).collect();
    colours.sort_unstable();
    colours.dedup();
    assert!(colours.len() > 300, "{} colours", colours.len());
}

#[test]
fn the_report_of_an_experiment_can_be_made_from_its_recordings_alone() {
    let folder = tempfile::tempdir().unwrap();
    let scene = small_scene(folder.path());
    let run = |level: &str| {
        let out = folder.path().join(level);
        let args =
            ["trials", "--scene", &scene, "--trials", "2", "--estimators", "grip,truth", "--record", level];
        let done = common::grip(&[&args[..], &["--out", out.to_str().unwrap()]].concat());
        assert_eq!(code(&done), 0, "{}", stderr(&done));
        out
    };
    let [none, events] = ["none", "events"].map(run);
    let trials = |folder: &Path| std::fs::read(folder.join("trials.jsonl")).unwrap();
    assert_eq!(trials(&none), trials(&events));
    assert!(!none.join("records").exists());
    assert_eq!(std::fs::read_dir(events.join("records")).unwrap().count(), 4);
    let page = folder.path().join("report.html");
    let report = common::grip(&["report", events.to_str().unwrap(), "--out", page.to_str().unwrap()]);
    assert_eq!(code(&report), 0, "{}", stderr(&report));
    python(
        "check_records.py",
        "pandas, pyarrow",
        &[Path::new(&script("examples/records.py")), &events, &page],
    );
    // A shard and its merge have them, too.
    let merged = folder.path().join("merged");
    let done = common::grip(&["merge", events.to_str().unwrap(), "--out", merged.to_str().unwrap()]);
    assert_eq!(code(&done), 0, "{}", stderr(&done));
    let name = "records/1-grocery-base-grip/events.jsonl";
    assert_eq!(std::fs::read(events.join(name)).unwrap(), std::fs::read(merged.join(name)).unwrap());
}

#[test]
fn what_fails_is_recorded_if_nothing_is_said() {
    if !common::has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let scene = small_scene(folder.path());
    let out = folder.path().join("out");
    let estimators = format!("truth,none=cmd:python3 {} 1 1 crash", script("tests/estimators/faulty.py"));
    let args =
        ["trials", "--scene", &scene, "--trials", "1", "--renderer", "cpu", "--estimators", &estimators];
    let done = common::grip(&[&args[..], &["--out", out.to_str().unwrap()]].concat());
    assert_eq!(code(&done), 0, "{}", stderr(&done));
    let packed =
        |line: &Value| (line["estimator"].as_str().unwrap().to_owned(), line["packed"] == line["requested"]);
    let results: Vec<(String, bool)> = common::trials(&out).iter().map(packed).collect();
    assert_eq!(results, [("none".to_owned(), false), ("truth".to_owned(), true)]);
    let kept: Vec<_> =
        std::fs::read_dir(out.join("records")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(kept, ["1-grocery-base-none"]);
}
