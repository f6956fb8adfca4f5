//! Pictures of others: PNG, JPEG and TIFF files, whole or refused.
//!
//! `image` decodes them. What it is lenient about is strict here: a JPEG that was cut off or garbled is an error and not half grey;
//! a picture that EXIF says to turn is turned or refused, and one that is not sRGB because a PNG declares another gamma is
//! converted.

use std::io::Cursor;
use std::path::Path;

use image::metadata::Orientation;
use image::{DynamicImage, GrayImage, ImageDecoder, ImageFormat, ImageReader, Limits, RgbImage};
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

use crate::files;
use crate::{Error, Result};

/// Pixels a side: more than any camera delivers, and less than a broken header says.
const LARGEST: u32 = 16_384;
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
            return Err(format!("is a picture in the format {other:?}; PNG, JPEG and TIFF are read: convert it"));
        }
        Err(_) => return Err("is no picture: PNG, JPEG and TIFF are read; check the file".into()),
    };
    let broken = |error: &dyn std::fmt::Display| format!("is not a whole {name} picture: {error}; copy or write it again");
    if format == ImageFormat::Jpeg {
        return jpeg(bytes).map_err(|error| broken(&error));
    }
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_image_width = Some(LARGEST);
    limits.max_image_height = Some(LARGEST);
    reader.limits(limits);
    let mut decoder = reader.into_decoder().map_err(|error| broken(&error))?;
    let orientation = decoder.orientation().map_err(|error| broken(&error))?;
    let image = DynamicImage::from_decoder(decoder).map_err(|error| broken(&error))?;
    let gamma = if format == ImageFormat::Png { gamma(bytes) } else { None };
    Ok(Picture { image, orientation, gamma })
}

/// `image` never asks this decoder to be strict, and without an end marker it takes a picture for whole.
fn jpeg(bytes: &[u8]) -> std::result::Result<Picture, String> {
    if !ends(bytes) {
        return Err("it ends before its end marker".into());
    }
    let text = |error: zune_jpeg::errors::DecodeErrors| error.to_string();
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(LARGEST as usize)
        .set_max_height(LARGEST as usize);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(text)?;
    let grey = decoder.input_colorspace() == Some(ColorSpace::Luma);
    let color = if grey { ColorSpace::Luma } else { ColorSpace::RGB };
    decoder.set_options(options.jpeg_set_out_colorspace(color));
    let orientation = decoder.exif().and_then(|chunk| Orientation::from_exif_chunk(chunk));
    let (width, height) = decoder.info().map(|info| (info.width, info.height)).ok_or("it has no size")?;
    let pixels = decoder.decode().map_err(text)?;
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

/// Whether a JPEG has its end marker, behind a scan; what follows it does not matter.
fn ends(bytes: &[u8]) -> bool {
    const START: u8 = 0xd8;
    const END: u8 = 0xd9;
    const SCAN: u8 = 0xda;
    let mut at = 2;
    let mut in_scan = false;
    loop {
        let Some(&[first, marker]) = bytes.get(at..at + 2) else { return false };
        match marker {
            _ if first != 0xff => at += 1,
            0xff => at += 1,
            END => return in_scan,
            // Stuffed zeros and restarts within a scan, and what has no length.
            0 | 1 | 0xd0..=START => at += 2,
            // A segment says how long it is.
            _ => {
                in_scan |= marker == SCAN;
                let Some(&[high, low]) = bytes.get(at + 2..at + 4) else { return false };
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
