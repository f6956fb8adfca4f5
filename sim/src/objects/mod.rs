//! Objects: tables of facts and a model for each row. The 21 YCB-Video objects (`scenes/objects.toml`) are built in code or
//! read from a scanned set; objects of one's own are read from mesh files.
//!
//! | module | what it does |
//! |---|---|
//! | [`table`] | reads and checks tables such as `scenes/objects.toml` |
//! | [`library`] | the tables and the models of one set, loaded when asked for |
//! | `builtin` | parametric models of all 21 objects |
//! | [`own`] | models of one's own, from the files that a row names |
//! | [`any_mesh`], `gltf` | a mesh in whatever format; glTF files |
//! | [`mass`] | volume, centre of mass and inertia of a mesh |
//! | [`scans`] | models from the official YCB scans or from BOP |
//! | [`mesh_io`] | OBJ and PLY files |
//! | `obj` | OBJ files and material libraries as people write them |
//! | [`decompose`] | convex pieces of a scanned mesh |
//! | [`Axis`] | turns that keep an object's shape, as declared in the table |
//! | [`collision_error()`] | how far the pieces are from the mesh |

pub mod any_mesh;
mod builtin;
pub mod collision_error;
pub mod decompose;
mod gltf;
pub mod library;
pub mod mass;
pub mod mesh_io;
pub(crate) mod obj;
pub mod own;
pub(crate) mod ply;
pub mod scans;
mod symmetry;
pub mod table;

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use nalgebra::{Point3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::{Mesh, Visual};
use crate::shape::CollisionShape;

pub use collision_error::{CollisionError, collision_error};
pub use library::{ObjectLibrary, resolve_set};
pub use own::MeshSource;
pub use symmetry::{Axis, measured as measured_symmetry};

/// Where the models come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ObjectSet {
    /// Parametric models made in code.
    BuiltIn,
    /// The official YCB layout, `NNN_name/google_16k/textured.obj`.
    Ycb(PathBuf),
    /// A BOP `models` folder of `obj_NNNNNN.ply` in millimetres.
    Bop(PathBuf),
}

impl ObjectSet {
    /// The set's name in tables and reports.
    pub fn label(&self) -> &'static str {
        match self {
            Self::BuiltIn => "built-in",
            Self::Ycb(_) => "ycb",
            Self::Bop(_) => "bop",
        }
    }
}

/// How easily an object is damaged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Fragility {
    /// Takes any load.
    Sturdy,
    /// Nothing heavy on top.
    Delicate,
    /// Nothing on top, low grip force.
    Fragile,
}

impl Fragility {
    /// Height of a fall onto something hard that does no harm, metres. Our assumption, as the classes themselves are.
    pub fn harmless_fall_m(self) -> f64 {
        match self {
            Self::Sturdy => 0.5,
            Self::Delicate => 0.1,
            Self::Fragile => 0.02,
        }
    }

    /// Whether an object of `mass_kg` may rest on it.
    pub fn bears(self, mass_kg: f64) -> bool {
        /// Heavier things crush what is delicate, kilograms.
        const HEAVY: f64 = 0.3;
        match self {
            Self::Sturdy => true,
            Self::Delicate => mass_kg <= HEAVY,
            Self::Fragile => false,
        }
    }
}

/// The facts about an object: a row of its table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObjectInfo {
    /// Such as `005_tomato_soup_can`.
    pub name: String,
    /// The object's number in BOP data sets; of the YCB objects that in YCB-Video, 1 to 21.
    pub bop_id: u32,
    /// Mass, kilograms (of the YCB objects: their list).
    pub mass_kg: f64,
    /// Coulomb friction; a contact has the mean of both sides' coefficients.
    pub friction: f64,
    /// Scored by ADD-S because turned copies cannot be told apart by shape.
    pub symmetric: bool,
    /// How easily it is damaged.
    pub fragility: Fragility,
    /// Must stand upright when packed.
    pub upright: bool,
    /// The axis about which any turn keeps the shape, if there is one. None where the row leaves it out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub revolution: Option<Axis>,
    /// The axes about which a turn by 180 degrees keeps the shape, beyond what `revolution` says already; with
    /// `revolution`, one of the two others at most. None where the row leaves it out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub half_turns: Vec<Axis>,
}

impl ObjectInfo {
    /// The largest blow that does the object no harm: its momentum after a harmless fall, newton seconds.
    pub fn harmless_impulse_n_s(&self) -> f64 {
        self.mass_kg * (2.0 * 9.81 * self.fragility.harmless_fall_m()).sqrt()
    }
}

/// An object: facts, looks and solid. Immutable.
#[derive(Debug, Clone)]
pub struct ObjectModel {
    /// The table's row.
    pub info: ObjectInfo,
    /// Looks; the mesh is closed and in the object frame.
    pub visual: Arc<Visual>,
    /// Convex pieces in the object frame; together they are the solid that physics uses.
    pub collision: Vec<CollisionShape>,
    /// Lower corner of the mesh's bounding box, metres; minus `max` up to the 0.3 mm by which BOP's own files miss the
    /// frame's definition.
    pub min: Point3<f64>,
    /// Upper corner of the mesh's bounding box, metres.
    pub max: Point3<f64>,
    /// Largest distance between two vertices, metres.
    pub diameter: f64,
    /// The files it is from, if it is none of a set's models.
    pub source: Option<Arc<MeshSource>>,
    rough: OnceLock<Mesh>,
}

impl ObjectModel {
    /// How far [`ObjectModel::rough`] may be from the surface, metres.
    const ROUGH_ERROR: f64 = 0.003;

    /// Puts a model together; bounds and diameter are those of the mesh.
    pub fn new(info: ObjectInfo, visual: Visual, collision: Vec<CollisionShape>) -> Self {
        let (min, max) = visual.mesh.bounds().unwrap_or((Point3::origin(), Point3::origin()));
        let diameter = visual.mesh.diameter();
        Self {
            info,
            visual: Arc::new(visual),
            collision,
            min,
            max,
            diameter,
            source: None,
            rough: OnceLock::new(),
        }
    }

    /// The surface within 3 mm in a few hundred triangles: enough to tell what hides what.
    pub fn rough(&self) -> &Mesh {
        self.rough.get_or_init(|| self.visual.mesh.simplified(Self::ROUGH_ERROR))
    }

    /// Extents of the bounding box, metres.
    pub fn size(&self) -> Vector3<f64> {
        self.max - self.min
    }
}
