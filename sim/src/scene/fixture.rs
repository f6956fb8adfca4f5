//! Solids that never move, as the scene is built of them.

use nalgebra::{Isometry3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::shape::{CollisionShape, Convex};

/// How a bin is built and what it looks like. All are rigid: a bag stands open, as one does in a packing frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum BinKind {
    /// Straight walls of cardboard.
    #[default]
    Carton,
    /// Walls of wooden slats with gaps between them.
    Crate,
    /// A plastic tub whose walls lean outwards.
    Tote,
    /// Straight walls of paper: for high, thin ones.
    Bag,
}

/// What a fixture is made of, for its looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FixtureKind {
    /// The table's top.
    TableTop,
    /// A table leg.
    TableLeg,
    /// Floor or wall of the bin.
    Bin(BinKind),
    /// What the bin stands on when it stands beside the table.
    Stand,
    /// A shelf, a step, a wall.
    Block,
}

/// A solid that never moves.
#[derive(Debug, Clone)]
pub struct Fixture {
    /// Which part it is.
    pub kind: FixtureKind,
    /// The solid, in the world frame.
    pub shape: CollisionShape,
    /// Coulomb friction.
    pub friction: f64,
}

pub(super) fn block(kind: FixtureKind, pose: Isometry3<f64>, half: [f64; 3], friction: f64) -> Fixture {
    Fixture {
        kind,
        shape: CollisionShape { pose, geometry: Convex::Cuboid { half: Vector3::from(half) } },
        friction,
    }
}

/// Of table and bin, unless given: wood or cardboard against what is packed.
pub(super) fn default_friction() -> f64 {
    0.6
}
