//! The animated replay.

use anyhow::{Context, Result};
use color_quant::NeuQuant;
use grip_sim::images::RgbImage;

/// How long a picture is shown, and the last one, hundredths of a second.
const SHOWN: u16 = 10;
const LAST_SHOWN: u16 = 200;
/// A colour this near to the one that is shown, in each channel, is not drawn anew: a third of the size.
const NEAR: u8 = 10;
/// The palette's last entry means "as before".
const SAME: u8 = 255;
/// Pixels that the palette is learnt from.
const SAMPLES: usize = 400_000;

/// An animated PNG that repeats. One palette for all pictures, and of each only the rectangle in which something changed, there only what
/// changed: small.
pub fn animation(pictures: &[RgbImage]) -> Result<Vec<u8>> {
    let first = pictures.first().context("no pictures")?;
    let (width, height) = first.dimensions();
    let all = pictures.len() * first.pixels().len();
    let sample: Vec<u8> = pictures
        .iter()
        .flat_map(RgbImage::pixels)
        .step_by(all.div_ceil(SAMPLES).max(1))
        .flat_map(|p| [p[0], p[1], p[2], 255])
        .collect();
    let colors = NeuQuant::new(1, usize::from(SAME), &sample);
    let mut palette = colors.color_map_rgb();
    palette.resize(3 * 256, 0);

    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette);
    let mut opacity = vec![255; 256];
    opacity[usize::from(SAME)] = 0;
    encoder.set_trns(opacity);
    encoder.set_compression(png::Compression::High);
    // Neighbouring indices say nothing of each other.
    encoder.set_filter(png::Filter::NoFilter);
    encoder.set_animated(u32::try_from(pictures.len())?, 0)?;
    encoder.set_blend_op(png::BlendOp::Over)?;
    encoder.set_dispose_op(png::DisposeOp::None)?;
    let mut writer = encoder.write_header()?;
    let mut shown: Vec<u8> = Vec::new();
    for (i, picture) in pictures.iter().enumerate() {
        let indices = followed(&colors, &shown, picture);
        let [left, top, right, bottom] = changed(&shown, &indices, width as usize);
        let (columns, rows) = (right - left, bottom - top);
        // A piece must lie in the picture at every moment.
        writer.reset_frame_position()?;
        writer.set_frame_dimension(columns as u32, rows as u32)?;
        writer.set_frame_position(left as u32, top as u32)?;
        writer.set_frame_delay(if i + 1 == pictures.len() { LAST_SHOWN } else { SHOWN }, 100)?;
        let piece: Vec<u8> = (top..bottom)
            .flat_map(|v| (left..right).map(move |u| v * width as usize + u))
            .map(|k| if shown.get(k) == Some(&indices[k]) { SAME } else { indices[k] })
            .collect();
        writer.write_image_data(&piece)?;
        shown = indices;
    }
    writer.finish()?;
    Ok(bytes)
}

/// The palette's nearest entries, but where what is shown is near enough: that stays. Light from the arm changes a little everywhere.
fn followed(colors: &NeuQuant, shown: &[u8], picture: &RgbImage) -> Vec<u8> {
    let near = |index: u8, p: [u8; 3]| {
        let color = colors.lookup(usize::from(index));
        color.is_some_and(|color| p.iter().zip(color).all(|(a, b)| a.abs_diff(b) <= NEAR))
    };
    // Pixels beside each other often are the same.
    let mut last = None;
    let mut nearest = |p: [u8; 3]| match last {
        Some((color, index)) if color == p => index,
        _ => {
            let index = colors.index_of(&[p[0], p[1], p[2], 255]) as u8;
            last = Some((p, index));
            index
        }
    };
    let keeps = |k: usize, p: [u8; 3]| shown.get(k).copied().filter(|&index| near(index, p));
    picture.pixels().enumerate().map(|(k, p)| keeps(k, p.0).unwrap_or_else(|| nearest(p.0))).collect()
}

/// The rectangle outside which `now` is as `before`, at least a pixel: left, top, right, bottom, the last two not in it.
fn changed(before: &[u8], now: &[u8], width: usize) -> [usize; 4] {
    let mut bounds = [usize::MAX, usize::MAX, 0, 0];
    for (k, _) in now.iter().enumerate().filter(|(k, index)| before.get(*k) != Some(*index)) {
        let (u, v) = (k % width, k / width);
        bounds = [bounds[0].min(u), bounds[1].min(v), bounds[2].max(u + 1), bounds[3].max(v + 1)];
    }
    if bounds[2] == 0 { [0, 0, 1, 1] } else { bounds }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_animation_is_read_back_with_what_did_not_change_left_out() {
        // A grey gradient, and a red square that moves on it, then stands.
        let frame = |at: u32| {
            RgbImage::from_fn(64, 48, |x, y| {
                let inside = x >= at && x < at + 8 && (10..18).contains(&y);
                image::Rgb(if inside { [220, 20, 20] } else { [(x * 3) as u8; 3] })
            })
        };
        let pictures: Vec<RgbImage> = (0..20).map(|i| frame(2 * i.min(17))).collect();
        let bytes = animation(&pictures).unwrap();
        assert!(bytes.len() < 20 * 64 * 48 / 8, "{}", bytes.len());
        let mut decoder = png::Decoder::new(std::io::Cursor::new(&bytes));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        assert_eq!(reader.info().animation_control.unwrap().num_frames, 20);
        let mut buffer = vec![0; 64 * 48 * 4];
        let mut shown = vec![0; 64 * 48 * 4];
        for (count, picture) in pictures.iter().enumerate() {
            reader.next_frame(&mut buffer).unwrap();
            let control = *reader.info().frame_control().unwrap();
            let [x, y, w, h] = [control.x_offset, control.y_offset, control.width, control.height];
            assert!(count == 0 || w * h <= 10 * 8, "frame {count}: {w} x {h}");
            for v in 0..h as usize {
                for u in 0..w as usize {
                    let from = 4 * (v * w as usize + u);
                    if buffer[from + 3] > 0 {
                        let to = 4 * ((y as usize + v) * 64 + x as usize + u);
                        shown[to..to + 4].copy_from_slice(&buffer[from..from + 4]);
                    }
                }
            }
            for (k, pixel) in picture.pixels().enumerate() {
                let off = (0..3).map(|c| shown[4 * k + c].abs_diff(pixel[c])).max().unwrap();
                assert!(off <= NEAR.max(12), "frame {count}, pixel {k}: off by {off}");
            }
        }
    }
}
