//! The colour camera: luminance to 8-bit sRGB by way of exposure, photons, electrons and gain.
//!
//! The model is EMVA 1288's: electrons follow light and exposure time; photon (shot) noise has the variance of the electrons, the
//! read-out adds its own; gain multiplies signal and noise alike. So a dark room gives a picture that is dim and noisy.

use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::RowStreams;
use super::normal::normal;
use crate::condition::{Condition, ExposureLimits};
use crate::images::{RadianceImage, RgbImage};
use crate::render::Lighting;
use crate::render::srgb::encode_8bit;

/// A colour sensor behind its lens.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ColorSensor {
    /// Electrons a pixel gathers in one second from 1 cd/m^2, 1 to 1e6. The default, 2560: f/2 lens of 90 % transmission (0.177 lux on
    /// the chip), 2.8 um pixels, 45 % quantum efficiency, 4.1e15 photons in a lumen second.
    pub electrons_per_nit_second: f64,
    /// Electrons at which a pixel is full, 100 to 1e6. Default 6000, usual for pixels of this size.
    pub full_well: f64,
    /// Read-out noise, electrons (standard deviation), 0 to 1000. Default 4.
    pub read_noise: f64,
    /// Steps of the analogue-digital converter, after gain, 255 to 65535. Default 1023 (10 bits).
    pub levels: f64,
    /// Mean signal that auto exposure aims at, as a share of full scale, 0.01 to 0.9. Default 0.18, photography's middle grey.
    pub target: f64,
    /// Share of a pixel's light that lens and demosaicing spread to each of its two neighbours along rows, and along
    /// columns, 0 to 0.33. Default 0.1, a point spread of 0.45 px (standard deviation).
    pub spread: f64,
    /// Share of the light's colour that white balance removes: 1 makes white paper white, 0 leaves it. Default 0.85.
    pub white_balance: f64,
}

impl Default for ColorSensor {
    fn default() -> Self {
        Self {
            electrons_per_nit_second: 2560.0,
            full_well: 6000.0,
            read_noise: 4.0,
            levels: 1023.0,
            target: 0.18,
            spread: 0.1,
            white_balance: 0.85,
        }
    }
}

/// The exposure at which a picture for people has photography's middle grey on average: [`develop`]'s second argument.
pub fn metered(radiance: &RadianceImage) -> f32 {
    let data = radiance.data();
    let sum: f64 = data.iter().map(|[r, g, b]| f64::from(r + g + b) / 3.0).sum();
    let mean = sum / data.len().max(1) as f64;
    if mean > 0.0 { (0.18 / mean) as f32 } else { 1.0 }
}

/// A picture for people, not for perception: no noise, no blur, white at a luminance of 1 / `exposure` cd/m^2.
pub fn develop(radiance: &RadianceImage, exposure: f32) -> RgbImage {
    let mut picture = RgbImage::new(radiance.width() as u32, radiance.height() as u32);
    for (pixel, light) in picture.pixels_mut().zip(radiance.data()) {
        pixel.0 = light.map(|c| encode_8bit((c * exposure).clamp(0.0, 1.0)));
    }
    picture
}

/// What auto exposure chose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    /// Seconds.
    pub time_s: f64,
    /// Factor, 1 or more.
    pub gain: f64,
}

/// Auto exposure never goes below this, seconds.
const SHORTEST_S: f64 = 1.0 / 8000.0;
/// Signal that one pixel in fifty may exceed, as a share of full scale: highlights may burn out, but not large parts.
const HIGHLIGHT: f64 = 1.5;
/// Share of pixels below the highlight.
const HIGHLIGHT_QUANTILE: f64 = 0.98;
/// Auto exposure looks at every n-th pixel of every n-th row.
const METER_STRIDE: usize = 4;

impl ColorSensor {
    /// Signal, as a share of full scale, of 1 cd/m^2 in one second at gain 1.
    fn sensitivity(&self) -> f64 {
        self.electrons_per_nit_second / self.full_well
    }

