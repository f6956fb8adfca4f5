//! campaign.json: what is to be run, and hashes of all that it depends on.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use grip_sim::unfinished::Unfinished;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use sha2::{Digest, Sha256};

use super::Verb;
use crate::experiment::plan::{self, Key};
use crate::scenario::Program;

/// Version of campaign.json.
pub const SCHEMA: &str = "grip.campaign/1";
/// The manifest, in a campaign's folder.
pub const FILE: &str = "campaign.json";
/// The folder of what all units have in common.
pub const SHARED: &str = "shared";
/// The folder of the units.
pub const UNITS: &str = "units";

/// campaign.json.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// [`SCHEMA`].
    pub schema: String,
    /// For people.
    pub name: String,
    /// The program that planned, as in scenario.json.
    #[schemars(with = "Program")]
    pub program: Value,
    /// SHA-256 of the program's file.
    pub build_sha256: Option<String>,
    /// What each unit is to have.
    pub work: Job,
    /// Options of the verb, as in the campaign file.
    pub options: Map<String, Value>,
    /// Folder of the campaign file, from this one: where relative paths among the options begin.
    pub base: String,
    /// Files that the options name, seen from `base`, and, for a data set, the files that all units read. What else the work depends on
    /// (scenes, robots, objects, settings, networks) is in the file of the verb in `shared`, by its content or its hash.
    pub inputs: Vec<FileDigest>,
    /// Files of the folder `shared`, seen from there.
    pub shared: Vec<FileDigest>,
    /// The units; their numbers are their positions, from 0 on.
    pub units: Vec<Unit>,
}

/// What a verb makes of an item.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "verb", rename_all = "lowercase", deny_unknown_fields)]
pub enum Job {
    /// A trial of each of these with each seed.
    Trials {
        /// In the order of results.
        arms: Vec<Arm>,
        /// Whether pictures are kept.
        films: bool,
    },
    /// A grasp of each object with each seed and error.
    Sweep {
        /// In the order of results.
        objects: Vec<String>,
        /// How many errors.
        cases: usize,
    },
    /// A folder of frames.
    Scenes {
        /// The folder of the scenes.
        split: String,
    },
    /// Poses of each image.
    Estimate {
        /// Whether posteriors are written, too.
        posteriors: bool,
    },
}

/// What is tried with each seed.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Arm {
    /// The scene's name.
    pub scene: String,
    /// The condition's name.
    pub condition: String,
    /// The estimator's name.
    pub estimator: String,
    /// The grasp planner's name.
    pub grasper: String,
}

/// A part of the work.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Unit {
    /// The first seed or the number of the first scene; for `estimate` how many items come before it.
    pub first: u64,
    /// How many seeds, scenes, or images (with `track` sequences of images), one after the other.
    pub items: u64,
    /// Which images, for `estimate`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub images: Option<Images>,
}

/// Images of a data set.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Images {
    /// How many.
    pub count: usize,
    /// Scene and image of the first one.
    pub first: [u32; 2],
    /// Scene and image of the last one.
    pub last: [u32; 2],
    /// Of their pictures and of the JSON files of their scenes.
    pub sha256: String,
}

/// A file, and what is in it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FileDigest {
    /// The file.
    pub path: String,
    /// Its length.
    pub bytes: u64,
    /// Of its content.
    pub sha256: String,
}

impl Job {
    /// Which verb.
    pub fn verb(&self) -> Verb {
        match self {
            Self::Trials { .. } => Verb::Trials,
            Self::Sweep { .. } => Verb::Sweep,
            Self::Scenes { .. } => Verb::Scenes,
            Self::Estimate { .. } => Verb::Estimate,
        }
    }

    /// How many results an item comes to, if none is left out.
    pub fn results_per_item(&self) -> u64 {
        match self {
            Self::Trials { arms, .. } => arms.len() as u64,
            Self::Sweep { objects, cases } => (objects.len() * cases) as u64,
            Self::Scenes { .. } | Self::Estimate { .. } => 1,
        }
    }

    /// How many results a unit has, with those that may be left out.
    pub fn results(&self, unit: &Unit) -> u64 {
        match &unit.images {
            Some(images) => images.count as u64,
            None => unit.items * self.results_per_item(),
        }
    }
}

impl Arm {
    /// The trial with a seed.
    pub fn key(&self, seed: u64) -> Key {
        let Self { scene, condition, estimator, grasper } = self.clone();
        Key { seed, scene, condition, estimator, grasper }
    }
}

/// A campaign's folder, its manifest read.
#[derive(Debug, Clone)]
pub struct Campaign {
    /// The folder, by an absolute path.
    pub folder: PathBuf,
    /// What is in campaign.json.
    pub manifest: Manifest,
    /// SHA-256 of campaign.json: results of another campaign are not ours.
    pub sha256: String,
}

