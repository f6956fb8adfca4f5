//! Pictures of others: PNG, JPEG and TIFF files, whole or refused.
//!
//! `image` decodes them. What it is lenient about is strict here: a JPEG that was cut off or garbled is an error and not half grey;
//! a picture that EXIF says to turn is turned or refused, and one that is not sRGB because a PNG declares another gamma is
//! converted.

use std::io::Cursor;
use std::path::Path;

use image::metadata::Orientation;
use image::{DynamicImage, GrayImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits, RgbImage};
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

use crate::files;
use crate::{Error, Result};

/// Pixels a side: more than any camera delivers, and less than a broken header says.
const LARGEST: u32 = 16_384;
/// Pixels altogether: what decoding takes stays under a gigabyte.
const MOST_PIXELS: u64 = 100_000_000;
/// Gamma of sRGB as PNG files say it, and how far others may be from it.
const SRGB_GAMMA: f32 = 0.454_55;
const SRGB_GAMMA_OFF: f32 = 0.02;

/// A colour or grey picture as 8-bit sRGB, upright: turned as its EXIF says, as a viewer shows it.
///
/// # Errors
/// If it cannot be read, or is not a whole picture of a known format.
pub fn upright(path: &Path) -> Result<RgbImage> {
    let Picture { mut image, orientation, gamma } = read(path)?;
    image.apply_orientation(orientation);
    rgb8(image, gamma).map_err(|reason| Error::invalid(path, reason))
}

/// A colour or grey picture as 8-bit sRGB, pixel by pixel as it is stored, as intrinsics and texture coordinates mean it.
///
/// # Errors
/// As [`upright`]; and if EXIF says to turn it, for then viewers and tools show different pictures.
pub fn stored(path: &Path) -> Result<RgbImage> {
    let Picture { image, orientation, gamma } = read(path)?;
    if orientation != Orientation::NoTransforms {
        return Err(Error::invalid(
            path,
            format!(
                "its EXIF orientation is {}, so that viewers turn it, but not all tools; turn the pixels and remove the tag",
                orientation.to_exif()
            ),
        ));
    }
    rgb8(image, gamma).map_err(|reason| Error::invalid(path, reason))
}

/// [`stored`], of the bytes of a picture that is part of another file, whatever its EXIF says.
///
/// # Errors
/// Why they are no whole picture; the caller names the file.
pub(crate) fn stored_bytes(bytes: &[u8]) -> std::result::Result<RgbImage, String> {
    let Picture { image, gamma, .. } = decode(bytes)?;
    rgb8(image, gamma)
}

/// The values of a picture that is no colour picture: of depth, or a mask.
///
/// # Errors
/// As [`upright`].
pub(crate) fn values(path: &Path) -> Result<DynamicImage> {
    Ok(read(path)?.image)
}

/// Width and height in pixels as stored, of the header alone.
///
/// # Errors
/// If it cannot be read or is no picture.
pub(crate) fn size(path: &Path) -> Result<[usize; 2]> {
    let file = std::fs::File::open(path).map_err(|reason| Error::io(path, reason))?;
    let known = ImageReader::new(std::io::BufReader::new(file)).with_guessed_format();
    match known.map_err(|reason| Error::io(path, reason))?.into_dimensions() {
        Ok((width, height)) => Ok([width as usize, height as usize]),
        // All that can be said of it says the decoder.
        Err(error) => Err(read(path).err().unwrap_or_else(|| Error::invalid(path, error.to_string()))),
    }
}

fn read(path: &Path) -> Result<Picture> {
    decode(&files::read(path)?).map_err(|reason| Error::invalid(path, reason))
}

/// A picture of a file.
pub(crate) struct Picture {
    pub image: DynamicImage,
    /// How it is to be turned to be upright.
    pub orientation: Orientation,
    /// What a PNG says of its values, unless they are sRGB.
    pub gamma: Option<f32>,
}

