//! Dark pictures, brightened for people.

use grip_sim::images::RgbImage;

/// A picture is dark when no more than this share of its pixels is brighter than [`DARK`].
const SHARE: f64 = 0.02;
/// 8-bit luma.
const DARK: f32 = 80.0;
/// What that pixel is brightened to.
const BRIGHT: f32 = 190.0;

/// A dark picture made brighter, and how many times; `None` where it is bright enough as it is. Its noise, which grows as well, is
/// smoothed. For people alone: nothing that decides sees it.
pub fn brightened(picture: &RgbImage) -> Option<(RgbImage, f32)> {
    let mut lumas: Vec<f32> = picture.pixels().map(|p| luma(p.0)).collect();
    let place = ((1.0 - SHARE) * lumas.len() as f64) as usize;
    if place >= lumas.len() {
        return None;
    }
    let high = *lumas.select_nth_unstable_by(place, f32::total_cmp).1;
    if high >= DARK {
        return None;
    }
    let gain = BRIGHT / high.max(1.0);
    // Where the noise is louder, more of it is smoothed away.
    let passes = (gain.log2() / 2.0).round().clamp(1.0, 3.0) as usize;
    let (width, height) = picture.dimensions();
    let mut channels: Vec<[f32; 3]> = picture.pixels().map(|p| p.0.map(f32::from)).collect();
    for _ in 0..passes {
        channels = smoothed(&channels, width as usize, height as usize);
    }
    let mut bright = RgbImage::new(width, height);
    for (pixel, channels) in bright.pixels_mut().zip(&channels) {
        pixel.0 = channels.map(|c| (gain * c).round().clamp(0.0, 255.0) as u8);
    }
    Some((bright, gain))
}

/// Each pixel with its neighbours, which weigh a half and a quarter of it.
fn smoothed(pixels: &[[f32; 3]], width: usize, height: usize) -> Vec<[f32; 3]> {
    let mut smooth = Vec::with_capacity(pixels.len());
    for y in 0..height {
        for x in 0..width {
            let mut sum = [0.0; 3];
            for (v, wy) in [(y.saturating_sub(1), 1.0), (y, 2.0), ((y + 1).min(height - 1), 1.0)] {
                for (u, wx) in [(x.saturating_sub(1), 1.0), (x, 2.0), ((x + 1).min(width - 1), 1.0)] {
                    for (sum, value) in sum.iter_mut().zip(pixels[v * width + u]) {
                        *sum += wx * wy / 16.0 * value;
                    }
                }
            }
            smooth.push(sum);
        }
    }
    smooth
}

/// `marked`, which is `picture` with marks drawn on it, with the marks on `ground` in place of the picture.
pub fn marks_on(ground: &RgbImage, picture: &RgbImage, marked: &RgbImage) -> RgbImage {
    let mut both = ground.clone();
    for ((pixel, before), after) in both.pixels_mut().zip(picture.pixels()).zip(marked.pixels()) {
        if before != after {
            *pixel = *after;
        }
    }
    both
}

fn luma([r, g, b]: [u8; 3]) -> f32 {
    0.299 * f32::from(r) + 0.587 * f32::from(g) + 0.114 * f32::from(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_dark_picture_is_brightened_and_keeps_what_it_shows() {
        let ramp = |most: u32| RgbImage::from_fn(160, 20, |x, _| image::Rgb([(most * x / 159) as u8; 3]));
        assert!(brightened(&ramp(255)).is_none());
        let (bright, gain) = brightened(&ramp(20)).unwrap();
        assert!((gain - 9.5).abs() < 0.6, "{gain}");
        let row: Vec<u8> = (0..160).map(|x| bright.get_pixel(x, 10).0[0]).collect();
        assert!(row.windows(2).all(|pair| pair[0] <= pair[1]), "darker stays darker");
        assert!(row[0] < 10 && row[158] > 180, "{row:?}");
        // Where all is black there is nothing to be seen, and no division by nothing.
        assert!(brightened(&RgbImage::new(8, 8)).unwrap().0.pixels().all(|p| p.0 == [0; 3]));
        assert!(brightened(&RgbImage::new(0, 0)).is_none());
    }

    #[test]
    fn marks_lie_on_the_brightened_picture() {
        let dark = RgbImage::from_pixel(8, 8, image::Rgb([10; 3]));
        let mut marked = dark.clone();
        marked.put_pixel(3, 4, image::Rgb([255, 0, 0]));
        let bright = brightened(&dark).unwrap().0;
        let both = marks_on(&bright, &dark, &marked);
        assert_eq!(both.get_pixel(3, 4).0, [255, 0, 0]);
        assert_eq!(both.get_pixel(5, 4).0, bright.get_pixel(5, 4).0);
    }
}
