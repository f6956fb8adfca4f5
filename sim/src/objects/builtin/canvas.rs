//! A picture painted in code: the labels and surfaces of the built-in objects.
//!
//! Coordinates are pixels from the top left, real numbers; pixel `(i, j)` covers `[i, i + 1) x [j, j + 1)`. Edges are
//! smoothed by the share of the pixel that is covered. Everything is deterministic.

use std::sync::Arc;

use image::{Rgb, RgbImage};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster};

/// An sRGB colour.
pub(super) type Color = [u8; 3];

/// White, as printed.
pub(super) const WHITE: Color = [244, 243, 238];
/// Black, as printed.
pub(super) const BLACK: Color = [26, 25, 26];
/// Bare tin or aluminium.
pub(super) const METAL: Color = [176, 178, 180];

/// How heavy the strokes of a text are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Weight {
    /// Thin strokes.
    Regular,
    /// Thick strokes.
    Bold,
}

/// Which way a text runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Turn {
    /// Left to right.
    None,
    /// Top to bottom (a quarter turn clockwise).
    Clockwise,
    /// Bottom to top (a quarter turn counter-clockwise).
    Counter,
}

/// A picture being painted.
#[derive(Debug, Clone)]
pub(super) struct Canvas {
    image: RgbImage,
}

/// `a` at 0, `b` at 1.
pub(super) fn mix(a: Color, b: Color, t: f32) -> Color {
    let t = t.clamp(0.0, 1.0);
    std::array::from_fn(|i| {
        let (from, to) = (f32::from(a[i]), f32::from(b[i]));
        (from + (to - from) * t).round() as u8
    })
}

/// A number in [0, 1) for each integer point and seed (the finaliser of MurmurHash3).
pub(super) fn hash(x: i32, y: i32, seed: u32) -> f32 {
    let mut h = (x as u32)
        .wrapping_mul(0x9e37_79b1)
        .wrapping_add((y as u32).wrapping_mul(0x85eb_ca77))
        .wrapping_add(seed.wrapping_mul(0xc2b2_ae3d));
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^= h >> 16;
    (h >> 8) as f32 / (1 << 24) as f32
}

/// Smooth noise in [0, 1) with features one unit in size.
pub(super) fn value_noise(x: f32, y: f32, seed: u32) -> f32 {
    let (i, j) = (x.floor(), y.floor());
    let smooth = |t: f32| t * t * (3.0 - 2.0 * t);
    let (s, t) = (smooth(x - i), smooth(y - j));
    let (i, j) = (i as i32, j as i32);
    let top = hash(i, j, seed) * (1.0 - s) + hash(i + 1, j, seed) * s;
    let bottom = hash(i, j + 1, seed) * (1.0 - s) + hash(i + 1, j + 1, seed) * s;
    top * (1.0 - t) + bottom * t
}

impl Canvas {
    /// A picture of one colour.
    pub(super) fn new(width: u32, height: u32, color: Color) -> Self {
        Self { image: RgbImage::from_pixel(width, height, Rgb(color)) }
    }

    /// Columns.
    pub(super) fn width(&self) -> f32 {
        self.image.width() as f32
    }

    /// Rows.
    pub(super) fn height(&self) -> f32 {
        self.image.height() as f32
    }

    /// The picture, done.
    pub(super) fn finish(self) -> Arc<RgbImage> {
        Arc::new(self.image)
    }

    /// Mixes `color(x, y)` into the pixels of a box, by `cover(x, y)` from 0 to 1; both are asked at pixel centres.
    pub(super) fn paint(
        &mut self,
        [x0, y0, x1, y1]: [f32; 4],
        cover: impl Fn(f32, f32) -> f32,
        color: impl Fn(f32, f32) -> Color,
    ) {
        let (w, h) = self.image.dimensions();
        let clip = |v: f32, end: u32| v.clamp(0.0, end as f32) as u32;
        for j in clip(y0.floor(), h)..clip(y1.ceil(), h) {
            for i in clip(x0.floor(), w)..clip(x1.ceil(), w) {
                let (x, y) = (i as f32 + 0.5, j as f32 + 0.5);
                let share = cover(x, y);
                if share > 0.0 {
                    let pixel = self.image.get_pixel_mut(i, j);
                    pixel.0 = mix(pixel.0, color(x, y), share);
                }
            }
        }
    }

    /// A filled rectangle.
    pub(super) fn rect(&mut self, x0: f32, y0: f32, x1: f32, y1: f32, color: Color) {
        let overlap = |v: f32, a: f32, b: f32| ((v + 0.5).min(b) - (v - 0.5).max(a)).clamp(0.0, 1.0);
        self.paint([x0, y0, x1, y1], |x, y| overlap(x, x0, x1) * overlap(y, y0, y1), |_, _| color);
    }

