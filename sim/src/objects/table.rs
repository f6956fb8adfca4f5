//! The object table, `scenes/objects.toml`: reading and checking.

use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

use super::{ObjectInfo, symmetry};
use crate::files;
use crate::range::within;
use crate::{Error, Result};

/// The `schema` line that this program reads.
pub const SCHEMA: &str = "grip.object-table/1";

/// The file as it is written.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObjectTable {
    /// `grip.object-table/1`.
    pub schema: String,
    /// At least one.
    pub objects: Vec<ObjectInfo>,
}

/// Reads and checks the table, in the order of the file.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read; [`Error::Invalid`] with object, field and value for anything wrong in it.
pub fn load(path: &Path) -> Result<Vec<ObjectInfo>> {
    let text = files::read_to_string(path)?;
    let table: ObjectTable = files::from_toml(&text).map_err(|message| Error::invalid(path, message))?;
    check(&table).map_err(|message| Error::invalid(path, message))?;
    Ok(table.objects)
}

fn check(table: &ObjectTable) -> std::result::Result<(), String> {
    if table.schema != SCHEMA {
        return Err(format!("schema = \"{}\": this program reads \"{SCHEMA}\"", table.schema));
    }
    if table.objects.is_empty() {
        return Err("objects: the table is empty; give at least one [[objects]]".into());
    }
    for (index, info) in table.objects.iter().enumerate() {
        check_row(info)?;
        for other in &table.objects[..index] {
            if other.name == info.name {
                return Err(format!("object '{}': name is used twice; names are unique", info.name));
            }
            if other.bop_id == info.bop_id {
                return Err(format!(
                    "object '{}': bop_id = {} is used by '{}' too; ids are unique",
                    info.name, info.bop_id, other.name
                ));
            }
        }
    }
    Ok(())
}

fn check_row(info: &ObjectInfo) -> std::result::Result<(), String> {
    let name = &info.name;
    // Names become folder names.
    if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-') {
        return Err(format!("object '{name}': name must be made of letters, digits, '_' and '-'"));
    }
    if info.bop_id == 0 || info.bop_id > 999_999 {
        return Err(format!("object '{name}': bop_id = {}: must be 1 to 999999", info.bop_id));
    }
    within(&format!("object '{name}': mass_kg"), info.mass_kg, 1e-3, 50.0)?;
    within(&format!("object '{name}': friction"), info.friction, 0.01, 2.0)?;
    match symmetry::problem(info.revolution, &info.half_turns) {
        Some(problem) => Err(format!("object '{name}': {problem}")),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROW: &str = "[[objects]]\nname = \"a\"\nbop_id = 1\nmass_kg = 0.1\nfriction = 0.6\nsymmetric = false\n\
                       fragility = \"sturdy\"\nupright = false\n";

    fn error_of(text: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("objects.toml");
        std::fs::write(&path, text).unwrap();
        let message = load(&path).unwrap_err().to_string();
        assert!(message.contains("objects.toml"), "{message}");
        message
    }

    fn with(from: &str, to: &str) -> String {
        format!("schema = \"{SCHEMA}\"\n{}", ROW.replace(from, to))
    }

    #[test]
    fn the_built_in_table_is_the_one_on_disk() {
        let on_disk = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/objects.toml");
        assert_eq!(load(&files::builtin_path("scenes/objects.toml")).unwrap(), load(&on_disk).unwrap());
    }

    #[test]
    fn every_error_names_object_field_and_value() {
        for (from, to, wanted) in [
            ("mass_kg = 0.1", "mass_kg = -1.0", "object 'a': mass_kg = -1"),
            ("mass_kg = 0.1", "mass_kg = nan", "mass_kg = NaN"),
            ("mass_kg = 0.1", "mass_kg = inf", "mass_kg = inf"),
            ("friction = 0.6", "friction = 9.0", "object 'a': friction = 9"),
            ("bop_id = 1", "bop_id = 0", "object 'a': bop_id = 0"),
            ("\"a\"", "\"../a\"", "object '../a': name"),
            ("upright = false", "", "upright"),
            ("upright", "uprigth", "uprigth"),
            ("sturdy", "soft", "soft"),
            ("upright = false", "upright = false\nrevolution = \"w\"", "unknown variant `w`"),
            (
                "upright = false",
                "upright = false\nhalf_turns = [\"x\", \"x\"]",
                "object 'a': half_turns: \"x\"",
            ),
            (
                "upright = false",
                "upright = false\nrevolution = \"z\"\nhalf_turns = [\"z\"]",
                "revolution = \"z\"; leave it out",
            ),
        ] {
            let message = error_of(&with(from, to));
            assert!(message.contains(wanted), "{to}: {message}");
        }
        assert!(error_of(&format!("schema = \"other/9\"\n{ROW}")).contains("other/9"));
        assert!(error_of(&format!("schema = \"{SCHEMA}\"\nobjects = []")).contains("empty"));
        assert!(error_of(&format!("schema = \"{SCHEMA}\"\n{ROW}{ROW}")).contains("name is used twice"));
        let same_id = format!("schema = \"{SCHEMA}\"\n{ROW}{}", ROW.replace("\"a\"", "\"b\""));
        assert!(error_of(&same_id).contains("object 'b': bop_id = 1"));
        assert!(load(Path::new("/nowhere/objects.toml")).unwrap_err().to_string().contains("/nowhere"));
    }
}
