//! The objects of one set: facts from the table, models loaded when they are first asked for.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::{ObjectInfo, ObjectModel, ObjectSet, builtin, scans, table};
use crate::{Error, Result};

/// The table and the models of one [`ObjectSet`]. Shared between threads as it is.
#[derive(Debug)]
pub struct ObjectLibrary {
    set: ObjectSet,
    infos: Vec<ObjectInfo>,
    /// One lock an object, so that different objects load at the same time and each is loaded once.
    models: Vec<Mutex<Option<Arc<ObjectModel>>>>,
}

impl ObjectLibrary {
    /// Reads the table; models are loaded later, by [`load`](Self::load).
    ///
    /// # Errors
    /// If the table cannot be read or is wrong, or the set's folder does not exist.
    pub fn open(table: &Path, set: ObjectSet) -> Result<Self> {
        let infos = table::load(table)?;
        if let ObjectSet::Ycb(folder) | ObjectSet::Bop(folder) = &set {
            std::fs::read_dir(folder).map_err(|source| Error::io(folder, source))?;
        }
        let models = infos.iter().map(|_| Mutex::new(None)).collect();
        Ok(Self { set, infos, models })
    }

    /// Names in the order of the table.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.infos.iter().map(|info| info.name.as_str())
    }

    /// Where the models come from.
    pub fn set(&self) -> &ObjectSet {
        &self.set
    }

    /// The table's row for `name`.
    ///
    /// # Errors
    /// [`Error::UnknownObject`] with the known names.
    pub fn info(&self, name: &str) -> Result<&ObjectInfo> {
        self.index(name).map(|index| &self.infos[index])
    }

    /// The model of `name`; read or built the first time, shared after that.
    ///
    /// # Errors
    /// [`Error::UnknownObject`], or what is wrong with the set's files.
    pub fn load(&self, name: &str) -> Result<Arc<ObjectModel>> {
        let index = self.index(name)?;
        // A load that panicked left `None` behind, which is a good state.
        let mut slot = self.models[index].lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(model) = &*slot {
            return Ok(Arc::clone(model));
        }
        let info = self.infos[index].clone();
        let model = Arc::new(match &self.set {
            ObjectSet::BuiltIn => built_in(info)?,
            ObjectSet::Ycb(folder) => scans::load_ycb(folder, info)?,
            ObjectSet::Bop(folder) => scans::load_bop(folder, info)?,
        });
        *slot = Some(Arc::clone(&model));
        Ok(model)
    }

    fn index(&self, name: &str) -> Result<usize> {
        self.infos.iter().position(|info| info.name == name).ok_or_else(|| self.unknown(name))
    }

    fn unknown(&self, name: &str) -> Error {
        let known: Vec<&str> = self.names().collect();
        let mut text = known.join(", ");
        let closest = known.iter().filter_map(|known| Some((edits(known, name)?, known))).min();
        if let Some((_, known)) = closest {
            text.push_str(&format!("; did you mean '{known}'?"));
        }
        Error::UnknownObject { name: name.to_owned(), known: text }
    }
}

fn built_in(info: ObjectInfo) -> Result<ObjectModel> {
    let model = builtin::build(&info.name).ok_or_else(|| {
        Error::invalid(
            &info.name,
            "there is no built-in model of this object; give a scanned set with --ycb or GRIP_YCB_DIR",
        )
    })?;
    Ok(ObjectModel::new(info, model.visual, model.collision))
}

/// The set to use: the flag's folder, else that of `GRIP_YCB_DIR`, else the built-in models.
///
/// A folder that holds `obj_*.ply` is a BOP models folder, any other one the official YCB layout.
pub fn resolve_set(ycb_flag: Option<PathBuf>) -> ObjectSet {
    let from_environment =
        || std::env::var_os("GRIP_YCB_DIR").filter(|value| !value.is_empty()).map(PathBuf::from);
    match ycb_flag.or_else(from_environment) {
        None => ObjectSet::BuiltIn,
        Some(folder) if holds_bop_models(&folder) => ObjectSet::Bop(folder),
        Some(folder) => ObjectSet::Ycb(folder),
    }
}

