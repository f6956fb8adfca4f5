//! Shards become one experiment.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use super::plan::{BUILD, FILMS, Key, LEFT_OUT, MANIFEST, TIMINGS, TRIALS, differs, read_manifest};
use super::trials::{LeftOut, TimingLine};
use super::{items, journal};
use crate::run_dir::RunDir;
use crate::score::outcome::TrialResult;

/// A whole experiment.
pub struct Merged {
    /// Its results, in their order.
    pub results: Vec<TrialResult>,
    /// How many of its trials have no result because their objects could not be laid out.
    pub left_out: usize,
}

/// Writes the experiment of which `folders` are parts.
///
/// # Errors
/// When the folders are not parts of one experiment, two of them disagree about a trial, or `out` cannot be written.
pub fn merge(folders: &[PathBuf], out: &Path) -> Result<Merged> {
    let run = RunDir::begin(out)?;
    let mut manifest: Option<Value> = None;
    let mut trials: BTreeMap<Key, TrialResult> = BTreeMap::new();
    let mut timings: BTreeMap<Key, TimingLine> = BTreeMap::new();
    let mut left_out: BTreeMap<Key, LeftOut> = BTreeMap::new();
    for folder in folders {
        let mut part = read_manifest(folder)?;
        part["shard"] = Value::Null;
        match &manifest {
            None => manifest = Some(part),
            Some(whole) => {
                if whole[BUILD] != part[BUILD] {
                    log::warn!(
                        "{}: was made by another build than {}; results may differ in last bits",
                        folder.display(),
                        folders[0].display()
                    );
                }
                if let Some(field) = differs(whole, &part) {
                    bail!(
                        "{}: {field} differs from {}; only parts of one experiment can be merged",
                        folder.join(MANIFEST).display(),
                        folders[0].join(MANIFEST).display()
                    );
                }
            }
        }
        for trial in journal::read::<TrialResult>(&folder.join(TRIALS))? {
            let key = Key::of(&trial);
            if let Some(other) = trials.get(&key) {
                ensure!(
                    other == &trial,
                    "{}: the trial {key:?} has another result than in a folder before; were they run by the same program?",
                    folder.display()
                );
                continue;
            }
            let film = key.film();
            match std::fs::read(folder.join(&film)) {
                Ok(bytes) => run.write(&film.to_string_lossy(), bytes)?,
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
                Err(error) => return Err(error).with_context(|| folder.join(&film).display().to_string()),
            }
            let record = key.record();
            for (name, path) in files_in(&folder.join(&record))? {
                let bytes = std::fs::read(&path).with_context(|| path.display().to_string())?;
                run.write(&record.join(name).to_string_lossy(), bytes)?;
            }
            trials.insert(key, trial);
        }
        for line in journal::read::<TimingLine>(&folder.join(TIMINGS))? {
            timings.insert(line.key.clone(), line);
        }
        for line in journal::read::<LeftOut>(&folder.join(LEFT_OUT))? {
            left_out.insert(line.key.clone(), line);
        }
    }
    let manifest = manifest.context("give at least one folder")?;
    let trials: Vec<TrialResult> = trials.into_values().collect();
    run.write(MANIFEST, serde_json::to_string_pretty(&manifest)?)?;
    run.write(TRIALS, journal::text(&trials)?)?;
    run.write(TIMINGS, journal::text(&timings.into_values().collect::<Vec<_>>())?)?;
    let left_out: Vec<LeftOut> = left_out.into_values().collect();
    run.write(LEFT_OUT, journal::text(&left_out)?)?;
    run.write(items::FILE, items::bytes(&trials)?)?;
    run.folder(FILMS)?;
    run.finish()?;
    Ok(Merged { results: trials, left_out: left_out.len() })
}

/// The files in a folder of two levels, with their names from there; none where it is not.
pub(crate) fn files_in(folder: &Path) -> Result<Vec<(PathBuf, PathBuf)>> {
    let mut files = Vec::new();
    if !folder.is_dir() {
        return Ok(files);
    }
    let listed = |folder: &Path| -> Result<Vec<PathBuf>> {
        let entries = std::fs::read_dir(folder).with_context(|| folder.display().to_string())?;
        let mut paths = entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>()?;
        paths.sort();
        Ok(paths)
    };
    for path in listed(folder)? {
        let inside = if path.is_dir() { listed(&path)? } else { vec![path] };
        for path in inside {
            files.push((path.strip_prefix(folder)?.to_path_buf(), path));
        }
    }
    Ok(files)
}
