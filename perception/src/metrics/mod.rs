//! Pose metrics as the field defines them: ADD and ADD-S ([`add`](fn@add), [`adds`]) and the area under their
//! accuracy-threshold curve ([`auc`]), and the BOP challenge's: MSSD and MSPD ([`SymmetricShape`]), [`vsd`](fn@vsd), and the
//! average recall over their thresholds ([`AverageRecall`]); in words how an estimate is wrong ([`ErrorKind`]); and whether a
//! posterior holds the truth as often as it says ([`credible_level`]).
//!
//! Pure functions of poses, models and depth images; who compares belief with truth is not this crate's business.

mod add;
mod calibration;
mod kind;
mod recall;
mod surface_distance;
mod vsd;

use nalgebra::Point3;

pub use add::{Surface, add, adds};
pub use calibration::credible_level;
pub use kind::{ErrorKind, ErrorKinds};
pub use recall::{AverageRecall, Hits, Measured, PairErrors, THRESHOLDS};
pub use surface_distance::{SYMMETRY_STEP, SymmetricShape};
pub use vsd::vsd;

/// At most `count` of `points`, evenly spaced in their order.
pub fn sample_points(points: &[Point3<f32>], count: usize) -> Vec<Point3<f64>> {
    let take = count.min(points.len());
    (0..take).map(|i| points[i * points.len() / take].cast()).collect()
}

/// Area under the accuracy-threshold curve from 0 to `threshold`, normalised to 0 .. 1: the mean of
/// `max(0, 1 - error / threshold)`. Errors over the threshold, infinite and NaN ones (a miss) give nothing. 0 for no errors
/// or a threshold that is not positive.
///
/// PoseCNN's toolbox gives each step of the curve the height at its right end (PASCAL VOC's area), which is more by up to
/// one over the number of errors: nothing for thousands, but 1 for a single error of any size under the threshold.
pub fn auc(errors: &[f64], threshold: f64) -> f64 {
    if errors.is_empty() || !(threshold > 0.0 && threshold.is_finite()) {
        return 0.0;
    }
    // `max` takes 0 over NaN.
    errors.iter().map(|error| (1.0 - error / threshold).max(0.0)).sum::<f64>() / errors.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn area_under_the_curve_closed_form() {
        assert_eq!(auc(&[], 0.04), 0.0);
        assert_eq!(auc(&[0.05, f64::NAN, f64::INFINITY], 0.04), 0.0);
        assert_eq!(auc(&[0.0, 0.0], 0.04), 1.0);
        // Two of four found, at 1 cm and 3 cm: (3/4 + 1/4) / 4.
        let area = auc(&[0.03, 0.01, f64::INFINITY, f64::NAN], 0.04);
        assert!((area - 0.25).abs() < 1e-12, "{area}");
        // Many evenly spread errors: a half.
        let spread: Vec<f64> = (0..10_000).map(|i| f64::from(i) * 0.04e-4).collect();
        assert!((auc(&spread, 0.04) - 0.5).abs() < 1e-3);
    }

    #[test]
    fn samples_evenly_and_never_more_than_there_are() {
        let points: Vec<Point3<f32>> = (0..100).map(|i| Point3::new(i as f32, 0.0, 0.0)).collect();
        assert_eq!(
            sample_points(&points, 4).iter().map(|p| p.x).collect::<Vec<_>>(),
            [0.0, 25.0, 50.0, 75.0]
        );
        assert_eq!(sample_points(&points, 1000).len(), 100);
        assert!(sample_points(&[], 10).is_empty());
    }
}
