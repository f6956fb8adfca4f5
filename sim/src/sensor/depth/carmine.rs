//! PrimeSense Carmine 1.09 (short range), composed by us from what is published about it and its relatives.
//!
//! | effect | model | source |
//! |---|---|---|
//! | axial noise | standard deviation 0.000181 + 0.00166 (z - 0.1)^2 m in all | data sheet fit (ANYbotics elevation_mapping) |
//! | steps in depth | disparity in eighths of a pixel, f = 575.8 px, b = 0.075 m; part of the axial noise | as in Handa 2014 |
//! | ragged edges | each pixel sees one N(0, 0.5 px) away | as in Handa 2014 |
//! | projector shadow | re-projection over the baseline, row by row | geometry |
//! | grazing drop-out | lost with probability (1 - cos)^8: 0.4 % at 60, 22 % at 80 degrees | ours |
//! | slow bias | disparity off by a smooth field of 0.06 px, drawn for each frame: 1.4 mm at 1 m | ours |
//! | range | nothing outside 0.35 .. 1.4 m, or .. 4.5 m in wide mode | data sheet |
//!
//! The size of the bias is chosen so that depth at the true pose of an object is off by millimetres as a whole, as it is
//! on real frames (-3.6 to +4.1 mm an object on YCB-Video). Drop-out on dark and shiny material is left out: a renderer's
//! picture in visible light does not tell reflectance in infrared.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::shifted;
use crate::camera::Intrinsics;
use crate::images::{DepthImage, Image};
use crate::render::Rendering;
use crate::sensor::RowStreams;
use crate::sensor::normal::normal;

/// Distances at which the sensor reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DepthRange {
    /// 0.35 to 1.4 m, what the maker promises.
    Near,
    /// 0.35 to 4.5 m, what the device delivers with growing noise. The default: from the Fetch's head the far part of a
    /// table is 1.0 to 1.5 m away.
    #[default]
    Wide,
}

impl DepthRange {
    /// Smallest and largest depth, metres.
    pub fn limits(self) -> (f32, f32) {
        match self {
            Self::Near => (0.35, 1.4),
            Self::Wide => (0.35, 4.5),
        }
    }
}

/// Settings of the Carmine 1.09 model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Carmine109 {
    /// Distances at which it reads. Not read from a file of settings: the preset's name in the scene says it.
    #[serde(skip)]
    pub range: DepthRange,
    /// Standard deviation of the sideways shift of each pixel, pixels, 0 to 10. Default 0.5.
    pub lateral_px: f32,
    /// Standard deviation of the smooth error of disparity, pixels, 0 to 10. Default 0.06.
    pub bias_px: f32,
    /// Where the projector stands beside the infrared camera along its x axis, metres, -1 to 1; 0 for no projector shadow.
    /// Default 0.075: on the right, so that shadows fall to the left of things.
    pub projector_x: f32,
    /// Exponent n of the drop-out probability (1 - cos)^n, 0 to 100; 0 for no drop-out. Default 8.
    pub grazing_exponent: i32,
}

impl Carmine109 {
    /// The default: in wide mode.
    pub const WIDE: Self = Self {
        range: DepthRange::Wide,
        lateral_px: 0.5,
        bias_px: 0.06,
        projector_x: 0.075,
        grazing_exponent: 8,
    };
}

impl Default for Carmine109 {
    fn default() -> Self {
        Self::WIDE
    }
}

/// Focal length (pixels) times baseline (metres) of the depth sensor: disparity is this over depth.
const FOCAL_BASELINE: f32 = 575.8 * 0.075;
/// Disparity is read in this many steps a pixel.
const STEPS_PER_PIXEL: f32 = 8.0;
/// Distance between the nodes of the bias field, pixels.
const BIAS_SPACING: usize = 64;

/// Standard deviation of depth at `z`, metres (data sheet).
fn sigma(z: f32) -> f32 {
    0.000_181 + 0.001_66 * (z - 0.1) * (z - 0.1)
}

/// Distance between neighbouring readings about `z`, metres.
fn step(z: f32) -> f32 {
    z * z / (FOCAL_BASELINE * STEPS_PER_PIXEL)
}

