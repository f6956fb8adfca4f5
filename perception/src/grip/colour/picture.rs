//! The colour image in linear light at strides 1, 2 and 4, with the noise that is in it.

use grip_sim::frame::CameraFrame;

use crate::model::linear;
use crate::observation::Stride;

/// The strides that are prepared.
const STRIDES: [Stride; 3] = [Stride::One, Stride::Two, Stride::Four];
/// Bins of brightness in which noise is measured, from [`DARKEST`] to 1.
const BINS: usize = 25;
/// Linear light of 8-bit code 1: below is black.
const DARKEST: f32 = 1.0 / (255.0 * 12.92);
/// Fewer differences say nothing of a bin.
const FEWEST: usize = 30;
/// Of each so many rows and columns one is measured.
const EVERY: usize = 4;

/// The colour image of a frame.
#[derive(Debug)]
pub(crate) struct Picture {
    levels: Vec<PictureLevel>,
}

/// At one resolution.
#[derive(Debug)]
pub(super) struct PictureLevel {
    /// Blocks of this side make a pixel.
    pub stride: Stride,
    width: usize,
    height: usize,
    /// Linear RGB, row by row.
    rgb: Vec<[f32; 3]>,
    /// Standard deviation of a channel, by its brightness.
    noise: [f32; BINS],
}

impl Picture {
    /// Of this frame; `None` where it has no colour image of the size of the depth image.
    pub fn new(frame: &CameraFrame) -> Option<Self> {
        let (width, height) = (frame.intrinsics.width, frame.intrinsics.height);
        if (frame.rgb.width() as usize, frame.rgb.height() as usize) != (width, height) {
            return None;
        }
        let table: Vec<f32> = (0..=255u8).map(|code| linear(f32::from(code) / 255.0)).collect();
        let pixels = frame.rgb.as_raw().as_chunks::<3>().0;
        let rgb = pixels.iter().map(|p| p.map(|code| table[usize::from(code)])).collect();
        let mut levels = vec![PictureLevel::new(Stride::One, width, height, rgb)];
        for stride in &STRIDES[1..] {
            let halved = levels[levels.len() - 1].halved(*stride);
            levels.push(halved);
        }
        Some(Self { levels })
    }

    /// The coarsest level whose pixels are not much larger than `pixels` of full resolution.
    pub(super) fn level(&self, pixels: f32) -> &PictureLevel {
        let i = STRIDES.iter().rposition(|&s| pixels >= 0.75 * s.pixels() as f32).unwrap_or(0);
        &self.levels[i]
    }
}

impl PictureLevel {
    fn new(stride: Stride, width: usize, height: usize, rgb: Vec<[f32; 3]>) -> Self {
        let noise = noise(&rgb, width, height);
        Self { stride, width, height, rgb, noise }
    }

    fn halved(&self, stride: Stride) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let mut rgb = Vec::with_capacity(width * height);
        for v in 0..height {
            for u in 0..width {
                let at = 2 * v * self.width + 2 * u;
                let block = [at, at + 1, at + self.width, at + self.width + 1].map(|i| self.rgb[i]);
                rgb.push([0, 1, 2].map(|c| 0.25 * block.iter().map(|p| p[c]).sum::<f32>()));
            }
        }
        Self::new(stride, width, height, rgb)
    }

    /// Linear RGB between pixels; `None` outside of their centres.
    #[inline]
    pub fn at(&self, u: f32, v: f32) -> Option<[f32; 3]> {
        if !(u >= 0.0 && v >= 0.0 && u < self.width as f32 - 1.0 && v < self.height as f32 - 1.0) {
            return None;
        }
        let (x, y) = (u as usize, v as usize);
        let (p, q) = (u - x as f32, v - y as f32);
        let i = y * self.width + x;
        let (a, b) = (self.rgb[i], self.rgb[i + 1]);
        let (c, d) = (self.rgb[i + self.width], self.rgb[i + self.width + 1]);
        Some([0, 1, 2].map(|k| {
            let (above, below) = (a[k] + p * (b[k] - a[k]), c[k] + p * (d[k] - c[k]));
            above + q * (below - above)
        }))
    }

    /// Standard deviation of the noise of a channel of this brightness, linear light.
    #[inline]
    pub fn noise(&self, brightness: f32) -> f32 {
        self.noise[bin(brightness)]
    }
}

/// Half-octaves above [`DARKEST`]: the exponent of a float and the first bit of its mantissa.
#[inline]
fn bin(brightness: f32) -> usize {
    const FIRST: u32 = DARKEST.to_bits() >> 22;
    ((brightness.max(DARKEST).to_bits() >> 22) - FIRST).min(BINS as u32 - 1) as usize
}

/// Noise from the image itself: the median of what differs along both diagonals of four pixels, which is none of a slope's
/// and little of an edge's. What texture adds errs on the safe side.
fn noise(rgb: &[[f32; 3]], width: usize, height: usize) -> [f32; BINS] {
    let mut differences: [Vec<f32>; BINS] = std::array::from_fn(|_| Vec::new());
    for v in (0..height.saturating_sub(1)).step_by(EVERY) {
        for u in (0..width.saturating_sub(1)).step_by(EVERY) {
            let i = v * width + u;
            let (a, b, c, d) = (rgb[i], rgb[i + 1], rgb[i + width], rgb[i + width + 1]);
            for k in 0..3 {
                let mean = 0.25 * (a[k] + b[k] + c[k] + d[k]);
                differences[bin(mean)].push(0.5 * (a[k] - b[k] - c[k] + d[k]).abs());
            }
        }
    }
    let measured: Vec<Option<f32>> = differences
        .into_iter()
        .map(|mut d| {
            let middle = d.len() / 2;
            // 1.4826 makes a standard deviation of the median of a normal law.
            (d.len() >= FEWEST).then(|| 1.4826 * *d.select_nth_unstable_by(middle, f32::total_cmp).1)
        })
        .collect();
    std::array::from_fn(|i| {
        let nearest = (0..BINS).filter(|&j| measured[j].is_some()).min_by_key(|&j| i.abs_diff(j));
        nearest.and_then(|j| measured[j]).unwrap_or(DARKEST).max(0.3 * DARKEST)
    })
}