impl Campaign {
    /// Reads a campaign.
    ///
    /// # Errors
    /// When there is none in the folder, or it is of another version of the program.
    pub fn open(folder: &Path) -> Result<Self> {
        let path = folder.join(FILE);
        let text = std::fs::read_to_string(&path).with_context(|| {
            format!(
                "{}: cannot be read; is it the folder of a campaign (grip campaign plan)?",
                path.display()
            )
        })?;
        let damaged = || format!("{}: is damaged, or no campaign of this program", path.display());
        // The version first: another one has other fields.
        let value: Value = serde_json::from_str(&text).with_context(damaged)?;
        ensure!(
            value["schema"] == SCHEMA,
            "{}: schema = {}: this program reads {SCHEMA}",
            path.display(),
            value["schema"]
        );
        let manifest = serde_json::from_value(value).with_context(damaged)?;
        let folder = std::path::absolute(folder)?;
        Ok(Self { folder, manifest, sha256: format!("{:x}", Sha256::digest(text)) })
    }

    /// Makes the folder of a new campaign; `share` writes into the folder it is given what all units have in common.
    ///
    /// # Errors
    /// When the folder is there and not empty, or cannot be written.
    pub fn begin(
        folder: &Path,
        mut manifest: Manifest,
        share: impl FnOnce(&Path) -> Result<()>,
    ) -> Result<Self> {
        new_folder(folder, |building| {
            let shared = building.join(SHARED);
            share(&shared)?;
            manifest.shared = digests_below(&shared)?;
            std::fs::create_dir_all(building.join(UNITS))?;
            std::fs::write(building.join(FILE), serde_json::to_string_pretty(&manifest)? + "\n")?;
            Ok(())
        })?;
        Self::open(folder)
    }

    /// The folder of a unit.
    pub fn unit_folder(&self, unit: usize) -> PathBuf {
        self.folder.join(UNITS).join(unit_name(unit))
    }

    /// The folder of what all units have in common.
    pub fn shared(&self) -> PathBuf {
        self.folder.join(SHARED)
    }

    /// Where relative paths among the options begin.
    pub fn base(&self) -> PathBuf {
        self.folder.join(&self.manifest.base)
    }

    /// Makes sure that the files which the options name are what they were, and that the shared ones are.
    ///
    /// # Errors
    /// Names the file that is not.
    pub fn check_inputs(&self) -> Result<()> {
        let of = |folder: PathBuf, files: &[FileDigest]| {
            files.iter().try_for_each(|file| {
                let path = folder.join(&file.path);
                let now = digest(&path)?;
                ensure!(
                    now.sha256 == file.sha256,
                    "{}: is not what it was when the campaign was planned; put it back, or plan anew into another folder",
                    path.display()
                );
                Ok(())
            })
        };
        of(self.base(), &self.manifest.inputs)?;
        of(self.shared(), &self.manifest.shared)
    }

    /// Makes sure that the verb would do what it would have done when the campaign was planned: `now` is what it says that it depends on,
    /// `name` the file in which it said so.
    ///
    /// # Errors
    /// Names the field in which they differ.
    pub fn check_same(&self, name: &str, now: &Value) -> Result<()> {
        let path = self.shared().join(name);
        let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        let before: Value = serde_json::from_str(&text).with_context(|| path.display().to_string())?;
        if let Some(field) = plan::differs(&before, now) {
            bail!(
                "{}: {field} is not what it was when the campaign was planned; give the same files, or plan anew into another folder",
                path.display()
            );
        }
        Ok(())
    }
}

/// The name of a unit's folder.
pub fn unit_name(unit: usize) -> String {
    format!("{unit:06}")
}

/// Makes a new folder whole or not at all.
pub(super) fn new_folder(target: &Path, fill: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let cannot = || {
        format!(
            "{}: cannot be written; check permissions and free space, or choose another --out",
            target.display()
        )
    };
    if target.exists() {
        let empty = std::fs::read_dir(target).is_ok_and(|mut entries| entries.next().is_none());
        ensure!(empty, "{}: exists; choose another --out, or remove it", target.display());
    }
    if let Some(parent) = target.parent().filter(|parent| !parent.as_os_str().is_empty()) {
        std::fs::create_dir_all(parent).with_context(cannot)?;
    }
    let building = Unfinished::beside(target).with_context(cannot)?;
    std::fs::create_dir(building.path()).with_context(cannot)?;
    fill(building.path())?;
    building.move_to(target).with_context(cannot)
}

/// Length and SHA-256 of a file.
///
/// # Errors
/// When it cannot be read.
pub fn digest(path: &Path) -> Result<FileDigest> {
    let cannot = || format!("{}: cannot be read", path.display());
    let mut file = File::open(path).with_context(cannot)?;
    let (mut hasher, mut bytes, mut buffer) = (Sha256::new(), 0, vec![0; 1 << 16]);
    loop {
        let read = file.read(&mut buffer).with_context(cannot)?;
        if read == 0 {
            break;
        }
        hasher.update(&buffer[..read]);
        bytes += read as u64;
    }
    Ok(FileDigest {
        path: path.to_string_lossy().into_owned(),
        bytes,
        sha256: format!("{:x}", hasher.finalize()),
    })
}

