//! Looks drawn from the seed, a stream for each part: what is drawn for one part never changes another.

use rand::RngExt;

use super::cell::Cell;
use super::distractors;
use super::look::{Look, Odds};
use super::parts::{Furniture, Parts, assemble};
use crate::render::textures::Family::*;
use crate::rng;
use crate::scene::Fixture;

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
        Look::drawn(
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
