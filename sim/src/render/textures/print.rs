//! Posters and newspaper pages, pinned one over the other.

use image::RgbImage;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::canvas::Canvas;
use super::colors::{any, apart, grey, mix, strong};
use super::noise::{Cloud, length, ramp};

pub(super) fn draw(size: u32, rng: &mut ChaCha8Rng) -> RgbImage {
    let ground = any(rng);
    let mut canvas = Canvas::new(size, |_, _| ground);
    let tilt = rng.random_range(0.0..0.25_f32);
    let largest = rng.random_range(0.16..0.30);
    // A jittered grid, so that little of the ground shows.
    const GRID: usize = 4;
    for i in 0..GRID * GRID {
        let mut place = |at: usize| (at as f32 + rng.random_range(0.1..0.9)) / GRID as f32;
        let center = [place(i % GRID), place(i / GRID)];
        let width = largest * rng.random_range(0.6..1.0_f32);
        let half = [width * 0.7, width * rng.random_range(0.8..1.1)];
        let sheet = Sheet { center, angle: rng.random_range(-tilt..=tilt), half };
        if rng.random_bool(0.5) {
            sheet.newspaper(&mut canvas, rng);
        } else {
            sheet.poster(&mut canvas, rng);
        }
    }
    canvas.finish()
}

/// A rectangle of paper.
struct Sheet {
    center: [f32; 2],
    angle: f32,
    half: [f32; 2],
}

impl Sheet {
    /// The place on the canvas of a place on the sheet, -1 to 1 each way.
    fn at(&self, x: f32, y: f32) -> [f32; 2] {
        let (sin, cos) = self.angle.sin_cos();
        let (a, b) = (x * self.half[0], y * self.half[1]);
        [self.center[0] + cos * a - sin * b, self.center[1] + sin * a + cos * b]
    }

    fn part(&self, canvas: &mut Canvas, at: [f32; 2], half: [f32; 2], color: [f32; 3]) {
        let size = [half[0] * self.half[0], half[1] * self.half[1]];
        canvas.rectangle(self.at(at[0], at[1]), self.angle, size, color);
    }

    /// A photograph: a sky, hills from noise, a bright disc.
    fn picture(&self, canvas: &mut Canvas, at: [f32; 2], half: [f32; 2], colors: [[f32; 3]; 3], seed: u32) {
        let size = [half[0] * self.half[0], half[1] * self.half[1]];
        let cover = canvas.cover();
        let hills = Cloud::new([5, 1], seed, 3);
        canvas.lay(self.at(at[0], at[1]), self.angle, size, |a, b| {
            let (x, y) = (0.5 + 0.5 * a / size[0], 0.5 + 0.5 * b / size[1]);
            let hill = hills.at(x, 0.0);
            let sun = length(x - 0.7, (y - 0.25) * size[1] / size[0]) - 0.13;
            let sky = mix(colors[0], [0.95; 3], 0.5 * y);
            let sky = mix(sky, colors[2], 1.0 - ramp(-0.02, 0.02, sun));
            let color = mix(sky, mix(colors[1], [0.1; 3], 0.5 * y), ramp(-0.02, 0.02, y - 0.3 - 0.5 * hill));
            (color, cover((a.abs() - size[0]).max(b.abs() - size[1])))
        });
    }

    /// A headline of letters across the width about height `y`.
    fn headline(&self, canvas: &mut Canvas, y: f32, height: f32, color: [f32; 3], rng: &mut ChaCha8Rng) {
        let tall = height * self.half[1];
        // A letter's cell is half as wide as it is high.
        let step = 0.5 * tall / self.half[0];
        let mut x = -0.85 + 0.5 * step;
        while x < 0.85 {
            if rng.random_bool(0.85) {
                let letter = char::from(b'A' + rng.random_range(0..26_u8));
                canvas.letter(letter, self.at(x, y), self.angle, tall, color);
            }
            x += step;
        }
    }

    /// Paper, headline, a picture, columns of lines made of words.
    fn newspaper(&self, canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
        let paper = mix([0.90, 0.87, 0.80], grey(rng), 0.15);
        let ink = mix(paper, [0.12; 3], 0.85);
        self.part(canvas, [0.0; 2], [1.0; 2], paper);
        self.headline(canvas, -0.86, 0.2, ink, rng);
        let columns = rng.random_range(2..5);
        let column = 1.8 / columns as f32;
        let pictured = rng.random_range(0..columns);
        for i in 0..columns {
            let left = -0.9 + column * i as f32;
            let mut y = -0.68;
            if i == pictured {
                let shades = [[0.7; 3], [0.4; 3], [0.85; 3]];
                self.picture(
                    canvas,
                    [left + 0.47 * column, -0.4],
                    [0.44 * column, 0.26],
                    shades,
                    rng.random(),
                );
                y = -0.06;
            }
            while y < 0.92 {
                let mut x = left;
                while x < left + 0.8 * column {
                    let word = rng.random_range(0.03..0.12_f32).min(left + 0.92 * column - x);
                    self.part(canvas, [x + 0.5 * word, y], [0.5 * word, 0.014], mix(paper, ink, 0.7));
                    x += word + 0.025;
                }
                y += 0.055;
            }
        }
    }

    /// Coloured paper, a picture, a headline, a band.
    fn poster(&self, canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
        let paper = any(rng);
        self.part(canvas, [0.0; 2], [1.0; 2], paper);
        let y = rng.random_range(-0.3..0.1);
        let half = [rng.random_range(0.6..0.95), rng.random_range(0.3..0.6)];
        self.picture(canvas, [0.0, y], half, [any(rng), strong(rng), strong(rng)], rng.random());
        let text = apart(paper, rng);
        self.headline(canvas, rng.random_range(0.62..0.8), rng.random_range(0.15..0.4), text, rng);
        if rng.random_bool(0.5) {
            self.part(canvas, [0.0, -0.92], [1.0, 0.06], strong(rng));
        }
    }
}
