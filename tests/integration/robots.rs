//! Robots of others, from public packages: a Panda and a UR5e pack a box.

use std::path::{Path, PathBuf};

use grip::robot;
use grip::setup::{Setup, SetupOptions};
use grip_sim::robot::{RobotConfig, RobotModel};
use serde_json::Value;

use crate::common::{code, grip, root, stderr, stdout};

/// Where `.ci/run` puts Python packages: `package://` is looked up in both.
#[allow(clippy::print_stdout, reason = "tests")]
pub fn packages() -> Option<[PathBuf; 2]> {
    let python = root().join("target/python");
    let share = python.join("cmeel.prefix/share");
    let there = share.join("example-robot-data").is_dir() && python.join("airo_models").is_dir();
    assert!(
        there || std::env::var_os("GRIP_REQUIRE_PYTHON").is_none(),
        "GRIP_REQUIRE_PYTHON is set but example-robot-data and airo-models are not in target/python"
    );
    if !there {
        println!("SKIPPED: no example-robot-data and airo-models in target/python");
    }
    there.then_some([share, python])
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8 path")
}

/// `grip` with the packages.
fn with_packages(arguments: &[&str]) -> Option<std::process::Output> {
    let [share, python] = packages()?;
    let more = ["--package-path", text(&share), "--package-path", text(&python)];
    Some(grip(&[arguments, &more].concat()))
}

/// Packs the default groceries by true poses: what the robot, its grasps and its motions are worth.
fn packs(scene: &str) {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let arguments = [
        "pack",
        scene,
        "--estimator",
        "truth",
        "--seed",
        "6001",
        "--renderer",
        "cpu",
        "--json",
        "--out",
        text(&run),
    ];
    let Some(output) = with_packages(&arguments) else { return };
    assert!(code(&output) < 2, "{}", stderr(&output));
    let result: Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(result["requested"], 5, "{result:#}");
    assert!(result["packed"].as_u64().unwrap() >= 4, "{result:#}");
    assert_eq!(result["motion_check"]["collisions"].as_array().map(Vec::len), Some(0), "{result:#}");
    let scenario: Value =
        serde_json::from_str(&std::fs::read_to_string(run.join("scenario.json")).unwrap()).unwrap();
    let config = scenario["robot"]["config"].as_str().unwrap();
    assert!(config.ends_with(".toml") && scenario["robot"]["config_sha256"].is_string(), "{config}");
}

#[test]
fn a_panda_packs_the_default_groceries() {
    packs("scenes/panda.toml");
}

#[test]
fn a_ur5e_with_a_gripper_of_ours_packs_the_default_groceries() {
    packs("scenes/ur5e.toml");
}

#[test]
fn sampling_finds_the_pairs_that_the_makers_of_the_panda_give() {
    let Some([share, _]) = packages() else { return };
    let folder = tempfile::tempdir().unwrap();
    let urdf = share.join("example-robot-data/robots/panda_description/urdf/panda.urdf");
    let text = std::fs::read_to_string(root().join("robots/panda/panda.toml")).unwrap();
    let (without, _) = text.split_once("[self_collision]").unwrap();
    let pairs = |text: &str| {
        let path = folder.path().join("panda.toml");
        std::fs::write(&path, text).unwrap();
        let robot = RobotModel::load(&urdf, std::slice::from_ref(&share)).unwrap();
        RobotConfig::load(&path, robot).unwrap().1.allowed_pairs().to_vec()
    };
    let of_srdf = pairs(&text);
    assert!(of_srdf.len() > 30);
    assert_eq!(pairs(without), of_srdf);
}

#[test]
fn both_fit_their_scenes_and_are_drawn() {
    for scene in ["scenes/panda.toml", "scenes/ur5e.toml"] {
        let Some([share, python]) = packages() else { return };
        let options = SetupOptions {
            scene: root().join(scene),
            package_path: vec![share, python],
            ..SetupOptions::default()
        };
        let setup = Setup::open(&options).unwrap();
        let check = robot::check(&setup).unwrap();
        assert!(check.problems.is_empty(), "{scene}: {check:#?}");
        assert!(check.objects.iter().all(|object| object.grasps > 50), "{check:#?}");
        // A camera in the room sees the same wherever the arm is.
        let mut moved = setup.cell.start.clone();
        moved[0] += 0.5;
        let [before, after] = [&setup.cell.start, &moved].map(|q| *setup.cell.world_from_camera(q).iso());
        assert_eq!(before, after);
        let mut renderer = grip_sim::render::open(grip_sim::render::RendererChoice::Cpu).unwrap();
        let picture = robot::portrait(&setup, renderer.as_mut()).unwrap();
        // The pictures are of something.
        let [low, high] =
            [0, 255].map(|end: u8| picture.pixels().map(|p| p[0].abs_diff(end)).min().unwrap_or(255));
        assert!(low < 60 && high < 60, "{low} {high}");
    }
}

#[test]
fn a_file_is_guessed_from_a_urdf_and_what_a_scene_lacks_is_told() {
    let Some([share, _]) = packages() else { return };
    let folder = tempfile::tempdir().unwrap();
    let panda = share.join("example-robot-data/robots/panda_description/urdf/panda.urdf");
    let config = folder.path().join("panda.toml");
    let output = with_packages(&["robot", "--robot", text(&panda), "--write-config", text(&config)]).unwrap();
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let found = std::fs::read_to_string(&config).unwrap();
    for line in [
        "gripper = [\"panda_finger_joint1\", \"panda_finger_joint2\"]",
        "opening = 0.08",
        "link = \"panda_hand\"",
    ] {
        assert!(found.contains(line), "{line}\n{found}");
    }
    // It holds in the Panda's scene.
    let fits = [
        "robot",
        "--robot",
        text(&panda),
        "--robot-config",
        text(&config),
        "--check",
        "--scene",
        "scenes/panda.toml",
    ];
    let output = with_packages(&fits).unwrap();
    assert!(code(&output) < 2, "{}", stderr(&output));
    assert!(stdout(&output).contains("ready"), "{}", stdout(&output));
    // In the Fetch's scene there is no camera for it.
    let output = with_packages(&["pack", "--robot", text(&panda), "--robot-config", text(&config)]).unwrap();
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("camera.place: is missing"), "{}", stderr(&output));
    // And a second file is not written over the first.
    let again = with_packages(&["robot", "--robot", text(&panda), "--write-config", text(&config)]).unwrap();
    assert_eq!(code(&again), 2);
}
