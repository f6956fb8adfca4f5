//! Depth cameras that match windows of two pictures, as they are measured on real frames: presets `xtion`, `fetch-head`
//! and `d435`.
//!
//! A window has one disparity: its error is the same for neighbours, holes come in pieces, edges are ragged or fat. Noise
//! of single pixels, as most models have it, averages out over an object; this one does not.
//!
//! | effect | model |
//! |---|---|
//! | noise | disparity off by N(0, `noise_px`): two fields of equal size, smoothed by Gaussians of w = `windows_px`; two pixels k apart correlate by the mean of exp(-k^2 / (4 w^2)) |
//! | steps | disparity in `steps_per_pixel` |
//! | slow bias | depth off by a smooth field of `bias_m` |
//! | edges | pieces of a strip of `edge_px` along jumps in depth are lost, a share `edge_lost`; what is behind a near surface within `fattened_px` reads as that surface |
//! | holes | pieces anywhere, a share `lost`; at grazing angles with probability (1 - cos)^`grazing_exponent`; pieces of surfaces without texture, a share `flat_lost` |
//! | shadow | of the projector, or what the second camera does not see, over the baseline |
//! | border, range | nothing within `border_px` of the picture's border, or outside of the range |

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::carmine::{BiasField, projector_light};
use crate::camera::Intrinsics;
use crate::images::{DepthImage, Image};
use crate::render::Rendering;
use crate::sensor::RowStreams;
use crate::sensor::normal::normal;
use crate::sensor::patches::Patches;

/// A depth camera that matches windows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matcher {
    /// Focal length (pixels) times baseline (metres): disparity is this over depth.
    pub focal_baseline: f32,
    /// Standard deviation of disparity, pixels.
    pub noise_px: f32,
    /// Standard deviations of the Gaussians that smooth its two halves, pixels.
    pub windows_px: [f32; 2],
    /// Steps of disparity a pixel; 0 for none.
    pub steps_per_pixel: f32,
    /// Standard deviation of the slow error of depth, metres.
    pub bias_m: f32,
    /// Exponent of the drop-out at grazing angles.
    pub grazing_exponent: f32,
    /// Share of all pieces that are lost.
    pub lost: f32,
    /// Share of the pieces along edges that are lost.
    pub edge_lost: f32,
    /// Width of the strip along an edge, on either side, pixels.
    pub edge_px: usize,
    /// How far near surfaces reach over what is behind, pixels.
    pub fattened_px: usize,
    /// Share of the pieces without texture that are lost.
    pub flat_lost: f32,
    /// Without reading along the picture's border, pixels.
    pub border_px: usize,
    /// Where the projector or second camera stands along x, metres.
    pub baseline_x: f32,
    /// Least and largest depth, metres.
    pub range: [f32; 2],
}

impl Matcher {
    /// ASUS Xtion Pro Live as in YCB-Video, its depth registered to colour. Measured by `sim/examples/depth_residuals.rs` on eight
    /// frames, at the true poses after the best rigid motion of each object: standard deviation 2.4 mm at 1 m, growing
    /// with z^2; correlation 0.85, 0.66, 0.39 and 0.13 of that of neighbours at 2, 4, 8 and 16 pixels; lost readings 27 % at
    /// cos 0.25, 23 % at 0.35, 7.5 % at 0.45, 2.4 to 4 % above 0.5, 35 to 20 % in the five pixels along edges. Depth is kept
    /// in whole millimetres, so there are no steps to be seen.
    pub const XTION: Self = Self {
        focal_baseline: 575.8 * 0.075,
        noise_px: 0.102,
        windows_px: [2.1, 6.0],
        steps_per_pixel: 0.0,
        bias_m: 0.0015,
        grazing_exponent: 4.15,
        lost: 0.01,
        edge_lost: 0.27,
        edge_px: 4,
        fattened_px: 0,
        flat_lost: 0.0,
        border_px: 0,
        baseline_x: 0.075,
        range: [0.35, 4.5],
    };