    /// Exposure time first, then gain, until the mean signal is [`ColorSensor::target`] or both are at their limits.
    pub fn auto_exposure(&self, radiance: &RadianceImage, limits: &ExposureLimits) -> Exposure {
        let mut luminance: Vec<f64> = (0..radiance.height())
            .step_by(METER_STRIDE)
            .flat_map(|v| (0..radiance.width()).step_by(METER_STRIDE).map(move |u| (u, v)))
            .map(|(u, v)| {
                let [r, g, b] = radiance.at(u, v).map(f64::from);
                // Rec. 709 luminance.
                0.2126 * r + 0.7152 * g + 0.0722 * b
            })
            .collect();
        luminance.sort_by(f64::total_cmp);
        let most = limits.max_time_s * limits.max_gain * self.sensitivity();
        let least = SHORTEST_S.min(limits.max_time_s) * self.sensitivity();
        let mean =
            |scale: f64| luminance.iter().map(|l| (l * scale).min(1.0)).sum::<f64>() / luminance.len() as f64;
        // The clipped mean grows with the scale; halve the interval, in stops.
        let (mut low, mut high) = (least, most.max(least));
        for _ in 0..40 {
            let middle = (low * high).sqrt();
            if mean(middle) < self.target {
                low = middle;
            } else {
                high = middle;
            }
        }
        let bright = luminance[((luminance.len() - 1) as f64 * HIGHLIGHT_QUANTILE) as usize];
        let scale = high.min(HIGHLIGHT / bright.max(1e-12)).max(least);
        let wanted = scale / self.sensitivity();
        let time_s = wanted.min(limits.max_time_s);
        Exposure { time_s, gain: (wanted / time_s).clamp(1.0, limits.max_gain) }
    }

    /// The 8-bit sRGB picture of `radiance` under auto exposure within the condition's limits.
    pub fn expose(&self, radiance: &RadianceImage, condition: &Condition, rng: &mut ChaCha8Rng) -> RgbImage {
        let exposure = self.auto_exposure(radiance, &condition.exposure);
        let white = self.white_balance(&condition.lighting);
        self.develop(radiance, exposure, white, rng)
    }

    /// The picture at a given exposure; `white` multiplies the channels.
    fn develop(
        &self,
        radiance: &RadianceImage,
        exposure: Exposure,
        white: [f32; 3],
        rng: &mut ChaCha8Rng,
    ) -> RgbImage {
        let (width, height) = (radiance.width(), radiance.height());
        let electrons_per_nit = (self.electrons_per_nit_second * exposure.time_s) as f32;
        let full_well = self.full_well as f32;
        let read_variance = (self.read_noise * self.read_noise) as f32;
        let levels = self.levels as f32;
        let codes_per_electron = (exposure.gain / self.full_well) as f32 * levels;
        // What each code of the converter becomes, by channel.
        let encoded: [Vec<u8>; 3] = white.map(|white| {
            (0..=self.levels as u32).map(|code| encode_8bit(code as f32 / levels * white)).collect()
        });
        let streams = RowStreams::new(rng);
        let mut pixels = vec![0_u8; 3 * width * height];
        pixels.par_chunks_mut(3 * width).enumerate().for_each(|(v, row)| {
            let mut rng = streams.row(v);
            let mut signal = blurred_row(radiance, v, self.spread as f32);
            for signal in signal.as_flattened_mut() {
                let electrons = (*signal * electrons_per_nit).clamp(0.0, full_well);
                // Poisson, by its normal limit: exact enough from ten electrons on, and read noise hides the rest.
                let noisy = electrons + normal(&mut rng) * (electrons + read_variance).sqrt();
                // To be rounded; below zero all is black.
                *signal = (noisy * codes_per_electron + 0.5).clamp(0.0, levels);
            }
            for (pixel, signal) in row.as_chunks_mut::<3>().0.iter_mut().zip(signal) {
                *pixel = [0, 1, 2].map(|c| encoded[c][signal[c] as usize]);
            }
        });
        let black = || RgbImage::new(width as u32, height as u32);
        RgbImage::from_raw(width as u32, height as u32, pixels).unwrap_or_else(black)
    }

    /// Gains, at least 1 each, that take most of the illuminant's colour out: an ideal automatic white balance, held back
    /// by [`ColorSensor::white_balance`] as real ones are.
    fn white_balance(&self, lighting: &Lighting) -> [f32; 3] {
        let mut light = [lighting.ambient_lux; 3];
        for source in &lighting.lights {
            let squared = (source.target - source.position).norm_squared().max(1e-4);
            for (sum, color) in light.iter_mut().zip(source.color) {
                *sum += color * source.intensity_cd / squared;
            }
        }
        let brightest = light.iter().copied().fold(0.0, f64::max);
        light.map(|channel| {
            // A channel without light cannot be brought back.
            let share = if brightest > 0.0 { (channel / brightest).max(0.1) } else { 1.0 };
            share.powf(-self.white_balance) as f32
        })
    }
}

