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

/// Whether there is a Python for estimators that need no packages; must be where `GRIP_REQUIRE_PYTHON` is set.
pub fn has_python() -> bool {
    has_python_with("json")
}

#[allow(clippy::print_stdout, reason = "tests")]
fn has_python_with(modules: &str) -> bool {
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
