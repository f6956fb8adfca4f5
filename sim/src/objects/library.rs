//! The objects of one set: facts from the table, models loaded when they are first asked for.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::own::OwnMesh;
use super::table::ObjectRow;
use super::{ObjectInfo, ObjectModel, ObjectSet, builtin, scans, table};
use crate::{Error, Result, names};

/// The tables and the models of one [`ObjectSet`]. Shared between threads as it is.
#[derive(Debug)]
pub struct ObjectLibrary {
    set: ObjectSet,
    objects: Vec<Entry>,
}

/// An object of a table.
#[derive(Debug)]
struct Entry {
    info: ObjectInfo,
    /// Position of its table.
    table: usize,
    /// Its mesh, if it is none of the set.
    own: Option<OwnMesh>,
    /// One lock an object, so that different objects load at the same time and each is loaded once.
    model: Mutex<Option<Arc<ObjectModel>>>,
}

impl ObjectLibrary {
    /// Reads the table; models are loaded later, by [`load`](Self::load).
    ///
    /// # Errors
    /// If the table cannot be read or is wrong, or the set's folder does not exist.
    pub fn open(table: &Path, set: ObjectSet) -> Result<Self> {
        Self::with_tables(table, &[], set)
    }

    /// Reads the table, and further ones after it; one that is named twice is read once. Of rows that give a density the meshes are read
    /// here, too.
    ///
    /// # Errors
    /// As [`open`](Self::open), and if two tables use the same name or number.
    pub fn with_tables(table: &Path, more: &[PathBuf], set: ObjectSet) -> Result<Self> {
        if let ObjectSet::Ycb(folder) | ObjectSet::Bop(folder) = &set {
            std::fs::read_dir(folder).map_err(|source| Error::io(folder, source))?;
        }
        let same = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
        let mut tables: Vec<&Path> = vec![table];
        for path in more {
            if !tables.iter().any(|known| same(known) == same(path)) {
                tables.push(path);
            }
        }
        let mut objects: Vec<Entry> = Vec::new();
        for (index, path) in tables.iter().enumerate() {
            for row in table::load(path)? {
                if let Some(problem) = taken(&row, &objects, &tables) {
                    return Err(Error::invalid(*path, problem));
                }
                objects.push(Entry::new(path, index, &row)?);
            }
        }
        Ok(Self { set, objects })
    }

    /// Names in the order of the tables.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.infos().map(|info| info.name.as_str())
    }

    /// The facts of all objects, in the order of the tables.
    pub fn infos(&self) -> impl Iterator<Item = &ObjectInfo> {
        self.objects.iter().map(|object| &object.info)
    }

    /// Where the models come from that no table gives a mesh.
    pub fn set(&self) -> &ObjectSet {
        &self.set
    }

    /// What to call the models of some objects in outputs: the set's label, `own` for objects of one's own, or both with a `+`.
    pub fn label<'a>(&self, models: impl IntoIterator<Item = &'a Arc<ObjectModel>>) -> String {
        let (mut own, mut all) = (0, 0);
        for model in models {
            own += usize::from(model.source.is_some());
            all += 1;
        }
        match own {
            0 => self.set.label().to_owned(),
            _ if own == all => "own".to_owned(),
            _ => format!("{}+own", self.set.label()),
        }
    }

    /// The facts about `name`.
    ///
    /// # Errors
    /// [`Error::UnknownObject`] with the known names.
    pub fn info(&self, name: &str) -> Result<&ObjectInfo> {
        self.entry(name).map(|object| &object.info)
    }

    /// The model of `name`; read or built the first time, shared after that.
    ///
    /// # Errors
    /// [`Error::UnknownObject`], or what is wrong with the files of the set or of the object.
    pub fn load(&self, name: &str) -> Result<Arc<ObjectModel>> {
        let object = self.entry(name)?;
        // A load that panicked left `None` behind, which is a good state.
        let mut slot = object.model.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(model) = &*slot {
            return Ok(Arc::clone(model));
        }
        let info = object.info.clone();
        let model = Arc::new(match (&object.own, &self.set) {
            (Some(own), _) => own.model(info)?,
            (None, ObjectSet::BuiltIn) => built_in(info)?,
            (None, ObjectSet::Ycb(folder)) => scans::load_ycb(folder, info)?,
            (None, ObjectSet::Bop(folder)) => scans::load_bop(folder, info)?,
        });
        *slot = Some(Arc::clone(&model));
        Ok(model)
    }

    fn entry(&self, name: &str) -> Result<&Entry> {
        self.objects.iter().find(|object| object.info.name == name).ok_or_else(|| self.unknown(name))
    }

    fn unknown(&self, name: &str) -> Error {
        let known: Vec<&str> = self.names().collect();
        let nearest = names::suggestion(known.iter().copied(), name);
        Error::UnknownObject { name: name.to_owned(), known: known.join(", ") + &nearest }
    }
}

impl Entry {
    fn new(path: &Path, table: usize, row: &ObjectRow) -> Result<Self> {
        let own = OwnMesh::of(path, row);
        let info = row.info(|| own.as_ref().map_or(Ok(0.0), OwnMesh::volume))?;
        let info = info.map_err(|message| Error::invalid(path, message))?;
        Ok(Self { info, table, own, model: Mutex::new(None) })
    }
}

/// What a row has that an object of an earlier table has already.
fn taken(row: &ObjectRow, objects: &[Entry], tables: &[&Path]) -> Option<String> {
    let other = |object: &Entry| tables[object.table].display().to_string();
    if let Some(object) = objects.iter().find(|object| object.info.name == row.name) {
        return Some(format!(
            "object '{}': {} has this name, too; names are unique",
            row.name,
            other(object)
        ));
    }
    let object = objects.iter().find(|object| object.info.bop_id == row.bop_id)?;
    let free = 1 + objects.iter().map(|object| object.info.bop_id).max().unwrap_or(0);
    Some(format!(
        "object '{}': bop_id = {} is that of '{}' in {}; ids are unique over all tables: {free} and above are free there",
        row.name,
        row.bop_id,
        object.info.name,
        other(object)
    ))
}

fn built_in(info: ObjectInfo) -> Result<ObjectModel> {
    let model = builtin::build(&info.name).ok_or_else(|| {
        Error::invalid(
            &info.name,
            "there is no built-in model of this object; give its row of the table a mesh, or a scanned set with --ycb or GRIP_YCB_DIR",
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
