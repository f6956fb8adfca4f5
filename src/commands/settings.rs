//! `grip settings`: the tree of settings.

use anyhow::Result;

use super::{Done, output};
use crate::cli::SettingsFile;

/// Prints the whole tree, with what the file changes.
pub fn run(file: &SettingsFile) -> Result<Done> {
    output::data(format_args!("{}", file.load()?.to_toml()?.trim_end()))?;
    Ok(Done::Fully)
}
