//! Lines, arrows and frames.

use grip_sim::images::RgbImage;

/// Fills a rectangle; what reaches out of the picture is cut off.
pub fn fill(picture: &mut RgbImage, [left, top]: [u32; 2], [width, height]: [u32; 2], color: [u8; 3]) {
    for y in top..(top + height).min(picture.height()) {
        for x in left..(left + width).min(picture.width()) {
            picture.put_pixel(x, y, image::Rgb(color));
        }
    }
}

/// A border inside the picture.
pub fn frame(picture: &mut RgbImage, thickness: u32, color: [u8; 3]) {
    let (width, height) = picture.dimensions();
    fill(picture, [0, 0], [width, thickness], color);
    fill(picture, [0, height.saturating_sub(thickness)], [width, thickness], color);
    fill(picture, [0, 0], [thickness, height], color);
    fill(picture, [width.saturating_sub(thickness), 0], [thickness, height], color);
}

/// A disc, smooth at its edge; pixels from the picture's corner, centres of pixels at whole numbers.
pub fn disc(picture: &mut RgbImage, at: [f64; 2], radius: f64, color: [u8; 3]) {
    line(picture, at, at, 2.0 * radius, color);
}

/// A line with round ends, smooth at its edges.
pub fn line(picture: &mut RgbImage, from: [f64; 2], to: [f64; 2], width: f64, color: [u8; 3]) {
    let reach = width / 2.0 + 1.0;
    let range = |a: f64, b: f64, length: u32| {
        let low = (a.min(b) - reach).floor().clamp(0.0, f64::from(length));
        let high = (a.max(b) + reach).ceil().clamp(-1.0, f64::from(length) - 1.0);
        low as u32..(high + 1.0) as u32
    };
    let along = [to[0] - from[0], to[1] - from[1]];
    let squared = along[0] * along[0] + along[1] * along[1];
    for y in range(from[1], to[1], picture.height()) {
        for x in range(from[0], to[0], picture.width()) {
            let off = [f64::from(x) - from[0], f64::from(y) - from[1]];
            let share = if squared > 0.0 { (off[0] * along[0] + off[1] * along[1]) / squared } else { 0.0 };
            let share = share.clamp(0.0, 1.0);
            let distance = (off[0] - share * along[0]).hypot(off[1] - share * along[1]);
            let cover = (width / 2.0 + 0.5 - distance).clamp(0.0, 1.0);
            if cover > 0.0 {
                let pixel = picture.get_pixel_mut(x, y);
                for (channel, color) in pixel.0.iter_mut().zip(color) {
                    let mixed = f64::from(*channel) * (1.0 - cover) + f64::from(color) * cover;
                    *channel = mixed.round() as u8;
                }
            }
        }
    }
}

/// A line with a head at `to`, edged in black.
pub fn arrow(picture: &mut RgbImage, from: [f64; 2], to: [f64; 2], width: f64, color: [u8; 3]) {
    let along = [to[0] - from[0], to[1] - from[1]];
    let length = along[0].hypot(along[1]);
    let head = if length > 1e-6 { (4.0 * width).min(0.6 * length) / length } else { 0.0 };
    let back = [to[0] - head * along[0], to[1] - head * along[1]];
    let side = [-0.55 * head * along[1], 0.55 * head * along[0]];
    let barb = |sign: f64| [back[0] + sign * side[0], back[1] + sign * side[1]];
    for (width, color) in [(width + 3.0, [0; 3]), (width, color)] {
        for start in [from, barb(1.0), barb(-1.0)] {
            line(picture, start, to, width, color);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_covers_its_length_by_its_width_and_what_leaves_the_picture_is_cut_off() {
        let mut picture = RgbImage::new(60, 40);
        line(&mut picture, [10.0, 20.0], [50.0, 20.0], 4.0, [200, 0, 0]);
        let ink: f64 = picture.pixels().map(|p| f64::from(p.0[0]) / 200.0).sum();
        let expected = 40.0 * 4.0 + std::f64::consts::PI * 4.0;
        assert!((ink - expected).abs() < 0.05 * expected, "{ink} {expected}");
        line(&mut picture, [-100.0, -50.0], [200.0, 90.0], 3.0, [0, 255, 0]);
        disc(&mut picture, [1e6, -1e6], 5.0, [255; 3]);
        arrow(&mut picture, [30.0, 5.0], [30.0, 5.0], 3.0, [0, 0, 255]);
        assert_eq!(picture.get_pixel(30, 20).0[0], 200);
    }

    #[test]
    fn a_frame_lies_along_the_edge() {
        let mut picture = RgbImage::new(9, 7);
        frame(&mut picture, 2, [255, 0, 0]);
        let red = picture.pixels().filter(|p| p.0 == [255, 0, 0]).count();
        assert_eq!(red, 9 * 7 - 5 * 3);
    }
}
