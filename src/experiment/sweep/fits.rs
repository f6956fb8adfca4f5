//! What a sweep has shown: shares of grasps that held, and the errors at which half and nine tenths still do.

use std::collections::BTreeMap;

use grip_sim::rng;
use rand::RngExt;
use schemars::JsonSchema;
use serde::Serialize;

use super::GraspLine;
use super::errors::Axis;
use super::layout::GraspOutcome;
use crate::experiment::stats::{Logistic, wilson};

/// Draws of the bootstrap of a D50.
const RESAMPLES: usize = 200;

/// Grasps under one error.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Share {
    /// The error: metres or radians.
    pub value: f64,
    /// Grasps tried.
    pub tried: usize,
    /// Of those, held.
    pub held: usize,
    /// Their share.
    pub share: f64,
    /// Its interval, 95 %, Wilson's.
    pub interval: [f64; 2],
}

impl Share {
    fn of(value: f64, held: impl Iterator<Item = bool>) -> Self {
        let (tried, held) = held.fold((0, 0), |(n, k), held| (n + 1, k + usize::from(held)));
        Self { value, tried, held, share: held as f64 / tried.max(1) as f64, interval: wilson(held, tried) }
    }
}

/// A logistic curve of the chance to hold over an error that grows from 0.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Fall {
    /// The curve.
    pub model: Logistic,
    /// Where the chance falls to a half, metres or radians; none within the errors that were tried.
    pub d50: Option<f64>,
    /// Its interval, 95 %, by a bootstrap that draws layouts; an end that lies beyond the errors tried is none. A fall between
    /// two neighbouring errors may be anywhere between them.
    pub d50_interval: [Option<f64>; 2],
    /// Where the chance falls to nine tenths; none when it is lower without any error.
    pub d90: Option<f64>,
}

/// A grasp for a fit: its layout's seed, the error's size, and whether it held.
type Point = (u64, f64, bool);

impl Fall {
    /// Fits; none of too few grasps.
    fn fit(points: &[Point]) -> Option<Self> {
        let farthest = points.iter().map(|p| p.1).fold(0.0, f64::max);
        let cases = |points: &mut dyn Iterator<Item = &Point>| -> Vec<(Vec<f64>, bool)> {
            points.map(|(_, x, held)| (vec![*x], *held)).collect()
        };
        let whole = Logistic::fit(&cases(&mut points.iter()))?;
        let within = |x: Option<f64>| x.filter(|x| *x <= farthest);
        let mut seeds: BTreeMap<u64, Vec<&Point>> = BTreeMap::new();
        points.iter().for_each(|point| seeds.entry(point.0).or_default().push(point));
        let groups: Vec<Vec<&Point>> = seeds.into_values().collect();
        let mut random = rng::stream(0, "bootstrap of d50");
        let mut drawn: Vec<f64> = (0..RESAMPLES)
            .map(|_| {
                let picked: Vec<&Point> = (0..groups.len())
                    .flat_map(|_| groups[random.random_range(0..groups.len())].iter().copied())
                    .collect();
                let fit = Logistic::fit(&cases(&mut picked.into_iter()));
                // Lower than a half from the beginning, or never down to it.
                fit.map_or(f64::INFINITY, |fit| {
                    let low = fit.probability(&[0.0]) < 0.5;
                    fit.falls_to(0.5).unwrap_or(if low { 0.0 } else { f64::INFINITY })
                })
            })
            .collect();
        drawn.sort_by(f64::total_cmp);
        let at = |q: f64| drawn[(q * (RESAMPLES - 1) as f64).round() as usize];
        let d50 = within(whole.falls_to(0.5));
        let [least, most] = d50.and_then(|d50| sudden(points, d50)).unwrap_or([f64::INFINITY, 0.0]);
        Some(Self {
            d50,
            // One layout alone says nothing of others.
            d50_interval: match groups.len() {
                1 => [None, None],
                _ => [within(Some(at(0.025).min(least))), within(Some(at(0.975).max(most)))],
            },
            d90: within(whole.falls_to(0.9)),
            model: whole,
        })
    }

    /// The chance to hold under an error of this size.
    pub fn chance(&self, x: f64) -> f64 {
        self.model.probability(&[x])
    }
}

/// The errors next to `d50` on either side if nearly all grasps hold under the one and nearly none under the other: of where
/// in between they fall nothing is known, whatever curve is laid through them.
fn sudden(points: &[Point], d50: f64) -> Option<[f64; 2]> {
    let share = |x: f64| Share::of(x, points.iter().filter(|p| p.1 == x).map(|p| p.2)).share;
    let below = points.iter().map(|p| p.1).filter(|x| *x <= d50).fold(0.0, f64::max);
    let above = points.iter().map(|p| p.1).filter(|x| *x > d50).fold(f64::INFINITY, f64::min);
    (share(below) > 0.95 && share(above) < 0.05).then_some([below, above])
}

