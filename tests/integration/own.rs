//! The commands of docs/own.md, as they stand there but for their numbers.

use std::path::Path;
use std::process::Command;

use crate::common::{has_python, root};
use crate::robots::packages;

/// Less of the same, so that a test ends.
const SMALLER: [(&str, &str); 3] = [
    ("--trials 20", "--trials 1"),
    ("--scenes 5000", "--scenes 1"),
    ("--mode isotropic", "--mode isotropic --seeds 1 --samples 3"),
];
/// Commands of a task, at most.
const MOST: usize = 5;

/// The tasks of the page: title and commands.
fn tasks() -> Vec<(String, Vec<String>)> {
    let page = std::fs::read_to_string(root().join("docs/own.md")).unwrap();
    let task = |section: &str| {
        let (title, rest) = section.split_once('\n')?;
        let commands = rest.split_once("```sh\n")?.1.split_once("\n```")?.0;
        Some((title.to_owned(), commands.lines().map(str::to_owned).collect()))
    };
    page.split("\n## ").skip(1).filter_map(task).collect()
}

/// Runs the lines in `folder`, where the project's folders are; a box that is not packed in full ends with 1.
fn run(folder: &Path, commands: &[String]) {
    let program = Path::new(env!("CARGO_BIN_EXE_grip")).parent().unwrap();
    let path = std::env::join_paths(
        std::iter::once(program.to_path_buf())
            .chain(std::env::split_paths(&std::env::var_os("PATH").unwrap())),
    )
    .unwrap();
    // Packages are there, or are not to be had.
    for line in commands.iter().filter(|line| !line.starts_with("pip ")) {
        let mut smaller = line.clone();
        SMALLER.iter().for_each(|(all, few)| smaller = smaller.replace(all, few));
        let output =
            Command::new("sh").args(["-c", &smaller]).current_dir(folder).env("PATH", &path).output();
        let output = output.unwrap();
        let code = output.status.code().unwrap();
        let fine = code == 0 || (code == 1 && line.starts_with("grip pack"));
        assert!(fine, "{line}: {code}: {}", String::from_utf8_lossy(&output.stderr));
    }
}

fn run_task(title: &str, made: &[&str]) {
    if !has_python() {
        return;
    }
    let (_, commands) = tasks().into_iter().find(|(of, _)| of.contains(title)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for name in ["examples", "robots", "scenes", "target"] {
        std::os::unix::fs::symlink(root().join(name), folder.path().join(name)).unwrap();
    }
    run(folder.path(), &commands);
    for file in made {
        assert!(folder.path().join(file).exists(), "{file}");
    }
}

#[test]
fn each_task_takes_few_commands() {
    let tasks = tasks();
    assert_eq!(tasks.len(), 5);
    for (title, commands) in tasks {
        assert!((1..=MOST).contains(&commands.len()), "{title}: {} commands", commands.len());
    }
}

#[test]
fn an_estimator_of_ones_own_is_tried_in_the_dark() {
    run_task("My pose estimator", &["runs/mine/trials.jsonl", "runs/mine.html"]);
}

#[test]
fn success_is_measured_against_error_of_an_object_of_ones_own() {
    run_task("Success against error", &["mine.toml", "runs/bracket/grasps.jsonl", "runs/bracket.html"]);
}

#[test]
fn images_are_made_with_a_camera_of_ones_own() {
    run_task("images with my camera", &["runs/images/train_pbr/000001/scene_gt.json"]);
}

#[test]
fn a_panda_packs() {
    if packages().is_some() {
        run_task("A Panda", &["runs/panda-packed/result.json", "runs/panda/trials.jsonl"]);
    }
}

#[test]
fn objects_stand_where_they_are_put() {
    run_task(
        "objects at given poses",
        &[
            "runs/placed/rgb.png",
            "runs/placed-packed/result.json",
            "runs/placed-set/test/000001/scene_gt.json",
        ],
    );
}
