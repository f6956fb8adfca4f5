//! Object tables, such as `scenes/objects.toml`: reading and checking.

use std::fmt;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Axis, Fragility, ObjectInfo, symmetry};
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
    pub objects: Vec<ObjectRow>,
}

/// The unit of a mesh file's coordinates.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    /// Metres.
    #[default]
    M,
    /// Centimetres.
    Cm,
    /// Millimetres.
    Mm,
    /// Inches, 25.4 mm.
    In,
}

impl Unit {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::M, Self::Cm, Self::Mm, Self::In];

    /// In metres.
    pub fn metres(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Cm => 1e-2,
            Self::Mm => 1e-3,
            Self::In => 0.0254,
        }
    }

    /// As in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::M => "m",
            Self::Cm => "cm",
            Self::Mm => "mm",
            Self::In => "in",
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// An object, as its table has it. A row without `mesh` is of one of the YCB objects, whose models are built in or scanned.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObjectRow {
    /// Such as `005_tomato_soup_can`: letters, digits, `_` and `-`; used once in all tables.
    pub name: String,
    /// The object's number in BOP data sets, 1 to 999999; used once in all tables. The YCB objects have those of YCB-Video, 1 to
    /// 21.
    pub bop_id: u32,
    /// The object's mesh: an OBJ, PLY, STL, glTF (`.glb`, `.gltf`) or COLLADA file, relative to the table. The object's frame has the
    /// axes of the file (of a glTF with z up), its origin in the middle of the mesh's bounding box.
    #[serde(default)]
    pub mesh: Option<PathBuf>,
    /// The unit of the mesh's coordinates: `m` unless given.
    #[serde(default)]
    pub unit: Option<Unit>,
    /// A picture in place of the texture that the mesh names, relative to the table: PNG, JPEG or TIFF; the mesh must have texture
    /// coordinates.
    #[serde(default)]
    pub texture: Option<PathBuf>,
    /// A file whose parts (groups of an OBJ, meshes of a glTF or COLLADA file) are the object's solid, each by its convex hull, in place
    /// of pieces that are found; in the mesh's frame and unit, relative to the table.
    #[serde(default)]
    pub collision: Option<PathBuf>,
    /// Mass, kilograms, 0.001 to 50. This or `density_kg_m3`.
    #[serde(default)]
    pub mass_kg: Option<f64>,
    /// Density, kilograms per cubic metre, 1 to 30000, from which the mass follows with the volume of the mesh (of its convex hull, where
    /// it is not closed); of objects with a `mesh`.
    #[serde(default)]
    pub density_kg_m3: Option<f64>,
    /// Coulomb friction, 0.01 to 2. A contact has the mean of both sides' coefficients.
    pub friction: f64,
    /// Scored by ADD-S because turned copies cannot be told apart by shape.
    pub symmetric: bool,
    /// How easily it is damaged.
    pub fragility: Fragility,
    /// Must stand upright when packed.
    pub upright: bool,
    /// The axis about which any turn keeps the shape, if there is one. None where the row leaves it out.
    #[serde(default)]
    pub revolution: Option<Axis>,
    /// The axes about which a turn by 180 degrees keeps the shape, beyond what `revolution` says already; with
    /// `revolution`, one of the two others at most. None where the row leaves it out.
    #[serde(default)]
    pub half_turns: Vec<Axis>,
}

impl ObjectRow {
    /// The facts of the row, with the mass that it gives or that follows from the density and `volume`, cubic metres.
    ///
    /// # Errors
    /// What is wrong with the mass; in words, the caller names the file.
    pub fn info(
        &self,
        volume: impl FnOnce() -> Result<f64>,
    ) -> Result<std::result::Result<ObjectInfo, String>> {
        let name = &self.name;
        let mass_kg = match (self.mass_kg, self.density_kg_m3) {
            (Some(mass), _) => mass,
            (None, density) => {
                let (density, volume) = (density.unwrap_or_default(), volume()?);
                let mass = density * volume;
                if !(1e-3..=50.0).contains(&mass) {
                    return Ok(Err(format!(
                        "object '{name}': density_kg_m3 = {density} of {:.2} cm3 is {mass:.6} kg; masses are 0.001 to 50 kg: \
                         check density and unit",
                        1e6 * volume
                    )));
                }
                mass
            }
        };
        let Self { bop_id, friction, symmetric, fragility, upright, revolution, .. } = *self;
        let (name, half_turns) = (name.clone(), self.half_turns.clone());
        Ok(Ok(ObjectInfo {
            name,
            bop_id,
            mass_kg,
            friction,
            symmetric,
            fragility,
            upright,
            revolution,
            half_turns,
        }))
    }
}

