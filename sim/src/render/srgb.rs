//! The sRGB transfer curve (IEC 61966-2-1), exact and by table.

use std::sync::LazyLock;

/// Linear light, 0 to 1, of an encoded value 0 to 1.
pub fn to_linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// Encoded value, 0 to 1, of linear light 0 to 1.
pub fn from_linear(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Linear light of each 8-bit code.
pub(crate) static LINEAR_OF_8BIT: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| to_linear(code as f32 / 255.0)));

/// 8-bit code of linear light in 65535 steps.
static CODE_OF_16BIT: LazyLock<Vec<u8>> = LazyLock::new(|| {
    (0..=u16::MAX).map(|x| (from_linear(f32::from(x) / 65535.0) * 255.0 + 0.5) as u8).collect()
});

/// The 8-bit code of linear light; values outside 0 to 1 (and NaN, as 0) are clipped.
pub(crate) fn encode_8bit(linear: f32) -> u8 {
    CODE_OF_16BIT[(linear * 65535.0 + 0.5) as u16 as usize]
}

/// Linear light of an sRGB triple, 0 to 1.
pub(crate) fn color_to_linear(encoded: [f32; 3]) -> [f32; 3] {
    encoded.map(|c| to_linear(c.clamp(0.0, 1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_bit_codes_survive_the_round_trip() {
        for code in 0..=255_u8 {
            assert_eq!(encode_8bit(LINEAR_OF_8BIT[code as usize]), code);
        }
        assert_eq!(encode_8bit(7.0), 255);
        assert_eq!(encode_8bit(-7.0), 0);
        assert_eq!(encode_8bit(f32::NAN), 0);
        // Half of the light is code 188, the figure every graphics text quotes.
        assert_eq!(encode_8bit(0.5), 188);
    }
}
