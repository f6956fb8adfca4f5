//! Planks, oiled or painted.

use image::RgbImage;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::colors::{any, mix, scale};
use super::noise::{Cloud, fraction, length, paint, ramp, random, smooth, wrap_distance};

/// Early wood, late wood, strength of the pores, share of planks with a knot.
type Species = ([f32; 3], [f32; 3], f32, f32);

const SPECIES: [Species; 9] = [
    // Beech, birch, oak, pine, cherry, walnut, mahogany, wenge, weathered grey.
    ([0.80, 0.63, 0.45], [0.70, 0.52, 0.35], 0.10, 0.0),
    ([0.90, 0.79, 0.62], [0.82, 0.68, 0.49], 0.05, 0.1),
    ([0.74, 0.58, 0.40], [0.55, 0.40, 0.25], 0.30, 0.1),
    ([0.88, 0.72, 0.50], [0.72, 0.50, 0.28], 0.03, 0.6),
    ([0.66, 0.40, 0.25], [0.50, 0.27, 0.16], 0.10, 0.1),
    ([0.45, 0.31, 0.21], [0.27, 0.17, 0.11], 0.20, 0.1),
    ([0.48, 0.23, 0.15], [0.33, 0.14, 0.10], 0.15, 0.0),
    ([0.29, 0.22, 0.18], [0.15, 0.11, 0.09], 0.25, 0.0),
    ([0.62, 0.59, 0.55], [0.43, 0.40, 0.37], 0.30, 0.3),
];

pub(super) fn draw(size: u32, rng: &mut ChaCha8Rng) -> RgbImage {
    let seed: u32 = rng.random();
    let (mut early, mut late, pore, knots) = SPECIES[rng.random_range(0..SPECIES.len())];
    let stain = rng.random_range(0.8..1.1);
    if rng.random_bool(0.2) {
        // Paint lets the grain through faintly.
        let paint = any(rng);
        (early, late) = (paint, mix(paint, scale(late, 0.5), rng.random_range(0.04..0.15)));
    } else {
        (early, late) = (scale(early, stain), scale(late, stain));
    }
    let planks: u32 = rng.random_range(2..=12);
    let variety = rng.random_range(0.04..0.22);
    let ring_count = rng.random_range(2.0..9.0_f32) * 4.0 / planks as f32;
    let bend_by = rng.random_range(0.5..2.5_f32);
    let joint_depth = if rng.random_bool(0.3) { 0.0 } else { rng.random_range(0.2..0.7) };
    let butt_joints = rng.random_bool(0.6);
    // Each plank is a cut through its own tree.
    let trees: Vec<_> = (0..planks).map(|row| Cloud::new([2, 6], seed.wrapping_add(row * 17), 2)).collect();
    let streaks = Cloud::new([4, 120], seed ^ 0x51ed, 1);
    let pore_at = Cloud::new([12, 256], seed ^ 0x9e37, 1);
    paint(size, |x, y| {
        let row = (y * planks as f32) as u32 % planks;
        let across = fraction(y * planks as f32);
        // Rings bent by slow noise, and fine pores along the grain.
        let bend = trees[row as usize].at(x, y);
        let mut rings = across * ring_count + bend_by * bend + random(seed, row, 2);
        let mut dark = 0.0;
        if random(seed, row, 5) < knots {
            let dx = wrap_distance(x, random(seed, row, 6)) * 0.5;
            let dy = (across - 0.25 - 0.5 * random(seed, row, 7)) / planks as f32;
            let d = length(dx, dy) / (0.008 + 0.010 * random(seed, row, 8));
            rings += 1.5 * (-0.3 * d * d).exp();
            dark = 0.8 * (1.0 - ramp(0.4, 1.3, d));
        }
        // Late wood grows dark slowly and ends at once, as the year does.
        let year = fraction(rings * 2.0);
        let late_wood = if year < 0.85 { smooth(year / 0.85) } else { smooth((1.0 - year) / 0.15) };
        let streak = streaks.at(x, y);
        let pores = pore_at.at(x, y);
        let mut color = mix(early, late, (0.75 * late_wood + 0.9 * (streak - 0.4)).clamp(0.0, 1.3));
        color = mix(color, scale(late, 0.45), dark);
        let mut light = 1.0 + variety * (random(seed, row, 1) - 0.5) * 2.0;
        light -= pore * ramp(0.65, 0.9, pores);
        // A thin dark joint between planks, and one butt joint a plank.
        let mut joint = across.min(1.0 - across) / planks as f32;
        if butt_joints {
            joint = joint.min(wrap_distance(x, random(seed, row, 3)));
        }
        light *= 1.0 - joint_depth * (1.0 - ramp(0.0008, 0.0030, joint));
        scale(color, light)
    })
}