    /// The camera on a Fetch's head, a PrimeSense Carmine 1.09. From recordings of one: planes have 3.3 mm of noise at 1.0 m and
    /// 3.8 at 1.3, most of it slow; 180 to 200 levels between 0.95 and 2.2 m (eighths of a pixel make 206); 6 to 8 pixels of
    /// border and all edges without reading. Window, grazing angles and holes are taken from the Xtion, which has the same
    /// sensor.
    pub const FETCH_HEAD: Self = Self {
        focal_baseline: 574.05 * 0.075,
        noise_px: 0.047,
        steps_per_pixel: 8.0,
        bias_m: 0.003,
        edge_lost: 1.0,
        edge_px: 2,
        border_px: 7,
        ..Self::XTION
    };

    /// Intel RealSense D435 at 848 x 480, a stereo pair of 50 mm with a pattern projector. Noise by the maker's formula (RMS =
    /// z^2 x subpixel / (f B), f = 424 pixels, subpixel 0.08: 3.8 mm at 1 m), steps of 1/32 pixel, no reading below 0.28
    /// m. How far windows reach over edges and how much is lost without texture is ours.
    pub const D435: Self = Self {
        focal_baseline: 424.0 * 0.05,
        noise_px: 0.08,
        windows_px: [2.5, 2.5],
        steps_per_pixel: 32.0,
        bias_m: 0.0015,
        grazing_exponent: 6.0,
        lost: 0.01,
        edge_lost: 0.15,
        edge_px: 3,
        fattened_px: 3,
        flat_lost: 0.15,
        border_px: 0,
        baseline_x: -0.05,
        range: [0.28, 6.0],
    };

    pub(super) fn apply(
        &self,
        rendering: &Rendering,
        intrinsics: &Intrinsics,
        rng: &mut ChaCha8Rng,
    ) -> DepthImage {
        let (width, height) = (rendering.depth.width(), rendering.depth.height());
        let lost = Patches::new(width, height, HOLE_PX, self.lost, rng);
        let lost_at_edges = Patches::new(width, height, EDGE_PIECE_PX, self.edge_lost, rng);
        let lost_where_flat = Patches::new(width, height, HOLE_PX, self.flat_lost, rng);
        let bias = BiasField::new(width, height, self.bias_m, rng);
        let streams = RowStreams::new(rng);
        let noise = smooth_noise(width, height, self.windows_px[0], &streams);
        let slower = smooth_noise(width, height, self.windows_px[1], &RowStreams::new(rng));
        let drops = RowStreams::new(rng);

        let perfect = fattened(&rendering.depth, self.fattened_px);
        let near_edge = spread(&edges(&rendering.depth), self.edge_px, |a, b| a | b);
        let flat = (self.flat_lost > 0.0).then(|| flat(rendering));
        let shift = intrinsics.fx as f32 * self.baseline_x;
        let mut image = Image::filled(width, height, 0.0);
        image.data_mut().par_chunks_mut(width).enumerate().for_each(|(v, row)| {
            if v < self.border_px || v + self.border_px >= height {
                return;
            }
            let mut rng = drops.row(v);
            let depth = &perfect.data()[v * width..(v + 1) * width];
            let seen_by_both = projector_light(depth, shift);
            for (u, reading) in row.iter_mut().enumerate() {
                let drop: f32 = rng.random();
                let z = depth[u];
                let grazing = (1.0 - rendering.cos_incidence.at(u, v)).clamp(0.0, 1.0);
                let missing = z <= 0.0
                    || u < self.border_px
                    || u + self.border_px >= width
                    || !seen_by_both[u]
                    || lost.covers(u, v)
                    || drop < grazing.powf(self.grazing_exponent)
                    || (*near_edge.at(u, v) && lost_at_edges.covers(u, v))
                    || flat.as_ref().is_some_and(|flat| *flat.at(u, v) && lost_where_flat.covers(u, v));
                if missing {
                    continue;
                }
                let error = self.noise_px * HALF.sqrt() * (noise.at(u, v) + slower.at(u, v));
                let mut disparity = self.focal_baseline / z + error;
                if self.steps_per_pixel > 0.0 {
                    disparity = (disparity * self.steps_per_pixel).round() / self.steps_per_pixel;
                }
                let read = self.focal_baseline / disparity + bias.at(u, v);
                if disparity > 0.0 && (self.range[0]..=self.range[1]).contains(&read) {
                    *reading = read;
                }
            }
        });
        image
    }
}

