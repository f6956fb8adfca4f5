//! The laboratory: a beech table, a cardboard bin, grey linoleum, white plaster.

use super::look::Look;
use super::parts::{Furniture, Parts, ROOM_M, ROOM_X, assemble};
use crate::render::textures;
use crate::scene::Fixture;

/// Metres that one repeat of a laboratory texture covers.
const WOOD_M: f64 = 0.8;
const CARDBOARD_M: f64 = 0.4;
const WALL_M: f64 = 2.0;
const FLOOR_M: f64 = 1.0;

pub(super) fn furniture(fixtures: &[Fixture], seed: u64) -> Furniture {
    let steel = Look::plain([0.32, 0.33, 0.35], 0.5);
    let parts = Parts {
        table: Look::textured(textures::wood(seed as u32), WOOD_M, 0.55),
        legs: steel.clone(),
        stand: steel,
        bins: [
            Look::textured(textures::cardboard(), CARDBOARD_M, 0.9),
            Look::textured(textures::wood(seed as u32 ^ 1), WOOD_M, 0.8),
            Look::plain([0.06, 0.14, 0.34], 0.35),
            Look::plain([0.46, 0.32, 0.19], 0.95),
        ],
        floor: Look::textured(textures::floor(seed as u32), FLOOR_M, 0.6),
        wall: Look::textured(textures::wall(), WALL_M, 0.95),
        wall_x: ROOM_X + ROOM_M,
    };
    assemble(fixtures, &parts)
}