fn holds_bop_models(folder: &Path) -> bool {
    std::fs::read_dir(folder).is_ok_and(|entries| {
        entries.flatten().any(|entry| {
            let name = entry.file_name();
            let name = name.to_string_lossy();
            name.starts_with("obj_") && name.ends_with(".ply")
        })
    })
}

/// How many letters were mistyped, if `known` may have been meant: the whole name or the one without its number. 0 where
/// `typed` is a part of it.
fn edits(known: &str, typed: &str) -> Option<usize> {
    let (known, typed) = (known.to_ascii_lowercase(), typed.to_ascii_lowercase());
    if !typed.is_empty() && known.contains(&typed) {
        return Some(0);
    }
    let unnumbered = known.split_once('_').map_or(known.as_str(), |(_, name)| name);
    let edits = strsim::levenshtein(&known, &typed).min(strsim::levenshtein(unnumbered, &typed));
    // A guess must share at least half of what was typed.
    (edits <= 5 && 2 * edits <= typed.len()).then_some(edits)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/objects.toml")
    }

    #[test]
    fn the_table_has_the_21_objects_of_ycb_video() {
        let library = ObjectLibrary::open(&table(), ObjectSet::BuiltIn).unwrap();
        let names: Vec<&str> = library.names().collect();
        assert_eq!(names.len(), 21);
        assert!(names.is_sorted(), "BOP numbers the objects in the order of their YCB numbers");
        for (index, name) in names.iter().enumerate() {
            assert_eq!(library.info(name).unwrap().bop_id as usize, index + 1);
        }
        let grip_paper = ["003", "005", "006", "007", "010", "024", "040", "061"];
        for number in grip_paper {
            let name = names.iter().find(|name| name.starts_with(number)).unwrap();
            assert!(library.info(name).unwrap().symmetric, "{name}");
        }
    }

    #[test]
    fn built_in_models_are_loaded_once_closed_and_centred() {
        let library = ObjectLibrary::open(&table(), ObjectSet::BuiltIn).unwrap();
        for name in library.names() {
            let model = library.load(name).unwrap();
            assert!(Arc::ptr_eq(&model, &library.load(name).unwrap()));
            let mesh = &model.visual.mesh;
            mesh.validate().unwrap_or_else(|error| panic!("{name}: {error}"));
            assert!(mesh.is_closed(), "{name} is not closed");
            assert!(mesh.volume() > 0.0, "{name} is inside out");
            assert!(
                (model.min.coords + model.max.coords).norm() < 1e-4,
                "{name}: {} {}",
                model.min,
                model.max
            );
            assert!(!model.collision.is_empty(), "{name}");
            assert!(model.collision.iter().all(|shape| crate::convert::solid(shape).is_some()), "{name}");
            assert!(
                model.diameter <= model.size().norm() + 1e-9 && model.diameter >= model.size().max() - 1e-9
            );
        }
    }

    #[test]
    fn unknown_names_list_the_known_ones_and_the_closest() {
        let library = ObjectLibrary::open(&table(), ObjectSet::BuiltIn).unwrap();
        let message = library.load("tomato_soup_can").unwrap_err().to_string();
        assert!(message.contains("002_master_chef_can, 003_cracker_box"), "{message}");
        assert!(message.contains("did you mean '005_tomato_soup_can'"), "{message}");
        assert!(
            library.info("tomato").unwrap_err().to_string().contains("did you mean '005_tomato_soup_can'")
        );
        assert!(library.info("mugg").unwrap_err().to_string().contains("did you mean '025_mug'"));
        assert!(!library.info("qqqqqqq").unwrap_err().to_string().contains("did you mean"));
    }

    #[test]
    fn the_set_follows_from_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().to_path_buf();
        assert_eq!(resolve_set(Some(path.clone())), ObjectSet::Ycb(path.clone()));
        std::fs::write(path.join("obj_000007.ply"), "").unwrap();
        assert_eq!(resolve_set(Some(path.clone())), ObjectSet::Bop(path.clone()));
        let missing = path.join("missing");
        let error = ObjectLibrary::open(&table(), ObjectSet::Ycb(missing)).unwrap_err().to_string();
        assert!(error.contains("missing"), "{error}");
        assert_eq!([ObjectSet::BuiltIn.label(), ObjectSet::Bop(path).label()], ["built-in", "bop"]);
    }
}
