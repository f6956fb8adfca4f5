//! Campaigns as engines run them: units in any order, killed and told to end, and in the end the bytes of one undisturbed run.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::common::{self, code, grip, root, small_scene, stderr, stdout};
use serde_json::Value;

/// A campaign in a folder of its own.
struct Campaign {
    home: tempfile::TempDir,
}

impl Campaign {
    /// Plans what the file says; `{scene}` in it is a scene of two objects.
    fn plan(file: &str) -> Self {
        let home = tempfile::tempdir().unwrap();
        small_scene(home.path());
        std::fs::write(home.path().join("campaign.toml"), file).unwrap();
        let this = Self { home };
        let output = this.grip(&["campaign", "plan", &this.at("campaign.toml"), "--out", &this.at("c")]);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        this
    }

    fn at(&self, name: &str) -> String {
        self.home.path().join(name).to_str().unwrap().to_owned()
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_grip"));
        // Relative paths in the file do not depend on where the command is run; those of the undisturbed verb do.
        command
            .args(args)
            .current_dir(self.home.path())
            .env_remove("GRIP_YCB_DIR")
            .env_remove("ORT_DYLIB_PATH");
        command
    }

    fn grip(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }

    /// Exit code of a run, and what it says.
    fn run(&self, more: &[&str]) -> (i32, String) {
        let output = self.grip(&[&["campaign", "run", "c"], more].concat());
        (code(&output), stderr(&output))
    }

    fn unit(&self, unit: usize) -> PathBuf {
        self.home.path().join(format!("c/units/{unit:06}"))
    }

