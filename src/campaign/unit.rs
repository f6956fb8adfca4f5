//! Runs a unit: once, whoever else tries to, and on from where a killed run has left it.

use std::fs::{File, TryLockError};
use std::path::Path;
use std::time::{Duration, Instant};
use std::{fmt, io};

use anyhow::{Context, Result, ensure};
use grip_sim::bop;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::manifest::{Campaign, FileDigest, Unit, digest, names_below};
use super::node::Node;
use crate::progress::{Interrupted, Progress};

/// Version of done.json.
pub const SCHEMA: &str = "grip.campaign-unit/1";
/// Version of failed.json.
pub const FAILED_SCHEMA: &str = "grip.campaign-failed/1";
/// In the folder of a unit that is done.
pub const DONE: &str = "done.json";
/// In the folder of a unit that cannot be done.
pub const FAILED: &str = "failed.json";
/// Held by whoever runs it.
const LOCK: &str = ".lock";
/// How long it is waited for: a killed run has it until the system has cleared it away.
const LOCK_WAIT: Duration = Duration::from_secs(15);

/// What can run the items of a unit.
pub trait Work {
    /// Makes sure that what this unit alone reads is what it was when the campaign was planned.
    ///
    /// # Errors
    /// Names what is not.
    fn check(&self, unit: &Unit) -> Result<()>;

    /// Runs what the unit's folder lacks, on so many threads. Results are in the folder when this returns, whole, in their order, and in
    /// the same bytes however often it was killed before.
    ///
    /// # Errors
    /// When something other than a result comes out; what is done by then stays in the folder.
    fn run(&self, unit: &Unit, folder: &Path, jobs: usize, progress: &dyn Progress) -> Result<Ran>;
}

/// What has become of a unit's items.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ran {
    /// Results.
    pub results: u64,
    /// Those that cannot be had: no layout, no grasp.
    pub left_out: u64,
    /// Results that were there before this run.
    pub kept: u64,
}

/// done.json: a unit is done.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DoneFile {
    schema: String,
    /// SHA-256 of campaign.json.
    pub campaign: String,
    /// The unit's number.
    pub unit: usize,
    /// How many results it has.
    pub results: u64,
    /// How many more it would have, if they could be had: no layout, no grasp.
    pub left_out: u64,
    /// The machine that ended it.
    pub node: Node,
    /// Results that were made in the last run, the one that ended it.
    pub made: u64,
    /// How long that took, seconds.
    pub wall_s: f64,
    /// Its files.
    pub files: Vec<FileDigest>,
}

/// failed.json: a unit cannot be done.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FailedFile {
    schema: String,
    /// What was said.
    pub reason: String,
    /// The machine.
    pub node: Node,
}

/// What became of the attempt to run a unit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// It is done now.
    Done(Ran),
    /// It was done before.
    WasDone,
    /// It cannot be done, and why: a trial itself went wrong. Run again it would do so again.
    Failed(String),
}

/// Another process runs the unit.
#[derive(Debug)]
pub struct Busy(String);

impl fmt::Display for Busy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: another process runs this unit", self.0)
    }
}

impl std::error::Error for Busy {}

/// Whether an error is one of the machine or the moment, so that it is worth while to try again: a full disk, another process, a file
/// system that does not answer, a caller that wants an end.
pub fn passes(error: &anyhow::Error) -> bool {
    use io::ErrorKind as Kind;
    // Input/output error, and too many open files, which have no kind of their own.
    const NUMBERS: [i32; 3] = [5, 23, 24];
    error.chain().any(|cause| {
        let reason = match cause.downcast_ref::<grip_sim::Error>() {
            Some(grip_sim::Error::Io { reason, .. }) => Some(reason),
            _ => cause.downcast_ref::<io::Error>(),
        };
        let passing = reason.is_some_and(|reason| {
            let kind = matches!(
                reason.kind(),
                Kind::StorageFull
                    | Kind::QuotaExceeded
                    | Kind::StaleNetworkFileHandle
                    | Kind::TimedOut
                    | Kind::Interrupted
                    | Kind::ResourceBusy
                    | Kind::OutOfMemory
                    | Kind::HostUnreachable
                    | Kind::NetworkUnreachable
                    | Kind::NetworkDown
            );
            kind || reason.raw_os_error().is_some_and(|number| NUMBERS.contains(&number))
        });
        passing || cause.is::<Busy>() || cause.is::<Interrupted>()
    })
}

/// What done.json of a unit says; none where it is not done.
///
/// # Errors
/// When it is damaged, or says that it is of another campaign or unit.
pub fn done(campaign: &Campaign, unit: usize) -> Result<Option<DoneFile>> {
    let path = campaign.unit_folder(unit).join(DONE);
    let text = match std::fs::read(&path) {
        Ok(text) => text,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error).with_context(|| format!("{}: cannot be read", path.display())),
    };
    let again = "remove the unit's folder and run it again";
    let done: DoneFile =
        serde_json::from_slice(&text).with_context(|| format!("{}: is damaged; {again}", path.display()))?;
    ensure!(
        done.schema == SCHEMA && done.campaign == campaign.sha256,
        "{}: is of another campaign; {again}",
        path.display()
    );
    ensure!(done.unit == unit, "{}: is of unit {}; {again}", path.display(), done.unit);
    Ok(Some(done))
}

