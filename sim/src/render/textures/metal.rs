//! Sheet metal.

use image::RgbImage;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::colors::{near, scale};
use super::noise::{Cells, Cloud, paint, ramp};

/// Steel, aluminium, dark steel (twice each, as they are the usual ones), brass, copper: reflectance at normal incidence,
/// sRGB.
const METALS: [[f32; 3]; 8] = [
    [0.72, 0.72, 0.71],
    [0.80, 0.81, 0.82],
    [0.48, 0.49, 0.50],
    [0.72, 0.72, 0.71],
    [0.80, 0.81, 0.82],
    [0.48, 0.49, 0.50],
    [0.83, 0.72, 0.46],
    [0.84, 0.58, 0.46],
];

pub(super) fn draw(size: u32, rng: &mut ChaCha8Rng) -> RgbImage {
    let seed: u32 = rng.random();
    let kind = rng.random_range(0..3);
    // Zinc crystals grow on steel.
    let color = near(if kind == 1 { &METALS[..6] } else { &METALS }, rng);
    let strength = rng.random_range(0.08..0.3);
    let brush = Cloud::new([4, 256], seed, 1);
    let wide_brush = Cloud::new([2, 64], seed ^ 1, 2);
    let dull = Cloud::new([90, 90], seed ^ 1, 1);
    let scratches = Cloud::new([5, 40], seed ^ 1, 2);
    let rolled = Cloud::new([6, 6], seed, 3);
    let crystals = Cells::new(18, seed);
    paint(size, |x, y| {
        let pattern = match kind {
            // Brushed along the width.
            0 => brush.at(x, y) * 0.6 + wide_brush.at(x, y) * 0.4,
            // Zinc crystals.
            1 => {
                let crystal = crystals.at(x, y);
                crystal.id * 0.8 + 0.2 * dull.at(x, y)
            }
            // Rolled and scratched.
            _ => {
                let scratch = 1.0 - ramp(0.0, 0.03, (scratches.at(x, y) - 0.5).abs());
                0.4 * rolled.at(x, y) + 0.3 + 0.4 * scratch
            }
        };
        scale(color, 1.0 + strength * (pattern - 0.5))
    })
}