    /// Runs a unit until `begun` says that something of it is done, then ends it by this signal. Whether it was ended so.
    fn disturb(&self, unit: usize, signal: &str, begun: impl Fn(&Path) -> bool) -> bool {
        let unit_number = unit.to_string();
        let mut child: Child = self
            .command(&["campaign", "run", "c", "--unit", &unit_number, "--jobs", "1"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let since = Instant::now();
        while !begun(&self.unit(unit)) && child.try_wait().unwrap().is_none() {
            assert!(since.elapsed() < Duration::from_secs(300), "nothing happens");
            std::thread::sleep(Duration::from_millis(2));
        }
        let _ = Command::new("kill").args([signal, &child.id().to_string()]).stderr(Stdio::null()).status();
        let status = child.wait().unwrap();
        if signal == "-TERM" && status.code() != Some(0) {
            assert_eq!(status.code(), Some(75), "an engine is to try again");
        }
        status.code() != Some(0)
    }

    fn status(&self) -> (i32, Value) {
        let output = self.grip(&["campaign", "status", "c", "--json"]);
        (code(&output), serde_json::from_str(&stdout(&output)).unwrap())
    }

    fn merge(&self) -> Output {
        self.grip(&["campaign", "merge", "c", "--out", "merged"])
    }

    /// Merges, and holds what comes out against what the verb has written to `whole`: all but what is measured.
    fn is_the_undisturbed(&self, measured: &[&str]) {
        let output = self.merge();
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let [ours, whole] = ["merged", "whole"].map(|name| files(&self.home.path().join(name)));
        assert_eq!(ours.keys().collect::<Vec<_>>(), whole.keys().collect::<Vec<_>>());
        for (name, bytes) in &whole {
            let ours = &ours[name];
            if measured.contains(&name.as_str()) {
                let lines = |bytes: &[u8]| bytes.iter().filter(|&&byte| byte == b'\n').count();
                assert_eq!(lines(bytes), lines(ours), "{name}");
            } else {
                assert!(bytes == ours, "{name} differs");
            }
        }
    }
}

/// All files below a folder, by their names from there.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
                found.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    found
}

fn has_lines(file: &'static str, lines: usize) -> impl Fn(&Path) -> bool {
    move |unit| {
        let bytes = std::fs::read(unit.join(file)).unwrap_or_default();
        bytes.iter().filter(|&&byte| byte == b'\n').count() >= lines
    }
}

#[test]
fn trials_by_units_are_the_trials_undisturbed() {
    let campaign = Campaign::plan(
        "[campaign]\nname = \"packing\"\nunits = 2\nfilms = true\n\n[trials]\ntrials = 3\nseed = 3\nscene = \"scene.toml\"\n\
         conditions = \"base,dark\"\nestimators = \"truth\"\nrenderer = \"cpu\"\n",
    );
    let manifest: Value =
        serde_json::from_slice(&std::fs::read(campaign.at("c/campaign.json")).unwrap()).unwrap();
    assert_eq!(
        manifest["units"],
        serde_json::json!([{ "first": 3, "items": 1 }, { "first": 4, "items": 2 }])
    );
    assert_eq!(manifest["inputs"][0]["path"], "scene.toml");
    let (exit, status) = campaign.status();
    assert_eq!((exit, &status["missing"], &status["results"]), (1, &Value::from("0-1"), &Value::from(6)));

    // Told to end, then killed, then to the end: the last unit first.
    assert!(campaign.disturb(1, "-TERM", has_lines("trials.jsonl", 1)), "is too fast for this test");
    let (_, status) = campaign.status();
    assert!(status["begun"][0]["have"].as_u64() >= Some(1) && status["begun"][0]["unit"] == 1, "{status}");
    campaign.disturb(1, "-KILL", has_lines("trials.jsonl", 2));
    let (exit, said) = campaign.run(&["--unit", "1"]);
    assert_eq!(exit, 0, "{said}");
    let (exit, status) = campaign.status();
    assert_eq!((exit, &status["missing"], &status["have"]), (1, &Value::from("0"), &Value::from(4)));
    // It can be looked at on the way.
    let report = campaign.grip(&["report", "c", "--out", "now.html"]);
    assert_eq!(code(&report), 0, "{}", stderr(&report));
    let page = std::fs::read_to_string(campaign.at("now.html")).unwrap();
    assert!(
        page.contains("<p class=kind>Campaign packing, 1 of 2 units</p><h1>4 trials"),
        "{}",
        &page[..2000]
    );
    let error = campaign.merge();
    assert_eq!(code(&error), 2);
    assert!(stderr(&error).contains("1 of 2 units are not done: 0"), "{}", stderr(&error));

    // Another scene is another campaign; put back it goes on.
    let scene = campaign.at("scene.toml");
    let text = std::fs::read_to_string(&scene).unwrap();
    std::fs::write(&scene, text.replace("011_banana", "012_strawberry") + "\n# edited\n").unwrap();
    let (exit, said) = campaign.run(&["--unit", "0"]);
    assert!(exit == 2 && said.contains("scene.toml") && said.contains("planned"), "{exit}: {said}");
    std::fs::write(&scene, text).unwrap();
    // The engine says which.
    let mut by_engine = campaign.command(&["campaign", "run", "c"]);
    assert_eq!(code(&by_engine.output().unwrap()), 2, "no unit is named");
    let output = by_engine.env("SLURM_ARRAY_TASK_ID", "0").output().unwrap();
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let (exit, said) = campaign.run(&["--shard", "1/1"]);
    assert!(exit == 0 && said.contains("2 before"), "{said}");
    let (exit, status) = campaign.status();
    assert_eq!((exit, &status["done"], &status["missing"]), (0, &Value::from(2), &Value::from("")));
    let machines = status["machines"].as_array().unwrap();
    assert!(machines.len() == 1 && machines[0]["units"] == 2 && status["mixed"] == false, "{status}");

    let args = ["--trials", "3", "--seed", "3", "--scene", "scene.toml", "--conditions", "base,dark"];
    let how = ["--estimators", "truth", "--renderer", "cpu", "--out", "whole"];
    let output = campaign.grip(&[&["trials"], &args[..], &how[..]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    campaign.is_the_undisturbed(&["timings.jsonl"]);
    let report = campaign.grip(&["report", "merged", "--out", "page.html"]);
    assert_eq!(code(&report), 0, "{}", stderr(&report));
    // What is there is not replaced.
    assert!(stderr(&campaign.merge()).contains("merged: exists"));
}

#[test]
fn a_sweep_by_units_is_the_sweep_undisturbed() {
    let campaign = Campaign::plan(
        "[campaign]\nname = \"sweep\"\nitems_per_unit = 2\n\n[sweep]\nnames = [\"011_banana\", \"005_tomato_soup_can\"]\n\
         seeds = 3\nsamples = 3\naxes = \"y\"\n",
    );
    campaign.disturb(0, "-KILL", has_lines("grasps.jsonl", 2));
    campaign.disturb(0, "-TERM", has_lines("grasps.jsonl", 5));
    let (exit, said) = campaign.run(&["--unit", "1,0"]);
    assert_eq!(exit, 0, "{said}");
    let args = ["sweep", "011_banana", "005_tomato_soup_can", "--seeds", "3", "--samples", "3"];
    let output = campaign.grip(&[&args[..], &["--axes", "y", "--out", "whole"]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    campaign.is_the_undisturbed(&[]);
}

#[test]
fn scenes_and_poses_by_units_are_those_undisturbed() {
    let scenes = Campaign::plan(
        "[campaign]\nname = \"scenes\"\nunits = 2\n\n[scenes]\nscenes = 3\nviews = [\"B\"]\nrenderer = \"cpu\"\n",
    );
    let one_scene = |unit: &Path| unit.join("test/000002").is_dir();
    scenes.disturb(1, "-KILL", one_scene);
    let (exit, said) = scenes.run(&["--shard", "1/1"]);
    assert_eq!(exit, 0, "{said}");
    let output =
        scenes.grip(&["scenes", "--scenes", "3", "--views", "B", "--renderer", "cpu", "--out", "whole"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    scenes.is_the_undisturbed(&[]);

    let set = scenes.home.path().join("merged");
    let poses = Campaign::plan(&format!(
        "[campaign]\nname = \"poses\"\nunits = 2\n\n[estimate]\ndataset = '{}'\nboxes = \"gt\"\nposteriors = true\n",
        set.display()
    ));
    poses.disturb(1, "-TERM", has_lines("results.csv.partial", 3));
    let (exit, said) = poses.run(&["--unit", "0-1"]);
    assert_eq!(exit, 0, "{said}");
    let output = poses.merge();
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let (csv, posteriors) = (poses.at("whole.csv"), poses.at("whole.jsonl"));
    let output = grip(&[
        "estimate",
        set.to_str().unwrap(),
        "--boxes",
        "gt",
        "--out",
        &csv,
        "--posteriors",
        &posteriors,
    ]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    // The time of an image is measured.
    let lines = |path: &str| -> Vec<String> {
        let text = std::fs::read_to_string(path).unwrap();
        text.lines().map(|line| line.rsplit_once(',').unwrap().0.to_owned()).collect()
    };
    assert_eq!(lines(&csv), lines(&poses.at("merged/results.csv")));
    assert_eq!(
        std::fs::read(&posteriors).unwrap(),
        std::fs::read(poses.at("merged/posteriors.jsonl")).unwrap()
    );

    // Another picture is another data set.
    std::fs::remove_dir_all(poses.unit(1)).unwrap();
    let picture = set.join("test/000003/rgb/000000.png");
    std::fs::write(&picture, std::fs::read(set.join("test/000002/rgb/000000.png")).unwrap()).unwrap();
    let (exit, said) = poses.run(&["--unit", "1"]);
    assert!(exit == 2 && said.contains("not what they were"), "{exit}: {said}");
}

#[test]
fn a_unit_that_cannot_be_done_is_not_tried_again() {
    let campaign = Campaign::plan(
        "[campaign]\nname = \"boxes\"\nunits = 2\n\n[scenes]\nscenes = 2\nviews = [\"B\"]\nrenderer = \"cpu\"\n",
    );
    // A file where a folder is to be.
    std::fs::create_dir_all(campaign.unit(1)).unwrap();
    std::fs::write(campaign.unit(1).join("test"), "").unwrap();
    let (exit, said) = campaign.run(&["--unit", "1"]);
    assert!(exit == 1 && said.contains("unit 1: cannot be done"), "{exit}: {said}");
    let (exit, status) = campaign.status();
    assert_eq!(
        (exit, &status["failed"][0]["unit"], &status["missing"]),
        (1, &Value::from(1), &Value::from("0"))
    );
    let (exit, said) = campaign.run(&["--unit", "1"]);
    assert!(exit == 1 && said.contains("0 units done"), "{exit}: {said}");
    // Unless that is asked for, when the reason is gone.
    std::fs::remove_file(campaign.unit(1).join("test")).unwrap();
    let (exit, said) = campaign.run(&["--unit", "1", "--again"]);
    assert_eq!(exit, 0, "{said}");
}

/// By the schema of Kubernetes itself.
#[test]
fn the_job_for_kubernetes_is_one() {
    common::python(
        "check_kubernetes.py",
        "kubernetes_validate,yaml",
        &[&root().join("deploy/kubernetes/job.yaml")],
    );
}

#[test]
fn what_cannot_be_planned_or_run_is_said_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let (file, out) = (folder.path().join("c.toml"), folder.path().join("out"));
    let (file, out) = (file.to_str().unwrap(), out.to_str().unwrap());
    let head = "[campaign]\nname = \"a\"\nunits = 2\n";
    for (text, words) in [
        ("[sweep]\n", "campaign"),
        (head, "nothing to run"),
        ("[campaign]\nname = \"a\"\n[sweep]\nseeds = 2\n", "give units or items_per_unit"),
        (&format!("{head}[sweep]\nseeds = 1\n"), "1 to 1"),
        (&format!("{head}[sweep]\nseed_count = 1\n"), "seed_count: grip sweep has no such option"),
        (&format!("{head}[sweep]\nnames = [\"none\"]\n"), "unknown object 'none'"),
        (&format!("{head}[trials]\nout = \"x\"\n"), "the campaign decides it"),
        (&format!("{head}[trials]\nscene = \"none.toml\"\nestimators = \"truth\"\n"), "none.toml"),
        (&format!("{head}[estimate]\ndataset = \"none\"\n"), "none"),
    ] {
        std::fs::write(file, text).unwrap();
        let output = grip(&["campaign", "plan", file, "--out", out]);
        assert_eq!(code(&output), 2, "{text}");
        assert!(stderr(&output).contains(words), "{words}: {}", stderr(&output));
        assert!(!Path::new(out).exists(), "{text}");
    }
    let docs = root().join("docs");
    for verb in ["run", "status", "merge"] {
        let mut args = vec!["campaign", verb, docs.to_str().unwrap()];
        if verb == "merge" {
            args.extend(["--out", out]);
        }
        let output = grip(&args);
        assert_eq!(code(&output), 2);
        assert!(stderr(&output).contains("campaign.json"), "{}", stderr(&output));
    }
}
