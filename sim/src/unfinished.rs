//! Files and folders under construction beside their final places.
//!
//! Whoever begins one registers it. It is taken away when its owner gives up or panics, and all are when the program is interrupted
//! ([`remove_all`]), so that nothing half-written is left behind.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

static ALL: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn all() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    ALL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file or folder under construction; removed when dropped before [`Unfinished::move_to`].
#[derive(Debug)]
pub struct Unfinished(PathBuf);

impl Unfinished {
    /// Registers the hidden place beside `target` where it is to be built, and takes away what a killed process of the same number
    /// left there. Nothing is made yet.
    ///
    /// # Errors
    /// What the system says, or that `target` is no name of a file or folder.
    pub fn beside(target: &Path) -> std::io::Result<Self> {
        let name = target.file_name().ok_or_else(|| {
            std::io::Error::new(std::io::ErrorKind::InvalidInput, "is not a file or folder name")
        })?;
        let mut hidden = OsString::from(".");
        hidden.push(name);
        hidden.push(format!(".{}.tmp", std::process::id()));
        let this = Self(target.with_file_name(hidden));
        remove(&this.0)?;
        all().insert(this.0.clone());
        Ok(this)
    }

    /// Where it is built.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Puts it in its final place; what is there, if anything, is exchanged for it and then removed. No interruption comes between.
    ///
    /// # Errors
    /// What the system says; the old content is in its place then.
    pub fn move_to(self, target: &Path) -> std::io::Result<()> {
        let mut registered = all();
        let exchanged = exchange(&self.0, target);
        if exchanged.is_ok() {
            registered.remove(&self.0);
        }
        drop(registered);
        let aside = exchanged?;
        std::mem::forget(self);
        aside.map_or(Ok(()), fs::remove_dir_all)
    }
}

/// Where a folder is now that was in the place.
fn exchange(from: &Path, target: &Path) -> std::io::Result<Option<PathBuf>> {
    if !target.is_dir() {
        // Files are exchanged by the system.
        return fs::rename(from, target).map(|()| None);
    }
    let aside = from.with_extension("old.tmp");
    fs::rename(target, &aside)?;
    if let Err(error) = fs::rename(from, target) {
        fs::rename(&aside, target)?;
        return Err(error);
    }
    Ok(Some(aside))
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        all().remove(&self.0);
        let _ = remove(&self.0);
    }
}

fn remove(path: &Path) -> std::io::Result<()> {
    match fs::symlink_metadata(path) {
        Err(_) => Ok(()),
        Ok(there) if there.is_dir() => fs::remove_dir_all(path),
        Ok(_) => fs::remove_file(path),
    }
}

/// Takes away all that is under construction, and lets nothing be finished or begun any more. For a program that ends now.
pub fn remove_all() {
    let registered = all();
    for path in registered.iter() {
        // Others may still be writing into it.
        for _ in 0..20 {
            let _ = remove(path);
            std::thread::sleep(Duration::from_millis(5));
            if !path.exists() {
                break;
            }
        }
    }
    std::mem::forget(registered);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_takes_the_place_of_another_or_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out");
        let begin = |content: &str| {
            let building = Unfinished::beside(&target).unwrap();
            fs::create_dir(building.path()).unwrap();
            fs::write(building.path().join("a"), content).unwrap();
            building
        };
        drop(begin("never"));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        begin("first").move_to(&target).unwrap();
        begin("second").move_to(&target).unwrap();
        assert_eq!(fs::read_to_string(target.join("a")).unwrap(), "second");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        assert!(!all().iter().any(|path| path.starts_with(folder.path())));
    }

    #[test]
    fn a_file_takes_the_place_of_another_and_names_need_not_be_utf_8() {
        use std::os::unix::ffi::OsStringExt;
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join(OsString::from_vec(b"caf\xe9".to_vec()));
        for content in ["first", "second"] {
            let building = Unfinished::beside(&target).unwrap();
            fs::write(building.path(), content).unwrap();
            building.move_to(&target).unwrap();
        }
        assert_eq!(fs::read_to_string(&target).unwrap(), "second");
        assert!(Unfinished::beside(Path::new("/")).is_err());
    }
}