impl Carmine109 {
    pub(super) fn apply(
        &self,
        rendering: &Rendering,
        intrinsics: &Intrinsics,
        rng: &mut ChaCha8Rng,
    ) -> DepthImage {
        let (depth, cos) = (&rendering.depth, &rendering.cos_incidence);
        let (width, height) = (depth.width(), depth.height());
        let bias = BiasField::new(width, height, self.bias_px, rng);
        let streams = RowStreams::new(rng);
        let (nearest, farthest) = self.range.limits();
        let focal = intrinsics.fx as f32;
        let mut image = Image::filled(width, height, 0.0);
        image.data_mut().par_chunks_mut(width).zip(depth.data().par_chunks(width)).enumerate().for_each(
            |(v, (row, perfect))| {
                let mut rng = streams.row(v);
                let lit = projector_light(perfect, focal * self.projector_x);
                for (u, reading) in row.iter_mut().enumerate() {
                    // The same number of draws for every pixel, so that one hole does not change its neighbours.
                    let drop: f32 = rng.random();
                    let (su, sv) = shifted(depth, u, v, self.lateral_px, &mut rng);
                    let white = normal(&mut rng);
                    let z = *depth.at(su, sv);
                    if !lit[u] || z <= 0.0 {
                        continue;
                    }
                    if self.grazing_exponent > 0
                        && drop < (1.0 - cos.at(su, sv)).max(0.0).powi(self.grazing_exponent)
                    {
                        continue;
                    }
                    // What rounding does not contribute to the data sheet's noise is added before it, in disparity.
                    let added = (sigma(z) * sigma(z) - step(z) * step(z) / 12.0).max(0.0).sqrt();
                    let disparity =
                        FOCAL_BASELINE / z + white * added * FOCAL_BASELINE / (z * z) + bias.at(u, v);
                    let read =
                        FOCAL_BASELINE * STEPS_PER_PIXEL / (disparity * STEPS_PER_PIXEL + 0.5) as u32 as f32;
                    if (nearest..=farthest).contains(&read) {
                        *reading = read;
                    }
                }
            },
        );
        image
    }
}

/// Which pixels of a row of perfect depth the projector lights. `shift` is focal length times the projector's x: a point at
/// depth `z` in column `u` lies in column `u - shift / z` of the projector.
pub(super) fn projector_light(row: &[f32], shift: f32) -> Vec<bool> {
    /// Surfaces nearer than this are beyond the sensor's reach anyway, metres.
    const NEAREST: f32 = 0.2;
    /// Neighbouring pixels whose depths differ by less than this share belong to one surface.
    const SAME_SURFACE: f32 = 0.03;
    /// A point this much behind the first lit one, metres and share of depth, is in shadow.
    const BEHIND: (f32, f32) = (0.008, 0.008);

    let mut lit = vec![true; row.len()];
    if shift == 0.0 {
        return lit;
    }
    let margin = (shift.abs() / NEAREST).ceil() + 2.0;
    let cells = row.len() + 2 * margin as usize;
    let cell = |u: usize, z: f32| {
        let column = u as f32 - shift / z.max(NEAREST) + margin;
        // Rounded; the conversion stops at 0.
        ((column + 0.5) as usize).min(cells - 1)
    };
    let mut first = vec![f32::INFINITY; cells];
    let mut before: Option<(usize, f32)> = None;
    for (u, &z) in row.iter().enumerate() {
        if z <= 0.0 {
            before = None;
            continue;
        }
        let here = cell(u, z);
        first[here] = first[here].min(z);
        if let Some((there, previous)) = before
            && (z - previous).abs() < SAME_SURFACE * z
        {
            // A surface without gaps seen from here has none seen from there.
            for between in &mut first[here.min(there)..=here.max(there)] {
                *between = between.min(z.max(previous));
            }
        }
        before = Some((here, z));
    }
    for (u, &z) in row.iter().enumerate() {
        if z > 0.0 {
            lit[u] = z - first[cell(u, z)] <= BEHIND.0 + BEHIND.1 * z;
        }
    }
    lit
}

/// A smooth random field of unit variance everywhere, times a scale.
pub(super) struct BiasField {
    nodes: Vec<f32>,
    columns: usize,
    scale: f32,
}

impl BiasField {
    pub fn new(width: usize, height: usize, scale: f32, rng: &mut ChaCha8Rng) -> Self {
        let columns = width / BIAS_SPACING + 2;
        let rows = height / BIAS_SPACING + 2;
        Self { nodes: (0..columns * rows).map(|_| normal(rng)).collect(), columns, scale }
    }

