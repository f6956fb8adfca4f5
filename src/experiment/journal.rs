//! Results, a line of JSON each, appended as they come. A kill at any moment loses at most what was not finished: a line
//! that was cut short is dropped when the journal is opened again.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use grip_sim::bop;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// How long another run's lock is waited for: one that was killed has it until the system has cleared it away, which takes seconds.
const LOCK_WAIT: Duration = Duration::from_secs(15);

/// A file of results that this process alone appends to.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    /// Bytes of whole lines.
    whole: u64,
}

impl Journal {
    /// Opens or makes the journal at `path`, and reads what is in it.
    ///
    /// # Errors
    /// When another process has it open, or it cannot be read or written, or a line but the last is damaged.
    pub fn open<T: DeserializeOwned>(path: &Path) -> Result<(Self, Vec<T>)> {
        Self::open_within(LOCK_WAIT, path)
    }

    fn open_within<T: DeserializeOwned>(wait: Duration, path: &Path) -> Result<(Self, Vec<T>)> {
        let cannot = || format!("{}: cannot be written; check permissions", path.display());
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .with_context(cannot)?;
        let mut lock = file.try_lock();
        let until = Instant::now() + wait;
        if matches!(lock, Err(TryLockError::WouldBlock)) {
            log::warn!("{}: another run is writing to it; waits up to {wait:?}", path.display());
        }
        while matches!(lock, Err(TryLockError::WouldBlock)) && Instant::now() < until {
            std::thread::sleep(wait / 40);
            lock = file.try_lock();
        }
        match lock {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                bail!(
                    "{}: another run is writing to it; wait for it, or choose another --out",
                    path.display()
                )
            }
            // A file system without locks.
            Err(TryLockError::Error(error)) => log::warn!("{}: cannot be locked: {error}", path.display()),
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).with_context(|| format!("{}: cannot be read", path.display()))?;
        let whole = bytes.iter().rposition(|&b| b == b'\n').map_or(0, |at| at + 1);
        if whole < bytes.len() {
            log::info!("{}: drops a line that was cut short", path.display());
            file.set_len(whole as u64).with_context(cannot)?;
        }
        file.seek(SeekFrom::Start(whole as u64)).with_context(cannot)?;
        let lines = parse(&bytes[..whole], path)?;
        Ok((Self { path: path.to_path_buf(), file, whole: whole as u64 }, lines))
    }

    /// Adds a result.
    ///
    /// # Errors
    /// When it cannot be written, such as on a full disk.
    pub fn append(&mut self, line: &impl Serialize) -> Result<()> {
        let mut text = serde_json::to_string(line)?;
        text.push('\n');
        // One call, so that a line is seldom cut; on the disk before the next one is begun.
        let written = self.file.write_all(text.as_bytes()).and_then(|()| self.file.sync_data());
        match written {
            Ok(()) => self.whole += text.len() as u64,
            // Another thread may still have a line to write, and find room for it: not behind half a line.
            Err(_) => {
                let _ = self.file.set_len(self.whole);
                let _ = self.file.seek(SeekFrom::Start(self.whole));
            }
        }
        written.with_context(|| format!("{}: cannot be written; is the disk full?", self.path.display()))
    }
}

/// Reads a journal that nobody writes to any more.
///
/// # Errors
/// When it cannot be read, or a line is damaged.
pub fn read<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>> {
    let bytes = std::fs::read(path).with_context(|| format!("{}: cannot be read", path.display()))?;
    let whole = bytes.iter().rposition(|&b| b == b'\n').map_or(0, |at| at + 1);
    parse(&bytes[..whole], path)
}

fn parse<T: DeserializeOwned>(bytes: &[u8], path: &Path) -> Result<Vec<T>> {
    bytes
        .split(|&b| b == b'\n')
        .enumerate()
        .filter(|(_, line)| !line.is_empty())
        .map(|(i, line)| {
            serde_json::from_slice(line).with_context(|| {
                let path = path.display();
                format!("{path}: line {} is damaged, or of another version; choose another --out", i + 1)
            })
        })
        .collect()
}

/// Writes results as a whole file or not at all.
///
/// # Errors
/// When it cannot be written.
pub fn write_whole<T: Serialize>(path: &Path, lines: &[T]) -> Result<()> {
    Ok(bop::write_atomic(path, text(lines)?.as_bytes())?)
}

/// Results as the text of a journal.
///
/// # Errors
/// When one of them cannot be written as JSON.
pub fn text<T: Serialize>(lines: &[T]) -> Result<String> {
    let mut text = String::new();
    for line in lines {
        text += &serde_json::to_string(line)?;
        text.push('\n');
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_kill_leaves_is_read_up_to_the_last_whole_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("j.jsonl");
        {
            let (mut journal, before) = Journal::open::<[u32; 2]>(&path).unwrap();
            assert!(before.is_empty());
            journal.append(&[1, 2]).unwrap();
            journal.append(&[3, 4]).unwrap();
        }
        let whole = std::fs::read(&path).unwrap();
        // Cut at every byte: never an error, never a line lost that was whole.
        for cut in 0..=whole.len() {
            std::fs::write(&path, &whole[..cut]).unwrap();
            let (mut journal, lines) = Journal::open::<[u32; 2]>(&path).unwrap();
            assert_eq!(lines.len(), whole[..cut].iter().filter(|&&b| b == b'\n').count());
            journal.append(&[5, 6]).unwrap();
            drop(journal);
            let all: Vec<[u32; 2]> = read(&path).unwrap();
            assert_eq!(all.len(), lines.len() + 1);
            assert_eq!(all[lines.len()], [5, 6]);
        }
    }

    #[test]
    fn two_runs_do_not_write_to_one_journal() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("j.jsonl");
        let first = Journal::open::<u32>(&path).unwrap();
        let wait = Duration::from_millis(200);
        let error = Journal::open_within::<u32>(wait, &path).unwrap_err().to_string();
        assert!(error.contains("another run"), "{error}");
        // One that is about to go is waited for.
        let going = std::thread::spawn(move || {
            std::thread::sleep(wait / 2);
            drop(first);
        });
        Journal::open::<u32>(&path).unwrap();
        going.join().unwrap();
    }

    #[test]
    fn a_damaged_line_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("j.jsonl");
        std::fs::write(&path, "1\nx\n3\n").unwrap();
        let error = Journal::open::<u32>(&path).unwrap_err().to_string();
        assert!(error.contains("line 2"), "{error}");
    }
}