/// Share of the noise's variance in each of its two fields.
const HALF: f32 = 0.5;
/// Side of the pieces that are lost anywhere, and along edges, pixels.
const HOLE_PX: usize = 12;
const EDGE_PIECE_PX: usize = 6;
/// Depth jumps where neighbours differ by more than this, metres and share of depth.
const JUMP: (f32, f32) = (0.008, 0.012);
/// A surface has no texture where the brightness of a window of so many pixels to each side varies by less than this share.
const FLAT_PX: usize = 3;
const FLAT: f32 = 0.04;

/// Normal noise of unit variance, smoothed by a Gaussian of `sigma` pixels.
fn smooth_noise(width: usize, height: usize, sigma: f32, streams: &RowStreams) -> Image<f32> {
    let reach = (3.0 * sigma).ceil() as usize;
    let kernel: Vec<f32> = (0..=2 * reach)
        .map(|i| {
            let x = i as f32 - reach as f32;
            if sigma > 0.0 { (-0.5 * (x / sigma).powi(2)).exp() } else { 1.0 }
        })
        .collect();
    // So that smoothed noise has the variance of white noise.
    let norm: f32 = kernel.iter().map(|k| k * k).sum();
    // Beyond the picture on all sides, so that its border is like its middle.
    let (columns, rows) = (width + 2 * reach, height + 2 * reach);
    let mut along = vec![0.0_f32; width * rows];
    along.par_chunks_mut(width).enumerate().for_each(|(v, row)| {
        let mut rng = streams.row(v);
        let white: Vec<f32> = (0..columns).map(|_| normal(&mut rng)).collect();
        for (u, value) in row.iter_mut().enumerate() {
            *value = kernel.iter().zip(&white[u..]).map(|(k, w)| k * w).sum();
        }
    });
    let mut noise = Image::filled(width, height, 0.0);
    noise.data_mut().par_chunks_mut(width).enumerate().for_each(|(v, row)| {
        for (k, line) in kernel.iter().zip(along.chunks(width).skip(v)) {
            for (value, part) in row.iter_mut().zip(line) {
                *value += k * part / norm;
            }
        }
    });
    noise
}

/// Whether two neighbouring depths belong to different surfaces.
fn jump(a: f32, b: f32) -> bool {
    (a - b).abs() > JUMP.0 + JUMP.1 * a.min(b)
}

/// Pixels beside which depth jumps.
fn edges(depth: &DepthImage) -> Image<bool> {
    let (width, height) = (depth.width(), depth.height());
    let mut edges = Image::filled(width, height, false);
    for v in 0..height {
        for u in 0..width {
            let z = *depth.at(u, v);
            for (x, y) in [(u + 1, v), (u, v + 1)] {
                if x < width && y < height && jump(z, *depth.at(x, y)) {
                    *edges.at_mut(u, v) = true;
                    *edges.at_mut(x, y) = true;
                }
            }
        }
    }
    edges
}

/// Each pixel joined with all within `reach` columns and rows.
fn spread<T: Copy>(image: &Image<T>, reach: usize, join: impl Fn(T, T) -> T) -> Image<T> {
    let (width, height) = (image.width(), image.height());
    let mut out = image.clone();
    let mut pass = |source: &Image<T>, columns: bool| {
        for v in 0..height {
            for u in 0..width {
                let (at, size) = if columns { (u, width) } else { (v, height) };
                let window = at.saturating_sub(reach)..(at + reach + 1).min(size);
                let values = window.map(|i| *if columns { source.at(i, v) } else { source.at(u, i) });
                if let Some(joined) = values.reduce(&join) {
                    *out.at_mut(u, v) = joined;
                }
            }
        }
        out.clone()
    };
    let along = pass(image, true);
    pass(&along, false)
}

/// Depth in which near surfaces reach over what is behind them.
fn fattened(depth: &DepthImage, reach: usize) -> DepthImage {
    if reach == 0 {
        return depth.clone();
    }
    let nearer = |a: f32, b: f32| if a <= 0.0 || (b > 0.0 && b < a) { b } else { a };
    let nearest = spread(depth, reach, nearer);
    let mut fat = depth.clone();
    for (z, near) in fat.data_mut().iter_mut().zip(nearest.data()) {
        // A surface that slopes away is not before itself.
        if *near > 0.0 && (*z <= 0.0 || *z - near > 2.0 * (JUMP.0 + JUMP.1 * near) * reach as f32) {
            *z = *near;
        }
    }
    fat
}

