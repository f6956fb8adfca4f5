//! Grasp planners of others: `--grasper cmd:PROGRAM`.

use std::path::Path;

use serde_json::Value;

use crate::common::{code, grip, has_python, has_python_with, script, small_scene, stderr, stdout, trials};

/// Packs the groceries of a seed where they truly are.
fn packed_by(grasper: &str, out: &Path) -> Value {
    let args = ["pack", "--seed", "7601", "--renderer", "cpu", "--estimator", "truth", "--grasper", grasper];
    let output = grip(&[&args[..], &["--json", "--out", out.to_str().unwrap()]].concat());
    assert!(code(&output) <= 1, "{}", stderr(&output));
    serde_json::from_str(&stdout(&output)).unwrap()
}

#[test]
fn boxes_around_poses_are_gripped_and_outputs_name_the_grasper() {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let result = packed_by(&format!("cmd:python3 {}", script("examples/graspers/template.py")), &out);
    assert!(result["packed"].as_u64().unwrap() >= 3, "{result}");
    assert_eq!(result["grasper"], "template");
    // What it did not pack failed by its grasps, and no other ones were tried.
    for item in result["items"].as_array().unwrap() {
        if item["outcome"] == "no_grasp" {
            assert!(item["reason"].as_str().unwrap().ends_with("by grasps of template"), "{item}");
        }
    }
    let text = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let scenario: Value = serde_json::from_str(&text("scenario.json")).unwrap();
    assert!(scenario["grasper"]["command"].as_str().unwrap().contains("template.py"), "{scenario}");
    assert!(text("report.html").contains("grasps of template"));
}

#[test]
fn depth_alone_is_enough_to_grip_by() {
    if !has_python_with("numpy") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let command = format!("edges=cmd:python3 {}", script("examples/graspers/antipodal_depth.py"));
    let result = packed_by(&command, &folder.path().join("run"));
    assert!(result["packed"].as_u64().unwrap() >= 3, "{result}");
    assert_eq!(result["grasper"], "edges");
}

#[test]
fn what_a_grasper_does_wrong_ends_its_trial_and_no_other() {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let scene = small_scene(folder.path());
    let settings = folder.path().join("settings.toml");
    std::fs::write(&settings, "[trial]\ngrasper_timeout_s = 5.0\nmax_pushes = 0\n").unwrap();
    let run = |how: &str, out: &str, more: &[&str]| {
        let out = folder.path().join(out);
        let graspers = format!("grip,{how}=cmd:python3 {} 7 {how}", script("tests/graspers/faulty.py"));
        let mut args = vec!["trials", "--scene", &scene, "--trials", "2", "--seed", "6", "--renderer", "cpu"];
        args.extend(["--estimators", "truth", "--graspers", &graspers]);
        args.extend(["--settings", settings.to_str().unwrap(), "--out", out.to_str().unwrap()]);
        args.extend(more);
        let output = grip(&args);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        out
    };
    for (how, words) in
        [("crash", "nearly"), ("hang", "no answer within 5 s"), ("nonsense", "is not a rotation")]
    {
        let all = trials(&run(how, how, &[]));
        assert_eq!(all.len(), 4);
        for trial in &all {
            if trial["grasper"] == "grip" {
                assert!(trial["packed"].as_u64().unwrap() >= 1, "{trial}");
                continue;
            }
            assert_eq!(trial["grasper"], how);
            for item in trial["items"].as_array().unwrap() {
                let failed = trial["seed"] == 7;
                assert_eq!(item["outcome"], if failed { "grasper_failed" } else { "no_grasp" }, "{item}");
                let wanted =
                    if failed { words.to_owned() } else { format!("no grasp is given, by grasps of {how}") };
                assert!(item["reason"].as_str().unwrap().contains(&wanted), "{item}");
            }
        }
    }
    // What cannot even greet is a wrong command, and leaves nothing.
    let none = folder.path().join("none");
    let wrong = ["trials", "--scene", &scene, "--graspers", "cmd:/no/such/program"];
    let output = grip(&[&wrong[..], &["--out", none.to_str().unwrap()]].concat());
    assert!(code(&output) == 2 && stderr(&output).contains("cannot be started"), "{}", stderr(&output));
    assert!(!none.exists());
    // In parts, put together: the same. Another grasper is another experiment.
    let parts = ["1/2", "2/2"].map(|part| run("crash", &part.replace('/', "-"), &["--shard", part]));
    let [first, second] = [&parts[0], &parts[1]].map(|path| path.to_str().unwrap());
    let merge = |folders: &[&str], out: &Path| {
        grip(&[&["merge"], folders, &["--out", out.to_str().unwrap()]].concat())
    };
    let merged = folder.path().join("merged");
    let output = merge(&[first, second], &merged);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(stdout(&output).contains("truth + crash"), "{}", stdout(&output));
    let bytes = |path: &Path| std::fs::read(path.join("trials.jsonl")).unwrap();
    assert!(bytes(&merged) == bytes(&folder.path().join("crash")));
    let other = folder.path().join("hang");
    let output = merge(&[first, other.to_str().unwrap()], &folder.path().join("mixed"));
    assert!(code(&output) == 2 && stderr(&output).contains("graspers"), "{}", stderr(&output));
    // Ours from files, and theirs: one of them.
    let both = ["pack", "--grasps", "here", "--grasper", "cmd:true"];
    let output = grip(&[&both[..], &["--out", none.to_str().unwrap()]].concat());
    assert!(code(&output) == 2 && stderr(&output).contains("--grasps is for"), "{}", stderr(&output));
}
