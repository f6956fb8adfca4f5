//! Depth noise: the published models of structured-light cameras, and our composition for the PrimeSense Carmine 1.09 on
//! the Fetch's head.
//!
//! Room light does not matter to any of them: the camera brings its own infrared pattern.

mod carmine;
mod handa;

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

pub use self::carmine::{Carmine109, DepthRange};
use super::RowStreams;
use crate::camera::Intrinsics;
use crate::error::{Error, Result};
use crate::images::{DepthImage, Image};
use crate::render::Rendering;

/// A model of depth noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DepthNoise {
    /// Perfect depth.
    None,
    /// Nguyen, Izadi, Lovell 2012, for the Kinect v1: axial and lateral normal noise, by depth and angle.
    Nguyen,
    /// Handa et al. 2014 (simkinect) after Barron and Malik 2013 and Bohg et al. 2014: shifted pixels, rounded disparity, dots lost.
    Handa,
    /// Choi, Zhou, Koltun 2015: shifted pixels, half resolution, quantised disparity with noise.
    Redwood,
    /// PrimeSense Carmine 1.09, our composition; see [`Carmine109`].
    Carmine109(Carmine109),
}

impl Default for DepthNoise {
    fn default() -> Self {
        Self::Carmine109(Carmine109::default())
    }
}

impl DepthNoise {
    /// The names that [`DepthNoise::from_name`] knows.
    pub const NAMES: [&str; 6] = ["none", "nguyen", "handa", "redwood", "carmine-109", "carmine-109-near"];

    /// The preset called `name`: `none`, `nguyen`, `handa`, `redwood`, `carmine-109` (0.35 to 4.5 m) or
    /// `carmine-109-near` (0.35 to 1.4 m).
    ///
    /// # Errors
    /// For any other name, listing these.
    pub fn from_name(name: &str) -> Result<Self> {
        let carmine = |range| Self::Carmine109(Carmine109 { range, ..Carmine109::default() });
        Ok(match name {
            "none" => Self::None,
            "nguyen" => Self::Nguyen,
            "handa" => Self::Handa,
            "redwood" => Self::Redwood,
            "carmine-109" => carmine(DepthRange::Wide),
            "carmine-109-near" => carmine(DepthRange::Near),
            _ => {
                return Err(Error::invalid(
                    "depth noise",
                    format!("no preset '{name}'; there are: {}", Self::NAMES.join(", ")),
                ));
            }
        })
    }

    /// What the sensor reads of `rendering`; 0.0 where it reads nothing.
    pub fn apply(&self, rendering: &Rendering, intrinsics: &Intrinsics, rng: &mut ChaCha8Rng) -> DepthImage {
        match self {
            Self::None => rendering.depth.clone(),
            Self::Nguyen => nguyen(rendering, rng),
            Self::Handa => handa::handa(&rendering.depth, rng),
            Self::Redwood => redwood(&rendering.depth, rng),
            Self::Carmine109(settings) => settings.apply(rendering, intrinsics, rng),
        }
    }
}

/// Steepest angle at which Nguyen's formulas are used: they were fitted up to 80 degrees and have a pole at 90.
const NGUYEN_STEEPEST: f32 = 1.40;

/// Axial standard deviation, metres, at depth `z` and angle of incidence `theta` (Nguyen 2012, equation 3 with its term
/// for steep angles).
fn nguyen_axial(z: f32, theta: f32) -> f32 {
    let t = theta.min(NGUYEN_STEEPEST);
    let steep = t / (std::f32::consts::FRAC_PI_2 - t);
    0.0012 + 0.0019 * (z - 0.4) * (z - 0.4) + 0.0001 / z.sqrt() * steep * steep
}

/// Lateral standard deviation, pixels (Nguyen 2012, equation 2).
fn nguyen_lateral(theta: f32) -> f32 {
    let t = theta.min(NGUYEN_STEEPEST);
    0.8 + 0.035 * t / (std::f32::consts::FRAC_PI_2 - t)
}

