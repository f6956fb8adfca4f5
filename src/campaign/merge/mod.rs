//! All units become what one undisturbed run would have written. Units are read one after the other and line by line: memory does not
//! grow with their number.

mod estimate;
mod scenes;
mod sweep;
mod trials;

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use schemars::JsonSchema;
use serde::Serialize;

use super::manifest::{Campaign, Job, UNITS, Unit, new_folder, unit_name};
use super::select::ranges;
use super::unit::{self, DoneFile};
use crate::progress::Progress;

/// Version of what `--json` prints.
pub const SCHEMA: &str = "grip.campaign.merge/1";
/// Poses of an `estimate` campaign, in the merged folder and in those of units.
pub const RESULTS: &str = "results.csv";
/// Where each object may be, in the same.
pub const POSTERIORS: &str = "posteriors.jsonl";

/// What was merged.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Merged {
    schema: &'static str,
    /// How many units.
    pub units: usize,
    /// Trials, grasps, scenes or images.
    pub results: u64,
    /// Those that could not be had: no layout, no grasp.
    pub left_out: u64,
    /// Bytes of the units' files.
    pub bytes: u64,
    /// Canaries of the machines that did them: more than one where the machines were unlike.
    pub canaries: BTreeSet<String>,
}

/// Writes to the new folder `out` what one run of the verb would have written, after proving that every unit is there once, as it was
/// when it was done, and has the results that the manifest says.
///
/// # Errors
/// When a unit is missing, damaged, or there twice, or `out` is there or cannot be written; it is not there then.
pub fn merge(campaign: &Campaign, out: &Path, progress: &dyn Progress) -> Result<Merged> {
    let manifest = &campaign.manifest;
    nothing_else(campaign)?;
    let mut missing = Vec::new();
    for number in 0..manifest.units.len() {
        if unit::done(campaign, number)?.is_none() {
            missing.push(number);
        }
    }
    if !missing.is_empty() {
        bail!(
            "{}: {} of {} units are not done: {}",
            campaign.folder.display(),
            missing.len(),
            manifest.units.len(),
            ranges(missing)
        );
    }
    let mut merged = Merged {
        schema: SCHEMA,
        units: manifest.units.len(),
        results: 0,
        left_out: 0,
        bytes: 0,
        canaries: BTreeSet::new(),
    };
    progress.begin(manifest.units.len() as u64, 0);
    new_folder(out, |folder| {
        let mut sink: Box<dyn Sink> = match &manifest.work {
            Job::Trials { arms, .. } => Box::new(trials::Trials::begin(arms, folder)?),
            Job::Sweep { objects, cases } => Box::new(sweep::Sweep::begin(objects, *cases, folder)?),
            Job::Scenes { split } => Box::new(scenes::Scenes::begin(split, folder)?),
            Job::Estimate { posteriors } => Box::new(estimate::Estimate::begin(*posteriors, folder)?),
        };
        for (number, part) in manifest.units.iter().enumerate() {
            let done = unit::done(campaign, number)?.context("was done a moment ago")?;
            unit::verify(campaign, &done)?;
            let from = campaign.unit_folder(number);
            let expected = manifest.work.results(part);
            ensure!(
                done.results + done.left_out == expected,
                "{}: {} results and {} left out, of {expected}",
                from.display(),
                done.results,
                done.left_out
            );
            sink.add(part, &done, &from).with_context(|| format!("unit {number}"))?;
            merged.results += done.results;
            merged.left_out += done.left_out;
            merged.bytes += done.files.iter().map(|file| file.bytes).sum::<u64>();
            merged.canaries.insert(done.node.canary);
            progress.advance(1);
        }
        // What the verb writes before it begins.
        for file in &manifest.shared {
            copy(&campaign.shared().join(&file.path), &folder.join(&file.path))?;
        }
        sink.finish()
    })?;
    Ok(merged)
}

/// Takes units, one after the other.
trait Sink {
    /// The next one.
    fn add(&mut self, unit: &Unit, done: &DoneFile, folder: &Path) -> Result<()>;
    /// They are all.
    fn finish(self: Box<Self>) -> Result<()>;
}

/// That among the units' folders there is none that is no unit's.
fn nothing_else(campaign: &Campaign) -> Result<()> {
    let folder = campaign.folder.join(UNITS);
    let entries =
        std::fs::read_dir(&folder).with_context(|| format!("{}: cannot be read", folder.display()))?;
    for entry in entries {
        let name = entry?.file_name();
        let known = name
            .to_str()
            .and_then(|name| name.parse::<usize>().ok().filter(|&number| unit_name(number) == name))
            .is_some_and(|number| number < campaign.manifest.units.len());
        ensure!(known, "{}: is no unit of this campaign; remove it", folder.join(name).display());
    }
    Ok(())
}

/// A file that is written piece by piece.
struct Output {
    path: PathBuf,
    file: BufWriter<File>,
}

impl Output {
    fn create(path: PathBuf) -> Result<Self> {
        let file = File::create(&path).with_context(|| format!("{}: cannot be written", path.display()))?;
        Ok(Self { path, file: BufWriter::new(file) })
    }

    fn line(&mut self, line: &str) -> Result<()> {
        let written = self.file.write_all(line.as_bytes()).and_then(|()| self.file.write_all(b"\n"));
        written.with_context(|| self.cannot())
    }

    fn finish(mut self) -> Result<()> {
        let written = self.file.flush().and_then(|()| self.file.get_ref().sync_all());
        written.with_context(|| self.cannot())
    }

    fn cannot(&self) -> String {
        format!("{}: cannot be written; is the disk full?", self.path.display())
    }
}

/// The lines of a file, without their ends.
fn lines(path: &Path) -> Result<impl Iterator<Item = Result<String>>> {
    let cannot = format!("{}: cannot be read", path.display());
    let file = File::open(path).with_context(|| cannot.clone())?;
    Ok(BufReader::new(file).lines().map(move |line| line.with_context(|| cannot.clone())))
}

/// Copies a file, whose folder is made where it is not there.
fn copy(from: &Path, to: &Path) -> Result<()> {
    if let Some(folder) = to.parent() {
        std::fs::create_dir_all(folder).with_context(|| format!("{}: cannot be made", folder.display()))?;
    }
    std::fs::copy(from, to)
        .with_context(|| format!("{} to {}: cannot be copied", from.display(), to.display()))?;
    Ok(())
}