    /// The outline of a rectangle, drawn inwards.
    pub(super) fn frame(&mut self, x0: f32, y0: f32, x1: f32, y1: f32, thickness: f32, color: Color) {
        let t = thickness;
        self.rect(x0, y0, x1, y0 + t, color);
        self.rect(x0, y1 - t, x1, y1, color);
        self.rect(x0, y0 + t, x0 + t, y1 - t, color);
        self.rect(x1 - t, y0 + t, x1, y1 - t, color);
    }

    /// A rectangle with round corners.
    pub(super) fn rounded_rect(&mut self, x0: f32, y0: f32, x1: f32, y1: f32, radius: f32, color: Color) {
        let (cx, cy) = (0.5 * (x0 + x1), 0.5 * (y0 + y1));
        let (hx, hy) = (0.5 * (x1 - x0) - radius, 0.5 * (y1 - y0) - radius);
        self.paint(
            [x0, y0, x1, y1],
            |x, y| {
                let (dx, dy) = ((x - cx).abs() - hx, (y - cy).abs() - hy);
                let outside = dx.max(0.0).hypot(dy.max(0.0)) + dx.max(dy).min(0.0);
                (radius - outside + 0.5).clamp(0.0, 1.0)
            },
            |_, _| color,
        );
    }

    /// A rectangle whose colour goes from `top` to `bottom`.
    pub(super) fn gradient(&mut self, x0: f32, y0: f32, x1: f32, y1: f32, top: Color, bottom: Color) {
        self.paint([x0, y0, x1, y1], |_, _| 1.0, |_, y| mix(top, bottom, (y - y0) / (y1 - y0)));
    }

    /// A filled ellipse about `(cx, cy)`.
    pub(super) fn ellipse(&mut self, cx: f32, cy: f32, rx: f32, ry: f32, color: Color) {
        self.paint(
            [cx - rx - 1.0, cy - ry - 1.0, cx + rx + 1.0, cy + ry + 1.0],
            |x, y| {
                let d = ((x - cx) / rx).hypot((y - cy) / ry);
                ((1.0 - d) * rx.min(ry) + 0.5).clamp(0.0, 1.0)
            },
            |_, _| color,
        );
    }

    /// A filled circle.
    pub(super) fn circle(&mut self, cx: f32, cy: f32, radius: f32, color: Color) {
        self.ellipse(cx, cy, radius, radius, color);
    }

    /// A circle's outline, `thickness` inwards from `radius`.
    pub(super) fn ring(&mut self, cx: f32, cy: f32, radius: f32, thickness: f32, color: Color) {
        let r = radius + 1.0;
        self.paint(
            [cx - r, cy - r, cx + r, cy + r],
            |x, y| {
                let d = (x - cx).hypot(y - cy);
                (radius - d + 0.5).clamp(0.0, 1.0) * (d - radius + thickness + 0.5).clamp(0.0, 1.0)
            },
            |_, _| color,
        );
    }

    /// A stroke of `thickness` from one point to another, with round ends.
    pub(super) fn stripe(&mut self, from: [f32; 2], to: [f32; 2], thickness: f32, color: Color) {
        let r = 0.5 * thickness + 1.0;
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let length_2 = (dx * dx + dy * dy).max(1e-6);
        self.paint(
            [from[0].min(to[0]) - r, from[1].min(to[1]) - r, from[0].max(to[0]) + r, from[1].max(to[1]) + r],
            |x, y| {
                let t = (((x - from[0]) * dx + (y - from[1]) * dy) / length_2).clamp(0.0, 1.0);
                let d = (x - from[0] - t * dx).hypot(y - from[1] - t * dy);
                (0.5 * thickness - d + 0.5).clamp(0.0, 1.0)
            },
            |_, _| color,
        );
    }

    /// A filled polygon (even-odd rule), four samples a pixel.
    pub(super) fn polygon(&mut self, corners: &[[f32; 2]], color: Color) {
        let inside = |x: f32, y: f32| {
            let mut odd = false;
            for (k, a) in corners.iter().enumerate() {
                let b = corners[(k + 1) % corners.len()];
                if (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) {
                    odd = !odd;
                }
            }
            odd
        };
        let bounds = corners.iter().fold([f32::MAX, f32::MAX, f32::MIN, f32::MIN], |b, c| {
            [b[0].min(c[0]), b[1].min(c[1]), b[2].max(c[0]), b[3].max(c[1])]
        });
        self.paint(
            bounds,
            |x, y| {
                let hits = [(-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)]
                    .iter()
                    .filter(|(dx, dy)| inside(x + dx, y + dy));
                hits.count() as f32 / 4.0
            },
            |_, _| color,
        );
    }

