//! Shards become one experiment.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use super::plan::{FILMS, Key, MANIFEST, TIMINGS, TRIALS, differs, read_manifest};
use super::trials::TimingLine;
use super::{items, journal};
use crate::outcome::TrialResult;
use crate::run_dir::RunDir;

/// Writes the experiment of which `folders` are parts; returns its results in their order.
///
/// # Errors
/// When the folders are not parts of one experiment, two of them disagree about a trial, or `out` cannot be written.
pub fn merge(folders: &[PathBuf], out: &Path) -> Result<Vec<TrialResult>> {
    let run = RunDir::begin(out)?;
    let mut manifest: Option<Value> = None;
    let mut trials: BTreeMap<Key, TrialResult> = BTreeMap::new();
    let mut timings: BTreeMap<Key, TimingLine> = BTreeMap::new();
    for folder in folders {
        let mut part = read_manifest(folder)?;
        part["shard"] = Value::Null;
        match &manifest {
            None => manifest = Some(part),
            Some(whole) => {
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
            trials.insert(key, trial);
        }
        for line in journal::read::<TimingLine>(&folder.join(TIMINGS))? {
            timings.insert(line.key.clone(), line);
        }
    }
    let manifest = manifest.context("give at least one folder")?;
    let trials: Vec<TrialResult> = trials.into_values().collect();
    run.write(MANIFEST, serde_json::to_string_pretty(&manifest)?)?;
    run.write(TRIALS, journal::text(&trials)?)?;
    run.write(TIMINGS, journal::text(&timings.into_values().collect::<Vec<_>>())?)?;
    run.write(items::FILE, items::bytes(&trials)?)?;
    run.folder(FILMS)?;
    run.finish()?;
    Ok(trials)
}
