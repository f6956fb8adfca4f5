//! The parts of a scene in their looks: table, bin, floor and wall.

use std::sync::Arc;

use nalgebra::{Isometry3, Translation3, Vector3};

use super::look::Look;
use crate::mesh::Visual;
use crate::scene::{Fixture, FixtureKind};
use crate::shape::Convex;

/// Surroundings, ready to draw.
#[derive(Debug, Clone, Default)]
pub struct Furniture {
    /// Meshes and the world pose of each.
    pub drawn: Vec<(Isometry3<f64>, Arc<Visual>)>,
    /// Mean linear RGB reflectance of the table's top, 0 to 1: the colour of the light that it casts on what stands on
    /// it. Zero when there is no table.
    pub table_albedo: [f32; 3],
}

/// The floor is drawn this far in each direction, and the laboratory's wall stands this far ahead, metres.
pub(super) const ROOM_M: f64 = 4.0;
/// The room's middle is this far ahead of the origin, metres.
pub(super) const ROOM_X: f64 = 0.5;

/// The looks of all parts.
pub(super) struct Parts {
    pub table: Look,
    pub legs: Look,
    pub stand: Look,
    /// Carton, crate, tote and bag, in the order of [`BinKind`](crate::scene::BinKind).
    pub bins: [Look; 4],
    pub floor: Look,
    pub wall: Look,
    /// Where the wall's face stands, metres along x.
    pub wall_x: f64,
}

/// Each fixture in its look; floor and wall.
pub(super) fn assemble(fixtures: &[Fixture], parts: &Parts) -> Furniture {
    let mut furniture = Furniture::default();
    for fixture in fixtures {
        let look = match fixture.kind {
            FixtureKind::TableTop => &parts.table,
            FixtureKind::Bin(kind) => &parts.bins[kind as usize],
            FixtureKind::TableLeg => &parts.legs,
            FixtureKind::Stand | FixtureKind::Block => &parts.stand,
        };
        if fixture.kind == FixtureKind::TableTop {
            furniture.table_albedo = parts.table.albedo();
        }
        let visual = match &fixture.shape.geometry {
            Convex::Cuboid { half } => look.cuboid(*half),
            Convex::Hull { points } => look.hull(points),
            Convex::Cylinder { .. } | Convex::Sphere { .. } => unreachable!("no scene has round fixtures"),
        };
        furniture.drawn.push((fixture.shape.pose, visual));
    }
    let floor = parts.floor.cuboid(Vector3::new(ROOM_M, ROOM_M, 0.01));
    furniture.drawn.push((Isometry3::from(Translation3::new(ROOM_X, 0.0, -0.01)), floor));
    let wall = parts.wall.cuboid(Vector3::new(0.01, ROOM_M, 1.5));
    furniture.drawn.push((Isometry3::from(Translation3::new(parts.wall_x, 0.0, 1.5)), wall));
    furniture
}
