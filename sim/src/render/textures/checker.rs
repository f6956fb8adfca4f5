//! Squares of two colours.

use image::RgbImage;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::colors::{any, apart, mix, scale};
use super::noise::{Cloud, fraction, paint, ramp};

pub(super) fn draw(size: u32, rng: &mut ChaCha8Rng) -> RgbImage {
    let seed: u32 = rng.random();
    let first = any(rng);
    let second = apart(first, rng);
    let squares = [2.0, 4.0, 6.0, 8.0, 12.0][rng.random_range(0..5)];
    let diagonal = rng.random_bool(0.25);
    let line = if rng.random_bool(0.3) { apart(first, rng) } else { first };
    let line_width = if line == first { 0.0 } else { rng.random_range(0.02..0.08) };
    let wear = rng.random_range(0.0..0.2);
    // Edges are as wide as half a pixel, in squares.
    let edge = 0.5 * squares / size as f32;
    let worn = Cloud::new([6, 6], seed, 3);
    paint(size, |x, y| {
        let (u, v) = if diagonal {
            ((x + y) * squares * 0.5, (x - y + 1.0) * squares * 0.5)
        } else {
            (x * squares, y * squares)
        };
        let side = |t: f32| fraction(t).min(1.0 - fraction(t));
        let even = (u as u32 + v as u32).is_multiple_of(2);
        let near_edge = side(u).min(side(v));
        let (here, there) = if even { (first, second) } else { (second, first) };
        let mut color = mix(here, there, 0.5 * (1.0 - ramp(0.0, edge, near_edge)));
        if line_width > 0.0 {
            color = mix(line, color, ramp(line_width - edge, line_width + edge, near_edge));
        }
        scale(color, 1.0 + wear * (worn.at(x, y) - 0.5))
    })
}
