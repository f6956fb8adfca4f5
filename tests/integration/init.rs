//! The program is whole: alone in an empty folder it renders and packs, and writes out what is built into it.

use std::path::Path;
use std::process::{Command, Output};

use crate::common::{code, stderr};

/// Runs a copy of the program that lies alone in `folder`, there.
fn alone(folder: &Path, args: &[&str]) -> Output {
    let program = folder.join("grip-alone");
    if !program.exists() {
        std::fs::copy(env!("CARGO_BIN_EXE_grip"), &program).unwrap();
    }
    Command::new(&program).args(args).current_dir(folder).env_remove("GRIP_YCB_DIR").output().unwrap()
}

#[test]
fn the_program_alone_renders_packs_and_makes_data_sets() {
    let folder = tempfile::tempdir().unwrap();
    for args in [
        &["render", "--renderer", "cpu", "--out", "seen"][..],
        &["pack", "--estimator", "truth", "--items", "1", "--renderer", "cpu", "--out", "run"],
        &["scenes", "--scenes", "1", "--views", "B", "--renderer", "cpu", "--out", "set"],
        &["objects"],
        &["robot"],
    ] {
        let output = alone(folder.path(), args);
        assert_eq!(code(&output), 0, "{args:?}: {}", stderr(&output));
    }
    for file in ["seen/rgb.png", "run/report.html", "set/dataset.json"] {
        assert!(folder.path().join(file).exists(), "{file}");
    }
}

#[test]
fn what_is_written_out_is_used_where_it_lies_and_nothing_is_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let output = alone(folder.path(), &["init", "mine"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let mine = folder.path().join("mine");
    let scene = mine.join("scenes/grocery.toml");
    let text = std::fs::read_to_string(&scene).unwrap();
    std::fs::write(&scene, text.replace("name = \"grocery\"", "name = \"mine\"")).unwrap();
    let rendered = Command::new(folder.path().join("grip-alone"))
        .args(["render", "--renderer", "cpu", "--out", "seen"])
        .current_dir(&mine)
        .env_remove("GRIP_YCB_DIR")
        .output()
        .unwrap();
    assert_eq!(code(&rendered), 0, "{}", stderr(&rendered));
    let camera = std::fs::read_to_string(mine.join("seen/camera.json")).unwrap();
    assert!(camera.contains("\"scene\": \"mine\""), "{camera}");
    let again = alone(folder.path(), &["init", "mine"]);
    assert_eq!(code(&again), 2);
    assert!(stderr(&again).contains("not an empty folder"), "{}", stderr(&again));
}
