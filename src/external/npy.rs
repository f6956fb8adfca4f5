//! NumPy's file format, version 1.0: a header that says type and shape, then the numbers as they lie in memory.
//! (<https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>)

use std::fmt::Write as _;

use grip_sim::images::{DepthImage, LabelImage, RgbImage};

/// Height x width x 3, uint8.
pub fn rgb(image: &RgbImage) -> Vec<u8> {
    let mut bytes = header("|u1", &[image.height() as usize, image.width() as usize, 3]);
    bytes.extend_from_slice(image.as_raw());
    bytes
}

/// Height x width, float32.
pub fn depth(image: &DepthImage) -> Vec<u8> {
    let mut bytes = header("<f4", &[image.height(), image.width()]);
    bytes.extend(image.data().iter().flat_map(|z| z.to_le_bytes()));
    bytes
}

/// Height x width, uint16.
pub fn labels(image: &LabelImage) -> Vec<u8> {
    let mut bytes = header("<u2", &[image.height(), image.width()]);
    bytes.extend(image.data().iter().flat_map(|label| label.to_le_bytes()));
    bytes
}

fn header(kind: &str, shape: &[usize]) -> Vec<u8> {
    let shape: Vec<String> = shape.iter().map(usize::to_string).collect();
    let mut text =
        format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({}), }}", shape.join(", "));
    // The numbers begin at a multiple of 64 bytes.
    const BEFORE: usize = 10;
    let padding = (64 - (BEFORE + text.len() + 1) % 64) % 64;
    let _ = writeln!(text, "{:padding$}", "");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_follow_a_header_of_whole_lines_of_64_bytes() {
        let mut image = DepthImage::filled(3, 2, 0.0);
        image.data_mut()[4] = 1.5;
        let bytes = depth(&image);
        assert_eq!(bytes.len() % 64, 24);
        let text = std::str::from_utf8(&bytes[10..bytes.len() - 24]).unwrap();
        assert!(text.starts_with("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }"), "{text}");
        assert!(text.ends_with(" \n"), "{text:?}");
        assert_eq!(usize::from(bytes[8]) + 256 * usize::from(bytes[9]), text.len());
        assert_eq!(bytes[bytes.len() - 8..bytes.len() - 4], 1.5f32.to_le_bytes());
    }
}
