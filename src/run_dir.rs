//! A run folder that exists whole or not at all.
//!
//! Everything is written to a temporary folder beside the final one and renamed at the end, so that a kill, an error or
//! a full disk leaves no half-written run. A run that replaces an earlier one keeps what others have put into its folder.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use grip_sim::unfinished::Unfinished;

/// Files by which a folder is known as one of ours, which may be replaced, and how the schema in them begins. The names
/// alone would not do: a BOP data set has a camera.json too.
const MARKS: [(&str, &str); 3] =
    [("result.json", "grip.trial/"), ("camera.json", "grip.camera/"), ("plan.json", "grip.plan/")];

/// Names the files of a run, a line each, so that a later one knows what it may replace.
const FILES: &str = ".grip-files";

/// A run folder under construction; removed when dropped before [`RunDir::finish`].
#[derive(Debug)]
pub struct RunDir {
    building: Unfinished,
    target: PathBuf,
}

impl RunDir {
    /// Begins a run folder that will end at `target`.
    ///
    /// # Errors
    /// When `target` may not be written to, or exists and is not an earlier run.
    pub fn begin(target: &Path) -> Result<Self> {
        if target.exists() && !replaceable(target) {
            bail!(
                "{}: exists and is not the folder of an earlier run; choose another --out",
                target.display()
            );
        }
        let parent = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        fs::create_dir_all(parent).with_context(|| cannot_write(parent))?;
        let building = Unfinished::beside(target).with_context(|| {
            format!("{}: not a folder that can be written; choose another --out", target.display())
        })?;
        fs::create_dir(building.path()).with_context(|| cannot_write(parent))?;
        Ok(Self { building, target: target.to_path_buf() })
    }

    /// Writes a file of the run; `name` may have folders.
    ///
    /// # Errors
    /// When it cannot be written, such as on a full disk.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> Result<()> {
        let path = self.building.path().join(name);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).with_context(|| cannot_write(folder))?;
        }
        fs::write(&path, content).with_context(|| cannot_write(&self.target.join(name)))
    }

    /// A new folder of the run, to be filled by others.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn folder(&self, name: &str) -> Result<PathBuf> {
        let path = self.building.path().join(name);
        fs::create_dir_all(&path).with_context(|| cannot_write(&path))?;
        Ok(path)
    }

    /// Puts the folder in its final place, in exchange for an earlier run there.
    ///
    /// # Errors
    /// When it cannot be renamed.
    pub fn finish(self) -> Result<PathBuf> {
        let ours = files_below(self.building.path()).with_context(|| cannot_write(self.building.path()))?;
        self.write(FILES, ours.iter().map(|file| format!("{}\n", file.display())).collect::<String>())?;
        if self.target.exists() {
            self.keep_what_others_added(&ours)?;
        }
        // At every moment a whole run is on disk.
        let Self { building, target } = self;
        building.move_to(&target).with_context(|| cannot_write(&target))?;
        Ok(target)
    }

    /// Copies from the earlier run what it did not write itself and this one does not have. Of a run that does not tell what
    /// it wrote that is everything else.
    fn keep_what_others_added(&self, ours: &[PathBuf]) -> Result<()> {
        let theirs = fs::read_to_string(self.target.join(FILES)).unwrap_or_default();
        let written: Vec<&Path> = theirs.lines().map(Path::new).chain([Path::new(FILES)]).collect();
        let there =
            files_below(&self.target).with_context(|| format!("{}: cannot read", self.target.display()))?;
        for file in there.iter().filter(|file| !written.contains(&file.as_path()) && !ours.contains(file)) {
            let to = self.building.path().join(file);
            let copy = || {
                fs::create_dir_all(to.parent().unwrap_or(self.building.path()))?;
                fs::copy(self.target.join(file), &to)
            };
            copy().with_context(|| cannot_write(&self.target.join(file)))?;
        }
        Ok(())
    }
}

/// All files below `folder`, by their paths from there, sorted.
fn files_below(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    fn collect(root: &Path, inside: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
        for entry in fs::read_dir(root.join(inside))? {
            let entry = entry?;
            let path = inside.join(entry.file_name());
            if entry.file_type()?.is_dir() {
                collect(root, &path, files)?;
            } else {
                files.push(path);
            }
        }
        Ok(())
    }
    let mut files = Vec::new();
    collect(folder, Path::new(""), &mut files)?;
    files.sort();
    Ok(files)
}

/// An empty folder, or one of ours.
fn replaceable(target: &Path) -> bool {
    let empty = fs::read_dir(target).is_ok_and(|mut entries| entries.next().is_none());
    empty || MARKS.iter().any(|(file, schema)| has_schema(&target.join(file), schema))
}

/// Whether `path` is a JSON file whose `schema` begins with `prefix`.
fn has_schema(path: &Path, prefix: &str) -> bool {
    let json = fs::read(path).ok().and_then(|bytes| serde_json::from_slice::<serde_json::Value>(&bytes).ok());
    json.is_some_and(|value| value["schema"].as_str().is_some_and(|schema| schema.starts_with(prefix)))
}

fn cannot_write(path: &Path) -> String {
    format!("{}: cannot write; check permissions and free space, or choose another --out", path.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_appears_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("deep/run");
        let run = RunDir::begin(&target).unwrap();
        run.write("frames/a.txt", "a").unwrap();
        assert!(!target.exists());
        drop(run);
        assert_eq!(fs::read_dir(folder.path().join("deep")).unwrap().count(), 0);

        let run = RunDir::begin(&target).unwrap();
        run.write("result.json", r#"{"schema": "grip.trial/5"}"#).unwrap();
        run.finish().unwrap();
        assert!(target.join("result.json").exists());
        // An earlier run may be replaced, another folder may not.
        RunDir::begin(&target).unwrap().finish().unwrap();
        fs::write(target.join("thesis.txt"), "precious").unwrap();
        let error = RunDir::begin(&target).unwrap_err().to_string();
        assert!(error.contains("not the folder of an earlier run"), "{error}");
    }

    #[test]
    fn a_rerun_keeps_what_others_added_and_nothing_of_the_earlier_run() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("run");
        let run = |files: &[&str]| {
            let run = RunDir::begin(&target).unwrap();
            run.write("result.json", r#"{"schema": "grip.trial/5"}"#).unwrap();
            files.iter().for_each(|file| run.write(file, "of the run").unwrap());
            run.finish().unwrap();
        };
        run(&["frames/00.png", "frames/01.png"]);
        fs::write(target.join("notes.txt"), "precious").unwrap();
        fs::write(target.join("frames/marked.png"), "precious").unwrap();
        run(&["frames/00.png"]);
        assert_eq!(fs::read_to_string(target.join("notes.txt")).unwrap(), "precious");
        assert_eq!(fs::read_to_string(target.join("frames/marked.png")).unwrap(), "precious");
        assert!(!target.join("frames/01.png").exists(), "a frame that the new run does not have");
        // And again: what was kept is still no file of the run.
        run(&[]);
        assert!(target.join("notes.txt").exists() && !target.join("frames/00.png").exists());
    }

    #[test]
    fn a_data_set_with_a_camera_file_is_not_ours() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("camera.json"), r#"{"cx": 320.0, "depth_scale": 1.0}"#).unwrap();
        assert!(RunDir::begin(folder.path()).is_err());
        assert!(folder.path().join("camera.json").exists());
    }

    #[test]
    fn a_file_in_the_way_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        let error = format!("{:#}", RunDir::begin(&file.join("run")).unwrap_err());
        assert!(error.contains("file") && error.contains("cannot write"), "{error}");
    }
}
