//! Draws colours; all are sRGB, 0 to 1.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// From a to b.
pub(super) fn mix(a: [f32; 3], b: [f32; 3], t: f32) -> [f32; 3] {
    std::array::from_fn(|c| a[c] + (b[c] - a[c]) * t)
}

/// Brighter or darker.
pub(super) fn scale(color: [f32; 3], factor: f32) -> [f32; 3] {
    color.map(|c| c * factor)
}

/// Hue in turns, saturation and value 0 to 1 (Smith 1978).
pub(super) fn hsv(hue: f32, saturation: f32, value: f32) -> [f32; 3] {
    [5.0, 3.0, 1.0].map(|n: f32| {
        let k = (n + hue * 6.0) % 6.0;
        value * (1.0 - saturation * k.min(4.0 - k).clamp(0.0, 1.0))
    })
}

/// Any colour that a thing in a house has: a third greys, a third muted, a third strong.
pub(super) fn any(rng: &mut ChaCha8Rng) -> [f32; 3] {
    match rng.random_range(0..3) {
        0 => grey(rng),
        1 => muted(rng),
        _ => strong(rng),
    }
}

/// White, grey or black with a slight cast.
pub(super) fn grey(rng: &mut ChaCha8Rng) -> [f32; 3] {
    hsv(rng.random(), rng.random_range(0.0..0.10), rng.random_range(0.12..0.95))
}

/// As walls and cloth are.
pub(super) fn muted(rng: &mut ChaCha8Rng) -> [f32; 3] {
    hsv(rng.random(), rng.random_range(0.10..0.45), rng.random_range(0.30..0.90))
}

/// As plastics and prints are.
pub(super) fn strong(rng: &mut ChaCha8Rng) -> [f32; 3] {
    hsv(rng.random(), rng.random_range(0.5..0.95), rng.random_range(0.30..0.92))
}

/// A colour that stands out from `from`.
pub(super) fn apart(from: [f32; 3], rng: &mut ChaCha8Rng) -> [f32; 3] {
    for _ in 0..8 {
        let color = any(rng);
        if (0..3).map(|c| (color[c] - from[c]).abs()).sum::<f32>() > 0.7 {
            return color;
        }
    }
    if from.iter().sum::<f32>() > 1.5 { [0.15; 3] } else { [0.9; 3] }
}

/// One of `list`, moved a little.
pub(super) fn near(list: &[[f32; 3]], rng: &mut ChaCha8Rng) -> [f32; 3] {
    let color = list[rng.random_range(0..list.len())];
    let light = rng.random_range(0.85..1.12);
    color.map(|c| (c * light * rng.random_range(0.96_f32..1.04)).min(0.97))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hues_are_where_they_belong() {
        assert_eq!(hsv(0.0, 1.0, 1.0), [1.0, 0.0, 0.0]);
        assert_eq!(hsv(1.0 / 3.0, 1.0, 1.0), [0.0, 1.0, 0.0]);
        assert_eq!(hsv(0.5, 0.5, 0.8), [0.4, 0.8, 0.8]);
    }
}
