//! Corrugated cardboard.

use std::f32::consts::TAU;

use image::RgbImage;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::colors::{near, scale};
use super::noise::{Cloud, paint, ramp};

/// Brown, pale, dark and recycled grey, and bleached.
const BOARD: [[f32; 3]; 5] =
    [[0.69, 0.545, 0.40], [0.78, 0.66, 0.50], [0.56, 0.42, 0.29], [0.62, 0.58, 0.52], [0.88, 0.87, 0.83]];

pub(super) fn draw(size: u32, rng: &mut ChaCha8Rng) -> RgbImage {
    let seed: u32 = rng.random();
    let color = near(&BOARD, rng);
    let flutes = rng.random_range(40..80) as f32 * TAU;
    let relief = rng.random_range(0.005..0.05);
    let fibres = rng.random_range(0.06..0.16);
    let fibre_at = Cloud::new([40, 160], seed, 2);
    let blotch_at = Cloud::new([5, 5], seed ^ 1, 3);
    let specks = Cloud::new([128, 128], seed ^ 2, 1);
    paint(size, |x, y| {
        let flute = (x * flutes).sin();
        let fibre = fibre_at.at(x, y);
        let blotch = blotch_at.at(x, y);
        let speck = ramp(0.86, 0.93, specks.at(x, y));
        let light = 1.0 + relief * flute + fibres * (fibre - 0.5) + 0.12 * (blotch - 0.5) - 0.2 * speck;
        scale(color, light)
    })
}
