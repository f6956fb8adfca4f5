//! Handa et al. 2014 (ICL-NUIM, simkinect): shifted pixels, rounded disparity, dots that must agree, noise in disparity.

use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::each_pixel;
use crate::images::{DepthImage, Image};
use crate::sensor::normal::normal;

/// Focal length in pixels times baseline in metres.
const FOCAL_BASELINE: f32 = 480.0 * 0.075;
/// Half of the window in which dots must agree.
const WINDOW: usize = 4;
/// Share of a window's dots that must agree with its mean disparity.
const QUORUM: f32 = 1.0 / 1.2;
/// How far, pixels of disparity, a dot may be from the window's mean at a distance of one pixel from the centre.
const AGREEMENT: f32 = 0.1;
/// One pixel in this many carries a dot of the projected pattern (ours; the original reads a picture of the pattern).
const PIXELS_PER_DOT: u32 = 6;

pub(super) fn handa(depth: &DepthImage, rng: &mut ChaCha8Rng) -> DepthImage {
    let (width, height) = (depth.width(), depth.height());
    // (1) and (2): what the matcher sees, as disparity in eighths of a pixel; 0 for nothing.
    let disparity = each_pixel(width, height, rng, |u, v, rng| {
        let z = bilinear(depth, u as f32 + 0.5 * normal(rng), v as f32 + 0.5 * normal(rng));
        if z > 0.0 { (FOCAL_BASELINE / z * 8.0).round() / 8.0 } else { 0.0 }
    });
    // (3)
    let mut matched = Image::filled(width, height, false);
    matched.data_mut().par_chunks_mut(width).enumerate().for_each(|(v, row)| {
        for (u, ok) in row.iter_mut().enumerate() {
            *ok = dots_agree(&disparity, u, v);
        }
    });
    // (4): depth in centimetres, then disparity with noise, then back.
    each_pixel(width, height, rng, |u, v, rng| {
        let noise = normal(rng) / 6.0;
        if !*matched.at(u, v) {
            return 0.0;
        }
        let z = FOCAL_BASELINE / disparity.at(u, v);
        quantise(z, noise)
    })
}

/// Depth as read, with `noise` in units of the sensor's disparity.
fn quantise(z: f32, noise: f32) -> f32 {
    35130.0 / (35130.0 / (100.0 * z).round() + noise + 0.5).round() / 100.0
}

/// Depth between pixels; the nearest pixel's where one of the four reads nothing.
fn bilinear(image: &DepthImage, u: f32, v: f32) -> f32 {
    let u = u.clamp(0.0, (image.width() - 1) as f32);
    let v = v.clamp(0.0, (image.height() - 1) as f32);
    let (u0, v0) = (u as usize, v as usize);
    let (u1, v1) = ((u0 + 1).min(image.width() - 1), (v0 + 1).min(image.height() - 1));
    let (fu, fv) = (u.fract(), v.fract());
    let [a, b, c, d] = [(u0, v0), (u1, v0), (u0, v1), (u1, v1)].map(|(u, v)| *image.at(u, v));
    if a > 0.0 && b > 0.0 && c > 0.0 && d > 0.0 {
        (a * (1.0 - fu) + b * fu) * (1.0 - fv) + (c * (1.0 - fu) + d * fu) * fv
    } else {
        *image.at(u.round() as usize, v.round() as usize)
    }
}

/// Whether the projector puts a dot on this pixel: a fixed pattern.
fn is_dot(u: usize, v: usize) -> bool {
    let mut h = (u as u32).wrapping_mul(0x9e37_79b9).wrapping_add((v as u32).wrapping_mul(0x85eb_ca6b));
    for multiplier in [0x7feb_352d_u32, 0x846c_a68b] {
        h = (h ^ (h >> 16)).wrapping_mul(multiplier);
    }
    (h ^ (h >> 16)).is_multiple_of(PIXELS_PER_DOT)
}