/// Row `v` after each pixel has given `spread` of its light to each neighbour along rows and along columns.
fn blurred_row(radiance: &RadianceImage, v: usize, spread: f32) -> Vec<[f32; 3]> {
    let (width, height) = (radiance.width(), radiance.height());
    let row = |v: usize| &radiance.data()[v * width..(v + 1) * width];
    let mix = |a: [f32; 3], b: [f32; 3], c: [f32; 3]| -> [f32; 3] {
        [0, 1, 2].map(|i| b[i] + spread * (a[i] - 2.0 * b[i] + c[i]))
    };
    let (above, here, below) = (row(v.saturating_sub(1)), row(v), row((v + 1).min(height - 1)));
    // With a copy of the first and the last pixel beyond the ends.
    let mut column = Vec::with_capacity(width + 2);
    column.push(mix(above[0], here[0], below[0]));
    column.extend(above.iter().zip(here).zip(below).map(|((a, b), c)| mix(*a, *b, *c)));
    column.push(column[width]);
    column.windows(3).map(|w| mix(w[0], w[1], w[2])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::images::Image;
    use crate::render::Light;
    use crate::rng;
    use nalgebra::Vector3;

    fn limits(max_time_s: f64, max_gain: f64) -> ExposureLimits {
        ExposureLimits { max_time_s, max_gain }
    }

    /// A grey card.
    fn card(nits: f32) -> RadianceImage {
        Image::filled(320, 240, [nits; 3])
    }

    #[test]
    fn exposure_reaches_middle_grey_by_time_before_gain() {
        let sensor = ColorSensor::default();
        let bright = sensor.auto_exposure(&card(100.0), &limits(0.033, 8.0));
        assert_eq!(bright.gain, 1.0);
        let signal = 100.0 * bright.time_s * sensor.sensitivity();
        assert!((signal / 0.18 - 1.0).abs() < 0.01, "{signal}");
        let dim = sensor.auto_exposure(&card(4.0), &limits(0.033, 8.0));
        assert_eq!(dim.time_s, 0.033);
        assert!((4.0 * dim.time_s * dim.gain * sensor.sensitivity() / 0.18 - 1.0).abs() < 0.01);
        let night = sensor.auto_exposure(&card(0.1), &limits(0.033, 8.0));
        assert_eq!((night.time_s, night.gain), (0.033, 8.0));
    }

    #[test]
    fn noise_is_shot_plus_read_noise_times_gain() {
        let sensor = ColorSensor { levels: 1e6, ..Default::default() };
        let exposure = Exposure { time_s: 0.02, gain: 4.0 };
        let nits = 6.0_f32;
        let electrons = f64::from(nits) * 0.02 * sensor.electrons_per_nit_second;
        let picture = sensor.develop(&card(nits), exposure, [1.0; 3], &mut rng::stream(1, "t"));
        let values: Vec<f64> = picture
            .iter()
            .map(|&c| f64::from(crate::render::srgb::LINEAR_OF_8BIT[c as usize]) * 6000.0 / 4.0)
            .collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let sigma = (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt();
        let expected = (electrons + 16.0).sqrt();
        assert!((mean / electrons - 1.0).abs() < 0.01, "{mean} {electrons}");
        assert!((sigma / expected - 1.0).abs() < 0.03, "{sigma} {expected}");
    }

    #[test]
    fn the_dark_is_dim_and_noisy_but_not_black() {
        let sensor = ColorSensor::default();
        let condition = |ambient_lux, max_gain| Condition {
            lighting: Lighting { ambient_lux, ..Lighting::default() },
            exposure: limits(0.033, max_gain),
            ..Condition::default()
        };
        let statistics = |lux: f64| {
            // A card that reflects 40 %.
            let card = card((0.4 * lux / std::f64::consts::PI) as f32);
            let picture = sensor.expose(&card, &condition(lux, 16.0), &mut rng::stream(2, "t"));
            let count = picture.len() as f64;
            let mean = picture.iter().map(|&c| f64::from(c)).sum::<f64>() / count;
            let variance = picture.iter().map(|&c| (f64::from(c) - mean).powi(2)).sum::<f64>() / count;
            (mean, variance.sqrt())
        };
        let (day, day_noise) = statistics(400.0);
        let (night, night_noise) = statistics(1.0);
        assert!((day - 118.0).abs() < 4.0, "{day}");
        assert!((10.0..80.0).contains(&night), "{night}");
        assert!(night_noise > 4.0 * day_noise, "{day_noise} {night_noise}");
    }

    #[test]
    fn warm_light_is_mostly_balanced_away() {
        let lighting = Lighting {
            lights: vec![Light {
                position: Vector3::z(),
                target: Vector3::zeros(),
                intensity_cd: 100.0,
                color: [1.0, 0.8, 0.5],
                radius: 0.0,
                half_angle: 1.0,
                shadows: false,
            }],
            ..Lighting::default()
        };
        let white = ColorSensor::default().white_balance(&lighting);
        assert_eq!(white[0], 1.0);
        assert!(white[2] > 1.7 && white[2] < 2.0, "{white:?}");
    }

    #[test]
    fn pictures_do_not_depend_on_the_number_of_threads() {
        let take = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let exposure = Exposure { time_s: 0.01, gain: 1.0 };
            pool.install(|| {
                ColorSensor::default().develop(&card(50.0), exposure, [1.0; 3], &mut rng::stream(3, "t"))
            })
        };
        assert_eq!(take(1), take(3));
    }
}
