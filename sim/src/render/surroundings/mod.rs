//! What stands about the objects: table, bin, floor, wall, and things in the distance, as things to draw.

mod cell;
mod distractors;
mod laboratory;
mod look;
mod parts;
mod solids;
mod unknown;
mod varied;

use crate::scene::{Fixture, Surroundings};

pub use parts::Furniture;
pub use unknown::unknown_object;

/// The scene's fixtures, a floor, a wall behind the table and, when varied, distractors. The same for the same seed.
pub fn furniture(fixtures: &[Fixture], surroundings: Surroundings, seed: u64) -> Furniture {
    match surroundings {
        Surroundings::Laboratory => laboratory::furniture(fixtures, seed),
        Surroundings::Varied => varied::furniture(fixtures, seed),
    }
}

#[cfg(test)]
mod tests;
