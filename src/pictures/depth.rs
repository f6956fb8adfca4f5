//! Depth as colours, with a bar that says what they mean.

use grip_sim::images::{DepthImage, RgbImage};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight};

use super::draw::fill;
use super::text::{draw_text, text_width};

/// Shares of the readings at which the colours end: single wrong readings beyond them take none of the range.
const SHARES: [f64; 2] = [0.005, 0.95];
/// The colours span at least this much, metres, so that a plane's noise does not look like hills.
const LEAST_SPAN_M: f32 = 0.05;
/// Height of the bar and its text, pixels.
const BAR: u32 = 24;

/// Depth as colours over the range of its own readings, near yellow to far blue, black where there is none; below it a bar with the
/// ends of the range in metres. Readings beyond the ends have the colours of the ends.
pub fn depth_picture(depth: &DepthImage) -> RgbImage {
    with_bar(&depth_colors(depth, range(depth)), range(depth))
}

/// The same without the bar, over `range`, metres.
pub fn depth_colors(depth: &DepthImage, range: [f32; 2]) -> RgbImage {
    let mut picture = RgbImage::new(depth.width() as u32, depth.height() as u32);
    for (pixel, &metres) in picture.pixels_mut().zip(depth.data()) {
        if metres > 0.0 {
            pixel.0 = color(metres, range);
        }
    }
    picture
}

/// From where to where the readings of `depth` lie, but for a few, metres; from 0 to 1 if there is none.
pub fn range(depth: &DepthImage) -> [f32; 2] {
    let mut readings: Vec<f32> = depth.data().iter().copied().filter(|&metres| metres > 0.0).collect();
    if readings.is_empty() {
        return [0.0, 1.0];
    }
    let last = readings.len() - 1;
    let [near, far] = SHARES.map(|share| {
        let place = (share * last as f64).round() as usize;
        *readings.select_nth_unstable_by(place, f32::total_cmp).1
    });
    let missing = (LEAST_SPAN_M - (far - near)).max(0.0) / 2.0;
    [(near - missing).max(0.0), far + missing]
}

/// The picture with the bar below it, which spans its width.
pub fn with_bar(picture: &RgbImage, [near, far]: [f32; 2]) -> RgbImage {
    const SIZE: RasterHeight = RasterHeight::Size16;
    const GAP: u32 = 6;
    let (width, height) = picture.dimensions();
    let mut whole = RgbImage::from_pixel(width, height + BAR, image::Rgb([255; 3]));
    image::imageops::replace(&mut whole, picture, 0, 0);
    let ends = [near, far].map(|metres| format!("{metres:.2} m"));
    let [left, right] = [0, 1].map(|end: usize| text_width(&ends[end], SIZE) + 2 * GAP);
    let y = height + (BAR - SIZE.val() as u32) / 2;
    let ink = [27, 31, 36];
    draw_text(&mut whole, [GAP, y], &ends[0], SIZE, FontWeight::Regular, ink);
    let end = width.saturating_sub(right);
    draw_text(&mut whole, [end + GAP, y], &ends[1], SIZE, FontWeight::Regular, ink);
    for x in left..end {
        let share = (x - left) as f32 / (end - left) as f32;
        fill(&mut whole, [x, height + 5], [1, BAR - 10], color(near + share * (far - near), [near, far]));
    }
    whole
}

fn color(metres: f32, [near, far]: [f32; 2]) -> [u8; 3] {
    let share = ((far - metres) / (far - near).max(1e-6)).clamp(0.0, 1.0);
    let c = colorous::VIRIDIS.eval_continuous(f64::from(share));
    [c.r, c.g, c.b]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plane whose depth grows from row to row, a near wrong reading, a far one, and a hole.
    fn plane(from: f32, to: f32) -> DepthImage {
        let (width, height) = (200, 100);
        let mut depth = DepthImage::filled(width, height, 0.0);
        for v in 0..height {
            for u in 0..width {
                *depth.at_mut(u, v) = from + (to - from) * v as f32 / 99.0;
            }
        }
        *depth.at_mut(0, 0) = 0.0;
        *depth.at_mut(1, 0) = 0.05;
        *depth.at_mut(2, 99) = 60.0;
        depth
    }

    #[test]
    fn near_and_far_planes_use_all_colours_and_a_few_wrong_readings_take_none() {
        for (from, to) in [(0.2_f32, 0.45), (0.6, 1.4), (2.0, 5.0)] {
            let depth = plane(from, to);
            let [near, far] = range(&depth);
            let span = to - from;
            assert!((near - from).abs() < 0.02 * span && (far - to).abs() < 0.07 * span, "{near} {far}");
            let picture = depth_picture(&depth);
            let mut colours: Vec<[u8; 3]> = (0..100).map(|v| picture.get_pixel(100, v).0).collect();
            colours.dedup();
            assert!(colours.len() > 90, "only {} of 100 depths can be told apart", colours.len());
            assert_eq!(picture.get_pixel(0, 0).0, [0; 3], "no reading is black");
        }
    }

    #[test]
    fn the_bar_shows_the_colours_of_its_range() {
        let depth = plane(0.5, 1.5);
        let picture = depth_picture(&depth);
        assert_eq!(picture.dimensions(), (200, 100 + BAR));
        let middle = |x: u32| picture.get_pixel(x, 100 + BAR / 2).0;
        let near = |a: [u8; 3], b: [u8; 3]| a.iter().zip(b).all(|(a, b)| a.abs_diff(b) < 16);
        let end = text_width("0.50 m", RasterHeight::Size16) + 12;
        assert!(near(middle(end), picture.get_pixel(100, 1).0), "near end");
        assert!(near(middle(200 - end - 1), picture.get_pixel(100, 98).0), "far end");
        assert!(near(middle(100), picture.get_pixel(100, 49).0), "middle");
    }

    #[test]
    fn without_readings_all_is_black() {
        let picture = depth_colors(&DepthImage::filled(4, 3, 0.0), range(&DepthImage::filled(4, 3, 0.0)));
        assert!(picture.pixels().all(|p| p.0 == [0; 3]));
    }
}