    /// Changes each pixel's brightness by up to `amount` (of 255) either way: paper, pores, print.
    pub(super) fn noise(&mut self, amount: f32, seed: u32) {
        for (x, y, pixel) in self.image.enumerate_pixels_mut() {
            let change = (hash(x as i32, y as i32, seed) - 0.5) * 2.0 * amount;
            for channel in &mut pixel.0 {
                *channel = (f32::from(*channel) + change).round().clamp(0.0, 255.0) as u8;
            }
        }
    }

    /// Smooth streaks along x (`scale = [long, short]`) or y (`[short, long]`), feature sizes in pixels: wood, brushed
    /// metal. Mixes `color` in by up to `amount`.
    pub(super) fn grain(&mut self, scale: [f32; 2], color: Color, amount: f32, seed: u32) {
        let bounds = [0.0, 0.0, self.width(), self.height()];
        self.paint(
            bounds,
            |x, y| {
                let (u, v) = (x / scale[0], y / scale[1]);
                let n = 0.6 * value_noise(u, v, seed) + 0.4 * value_noise(2.3 * u, 2.3 * v, seed + 1);
                amount * n
            },
            |_, _| color,
        );
    }

    /// How wide a text of `height` is, pixels.
    pub(super) fn text_width(height: f32, text: &str) -> f32 {
        let (size, cell) = font(height);
        let advance = get_raster('M', FontWeight::Regular, size).map_or(0.5 * cell, |g| g.width() as f32);
        text.chars().count() as f32 * advance * height / cell
    }

    /// A text in one line; `(x, y)` is the top left of its first cell, `height` the cell's (capitals are about 0.7 of it).
    pub(super) fn text(&mut self, x: f32, y: f32, height: f32, text: &str, color: Color, weight: Weight) {
        let (cx, cy) = (x + 0.5 * Self::text_width(height, text), y + 0.5 * height);
        self.text_turned(cx, cy, height, text, color, weight, Turn::None);
    }

    /// A text about `(cx, cy)`.
    pub(super) fn text_centered(
        &mut self,
        cx: f32,
        cy: f32,
        height: f32,
        text: &str,
        color: Color,
        weight: Weight,
    ) {
        self.text_turned(cx, cy, height, text, color, weight, Turn::None);
    }

    /// A text about `(cx, cy)`, as high as `height` at most and no wider than `width`.
    pub(super) fn text_fitted(
        &mut self,
        [cx, cy]: [f32; 2],
        [width, height]: [f32; 2],
        text: &str,
        color: Color,
    ) {
        let height = height.min(height * width / Self::text_width(height, text).max(1.0));
        self.text_centered(cx, cy, height, text, color, Weight::Bold);
    }

    /// A text about `(cx, cy)` that runs in any direction of [`Turn`].
    #[expect(clippy::too_many_arguments, reason = "place, size, look: all of them are needed")]
    pub(super) fn text_turned(
        &mut self,
        cx: f32,
        cy: f32,
        height: f32,
        text: &str,
        color: Color,
        weight: Weight,
        turn: Turn,
    ) {
        let (size, cell) = font(height);
        let weight = match weight {
            Weight::Regular => FontWeight::Regular,
            Weight::Bold => FontWeight::Bold,
        };
        let scale = height / cell;
        let glyphs: Vec<_> = text
            .chars()
            .map(|c| get_raster(c, weight, size).or_else(|| get_raster('?', weight, size)))
            .collect();
        let Some(advance) = glyphs.iter().flatten().map(|g| g.width()).next() else {
            return;
        };
        let ink = |column: i32, row: i32| -> f32 {
            if column < 0 || row < 0 {
                return 0.0;
            }
            let (column, row) = (column as usize, row as usize);
            let glyph = glyphs.get(column / advance).and_then(Option::as_ref);
            glyph
                .and_then(|g| g.raster().get(row))
                .and_then(|r| r.get(column % advance))
                .map_or(0.0, |&v| f32::from(v) / 255.0)
        };
        let (half_x, half_y) = (0.5 * advance as f32 * glyphs.len() as f32, 0.5 * cell);
        let (reach_x, reach_y) = match turn {
            Turn::None => (half_x * scale, half_y * scale),
            Turn::Clockwise | Turn::Counter => (half_y * scale, half_x * scale),
        };
        // Enlarged letters get their sharp edge back: bilinear values are steepened about one half.
        let steep = scale.max(1.0);
        self.paint(
            [cx - reach_x, cy - reach_y, cx + reach_x, cy + reach_y],
            |x, y| {
                let (dx, dy) = ((x - cx) / scale, (y - cy) / scale);
                let (along, down) = match turn {
                    Turn::None => (dx, dy),
                    Turn::Clockwise => (dy, -dx),
                    Turn::Counter => (-dy, dx),
                };
                let (u, v) = (along + half_x - 0.5, down + half_y - 0.5);
                let (i, j) = (u.floor(), v.floor());
                let (s, t) = (u - i, v - j);
                let (i, j) = (i as i32, j as i32);
                let top = ink(i, j) * (1.0 - s) + ink(i + 1, j) * s;
                let bottom = ink(i, j + 1) * (1.0 - s) + ink(i + 1, j + 1) * s;
                ((top * (1.0 - t) + bottom * t - 0.5) * steep + 0.5).clamp(0.0, 1.0)
            },
            |_, _| color,
        );
    }

