//! Rows of blocks with joints between them: glazed tiles and bricks.

use image::RgbImage;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::colors::{any, apart, grey, mix, muted, near, scale};
use super::noise::{Cloud, fraction, paint, ramp, random};

/// A grid of blocks.
struct Bond {
    columns: u32,
    rows: u32,
    /// Each second row is moved by this share of a block; `rows` is even where it is not 0.
    shift: f32,
    /// Half the joint's width as a share of the picture.
    joint: f32,
    /// Half the width of the joint's edge.
    edge: f32,
}

impl Bond {
    /// Column and row of the block at (x, y), and how much of the block's face is there (0 is joint).
    fn at(&self, x: f32, y: f32) -> (u32, u32, f32) {
        let v = y * self.rows as f32;
        let row = v as u32;
        let u = x * self.columns as f32 + if row % 2 == 1 { self.shift } else { 0.0 };
        let inside = |t: f32, count: u32| fraction(t).min(1.0 - fraction(t)) / count as f32;
        let to_edge = inside(u, self.columns).min(inside(v, self.rows));
        let face = ramp(self.joint - self.edge, self.joint + self.edge, to_edge);
        (u as u32 % self.columns, row % self.rows, face)
    }
}

/// Square or long tiles, glazed or stone-like, in one colour or two.
pub(super) fn tiles(size: u32, rng: &mut ChaCha8Rng) -> RgbImage {
    let seed: u32 = rng.random();
    let long = rng.random_bool(0.35);
    let columns = rng.random_range(2..=6_u32);
    let joint = rng.random_range(0.002..0.006);
    let bond = Bond {
        columns,
        rows: if long { 2 * columns } else { columns },
        shift: if long && rng.random_bool(0.7) { 0.5 } else { 0.0 },
        joint,
        edge: 0.7 / size as f32,
    };
    let first = if rng.random_bool(0.6) { muted(rng) } else { any(rng) };
    let second = if rng.random_bool(0.2) { apart(first, rng) } else { first };
    let grout = scale(grey(rng), 0.9);
    let variety = rng.random_range(0.02..0.25);
    let mottled = rng.random_range(0.0..0.35);
    let mottle = Cloud::new([9, 9], seed ^ 2, 3);
    let sand = Cloud::new([128, 128], seed ^ 3, 1);
    paint(size, |x, y| {
        let (column, row, face) = bond.at(x, y);
        let color = if random(seed, column, row) < 0.7 { first } else { second };
        // Each tile shows another part of the cloud.
        let other = random(seed ^ 1, column, row);
        let light = 1.0 + variety * (other - 0.5) + mottled * (mottle.at(x + other, y + 7.0 * other) - 0.5);
        let rough = 0.9 + 0.2 * sand.at(x, y);
        mix(scale(grout, rough), scale(color, light), face)
    })
}

const CLAY: [[f32; 3]; 6] = [
    [0.58, 0.27, 0.20],
    [0.66, 0.36, 0.26],
    [0.46, 0.25, 0.20],
    [0.72, 0.60, 0.45],
    [0.80, 0.78, 0.74],
    [0.35, 0.33, 0.32],
];

/// Bricks, bare or painted over.
pub(super) fn brick(size: u32, rng: &mut ChaCha8Rng) -> RgbImage {
    let seed: u32 = rng.random();
    let columns = rng.random_range(2..=4_u32);
    let bond = Bond {
        columns,
        rows: columns * 3 + columns % 2,
        shift: 0.5,
        joint: rng.random_range(0.004..0.009),
        edge: 0.003,
    };
    let clay = near(&CLAY, rng);
    let burnt = near(&CLAY, rng);
    let mortar = if rng.random_bool(0.25) { scale(clay, 0.85) } else { near(&[[0.66, 0.63, 0.58]], rng) };
    let variety = rng.random_range(0.1..0.45);
    let wander = [5, 6].map(|salt| Cloud::new([40, 40], seed ^ salt, 1));
    let grain_at = Cloud::new([70, 70], seed ^ 1, 3);
    paint(size, |x, y| {
        // Edges are not straight.
        let [dx, dy] = [0, 1].map(|axis: usize| 0.006 * (wander[axis].at(x, y) - 0.5));
        let (column, row, face) = bond.at(fraction(x + dx + 1.0), fraction(y + dy + 1.0));
        let own = random(seed, column, row);
        let grain = grain_at.at(x, y);
        let color = mix(clay, burnt, if own > 0.8 { 0.7 } else { 0.0 });
        let light = 1.0 + variety * (random(seed ^ 2, column, row) - 0.5) + 0.5 * (grain - 0.5);
        mix(scale(mortar, 0.85 + 0.3 * grain), scale(color, light), face)
    })
}
