//! Plaster, concrete and wall paint.

use image::RgbImage;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::colors::{grey, mix, muted, near, scale, strong};
use super::noise::{Cells, Cloud, paint, ramp};

const CONCRETE: [[f32; 3]; 4] =
    [[0.62, 0.61, 0.58], [0.50, 0.49, 0.47], [0.70, 0.67, 0.61], [0.40, 0.40, 0.40]];

pub(super) fn draw(size: u32, rng: &mut ChaCha8Rng) -> RgbImage {
    let seed: u32 = rng.random();
    let (color, clouds, grain, holes) = match rng.random_range(0..5) {
        0 | 1 => (near(&CONCRETE, rng), rng.random_range(0.2..0.5), 0.10, rng.random_range(0.0..0.45)),
        2 => (grey(rng), 0.12, 0.08, 0.0),
        3 => (muted(rng), rng.random_range(0.05..0.3), 0.08, 0.0),
        _ => (mix(strong(rng), [0.9; 3], rng.random_range(0.0..0.6)), 0.08, 0.06, 0.0),
    };
    let stain = scale(color, 0.7);
    let stains = rng.random_range(0.0..0.5);
    let blotches = Cloud::new([5, 5], seed, 3);
    let nap = Cloud::new([140, 140], seed ^ 1, 1);
    let damp = Cloud::new([3, 4], seed ^ 3, 3);
    let bubbles = Cells::new(40, seed ^ 2);
    paint(size, |x, y| {
        let blotch = blotches.at(x, y);
        let roller = nap.at(x, y);
        let mut light = 1.0 + clouds * (blotch - 0.5) + 2.0 * grain * (roller - 0.5);
        if holes > 0.0 {
            // Air bubbles: few, round and of many sizes.
            let bubble = bubbles.at(x, y);
            let radius = (bubble.id - 0.75).max(0.0);
            light *= 1.0 - holes * (1.0 - ramp(0.6 * radius, radius + 1e-3, bubble.distance));
        }
        let stained = stains * ramp(0.55, 0.75, damp.at(x, y));
        scale(mix(color, stain, stained), light)
    })
}
