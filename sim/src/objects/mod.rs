//! The 21 YCB-Video objects: a table of facts (`scenes/objects.toml`) and a model for each, built in code or read from
//! a scanned set.

use std::path::PathBuf;

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

use crate::mesh::Visual;
use crate::shape::CollisionShape;

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

/// How easily an object is damaged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fragility {
    /// Takes any load.
    Sturdy,
    /// Nothing heavy on top.
    Delicate,
    /// Nothing on top, low grip force.
    Fragile,
}

/// One row of `scenes/objects.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectInfo {
    /// YCB name, such as `005_tomato_soup_can`.
    pub name: String,
    /// The object's number in YCB-Video's BOP data set, 1 to 21.
    pub bop_id: u32,
    /// Mass, kilograms (YCB object list).
    pub mass_kg: f64,
    /// Coulomb friction against the table and the pads' average rule.
    pub friction: f64,
    /// Scored by ADD-S because turned copies cannot be told apart by shape.
    pub symmetric: bool,
    /// How easily it is damaged.
    pub fragility: Fragility,
    /// Must stand upright when packed.
    pub upright: bool,
}

/// An object: facts, looks and solid. Immutable.
#[derive(Debug, Clone)]
pub struct ObjectModel {
    /// The table's row.
    pub info: ObjectInfo,
    /// Looks; the mesh is closed and in the object frame.
    pub visual: std::sync::Arc<Visual>,
    /// Convex pieces in the object frame; together they are the solid that physics uses.
    pub collision: Vec<CollisionShape>,
    /// Lower corner of the mesh's bounding box, metres (minus `max`, by the frame's definition).
    pub min: Point3<f64>,
    /// Upper corner of the mesh's bounding box, metres.
    pub max: Point3<f64>,
    /// Largest distance between two vertices, metres.
    pub diameter: f64,
}

impl ObjectModel {
    /// Extents of the bounding box, metres.
    pub fn size(&self) -> Vector3<f64> {
        self.max - self.min
    }
}
