//! The figures of a sweep: fitted curves, with the shares and the single grasps that they were fitted to.

use std::collections::BTreeMap;

use anyhow::Result;

use super::SweepSource;
use crate::experiment::stats::wilson;
use crate::experiment::sweep::GraspLine;
use crate::experiment::sweep::errors::Axis;
use crate::experiment::sweep::fits::{AxisResult, Fall, ObjectResult};
use crate::plot::{self, Axis as PlotAxis, Curve, Figure, MOST_CURVES, Panel};

/// Points of a smooth curve.
const POINTS: usize = 81;
/// Letters of a title that have room above a figure.
const TITLE: usize = 58;
/// Room for single grasps beyond either end of the axis of shares, per cent: so much, and more for each object.
const RUG: [f64; 2] = [5.0, 3.0];
/// Objects whose intervals can be told apart in one figure.
const MOST_INTERVALS: usize = 3;
/// Largest errors shown by their size, millimetres.
const MOST_MM: f64 = 60.0;
/// Dots over the size of an error, each of the grasps from one of so many parts of the axis.
const DOTS: usize = 12;

/// A figure for each axis along which there were errors.
pub fn axes(sweep: &SweepSource, objects: &[ObjectResult]) -> Result<Vec<String>> {
    let figures = Axis::ALL.into_iter().filter_map(|axis| axis_figure(sweep, objects, axis));
    figures.map(|figure| plot::svg(&figure)).collect()
}

fn axis_figure(sweep: &SweepSource, objects: &[ObjectResult], axis: Axis) -> Option<Figure> {
    let tried = |object: &'_ ObjectResult| object.axes.iter().any(|result| result.axis == axis);
    let objects: Vec<&ObjectResult> =
        objects.iter().filter(|object| tried(object)).take(MOST_CURVES).collect();
    let results = objects.iter().filter_map(|o| o.axes.iter().find(|result| result.axis == axis));
    let results: Vec<&AxisResult> = results.collect();
    let values = || results.iter().flat_map(|result| &result.shares).map(|share| share.value);
    let most = values().map(f64::abs).fold(0.0, f64::max);
    if most <= 0.0 {
        return None;
    }
    // What is at one error lies side by side, in a part of the distance to the next one.
    let mut distinct: Vec<f64> = values().collect();
    distinct.sort_by(f64::total_cmp);
    let gaps = distinct.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 1e-9 * most);
    let gap = gaps.fold(2.0 * most, f64::min);
    let unit = if axis.turns() { 1f64.to_degrees() } else { 1e3 };
    let curves = objects.iter().zip(&results).enumerate().map(|(i, (object, result))| {
        let aside = 0.4 * gap * ((i as f64 + 0.5) / objects.len() as f64 - 0.5);
        Curve {
            label: object.object.clone(),
            points: fitted(result, most).map(|(x, share)| (unit * x, 100.0 * share)).collect(),
            dots: result
                .shares
                .iter()
                .map(|s| (unit * (s.value + aside), 100.0 * s.share, s.interval.map(|end| 100.0 * end)))
                .collect(),
            rug: single(sweep, &object.object, axis, 0.7 * gap).map(|(x, held)| (unit * x, held)).collect(),
            ..Curve::default()
        }
    });
    let (of, label) = match axis {
        Axis::X => ("along x, the approach", "error along x, mm: - too short, + too far"),
        Axis::Y => ("along y, the closing direction", "error along y, mm: - right, + left"),
        Axis::Z => ("along z, sideways", "error along z, mm"),
        Axis::Roll => ("in roll, about the approach", "roll error, degrees"),
        Axis::Pitch => ("in pitch, about the closing direction", "pitch error, degrees"),
        Axis::Yaw => ("in yaw, about the sideways axis", "yaw error, degrees"),
    };
    let names: Vec<&str> = objects.iter().map(|object| object.object.as_str()).collect();
    let x = PlotAxis::linear(label, unit * -(most + 0.4 * gap), unit * (most + 0.4 * gap));
    Some(figure(&format!("Errors {of}"), &names, x, curves.collect()))
}

/// Both halves of the fit, with a gap between them: either is of its own side alone.
fn fitted(result: &AxisResult, most: f64) -> impl Iterator<Item = (f64, f64)> {
    let [minus, plus] = &result.falls;
    let side = move |fall: &Option<Fall>, sign: f64| -> Vec<(f64, f64)> {
        let at = |fall: &Fall, i: usize| {
            let size = most * i as f64 / (POINTS - 1) as f64;
            (sign * size, fall.chance(size))
        };
        fall.iter().flat_map(|fall| (0..POINTS).map(move |i| at(fall, i))).collect()
    };
    let [minus, plus] = [side(minus, -1.0), side(plus, 1.0)];
    minus.into_iter().rev().chain([(0.0, f64::NAN)]).chain(plus)
}