/// Decodes the bytes of a file.
///
/// # Errors
/// Why they are no whole picture, and what to try; the caller names the file.
pub(crate) fn decode(bytes: &[u8]) -> std::result::Result<Picture, String> {
    let (format, name) = match image::guess_format(bytes) {
        Ok(ImageFormat::Png) => (ImageFormat::Png, "PNG"),
        Ok(ImageFormat::Jpeg) => (ImageFormat::Jpeg, "JPEG"),
        Ok(ImageFormat::Tiff) => (ImageFormat::Tiff, "TIFF"),
        Ok(other) => {
            return Err(format!(
                "is a picture in the format {other:?}; PNG, JPEG and TIFF are read: convert it"
            ));
        }
        Err(_) => return Err("is no picture: PNG, JPEG and TIFF are read; check the file".into()),
    };
    let broken = |error: &dyn std::fmt::Display| {
        format!("is not a whole {name} picture: {error}; copy or write it again")
    };
    if format == ImageFormat::Jpeg {
        return jpeg(bytes).map_err(|error| broken(&error));
    }
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_image_width = Some(LARGEST);
    limits.max_image_height = Some(LARGEST);
    reader.limits(limits);
    let wrong = |error: ImageError| match error {
        ImageError::Unsupported(_) => format!(
            "is a {name} picture of a kind that is not read ({error}); save it with 8 or 16 bits, depth as 16-bit grey"
        ),
        _ => broken(&error),
    };
    let mut decoder = reader.into_decoder().map_err(wrong)?;
    let (width, height) = decoder.dimensions();
    check_size(width.into(), height.into()).map_err(|error| broken(&error))?;
    let orientation = decoder.orientation().map_err(wrong)?;
    let image = DynamicImage::from_decoder(decoder).map_err(wrong)?;
    let gamma = if format == ImageFormat::Png { gamma(bytes) } else { None };
    Ok(Picture { image, orientation, gamma })
}

fn check_size(width: u64, height: u64) -> std::result::Result<(), String> {
    if width * height > MOST_PIXELS {
        return Err(format!("{width}x{height} pixels are more than the {MOST_PIXELS} that are supported"));
    }
    Ok(())
}

/// `image` never asks this decoder to be strict, and without an end marker it takes a picture for whole.
fn jpeg(bytes: &[u8]) -> std::result::Result<Picture, String> {
    let end = end(bytes).ok_or("it ends before its end marker")?;
    let text = |error: zune_jpeg::errors::DecodeErrors| error.to_string();
    let options = DecoderOptions::default().set_max_width(LARGEST as usize).set_max_height(LARGEST as usize);
    let strict = options.set_strict_mode(true);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), strict);
    decoder.decode_headers().map_err(text)?;
    let grey = decoder.input_colorspace() == Some(ColorSpace::Luma);
    let color = if grey { ColorSpace::Luma } else { ColorSpace::RGB };
    decoder.set_options(strict.jpeg_set_out_colorspace(color));
    let orientation = decoder.exif().and_then(|chunk| Orientation::from_exif_chunk(chunk));
    let (width, height) = decoder.info().map(|info| (info.width, info.height)).ok_or("it has no size")?;
    check_size(width.into(), height.into())?;
    // A block of 64 pixels takes a bit at the very least.
    if u64::from(width) * u64::from(height) > 64 * 8 * bytes.len() as u64 {
        return Err(format!("it has {} bytes for {width}x{height} pixels", bytes.len()));
    }
    let pixels = decoder.decode().map_err(text)?;
    // At the end marker the decoder goes on with zeros as long as it lacks pixels: whether it did, other bytes show in their place.
    let longer = [&bytes[..end], &[0x5a; 256], &bytes[end..]].concat();
    let lenient = options.set_strict_mode(false).jpeg_set_out_colorspace(color);
    if JpegDecoder::new_with_options(ZCursor::new(&longer), lenient).decode().ok().as_ref() != Some(&pixels) {
        return Err("its end marker comes before its last pixels".into());
    }
    let (width, height) = (u32::from(width), u32::from(height));
    let image = if grey {
        GrayImage::from_raw(width, height, pixels).map(DynamicImage::ImageLuma8)
    } else {
        RgbImage::from_raw(width, height, pixels).map(DynamicImage::ImageRgb8)
    };
    Ok(Picture {
        image: image.ok_or("it has fewer pixels than its header says")?,
        orientation: orientation.unwrap_or(Orientation::NoTransforms),
        gamma: None,
    })
}

/// Where the end marker of a JPEG is, behind a scan; what follows it does not matter.
fn end(bytes: &[u8]) -> Option<usize> {
    const START: u8 = 0xd8;
    const END: u8 = 0xd9;
    const SCAN: u8 = 0xda;
    let mut at = 2;
    let mut in_scan = false;
    loop {
        let &[first, marker] = bytes.get(at..at + 2)? else { return None };
        match marker {
            _ if first != 0xff => at += 1,
            0xff => at += 1,
            END => return in_scan.then_some(at),
            // Stuffed zeros and restarts within a scan, and what has no length.
            0 | 1 | 0xd0..=START => at += 2,
            // A segment says how long it is.
            _ => {
                in_scan |= marker == SCAN;
                let &[high, low] = bytes.get(at + 2..at + 4)? else { return None };
                at += 2 + usize::from(u16::from_be_bytes([high, low])).max(2);
            }
        }
    }
}

