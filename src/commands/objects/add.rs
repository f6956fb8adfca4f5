//! `grip objects add`: measures a mesh and writes its row.

use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use crate::assets;
use crate::object_report::ObjectReport;
use anyhow::{Context, Result, ensure};
use grip_manip::Planner;
use grip_sim::objects::own::OwnMesh;
use grip_sim::objects::table::{self, ObjectRow};
use grip_sim::objects::{Axis, ObjectLibrary, ObjectSet, measured_symmetry};
use grip_sim::unfinished::Unfinished;

use crate::cli::AddArgs;
use crate::commands::{Done, output};

/// How a new table begins.
const HEADER: &str = "\
# Objects of our own, for --objects of every command: docs/objects.md says what the fields mean.
#
#   mesh       relative to this file; with unit \"m\", \"cm\", \"mm\" or \"in\"
#   mass_kg    or density_kg_m3
#   friction   Coulomb coefficient; a contact has the mean of both sides' coefficients
";

/// Appends the row of a mesh to a table and prints what was measured.
pub fn run(args: &AddArgs) -> Result<Done> {
    let table = &args.table;
    let exists = table.exists();
    // What there is already, of the built-in table and of others.
    let mut tables = args.tables.tables.clone();
    tables.extend(exists.then(|| table.clone()));
    let base = assets::find("scenes/objects.toml");
    let library = ObjectLibrary::with_tables(&base, &tables, ObjectSet::BuiltIn)?;
    let free = 1 + library.infos().map(|info| info.bop_id).max().unwrap_or(0);
    let name = args.name.clone().map_or_else(|| name_of(&args.mesh), Ok)?;
    ensure!(
        library.names().all(|known| known != name),
        "{name}: there is an object of this name already; give another --name"
    );

    let bop_id = args.bop_id.unwrap_or(free);
    ensure!(
        library.infos().all(|info| info.bop_id != bop_id),
        "--bop-id {bop_id}: is in use; {free} and above are free"
    );

    let text = if exists {
        grip_sim::files::read_to_string(table)?.into_owned()
    } else {
        format!("{HEADER}schema = \"{}\"\n", table::SCHEMA)
    };
    let parse = |text: &str| -> Result<ObjectRow> {
        let rows = table::parse(text).map_err(anyhow::Error::msg).context("the new row")?;
        rows.into_iter().next_back().context("the new row is missing")
    };
    // The shape is looked at first: the row says its symmetry.
    let mut row = Row { args, name: &name, bop_id, symmetry: (None, Vec::new()) };
    let own = OwnMesh::of(table, &parse(&row.after(&text)?)?).context("the new row has no mesh")?;
    let (visual, origin) = own.visual()?;
    row.symmetry = measured_symmetry(&visual.mesh, visual.mesh.diameter());
    let text = row.after(&text)?;
    let written = parse(&text)?;
    let info = written.info(|| own.volume())?.map_err(anyhow::Error::msg)?;
    let model = Arc::new(own.model(info)?);

    let (_, robot, config) = args.robot.load()?;
    let config = Arc::new(config);
    let planner =
        Planner::new(Arc::new(robot), config.clone(), args.settings.load()?.for_robot(&config).planner);
    let report = ObjectReport::new(&model, own.path(), &origin, &planner, &config)?;
    if !args.dry_run {
        write(table, &text).with_context(|| format!("{}: cannot be written", table.display()))?;
    }
    if args.json {
        output::json(&report)?;
    } else {
        output::data(format_args!("{}", report.text()))?;
    }
    let what = if args.dry_run { "would be written to" } else { "written to" };
    output::message(format_args!("{what} {}", table.display()));
    Ok(Done::Fully)
}

/// The table with its new text, whole.
fn write(table: &Path, text: &str) -> std::io::Result<()> {
    if let Some(folder) = table.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder)?;
    }
    let building = Unfinished::beside(table)?;
    std::fs::write(building.path(), text)?;
    building.move_to(table)
}