/// Errors along one axis.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct AxisResult {
    /// Which.
    pub axis: Axis,
    /// In order of the error.
    pub shares: Vec<Share>,
    /// To the negative and to the positive side.
    pub falls: [Option<Fall>; 2],
}

/// Everything about one object.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ObjectResult {
    /// Its name.
    pub object: String,
    /// Grasps tried, those out of reach aside.
    pub tried: usize,
    /// Grasps out of reach.
    pub unreachable: usize,
    /// Grasps by what became of them.
    pub outcomes: BTreeMap<GraspOutcome, usize>,
    /// Without any error, if that was tried.
    pub without_error: Option<Share>,
    /// Axis by axis, where errors were along axes.
    pub axes: Vec<AxisResult>,
    /// Over ADD-S of random errors, metres. Errors along axes are not how poses err: what their size is worth depends on the
    /// axes and ranges tried.
    pub adds: Option<Fall>,
    /// The same over ADD.
    pub add: Option<Fall>,
    /// Random errors: chance over translation (metres) and angle (radians): intercept and slopes.
    pub isotropic: Option<Logistic>,
}

/// Object by object, in the order of their names.
pub fn results(lines: &[GraspLine]) -> Vec<ObjectResult> {
    let mut objects: BTreeMap<&str, Vec<&GraspLine>> = BTreeMap::new();
    for line in lines {
        objects.entry(&line.object).or_default().push(line);
    }
    objects.into_iter().map(|(object, lines)| result(object, &lines)).collect()
}

fn result(object: &str, lines: &[&GraspLine]) -> ObjectResult {
    let tried: Vec<(&GraspLine, bool)> =
        lines.iter().filter_map(|line| Some((*line, line.held()?))).collect();
    let mut outcomes = BTreeMap::new();
    for line in lines {
        *outcomes.entry(line.outcome).or_default() += 1;
    }
    let none: Vec<bool> =
        tried.iter().filter(|(line, _)| line.error.size() == [0.0, 0.0]).map(|(_, held)| *held).collect();
    let axes = Axis::ALL.into_iter().filter_map(|axis| axis_result(axis, &tried)).collect();
    let none_or_random = tried.iter().filter(|(line, _)| line.error.axis.is_none());
    let random: Vec<(&GraspLine, bool)> =
        none_or_random.clone().filter(|(line, _)| line.error.size() != [0.0, 0.0]).copied().collect();
    let over = |size: fn(&GraspLine) -> f64| {
        let points: Vec<Point> =
            none_or_random.clone().map(|(line, held)| (line.seed, size(line), *held)).collect();
        if random.is_empty() { None } else { Fall::fit(&points) }
    };
    let sizes: Vec<(Vec<f64>, bool)> =
        random.iter().map(|(line, held)| (line.error.size().to_vec(), *held)).collect();
    ObjectResult {
        object: object.to_owned(),
        tried: tried.len(),
        unreachable: lines.len() - tried.len(),
        outcomes,
        without_error: (!none.is_empty()).then(|| Share::of(0.0, none.into_iter())),
        axes,
        adds: over(|line| line.adds_m),
        add: over(|line| line.add_m),
        isotropic: Logistic::fit(&sizes),
    }
}

fn axis_result(axis: Axis, tried: &[(&GraspLine, bool)]) -> Option<AxisResult> {
    let none = |line: &GraspLine| line.error.size() == [0.0, 0.0];
    let mut along: Vec<(&GraspLine, f64, bool)> = tried
        .iter()
        .filter(|(line, _)| line.error.axis == Some(axis) || none(line))
        .map(|(line, held)| (*line, line.error.value(axis), *held))
        .collect();
    if along.iter().all(|(line, ..)| none(line)) {
        return None;
    }
    along.sort_by(|a, b| a.1.total_cmp(&b.1));
    let shares = along
        .chunk_by(|a, b| a.1 == b.1)
        .map(|cell| Share::of(cell[0].1, cell.iter().map(|(.., held)| *held)))
        .collect();
    let falls = [-1.0, 1.0].map(|sign: f64| {
        let points: Vec<Point> = along
            .iter()
            .filter(|(_, value, _)| value * sign >= 0.0)
            .map(|(line, value, held)| (line.seed, value.abs(), *held))
            .collect();
        Fall::fit(&points)
    });
    Some(AxisResult { axis, shares, falls })
}