/// Reads and checks the table, in the order of the file.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read; [`Error::Invalid`] with object, field and value for anything wrong in it.
pub fn load(path: &Path) -> Result<Vec<ObjectRow>> {
    parse(&files::read_to_string(path)?).map_err(|message| Error::invalid(path, message))
}

/// The same of the text of a file.
///
/// # Errors
/// What is wrong, in words; the caller names the file.
pub fn parse(text: &str) -> std::result::Result<Vec<ObjectRow>, String> {
    let table: ObjectTable = files::from_toml(text)?;
    check(&table)?;
    Ok(table.objects)
}

fn check(table: &ObjectTable) -> std::result::Result<(), String> {
    if table.schema != SCHEMA {
        return Err(format!("schema = \"{}\": this program reads \"{SCHEMA}\"", table.schema));
    }
    if table.objects.is_empty() {
        return Err("objects: the table is empty; give at least one [[objects]]".into());
    }
    for (index, row) in table.objects.iter().enumerate() {
        check_row(row)?;
        for other in &table.objects[..index] {
            if other.name == row.name {
                return Err(format!("object '{}': name is used twice; names are unique", row.name));
            }
            if other.bop_id == row.bop_id {
                return Err(format!(
                    "object '{}': bop_id = {} is used by '{}' too; ids are unique",
                    row.name, row.bop_id, other.name
                ));
            }
        }
    }
    Ok(())
}

fn check_row(row: &ObjectRow) -> std::result::Result<(), String> {
    let name = &row.name;
    // Names become folder names.
    if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-') {
        return Err(format!("object '{name}': name must be made of letters, digits, '_' and '-'"));
    }
    if row.bop_id == 0 || row.bop_id > 999_999 {
        return Err(format!("object '{name}': bop_id = {}: must be 1 to 999999", row.bop_id));
    }
    let of_mesh = [
        ("unit", row.unit.is_some()),
        ("texture", row.texture.is_some()),
        ("collision", row.collision.is_some()),
        ("density_kg_m3", row.density_kg_m3.is_some()),
    ];
    if let (None, Some((field, _))) = (&row.mesh, of_mesh.iter().find(|(_, given)| *given)) {
        return Err(format!(
            "object '{name}': {field} is for objects with a mesh of their own; give mesh, too"
        ));
    }
    match (row.mass_kg, row.density_kg_m3) {
        (Some(mass), None) => within(&format!("object '{name}': mass_kg"), mass, 1e-3, 50.0)?,
        (None, Some(density)) => within(&format!("object '{name}': density_kg_m3"), density, 1.0, 30_000.0)?,
        (Some(_), Some(_)) => {
            return Err(format!("object '{name}': has mass_kg and density_kg_m3; leave one out"));
        }
        (None, None) if row.mesh.is_some() => {
            return Err(format!("object '{name}': has neither mass_kg nor density_kg_m3; give one of them"));
        }
        (None, None) => return Err(format!("object '{name}': mass_kg is missing")),
    }
    within(&format!("object '{name}': friction"), row.friction, 0.01, 2.0)?;
    match symmetry::problem(row.revolution, &row.half_turns) {
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
            ("upright", "uprigth", "did you mean 'upright'?"),
            ("mass_kg = 0.1", "", "object 'a': mass_kg is missing"),
            ("mass_kg = 0.1", "density_kg_m3 = 900.0", "density_kg_m3 is for objects with a mesh"),
            ("mass_kg = 0.1", "mass_kg = 0.1\nunit = \"mm\"", "object 'a': unit is for objects with a mesh"),
            ("mass_kg = 0.1", "mesh = \"a.stl\"", "neither mass_kg nor density_kg_m3"),
            ("mass_kg = 0.1", "mesh = \"a.stl\"\nmass_kg = 0.1\ndensity_kg_m3 = 9.0", "leave one out"),
            ("mass_kg = 0.1", "mesh = \"a.stl\"\ndensity_kg_m3 = 0.1", "density_kg_m3 = 0.1"),
            ("mass_kg = 0.1", "mesh = \"a.stl\"\nmass_kg = 0.1\nunit = \"miles\"", "miles"),
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
