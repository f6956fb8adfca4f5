//! A picture that shapes are laid on, one over the other; what leaves at one side comes back at the opposite one.

use image::RgbImage;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster};

use super::colors::mix;
use super::noise::encode;

/// Lengths are shares of the picture's side, so that a drawing does not depend on the number of pixels.
pub(super) struct Canvas {
    size: usize,
    pixels: Vec<[f32; 3]>,
}

impl Canvas {
    /// From a function of position, 0 to 1 along each side.
    pub(super) fn new(size: u32, color: impl Fn(f32, f32) -> [f32; 3]) -> Self {
        let size = size as usize;
        let at = |i: usize| (i as f32 + 0.5) / size as f32;
        let pixels = (0..size * size).map(|i| color(at(i % size), at(i / size))).collect();
        Self { size, pixels }
    }

    /// Lays a shape about `center`, turned by `angle` radians, nowhere larger than `half` from its middle along its own
    /// axes. `ink` tells colour and opacity, given a place on those axes.
    pub(super) fn lay(
        &mut self,
        center: [f32; 2],
        angle: f32,
        half: [f32; 2],
        ink: impl Fn(f32, f32) -> ([f32; 3], f32),
    ) {
        let scale = self.size as f32;
        let (sin, cos) = angle.sin_cos();
        let pad = 1.0 / scale;
        let extent = |a: f32, b: f32| ((half[0] * a).abs() + (half[1] * b).abs() + pad).min(0.499);
        let (rx, ry) = (extent(cos, sin), extent(sin, cos));
        let range = |c: f32, r: f32| ((c - r) * scale).floor() as i64..((c + r) * scale).ceil() as i64;
        for v in range(center[1], ry) {
            let row = v.rem_euclid(self.size as i64) as usize * self.size;
            let dy = (v as f32 + 0.5) / scale - center[1];
            for u in range(center[0], rx) {
                let dx = (u as f32 + 0.5) / scale - center[0];
                let (color, opacity) = ink(cos * dx + sin * dy, cos * dy - sin * dx);
                if opacity > 0.0 {
                    let pixel = &mut self.pixels[row + u.rem_euclid(self.size as i64) as usize];
                    *pixel = mix(*pixel, color, opacity.min(1.0));
                }
            }
        }
    }

    /// Opacity at signed `distance` outside an edge: the edge is one pixel wide.
    pub(super) fn cover(&self) -> impl Fn(f32) -> f32 + Copy + use<> {
        let scale = self.size as f32;
        move |distance| (0.5 - distance * scale).clamp(0.0, 1.0)
    }

    /// A rectangle with sides of twice `half`.
    pub(super) fn rectangle(&mut self, center: [f32; 2], angle: f32, half: [f32; 2], color: [f32; 3]) {
        let cover = self.cover();
        self.lay(center, angle, half, |a, b| (color, cover((a.abs() - half[0]).max(b.abs() - half[1]))));
    }

    /// A letter `height` high about `center`.
    pub(super) fn letter(
        &mut self,
        letter: char,
        center: [f32; 2],
        angle: f32,
        height: f32,
        color: [f32; 3],
    ) {
        let Some(glyph) = get_raster(letter, FontWeight::Bold, RasterHeight::Size32) else { return };
        let raster = glyph.raster();
        let (columns, rows) = (glyph.width() as f32, raster.len() as f32);
        let cell = height / rows;
        let half = [0.5 * columns * cell, 0.5 * height];
        let texel = |i: i32, j: i32| {
            let inside = i >= 0 && j >= 0 && (i as f32) < columns && (j as f32) < rows;
            if inside { f32::from(raster[j as usize][i as usize]) / 255.0 } else { 0.0 }
        };
        self.lay(center, angle, half, |a, b| {
            let (x, y) = ((a + half[0]) / cell - 0.5, (b + half[1]) / cell - 0.5);
            let (i, j) = (x.floor(), y.floor());
            let (fx, fy) = (x - i, y - j);
            let (i, j) = (i as i32, j as i32);
            let top = texel(i, j) * (1.0 - fx) + texel(i + 1, j) * fx;
            let bottom = texel(i, j + 1) * (1.0 - fx) + texel(i + 1, j + 1) * fx;
            (color, top * (1.0 - fy) + bottom * fy)
        });
    }

    /// The finished picture.
    pub(super) fn finish(self) -> RgbImage {
        let raw = self.pixels.iter().flat_map(|pixel| pixel.map(encode)).collect();
        RgbImage::from_raw(self.size as u32, self.size as u32, raw).unwrap_or_default()
    }
}