/// The name of a mesh file, as an object's.
fn name_of(mesh: &Path) -> Result<String> {
    let stem = mesh.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    let name: String = stem.chars().map(plain).collect();
    ensure!(
        name.contains(|c: char| c.is_ascii_alphanumeric()),
        "{}: makes no name of letters and digits; give --name",
        mesh.display()
    );
    Ok(name)
}

/// The row to be written.
struct Row<'a> {
    args: &'a AddArgs,
    name: &'a str,
    bop_id: u32,
    symmetry: (Option<Axis>, Vec<Axis>),
}

impl Row<'_> {
    /// The table with the row at its end.
    fn after(&self, text: &str) -> Result<String> {
        let Self { args, name, bop_id, symmetry: (revolution, half_turns) } = self;
        let folder = args.table.parent().unwrap_or(Path::new("."));
        let file = |path: &PathBuf| -> Result<String> {
            let relative = relative(folder, path)
                .with_context(|| format!("{}: cannot be found from the table", path.display()))?;
            let text =
                relative.to_str().with_context(|| format!("{}: its name is no text", path.display()))?;
            Ok(quoted(text))
        };
        let mut lines =
            vec!["[[objects]]".to_owned(), format!("name = {}", quoted(name)), format!("bop_id = {bop_id}")];
        lines.push(format!("mesh = {}", file(&args.mesh)?));
        lines.push(format!("unit = \"{}\"", args.unit.unit()));
        for (field, path) in [("texture", &args.texture), ("collision", &args.collision)] {
            if let Some(path) = path {
                lines.push(format!("{field} = {}", file(path)?));
            }
        }
        for (field, value) in [("mass_kg", args.mass), ("density_kg_m3", args.density)] {
            if let Some(value) = value {
                lines.push(format!("{field} = {value:?}"));
            }
        }
        lines.push(format!("friction = {:?}", args.friction));
        let symmetric = args.symmetric.unwrap_or(revolution.is_some() || !half_turns.is_empty());
        lines.push(format!("symmetric = {symmetric}"));
        lines.push(format!("fragility = \"{}\"", args.fragility.name()));
        lines.push(format!("upright = {}", args.upright));
        if let Some(axis) = revolution {
            lines.push(format!("revolution = \"{}\"", axis.letter()));
        }
        if !half_turns.is_empty() {
            let axes: Vec<String> = half_turns.iter().map(|axis| format!("\"{}\"", axis.letter())).collect();
            lines.push(format!("half_turns = [{}]", axes.join(", ")));
        }
        let break_before = if text.ends_with('\n') { "\n" } else { "\n\n" };
        Ok(format!("{text}{break_before}{}\n", lines.join("\n")))
    }
}

/// As TOML writes a text.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// A file's path as seen from a folder, which need not be there yet.
fn relative(folder: &Path, file: &Path) -> std::io::Result<PathBuf> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let folder = folder.canonicalize().or_else(|_| std::path::absolute(folder))?;
    let name = file.file_name().unwrap_or_default();
    let parent = file.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // The file itself may be a link, which stays one.
    let file = parent.canonicalize()?.join(name);
    let common = folder.components().zip(file.components()).take_while(|(a, b)| a == b).count();
    if common == 0 {
        return Ok(file);
    }
    let up = folder.components().skip(common).map(|_| Component::ParentDir);
    Ok(up.chain(file.components().skip(common)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_named_as_seen_from_the_table() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path();
        std::fs::create_dir_all(root.join("a/meshes")).unwrap();
        let see = |folder: &str, file: &str| relative(&root.join(folder), &root.join(file)).unwrap();
        assert_eq!(see("a", "a/meshes/b.stl"), Path::new("meshes/b.stl"));
        assert_eq!(see("a/meshes", "a/b.stl"), Path::new("../b.stl"));
        assert_eq!(see("a", "a/meshes/../b.stl"), Path::new("b.stl"));
        assert!(relative(&root.join("a"), &root.join("none/b.stl")).is_err());
    }

    #[test]
    fn a_files_name_makes_an_objects() {
        assert_eq!(name_of(Path::new("x/My mug (2).obj")).unwrap(), "My_mug__2_");
        assert!(name_of(Path::new("é.obj")).is_err());
    }
}
