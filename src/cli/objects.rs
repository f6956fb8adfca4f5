//! The options of objects.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use grip_sim::objects::table::Unit;

use super::{RobotFile, SettingsFile};

/// Objects of one's own.
#[derive(Debug, Clone, Default, Args)]
pub struct ObjectTables {
    /// Table of objects of your own (docs/objects.md), beside the built-in ones; may be given more than once.
    #[arg(long = "objects", value_name = "TABLE.toml", value_parser = table_file)]
    pub tables: Vec<PathBuf>,
}

/// Whether a path is that of a table.
pub fn is_table(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "toml")
}

fn table_file(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    if is_table(&path) { Ok(path) } else { Err("must be a table of objects, a .toml file".into()) }
}

/// `grip objects`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct ObjectsArgs {
    /// What to do with them; `list` where nothing is said.
    #[command(subcommand)]
    pub command: Option<ObjectsCommand>,
    #[command(flatten)]
    pub list: ObjectsListArgs,
}

/// What to do with objects.
#[derive(Debug, Subcommand)]
pub enum ObjectsCommand {
    /// List the objects and the set that is in use.
    List(ObjectsListArgs),
    /// Measure a mesh of your own and write its row into a table of objects, for --objects of all commands: size, volume, inertia,
    /// symmetry, resting poses, solid, grasps.
    Add(Box<AddArgs>),
}

/// `grip objects list`.
#[derive(Debug, Args)]
pub struct ObjectsListArgs {
    /// Folder of scanned objects (official YCB layout, or a BOP `models` folder) [env: GRIP_YCB_DIR].
    #[arg(long, value_name = "DIR")]
    pub ycb: Option<PathBuf>,
    #[command(flatten)]
    pub tables: ObjectTables,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// `grip objects add`.
#[derive(Debug, Args)]
pub struct AddArgs {
    /// The mesh: .obj, .ply, .stl, .glb, .gltf or .dae.
    pub mesh: PathBuf,
    /// The table that gets the row; one that is not there is begun.
    #[arg(long, value_name = "TABLE.toml", value_parser = table_file)]
    pub table: PathBuf,
    /// The object's name [default: that of the file].
    #[arg(long)]
    pub name: Option<String>,
    /// The unit of the mesh's coordinates.
    #[arg(long, value_enum, default_value_t = UnitChoice::M)]
    pub unit: UnitChoice,
    /// Mass, kilograms.
    #[arg(long, value_name = "KG", required_unless_present = "density")]
    pub mass: Option<f64>,
    /// Density in place of the mass, kg/m3: water has 1000.
    #[arg(long, value_name = "KG/M3", conflicts_with = "mass")]
    pub density: Option<f64>,
    /// Coulomb friction; a contact has the mean of both sides' coefficients (pads: 0.9).
    #[arg(long, value_name = "MU", default_value_t = 0.5)]
    pub friction: f64,
    /// A picture in place of the texture that the mesh names.
    #[arg(long, value_name = "FILE")]
    pub texture: Option<PathBuf>,
    /// A file whose parts are the solid, each by its convex hull, in place of pieces that are found; in the mesh's frame and unit.
    #[arg(long, value_name = "FILE")]
    pub collision: Option<PathBuf>,
    /// Score its poses by ADD-S (or not) [default: if its shape has a symmetry].
    #[arg(long, value_name = "true|false")]
    pub symmetric: Option<bool>,
    /// How easily it is damaged.
    #[arg(long, value_enum, default_value_t = FragilityChoice::Sturdy)]
    pub fragility: FragilityChoice,
    /// It must stand upright when packed.
    #[arg(long)]
    pub upright: bool,
    /// The object's number in BOP data sets [default: the next that no table has].
    #[arg(long, value_name = "ID", value_parser = clap::value_parser!(u32).range(1..=999_999))]
    pub bop_id: Option<u32>,
    #[command(flatten)]
    pub tables: ObjectTables,
    #[command(flatten)]
    pub robot: RobotFile,
    #[command(flatten)]
    pub settings: SettingsFile,
    /// Measure, and write nothing.
    #[arg(long)]
    pub dry_run: bool,
    /// Print what was measured as one JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

/// Units of meshes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum UnitChoice {
    /// Metres.
    M,
    /// Centimetres.
    Cm,
    /// Millimetres.
    Mm,
    /// Inches.
    In,
}

impl UnitChoice {
    /// As the library has it.
    pub fn unit(self) -> Unit {
        match self {
            Self::M => Unit::M,
            Self::Cm => Unit::Cm,
            Self::Mm => Unit::Mm,
            Self::In => Unit::In,
        }
    }
}

/// How easily an object is damaged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum FragilityChoice {
    /// Takes any load.
    Sturdy,
    /// Nothing heavy on top.
    Delicate,
    /// Nothing on top, low grip force.
    Fragile,
}

impl FragilityChoice {
    /// As in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sturdy => "sturdy",
            Self::Delicate => "delicate",
            Self::Fragile => "fragile",
        }
    }
}
