//! Pose metrics as the field defines them: ADD and ADD-S (Hinterstoisser 2012, PoseCNN) and the area under the
//! accuracy-threshold curve.
//!
//! Pure functions of two poses; who compares belief with truth is not this crate's business.

use grip_sim::pose::{Camera, Object, Pose};
use nalgebra::Point3;

/// ADD, metres: mean distance between corresponding model points under the two poses. 0 for no points.
pub fn add(points: &[Point3<f64>], truth: &Pose<Camera, Object>, estimate: &Pose<Camera, Object>) -> f64 {
    let sum: f64 =
        points.iter().map(|p| (truth.transform_point(p) - estimate.transform_point(p)).norm()).sum();
    sum / points.len().max(1) as f64
}

/// ADD-S, metres: for each model point under the true pose the distance to the nearest one under the estimate, mean.
/// Brute force: quadratic in the number of points, so sample them down to 1000 with [`sample_points`]. 0 for no points.
pub fn adds(points: &[Point3<f64>], truth: &Pose<Camera, Object>, estimate: &Pose<Camera, Object>) -> f64 {
    let moved: Vec<Point3<f64>> = points.iter().map(|p| estimate.transform_point(p)).collect();
    let sum: f64 = points
        .iter()
        .map(|p| {
            let p = truth.transform_point(p);
            moved.iter().map(|q| (p - q).norm_squared()).fold(f64::INFINITY, f64::min).sqrt()
        })
        .sum();
    sum / points.len().max(1) as f64
}

/// At most `count` of `points`, evenly spaced in their order.
pub fn sample_points(points: &[Point3<f32>], count: usize) -> Vec<Point3<f64>> {
    let take = count.min(points.len());
    (0..take).map(|i| points[i * points.len() / take].cast()).collect()
}

/// Area under the accuracy-threshold curve from 0 to `threshold`, normalised to 0 .. 1, as PoseCNN's YCB-Video toolbox
/// computes it (PASCAL VOC's area): errors over the threshold, infinite and NaN ones (a miss) count as misses; each step of the curve is
/// given the height at its right end, so the figure is up to `1/n` above the mean of `max(0, 1 - error/threshold)`, and
/// one single error under the threshold gives 1. 0 for no errors or a threshold that is not positive.
pub fn auc(errors: &[f64], threshold: f64) -> f64 {
    let mut kept: Vec<f64> = errors.iter().copied().filter(|e| *e <= threshold).collect();
    kept.sort_by(f64::total_cmp);
    let Some(&last) = kept.last() else { return 0.0 };
    if !(threshold > 0.0 && threshold.is_finite()) {
        return 0.0;
    }
    let accuracy = |i: usize| (i + 1) as f64 / errors.len() as f64;
    let mut area = (threshold - last) * accuracy(kept.len() - 1);
    let mut before = 0.0;
    for (i, &error) in kept.iter().enumerate() {
        area += (error.max(0.0) - before) * accuracy(i);
        before = error.max(0.0);
    }
    area / threshold
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Vector3};

    fn cube() -> Vec<Point3<f64>> {
        (0..8)
            .map(|i| Point3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64) - Vector3::repeat(0.5))
            .collect()
    }

    #[test]
    fn translation_is_its_own_add() {
        let a = Pose::from_xyz_rpy([0.1, 0.2, 1.0], [0.3, 0.2, 0.1]);
        let b = Pose::new(Isometry3::translation(0.03, -0.04, 0.0) * a.iso());
        assert!((add(&cube(), &a, &b) - 0.05).abs() < 1e-12);
        assert!((adds(&cube(), &a, &b) - 0.05).abs() < 1e-12);
    }

    #[test]
    fn a_quarter_turn_of_a_cube_is_nothing_to_adds() {
        let a = Pose::identity();
        let b = Pose::from_xyz_rpy([0.0; 3], [0.0, 0.0, std::f64::consts::FRAC_PI_2]);
        // Each corner moves along the side of a unit square.
        assert!((add(&cube(), &a, &b) - 1.0).abs() < 1e-12);
        assert!(adds(&cube(), &a, &b) < 1e-12);
    }

    #[test]
    fn nearest_never_exceeds_corresponding() {
        for i in 0..50 {
            let x = f64::from(i) * 0.37;
            let b = Pose::from_xyz_rpy([x.sin(), 0.1 * x, 0.0], [x, 2.0 * x, 0.3]);
            assert!(adds(&cube(), &Pose::identity(), &b) <= add(&cube(), &Pose::identity(), &b) + 1e-12);
        }
    }

    #[test]
    fn area_under_the_curve_closed_form() {
        assert_eq!(auc(&[], 0.04), 0.0);
        assert_eq!(auc(&[0.05, f64::NAN, f64::INFINITY], 0.04), 0.0);
        assert_eq!(auc(&[0.0, 0.0], 0.04), 1.0);
        // Two of four found at 1 cm and 3 cm: (1*1/4 + 2*2/4 + 1*2/4) / 4.
        let area = auc(&[0.03, 0.01, f64::INFINITY, f64::NAN], 0.04);
        assert!((area - 0.4375).abs() < 1e-12, "{area}");
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
