//! The accuracy-threshold curve: the share of instances whose error is under a threshold.

use grip_perception::metrics::auc;

use super::case::Case;
use super::evaluation::THRESHOLDS;
use crate::plot::{Axis, Curve, Figure, Panel};

/// The curves of several results, each with its name: ADD-S beside ADD(-S), up to the first threshold. The legend has the
/// areas.
pub fn figure(dataset: &str, results: &[(String, &[Case])]) -> Figure {
    let most = THRESHOLDS[0];
    let panel = |title: &str, error: fn(&Case) -> f64| {
        let curves = results.iter().map(|(name, cases)| {
            let errors: Vec<f64> = cases.iter().map(error).collect();
            let points = steps(&errors, most).into_iter().map(|(m, share)| (1e3 * m, 100.0 * share));
            let label =
                format!("{name}: AUC {:.1} %, {} instances", 100.0 * auc(&errors, most), errors.len());
            Curve { label, points: points.collect(), ..Curve::default() }
        });
        Panel {
            title: title.to_owned(),
            x: Axis::linear("threshold, mm", 0.0, 1e3 * most),
            y: Axis::linear("instances under the threshold, %", 0.0, 100.0),
            curves: curves.collect(),
            level: None,
        }
    };
    Figure {
        title: format!("Accuracy against threshold: {dataset}"),
        columns: 2,
        panels: vec![panel("ADD-S", |case| case.adds), panel("ADD(-S)", Case::add_or_adds)],
    }
}

/// Corners of the step function from 0 to `most`: threshold and share of errors that are not larger. The area under it,
/// divided by `most`, is [`auc`].
pub(super) fn steps(errors: &[f64], most: f64) -> Vec<(f64, f64)> {
    let total = errors.len().max(1) as f64;
    let mut errors: Vec<f64> = errors.iter().copied().filter(|error| *error <= most).collect();
    errors.sort_by(f64::total_cmp);
    let mut points = vec![(0.0, 0.0)];
    let mut share = 0.0;
    for (i, error) in errors.iter().enumerate() {
        points.push((*error, share));
        share = (i + 1) as f64 / total;
        points.push((*error, share));
    }
    points.push((most, share));
    points.dedup();
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(points: &[(f64, f64)]) -> f64 {
        points.windows(2).map(|w| (w[1].0 - w[0].0) * w[0].1).sum()
    }

    #[test]
    fn the_curve_in_closed_form() {
        let inf = f64::INFINITY;
        assert_eq!(steps(&[], 0.04), [(0.0, 0.0), (0.04, 0.0)]);
        assert_eq!(steps(&[inf, 0.05], 0.04), [(0.0, 0.0), (0.04, 0.0)]);
        let points = steps(&[0.03, 0.0, inf, 0.01], 0.04);
        let expected =
            [(0.0, 0.0), (0.0, 0.25), (0.01, 0.25), (0.01, 0.5), (0.03, 0.5), (0.03, 0.75), (0.04, 0.75)];
        assert_eq!(points, expected);
    }

    #[test]
    fn the_area_under_the_curve_is_the_auc() {
        let errors: Vec<f64> = (0..57).map(|i| (f64::from(i) * 7.3).sin().abs() * 0.07).collect();
        assert!((area(&steps(&errors, 0.04)) / 0.04 - auc(&errors, 0.04)).abs() < 1e-12);
        let missed: Vec<f64> = errors.iter().copied().chain([f64::INFINITY; 20]).collect();
        assert!((area(&steps(&missed, 0.04)) / 0.04 - auc(&missed, 0.04)).abs() < 1e-12);
    }
}