    pub fn at(&self, u: usize, v: usize) -> f32 {
        let (x, y) = (u / BIAS_SPACING, v / BIAS_SPACING);
        let part = |at: usize| {
            let t = (at % BIAS_SPACING) as f32 / BIAS_SPACING as f32;
            t * t * (3.0 - 2.0 * t)
        };
        let (fx, fy) = (part(u), part(v));
        let node = |dx: usize, dy: usize| self.nodes[(y + dy) * self.columns + x + dx];
        let mixed = (node(0, 0) * (1.0 - fx) + node(1, 0) * fx) * (1.0 - fy)
            + (node(0, 1) * (1.0 - fx) + node(1, 1) * fx) * fy;
        // Mixing makes the variance smaller between nodes; undo that.
        let variance = |f: f32| (1.0 - f) * (1.0 - f) + f * f;
        self.scale * mixed / (variance(fx) * variance(fy)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{CAMERA, flat, statistics};
    use super::*;
    use crate::rng;
    use crate::sensor::depth::DepthNoise;

    fn without_bias() -> Carmine109 {
        Carmine109 { bias_px: 0.0, ..Carmine109::default() }
    }

    #[test]
    fn noise_and_steps_together_are_the_data_sheets() {
        assert!((sigma(1.0) - 0.001_53).abs() < 1e-5);
        for z in [0.6_f32, 1.0, 1.5] {
            // Averaged over a step, since at one depth rounding is a bias and not noise.
            let (mut squares, mut biases) = (0.0, 0.0);
            for i in 0..16 {
                let z = z + step(z) * (i as f32 + 0.5) / 16.0;
                let noise = DepthNoise::Carmine109(without_bias());
                let read = noise.apply(&flat(z, 0.0), &CAMERA, &mut rng::stream(i, "t"));
                let (bias, sigma, valid) = statistics(&read, z);
                assert_eq!(valid, 1.0);
                squares += bias * bias + sigma * sigma;
                biases += bias;
            }
            let total = (squares / 16.0).sqrt();
            let expected = f64::from(sigma(z));
            assert!((total / expected - 1.0).abs() < 0.03, "{z}: {total} {expected}");
            assert!((biases / 16.0).abs() < 0.05 * expected, "{z}: {}", biases / 16.0);
        }
    }

    #[test]
    fn readings_lie_on_the_eighths_of_disparity() {
        let read = DepthNoise::default().apply(&flat(1.0, 0.0), &CAMERA, &mut rng::stream(1, "t"));
        for &z in read.data() {
            let eighths = f64::from(FOCAL_BASELINE * 8.0) / f64::from(z);
            assert!((eighths - eighths.round()).abs() < 1e-3, "{z}");
        }
        assert!((step(1.0) - 0.00289).abs() < 1e-5);
    }

    #[test]
    fn bias_is_smooth_within_a_frame_and_has_its_size_over_frames() {
        let settings = Carmine109::default();
        let (mut squares, mut count) = (0.0, 0.0_f64);
        let mut difference = 0.0_f32;
        for seed in 0..400 {
            let field = BiasField::new(640, 480, settings.bias_px, &mut rng::stream(seed, "t"));
            for (u, v) in [(10, 10), (100, 300), (352, 224), (639, 479)] {
                squares += f64::from(field.at(u, v)).powi(2);
                count += 1.0;
            }
            difference = difference.max((field.at(200, 200) - field.at(201, 200)).abs());
        }
        let size = (squares / count).sqrt();
        assert!((size / 0.06 - 1.0).abs() < 0.07, "{size}");
        assert!(difference < 0.02, "{difference}");
    }

    #[test]
    fn grazing_surfaces_lose_readings_as_the_formula_says() {
        for degrees in [0.0_f32, 60.0, 75.0, 80.0, 85.0] {
            let theta = degrees.to_radians();
            let read = DepthNoise::default().apply(&flat(1.0, theta), &CAMERA, &mut rng::stream(2, "t"));
            let lost = read.data().iter().filter(|&&z| z == 0.0).count() as f64 / (320.0 * 240.0);
            let expected = f64::from(1.0 - theta.cos()).powi(8);
            assert!((lost - expected).abs() < 0.005, "{degrees}: {lost} {expected}");
        }
    }

    #[test]
    fn a_box_throws_a_projector_shadow_of_the_geometric_width() {
        // A box front at 0.8 m before a wall at 1.2 m: the shadow is f b (1/0.8 - 1/1.2) pixels wide, on the left.
        let (near, far) = (0.8_f32, 1.2_f32);
        let mut rendering = flat(far, 0.0);
        for v in 60..180 {
            for u in 120..200 {
                *rendering.depth.at_mut(u, v) = near;
            }
        }
        let settings = Carmine109 { lateral_px: 0.0, ..without_bias() };
        let read = DepthNoise::Carmine109(settings).apply(&rendering, &CAMERA, &mut rng::stream(3, "t"));
        let holes: Vec<usize> = (0..320).filter(|&u| *read.at(u, 100) == 0.0).collect();
        let width = 554.26 * 0.075 * (1.0 / near - 1.0 / far);
        assert!((holes.len() as f32 - width).abs() <= 1.0, "{holes:?} {width}");
        assert!(holes.iter().all(|&u| u < 120 && u + 20 > 120), "{holes:?}");
        assert!((0..320).all(|u| *read.at(u, 30) > 0.0));
    }

    #[test]
    fn nothing_is_read_out_of_range() {
        for (name, z, valid) in [
            ("carmine-109", 0.30, false),
            ("carmine-109", 0.40, true),
            ("carmine-109", 3.0, true),
            ("carmine-109", 6.0, false),
            ("carmine-109-near", 1.3, true),
            ("carmine-109-near", 1.6, false),
        ] {
            let noise = DepthNoise::from_name(name, &Carmine109::default()).unwrap();
            let read = noise.apply(&flat(z, 0.0), &CAMERA, &mut rng::stream(4, "t"));
            let any = read.data().iter().any(|&z| z > 0.0);
            let all = read.data().iter().all(|&z| z > 0.0);
            assert!(if valid { all } else { !any }, "{name} at {z}");
        }
    }
}
