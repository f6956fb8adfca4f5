//! `grip init`: the built-in scenes, conditions, objects and robot as files, to be edited.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use grip_sim::files;
use grip_sim::unfinished::Unfinished;

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
    // Each of its folders appears whole, at the end.
    let write = || {
        std::fs::create_dir_all(folder)?;
        let mut parts: BTreeMap<&str, Unfinished> = BTreeMap::new();
        for (relative, bytes) in &files {
            let (part, inside) = relative.split_once('/').unwrap_or((relative, ""));
            let building = match parts.entry(part) {
                Entry::Occupied(entry) => entry.into_mut(),
                Entry::Vacant(entry) => entry.insert(Unfinished::beside(&folder.join(part))?),
            };
            let path = building.path().join(inside);
            std::fs::create_dir_all(path.parent().unwrap_or(folder))?;
            std::fs::write(&path, bytes)?;
        }
        parts.into_iter().try_for_each(|(part, building)| building.move_to(&folder.join(part)))
    };
    let new = !folder.exists();
    write().inspect_err(|_| drop(new.then(|| std::fs::remove_dir(folder)))).with_context(|| {
        format!("{}: cannot be written; check permissions and free space", folder.display())
    })?;
    output::message(format_args!(
        "{} files in {}; there, grip takes its scenes and robot instead of those built in",
        files.len(),
        folder.display()
    ));
    Ok(Done::Fully)
}
