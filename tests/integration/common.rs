//! Running the program as a user does.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The project's root.
pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Runs `grip` in the project's root, without scanned objects.
pub fn grip(args: &[&str]) -> Output {
    grip_on_threads(args, None)
}

/// The same with a fixed number of threads.
pub fn grip_on_threads(args: &[&str], threads: Option<usize>) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_grip"));
    command.args(args).current_dir(root()).env_remove("GRIP_YCB_DIR").env_remove("ORT_DYLIB_PATH");
    if let Some(threads) = threads {
        command.env("RAYON_NUM_THREADS", threads.to_string());
    }
    command.output().expect("grip starts")
}

/// Exit code, which is never a signal or a panic (101).
pub fn code(output: &Output) -> i32 {
    let code = output.status.code().expect("ended by itself");
    assert_ne!(code, 101, "panicked: {}", stderr(output));
    code
}

/// Standard error as text.
pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Standard output as text.
pub fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// A copy of the default scene in `folder` with `edit` applied; its robot and conditions are named by absolute paths.
pub fn edited_scene(folder: &Path, edit: impl Fn(String) -> String) -> PathBuf {
    let text = std::fs::read_to_string(root().join("scenes/grocery.toml")).expect("default scene");
    let robots = root().join("robots");
    let text = text.replace("../robots", robots.to_str().expect("UTF-8 path"));
    let path = folder.join("scene.toml");
    std::fs::write(&path, edit(text)).expect("writable");
    path
}

/// A scene of two objects, whose trials are short.
pub fn small_scene(folder: &Path) -> String {
    let scene = edited_scene(folder, |text| {
        let names = text.find("names = [").unwrap();
        let end = names + text[names..].find(']').unwrap() + 1;
        format!("{}names = [\"005_tomato_soup_can\", \"004_sugar_box\"]{}", &text[..names], &text[end..])
    });
    scene.to_str().unwrap().to_owned()
}

/// The path of a file of the project.
pub fn script(name: &str) -> String {
    root().join(name).to_str().unwrap().to_owned()
}

/// The results of an experiment.
pub fn trials(folder: &Path) -> Vec<serde_json::Value> {
    let text = std::fs::read_to_string(folder.join("trials.jsonl")).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Whether there is a Python for programs that need no packages; must be where `GRIP_REQUIRE_PYTHON` is set.
pub fn has_python() -> bool {
    has_python_with("json")
}

/// The same with these modules, separated by commas.
#[allow(clippy::print_stdout, reason = "tests")]
pub fn has_python_with(modules: &str) -> bool {
    let ready = Command::new("python3").args(["-c", &format!("import {modules}")]).output();
    let ready = ready.is_ok_and(|output| output.status.success());
    assert!(
        ready || std::env::var_os("GRIP_REQUIRE_PYTHON").is_none(),
        "GRIP_REQUIRE_PYTHON is set but there is no python3 with {modules}"
    );
    if !ready {
        println!("SKIPPED: no python3 with {modules}");
    }
    ready
}

/// Runs a script of `tests/` by Python: without these modules it is skipped, or fails where
/// `GRIP_REQUIRE_PYTHON` is set. What it prints is printed; it must end with 0.
#[allow(clippy::print_stdout, reason = "tests")]
pub fn python(script: &str, modules: &str, args: &[&Path]) {
    if !has_python_with(modules) {
        return;
    }
    // Without -B Python leaves what it compiled among the sources.
    let output = Command::new("python3")
        .arg("-B")
        .arg(root().join("tests").join(script))
        .args(args)
        .output()
        .expect("python3 starts");
    println!("{}", stdout(&output));
    assert!(output.status.success(), "{}{}", stdout(&output), stderr(&output));
}
