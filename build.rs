//! Tells the program which commit it was built from and how, for its records.

use std::process::Command;

fn main() {
    let git = |args: &[&str]| {
        let output = Command::new("git").args(args).output().ok().filter(|output| output.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    // Where there is no repository, as in a container, it may be said.
    let said = || std::env::var("GRIP_COMMIT").ok().filter(|commit| !commit.is_empty());
    let commit =
        git(&["rev-parse", "--short=12", "HEAD"]).or_else(said).unwrap_or_else(|| "unknown".to_owned());
    println!("cargo::rerun-if-env-changed=GRIP_COMMIT");
    println!("cargo::rustc-env=GRIP_COMMIT={commit}");
    for (name, from) in [("GRIP_TARGET", "TARGET"), ("GRIP_TARGET_FEATURES", "CARGO_CFG_TARGET_FEATURE")] {
        println!("cargo::rustc-env={name}={}", std::env::var(from).unwrap_or_default());
    }
    println!("cargo::rerun-if-changed=build.rs");
    // A commit moves one of these.
    for path in ["HEAD", "logs/HEAD"].iter().filter_map(|name| git(&["rev-parse", "--git-path", name])) {
        println!("cargo::rerun-if-changed={path}");
    }
}