/// Whether enough dots about (u, v) have a disparity near the window's mean, the nearer to the centre the closer.
fn dots_agree(disparity: &DepthImage, u: usize, v: usize) -> bool {
    if *disparity.at(u, v) <= 0.0 {
        return false;
    }
    let columns = u.saturating_sub(WINDOW)..(u + WINDOW + 1).min(disparity.width());
    let rows = v.saturating_sub(WINDOW)..(v + WINDOW + 1).min(disparity.height());
    let (mut sum, mut valid) = (0.0, 0.0_f32);
    for y in rows.clone() {
        for x in columns.clone() {
            let d = *disparity.at(x, y);
            if d > 0.0 {
                sum += d;
                valid += 1.0;
            }
        }
    }
    let mean = sum / valid.max(1.0);
    let (mut dots, mut agreeing) = (0.0_f32, 0.0_f32);
    for y in rows {
        for x in columns.clone().filter(|&x| is_dot(x, y)) {
            dots += 1.0;
            let d = *disparity.at(x, y);
            let squared = (x.abs_diff(u).pow(2) + y.abs_diff(v).pow(2)).max(1) as f32;
            let weight = 1.0 / (1.44 * squared);
            if d > 0.0 && (d - mean).abs() * weight < AGREEMENT {
                agreeing += 1.0;
            }
        }
    }
    agreeing >= QUORUM * dots
}

#[cfg(test)]
mod tests {
    use super::super::tests::{CAMERA, flat, statistics};
    use crate::rng;
    use crate::sensor::depth::DepthNoise;

    #[test]
    fn has_its_published_step_and_sigma() {
        // z' takes the values 351.3 / n, and before rounding its noise is a sixth of a step.
        for z in [0.6_f32, 1.0, 1.5] {
            let read = DepthNoise::Handa.apply(&flat(z, 0.0), &CAMERA, &mut rng::stream(1, "t"));
            for &d in read.data().iter().filter(|&&d| d > 0.0) {
                let n = 351.30 / f64::from(d);
                assert!((n - n.round()).abs() < 2e-3, "{d}");
            }
            let step = f64::from(z * z) / 351.3;
            let (bias, sigma, valid) = statistics(&read, z);
            assert!(valid > 0.99, "{valid}");
            // Half a step of bias (the formula's 0.5), half a centimetre of rounding, half a step of quantised disparity.
            assert!(bias.abs() < step + 0.005 + 0.004 * f64::from(z * z), "{z}: {bias}");
            assert!(sigma < step, "{z}: {sigma}");
        }
        assert!((1.0 / 351.3 - 0.00285_f64).abs() < 1e-5);
        // Over many depths in whole centimetres the error before rounding is N(0.5, 1/6) steps; rounding adds 1/12.
        let mut rng = rng::stream(2, "t");
        for z in [0.6_f32, 1.0, 1.5] {
            let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0_f64);
            for centimetre in -10..=10 {
                let z = z + 0.01 * centimetre as f32;
                for _ in 0..2000 {
                    let read = super::quantise(z, super::normal(&mut rng) / 6.0);
                    let steps = 351.3 / f64::from(read) - 351.3 / f64::from(z);
                    sum += steps;
                    squares += steps * steps;
                    count += 1.0;
                }
            }
            let mean = sum / count;
            let sigma = (squares / count - mean * mean).sqrt();
            assert!((mean - 0.5).abs() < 0.12, "{z}: {mean}");
            assert!((sigma - (1.0_f64 / 36.0 + 1.0 / 12.0).sqrt()).abs() < 0.06, "{z}: {sigma}");
        }
    }

    #[test]
    fn depth_edges_lose_their_readings() {
        let mut rendering = flat(1.5, 0.0);
        for v in 0..240 {
            for u in 0..160 {
                *rendering.depth.at_mut(u, v) = 0.8;
            }
        }
        let read = DepthNoise::Handa.apply(&rendering, &CAMERA, &mut rng::stream(3, "t"));
        let lost = |columns: std::ops::Range<usize>| {
            let count = columns.len() * 240;
            let missing = columns
                .flat_map(|u| (0..240).map(move |v| (u, v)))
                .filter(|&(u, v)| *read.at(u, v) == 0.0)
                .count();
            missing as f64 / count as f64
        };
        assert!(lost(158..162) > 0.8, "{}", lost(158..162));
        assert!(lost(20..140) < 0.01);
    }
}
