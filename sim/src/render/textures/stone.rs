//! Marble, granite and terrazzo.

use std::f32::consts::TAU;

use image::RgbImage;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::colors::{any, apart, grey, mix, muted, near, scale};
use super::noise::{Cells, Cloud, fraction, paint, ramp};

pub(super) fn draw(size: u32, rng: &mut ChaCha8Rng) -> RgbImage {
    match rng.random_range(0..3) {
        0 => marble(size, rng),
        1 => granite(size, rng),
        _ => terrazzo(size, rng),
    }
}

const MARBLE: [[f32; 3]; 5] =
    [[0.90, 0.89, 0.87], [0.82, 0.76, 0.68], [0.16, 0.17, 0.18], [0.25, 0.38, 0.33], [0.62, 0.38, 0.33]];

/// Clouds and two layers of thin veins.
fn marble(size: u32, rng: &mut ChaCha8Rng) -> RgbImage {
    let seed: u32 = rng.random();
    let stone = near(&MARBLE, rng);
    let dark_or_pale =
        if stone[0] > 0.5 { near(&[[0.45, 0.43, 0.42], [0.55, 0.45, 0.33]], rng) } else { [0.85; 3] };
    let strength = rng.random_range(0.4..0.9);
    let slant = [
        rng.random_range(1..3) as f32,
        rng.random_range(1..3) as f32 * if rng.random() { 1.0 } else { -1.0 },
    ];
    let bent = rng.random_range(5.0..11.0_f32);
    let [bend, bend_fine, presence, ground] = [(0, 3, 5), (1, 6, 4), (2, 4, 2), (3, 4, 3)]
        .map(|(salt, n, octaves)| Cloud::new([n, n], seed ^ salt, octaves));
    paint(size, |x, y| {
        // Veins run along parallel lines that turbulence bends (Perlin 1985), and come and go.
        let line = TAU * (slant[0] * x + slant[1] * y);
        let vein = |phase: f32, bend: &Cloud, thin: f32| {
            let level = (line + phase + bent * (bend.at(x, y) - 0.5)).sin().abs();
            (1.0 - ramp(0.0, thin, level)).max(0.35 * (1.0 - ramp(0.0, 6.0 * thin, level)))
        };
        let here = ramp(0.3, 0.7, presence.at(x, y));
        let veins = (here * vein(0.0, &bend, 0.08)).max(0.5 * (1.0 - here) * vein(2.0, &bend_fine, 0.05));
        scale(mix(stone, dark_or_pale, strength * veins), 0.88 + 0.24 * ground.at(x, y))
    })
}

const GRANITE: [[f32; 3]; 5] =
    [[0.62, 0.60, 0.58], [0.60, 0.45, 0.38], [0.28, 0.28, 0.29], [0.72, 0.68, 0.58], [0.35, 0.40, 0.42]];

/// Grains of three minerals.
fn granite(size: u32, rng: &mut ChaCha8Rng) -> RgbImage {
    let seed: u32 = rng.random();
    let ground = near(&GRANITE, rng);
    let pale = mix(ground, [0.92, 0.90, 0.87], rng.random_range(0.3..0.8));
    let dark = scale(ground, rng.random_range(0.2..0.5));
    let cells = rng.random_range(40..80);
    let patches = Cloud::new([cells / 2, cells / 2], seed ^ 1, 1);
    let fine = Cloud::new([160, 160], seed ^ 2, 1);
    let grains = Cells::new(cells, seed);
    paint(size, |x, y| {
        let grain = grains.at(x, y);
        let patch = patches.at(x, y);
        let mineral = grain.id + 0.9 * (patch - 0.5);
        let color = if mineral < 0.3 {
            dark
        } else if mineral < 0.68 {
            ground
        } else {
            pale
        };
        scale(color, 0.90 + 0.2 * fine.at(x, y))
    })
}

/// Chips of several colours in cement.
fn terrazzo(size: u32, rng: &mut ChaCha8Rng) -> RgbImage {
    let seed: u32 = rng.random();
    let cement = if rng.random_bool(0.7) { grey(rng) } else { muted(rng) };
    let chips: Vec<[f32; 3]> = (0..rng.random_range(2..6))
        .map(|_| if rng.random_bool(0.5) { apart(cement, rng) } else { any(rng) })
        .collect();
    let cells = rng.random_range(14..34);
    let share = rng.random_range(0.5..0.9);
    let wobble = Cloud::new([60, 60], seed ^ 1, 1);
    let sand = Cloud::new([90, 90], seed ^ 2, 2);
    let chip_at = Cells::new(cells, seed);
    paint(size, |x, y| {
        let wander = 0.012 * (wobble.at(x, y) - 0.5);
        let chip = chip_at.at(x + wander, y + wander);
        let among = (chip.id / share * chips.len() as f32) as usize;
        // A chip is its cell, shrunk; the rest is cement.
        let shrunk = 0.15 + 0.5 * fraction(chip.id * 7.31);
        let color = match chips.get(among) {
            Some(&color) => mix(cement, color, ramp(shrunk, shrunk + 0.06, chip.gap)),
            None => cement,
        };
        scale(color, 0.95 + 0.1 * sand.at(x, y))
    })
}