fn nguyen(rendering: &Rendering, rng: &mut ChaCha8Rng) -> DepthImage {
    let (depth, cos) = (&rendering.depth, &rendering.cos_incidence);
    each_pixel(depth.width(), depth.height(), rng, |u, v, rng| {
        let sigma = nguyen_lateral(cos.at(u, v).clamp(0.0, 1.0).acos());
        let (u, v) = shifted(depth, u, v, sigma, rng);
        let z = *depth.at(u, v);
        if z <= 0.0 {
            return 0.0;
        }
        let theta = cos.at(u, v).clamp(0.0, 1.0).acos();
        z + normal(rng) * nguyen_axial(z, theta)
    })
}

/// Depth at which Redwood's sensor reads nothing, metres.
const REDWOOD_FARTHEST: f32 = 10.0;

fn redwood(depth: &DepthImage, rng: &mut ChaCha8Rng) -> DepthImage {
    each_pixel(depth.width(), depth.height(), rng, |u, v, rng| {
        let (u, v) = shifted(depth, u, v, 0.25, rng);
        // The sensor has half the resolution.
        let z = *depth.at(u - u % 2, v - v % 2);
        if z <= 0.0 || z >= REDWOOD_FARTHEST {
            return 0.0;
        }
        let eighths = ((35.130 / z + normal(rng) * 0.027_778) * 8.0).round();
        if eighths > 0.0 { 35.130 * 8.0 / eighths } else { 0.0 }
    })
}

/// An image from a function of pixel and random stream, in parallel over rows; the same on any number of threads.
fn each_pixel(
    width: usize,
    height: usize,
    rng: &mut ChaCha8Rng,
    reading: impl Fn(usize, usize, &mut ChaCha8Rng) -> f32 + Sync,
) -> DepthImage {
    let streams = RowStreams::new(rng);
    let mut image = Image::filled(width, height, 0.0);
    image.data_mut().par_chunks_mut(width).enumerate().for_each(|(v, row)| {
        let mut rng = streams.row(v);
        for (u, z) in row.iter_mut().enumerate() {
            *z = reading(u, v, &mut rng);
        }
    });
    image
}

fn normal(rng: &mut ChaCha8Rng) -> f32 {
    StandardNormal.sample(rng)
}

