//! Files of the project: on disk, or built into the program.
//!
//! The workspace's folders `scenes/` and `robots/` are built in, so that the program alone is whole. A path that begins
//! with `builtin:` names one of their files, such as `builtin:scenes/grocery.toml`; every other path is one on disk. Paths
//! are joined as usual, and `..` goes up: `builtin:scenes/../robots/fetch/fetch.urdf` is `builtin:robots/fetch/fetch.urdf`.
//!
//! ```
//! use std::path::Path;
//! use grip_sim::scene::Scene;
//! # fn main() -> grip_sim::Result<()> {
//! let scene = Scene::load(Path::new("builtin:scenes/grocery.toml"))?;
//! assert_eq!(scene.name, "grocery");
//! # Ok(())
//! # }
//! ```

use std::borrow::Cow;
use std::io;
use std::path::{Component, Path, PathBuf};

use include_dir::{Dir, File, include_dir};
use percent_encoding::percent_decode_str;

use crate::error::{Error, Result};

mod mistaken;
pub(crate) mod text;
mod typed;

pub use typed::{from_toml, lists_fit};

/// How paths of built-in files begin.
pub const PREFIX: &str = "builtin:";

static FOLDERS: [(&str, Dir<'_>); 2] = [
    ("robots", include_dir!("$CARGO_MANIFEST_DIR/../robots")),
    ("scenes", include_dir!("$CARGO_MANIFEST_DIR/../scenes")),
];

/// The built-in path of a file or folder of the project, such as `scenes/grocery.toml`.
pub fn builtin_path(relative: &str) -> PathBuf {
    PathBuf::from(format!("{PREFIX}{relative}"))
}

/// All built-in files: their paths from the project's root, with `/`, and their bytes. Sorted.
pub fn builtin() -> Vec<(String, &'static [u8])> {
    fn collect(folder: &str, dir: &'static Dir<'static>, files: &mut Vec<(String, &'static [u8])>) {
        files.extend(dir.files().map(|file| (format!("{folder}/{}", slashed(file.path())), file.contents())));
        dir.dirs().for_each(|inner| collect(folder, inner, files));
    }
    let mut files = Vec::new();
    FOLDERS.iter().for_each(|(name, dir)| collect(name, dir, &mut files));
    files.sort();
    files
}

/// The bytes of a file.
///
/// # Errors
/// [`Error::Io`] when it cannot be read; [`Error::Invalid`] when something else is in its place: nothing at all, a Git LFS pointer,
/// an HTML page, an archive.
pub fn read(path: &Path) -> Result<Cow<'static, [u8]>> {
    let bytes = match inside(path) {
        Some(inside) => file(&inside).map(|file| Cow::Borrowed(file.contents())).ok_or_else(|| missing(path)),
        None => std::fs::read(path).map(Cow::Owned).map_err(|source| Error::io(path, source)),
    }?;
    mistaken::instead(&bytes).map_or(Ok(bytes), |what| Err(Error::invalid(path, what)))
}

/// The text of a file: UTF-8, or UTF-16 with a byte order mark. The mark is left out.
///
/// # Errors
/// As [`read`]; [`Error::Invalid`] when it is no text.
pub fn read_to_string(path: &Path) -> Result<Cow<'static, str>> {
    text::strict(read(path)?).map_err(|message| Error::invalid(path, message))
}

/// Whether there is such a file or folder.
pub fn exists(path: &Path) -> bool {
    match inside(path) {
        Some(inside) => file(&inside).is_some() || dir(&inside).is_some(),
        None => path.exists(),
    }
}

/// The path that a URI or relative name in a file of others means, seen from the folder of that file.
///
/// Names are percent-encoded by some programs and not by others: one that is there as it stands is that file.
pub(crate) fn named(folder: &Path, name: &str) -> PathBuf {
    // file://localhost/path is the same as file:///path, and file:path is written, too.
    let rest = name.strip_prefix("file:").unwrap_or(name);
    let rest = rest.strip_prefix("//localhost").or_else(|| rest.strip_prefix("//")).unwrap_or(rest);
    let rest = rest.replace('\\', "/");
    let literal = folder.join(&rest);
    let decoded = percent_decode_str(&rest).decode_utf8().map(|name| folder.join(&*name));
    match decoded {
        Ok(decoded) if !exists(&literal) => decoded,
        _ => literal,
    }
}

/// Serialises a path for people: names need not be UTF-8, JSON must be.
///
/// # Errors
/// Those of the serialiser.
pub fn shown<S: serde::Serializer>(
    path: &impl AsRef<Path>,
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.as_ref().to_string_lossy())
}

/// The files directly in a folder, sorted.
///
/// # Errors
/// [`Error::Io`] when the folder cannot be read.
pub fn list(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files: Vec<PathBuf> = match inside(folder) {
        Some(inside) => {
            let dir = dir(&inside).ok_or_else(|| missing(folder))?;
            dir.files().filter_map(|file| Some(folder.join(file.path().file_name()?))).collect()
        }
        None => {
            let entries = std::fs::read_dir(folder).and_then(Iterator::collect::<io::Result<Vec<_>>>);
            let entries = entries.map_err(|source| Error::io(folder, source))?;
            entries.iter().map(std::fs::DirEntry::path).filter(|path| path.is_file()).collect()
        }
    };
    files.sort();
    Ok(files)
}