/// The gamma of a PNG that declares one and no sRGB.
fn gamma(bytes: &[u8]) -> Option<f32> {
    let reader = png::Decoder::new(Cursor::new(bytes)).read_info().ok()?;
    let info = reader.info();
    let gamma = info.gama_chunk.filter(|_| info.srgb.is_none())?.into_value();
    (gamma > 0.0 && (gamma - SRGB_GAMMA).abs() > SRGB_GAMMA_OFF).then_some(gamma)
}

/// As 8-bit sRGB.
fn rgb8(image: DynamicImage, gamma: Option<f32>) -> std::result::Result<RgbImage, String> {
    if matches!(image, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_)) {
        return Err("holds colours as floating-point numbers, whose range is not known; save it with 8 bits a channel".into());
    }
    let mut rgb = image.into_rgb8();
    if let Some(gamma) = gamma {
        let table: Vec<u8> = (0..=255u8)
            .map(|value| (255.0 * (f32::from(value) / 255.0).powf(SRGB_GAMMA / gamma)).round() as u8)
            .collect();
        rgb.iter_mut().for_each(|value| *value = table[usize::from(*value)]);
    }
    Ok(rgb)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::ImageBuffer;

    /// Wider than high, each corner of another colour.
    fn corners() -> RgbImage {
        RgbImage::from_fn(48, 32, |x, y| {
            image::Rgb(match (x < 24, y < 16) {
                (true, true) => [250, 10, 10],
                (false, true) => [10, 250, 10],
                (true, false) => [10, 10, 250],
                (false, false) => [240, 240, 240],
            })
        })
    }

    fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    /// A JPEG with the EXIF tag `orientation`.
    fn tagged(orientation: u8) -> Vec<u8> {
        let jpeg = encoded(&corners().into(), ImageFormat::Jpeg);
        // Big-endian TIFF with one directory of one entry: 0x0112, a short.
        let exif = [
            b"Exif\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0".as_slice(),
            &[orientation, 0, 0, 0, 0, 0, 0],
        ]
        .concat();
        let length = (exif.len() as u16 + 2).to_be_bytes();
        [&jpeg[..2], &[0xff, 0xe1], &length, &exif, &jpeg[2..]].concat()
    }

    fn written(name: &str, bytes: &[u8]) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        (folder, path)
    }

    fn refused(bytes: &[u8], wanted: &str) {
        let (_keep, path) = written("a.png", bytes);
        let error = stored(&path).unwrap_err().to_string();
        assert!(error.contains(wanted) && error.contains("a.png"), "{wanted}: {error}");
    }

    #[test]
    fn a_picture_that_is_cut_off_is_refused_wherever_it_is_cut() {
        let noisy: DynamicImage = RgbImage::from_fn(64, 48, |x, y| {
            image::Rgb([(x * y * 7 % 251) as u8, (x * 31 % 253) as u8, (y * 57 % 247) as u8])
        })
        .into();
        for (format, name) in
            [(ImageFormat::Jpeg, "JPEG"), (ImageFormat::Png, "PNG"), (ImageFormat::Tiff, "TIFF")]
        {
            let bytes = encoded(&noisy, format);
            assert_eq!(decode(&bytes).unwrap().image.width(), 64);
            // A PNG ends with 12 bytes that say no more than that; TIFF may end with its directory, without which it is none.
            let last = if format == ImageFormat::Png { bytes.len() - 16 } else { bytes.len() - 1 };
            for length in (0..last).step_by(7).chain([last]) {
                let error =
                    decode(&bytes[..length]).err().unwrap_or_else(|| panic!("{name} of {length} bytes"));
                assert!(length < 64 || error.contains(name), "{name} of {length}: {error}");
            }
        }
    }

    #[test]
    fn a_jpeg_whose_middle_is_missing_or_other_bytes_is_refused() {
        let bytes = encoded(&corners().into(), ImageFormat::Jpeg);
        let end = &bytes[bytes.len() - 2..];
        assert_eq!(end, [0xff, 0xd9]);
        let middle = bytes.len() - 40;
        for length in (middle - 200..bytes.len() - 4).step_by(3) {
            assert!(
                decode(&[&bytes[..length], end].concat()).is_err(),
                "cut off at {length} and closed again"
            );
        }
        let mut other = bytes.clone();
        other[middle..middle + 2].copy_from_slice(&[0xff, 0xc4]);
        assert!(decode(&other).is_err(), "a marker among the pixels");
        assert!(decode(&[&bytes, b"more".as_slice()].concat()).is_ok(), "bytes behind the end do no harm");
    }

    #[test]
    fn exif_turns_a_picture_where_it_may_and_is_refused_where_pixels_count() {
        let close = |a: &RgbImage, b: &RgbImage| {
            a.dimensions() == b.dimensions()
                && a.pixels()
                    .zip(b.pixels())
                    .filter(|(a, b)| (0..3).any(|i| a[i].abs_diff(b[i]) > 60))
                    .count()
                    < 100
        };
        let mut sides = Vec::new();
        for orientation in 1..=8 {
            let (_keep, path) = written("t.jpg", &tagged(orientation));
            let turned = upright(&path).unwrap();
            let mut wanted: DynamicImage = corners().into();
            wanted.apply_orientation(Orientation::from_exif(orientation).unwrap());
            assert!(close(&turned, &wanted.into_rgb8()), "{orientation}");
            sides.push(turned.width());
            if orientation == 1 {
                assert!(close(&stored(&path).unwrap(), &corners()));
            } else {
                let error = stored(&path).unwrap_err().to_string();
                assert!(error.contains(&format!("EXIF orientation is {orientation}")), "{error}");
            }
            assert_eq!(size(&path).unwrap(), [48, 32]);
        }
        assert_eq!(sides, [48, 48, 48, 48, 32, 32, 32, 32]);
    }

    /// A linear picture looks as dark as it says it is not: half the light is 188 in sRGB.
    #[test]
    fn a_png_of_another_gamma_is_converted() {
        let picture = |gamma: Option<f32>| {
            let mut bytes = Vec::new();
            let mut encoder = png::Encoder::new(&mut bytes, 2, 1);
            encoder.set_color(png::ColorType::Rgb);
            if let Some(gamma) = gamma {
                encoder.set_source_gamma(png::ScaledFloat::new(gamma));
            }
            encoder.write_header().unwrap().write_image_data(&[0, 128, 255, 64, 32, 16]).unwrap();
            let (_keep, path) = written("g.png", &bytes);
            stored(&path).unwrap().into_raw()
        };
        assert_eq!(picture(None), [0, 128, 255, 64, 32, 16]);
        assert_eq!(picture(Some(0.45455)), [0, 128, 255, 64, 32, 16]);
        let linear = picture(Some(1.0));
        assert_eq!((linear[0], linear[2]), (0, 255));
        assert!(linear[1].abs_diff(187) <= 1, "{linear:?}");
    }

    #[test]
    fn tiff_is_read_and_what_is_no_picture_of_ours_is_told_apart() {
        let grey: ImageBuffer<image::Luma<u16>, Vec<u16>> =
            ImageBuffer::from_fn(5, 3, |x, y| image::Luma([(x * 1000 + y) as u16]));
        let bytes = encoded(&grey.clone().into(), ImageFormat::Tiff);
        let (_keep, path) = written("d.tif", &bytes);
        assert_eq!(values(&path).unwrap().into_luma16(), grey);
        refused(b"GIF89a\x01\0\x01\0\0\0\0", "format Gif; PNG, JPEG and TIFF are read");
        refused(b"BM", "format Bmp");
        refused(b"\0\0\0\0", "is no picture");
        refused(b"version https://git-lfs.github.com/spec/v1\n", "git lfs pull");
        let float: DynamicImage = ImageBuffer::from_pixel(2, 2, image::Rgb([0.5f32, 2.0, -1.0])).into();
        refused(&encoded(&float, ImageFormat::Tiff), "floating-point");
        let huge = {
            let mut bytes = Vec::new();
            png::Encoder::new(&mut bytes, 100_000, 100_000).write_header().unwrap();
            bytes
        };
        refused(&huge, "PNG");
        // A JPEG of a few bytes that says to be large is no work.
        let mut bytes = encoded(&corners().into(), ImageFormat::Jpeg);
        let frame = bytes.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap();
        bytes[frame + 5..frame + 9].copy_from_slice(&[0x20, 0, 0x20, 0]);
        refused(&bytes, "bytes for 8192x8192 pixels");
    }
}
