//! Shapes, gradients, strokes and letters without meaning.

use std::f32::consts::TAU;

use image::RgbImage;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::canvas::Canvas;
use super::colors::{any, apart, mix, strong};
use super::noise::{Cloud, length};

pub(super) fn draw(size: u32, rng: &mut ChaCha8Rng) -> RgbImage {
    let seed: u32 = rng.random();
    let (first, second) = (any(rng), any(rng));
    let cells = rng.random_range(2..5);
    let shade = Cloud::new([cells; 2], seed, 2);
    let mut canvas = Canvas::new(size, |x, y| mix(first, second, shade.at(x, y)));
    let count = rng.random_range(40..140);
    let largest = rng.random_range(0.06..0.22_f32);
    for _ in 0..count {
        let center = [rng.random(), rng.random()];
        let angle = rng.random_range(0.0..TAU);
        // Many small shapes, few large ones.
        let reach = largest * rng.random_range(0.2..1.0_f32).powi(2) + 0.01;
        let color = if rng.random_bool(0.6) { strong(rng) } else { any(rng) };
        shape(&mut canvas, center, angle, reach, color, rng);
    }
    canvas.finish()
}

/// Letters and digits.
const LETTERS: &[u8] = b"ABCDEFGHKMNPRSTXYZabdeghkqs0123456789&?%#";

fn letter(rng: &mut ChaCha8Rng) -> char {
    char::from(LETTERS[rng.random_range(0..LETTERS.len())])
}

/// One shape about as large as `reach`: disc, ring, rectangle, triangle, stripes, stroke or a word.
fn shape(
    canvas: &mut Canvas,
    center: [f32; 2],
    angle: f32,
    reach: f32,
    color: [f32; 3],
    rng: &mut ChaCha8Rng,
) {
    let cover = canvas.cover();
    let opacity = if rng.random_bool(0.7) { 1.0 } else { rng.random_range(0.3..0.9) };
    let fade_to = if rng.random_bool(0.4) { apart(color, rng) } else { color };
    let flat = rng.random_range(0.2..1.0_f32);
    let filled = move |a: f32| mix(color, fade_to, 0.5 + 0.5 * (a / reach).clamp(-1.0, 1.0));
    match rng.random_range(0..8) {
        0 => canvas.lay(center, angle, [reach; 2], |a, b| (filled(a), opacity * cover(length(a, b) - reach))),
        1 => {
            let width = reach * flat * 0.3;
            let inner = reach - width;
            canvas.lay(center, angle, [reach; 2], |a, b| {
                (filled(a), opacity * cover((length(a, b) - inner).abs() - width))
            });
        }
        2 | 3 => {
            let half = [reach, reach * flat];
            canvas.lay(center, angle, half, |a, b| {
                (filled(a), opacity * cover((a.abs() - half[0]).max(b.abs() - half[1])))
            });
        }
        4 => canvas.lay(center, angle, [reach; 2], |a, b| {
            // Three half planes about the middle.
            let side = |turn: f32| a * turn.cos() + b * turn.sin() - 0.5 * reach;
            (filled(a), opacity * cover(side(0.0).max(side(TAU / 3.0)).max(side(-TAU / 3.0))))
        }),
        5 => {
            let (half, stripes) = ([reach, reach * flat], rng.random_range(2.0..8.0));
            canvas.lay(center, angle, half, |a, b| {
                let inside = cover((a.abs() - half[0]).max(b.abs() - half[1]));
                let stripe = ((a / reach * stripes).rem_euclid(1.0) - 0.5).abs() - 0.25;
                (if stripe > 0.0 { color } else { fade_to }, opacity * inside)
            });
        }
        6 => {
            let (swing, width) = (reach * 0.4 * flat, reach * 0.08);
            let half = [reach, swing + width];
            canvas.lay(center, angle, half, |a, b| {
                let middle = swing * (a / reach * 4.0).sin();
                (color, opacity * cover(((b - middle).abs() - width).max(a.abs() - reach)))
            });
        }
        _ => {
            let height = (reach * 0.9).min(0.15);
            let (step_x, step_y) = (0.5 * height * angle.cos(), 0.5 * height * angle.sin());
            for i in 0..rng.random_range(1..7) {
                let at = [center[0] + i as f32 * step_x, center[1] + i as f32 * step_y];
                canvas.letter(letter(rng), at, angle, height, color);
            }
        }
    }
}
