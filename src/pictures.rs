//! Pictures for people and files for tools: colour, depth, labels and overlays as PNG bytes.

mod bright;
pub mod camera;
mod depth;
mod draw;
mod grasps;
mod heatmaps;
mod plan;
mod solid;
mod text;

use anyhow::{Context, Result};
use grip_sim::images::{DepthImage, LabelImage, RgbImage};
use image::{ExtendedColorType, ImageEncoder, codecs::jpeg::JpegEncoder, codecs::png::PngEncoder};

pub use bright::{brightened, marks_on};
pub use depth::depth_picture;
pub use draw::{arrow, disc, fill, frame, line};
pub use grasps::grasps;
pub use heatmaps::heatmaps;
pub use plan::plan;
pub use text::{Tone, caption, captioned, draw_text, label, text_width, write_text};

/// Marks what went wrong.
pub const BAD: [u8; 3] = [190, 30, 22];

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

/// Pictures beside and below each other, `columns` in a row, with a thin white gap. A row is as high as its highest picture, a column
/// as wide as its widest.
pub fn sheet(pictures: &[RgbImage], columns: u32) -> RgbImage {
    const GAP: u32 = 6;
    if pictures.is_empty() {
        return RgbImage::new(1, 1);
    }
    let columns = (columns as usize).clamp(1, pictures.len());
    let most = |sizes: &mut dyn Iterator<Item = u32>| sizes.max().unwrap_or(0);
    let widths: Vec<u32> = (0..columns)
        .map(|column| most(&mut pictures.iter().skip(column).step_by(columns).map(RgbImage::width)))
        .collect();
    let heights: Vec<u32> =
        pictures.chunks(columns).map(|row| most(&mut row.iter().map(RgbImage::height))).collect();
    let starts = |sizes: &[u32]| -> Vec<u32> {
        sizes.iter().scan(0, |at, size| Some(std::mem::replace(at, *at + size + GAP))).collect()
    };
    let whole = |sizes: &[u32]| sizes.iter().map(|size| size + GAP).sum::<u32>() - GAP;
    let (lefts, tops) = (starts(&widths), starts(&heights));
    let mut sheet = RgbImage::from_pixel(whole(&widths), whole(&heights), image::Rgb([255; 3]));
    for (i, picture) in pictures.iter().enumerate() {
        let (x, y) = (lefts[i % columns], tops[i / columns]);
        image::imageops::replace(&mut sheet, picture, i64::from(x), i64::from(y));
    }
    sheet
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
    fn a_sheet_makes_room_for_the_largest_picture_of_a_row_and_of_a_column() {
        let sizes = [(4, 3), (8, 9), (5, 2)];
        let pictures = sizes.map(|(w, h)| RgbImage::from_pixel(w, h, image::Rgb([0; 3])));
        let sheet = sheet(&pictures, 2);
        assert_eq!(sheet.dimensions(), (5 + 6 + 8, 9 + 6 + 2));
        let black = sheet.pixels().filter(|p| p.0 == [0; 3]).count();
        assert_eq!(black, 4 * 3 + 8 * 9 + 5 * 2, "no picture covers another");
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