/// Where the picture has no texture.
fn flat(rendering: &Rendering) -> Image<bool> {
    let radiance = &rendering.radiance;
    let mut range = Image::filled(radiance.width(), radiance.height(), [0.0_f32; 2]);
    for (range, [r, g, b]) in range.data_mut().iter_mut().zip(radiance.data()) {
        *range = [r + g + b; 2];
    }
    let range = spread(&range, FLAT_PX, |[a, b], [c, d]| [a.min(c), b.max(d)]);
    let mut flat = Image::filled(radiance.width(), radiance.height(), false);
    for (flat, [low, high]) in flat.data_mut().iter_mut().zip(range.data()) {
        *flat = high - low <= FLAT * high;
    }
    flat
}

#[cfg(test)]
mod tests {
    use super::super::tests::{CAMERA, flat as plane, statistics};
    use super::*;
    use crate::rng;

    const PRESETS: [Matcher; 3] = [Matcher::XTION, Matcher::FETCH_HEAD, Matcher::D435];

    /// Noise and steps alone.
    fn without_holes(matcher: Matcher) -> Matcher {
        Matcher {
            bias_m: 0.0,
            lost: 0.0,
            edge_lost: 0.0,
            flat_lost: 0.0,
            border_px: 0,
            baseline_x: 0.0,
            ..matcher
        }
    }

    fn read(matcher: &Matcher, rendering: &Rendering, seed: u64) -> DepthImage {
        matcher.apply(rendering, &CAMERA, &mut rng::stream(seed, "t"))
    }

    #[test]
    fn noise_is_that_of_disparity_times_depth_squared() {
        for matcher in PRESETS.map(without_holes) {
            for z in [0.6_f32, 1.0, 1.5] {
                let step = if matcher.steps_per_pixel > 0.0 { 1.0 / matcher.steps_per_pixel } else { 0.0 };
                let in_depth = z * z / matcher.focal_baseline;
                // Over a step, since at one depth rounding is a bias.
                let (mut squares, mut biases) = (0.0, 0.0);
                for i in 0..16 {
                    let z = z + step * in_depth * ((i as f32 + 0.5) / 16.0 - 0.5);
                    let (bias, sigma, valid) = statistics(&read(&matcher, &plane(z, 0.0), i), z);
                    assert_eq!(valid, 1.0);
                    squares += (bias * bias + sigma * sigma) / 16.0;
                    biases += bias / 16.0;
                }
                let expected = f64::from(in_depth * (matcher.noise_px.powi(2) + step * step / 12.0).sqrt());
                assert!((squares.sqrt() / expected - 1.0).abs() < 0.04, "{z}: {} {expected}", squares.sqrt());
                assert!(biases.abs() < 0.06 * expected, "{z}: {biases}");
            }
        }
    }

    #[test]
    fn neighbours_share_their_noise_as_a_window_does() {
        let image = read(&without_holes(Matcher::XTION), &plane(1.0, 0.0), 7);
        let error = |u: usize, v: usize| f64::from(image.at(u, v) - 1.0);
        for k in [1_usize, 2, 4, 8] {
            let (mut products, mut squares) = (0.0, 0.0);
            for v in 0..CAMERA.height - 8 {
                for u in 0..CAMERA.width - 8 {
                    products += error(u, v) * (error(u + k, v) + error(u, v + k)) / 2.0;
                    squares += error(u, v).powi(2);
                }
            }
            let of = |window: f64| (-((k * k) as f64) / (4.0 * window * window)).exp();
            let expected = (of(2.1) + of(6.0)) / 2.0;
            // One picture has few windows of 6 pixels.
            assert!((products / squares - expected).abs() < 0.07, "{k}: {} {expected}", products / squares);
        }
    }

