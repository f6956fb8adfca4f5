//! Random draws that both filters need: by weight, with and without replacement, and rotations.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

/// Draws an item with probability in proportion to its weight, uniformly when no weight is positive.
pub(crate) fn sample_by<'a, T, R: Rng>(
    items: &'a [T],
    weight: impl Fn(&T) -> f64,
    rng: &mut R,
) -> Option<&'a T> {
    let total: f64 = items.iter().map(&weight).sum();
    let draw = rng.random::<f64>();
    if !(total > 0.0 && total.is_finite()) {
        return items.get(((draw * items.len() as f64) as usize).min(items.len().saturating_sub(1)));
    }
    let mut rest = draw * total;
    let mut last = None;
    for item in items {
        let w = weight(item);
        if w <= 0.0 {
            continue;
        }
        last = Some(item);
        rest -= w;
        if rest < 0.0 {
            break;
        }
    }
    last
}

/// The temperature at which weights `exp(score / T)` have an effective sample size of `share` times their number. Scores
/// that are all equal have any temperature; the coldest is returned where even that leaves too many.
pub(crate) fn temperature(scores: &[f32], share: f64) -> f32 {
    let (mut cold, mut hot) = (1e-4f32, 10.0f32);
    let target = (share * scores.len() as f64).max(1.0);
    // The effective sample size grows with the temperature.
    for _ in 0..16 {
        let middle = (cold * hot).sqrt();
        if effective_size(scores, middle) < target {
            cold = middle;
        } else {
            hot = middle;
        }
    }
    (cold * hot).sqrt()
}

fn effective_size(scores: &[f32], temperature: f32) -> f64 {
    let best = scores.iter().copied().fold(f32::MIN, f32::max);
    let (mut sum, mut squares) = (0.0f64, 0.0f64);
    for s in scores {
        let w = f64::from(((s - best) / temperature).exp());
        sum += w;
        squares += w * w;
    }
    sum * sum / squares
}

/// Draws `count` different indices with probability in proportion to `exp(log_weight)`: the largest after adding Gumbel
/// noise. In the order drawn.
pub(crate) fn gumbel_top<R: Rng>(log_weights: &[f32], count: usize, rng: &mut R) -> Vec<usize> {
    let mut keys: Vec<(f32, usize)> = log_weights
        .iter()
        .enumerate()
        .map(|(i, w)| {
            let uniform = rng.random::<f64>().max(1e-300);
            (w - (-uniform.ln()).ln() as f32, i)
        })
        .collect();
    let order = |a: &(f32, usize), b: &(f32, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
    if count < keys.len() {
        keys.select_nth_unstable_by(count, order);
        keys.truncate(count);
    }
    keys.sort_unstable_by(order);
    keys.into_iter().map(|(_, i)| i).collect()
}

/// Draws `count` indices with replacement in proportion to `exp(score / temperature)`, systematically: one random number,
/// evenly spaced teeth.
pub(crate) fn systematic<R: Rng>(scores: &[f32], temperature: f32, count: usize, rng: &mut R) -> Vec<usize> {
    let best = scores.iter().copied().fold(f32::MIN, f32::max);
    let weights: Vec<f64> = scores.iter().map(|s| f64::from(((s - best) / temperature).exp())).collect();
    let tooth = weights.iter().sum::<f64>() / count as f64;
    let mut next = rng.random::<f64>() * tooth;
    let mut drawn = Vec::with_capacity(count);
    let mut sum = 0.0;
    for (i, w) in weights.iter().enumerate() {
        sum += w;
        while next < sum && drawn.len() < count {
            drawn.push(i);
            next += tooth;
        }
    }
    while drawn.len() < count {
        drawn.push(scores.len().saturating_sub(1));
    }
    drawn
}

/// A rotation drawn uniformly from all rotations: four normal numbers, normalised.
pub(crate) fn uniform_rotation<R: Rng>(rng: &mut R) -> UnitQuaternion<f32> {
    loop {
        let mut normal = || -> f32 { StandardNormal.sample(rng) };
        let q = Quaternion::new(normal(), normal(), normal(), normal());
        if q.norm() > 1e-3 {
            return UnitQuaternion::from_quaternion(q);
        }
    }
}

/// A small random rotation with this standard deviation about each axis, radians.
pub(crate) fn small_rotation<R: Rng>(sigma: f32, rng: &mut R) -> UnitQuaternion<f32> {
    let mut normal = || -> f32 { StandardNormal.sample(rng) };
    UnitQuaternion::from_scaled_axis(Vector3::new(normal(), normal(), normal()) * sigma)
}

#[cfg(test)]
mod tests {
    use super::*;
    use grip_sim::rng;
    use nalgebra::Matrix3;

    #[test]
    fn the_temperature_gives_the_effective_size_asked_for() {
        let scores: Vec<f32> = (0..200).map(|i| (i as f32 * 0.37).sin()).collect();
        for share in [0.1, 0.3, 0.5] {
            let t = temperature(&scores, share);
            assert!((effective_size(&scores, t) / 200.0 - share).abs() < 0.01);
        }
        assert!(temperature(&[1.0; 10], 0.3).is_finite());
    }

    #[test]
    fn gumbel_draws_in_proportion_and_without_replacement() {
        let weights = [0.1f32.ln(), 0.6f32.ln(), 0.3f32.ln()];
        let mut rng = rng::stream(2, "test");
        let mut first = [0; 3];
        for _ in 0..9000 {
            let drawn = gumbel_top(&weights, 2, &mut rng);
            assert_ne!(drawn[0], drawn[1]);
            first[drawn[0]] += 1;
        }
        for (n, share) in first.iter().zip([0.1, 0.6, 0.3]) {
            assert!((f64::from(*n) / 9000.0 - share).abs() < 0.02, "{first:?}");
        }
        assert_eq!(gumbel_top(&weights, 10, &mut rng).len(), 3);
    }

    #[test]
    fn systematic_resampling_copies_each_by_its_share() {
        let scores = [0.5f32.ln(), 0.25f32.ln(), 0.25f32.ln()];
        let drawn = systematic(&scores, 1.0, 8, &mut rng::stream(3, "test"));
        assert_eq!(drawn, [0, 0, 0, 0, 1, 1, 2, 2]);
    }

    #[test]
    fn rotations_are_uniform() {
        let mut rng = rng::stream(1, "test");
        let n = 20_000;
        let (mut mean, mut square) = (Matrix3::<f64>::zeros(), Matrix3::<f64>::zeros());
        for _ in 0..n {
            let r = uniform_rotation(&mut rng).to_rotation_matrix().matrix().cast::<f64>();
            mean += r / f64::from(n);
            square += r.component_mul(&r) / f64::from(n);
        }
        // Every entry has mean 0 and variance 1/3 under the uniform distribution.
        assert!(mean.abs().max() < 0.02, "{mean}");
        assert!((square.add_scalar(-1.0 / 3.0)).abs().max() < 0.02, "{square}");
    }
}
