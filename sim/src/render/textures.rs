//! Procedural pictures for table, floor, walls and bin: made in code, the same on every machine, tiling in both directions.
//!
//! All are sRGB and [`SIZE`] pixels square; each says how many metres one repeat is meant to cover.

use image::RgbImage;
use rayon::prelude::*;

/// Width and height of every picture here, pixels.
pub const SIZE: u32 = 1024;

/// Oiled planks of beech, grain along the picture's width; meant for one repeat per 0.8 m.
pub fn wood(seed: u32) -> RgbImage {
    const PLANKS: u32 = 8;
    paint(|x, y| {
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
    paint(|x, y| {
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
    paint(|x, y| {
        let roller = fractal(x * 160.0, y * 160.0, [160, 160], 21, 2);
        let cloud = fractal(x * 3.0, y * 3.0, [3, 3], 22, 3);
        let light = 0.96 + 0.035 * (roller - 0.5) + 0.05 * (cloud - 0.5);
        [0.82 * light, 0.81 * light, 0.78 * light]
    })
}

/// Speckled grey linoleum, as laboratories have; meant for one repeat per 1 m.
pub fn floor(seed: u32) -> RgbImage {
    paint(|x, y| {
        let cloud = fractal(x * 4.0, y * 4.0, [4, 4], seed, 4);
        let fleck = fractal(x * 90.0, y * 90.0, [90, 90], seed ^ 0x77, 2);
        let light = 0.92 + 0.10 * (cloud - 0.5) + 0.30 * (fleck - 0.5).abs() - 0.04;
        [0.50 * light, 0.505 * light, 0.495 * light]
    })
}

/// Woven cotton, undyed; meant for one repeat per 0.25 m.
pub fn cloth(seed: u32) -> RgbImage {
    const THREADS: f32 = 128.0;
    paint(|x, y| {
        let (u, v) = (x * THREADS, y * THREADS);
        let over = (u as u32 + v as u32).is_multiple_of(2);
        let round = |t: f32| 1.0 - (2.0 * t.fract() - 1.0).powi(2);
        let thread = if over { round(v) } else { round(u) };
        let slub = fractal(x * 24.0, y * 24.0, [24, 24], seed, 3);
        let light = 0.80 + 0.14 * thread + 0.12 * (slub - 0.5);
        [0.80 * light, 0.78 * light, 0.72 * light]
    })
}

/// Fills a picture from a function of position, 0 to 1 along each side, to sRGB, 0 to 1.
fn paint(color: impl Fn(f32, f32) -> [f32; 3] + Sync) -> RgbImage {
    let at = |i: usize| (i as f32 + 0.5) / SIZE as f32;
    let mut pixels = vec![0_u8; 3 * (SIZE * SIZE) as usize];
    pixels.par_chunks_mut(3 * SIZE as usize).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            *pixel = color(at(x), at(y)).map(|c| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8);
        }
    });
    RgbImage::from_raw(SIZE, SIZE, pixels).unwrap_or_default()
}

/// A fixed random number, 0 to 1, for each cell (a 32-bit integer hash, after Wellons' lowbias32).
fn random(seed: u32, x: u32, y: u32) -> f32 {
    let mut h = seed.wrapping_mul(0x9e37_79b9).wrapping_add(x).wrapping_mul(0x85eb_ca6b).wrapping_add(y);
    for multiplier in [0x7feb_352d_u32, 0x846c_a68b] {
        h = (h ^ (h >> 16)).wrapping_mul(multiplier);
    }
    ((h ^ (h >> 16)) >> 8) as f32 / (1 << 24) as f32
}

/// Value noise, 0 to 1, that repeats after `period` cells; for positions that are not negative.
fn noise(x: f32, y: f32, period: [u32; 2], seed: u32) -> f32 {
    let (x0, y0) = (x as u32, y as u32);
    let (fx, fy) = (smooth(x - x0 as f32), smooth(y - y0 as f32));
    let (x0, y0) = (x0 % period[0], y0 % period[1]);
    let next = |i: u32, period: u32| if i + 1 < period { i + 1 } else { 0 };
    let (x1, y1) = (next(x0, period[0]), next(y0, period[1]));
    let top = random(seed, x0, y0) * (1.0 - fx) + random(seed, x1, y0) * fx;
    let bottom = random(seed, x0, y1) * (1.0 - fx) + random(seed, x1, y1) * fx;
    top * (1.0 - fy) + bottom * fy
}

/// Octaves of [`noise`], 0 to 1.
fn fractal(x: f32, y: f32, period: [u32; 2], seed: u32, octaves: u32) -> f32 {
    let (mut sum, mut weight) = (0.0, 0.0);
    for octave in 0..octaves {
        let scale = (1 << octave) as f32;
        let period = period.map(|p| p << octave);
        sum += noise(x * scale, y * scale, period, seed.wrapping_add(octave * 101)) / scale;
        weight += 1.0 / scale;
    }
    sum / weight
}

fn smooth(t: f32) -> f32 {
    t * t * (3.0 - 2.0 * t)
}

/// Distance on a circle of length 1.
fn wrap_distance(a: f32, b: f32) -> f32 {
    let d = (a - b).abs();
    d.min(1.0 - d)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_repeatable_and_neither_flat_nor_clipped() {
        assert_eq!(wood(3), wood(3));
        assert_ne!(wood(3), wood(4));
        for picture in [wood(1), cardboard(), wall(), floor(1), cloth(1)] {
            let greens = || picture.pixels().map(|p| f64::from(p.0[1]));
            let count = f64::from(SIZE * SIZE);
            let mean = greens().sum::<f64>() / count;
            let deviation = (greens().map(|g| (g - mean).powi(2)).sum::<f64>() / count).sqrt();
            assert!((60.0..220.0).contains(&mean), "{mean}");
            assert!((1.0..40.0).contains(&deviation), "{deviation}");
        }
    }

    #[test]
    fn noise_repeats_after_its_period() {
        for i in 0..50 {
            let t = i as f32 * 0.137;
            let a = noise(t, 2.3, [7, 5], 1);
            assert!((a - noise(t + 7.0, 2.3 + 5.0, [7, 5], 1)).abs() < 1e-4);
        }
    }
}
