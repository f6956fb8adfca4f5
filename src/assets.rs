//! Finding the files that ship with the program.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

/// A file of the project, such as `scenes/grocery.toml`: under the current folder, else under one that holds the
/// program (so that `cargo run` works from anywhere).
pub fn find(relative: &str) -> Result<PathBuf> {
    let here = Path::new(relative);
    if here.exists() {
        return Ok(here.to_path_buf());
    }
    let program = std::env::current_exe().context("cannot find out where this program lies")?;
    program
        .ancestors()
        .skip(1)
        .map(|folder| folder.join(relative))
        .find(|path| path.exists())
        .with_context(|| format!("{relative}: not under the current folder, nor beside {}; run from the project's root or name the file", program.display()))
}
