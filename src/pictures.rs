//! Pictures for people and files for tools: colour, depth, labels and overlays as PNG bytes.

mod heatmaps;

use anyhow::{Context, Result};
use grip_sim::images::{DepthImage, LabelImage, RgbImage};
use image::{ExtendedColorType, ImageEncoder, codecs::jpeg::JpegEncoder, codecs::png::PngEncoder};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster};

pub use heatmaps::heatmaps;

/// Depth is drawn over this range, metres: what a head camera sees of a table.
const DRAWN_DEPTH_M: [f32; 2] = [0.5, 1.8];

/// The colour that stands for an object label in every picture and table.
pub fn color(label: u16) -> [u8; 3] {
    match label {
        0 => [0, 0, 0],
        grip_physics::ROBOT_LABEL => [110, 110, 120],
        n => {
            let c = colorous::CATEGORY10[(usize::from(n) - 1) % 10];
            [c.r, c.g, c.b]
        }
    }
}

/// 8-bit RGB.
pub fn rgb_png(image: &RgbImage) -> Result<Vec<u8>> {
    encode(image.as_raw(), image.width(), image.height(), ExtendedColorType::Rgb8)
}

/// 8-bit RGB for people: JPEG, a tenth of a PNG's size.
pub fn jpeg(image: &RgbImage) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, 88)
        .write_image(image.as_raw(), image.width(), image.height(), ExtendedColorType::Rgb8)
        .context("JPEG")?;
    Ok(bytes)
}

/// 16-bit grey, millimetres; 0 is no reading. Depths beyond 65.535 m count as no reading.
pub fn depth_png_mm(depth: &DepthImage) -> Result<Vec<u8>> {
    let bytes: Vec<u8> = depth
        .data()
        .iter()
        .map(|metres| (metres * 1000.0).round())
        .map(|mm| if (0.0..=65535.0).contains(&mm) { mm as u16 } else { 0 })
        .flat_map(u16::to_ne_bytes)
        .collect();
    encode(&bytes, depth.width() as u32, depth.height() as u32, ExtendedColorType::L16)
}

/// Depth as colours, near yellow to far blue; black is no reading.
pub fn depth_color(depth: &DepthImage) -> RgbImage {
    let [near, far] = DRAWN_DEPTH_M;
    let mut picture = RgbImage::new(depth.width() as u32, depth.height() as u32);
    for (pixel, &metres) in picture.pixels_mut().zip(depth.data()) {
        if metres > 0.0 {
            let share = ((far - metres) / (far - near)).clamp(0.0, 1.0);
            let c = colorous::VIRIDIS.eval_continuous(f64::from(share));
            pixel.0 = [c.r, c.g, c.b];
        }
    }
    picture
}

/// Labels as an indexed PNG: tools read the label as the index (Pillow mode `P`), people see colours.
pub fn labels_png(labels: &LabelImage) -> Result<Vec<u8>> {
    let indices: Vec<u8> = labels
        .data()
        .iter()
        .map(|&label| u8::try_from(label))
        .collect::<std::result::Result<_, _>>()
        .context("labels.png holds at most 255 labels")?;
    let palette: Vec<u8> = (0..=255u16).flat_map(color).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, labels.width() as u32, labels.height() as u32);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette);
    let mut writer = encoder.write_header().context("labels.png")?;
    writer.write_image_data(&indices).context("labels.png")?;
    writer.finish().context("labels.png")?;
    Ok(bytes)
}

/// Draws the border of every label of `believed` on a copy of `rgb`, two pixels wide, in the label's colour.
pub fn outlines(rgb: &RgbImage, believed: &LabelImage) -> RgbImage {
    let mut picture = rgb.clone();
    let (width, height) = (believed.width(), believed.height());
    for v in 1..height - 1 {
        for u in 1..width - 1 {
            let here = *believed.at(u, v);
            let neighbours = [(u - 1, v), (u + 1, v), (u, v - 1), (u, v + 1)];
            let border = neighbours.iter().map(|&(x, y)| *believed.at(x, y)).filter(|&l| l != here).max();
            if let Some(label) = border.map(|other| here.max(other)) {
                picture.put_pixel(u as u32, v as u32, image::Rgb(color(label)));
            }
        }
    }
    picture
}

/// Pictures of one size beside and below each other, `columns` in a row, with a thin white gap.
pub fn sheet(pictures: &[RgbImage], columns: u32) -> RgbImage {
    const GAP: u32 = 6;
    let Some(first) = pictures.first() else { return RgbImage::new(1, 1) };
    let (width, height) = (first.width() + GAP, first.height() + GAP);
    let columns = columns.clamp(1, pictures.len() as u32);
    let rows = (pictures.len() as u32).div_ceil(columns);
    let white = image::Rgb([255; 3]);
    let mut sheet = RgbImage::from_pixel(columns * width - GAP, rows * height - GAP, white);
    for (i, picture) in (0u32..).zip(pictures) {
        let (x, y) = (i % columns * width, i / columns * height);
        image::imageops::overlay(&mut sheet, picture, i64::from(x), i64::from(y));
    }
    sheet
}

