//! Files and folders that appear whole or not at all.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use crate::unfinished::Unfinished;
use crate::{Error, Result};

/// A folder under construction beside its final place; removed when dropped before [`Staging::finish`].
#[derive(Debug)]
pub(super) struct Staging {
    building: Unfinished,
    target: PathBuf,
}

impl Staging {
    /// Begins a folder that will end at `target`, which must not exist yet.
    pub(super) fn begin(target: &Path) -> Result<Self> {
        refuse_existing(target)?;
        let parent = target.parent().unwrap_or(Path::new("."));
        fs::create_dir_all(parent).map_err(|reason| Error::io(parent, reason))?;
        let building = Unfinished::beside(target).map_err(|reason| Error::io(target, reason))?;
        fs::create_dir(building.path()).map_err(|reason| Error::io(building.path(), reason))?;
        Ok(Self { building, target: target.to_path_buf() })
    }

    /// Makes a folder in it.
    pub(super) fn folder(&self, name: &str) -> Result<()> {
        let path = self.building.path().join(name);
        fs::create_dir_all(&path).map_err(|source| Error::io(path, source))
    }

    /// Writes a file in it. Errors name the final place.
    pub(super) fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        fs::write(self.building.path().join(name), bytes)
            .map_err(|source| Error::io(self.target.join(name), source))
    }

    /// Where the folder will be.
    pub(super) fn target(&self) -> &Path {
        &self.target
    }

    /// Puts the folder in its final place.
    pub(super) fn finish(self) -> Result<PathBuf> {
        refuse_existing(&self.target)?;
        self.building.move_to(&self.target).map_err(|reason| Error::io(&self.target, reason))?;
        Ok(self.target)
    }
}

/// Writes a file such that a reader, or a kill, finds either the old content or the new, whole.
///
/// # Errors
/// [`Error::Io`] with `path`.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<()> {
    let write = || {
        let building = Unfinished::beside(path)?;
        let mut file = fs::File::create(building.path())?;
        file.write_all(bytes)?;
        // On the disk before it takes the place of what was there.
        file.sync_all()?;
        building.move_to(path)
    };
    write().map_err(|reason| Error::io(path, reason))
}

fn refuse_existing(target: &Path) -> Result<()> {
    if target.exists() {
        return Err(Error::invalid(target, "exists already; remove it or choose another place"));
    }
    Ok(())
}
