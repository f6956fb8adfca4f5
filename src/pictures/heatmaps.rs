//! What PyramidCNN says of an image, as a sheet: the most confident boxes, then a heat map for each object.

use grip_perception::{Detection, HeatMaps};
use grip_sim::images::RgbImage;
use image::imageops::{self, FilterType};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight};

use super::{color, draw_text, fill, sheet, text_width, write_text};

/// Width of a picture of the sheet, pixels.
const WIDTH: u32 = 320;
const COLUMNS: u32 = 4;
/// Pictures are drawn this dark under the heat.
const DIM: f32 = 0.45;

/// The sheet. A pixel is as hot as its hottest cell of any level; the scale is that of the root of the probability, so that
/// doubtful places are seen, too. `boxes` are classes and boxes.
pub fn heatmaps(rgb: &RgbImage, maps: &HeatMaps, boxes: &[(usize, Detection)]) -> RgbImage {
    let zoom = f64::from(WIDTH) / f64::from(rgb.width());
    let height = (f64::from(rgb.height()) * zoom).round().max(1.0) as u32;
    let small = imageops::resize(rgb, WIDTH, height, FilterType::Triangle);
    let mut pictures = vec![with_boxes(&small, zoom, maps, boxes)];
    for (i, object) in maps.description().objects.iter().enumerate() {
        let class = i + 1;
        let mut picture = small.clone();
        for (u, v, pixel) in picture.enumerate_pixels_mut() {
            let heat = hottest(maps, class, f64::from(u) / zoom, f64::from(v) / zoom).sqrt();
            let luma = DIM
                * (0.299 * f32::from(pixel.0[0])
                    + 0.587 * f32::from(pixel.0[1])
                    + 0.114 * f32::from(pixel.0[2]));
            let c = colorous::INFERNO.eval_continuous(f64::from(heat));
            pixel.0 = [c.r, c.g, c.b].map(|x| ((1.0 - heat) * luma + heat * f32::from(x)) as u8);
        }
        let most = maps.levels().iter().flat_map(|map| map.class(class)).fold(0.0_f32, |a, b| a.max(*b));
        write_text(&mut picture, &format!("{} {most:.3}", object.name));
        pictures.push(picture);
    }
    sheet(&pictures, COLUMNS)
}

/// The largest probability of a class at a pixel of the image, over the levels.
fn hottest(maps: &HeatMaps, class: usize, u: f64, v: f64) -> f32 {
    let stride = maps.description().stride_px as f64;
    let of_level = |map: &grip_perception::HeatMap| {
        let cell = |x: f64, scale: f64, count: usize| ((x * scale / stride) as usize).min(count - 1);
        let (row, column) = (cell(v, map.scale[1], map.rows), cell(u, map.scale[0], map.columns));
        map.class(class)[row * map.columns + column]
    };
    maps.levels().iter().map(of_level).fold(0.0, f32::max).clamp(0.0, 1.0)
}

fn with_boxes(small: &RgbImage, zoom: f64, maps: &HeatMaps, boxes: &[(usize, Detection)]) -> RgbImage {
    let mut picture = small.clone();
    // The most confident ones lie on top.
    for (class, detection) in boxes.iter().rev() {
        let [u0, v0, u1, v1] = detection.bbox.map(|x| (x * zoom).round().max(0.0) as u32);
        let (w, h) = (u1.saturating_sub(u0).max(2), v1.saturating_sub(v0).max(2));
        let line = color(*class as u16);
        for (at, size) in
            [([u0, v0], [w, 2]), ([u0, v0 + h - 2], [w, 2]), ([u0, v0], [2, h]), ([u0 + w - 2, v0], [2, h])]
        {
            fill(&mut picture, at, size, line);
        }
        let name = &maps.description().objects[class - 1].name;
        let number = name.split('_').next().unwrap_or(name);
        let text = format!("{number} {:.2}", detection.confidence);
        let size = [text_width(&text, RasterHeight::Size16), RasterHeight::Size16.val() as u32];
        let above = [u0.min(picture.width().saturating_sub(size[0])), v0.saturating_sub(size[1])];
        fill(&mut picture, above, size, line);
        draw_text(&mut picture, above, &text, RasterHeight::Size16, FontWeight::Bold, [0; 3]);
    }
    picture
}
