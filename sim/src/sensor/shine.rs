//! Things that shine: what a depth camera loses on metal, foil and glossy print.
//!
//! A surface that mirrors sends the projected pattern elsewhere, or blinds the camera with it. How much of a surface that is
//! depends on its curvature and on the pattern's wavelength, which are not known for these objects; so it is drawn, from a range
//! that is ours.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::patches::Patches;
use crate::images::{DepthImage, LabelImage};

/// Share of the pieces of a shining object that are lost, drawn evenly from this range.
const LOST: [f32; 2] = [0.2, 0.8];
/// Side of a piece, pixels.
const PIECE_PX: usize = 6;

/// Takes away readings of objects that shine: each of the labels 1 to `objects` does with probability `chance`. Returns which.
pub fn dazzle(
    depth: &mut DepthImage,
    labels: &LabelImage,
    objects: u16,
    chance: f64,
    rng: &mut ChaCha8Rng,
) -> Vec<u16> {
    let (width, height) = (depth.width(), depth.height());
    let mut shining = Vec::new();
    for label in 1..=objects {
        // Drawn for every object, so that one that shines changes no other.
        let (shines, share) = (rng.random::<f64>() < chance, rng.random_range(LOST[0]..LOST[1]));
        let lost = Patches::new(width, height, PIECE_PX, share, rng);
        if !shines {
            continue;
        }
        shining.push(label);
        for (i, z) in depth.data_mut().iter_mut().enumerate() {
            let (u, v) = (i % width, i / width);
            if *labels.at(u, v) == label && lost.covers(u, v) {
                *z = 0.0;
            }
        }
    }
    shining
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::images::Image;
    use crate::rng;

    #[test]
    fn what_shines_loses_a_share_of_its_readings_and_nothing_else_does() {
        let (width, height) = (320, 240);
        // Three objects side by side, and background.
        let mut labels = Image::filled(width, height, 0u16);
        for (i, label) in labels.data_mut().iter_mut().enumerate() {
            *label = (i % width / 80) as u16;
        }
        let left = |depth: &DepthImage, label: u16| {
            let of = || labels.data().iter().zip(depth.data()).filter(move |(l, _)| **l == label);
            of().filter(|(_, z)| **z > 0.0).count() as f64 / of().count() as f64
        };
        let (mut shone, mut shares) = (0, Vec::new());
        for seed in 0..100 {
            let mut depth = Image::filled(width, height, 1.0f32);
            let shining = dazzle(&mut depth, &labels, 3, 0.3, &mut rng::stream(seed, "shine"));
            shone += shining.len();
            for label in 0..=3 {
                let left = left(&depth, label);
                if shining.contains(&label) {
                    assert!((0.15..0.85).contains(&left), "{left}");
                    shares.push(left);
                } else {
                    assert_eq!(left, 1.0);
                }
            }
        }
        assert!((60..120).contains(&shone), "{shone} of 300 at a chance of 0.3");
        let mean = shares.iter().sum::<f64>() / shares.len() as f64;
        assert!((mean - 0.5).abs() < 0.06, "{mean}");
    }
}
