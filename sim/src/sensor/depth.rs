//! Depth noise: the published models of structured-light cameras, our composition for the PrimeSense Carmine 1.09, and
//! cameras as they are measured.
//!
//! Room light does not matter to any of them: the camera brings its own infrared pattern.

mod carmine;
mod handa;
mod matched;

use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

pub use self::carmine::{Carmine109, DepthRange};
pub use self::matched::Matcher;
use super::RowStreams;
use super::normal::normal;
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
    /// Windows matched, as measured on real cameras; see [`Matcher`].
    Matched(Matcher),
}

impl Default for DepthNoise {
    fn default() -> Self {
        Self::Carmine109(Carmine109::default())
    }
}

impl DepthNoise {
    /// Whether what is lost depends on the texture of what is seen, and so on its light.
    pub fn needs_light(&self) -> bool {
        matches!(self, Self::Matched(matcher) if matcher.flat_lost > 0.0)
    }

    /// The names that [`DepthNoise::from_name`] knows.
    pub const NAMES: [&str; 9] = [
        "none",
        "nguyen",
        "handa",
        "redwood",
        "carmine-109",
        "carmine-109-near",
        "xtion",
        "fetch-head",
        "d435",
    ];

    /// The preset called `name`: `none`, `nguyen`, `handa`, `redwood`, `xtion`, `fetch-head`, `d435`, `carmine-109` (0.35 to
    /// 4.5 m) or `carmine-109-near` (0.35 to 1.4 m), the last two with the settings `carmine` but for its range.
    ///
    /// # Errors
    /// For any other name, listing these.
    pub fn from_name(name: &str, carmine: &Carmine109) -> Result<Self> {
        Ok(match name {
            "none" => Self::None,
            "nguyen" => Self::Nguyen,
            "handa" => Self::Handa,
            "redwood" => Self::Redwood,
            "carmine-109" => Self::Carmine109(Carmine109 { range: DepthRange::Wide, ..*carmine }),
            "carmine-109-near" => Self::Carmine109(Carmine109 { range: DepthRange::Near, ..*carmine }),
            "xtion" => Self::Matched(Matcher::XTION),
            "fetch-head" => Self::Matched(Matcher::FETCH_HEAD),
            "d435" => Self::Matched(Matcher::D435),
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
            Self::Matched(matcher) => matcher.apply(rendering, intrinsics, rng),
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

/// The pixel that (u, v) sees after a normal shift of `sigma` pixels each way, kept inside the image.
fn shifted(image: &DepthImage, u: usize, v: usize, sigma: f32, rng: &mut ChaCha8Rng) -> (usize, usize) {
    let mut move_by = |at: usize, size: usize| {
        // Rounded; the conversion stops at 0.
        ((at as f32 + sigma * normal(rng) + 0.5) as usize).min(size - 1)
    };
    (move_by(u, image.width()), move_by(v, image.height()))
}

#[cfg(test)]
mod planes;
#[cfg(test)]
mod tests;