    #[test]
    fn readings_are_lost_as_often_as_each_preset_says() {
        for matcher in PRESETS {
            for degrees in [0.0_f32, 60.0, 75.0] {
                let cos = degrees.to_radians().cos();
                let mut lost = 0.0;
                let seeds = 12;
                for seed in 0..seeds {
                    let image = read(&matcher, &plane(1.0, degrees.to_radians()), seed);
                    let inside = (20..300).flat_map(|u| (20..220).map(move |v| (u, v)));
                    lost += inside.filter(|&(u, v)| *image.at(u, v) == 0.0).count() as f32;
                }
                let share = lost / (280 * 200 * seeds) as f32;
                // All black: no texture anywhere.
                let grazing = (1.0 - cos).powf(matcher.grazing_exponent);
                let expected = 1.0 - (1.0 - matcher.lost) * (1.0 - matcher.flat_lost) * (1.0 - grazing);
                assert!((share - expected).abs() < 0.02, "{matcher:?} {degrees}: {share} {expected}");
            }
        }
    }

    #[test]
    fn the_fetch_reads_nothing_at_its_border_and_at_edges_and_has_as_many_levels_as_recorded() {
        let mut rendering = plane(1.2, 0.0);
        for v in 0..240 {
            for u in 120..200 {
                *rendering.depth.at_mut(u, v) = 0.9;
            }
        }
        let image = read(&Matcher { lost: 0.0, ..Matcher::FETCH_HEAD }, &rendering, 3);
        for v in 0..240 {
            assert!((0..7).chain(313..320).all(|u| *image.at(u, v) == 0.0));
            assert!((118..122).chain(198..202).all(|u| *image.at(u, v) == 0.0));
        }
        assert!((0..320).all(|u| *image.at(u, 3) == 0.0 && *image.at(u, 236) == 0.0));
        assert!((210..300).all(|u| *image.at(u, 120) > 0.0));
        // Levels between 0.95 and 2.2 m.
        let matcher = Matcher { noise_px: 0.0, ..without_holes(Matcher::FETCH_HEAD) };
        let mut ramp = plane(1.0, 0.0);
        for (i, z) in ramp.depth.data_mut().iter_mut().enumerate() {
            *z = 0.95 + 1.25 * i as f32 / (320.0 * 240.0);
        }
        let mut levels = read(&matcher, &ramp, 1).data().to_vec();
        levels.sort_by(f32::total_cmp);
        levels.dedup();
        assert!((180..=210).contains(&levels.len()), "{}", levels.len());
    }

    #[test]
    fn a_stereo_cameras_near_surfaces_reach_over_what_is_behind() {
        let mut rendering = plane(1.5, 0.0);
        for v in 0..240 {
            for u in 120..200 {
                *rendering.depth.at_mut(u, v) = 0.8;
            }
        }
        let fat = fattened(&rendering.depth, 3);
        let near: Vec<usize> = (0..320).filter(|&u| *fat.at(u, 100) == 0.8).collect();
        assert_eq!((near[0], near[near.len() - 1], near.len()), (117, 202, 86));
        assert_eq!(fattened(&rendering.depth, 0), rendering.depth);
        // A slope is not before itself.
        let mut slope = plane(1.0, 0.0).depth;
        for v in 0..240 {
            for u in 0..320 {
                *slope.at_mut(u, v) = 0.8 + 0.004 * u as f32;
            }
        }
        assert_eq!(fattened(&slope, 3), slope);
    }

    #[test]
    fn only_what_has_no_texture_is_lost_for_want_of_it() {
        let matcher = Matcher { flat_lost: 1.0, lost: 0.0, bias_m: 0.0, ..Matcher::D435 };
        let mut rendering = plane(1.0, 0.0);
        for v in 0..240 {
            for u in 0..320 {
                // The right half is chequered.
                let bright = u < 160 || (u / 4 + v / 4) % 2 == 0;
                *rendering.radiance.at_mut(u, v) = [if bright { 1.0 } else { 0.5 }; 3];
            }
        }
        let image = read(&matcher, &rendering, 1);
        assert!((0..150).all(|u| (0..240).all(|v| *image.at(u, v) == 0.0)));
        assert!((164..310).all(|u| (5..230).all(|v| *image.at(u, v) > 0.0)));
    }
}
