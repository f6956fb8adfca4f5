//! Intervals, tests and fits for shares of successes.

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::Serialize;
use statrs::distribution::{Binomial, ContinuousCDF, DiscreteCDF, Normal};

/// Confidence of all intervals.
pub const CONFIDENCE: f64 = 0.95;

/// Two-sided quantile of the standard normal distribution for [`CONFIDENCE`]: 1.96.
fn z() -> f64 {
    Normal::standard().inverse_cdf(0.5 + 0.5 * CONFIDENCE)
}

/// Wilson's score interval of a share, `successes` of `n` (Wilson 1927; method 3 of Newcombe 1998). 0 to 1 of none.
pub fn wilson(successes: usize, n: usize) -> [f64; 2] {
    wilson_of(successes as f64, n as f64)
}

/// The same for counts that need not be whole, such as weights.
pub fn wilson_of(successes: f64, n: f64) -> [f64; 2] {
    if n <= 0.0 {
        return [0.0, 1.0];
    }
    let (z, p) = (z(), successes / n);
    let middle = p + z * z / (2.0 * n);
    let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).max(0.0).sqrt();
    let scale = 1.0 + z * z / n;
    [((middle - half) / scale).max(0.0), ((middle + half) / scale).min(1.0)]
}

/// McNemar's test of two methods on the same cases, exact and two-sided: the probability that so uneven a split of the cases
/// in which one alone succeeds, `first` and `second`, comes about by chance.
pub fn mcnemar(first: usize, second: usize) -> f64 {
    let n = (first + second) as u64;
    match Binomial::new(0.5, n) {
        Ok(fair) if n > 0 => (2.0 * fair.cdf(first.min(second) as u64)).min(1.0),
        _ => 1.0,
    }
}

/// Mean squared difference of predicted probabilities and what happened (Brier 1950); 0 is perfect, 0.25 is a coin.
pub fn brier(predicted: &[f64], happened: &[bool]) -> f64 {
    let sum: f64 = predicted.iter().zip(happened).map(|(p, &y)| (p - f64::from(u8::from(y))).powi(2)).sum();
    sum / predicted.len().max(1) as f64
}

/// A logistic model of success: P = 1 / (1 + exp(-(b0 + b1 x1 + ...))).
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Logistic {
    /// b0, b1, ...
    pub coefficients: Vec<f64>,
    /// Their standard errors.
    pub errors: Vec<f64>,
}

/// Newton steps at most, and the change that ends them.
const NEWTON_STEPS: usize = 100;
const CONVERGED: f64 = 1e-10;
/// Variance of the prior of the slopes, in units of one over the variable's variance: it keeps the fit of separable data
/// finite and moves others by less than a per cent.
const PRIOR_VARIANCE: f64 = 400.0;

impl Logistic {
    /// Fits by maximum likelihood (Newton's method), with a weak prior on the slopes. Each of `cases` has its variables and
    /// whether it succeeded. `None` when there are no cases, they differ in their number of variables, or a variable does not
    /// vary.
    pub fn fit(cases: &[(Vec<f64>, bool)]) -> Option<Self> {
        let k = cases.first()?.0.len();
        let n = cases.len() as f64;
        if cases.iter().any(|(x, _)| x.len() != k || x.iter().any(|v| !v.is_finite())) {
            return None;
        }
        let variance: Vec<f64> = (0..k)
            .map(|j| {
                let mean = cases.iter().map(|(x, _)| x[j]).sum::<f64>() / n;
                cases.iter().map(|(x, _)| (x[j] - mean).powi(2)).sum::<f64>() / n
            })
            .collect();
        if variance.iter().any(|v| *v <= 0.0) {
            return None;
        }
        let mut b = DVector::zeros(k + 1);
        let mut information = DMatrix::zeros(k + 1, k + 1);
        for _ in 0..NEWTON_STEPS {
            let mut gradient = DVector::zeros(k + 1);
            information.fill(0.0);
            for (x, y) in cases {
                let row = DVector::from_iterator(k + 1, std::iter::once(1.0).chain(x.iter().copied()));
                let p = sigmoid(row.dot(&b));
                gradient += &row * (f64::from(u8::from(*y)) - p);
                information.ger(p * (1.0 - p), &row, &row, 1.0);
            }
            // The intercept has a prior that is as weak, for cases that all succeed.
            let precision = |j: usize| (if j == 0 { 1.0 } else { variance[j - 1] }) / PRIOR_VARIANCE;
            for j in 0..=k {
                gradient[j] -= precision(j) * b[j];
                information[(j, j)] += precision(j);
            }
            let step = information.clone().cholesky()?.solve(&gradient);
            b += &step;
            if step.amax() < CONVERGED * (1.0 + b.amax()) {
                break;
            }
        }
        let covariance = information.try_inverse()?;
        let errors = (0..=k).map(|j| covariance[(j, j)].sqrt()).collect();
        b.iter().all(|v| v.is_finite()).then(|| Self { coefficients: b.iter().copied().collect(), errors })
    }

    /// The probability of success.
    pub fn probability(&self, x: &[f64]) -> f64 {
        let slopes = &self.coefficients[1..];
        sigmoid(self.coefficients[0] + slopes.iter().zip(x).map(|(b, x)| b * x).sum::<f64>())
    }

    /// Of a model of one variable: where the probability falls to `p`. `None` when it does not fall, or is lower from 0 on.
    pub fn falls_to(&self, p: f64) -> Option<f64> {
        let [intercept, slope] = self.coefficients[..] else { return None };
        let x = ((p / (1.0 - p)).ln() - intercept) / slope;
        (slope < 0.0 && x >= 0.0 && x.is_finite()).then_some(x)
    }
}

fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

/// Share of successes about `x`, and its interval, by a Gaussian kernel of this width over cases `(x, succeeded)`; the
/// interval is Wilson's with the kernel's effective number of cases. `None` where there is less than one, or none nearby.
pub fn kernel_share(cases: &[(f64, bool)], x: f64, width: f64) -> Option<(f64, [f64; 2])> {
    let (mut sum, mut squares, mut good) = (0.0, 0.0, 0.0);
    for (at, y) in cases {
        let w = (-0.5 * ((at - x) / width).powi(2)).exp();
        sum += w;
        squares += w * w;
        good += w * f64::from(u8::from(*y));
    }
    // Weights are at most one: many cases far away are not many cases here.
    let effective = if squares > 0.0 { (sum * sum / squares).min(sum) } else { 0.0 };
    let near = cases.iter().any(|(at, _)| (at - x).abs() <= 1.5 * width);
    (near && sum >= 1.0).then(|| (good / sum, wilson_of(good / sum * effective, effective)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_as_newcombe_tabulates_it() {
        // Newcombe 1998, table I, method 3.
        for (r, n, low, high) in [
            (81, 263, 0.2553, 0.3662),
            (15, 148, 0.0624, 0.1605),
            (0, 20, 0.0, 0.1611),
            (1, 29, 0.0061, 0.1718),
        ] {
            let [l, h] = wilson(r, n);
            assert!((l - low).abs() < 5e-5 && (h - high).abs() < 5e-5, "{r}/{n}: {l} {h}");
        }
        assert_eq!(wilson(0, 0), [0.0, 1.0]);
        assert!((wilson(5, 5)[1] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn mcnemar_is_a_fair_coin() {
        assert_eq!(mcnemar(0, 0), 1.0);
        assert!((mcnemar(5, 0) - 2.0 / 32.0).abs() < 1e-12);
        assert!((mcnemar(1, 9) - 22.0 / 1024.0).abs() < 1e-12);
        assert_eq!(mcnemar(4, 4), 1.0);
    }

    #[test]
    fn brier_in_closed_form() {
        assert_eq!(brier(&[1.0, 0.0], &[true, false]), 0.0);
        assert_eq!(brier(&[0.5, 0.5], &[true, false]), 0.25);
        assert!((brier(&[0.8, 0.3], &[true, true]) - (0.04 + 0.49) / 2.0).abs() < 1e-12);
    }

    #[test]
    fn the_fit_of_hours_of_study() {
        // The worked example of Wikipedia's article on logistic regression: -4.0777 (1.7610) + 1.5046 (0.6287) hours.
        let hours = [
            0.50, 0.75, 1.00, 1.25, 1.50, 1.75, 1.75, 2.00, 2.25, 2.50, 2.75, 3.00, 3.25, 3.50, 4.00, 4.25,
            4.50, 4.75, 5.00, 5.50,
        ];
        let passed = [0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 1, 1, 1, 1, 1];
        let cases: Vec<_> = hours.iter().zip(passed).map(|(h, y)| (vec![*h], y == 1)).collect();
        let fit = Logistic::fit(&cases).unwrap();
        for (found, expected, within) in [
            (fit.coefficients[0], -4.0777, 0.06),
            (fit.coefficients[1], 1.5046, 0.02),
            (fit.errors[0], 1.7610, 0.03),
            (fit.errors[1], 0.6287, 0.01),
        ] {
            assert!((found - expected).abs() < within, "{fit:?}");
        }
        assert_eq!(fit.falls_to(0.5), None, "it rises");
    }

    #[test]
    fn a_fall_from_always_to_never_is_found_where_it_is() {
        // Separable: the likelihood alone has no maximum.
        let cases: Vec<_> = (0..100).map(|i| (vec![f64::from(i)], i < 40)).collect();
        let fit = Logistic::fit(&cases).unwrap();
        let half = fit.falls_to(0.5).unwrap();
        assert!((half - 39.5).abs() < 0.6, "{half}");
        assert!(fit.falls_to(0.9).unwrap() < half);
        // Never and always have no fall.
        let all: Vec<_> = (0..100).map(|i| (vec![f64::from(i)], true)).collect();
        assert!(Logistic::fit(&all).unwrap().falls_to(0.5).is_none_or(|x| x > 100.0));
        assert_eq!(Logistic::fit(&[]), None);
        assert_eq!(Logistic::fit(&[(vec![1.0], true), (vec![1.0], false)]), None);
    }

    #[test]
    fn the_kernel_follows_the_share() {
        let cases: Vec<_> = (0..1000).map(|i| (f64::from(i % 100), i % 2 == 0 || i % 100 < 50)).collect();
        let (low, _) = kernel_share(&cases, 20.0, 5.0).unwrap();
        let (high, [l, h]) = kernel_share(&cases, 80.0, 5.0).unwrap();
        assert!(low > 0.999 && (high - 0.5).abs() < 0.02 && l < 0.5 && h > 0.5, "{low} {high} {l} {h}");
        assert_eq!(kernel_share(&cases, 500.0, 5.0), None);
        // A crowd far away says nothing here.
        let crowd = vec![(0.0, true); 1000];
        assert_eq!(kernel_share(&crowd, 3.0, 1.0), None);
        let (_, [low, _]) = kernel_share(&crowd, 1.5, 1.0).unwrap();
        assert!(low < 0.995, "{low}");
    }
}
