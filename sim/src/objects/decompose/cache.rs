//! Decompositions on disk. Nothing here fails: a cache that cannot be used costs time, not results.

use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::convert;
use crate::shape::{CollisionShape, Convex};

/// One file of the cache.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    key: String,
    shapes: Vec<CollisionShape>,
}

/// The cache folder; `None` if the environment names no place for one.
pub(super) fn folder() -> Option<PathBuf> {
    folder_from(|name| std::env::var_os(name).filter(|value| !value.is_empty()))
}

fn folder_from(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    variable("GRIP_CACHE_DIR")
        .map(PathBuf::from)
        .or_else(|| variable("XDG_CACHE_HOME").map(|cache| Path::new(&cache).join("grip")))
        .or_else(|| variable("HOME").map(|home| Path::new(&home).join(".cache/grip")))
}

fn path(folder: &Path, key: &str) -> PathBuf {
    folder.join("collision").join(format!("{key}.json"))
}

/// The pieces stored under `key`, if they are there and whole.
pub(super) fn read(folder: &Path, key: &str) -> Option<Vec<CollisionShape>> {
    let path = path(folder, key);
    let bytes = std::fs::read(&path).ok()?;
    let sound = serde_json::from_slice::<Entry>(&bytes)
        .ok()
        .filter(|entry| entry.key == key && !entry.shapes.is_empty() && entry.shapes.iter().all(is_sound));
    if sound.is_none() {
        log::warn!("{}: the cached collision pieces are damaged; computing them again", path.display());
    }
    sound.map(|entry| entry.shapes)
}

fn is_sound(shape: &CollisionShape) -> bool {
    let positive = |values: &[f64]| values.iter().all(|v| *v > 0.0 && *v < 10.0);
    let dimensions = match &shape.geometry {
        Convex::Cuboid { half } => positive(half.as_slice()),
        Convex::Cylinder { half_height, radius } => positive(&[*half_height, *radius]),
        Convex::Sphere { radius } => positive(&[*radius]),
        Convex::Hull { points } => {
            points.len() >= 4 && points.iter().flat_map(|p| p.iter()).all(|v| v.abs() < 10.0)
        }
    };
    let unit = (shape.pose.rotation.norm() - 1.0).abs() < 1e-6;
    let near = shape.pose.translation.vector.iter().all(|v| v.abs() < 10.0);
    dimensions && unit && near && convert::solid(shape).is_some()
}

/// Stores the pieces: a whole file or none. If that fails, a warning says so.
pub(super) fn write(folder: &Path, key: &str, shapes: &[CollisionShape]) {
    let path = path(folder, key);
    let entry = Entry { key: key.to_owned(), shapes: shapes.to_vec() };
    let store = || -> std::io::Result<()> {
        let parent = path.parent().unwrap_or(folder);
        std::fs::create_dir_all(parent)?;
        let mut file = tempfile::NamedTempFile::new_in(parent)?;
        serde_json::to_writer(&mut file, &entry)?;
        file.flush()?;
        file.persist(&path)?;
        Ok(())
    };
    if let Err(error) = store() {
        log::warn!(
            "{}: cannot keep collision pieces: {error}; set GRIP_CACHE_DIR to a writable folder",
            path.display()
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Vector3};

    fn pieces() -> Vec<CollisionShape> {
        let pose = Isometry3::new(Vector3::new(0.1, 0.2, 1.0 / 3.0), Vector3::new(0.3, 0.1, 0.7));
        vec![
            CollisionShape { pose, geometry: Convex::Cuboid { half: Vector3::new(0.01, 0.02, 0.03) } },
            CollisionShape { pose, geometry: Convex::Cylinder { half_height: 0.1, radius: 0.05 } },
        ]
    }

    #[test]
    fn what_is_written_is_read_bit_by_bit() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(read(folder.path(), "k"), None);
        write(folder.path(), "k", &pieces());
        assert_eq!(read(folder.path(), "k"), Some(pieces()));
    }

    #[test]
    fn damaged_entries_count_as_missing() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "k", &pieces());
        let file = path(folder.path(), "k");
        let whole = std::fs::read_to_string(&file).unwrap();
        for damaged in [
            &whole[..whole.len() / 2],
            "",
            &whole.replace("\"k\"", "\"other\""),
            &whole.replace("0.05", "-0.05"),
            &whole.replace("0.05", "1e300"),
        ] {
            std::fs::write(&file, damaged).unwrap();
            assert_eq!(read(folder.path(), "k"), None, "{damaged}");
        }
    }

    #[test]
    fn an_unwritable_cache_is_no_error() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        write(&file, "k", &pieces());
        assert_eq!(read(&file, "k"), None);
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