/// Of all files below a folder, in the order of their paths from there; hidden ones do not count.
///
/// # Errors
/// When one cannot be read, or its name is not UTF-8.
pub fn digests_below(folder: &Path) -> Result<Vec<FileDigest>> {
    let mut digests = Vec::new();
    for name in names_below(folder)? {
        digests.push(FileDigest { path: name.clone(), ..digest(&folder.join(&name))? });
    }
    Ok(digests)
}

/// The paths of these files, from there, with `/`.
pub(super) fn names_below(folder: &Path) -> Result<BTreeSet<String>> {
    fn collect(root: &Path, inside: &str, names: &mut BTreeSet<String>) -> Result<()> {
        let folder = root.join(inside);
        let entries =
            std::fs::read_dir(&folder).with_context(|| format!("{}: cannot be read", folder.display()))?;
        for entry in entries {
            let entry = entry?;
            let name = entry.file_name();
            let name = name.to_str().with_context(|| format!("{}: no UTF-8", entry.path().display()))?;
            if name.starts_with('.') {
                continue;
            }
            let path = if inside.is_empty() { name.to_owned() } else { format!("{inside}/{name}") };
            if entry.file_type()?.is_dir() {
                collect(root, &path, names)?;
            } else {
                names.insert(path);
            }
        }
        Ok(())
    }
    let mut names = BTreeSet::new();
    collect(folder, "", &mut names)?;
    Ok(names)
}

/// The way from one folder to another, both absolute and without links; the other itself where there is none.
pub fn way(from: &Path, to: &Path) -> PathBuf {
    let (a, b): (Vec<Component<'_>>, Vec<Component<'_>>) =
        (from.components().collect(), to.components().collect());
    let common = a.iter().zip(&b).take_while(|(a, b)| a == b).count();
    // Nothing in common but the root: a whole path says more.
    if common <= 1 {
        return to.to_path_buf();
    }
    let up = std::iter::repeat_n(Component::ParentDir, a.len() - common);
    let way: PathBuf = up.chain(b[common..].iter().copied()).collect();
    if way.as_os_str().is_empty() { PathBuf::from(".") } else { way }
}

/// The files that the options name, seen from `base`: values, what stands behind `csv:` or `NAME=`, and words of command lines that are
/// files there.
///
/// # Errors
/// When one of them cannot be read.
pub fn named_files(options: &Map<String, Value>, base: &Path) -> Result<Vec<FileDigest>> {
    fn texts(value: &Value, all: &mut BTreeSet<String>) {
        match value {
            Value::Array(values) => values.iter().for_each(|value| texts(value, all)),
            Value::String(text) => {
                let behind = text.split_once('=').map_or(text.as_str(), |(_, behind)| behind);
                let behind = behind.strip_prefix("csv:").unwrap_or(behind);
                let words = behind.strip_prefix("cmd:").and_then(shlex::split).unwrap_or_default();
                // What --objects, --conditions and others take several of.
                let parts = text.split(',').map(str::to_owned);
                all.extend([text.clone(), behind.to_owned()].into_iter().chain(words).chain(parts));
            }
            _ => {}
        }
    }
    let mut all = BTreeSet::new();
    options.values().for_each(|value| texts(value, &mut all));
    all.retain(|path| !path.is_empty() && base.join(path).is_file());
    all.into_iter().map(|path| Ok(FileDigest { path: path.clone(), ..digest(&base.join(&path))? })).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_folder_is_reached_from_another() {
        let way = |from: &str, to: &str| way(Path::new(from), Path::new(to)).display().to_string();
        assert_eq!(way("/a/b/c", "/a/b"), "..");
        assert_eq!(way("/a/b", "/a/c/d"), "../c/d");
        assert_eq!(way("/a/b", "/a/b"), ".");
        assert_eq!(way("/a/b", "/c"), "/c");
    }

    #[test]
    fn files_among_the_options_are_found_however_they_are_named() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["s.toml", "r.csv", "e.py", "o.toml"] {
            std::fs::write(folder.path().join(name), name).unwrap();
        }
        let options = json!({
            "scene": ["s.toml", "none.toml"], "estimators": ["truth", "csv:r.csv", "mine=cmd:python3 'e.py' --x"],
            "objects": "002_master_chef_can,o.toml", "seed": 3, "ycb": ".",
        });
        let found = named_files(options.as_object().unwrap(), folder.path()).unwrap();
        assert_eq!(
            found.iter().map(|file| file.path.as_str()).collect::<Vec<_>>(),
            ["e.py", "o.toml", "r.csv", "s.toml"]
        );
        assert_eq!(found[0].bytes, 4);
        assert_eq!(found[0].sha256, format!("{:x}", Sha256::digest("e.py")));
    }
}
