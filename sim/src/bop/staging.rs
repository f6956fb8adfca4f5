//! Files and folders that appear whole or not at all.

use std::ffi::OsStr;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// A folder under construction beside its final place; removed when dropped before [`Staging::finish`].
#[derive(Debug)]
pub(super) struct Staging {
    building: PathBuf,
    target: PathBuf,
    finished: bool,
}

impl Staging {
    /// Begins a folder that will end at `target`, which must not exist yet.
    pub(super) fn begin(target: &Path) -> Result<Self> {
        refuse_existing(target)?;
        let building = hidden(target)?;
        let parent = building.parent().unwrap_or(Path::new("."));
        fs::create_dir_all(parent).map_err(|source| Error::io(parent, source))?;
        if building.exists() {
            // Left by a run that was killed and had this process's number.
            fs::remove_dir_all(&building).map_err(|source| Error::io(&building, source))?;
        }
        fs::create_dir(&building).map_err(|source| Error::io(&building, source))?;
        Ok(Self { building, target: target.to_path_buf(), finished: false })
    }

    /// Makes a folder in it.
    pub(super) fn folder(&self, name: &str) -> Result<()> {
        let path = self.building.join(name);
        fs::create_dir_all(&path).map_err(|source| Error::io(path, source))
    }

    /// Writes a file in it. Errors name the final place.
    pub(super) fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        fs::write(self.building.join(name), bytes).map_err(|source| Error::io(self.target.join(name), source))
    }

    /// Where the folder will be.
    pub(super) fn target(&self) -> &Path {
        &self.target
    }

    /// Puts the folder in its final place.
    pub(super) fn finish(mut self) -> Result<PathBuf> {
        refuse_existing(&self.target)?;
        fs::rename(&self.building, &self.target).map_err(|source| Error::io(&self.target, source))?;
        self.finished = true;
        Ok(self.target.clone())
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        if !self.finished {
            let _ = fs::remove_dir_all(&self.building);
        }
    }
}

/// Writes a file such that a reader, or a kill, finds either the old content or the new, whole.
///
/// # Errors
/// [`Error::Io`] with `path`.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<()> {
    let building = hidden(path)?;
    // On the disk before it takes the place of what was there.
    let written = fs::File::create(&building)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
        .and_then(|()| fs::rename(&building, path));
    written.map_err(|source| {
        let _ = fs::remove_file(&building);
        Error::io(path, source)
    })
}

/// The hidden name beside `target` under which it is built.
fn hidden(target: &Path) -> Result<PathBuf> {
    let name = target
        .file_name()
        .and_then(OsStr::to_str)
        .ok_or_else(|| Error::invalid(target, "is not a file or folder name; choose another place"))?;
    Ok(target.with_file_name(format!(".{name}.{}.tmp", std::process::id())))
}

fn refuse_existing(target: &Path) -> Result<()> {
    if target.exists() {
        return Err(Error::invalid(target, "exists already; remove it or choose another place"));
    }
    Ok(())
}
