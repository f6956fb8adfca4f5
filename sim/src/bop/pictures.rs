//! Colour, 16-bit depth and masks: written as PNG, fast and the same every time; read from any format.

use std::path::Path;

use image::{DynamicImage, RgbImage};
use png::{BitDepth, ColorType, Compression, Filter};

use super::format::MILLIMETRE;
use crate::images::{DepthImage, Image};
use crate::pictures;
use crate::{Error, Result};

/// 8-bit RGB. `name` is for errors.
pub(super) fn encode_rgb(name: &Path, image: &RgbImage) -> Result<Vec<u8>> {
    let (width, height) = image.dimensions();
    encode(name, [width, height], ColorType::Rgb, BitDepth::Eight, Filter::Adaptive, image.as_raw())
}

/// 16-bit grey in units of `unit_mm` millimetres. What is not positive, or too far for 16 bits, becomes 0, no reading.
pub(super) fn encode_depth(name: &Path, depth: &DepthImage, unit_mm: f64) -> Result<Vec<u8>> {
    let per_metre = 1.0 / (unit_mm * MILLIMETRE);
    let bytes: Vec<u8> = depth
        .data()
        .iter()
        .flat_map(|&metres| {
            // Rounded; the cast makes NaN and what is negative 0.
            let units = (f64::from(metres) * per_metre + 0.5) as u64;
            u16::try_from(units).unwrap_or(0).to_be_bytes()
        })
        .collect();
    let size = [depth.width() as u32, depth.height() as u32];
    encode(name, size, ColorType::Grayscale, BitDepth::Sixteen, Filter::Adaptive, &bytes)
}

/// 8-bit grey, 255 where set.
pub(super) fn encode_mask(name: &Path, mask: &Image<bool>) -> Result<Vec<u8>> {
    let bytes: Vec<u8> = mask.data().iter().map(|&set| if set { 255 } else { 0 }).collect();
    let size = [mask.width() as u32, mask.height() as u32];
    // Most rows of a mask are as the one above: no other filter needs to be tried.
    encode(name, size, ColorType::Grayscale, BitDepth::Eight, Filter::Up, &bytes)
}

fn encode(
    name: &Path,
    [width, height]: [u32; 2],
    color: ColorType,
    depth: BitDepth,
    filter: Filter,
    bytes: &[u8],
) -> Result<Vec<u8>> {
    let failed = |error: png::EncodingError| Error::invalid(name, format!("cannot be encoded: {error}"));
    let mut file = Vec::with_capacity(bytes.len() / 2);
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.set_compression(Compression::Fast);
    encoder.set_filter(filter);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(bytes).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(file)
}

/// A 16-bit depth picture in metres; 0 stays 0.
pub(super) fn read_depth(path: &Path, unit_mm: f64) -> Result<DepthImage> {
    match pictures::values(path)? {
        DynamicImage::ImageLuma16(picture) => {
            let metres = |units: u16| (f64::from(units) * unit_mm * MILLIMETRE) as f32;
            let (width, height) = picture.dimensions();
            let data = picture.into_raw().into_iter().map(metres).collect();
            DepthImage::from_vec(width as usize, height as usize, data)
                .ok_or_else(|| Error::invalid(path, "has another number of pixels than its header says"))
        }
        other => Err(Error::invalid(
            path,
            format!(
                "is a picture of {:?}; depth must be 16-bit grey (L16), as RealSense and Kinect tools and BOP sets have it",
                other.color()
            ),
        )),
    }
}

/// A mask: set where not 0.
pub(super) fn read_mask(path: &Path) -> Result<Image<bool>> {
    let picture = pictures::values(path)?.into_luma8();
    let (width, height) = picture.dimensions();
    let data = picture.into_raw().into_iter().map(|value| value > 0).collect();
    Image::from_vec(width as usize, height as usize, data)
        .ok_or_else(|| Error::invalid(path, "has another number of pixels than its header says"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    /// A picture of soft shapes with the noise of a sensor on top.
    fn noisy(width: u32, height: u32) -> RgbImage {
        let mut rng = crate::rng::stream(1, "noisy picture");
        RgbImage::from_fn(width, height, |x, y| {
            let base = 120.0 + 60.0 * (x as f32 / 90.0).sin() + 40.0 * (y as f32 / 70.0).cos();
            image::Rgb(std::array::from_fn(|i| {
                let noise: f32 = (0..4).map(|_| rng.random::<f32>() - 0.5).sum();
                (base + 10.0 * i as f32 + 5.0 * noise).clamp(0.0, 255.0) as u8
            }))
        })
    }

    #[test]
    fn pictures_read_back_as_written_and_encode_fast() {
        let folder = tempfile::tempdir().unwrap();
        let rgb = noisy(640, 480);
        let mut rng = crate::rng::stream(2, "noisy depth");
        let mut depth = DepthImage::filled(640, 480, 0.0);
        for v in 0..480 {
            for u in 40..640 {
                *depth.at_mut(u, v) = 0.7 + 0.001 * v as f32 + 0.002 * rng.random::<f32>();
            }
        }
        let mut mask = Image::filled(640, 480, false);
        for v in 100..300 {
            (200 + v / 7..420).for_each(|u| *mask.at_mut(u, v) = true);
        }
        let time = |what: &str, encode: &dyn Fn() -> Vec<u8>| {
            let mut best = f64::MAX;
            let mut bytes = Vec::new();
            for _ in 0..8 {
                let start = std::time::Instant::now();
                bytes = encode();
                best = best.min(start.elapsed().as_secs_f64());
            }
            println!("{what}: {:.2} ms, {} kB", best * 1e3, bytes.len() / 1000);
            assert_eq!(bytes, encode(), "the same file every time");
            let path = folder.path().join(format!("{what}.png"));
            std::fs::write(&path, bytes).unwrap();
            path
        };
        let name = Path::new("test");
        let path = time("rgb", &|| encode_rgb(name, &rgb).unwrap());
        assert_eq!(pictures::stored(&path).unwrap(), rgb);
        let path = time("mask", &|| encode_mask(name, &mask).unwrap());
        assert_eq!(read_mask(&path).unwrap(), mask);
        for unit_mm in [1.0, 0.1] {
            let path = time("depth", &|| encode_depth(name, &depth, unit_mm).unwrap());
            let back = read_depth(&path, unit_mm).unwrap();
            for (a, b) in depth.data().iter().zip(back.data()) {
                assert!((a - b).abs() <= 0.5e-3 * unit_mm as f32 + 1e-6 && (*a > 0.0) == (*b > 0.0));
            }
        }
    }

    #[test]
    fn depths_that_cannot_be_told_become_no_reading() {
        let depth = DepthImage::from_vec(5, 1, vec![f32::NAN, -1.0, 66.0, 65.535, f32::INFINITY]).unwrap();
        let bytes = encode_depth(Path::new("test"), &depth, 1.0).unwrap();
        let picture = image::load_from_memory(&bytes).unwrap().into_luma16();
        assert_eq!(picture.into_raw(), [0, 0, 0, 65535, 0]);
    }
}
