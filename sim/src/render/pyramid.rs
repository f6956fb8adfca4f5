//! A texture with its mip levels, filtered in linear light, shared by both renderers; and its look-up on the CPU.

use image::RgbImage;

use super::srgb::{LINEAR_OF_8BIT, encode_8bit};

/// Larger textures are halved until they fit: at 640x480 a 20 cm object a metre away covers about 110 pixels, so
/// a 4096-pixel scan only costs memory.
const MAX_SIDE: u32 = 2048;

/// Samples along the longer side of a pixel's footprint, as the hardware sampler is set to. One is trilinear filtering: a
/// table seen from above is sharp enough with it, and four would double a software adapter's time for geometry.
pub(super) const MAX_ANISOTROPY: u16 = 1;

/// One mip level: sRGB, row-major.
pub(super) struct Level {
    pub width: u32,
    pub height: u32,
    pub texels: Vec<[u8; 3]>,
}

/// All mip levels, the largest first, the last 1x1.
pub(super) struct Pyramid {
    pub levels: Vec<Level>,
}

impl Pyramid {
    /// Filters `image` down; `None` for an image without pixels.
    pub fn new(image: &RgbImage) -> Option<Self> {
        if image.width() == 0 || image.height() == 0 {
            return None;
        }
        let mut level = Level {
            width: image.width(),
            height: image.height(),
            texels: image.pixels().map(|p| p.0).collect(),
        };
        while level.width.max(level.height) > MAX_SIDE {
            level = level.half();
        }
        let mut levels = Vec::new();
        while level.width > 1 || level.height > 1 {
            let next = level.half();
            levels.push(level);
            level = next;
        }
        levels.push(level);
        Some(Self { levels })
    }

    /// Linear colour at `uv` seen through a pixel whose sides are `dx` and `dy` in texture coordinates: trilinear, with
    /// several samples along the longer side as in EXT_texture_filter_anisotropic.
    pub fn sample(&self, uv: [f32; 2], dx: [f32; 2], dy: [f32; 2]) -> [f32; 3] {
        let size = [self.levels[0].width as f32, self.levels[0].height as f32];
        let length = |d: [f32; 2]| (d[0] * size[0]).hypot(d[1] * size[1]);
        let (len_x, len_y) = (length(dx), length(dy));
        let (longest, shortest, along) = if len_x > len_y { (len_x, len_y, dx) } else { (len_y, len_x, dy) };
        if !(longest.is_finite() && longest > 0.0) {
            return self.levels[0].bilinear(uv);
        }
        let count = (longest / shortest.max(1e-6)).ceil().clamp(1.0, f32::from(MAX_ANISOTROPY));
        let lod = (longest / count).log2();
        let mut sum = [0.0; 3];
        for i in 0..count as u32 {
            let s = (i as f32 + 0.5) / count - 0.5;
            let color = self.trilinear([uv[0] + along[0] * s, uv[1] + along[1] * s], lod);
            for c in 0..3 {
                sum[c] += color[c];
            }
        }
        sum.map(|c| c / count)
    }

    fn trilinear(&self, uv: [f32; 2], lod: f32) -> [f32; 3] {
        let lod = lod.clamp(0.0, (self.levels.len() - 1) as f32);
        let (lower, part) = (lod as usize, lod.fract());
        let near = self.levels[lower].bilinear(uv);
        if part == 0.0 {
            return near;
        }
        let far = self.levels[lower + 1].bilinear(uv);
        std::array::from_fn(|c| near[c] + (far[c] - near[c]) * part)
    }
}

impl Level {
    /// Half as wide and high (at least 1), each texel the mean of the four below it in linear light.
    fn half(&self) -> Self {
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let mut texels = Vec::with_capacity((width * height) as usize);
        for y in 0..height {
            let rows = [2 * y, (2 * y + 1).min(self.height - 1)];
            for x in 0..width {
                let columns = [2 * x, (2 * x + 1).min(self.width - 1)];
                let mut sum = [0.0; 3];
                for row in rows {
                    for column in columns {
                        let texel = self.texels[(row * self.width + column) as usize];
                        for c in 0..3 {
                            sum[c] += LINEAR_OF_8BIT[texel[c] as usize];
                        }
                    }
                }
                texels.push(sum.map(|s: f32| encode_8bit(s * 0.25)));
            }
        }
        Self { width, height, texels }
    }

    /// Linear colour between the four nearest texels; the texture repeats.
    fn bilinear(&self, uv: [f32; 2]) -> [f32; 3] {
        let (x0, x1, fx) = split(uv[0], self.width);
        let (y0, y1, fy) = split(uv[1], self.height);
        let texel = |x: usize, y: usize| {
            self.texels[y * self.width as usize + x].map(|code| LINEAR_OF_8BIT[code as usize])
        };
        let (a, b, c, d) = (texel(x0, y0), texel(x1, y0), texel(x0, y1), texel(x1, y1));
        std::array::from_fn(|i| {
            (a[i] * (1.0 - fx) + b[i] * fx) * (1.0 - fy) + (c[i] * (1.0 - fx) + d[i] * fx) * fy
        })
    }
}

/// The two texels beside coordinate `t` (1 is one repeat) and how far it is towards the second.
fn split(t: f32, size: u32) -> (usize, usize, f32) {
    let position = (t - t.floor()) * size as f32 - 0.5;
    let lower = position.floor();
    let size = size as i64;
    let index = (lower as i64).rem_euclid(size);
    (index as usize, ((index + 1) % size) as usize, position - lower)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smallest_level_is_the_mean_in_linear_light() {
        let checker = RgbImage::from_fn(64, 64, |x, y| image::Rgb([255 * ((x + y) % 2) as u8; 3]));
        let pyramid = Pyramid::new(&checker).unwrap();
        assert_eq!(pyramid.levels.len(), 7);
        assert_eq!(pyramid.levels[6].texels[0], [188; 3]);
        let seen_from_afar = pyramid.sample([0.3, 0.7], [0.5, 0.0], [0.0, 0.5]);
        assert!((seen_from_afar[0] - 0.5).abs() < 0.01);
    }

    #[test]
    fn texel_centres_are_exact_and_the_texture_repeats() {
        let image = RgbImage::from_fn(4, 2, |x, y| image::Rgb([(x * 60) as u8, (y * 99) as u8, 7]));
        let pyramid = Pyramid::new(&image).unwrap();
        let zero = [0.0; 2];
        let color = pyramid.sample([2.5 / 4.0, 1.5 / 2.0], zero, zero);
        let expected = [120, 99, 7].map(|c: usize| LINEAR_OF_8BIT[c]);
        for c in 0..3 {
            assert!((color[c] - expected[c]).abs() < 1e-6);
        }
        assert_eq!(pyramid.sample([2.5 / 4.0 - 3.0, 1.5 / 2.0 + 5.0], zero, zero), color);
    }

    #[test]
    fn large_scans_are_halved_and_odd_sizes_work() {
        let pyramid = Pyramid::new(&RgbImage::new(4096, 33)).unwrap();
        assert_eq!((pyramid.levels[0].width, pyramid.levels[0].height), (2048, 16));
        assert!(Pyramid::new(&RgbImage::new(0, 5)).is_none());
    }
}
