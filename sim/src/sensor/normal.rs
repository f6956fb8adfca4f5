//! Normal numbers for images: a picture takes millions of them, so they come from a table.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};
use std::sync::LazyLock;

use rand::Rng;

/// The table has this many cells of equal probability, a power of two.
const CELLS: usize = 1 << CELL_BITS;
const CELL_BITS: u32 = 12;
/// Where the outermost cells end: so far that the variance is 1. Nothing lies beyond.
const END: f64 = 3.97;

/// Borders of the cells: quantiles of the standard normal distribution.
static QUANTILES: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let mut x = -END;
    (0..=CELLS)
        .map(|i| {
            if i == 0 || i == CELLS {
                return if i == 0 { -END } else { END } as f32;
            }
            // Newton's method from the border before; the first steps are small because the density is.
            for _ in 0..60 {
                let excess = 0.5 * libm::erfc(-x * FRAC_1_SQRT_2) - i as f64 / CELLS as f64;
                let density = (-0.5 * x * x).exp() / TAU.sqrt();
                let step = (excess / density).clamp(-0.1, 0.1);
                x -= step;
                if step.abs() < 1e-12 {
                    break;
                }
            }
            x as f32
        })
        .collect()
});

/// A number from the standard normal distribution, exact to the width of a cell: a cell at random, and a place in it.
#[inline]
pub(super) fn normal(rng: &mut impl Rng) -> f32 {
    const PLACE_BITS: u32 = 32 - CELL_BITS;
    let bits = rng.next_u32();
    let cell = (bits >> PLACE_BITS) as usize;
    let place = (bits & ((1 << PLACE_BITS) - 1)) as f32 * (1.0 / (1_u32 << PLACE_BITS) as f32);
    let [low, high] = [QUANTILES[cell], QUANTILES[cell + 1]];
    low + (high - low) * place
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng;

    #[test]
    fn moments_and_tails_are_those_of_the_normal_distribution() {
        let mut rng = rng::stream(1, "normal");
        let count = 4_000_000;
        let mut moments = [0.0_f64; 4];
        let mut beyond = [0_u32; 3];
        for _ in 0..count {
            let x = f64::from(normal(&mut rng));
            for (power, sum) in (1..).zip(&mut moments) {
                *sum += x.powi(power) / f64::from(count);
            }
            for (sigmas, tally) in (1..).zip(&mut beyond) {
                *tally += u32::from(x.abs() > f64::from(sigmas));
            }
        }
        // Four standard errors of each: sqrt(1, 2, 15, 96) / 2000.
        for (moment, (expected, error)) in
            moments.into_iter().zip([(0.0, 0.002), (1.0, 0.0028), (0.0, 0.0078), (3.0, 0.02)])
        {
            assert!((moment - expected).abs() < error, "{moments:?}");
        }
        for (tally, expected) in beyond.into_iter().zip([0.317_311, 0.045_500, 0.002_700]) {
            let share = f64::from(tally) / f64::from(count);
            assert!((share - expected).abs() < 4.0 * (expected / f64::from(count)).sqrt(), "{beyond:?}");
        }
    }

    #[test]
    fn borders_are_quantiles() {
        // Tables of the normal distribution: the quartile, and the quantile of 1/4096.
        assert!((QUANTILES[3 * CELLS / 4] - 0.674_49).abs() < 1e-5);
        assert!((QUANTILES[1] + 3.487_10).abs() < 1e-4, "{}", QUANTILES[1]);
        assert!(QUANTILES.is_sorted());
    }
}
