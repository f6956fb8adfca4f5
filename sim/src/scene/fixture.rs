//! Solids that never move, as the scene is built of them.

use nalgebra::{Isometry3, Vector3};

use super::BinKind;
use crate::shape::{CollisionShape, Convex};

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
