//! Text in pictures and around them. Nothing is cut: a caption grows by lines, and words stay whole.

use grip_sim::images::RgbImage;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster};

use super::draw::fill;

/// A caption's colours: of the strip and of the text on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// Of a picture.
    Plain,
    /// Of several pictures.
    Title,
    /// Of what went wrong.
    Bad,
}

impl Tone {
    fn colors(self) -> [[u8; 3]; 2] {
        match self {
            Self::Plain => [[255; 3], [27, 31, 36]],
            Self::Title => [[27, 31, 36], [255; 3]],
            Self::Bad => [super::BAD, [255; 3]],
        }
    }
}

/// Sizes of text, the larger first.
const SIZES: [RasterHeight; 2] = [RasterHeight::Size24, RasterHeight::Size16];
/// About a caption's text, pixels.
const MARGIN: u32 = 6;

/// The picture with a caption of one line below it, or of as many as the text needs.
pub fn captioned(picture: &RgbImage, text: &str, tone: Tone) -> RgbImage {
    let strip = caption(picture.width(), text, tone);
    let mut whole = RgbImage::new(picture.width(), picture.height() + strip.height());
    image::imageops::replace(&mut whole, picture, 0, 0);
    image::imageops::replace(&mut whole, &strip, 0, i64::from(picture.height()));
    whole
}

/// A strip of text: large on one line where it fits, else small, on as many lines as it needs.
pub fn caption(width: u32, text: &str, tone: Tone) -> RgbImage {
    let [ground, ink] = tone.colors();
    let room = width.saturating_sub(2 * MARGIN);
    let fits = SIZES.into_iter().find(|&size| text_width(text, size) <= room);
    let size = fits.unwrap_or(RasterHeight::Size16);
    let lines = wrapped(text, room, size);
    let line = size.val() as u32;
    let mut strip = RgbImage::from_pixel(width, lines.len() as u32 * line + MARGIN, image::Rgb(ground));
    let weight = if tone == Tone::Plain { FontWeight::Regular } else { FontWeight::Bold };
    for (i, text) in (0..).zip(&lines) {
        draw_text(&mut strip, [MARGIN, MARGIN / 2 + i * line], text, size, weight, ink);
    }
    strip
}

/// Lines no wider than `width` pixels, broken between words. A word that is wider has a line of its own, broken where it must.
fn wrapped(text: &str, width: u32, size: RasterHeight) -> Vec<String> {
    let letter = text_width("0", size).max(1);
    let most = (width / letter).max(1) as usize;
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        let letters: Vec<char> = word.chars().collect();
        for piece in letters.chunks(most) {
            match lines.last_mut().filter(|line| line.chars().count() + 1 + piece.len() <= most) {
                Some(line) => {
                    line.push(' ');
                    line.extend(piece);
                }
                None => lines.push(piece.iter().collect()),
            }
        }
    }
    // An empty caption has the height of a line all the same.
    if lines.is_empty() {
        lines.push(String::new());
    }
    lines
}

/// Writes a line of text in the top left corner, white on black, in letters that fit; characters beyond ASCII are left out.
pub fn write_text(picture: &mut RgbImage, text: &str) {
    let height = RasterHeight::Size16;
    fill(picture, [0, 0], [text_width(text, height), height.val() as u32], [0; 3]);
    draw_text(picture, [0, 0], text, height, FontWeight::Regular, [255; 3]);
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

/// A word on a ground of its own near `at`, pixels, moved so that it lies in the picture.
pub fn label(picture: &mut RgbImage, at: [f64; 2], text: &str, ground: [u8; 3], ink: [u8; 3]) {
    let size = RasterHeight::Size24;
    let (width, height) = (text_width(text, size) + 4, size.val() as u32);
    let within =
        |at: f64, length: u32, whole: u32| at.clamp(0.0, f64::from(whole.saturating_sub(length))) as u32;
    let at = [
        within(at[0] - f64::from(width) / 2.0, width, picture.width()),
        within(at[1] - f64::from(height) / 2.0, height, picture.height()),
    ];
    fill(picture, at, [width, height], ground);
    draw_text(picture, [at[0] + 2, at[1]], text, size, FontWeight::Bold, ink);
}

/// Width of a line of text, pixels.
pub fn text_width(text: &str, height: RasterHeight) -> u32 {
    let letters = text.chars().filter_map(|letter| get_raster(letter, FontWeight::Regular, height));
    letters.map(|raster| raster.width() as u32).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_caption_grows_and_no_word_is_broken_that_fits_on_a_line() {
        let size = RasterHeight::Size16;
        let text = "010_potted_meat_can: lost the object: the fingers went from 50.1 to 0.0 mm";
        let lines = wrapped(text, 240, size);
        assert_eq!(lines.join(" "), text, "nothing is left out");
        assert!(lines.len() > 1 && lines.iter().all(|line| text_width(line, size) <= 240), "{lines:?}");
        assert!(text.split(' ').all(|word| lines.iter().any(|line| line.contains(word))), "{lines:?}");
        // A word that no line holds is broken, not cut.
        assert_eq!(wrapped(&"x".repeat(50), 240, size).concat(), "x".repeat(50));

        let picture = RgbImage::new(240, 100);
        let [short, long] = ["banana", text].map(|text| captioned(&picture, text, Tone::Plain));
        assert_eq!(short.dimensions(), (240, 100 + 24 + 6));
        assert_eq!(long.dimensions(), (240, 100 + lines.len() as u32 * 16 + 6));
        let ink = |picture: &RgbImage, from: u32| {
            picture.enumerate_pixels().filter(|(x, y, p)| *y >= from && p.0[0] < 100 && *x >= 234).count()
        };
        assert_eq!(ink(&long, 100), 0, "the text ends before the picture does");
    }

    #[test]
    fn a_label_at_the_edge_lies_in_the_picture() {
        let mut picture = RgbImage::new(100, 40);
        label(&mut picture, [99.0, -5.0], "47 N", [255, 0, 0], [0; 3]);
        let red = picture.pixels().filter(|p| p.0 == [255, 0, 0]).count() as u32;
        assert!(red > (text_width("47 N", RasterHeight::Size24) + 4) * 24 / 2, "{red}");
        assert_eq!(picture.get_pixel(99, 0).0, [255, 0, 0]);
    }
}