/// Single grasps of an object under errors along an axis, those under the same error side by side over `width`.
fn single<'a>(
    sweep: &'a SweepSource,
    object: &'a str,
    axis: Axis,
    width: f64,
) -> impl Iterator<Item = (f64, bool)> + 'a {
    let along = sweep.lines.iter().filter(move |line| {
        line.object == object && (line.error.axis == Some(axis) || line.error.size() == [0.0, 0.0])
    });
    let mut cases: Vec<(f64, u64, bool)> =
        along.filter_map(|line| Some((line.error.value(axis), line.seed, line.held()?))).collect();
    cases.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let cells: Vec<Vec<(f64, u64, bool)>> =
        cases.chunk_by(|a, b| a.0 == b.0).map(<[(f64, u64, bool)]>::to_vec).collect();
    cells.into_iter().flat_map(move |cell| {
        let count = cell.len() as f64;
        let aside = move |i: usize| width * ((i as f64 + 0.5) / count - 0.5);
        cell.into_iter().enumerate().map(move |(i, (x, _, held))| (x + aside(i), held))
    })
}

/// Random errors by what they are in ADD-S and in ADD; none of errors along axes, whose size alone says little.
pub fn sizes(sweep: &SweepSource, objects: &[ObjectResult]) -> Result<Vec<String>> {
    type Size = fn(&GraspLine) -> f64;
    type Fit = fn(&ObjectResult) -> Option<&Fall>;
    let kinds: [(&str, Size, Fit); 2] =
        [("ADD-S", |l| l.adds_m, |o| o.adds.as_ref()), ("ADD", |l| l.add_m, |o| o.add.as_ref())];
    if objects.iter().all(|object| object.adds.is_none() && object.add.is_none()) {
        return Ok(Vec::new());
    }
    let figures = kinds.into_iter().map(|(name, size, fit)| {
        let mut cases: BTreeMap<&str, Vec<(f64, bool)>> = BTreeMap::new();
        for line in &sweep.lines {
            if let Some(held) = line.held() {
                cases.entry(&line.object).or_default().push((1e3 * size(line), held));
            }
        }
        let all = cases.values().flatten().map(|(mm, _)| *mm);
        let most = all.fold(0.0, f64::max).clamp(1.0, MOST_MM);
        let curves = objects.iter().take(MOST_CURVES).map(|object| {
            let cases = cases.get(object.object.as_str()).map_or([].as_slice(), Vec::as_slice);
            let xs = (0..POINTS).map(|i| most * i as f64 / (POINTS - 1) as f64);
            let chance = |fall: &Fall| xs.clone().map(|mm| (mm, 100.0 * fall.chance(1e-3 * mm))).collect();
            Curve {
                label: object.object.clone(),
                points: fit(object).map(chance).unwrap_or_default(),
                dots: binned(cases, most),
                rug: cases.iter().filter(|(mm, _)| *mm <= most).copied().collect(),
                ..Curve::default()
            }
        });
        let names: Vec<&str> = objects.iter().map(|object| object.object.as_str()).collect();
        let x = PlotAxis::linear(&format!("{name} of the pose, mm"), 0.0, most);
        plot::svg(&figure(&format!("Random errors by {name}"), &names, x, curves.collect()))
    });
    figures.collect()
}

/// Shares of cases in parts of the axis up to `most`, at their mean place, per cent.
fn binned(cases: &[(f64, bool)], most: f64) -> Vec<(f64, f64, [f64; 2])> {
    let mut parts: Vec<Vec<(f64, bool)>> = vec![Vec::new(); DOTS];
    for &(x, held) in cases.iter().filter(|(x, _)| *x <= most) {
        parts[((x / most * DOTS as f64) as usize).min(DOTS - 1)].push((x, held));
    }
    let dot = |part: &Vec<(f64, bool)>| {
        let (tried, held) = (part.len(), part.iter().filter(|(_, held)| *held).count());
        let mean = part.iter().map(|(x, _)| x).sum::<f64>() / tried as f64;
        let share = 100.0 * held as f64 / tried as f64;
        (mean, share, wilson(held, tried).map(|end| 100.0 * end))
    };
    parts.iter().filter(|part| !part.is_empty()).map(dot).collect()
}

/// One panel, named by what varies and by its objects.
fn figure(what: &str, names: &[&str], x: PlotAxis, mut curves: Vec<Curve>) -> Figure {
    let room = RUG[0] + RUG[1] * curves.len() as f64;
    if curves.len() > MOST_INTERVALS {
        let dots = curves.iter_mut().flat_map(|curve| &mut curve.dots);
        dots.for_each(|(_, share, interval)| *interval = [*share; 2]);
    }
    let mut shown = names.len();
    let title = |shown: usize| {
        let rest = names.len() - shown;
        let more = if rest > 0 { format!(" and {rest} more") } else { String::new() };
        format!("{}{more}", names[..shown].join(", "))
    };
    while shown > 1 && title(shown).len() > TITLE {
        shown -= 1;
    }
    Figure {
        title: what.to_owned(),
        columns: 1,
        panels: vec![Panel {
            title: title(shown),
            x,
            y: PlotAxis::linear("grasps held, %", 0.0, 100.0).with_room(room),
            curves,
            level: None,
        }],
    }
}
