//! What takes long to compute and never changes, on disk: collision pieces of meshes, grasps of objects. Nothing here fails:
//! a cache that cannot be used costs time, not results.

use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// One file of the cache.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry<T> {
    key: String,
    value: T,
}

/// The cache folder, `GRIP_CACHE_DIR` or the user's own; `None` if the environment names no place for one.
pub fn folder() -> Option<PathBuf> {
    folder_from(|name| std::env::var_os(name).filter(|value| !value.is_empty()))
}

fn folder_from(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    variable("GRIP_CACHE_DIR")
        .map(PathBuf::from)
        .or_else(|| variable("XDG_CACHE_HOME").map(|cache| Path::new(&cache).join("grip")))
        .or_else(|| variable("HOME").map(|home| Path::new(&home).join(".cache/grip")))
}

fn path(folder: &Path, kind: &str, key: &str) -> PathBuf {
    folder.join(kind).join(format!("{key}.json"))
}

/// What is stored under `key` in the folder of its `kind`, if it is there, whole and sound.
pub fn read<T: DeserializeOwned>(
    folder: &Path,
    kind: &str,
    key: &str,
    is_sound: impl Fn(&T) -> bool,
) -> Option<T> {
    let path = path(folder, kind, key);
    let bytes = std::fs::read(&path).ok()?;
    let sound = serde_json::from_slice::<Entry<T>>(&bytes)
        .ok()
        .filter(|entry| entry.key == key && is_sound(&entry.value));
    if sound.is_none() {
        log::warn!("{}: damaged; computing it again", path.display());
    }
    sound.map(|entry| entry.value)
}

/// Stores a value: a whole file or none. If that fails, a warning says so.
pub fn write<T: Serialize>(folder: &Path, kind: &str, key: &str, value: &T) {
    let path = path(folder, kind, key);
    let store = || -> std::io::Result<()> {
        let parent = path.parent().unwrap_or(folder);
        std::fs::create_dir_all(parent)?;
        let mut file = tempfile::NamedTempFile::new_in(parent)?;
        serde_json::to_writer(&mut file, &Entry { key: key.to_owned(), value })?;
        file.flush()?;
        file.persist(&path)?;
        Ok(())
    };
    if let Err(error) = store() {
        log::warn!("{}: cannot keep it: {error}; set GRIP_CACHE_DIR to a writable folder", path.display());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VALUE: [f64; 3] = [0.1, 1.0 / 3.0, 1e-300];

    fn get(folder: &Path) -> Option<[f64; 3]> {
        read(folder, "kind", "k", |v: &[f64; 3]| v.iter().all(|x| *x < 10.0))
    }

    #[test]
    fn what_is_written_is_read_bit_by_bit() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(get(folder.path()), None);
        write(folder.path(), "kind", "k", &VALUE);
        assert_eq!(get(folder.path()), Some(VALUE));
    }

    #[test]
    fn damaged_entries_count_as_missing() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "kind", "k", &VALUE);
        let file = path(folder.path(), "kind", "k");
        let whole = std::fs::read_to_string(&file).unwrap();
        for damaged in [
            &whole[..whole.len() / 2],
            "",
            &whole.replace("\"k\"", "\"other\""),
            &whole.replace("0.1", "1e300"),
        ] {
            std::fs::write(&file, damaged).unwrap();
            assert_eq!(get(folder.path()), None, "{damaged}");
        }
    }

    #[test]
    fn an_unwritable_cache_is_no_error() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        write(&file, "kind", "k", &VALUE);
        assert_eq!(get(&file), None);
    }

    #[test]
    fn the_environment_names_the_folder() {
        let with = |pairs: &'static [(&str, &str)]| {
            folder_from(|name| pairs.iter().find(|(key, _)| *key == name).map(|(_, value)| value.into()))
        };
        assert_eq!(with(&[("GRIP_CACHE_DIR", "/a"), ("XDG_CACHE_HOME", "/b")]), Some("/a".into()));
        assert_eq!(with(&[("XDG_CACHE_HOME", "/b"), ("HOME", "/c")]), Some("/b/grip".into()));
        assert_eq!(with(&[("HOME", "/c")]), Some("/c/.cache/grip".into()));
        assert_eq!(with(&[]), None);
    }
}