/// Why a unit cannot be done; none where nobody has said so.
pub fn failed(campaign: &Campaign, unit: usize) -> Option<FailedFile> {
    let text = std::fs::read(campaign.unit_folder(unit).join(FAILED)).ok()?;
    serde_json::from_slice(&text).ok()
}

/// Whether somebody runs the unit at this moment.
pub fn is_running(campaign: &Campaign, unit: usize) -> bool {
    let file = File::open(campaign.unit_folder(unit).join(LOCK));
    file.is_ok_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)))
}

/// Makes sure that the files of a unit that is done are what they were when it was.
///
/// # Errors
/// Names the one that is not, or is missing, or one too many.
pub fn verify(campaign: &Campaign, done: &DoneFile) -> Result<()> {
    let folder = campaign.unit_folder(done.unit);
    let mut there = names_of_results(&folder)?;
    for file in &done.files {
        let path = folder.join(&file.path);
        let now = digest(&path)?;
        ensure!(
            now.sha256 == file.sha256,
            "{}: is not what it was when the unit was done; remove the unit's folder and run it again",
            path.display()
        );
        there.retain(|name| name != &file.path);
    }
    ensure!(
        there.is_empty(),
        "{}: {}: was not there when the unit was done; remove it",
        folder.display(),
        there.join(", ")
    );
    Ok(())
}

fn names_of_results(folder: &Path) -> Result<Vec<String>> {
    let names = names_below(folder)?;
    Ok(names.into_iter().filter(|name| name != DONE && name != FAILED).collect())
}

/// Runs a unit. A panic is an outcome like an error of the work, which is written down.
///
/// # Errors
/// When the unit could be done another time ([`passes`]), its folder is not ours, or its inputs have changed.
pub fn run(
    campaign: &Campaign,
    number: usize,
    work: &dyn Work,
    node: &Node,
    jobs: usize,
    progress: &dyn Progress,
) -> Result<Outcome> {
    let unit = &campaign.manifest.units[number];
    let folder = campaign.unit_folder(number);
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("{}: cannot be made; check permissions", folder.display()))?;
    let lock = lock(LOCK_WAIT, &folder)?;
    if done(campaign, number)?.is_some() {
        return Ok(Outcome::WasDone);
    }
    clear(&folder).with_context(|| format!("{}: cannot be cleared", folder.display()))?;
    work.check(unit)?;
    let began = Instant::now();
    let ran =
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| work.run(unit, &folder, jobs, progress)));
    let reason = match ran {
        Ok(Ok(ran)) => {
            let expected = campaign.manifest.work.results(unit);
            ensure!(
                ran.results + ran.left_out == expected,
                "unit {number}: {} results and {} left out, of {expected}: this is an error of the program",
                ran.results,
                ran.left_out
            );
            let mut files = Vec::new();
            for name in names_of_results(&folder)? {
                files.push(FileDigest { path: name.clone(), ..digest(&folder.join(&name))? });
            }
            let done = DoneFile {
                schema: SCHEMA.into(),
                campaign: campaign.sha256.clone(),
                unit: number,
                results: ran.results,
                left_out: ran.left_out,
                node: node.clone(),
                made: ran.results.saturating_sub(ran.kept),
                wall_s: (began.elapsed().as_secs_f64() * 1e3).round() / 1e3,
                files,
            };
            bop::write_atomic(&folder.join(DONE), (serde_json::to_string_pretty(&done)? + "\n").as_bytes())?;
            // Whoever waits for it finds the unit done.
            let _ = std::fs::remove_file(folder.join(LOCK));
            drop(lock);
            return Ok(Outcome::Done(ran));
        }
        Ok(Err(error)) if passes(&error) => return Err(error),
        Ok(Err(error)) => format!("{error:#}"),
        Err(panic) => {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            format!(
                "panicked: {}",
                text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("no reason given")
            )
        }
    };
    let failed = FailedFile { schema: FAILED_SCHEMA.into(), reason: reason.clone(), node: node.clone() };
    bop::write_atomic(&folder.join(FAILED), (serde_json::to_string_pretty(&failed)? + "\n").as_bytes())?;
    Ok(Outcome::Failed(reason))
}

/// Takes away what killed runs have left half-written, and what an earlier one has said.
fn clear(folder: &Path) -> Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name == FAILED {
            std::fs::remove_file(entry.path())?;
        } else if name.starts_with('.') && name.ends_with(".tmp") {
            if entry.file_type()?.is_dir() {
                std::fs::remove_dir_all(entry.path())?;
            } else {
                std::fs::remove_file(entry.path())?;
            }
        }
    }
    Ok(())
}

pub(super) fn lock(wait: Duration, folder: &Path) -> Result<File> {
    let path = folder.join(LOCK);
    let cannot = || format!("{}: cannot be written; check permissions", path.display());
    let file = File::options().create(true).truncate(false).write(true).open(&path).with_context(cannot)?;
    let until = Instant::now() + wait;
    loop {
        match file.try_lock() {
            Ok(()) => return Ok(file),
            Err(TryLockError::WouldBlock) if Instant::now() < until => std::thread::sleep(wait / 60),
            Err(TryLockError::WouldBlock) => return Err(Busy(folder.display().to_string()).into()),
            Err(TryLockError::Error(error)) => {
                log::warn!(
                    "{}: cannot be locked: {error}; make sure that no other process runs this unit",
                    path.display()
                );
                return Ok(file);
            }
        }
    }
}