#[cfg(test)]
mod tests {
    use super::super::errors::{ErrorCase, PoseError, along_axes};
    use super::*;

    /// Grasps that hold up to 15 mm along y to the positive side, 25 mm to the negative one.
    fn lines() -> Vec<GraspLine> {
        let cases = along_axes(&[Axis::Y], 0.04, 0.0, 17);
        let mut lines = Vec::new();
        for seed in 0..20_u64 {
            for (case, error) in cases.iter().map(|c: &ErrorCase| c.at(seed)).enumerate() {
                let PoseError { translation: [_, y, _], .. } = error;
                let held = (-0.025..=0.015).contains(&(y + 0.0005 * (seed as f64 - 9.5)));
                let outcome = if held { GraspOutcome::Held } else { GraspOutcome::Missed };
                lines.push(GraspLine {
                    object: "can".into(),
                    seed,
                    case,
                    error,
                    add_m: y.abs(),
                    adds_m: 0.5 * y.abs(),
                    outcome,
                    opposing_contacts: held,
                    lifted_clear: held,
                    held_after_shake: held,
                    slip_within: held,
                    slip_m: None,
                    slip_deg: None,
                    motion: None,
                });
            }
        }
        lines
    }

    #[test]
    fn half_hold_where_half_hold() {
        let result = &results(&lines())[0];
        assert_eq!((result.tried, result.unreachable), (20 * 17, 0));
        let y = &result.axes[0];
        assert_eq!((result.axes.len(), y.axis, y.shares.len()), (1, Axis::Y, 17));
        let [negative, positive] = y.falls.each_ref().map(|fall| fall.as_ref().unwrap());
        let (n, p) = (negative.d50.unwrap(), positive.d50.unwrap());
        assert!((n - 0.025).abs() < 0.0025 && (p - 0.015).abs() < 0.0025, "{n} {p}");
        assert!(positive.d90.unwrap() < p && (positive.chance(p) - 0.5).abs() < 1e-9);
        let [low, high] = positive.d50_interval.map(Option::unwrap);
        assert!(low <= p && p <= high && high - low < 0.01, "{low} {high}");
        assert_eq!(result.without_error.as_ref().unwrap().held, 20);
        assert_eq!((&result.adds, &result.add, &result.isotropic), (&None, &None, &None), "no random errors");
    }

    #[test]
    fn sizes_are_those_of_random_errors() {
        let mut lines = lines();
        for line in lines.iter_mut() {
            line.error.axis = None;
            let held = line.adds_m < 0.010;
            line.outcome = if held { GraspOutcome::Held } else { GraspOutcome::Missed };
        }
        let result = &results(&lines)[0];
        assert!((result.adds.as_ref().unwrap().d50.unwrap() - 0.010).abs() < 0.002);
        assert!((result.add.as_ref().unwrap().d50.unwrap() - 0.020).abs() < 0.004);
        // One layout has no others to be drawn.
        lines.retain(|line| line.seed == 3);
        assert_eq!(results(&lines)[0].adds.as_ref().unwrap().d50_interval, [None, None]);
    }

    #[test]
    fn what_was_out_of_reach_counts_for_nothing() {
        let mut lines = lines();
        for line in lines.iter_mut().filter(|line| line.seed < 10) {
            line.outcome = GraspOutcome::Unreachable;
        }
        let result = &results(&lines)[0];
        assert_eq!((result.tried, result.unreachable), (10 * 17, 10 * 17));
        assert_eq!(result.without_error.as_ref().unwrap().tried, 10);
    }

    #[test]
    fn a_fall_between_two_errors_may_be_anywhere_between_them() {
        let mut lines = lines();
        for line in &mut lines {
            let held = line.error.translation[1] < 0.012;
            line.outcome = if held { GraspOutcome::Held } else { GraspOutcome::Missed };
        }
        let result = &results(&lines)[0];
        let fall = result.axes[0].falls[1].as_ref().unwrap();
        let [low, high] = fall.d50_interval.map(Option::unwrap);
        assert!((low - 0.010).abs() < 1e-9 && (high - 0.015).abs() < 1e-9, "{fall:?}");
    }

    #[test]
    fn what_never_falls_has_no_d50() {
        let mut lines = lines();
        lines.iter_mut().for_each(|line| line.outcome = GraspOutcome::Held);
        let result = &results(&lines)[0];
        assert!(result.axes[0].falls.iter().flatten().all(|fall| fall.d50.is_none() && fall.d90.is_none()));
    }
}
