//! Woven cloth and carpet.

use image::RgbImage;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::colors::{any, apart, mix, muted, scale, strong};
use super::noise::{Cells, Cloud, fraction, length, paint, ramp, random};

/// Threads a repeat each way: a multiple of 4, so that twill closes.
const THREADS: usize = 128;

/// Colours of threads, one each.
type Sett = Vec<[f32; 3]>;

/// One colour, two, striped, gingham, tartan or printed with dots.
pub(super) fn cloth(size: u32, rng: &mut ChaCha8Rng) -> RgbImage {
    let seed: u32 = rng.random();
    let ground = any(rng);
    let other = apart(ground, rng);
    let even = |color| vec![color; THREADS];
    let kind = rng.random_range(0..6);
    let (warp, weft) = match kind {
        0 => (even(ground), even(ground)),
        1 => (even(ground), even(mix(ground, other, rng.random_range(0.2..0.8)))),
        2 => (sett(&[ground, other], rng), even(ground)),
        3 => {
            let check = bands(&[ground, other], &[1, 1], [4, 8, 16][rng.random_range(0..3)]);
            (check.clone(), check)
        }
        4 => {
            let third = if rng.random_bool(0.5) { strong(rng) } else { apart(other, rng) };
            let tartan = sett(&[ground, other, third], rng);
            (tartan.clone(), tartan)
        }
        _ => (even(ground), even(ground)),
    };
    let twill = rng.random_bool(0.3);
    let relief = rng.random_range(0.06..0.22);
    let slubs = rng.random_range(0.05..0.2);
    let dots = 2 * rng.random_range(2..7_u32);
    let dot_radius = rng.random_range(0.15..0.38);
    let slub_at = Cloud::new([24, 24], seed, 2);
    paint(size, |x, y| {
        let (u, v) = (x * THREADS as f32, y * THREADS as f32);
        let (column, row) = (u as usize % THREADS, v as usize % THREADS);
        let over = if twill { (column + row) % 4 < 2 } else { (column + row) % 2 == 0 };
        let round = |t: f32| 1.0 - (2.0 * fraction(t) - 1.0).powi(2);
        let (mut color, thread) = if over { (weft[row], round(v)) } else { (warp[column], round(u)) };
        if kind == 5 {
            // Each second column of dots stands half a step lower; an even number of columns closes the repeat.
            let a = x * dots as f32;
            let b = y * dots as f32 + 0.5 * (a as u32 % 2) as f32;
            let from_dot = length(fraction(a) - 0.5, fraction(b) - 0.5);
            color = mix(other, color, ramp(dot_radius - 0.02, dot_radius + 0.02, from_dot));
        }
        let slub = slub_at.at(x, y);
        scale(color, 1.0 + relief * (thread - 0.67) + slubs * (slub - 0.5))
    })
}

/// Bands of random widths, mirrored as a tartan's are, one or two of them a repeat.
fn sett(colors: &[[f32; 3]], rng: &mut ChaCha8Rng) -> Sett {
    let count = rng.random_range(3..7);
    let half = if rng.random_bool(0.5) { THREADS / 2 } else { THREADS / 4 };
    let widths: Vec<usize> = (0..count).map(|_| rng.random_range(1..=8_usize).pow(2)).collect();
    let total: usize = widths.iter().sum();
    let mut threads = Vec::with_capacity(half);
    let mut reached = 0;
    for (i, width) in widths.iter().enumerate() {
        reached += width;
        threads.resize(half * reached / total, colors[i % colors.len()]);
    }
    let back: Vec<_> = threads.iter().rev().copied().collect();
    threads.extend(back);
    threads.iter().copied().cycle().take(THREADS).collect()
}

/// Bands of `unit` threads times their weight, over and over.
fn bands(colors: &[[f32; 3]], weights: &[usize], unit: usize) -> Sett {
    let once: Vec<_> =
        colors.iter().zip(weights).flat_map(|(&color, weight)| vec![color; unit * weight]).collect();
    once.iter().copied().cycle().take(THREADS).collect()
}

/// Loops, plain, flecked or with a pattern of blots.
pub(super) fn carpet(size: u32, rng: &mut ChaCha8Rng) -> RgbImage {
    let seed: u32 = rng.random();
    let ground = if rng.random_bool(0.7) { muted(rng) } else { any(rng) };
    let second = apart(ground, rng);
    let flecks = if rng.random_bool(0.5) { rng.random_range(0.1..0.5) } else { 0.0 };
    let blots = if rng.random_bool(0.35) { rng.random_range(0.3..0.9) } else { 0.0 };
    let blot_cells = rng.random_range(3..9);
    let pile = rng.random_range(0.4..0.8);
    let loops = [48, 64, 80][rng.random_range(0..3)];
    let blot = Cloud::new([blot_cells; 2], seed ^ 1, 2);
    let trodden = Cloud::new([5, 5], seed ^ 3, 2);
    let tufts = Cells::new(loops, seed);
    paint(size, |x, y| {
        let tuft = tufts.at(x, y);
        let mut color = mix(ground, second, if tuft.id < 0.3 { flecks } else { 0.0 });
        color = mix(color, second, blots * ramp(0.48, 0.54, blot.at(x, y)));
        let fibre = random(seed ^ 2, (x * 512.0) as u32, (y * 512.0) as u32) - 0.5;
        let light = 1.12 - pile * tuft.distance * 0.7 + 0.2 * fibre + 0.25 * (trodden.at(x, y) - 0.5);
        scale(color, light)
    })
}
