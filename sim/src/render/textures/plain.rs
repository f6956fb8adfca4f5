//! Even surfaces: laminate and plastic.

use image::RgbImage;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::colors::{any, apart, mix, scale, strong};
use super::noise::{Cloud, paint, ramp, random};

/// Any colour; half of them with flecks of a second one.
pub(super) fn laminate(size: u32, rng: &mut ChaCha8Rng) -> RgbImage {
    let seed: u32 = rng.random();
    let color = any(rng);
    let fleck = apart(color, rng);
    let flecks = if rng.random_bool(0.5) { rng.random_range(0.1..0.5) } else { 0.0 };
    let rarity = rng.random_range(0.60..0.80);
    let grain = rng.random_range(0.005..0.03);
    let fine = Cloud::new([110, 110], seed, 1);
    let shade = Cloud::new([3, 3], seed ^ 1, 2);
    paint(size, |x, y| {
        let spot = fine.at(x, y);
        let light = 1.0
            + grain * (random(seed, (x * 512.0) as u32, (y * 512.0) as u32) - 0.5)
            + 0.03 * (shade.at(x, y) - 0.5);
        scale(mix(color, fleck, flecks * ramp(rarity, rarity + 0.12, spot)), light)
    })
}

/// Strong colours, moulded grain.
pub(super) fn plastic(size: u32, rng: &mut ChaCha8Rng) -> RgbImage {
    let seed: u32 = rng.random();
    let color = if rng.random_bool(0.7) { strong(rng) } else { any(rng) };
    let grain = rng.random_range(0.01..0.05);
    let fine = Cloud::new([160, 160], seed, 1);
    let shade = Cloud::new([2, 2], seed ^ 1, 2);
    paint(size, |x, y| {
        let light = 1.0 + grain * (fine.at(x, y) - 0.5) + 0.04 * (shade.at(x, y) - 0.5);
        scale(color, light)
    })
}
