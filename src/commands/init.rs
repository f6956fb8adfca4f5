//! `grip init`: the built-in scenes, conditions, objects and robot as files, to be edited.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use grip_sim::files;

use super::{Done, output, schemas};
use crate::cli::InitArgs;

/// Writes them into a new or empty folder.
pub fn run(args: &InitArgs) -> Result<Done> {
    let folder = &args.folder;
    let empty = |folder: &Path| folder.read_dir().is_ok_and(|mut entries| entries.next().is_none());
    ensure!(
        !folder.exists() || empty(folder),
        "{}: exists and is not an empty folder; choose another",
        folder.display()
    );
    let mut files: Vec<(String, Vec<u8>)> =
        files::builtin().into_iter().map(|(path, bytes)| (path, bytes.to_vec())).collect();
    for (name, schema) in schemas::all() {
        let text = serde_json::to_string_pretty(&schema)? + "\n";
        files.push((format!("schemas/{name}.json"), text.into_bytes()));
    }
    for (relative, bytes) in &files {
        let path = folder.join(relative);
        let write = || {
            std::fs::create_dir_all(path.parent().unwrap_or(folder))?;
            std::fs::write(&path, bytes)
        };
        write().with_context(|| {
            format!("{}: cannot be written; check permissions and free space", path.display())
        })?;
    }
    output::message(format_args!(
        "{} files in {}; there, grip takes its scenes and robot instead of those built in",
        files.len(),
        folder.display()
    ));
    Ok(Done::Fully)
}