/// What a built-in path names: a folder of [`FOLDERS`], and the way from there. `None` for a path on disk.
fn inside(path: &Path) -> Option<(String, PathBuf)> {
    let mut parts: Vec<String> = Vec::new();
    let after = path.to_str()?.strip_prefix(PREFIX)?;
    for component in Path::new(after).components() {
        match component {
            // Above the root there is nothing: what is not there is not found.
            Component::ParentDir if parts.last().is_none_or(|last| last == "..") => parts.push("..".into()),
            Component::ParentDir => drop(parts.pop()),
            Component::Normal(part) => parts.push(part.to_string_lossy().into_owned()),
            _ => {}
        }
    }
    let mut parts = parts.into_iter();
    Some((parts.next().unwrap_or_default(), parts.collect()))
}

fn dir((folder, inside): &(String, PathBuf)) -> Option<&'static Dir<'static>> {
    let (_, root) = FOLDERS.iter().find(|(name, _)| name == folder)?;
    if inside.as_os_str().is_empty() { Some(root) } else { root.get_dir(slashed(inside)) }
}

fn file((folder, inside): &(String, PathBuf)) -> Option<&'static File<'static>> {
    let (_, root) = FOLDERS.iter().find(|(name, _)| name == folder)?;
    root.get_file(slashed(inside))
}

/// A relative path with `/` on every system.
fn slashed(path: &Path) -> String {
    path.components().map(|c| c.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
}

fn missing(path: &Path) -> Error {
    let known: Vec<String> = builtin().into_iter().map(|(path, _)| path).collect();
    let message = format!("not among the files built into the program ({})", known.join(", "));
    Error::io(path, io::Error::new(io::ErrorKind::NotFound, message))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn root() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
    }

    /// Every file below `folder`, by its path from `root`.
    fn on_disk(folder: &Path, root: &Path, files: &mut BTreeMap<String, Vec<u8>>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                on_disk(&path, root, files);
            } else {
                files.insert(slashed(path.strip_prefix(root).unwrap()), std::fs::read(&path).unwrap());
            }
        }
    }

    /// A file that is new is built in when something else of this crate has changed: `touch sim/src/files.rs`.
    #[test]
    fn what_is_built_in_is_what_is_on_disk() {
        let mut files = BTreeMap::new();
        for (folder, _) in &FOLDERS {
            on_disk(&root().join(folder), &root(), &mut files);
        }
        let built_in = builtin();
        assert!(built_in.is_sorted() && built_in.len() > 20);
        assert_eq!(
            built_in.iter().map(|(path, _)| path).collect::<Vec<_>>(),
            files.keys().collect::<Vec<_>>()
        );
        for (path, bytes) in built_in {
            assert!(bytes == files[&path], "{path}");
            assert_eq!(*read(&super::builtin_path(&path)).unwrap(), *bytes);
        }
    }

    #[test]
    fn paths_are_joined_and_go_up() {
        let scene = builtin_path("scenes/grocery.toml");
        let urdf = scene.parent().unwrap().join("../robots/fetch/fetch.urdf");
        let text = std::fs::read_to_string(root().join("robots/fetch/fetch.urdf")).unwrap();
        assert_eq!(read_to_string(&urdf).unwrap(), text);
        assert!(
            exists(&scene)
                && exists(scene.parent().unwrap())
                && exists(&builtin_path("robots/fetch/./meshes"))
        );
        let names = list(&builtin_path("scenes/conditions")).unwrap();
        assert!(names.contains(&builtin_path("scenes/conditions/base.toml")), "{names:?}");
        assert_eq!(names.len(), list(&root().join("scenes/conditions")).unwrap().len());
    }

    #[test]
    fn names_in_files_of_others_are_uris_or_names() {
        let folder = tempfile::tempdir().unwrap();
        let here = |name: &str| folder.path().join(name);
        for name in ["my label.png", "50%25.png", "größe.png"] {
            std::fs::write(here(name), "x").unwrap();
        }
        for (name, wanted) in [
            ("my%20label.png", "my label.png"),
            ("my label.png", "my label.png"),
            ("./my%20label.png", "./my label.png"),
            // There as it stands.
            ("50%25.png", "50%25.png"),
            ("gr%C3%B6%c3%9fe.png", "größe.png"),
            ("none%20.png", "none .png"),
            ("100%.png", "100%.png"),
            ("a\\b.png", "a/b.png"),
        ] {
            assert_eq!(named(folder.path(), name), here(wanted), "{name}");
        }
        let whole = format!("file://{}", here("my%20label.png").display());
        assert_eq!(named(Path::new("elsewhere"), &whole), here("my label.png"));
        assert_eq!(named(Path::new("x"), "file://localhost/a%20b"), Path::new("/a b"));
    }

    #[test]
    fn what_is_not_built_in_is_not_found() {
        for path in [
            "scenes/none.toml",
            "Cargo.toml",
            "../../scenes/grocery.toml",
            "scenes/../../scenes/grocery.toml",
            "scenes",
            "",
        ] {
            let error = read(&builtin_path(path)).unwrap_err().to_string();
            assert!(error.contains(&format!("builtin:{path}")) && error.contains("grocery.toml"), "{error}");
        }
        assert!(!exists(&builtin_path("scenes/none.toml")) && list(&builtin_path("scenes/none")).is_err());
        assert!(read_to_string(Path::new("/nowhere/x")).unwrap_err().to_string().contains("/nowhere/x"));
    }
}
