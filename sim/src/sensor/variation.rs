//! Another camera for each picture: how a real one's colour and depth image differ from what [`super::sense`] makes of a scene.
//!
//! For data sets on which estimators are to be told apart, and on which they are tuned for real pictures without looking at
//! any. Ranges are of common RGB-D cameras and their drivers: automatic exposure and white balance that err, tone curves,
//! sharpening, JPEG compression; colour that lies some pixels beside depth; one of several depth cameras.

use image::codecs::jpeg::{JpegDecoder, JpegEncoder};
use image::imageops;
use image::{DynamicImage, ExtendedColorType, ImageEncoder, ImageResult, Rgb32FImage};
use nalgebra::Vector2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::depth::{Carmine109, DepthNoise, Matcher};
use super::normal::normal;
use crate::frame::CameraFrame;
use crate::images::RgbImage;
use crate::render::srgb::{LINEAR_OF_8BIT, from_linear};

/// Standard deviation of exposure, stops.
const EXPOSURE_STOPS: f32 = 0.8;
/// Of the logarithm of each channel's gain.
const WHITE_BALANCE: f32 = 0.15;
/// Contrast and saturation are drawn from these ranges,
const CONTRAST: [f32; 2] = [0.9, 1.35];
const SATURATION: [f32; 2] = [0.7, 1.5];
/// blur (standard deviation, pixels), sharpening (share of what a blur of 1.5 pixels takes away),
const BLUR_PX: [f32; 2] = [0.4, 1.5];
const SHARPENING: [f32; 2] = [0.0, 1.5];
const SHARPENED_PX: f32 = 1.5;
/// noise (standard deviation, of code values from 0 to 1), quality of the compression,
const NOISE: [f32; 2] = [0.005, 0.04];
const JPEG_QUALITY: [u8; 2] = [40, 95];
/// and the shift of colour against depth, pixels along each side.
const SHIFT_PX: [f32; 2] = [-4.0, 4.0];
/// The depth cameras there are.
const DEPTH_CAMERAS: [DepthNoise; 4] = [
    DepthNoise::Matched(Matcher::XTION),
    DepthNoise::Matched(Matcher::FETCH_HEAD),
    DepthNoise::Matched(Matcher::D435),
    DepthNoise::Carmine109(Carmine109::WIDE),
];

/// What is peculiar to the camera of one picture.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraVariation {
    /// Factor of each channel's linear light: exposure and white balance.
    pub gain: [f32; 3],
    /// Factors about middle grey, and about grey of the same brightness.
    pub contrast: f32,
    #[expect(missing_docs, reason = "with contrast")]
    pub saturation: f32,
    /// Standard deviation, pixels.
    pub blur_px: f32,
    /// Share of an unsharp mask.
    pub sharpening: f32,
    /// Standard deviation, code values from 0 to 1.
    pub noise: f32,
    /// Of the compression, 1 to 100.
    pub jpeg_quality: u8,
    /// Of colour against depth, pixels to the right and down.
    pub shift_px: [f32; 2],
    /// How its depth is noisy.
    pub depth_noise: DepthNoise,
}

impl CameraVariation {
    /// A camera by chance.
    pub fn drawn(rng: &mut ChaCha8Rng) -> Self {
        let within = |[low, high]: [f32; 2], rng: &mut ChaCha8Rng| low + (high - low) * rng.random::<f32>();
        let exposure = (EXPOSURE_STOPS * normal(rng)).exp2();
        let gain = [(); 3].map(|()| exposure * (WHITE_BALANCE * normal(rng)).exp());
        Self {
            gain,
            contrast: within(CONTRAST, rng),
            saturation: within(SATURATION, rng),
            blur_px: within(BLUR_PX, rng),
            sharpening: within(SHARPENING, rng),
            noise: within(NOISE, rng),
            jpeg_quality: rng.random_range(JPEG_QUALITY[0]..=JPEG_QUALITY[1]),
            shift_px: [within(SHIFT_PX, rng), within(SHIFT_PX, rng)],
            depth_noise: DEPTH_CAMERAS[rng.random_range(0..DEPTH_CAMERAS.len())],
        }
    }

    /// The frame as this camera takes it.
    ///
    /// # Errors
    /// When the picture cannot be compressed: it has no pixels, or more than 65535 a side.
    pub fn applied(&self, frame: &CameraFrame, rng: &mut ChaCha8Rng) -> ImageResult<CameraFrame> {
        Ok(CameraFrame { rgb: self.colour(&frame.rgb, rng)?, ..frame.clone() })
    }

    fn colour(&self, rgb: &RgbImage, rng: &mut ChaCha8Rng) -> ImageResult<RgbImage> {
        let toned = Rgb32FImage::from_fn(rgb.width(), rgb.height(), |u, v| {
            let pixel = rgb.get_pixel(u, v).0;
            let code = [0, 1, 2].map(|c| {
                let light = LINEAR_OF_8BIT[usize::from(pixel[c])] * self.gain[c];
                let code = from_linear(light.clamp(0.0, 1.0));
                ((code - 0.5) * self.contrast + 0.5).clamp(0.0, 1.0)
            });
            let grey = code.iter().sum::<f32>() / 3.0;
            image::Rgb(code.map(|c| (grey + (c - grey) * self.saturation).clamp(0.0, 1.0)))
        });
        let mut taken = imageops::blur(&toned, self.blur_px);
        let soft = imageops::blur(&taken, SHARPENED_PX);
        for (code, soft) in taken.iter_mut().zip(soft.iter()) {
            *code += self.sharpening * (*code - soft) + self.noise * normal(rng);
        }
        let (width, height) = (rgb.width(), rgb.height());
        let shifted = RgbImage::from_fn(width, height, |u, v| {
            let at = Vector2::new(u as f32, v as f32) - Vector2::from(self.shift_px);
            let most = Vector2::new(width as f32 - 1.0, height as f32 - 1.0);
            let at = at.sup(&Vector2::zeros()).inf(&most);
            let code = imageops::interpolate_bilinear(&taken, at.x, at.y).map_or([0.0; 3], |p| p.0);
            image::Rgb(code.map(|c| (255.0 * c.clamp(0.0, 1.0) + 0.5) as u8))
        });
        compressed(&shifted, self.jpeg_quality)
    }
}