/// Writes a line of text in the top left corner, white on black; characters beyond ASCII are left out.
pub fn write_text(picture: &mut RgbImage, text: &str) {
    const HEIGHT: RasterHeight = RasterHeight::Size16;
    fill(picture, [0, 0], [text_width(text, HEIGHT), HEIGHT.val() as u32], [0; 3]);
    draw_text(picture, [0, 0], text, HEIGHT, FontWeight::Regular, [255; 3]);
}

/// Writes a line of text over the picture with its top left corner at `at`; what reaches out of the picture is cut off.
pub fn draw_text(
    picture: &mut RgbImage,
    at: [u32; 2],
    text: &str,
    height: RasterHeight,
    weight: FontWeight,
    ink: [u8; 3],
) {
    let mut left = at[0];
    for raster in text.chars().filter_map(|letter| get_raster(letter, weight, height)) {
        for (y, row) in (at[1]..).zip(raster.raster()) {
            for (x, &value) in (left..).zip(row.iter()) {
                if let Some(pixel) = picture.get_pixel_mut_checked(x, y) {
                    for (channel, ink) in pixel.0.iter_mut().zip(ink) {
                        let (below, above, share) = (u32::from(*channel), u32::from(ink), u32::from(value));
                        *channel = ((below * (255 - share) + above * share + 127) / 255) as u8;
                    }
                }
            }
        }
        left += raster.width() as u32;
    }
}

/// Width of a line of text, pixels.
pub fn text_width(text: &str, height: RasterHeight) -> u32 {
    let letters = text.chars().filter_map(|letter| get_raster(letter, FontWeight::Regular, height));
    letters.map(|raster| raster.width() as u32).sum()
}

/// Fills a rectangle; what reaches out of the picture is cut off.
pub fn fill(picture: &mut RgbImage, [left, top]: [u32; 2], [width, height]: [u32; 2], color: [u8; 3]) {
    for y in top..(top + height).min(picture.height()) {
        for x in left..(left + width).min(picture.width()) {
            picture.put_pixel(x, y, image::Rgb(color));
        }
    }
}

fn encode(bytes: &[u8], width: u32, height: u32, kind: ExtendedColorType) -> Result<Vec<u8>> {
    let mut png = Vec::new();
    PngEncoder::new(&mut png).write_image(bytes, width, height, kind).context("cannot encode a PNG")?;
    Ok(png)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_stored_in_millimetres_and_holes_stay_zero() {
        let depth = DepthImage::from_vec(2, 1, vec![0.0, 1.2345]).unwrap();
        let png = image::load_from_memory(&depth_png_mm(&depth).unwrap()).unwrap().into_luma16();
        assert_eq!(png.as_raw(), &[0, 1235]);
        assert_eq!(depth_color(&depth).get_pixel(0, 0).0, [0, 0, 0]);
    }

    #[test]
    fn labels_are_read_back_as_indices() {
        let labels = LabelImage::from_vec(3, 1, vec![0, 2, 255]).unwrap();
        let png = labels_png(&labels).unwrap();
        let mut decoder = png::Decoder::new(std::io::Cursor::new(png));
        decoder.set_transformations(png::Transformations::IDENTITY);
        let mut reader = decoder.read_info().unwrap();
        let mut indices = vec![0; 3];
        reader.next_frame(&mut indices).unwrap();
        assert_eq!(indices, [0, 2, 255]);
    }

    #[test]
    fn a_sheet_holds_all_pictures_in_rows() {
        let red = RgbImage::from_pixel(4, 3, image::Rgb([255, 0, 0]));
        let sheet = sheet(&[red.clone(), red.clone(), red], 2);
        assert_eq!(sheet.dimensions(), (4 + 6 + 4, 3 + 6 + 3));
        assert_eq!(sheet.get_pixel(10, 0).0, [255, 0, 0]);
        assert_eq!(sheet.get_pixel(0, 9).0, [255, 0, 0]);
        assert_eq!(sheet.get_pixel(10, 9).0, [255, 255, 255]);
    }

    #[test]
    fn outlines_follow_the_border() {
        let rgb = RgbImage::new(8, 8);
        let mut believed = LabelImage::filled(8, 8, 0);
        for v in 3..6 {
            for u in 3..6 {
                *believed.at_mut(u, v) = 1;
            }
        }
        let picture = outlines(&rgb, &believed);
        assert_eq!(picture.get_pixel(3, 4).0, color(1));
        assert_eq!(picture.get_pixel(4, 4).0, [0, 0, 0]);
    }
}