/// The pixel that (u, v) sees after a normal shift of `sigma` pixels each way, kept inside the image.
fn shifted(image: &DepthImage, u: usize, v: usize, sigma: f32, rng: &mut ChaCha8Rng) -> (usize, usize) {
    let mut move_by = |at: usize, size: usize| {
        (at as f32 + sigma * normal(rng)).round().clamp(0.0, (size - 1) as f32) as usize
    };
    (move_by(u, image.width()), move_by(v, image.height()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng;

    /// A picture of constant depth and angle (not of a plane: that isolates axial noise from lateral).
    pub(super) fn flat(z: f32, theta: f32) -> Rendering {
        let (w, h) = (320, 240);
        Rendering {
            radiance: Image::filled(w, h, [0.0; 3]),
            depth: Image::filled(w, h, z),
            labels: Image::filled(w, h, 0),
            cos_incidence: Image::filled(w, h, theta.cos()),
        }
    }

    pub(super) const CAMERA: Intrinsics =
        Intrinsics { width: 320, height: 240, fx: 554.26, fy: 554.26, cx: 159.5, cy: 119.5 };

    /// Mean, standard deviation and share of valid readings, relative to `z`.
    pub(super) fn statistics(image: &DepthImage, z: f32) -> (f64, f64, f64) {
        let valid: Vec<f64> =
            image.data().iter().filter(|&&d| d > 0.0).map(|&d| f64::from(d) - f64::from(z)).collect();
        let count = valid.len().max(1) as f64;
        let mean = valid.iter().sum::<f64>() / count;
        let variance = valid.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / count;
        (mean, variance.sqrt(), count / image.data().len() as f64)
    }

    #[test]
    fn names_lead_to_presets_and_an_unknown_one_lists_them() {
        for name in DepthNoise::NAMES {
            assert!(DepthNoise::from_name(name).is_ok());
        }
        assert_eq!(DepthNoise::from_name("carmine-109").unwrap(), DepthNoise::default());
        let error = DepthNoise::from_name("kinect").unwrap_err().to_string();
        assert!(error.contains("kinect") && error.contains("redwood"), "{error}");
    }

    #[test]
    fn none_changes_nothing() {
        let rendering = flat(1.0, 0.3);
        let read = DepthNoise::None.apply(&rendering, &CAMERA, &mut rng::stream(1, "t"));
        assert_eq!(read, rendering.depth);
    }

    #[test]
    fn nguyen_has_its_published_sigma() {
        // The figure that is quoted for one metre, straight on.
        assert!((nguyen_axial(1.0, 0.0) - 0.00188).abs() < 1e-5);
        for (z, theta) in [(0.6, 0.0), (1.0, 0.0), (1.5, 0.0), (1.0, 1.1)] {
            let read = DepthNoise::Nguyen.apply(&flat(z, theta), &CAMERA, &mut rng::stream(1, "t"));
            let (bias, sigma, valid) = statistics(&read, z);
            let t = f64::from(theta);
            let steep = (t / (std::f64::consts::FRAC_PI_2 - t)).powi(2);
            let depth = f64::from(z);
            let expected = 0.0012 + 0.0019 * (depth - 0.4).powi(2) + 0.0001 / depth.sqrt() * steep;
            assert_eq!(valid, 1.0);
            assert!(bias.abs() < 0.03 * expected, "{z} {theta}: bias {bias}");
            assert!((sigma / expected - 1.0).abs() < 0.02, "{z} {theta}: {sigma} {expected}");
        }
    }

    #[test]
    fn nguyen_moves_edges_sideways_by_its_lateral_sigma() {
        // Depth that grows along u turns a shift of pixels into a change of depth (rounding to pixels adds 1/12).
        let mut rendering = flat(1.0, 0.0);
        let slope = 0.05;
        for v in 0..240 {
            for u in 0..320 {
                *rendering.depth.at_mut(u, v) = 1.0 + slope * u as f32;
            }
        }
        let read = DepthNoise::Nguyen.apply(&rendering, &CAMERA, &mut rng::stream(2, "t"));
        let mut sum = 0.0;
        for v in 0..240 {
            for u in 8..60 {
                let error = f64::from(read.at(u, v) - rendering.depth.at(u, v)) / f64::from(slope);
                sum += error * error;
            }
        }
        let sigma = (sum / (240.0 * 52.0)).sqrt();
        let expected = (0.64_f64 + 1.0 / 12.0).sqrt();
        assert!((sigma / expected - 1.0).abs() < 0.05, "{sigma} {expected}");
    }

    #[test]
    fn redwood_has_its_published_step_and_sigma() {
        for (z, step, sigma) in
            [(0.6, 0.001_28, 0.000_285), (1.0, 0.003_56, 0.000_79), (1.5, 0.008_0, 0.001_78)]
        {
            let read = DepthNoise::Redwood.apply(&flat(z, 0.0), &CAMERA, &mut rng::stream(3, "t"));
            let mut levels: Vec<f32> = read.data().to_vec();
            levels.sort_by(f32::total_cmp);
            levels.dedup();
            let steps: Vec<f32> = levels.windows(2).map(|w| w[1] - w[0]).collect();
            for s in &steps {
                assert!((s / step - 1.0).abs() < 0.03, "{z}: {s}");
            }
            // Rounding adds a twelfth of the squared step to the noise on average over depths: average over a step.
            let mut squares = 0.0;
            for i in 0..16 {
                let z = z + step * (i as f32 + 0.5) / 16.0;
                let read = DepthNoise::Redwood.apply(&flat(z, 0.0), &CAMERA, &mut rng::stream(i, "t"));
                let (bias, sigma, _) = statistics(&read, z);
                squares += bias * bias + sigma * sigma;
            }
            let total = (squares / 16.0).sqrt();
            let expected = (f64::from(step * step) / 12.0 + sigma * sigma).sqrt();
            assert!((total / expected - 1.0).abs() < 0.03, "{z}: {total} {expected}");
        }
        let far = DepthNoise::Redwood.apply(&flat(10.5, 0.0), &CAMERA, &mut rng::stream(3, "t"));
        assert!(far.data().iter().all(|&z| z == 0.0));
    }

    #[test]
    fn readings_do_not_depend_on_the_number_of_threads() {
        let rendering = flat(0.9, 0.7);
        for name in DepthNoise::NAMES {
            let noise = DepthNoise::from_name(name).unwrap();
            let take = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| noise.apply(&rendering, &CAMERA, &mut rng::stream(5, "t")))
            };
            assert_eq!(take(1), take(3), "{name}");
        }
    }
}