/// As JPEG leaves it.
fn compressed(rgb: &RgbImage, quality: u8) -> ImageResult<RgbImage> {
    let mut file = Vec::new();
    JpegEncoder::new_with_quality(&mut file, quality).write_image(
        rgb.as_raw(),
        rgb.width(),
        rgb.height(),
        ExtendedColorType::Rgb8,
    )?;
    let decoder = JpegDecoder::new(std::io::Cursor::new(file))?;
    Ok(DynamicImage::from_decoder(decoder)?.into_rgb8())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Intrinsics;
    use crate::images::DepthImage;
    use crate::pose::Pose;
    use crate::rng;

    /// A camera that changes nothing.
    fn plain() -> CameraVariation {
        CameraVariation {
            gain: [1.0; 3],
            contrast: 1.0,
            saturation: 1.0,
            blur_px: 0.4,
            sharpening: 0.0,
            noise: 0.0,
            jpeg_quality: 100,
            shift_px: [0.0; 2],
            depth_noise: DepthNoise::None,
        }
    }

    /// A bright square on a dark ground, 1 m away.
    fn frame() -> CameraFrame {
        let intrinsics = Intrinsics { width: 96, height: 64, ..Intrinsics::FETCH };
        let rgb = RgbImage::from_fn(96, 64, |u, v| {
            let inside = (40..56).contains(&u) && (24..40).contains(&v);
            image::Rgb(if inside { [200, 120, 60] } else { [60, 60, 60] })
        });
        let depth = DepthImage::filled(96, 64, 1.0);
        CameraFrame { rgb, depth, intrinsics, world_from_camera: Pose::identity() }
    }

    fn taken(variation: &CameraVariation) -> CameraFrame {
        variation.applied(&frame(), &mut rng::stream(1, "camera")).unwrap()
    }

    /// Mean position of what is bright, pixels. (Of what is red it would be another: JPEG spreads colour over two pixels.)
    fn middle(rgb: &RgbImage) -> [f32; 2] {
        let brightness =
            |[r, g, b]: [u8; 3]| 0.299 * f32::from(r) + 0.587 * f32::from(g) + 0.114 * f32::from(b);
        let bright = rgb.enumerate_pixels().filter(|(_, _, p)| brightness(p.0) > 98.0);
        let (n, x, y) =
            bright.fold((0.0, 0.0, 0.0), |s, (u, v, _)| (s.0 + 1.0, s.1 + u as f32, s.2 + v as f32));
        [x / n, y / n]
    }

    #[test]
    fn a_plain_camera_changes_next_to_nothing() {
        let (taken, given) = (taken(&plain()), frame());
        let off = || taken.rgb.iter().zip(given.rgb.iter()).map(|(a, b)| a.abs_diff(*b));
        let mean = off().map(f64::from).sum::<f64>() / off().count() as f64;
        // JPEG keeps colour at half resolution, which shows along edges.
        let same = off().filter(|off| *off <= 3).count() as f64 / off().count() as f64;
        assert!(mean < 2.0 && same > 0.9, "{mean} {same}");
        assert_eq!(taken.depth, given.depth);
    }

    #[test]
    fn gain_is_of_linear_light_and_colour_is_shifted_against_depth() {
        let darker = taken(&CameraVariation { gain: [0.5; 3], ..plain() });
        // 200 is 0.578 of linear light; half of it is 146.
        assert!(darker.rgb.get_pixel(48, 32).0[0].abs_diff(146) <= 2, "{:?}", darker.rgb.get_pixel(48, 32));
        let [x0, y0] = middle(&frame().rgb);
        // Neither blur nor sharpening moves anything.
        for (blur_px, sharpening) in [(0.4, 0.0), (0.9, 1.5), (1.5, 1.0)] {
            let still = taken(&CameraVariation { blur_px, sharpening, ..plain() });
            let [x, y] = middle(&still.rgb);
            assert!((x - x0).abs() < 0.3 && (y - y0).abs() < 0.3, "{blur_px}: {x} {y}");
        }
        let shifted = taken(&CameraVariation { shift_px: [4.0, -2.0], ..plain() });
        let [x, y] = middle(&shifted.rgb);
        assert!((x - x0 - 4.0).abs() < 0.3 && (y - y0 + 2.0).abs() < 0.3, "{x} {y}");
    }

    #[test]
    fn cameras_differ_and_are_drawn_again_from_the_same_seed() {
        let drawn = |seed: u64| CameraVariation::drawn(&mut rng::stream(seed, "camera"));
        assert_eq!(drawn(1), drawn(1));
        assert_ne!(drawn(1), drawn(2));
        let gains: Vec<f32> = (0..200).map(|seed| drawn(seed).gain[1].log2()).collect();
        let mean = gains.iter().sum::<f32>() / 200.0;
        let spread = (gains.iter().map(|g| (g - mean).powi(2)).sum::<f32>() / 200.0).sqrt();
        // Of exposure and white balance together: sqrt(0.8^2 + (0.15 / ln 2)^2).
        assert!(mean.abs() < 0.2 && (spread - 0.83).abs() < 0.12, "{mean} {spread}");
    }
}
