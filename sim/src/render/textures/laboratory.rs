//! The looks of the laboratory: one beech table, one cardboard bin, grey linoleum and a plastered wall.

use image::RgbImage;

use super::SIZE;
use super::noise::{fractal, paint, random, smooth, wrap_distance};

/// Oiled planks of beech, grain along the picture's width; meant for one repeat per 0.8 m.
pub fn wood(seed: u32) -> RgbImage {
    const PLANKS: u32 = 8;
    paint(SIZE, |x, y| {
        let row = (y * PLANKS as f32) as u32 % PLANKS;
        let across = (y * PLANKS as f32).fract();
        let tone = random(seed, row, 1);
        // Each plank is a cut through its own tree: rings bent by slow noise, and fine pores along the grain.
        let shift = row * 17;
        let bend = fractal(x * 2.0, y * 6.0, [2, 6], seed.wrapping_add(shift), 3);
        let rings = across * 2.2 + 1.6 * bend + random(seed, row, 2);
        let late_wood = smooth((rings * 3.0).fract());
        let pores = fractal(x * 10.0, y * 320.0, [10, 320], seed ^ 0x9e37, 2);
        let streak = fractal(x * 3.0, y * 90.0, [3, 90], seed ^ 0x51ed, 2);
        let mut light = 0.92 + 0.10 * (tone - 0.5) - 0.09 * late_wood;
        light += 0.10 * (streak - 0.5) - 0.12 * (pores - 0.55).max(0.0);
        // A thin dark joint between planks, and one butt joint a plank.
        let seam = across.min(1.0 - across) * 0.8 / PLANKS as f32;
        let butt = wrap_distance(x, random(seed, row, 3)) * 0.8;
        let joint = 1.0 - smooth((seam.min(butt) / 0.0012).min(1.0));
        light *= 1.0 - 0.45 * joint;
        let warm = 0.03 * (bend - 0.5);
        [(0.74 + warm) * light, 0.565 * light, (0.385 - warm) * light]
    })
}

/// Brown corrugated cardboard with faint flutes; meant for one repeat per 0.4 m.
pub fn cardboard() -> RgbImage {
    paint(SIZE, |x, y| {
        let flute = (x * 64.0 * std::f32::consts::TAU).sin();
        let fibre = fractal(x * 40.0, y * 160.0, [40, 160], 11, 3);
        let cloud = fractal(x * 5.0, y * 5.0, [5, 5], 12, 3);
        let speck = if random(13, (x * SIZE as f32) as u32 / 2, (y * SIZE as f32) as u32 / 2) > 0.996 {
            0.86
        } else {
            1.0
        };
        let light = speck * (0.93 + 0.015 * flute + 0.08 * (fibre - 0.5) + 0.08 * (cloud - 0.5));
        [0.69 * light, 0.545 * light, 0.40 * light]
    })
}

/// Painted plaster, off-white; meant for one repeat per 2 m.
pub fn wall() -> RgbImage {
    paint(SIZE, |x, y| {
        let roller = fractal(x * 160.0, y * 160.0, [160, 160], 21, 2);
        let cloud = fractal(x * 3.0, y * 3.0, [3, 3], 22, 3);
        let light = 0.96 + 0.035 * (roller - 0.5) + 0.05 * (cloud - 0.5);
        [0.82 * light, 0.81 * light, 0.78 * light]
    })
}

/// Speckled grey linoleum, as laboratories have; meant for one repeat per 1 m.
pub fn floor(seed: u32) -> RgbImage {
    paint(SIZE, |x, y| {
        let cloud = fractal(x * 4.0, y * 4.0, [4, 4], seed, 4);
        let fleck = fractal(x * 90.0, y * 90.0, [90, 90], seed ^ 0x77, 2);
        let light = 0.92 + 0.10 * (cloud - 0.5) + 0.30 * (fleck - 0.5).abs() - 0.04;
        [0.50 * light, 0.505 * light, 0.495 * light]
    })
}

/// Woven cotton, undyed; meant for one repeat per 0.25 m.
pub fn cloth(seed: u32) -> RgbImage {
    const THREADS: f32 = 128.0;
    paint(SIZE, |x, y| {
        let (u, v) = (x * THREADS, y * THREADS);
        let over = (u as u32 + v as u32).is_multiple_of(2);
        let round = |t: f32| 1.0 - (2.0 * t.fract() - 1.0).powi(2);
        let thread = if over { round(v) } else { round(u) };
        let slub = fractal(x * 24.0, y * 24.0, [24, 24], seed, 3);
        let light = 0.80 + 0.14 * thread + 0.12 * (slub - 0.5);
        [0.80 * light, 0.78 * light, 0.72 * light]
    })
}