    /// A bar code on white, bars upright.
    pub(super) fn barcode(&mut self, x: f32, y: f32, width: f32, height: f32, seed: u32) {
        self.rect(x, y, x + width, y + height, WHITE);
        let module = ((width - 8.0) / 60.0).max(1.0);
        let digits = 0.2 * height;
        let (mut at, mut k) = (x + 4.0, 0);
        while at + 2.0 * module < x + width - 4.0 {
            let bar = module * (1.0 + (hash(k, 0, seed) * 3.0).floor());
            let gap = module * (1.0 + (hash(k, 1, seed) * 2.5).floor());
            self.rect(at, y + 3.0, (at + bar).min(x + width - 4.0), y + height - digits, BLACK);
            (at, k) = (at + bar + gap, k + 1);
        }
        let number: String = (0..11).map(|i| char::from(b'0' + (hash(i, 2, seed) * 10.0) as u8)).collect();
        self.text_centered(
            x + 0.5 * width,
            y + height - 0.5 * digits,
            digits,
            &number,
            BLACK,
            Weight::Regular,
        );
    }

    /// Lines of print too small to read: words as grey dashes.
    pub(super) fn small_print(&mut self, [x0, y0, x1, y1]: [f32; 4], line: f32, color: Color, seed: u32) {
        let rows = ((y1 - y0) / line) as i32;
        for row in 0..rows {
            let y = y0 + row as f32 * line;
            // The last line of a paragraph is short.
            let end = if row == rows - 1 { x0 + 0.6 * (x1 - x0) } else { x1 };
            let (mut x, mut k) = (x0, 0);
            while x < end - line {
                let word = line * (0.8 + 2.2 * hash(k, row, seed));
                self.rect(x, y + 0.2 * line, (x + word).min(end), y + 0.65 * line, color);
                (x, k) = (x + word + 0.45 * line, k + 1);
            }
        }
    }

    /// A nutrition table: black frame on white, title, rows with amounts.
    pub(super) fn nutrition_facts(&mut self, [x0, y0, x1, y1]: [f32; 4]) {
        const ROWS: [(&str, &str); 9] = [
            ("Calories", "140"),
            ("Total Fat", "5g"),
            ("Saturated", "1g"),
            ("Sodium", "230mg"),
            ("Carbohydr.", "22g"),
            ("Fiber", "1g"),
            ("Sugars", "3g"),
            ("Protein", "2g"),
            ("Iron", "8%"),
        ];
        self.rect(x0, y0, x1, y1, WHITE);
        self.frame(x0, y0, x1, y1, 2.0, BLACK);
        let (left, right) = (x0 + 6.0, x1 - 6.0);
        let row = (y1 - y0) / 11.5;
        self.text_fitted([0.5 * (x0 + x1), y0 + row], [right - left, 1.7 * row], "Nutrition Facts", BLACK);
        self.rect(left, y0 + 1.9 * row, right, y0 + 2.15 * row, BLACK);
        for (k, (name, amount)) in ROWS.iter().enumerate() {
            let y = y0 + (2.2 + k as f32) * row;
            let size = (0.95 * row).min((right - left) / 8.5);
            self.text(left, y + 0.5 * (row - size), size, name, BLACK, Weight::Regular);
            let width = Self::text_width(size, amount);
            self.text(right - width, y + 0.5 * (row - size), size, amount, BLACK, Weight::Bold);
            self.rect(left, y + row - 0.7, right, y + row, [120, 120, 118]);
        }
    }

    /// Copies another picture to `(x, y)`, turned by quarters.
    pub(super) fn paste(&mut self, x: u32, y: u32, other: &Self, turn: Turn) {
        let turned = match turn {
            Turn::None => other.image.clone(),
            Turn::Clockwise => image::imageops::rotate90(&other.image),
            Turn::Counter => image::imageops::rotate270(&other.image),
        };
        image::imageops::replace(&mut self.image, &turned, i64::from(x), i64::from(y));
    }
}

/// The raster to take for a text height, and its height.
fn font(height: f32) -> (RasterHeight, f32) {
    if height <= 18.0 { (RasterHeight::Size16, 16.0) } else { (RasterHeight::Size32, 32.0) }
}
