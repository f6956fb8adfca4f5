//! Looks drawn from the seed, a stream for each part: what is drawn for one part never changes another.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Furniture, Look, Parts, assemble, distractors};
use crate::mesh::Material;
use crate::render::textures::Family::{self, *};
use crate::rng;
use crate::scene::{Fixture, FixtureKind};
use crate::shape::Convex;

/// Families and their shares, per cent.
type Odds = [(Family, u32)];

const TABLE: &Odds =
    &[(Wood, 35), (Cloth, 20), (Plain, 15), (Checker, 10), (Stone, 10), (Clutter, 7), (Print, 3)];
const LEGS: &Odds = &[(Metal, 35), (Plain, 30), (Wood, 25), (Plastic, 10)];
const STAND: &Odds = &[(Plain, 30), (Wood, 30), (Metal, 15), (Plastic, 15), (Cardboard, 10)];
const BIN: &Odds =
    &[(Cardboard, 40), (Plastic, 30), (Wood, 10), (Metal, 8), (Cloth, 5), (Print, 4), (Clutter, 3)];
const FLOOR: &Odds = &[
    (Tiles, 20),
    (Wood, 20),
    (Carpet, 18),
    (Plaster, 15),
    (Stone, 12),
    (Plain, 8),
    (Checker, 5),
    (Clutter, 2),
];
const WALL: &Odds =
    &[(Plaster, 45), (Brick, 14), (Tiles, 10), (Wood, 9), (Plain, 9), (Print, 8), (Clutter, 5)];

/// Side of the pictures of the large parts, pixels: at 0.8 m a repeat, as fine as the camera sees a table 1 m away.
const TABLE_PX: u32 = 512;
/// The same for what is farther off, or small.
const OTHER_PX: u32 = 256;

pub(super) fn furniture(fixtures: &[Fixture], seed: u64) -> Furniture {
    let part = |name: &str, odds: &Odds, scale| {
        look(
            odds,
            scale,
            if name == "table" { TABLE_PX } else { OTHER_PX },
            &mut rng::stream(seed, &format!("surroundings/{name}")),
        )
    };
    let cell = Cell::of(fixtures);
    let wall_x = cell.high[0] + rng::stream(seed, "surroundings/room").random_range(0.9..3.6);
    let bin = part("bin", BIN, 0.5..1.5);
    let parts = Parts {
        // A table seen from 1 m away shows the texels of larger repeats.
        table: part("table", TABLE, 0.5..1.3),
        legs: part("legs", LEGS, 0.5..1.5),
        stand: part("stand", STAND, 0.5..1.5),
        bins: std::array::from_fn(|_| bin.clone()),
        floor: part("floor", FLOOR, 0.6..1.8),
        wall: part("wall", WALL, 0.6..1.8),
        wall_x,
    };
    let mut furniture = assemble(fixtures, &parts);
    let rng = &mut rng::stream(seed, "surroundings/distractors");
    furniture.drawn.extend(distractors::draw(&cell, wall_x, rng));
    furniture
}

/// A look by `odds`, its repeat `scale` times as large as is natural, its picture `size` pixels wide.
pub(super) fn look(odds: &Odds, scale: std::ops::Range<f64>, size: u32, rng: &mut ChaCha8Rng) -> Look {
    let mut left = rng.random_range(0..odds.iter().map(|(_, share)| share).sum());
    let family = odds.iter().find(|(_, share)| {
        let found = left < *share;
        left = left.saturating_sub(*share);
        found
    });
    let swatch = family.map_or(Plain, |(family, _)| *family).draw(rng.random(), size);
    // Even in the logarithm: half as large is as likely as twice as large.
    let metres = swatch.metres * rng.random_range(scale.start.ln()..scale.end.ln()).exp();
    let material = Material {
        base_color: [1.0; 3],
        roughness: swatch.roughness,
        metallic: swatch.metallic,
        texture: Some(swatch.image.into()),
    };
    Look { material, metres }
}

/// The space that table and bin take.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    /// Lower and upper corner of all fixtures seen from above, metres.
    pub low: [f64; 2],
    pub high: [f64; 2],
    /// The table's centre along x, metres.
    pub center_x: f64,
    /// Height of the table's top, metres.
    pub top: f64,
}

impl Cell {
    fn of(fixtures: &[Fixture]) -> Self {
        let mut cell =
            Self { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2], center_x: 0.0, top: 0.0 };
        for fixture in fixtures {
            let Convex::Cuboid { half } = &fixture.shape.geometry else { continue };
            let reach = fixture.shape.pose.rotation.to_rotation_matrix().matrix().abs() * half;
            let center = fixture.shape.pose.translation.vector;
            for axis in 0..2 {
                cell.low[axis] = cell.low[axis].min(center[axis] - reach[axis]);
                cell.high[axis] = cell.high[axis].max(center[axis] + reach[axis]);
            }
            if fixture.kind == FixtureKind::TableTop {
                cell.center_x = center.x;
                cell.top = center.z + half.z;
            }
        }
        if cell.low[0] > cell.high[0] {
            (cell.low, cell.high) = ([0.0; 2], [0.0; 2]);
        }
        cell
    }
}
