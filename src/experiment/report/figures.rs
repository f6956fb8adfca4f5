//! The figures of a page, as SVG.

use std::collections::BTreeMap;

use anyhow::Result;

use super::Sources;
use super::calibration::Calibration;
use crate::experiment::stats::kernel_share;
use crate::experiment::summary::Cell;
use crate::plot::bars::{self, Bar, Bars, MOST_SERIES};
use crate::plot::{self, Axis as PlotAxis, Curve, Figure, MOST_CURVES, Panel};
use crate::score::outcome::{FirstAttempt, Outcome};
use crate::setup::CalibrationRecord;

/// Largest errors shown of trials, millimetres, and width of the kernel there.
const MOST_MM: f64 = 40.0;
const TRIAL_KERNEL_MM: f64 = 1.5;
/// Kinds of failures that have a fill of their own.
const MOST_KINDS: usize = 13;
/// Points of a smooth curve.
const POINTS: usize = 81;

/// Shares of items packed, by scene and condition, with intervals. Several charts, where there are more methods than one can show.
pub fn packed(cells: &[Cell]) -> Result<String> {
    let group_of = group_of(cells);
    let (groups, methods) = names(cells, &group_of);
    let chart = |methods: &[String]| {
        let of = |group: &String, method: &String| {
            cells.iter().find(|&c| &group_of(c) == group && &c.method() == method)
        };
        let some = |group: &&String| methods.iter().any(|method| of(group, method).is_some());
        let groups: Vec<String> = groups.iter().filter(some).cloned().collect();
        let bar =
            |cell: &Cell| Bar { value: 100.0 * cell.share, interval: Some(cell.interval.map(|v| 100.0 * v)) };
        let series = methods.iter().map(|method| {
            let bars = groups.iter().map(|group| of(group, method).map(bar));
            (method.clone(), bars.collect())
        });
        bars::svg(&Bars {
            title: "Items packed, with 95 % intervals".into(),
            label: "items packed, %".into(),
            most: 100.0,
            stacked: false,
            series: series.collect(),
            groups,
        })
    };
    methods.chunks(MOST_SERIES).map(chart).collect()
}

/// Items that were not packed, by what became of them.
pub fn failures(cells: &[Cell]) -> Result<String> {
    let group = group_of(cells);
    let groups: Vec<String> = cells.iter().map(|c| format!("{}\n{}", group(c), c.method())).collect();
    let mut kinds: BTreeMap<&String, usize> = BTreeMap::new();
    for (kind, n) in cells.iter().flat_map(|c| &c.failures) {
        *kinds.entry(kind).or_default() += n;
    }
    let mut kinds: Vec<_> = kinds.into_iter().collect();
    kinds.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(b.0)));
    // More could not be told apart.
    let others: Vec<&String> =
        kinds.split_off(kinds.len().min(MOST_KINDS)).into_iter().map(|(kind, _)| kind).collect();
    let most = cells.iter().map(|c| c.items - c.packed).max().unwrap_or(0);
    let bar = |n: usize| (n > 0).then_some(Bar { value: n as f64, interval: None });
    let mut series: Vec<(String, Vec<Option<Bar>>)> = kinds
        .into_iter()
        .map(|(kind, _)| {
            let count = |c: &Cell| bar(c.failures.get(kind).copied().unwrap_or(0));
            (kind.clone(), cells.iter().map(count).collect())
        })
        .collect();
    if !others.is_empty() {
        let count = |c: &Cell| bar(others.iter().filter_map(|kind| c.failures.get(*kind)).sum());
        series.push(("other".into(), cells.iter().map(count).collect()));
    }
    bars::svg(&Bars {
        title: "Items not packed, by what became of them".into(),
        label: "items".into(),
        most: most as f64,
        stacked: true,
        groups,
        series,
    })
}

/// Share of grasps that held over ADD-S, and accuracy over threshold, by estimator and grasp planner.
pub fn errors(sources: &Sources) -> Result<Option<String>> {
    // Millimetres, infinite where there was no estimate; and whether the grasp held, where there was one.
    type Cases = (Vec<f64>, Vec<(f64, bool)>);
    let mut by_method: BTreeMap<String, Cases> = BTreeMap::new();
    for trial in sources.trials.iter().filter(|t| !t.estimator.starts_with("truth")) {
        let (all, tried) = by_method.entry(trial.method()).or_default();
        for item in &trial.items {
            all.push(item.adds_m.map_or(f64::INFINITY, |m| 1e3 * m));
            if let Some(FirstAttempt { adds_m: Some(m), held, .. }) = item.first_attempt {
                tried.push((1e3 * m, held));
            }
        }
    }
    if by_method.is_empty() {
        return Ok(None);
    }
    let xs = || (0..POINTS).map(|i| MOST_MM * i as f64 / (POINTS - 1) as f64);
    let held = by_method.iter().take(MOST_CURVES).map(|(name, (_, tried))| {
        smooth(format!("{name} ({} grasps)", tried.len()), tried, xs(), TRIAL_KERNEL_MM)
    });
    let accuracy = by_method.iter().take(MOST_CURVES).map(|(name, (all, _))| {
        let auc = grip_perception::metrics::auc(all, MOST_MM);
        let under = |x: f64| 100.0 * all.iter().filter(|e| **e <= x).count() as f64 / all.len().max(1) as f64;
        Curve {
            label: format!("{name}: AUC {:.1}", 100.0 * auc),
            points: xs().map(|x| (x, under(x))).collect(),
            ..Curve::default()
        }
    });
    let panel = |title: &str, x: &str, y: &str, curves: Vec<Curve>| Panel {
        title: title.into(),
        x: PlotAxis::linear(x, 0.0, MOST_MM),
        y: PlotAxis::linear(y, 0.0, 100.0),
        curves,
        level: None,
    };
    let figure = Figure {
        title: "Estimates in trials".into(),
        columns: 2,
        panels: vec![
            panel("First grasps that held", "ADD-S before the grasp, mm", "grasps held, %", held.collect()),
            panel("Accuracy", "threshold of ADD-S, mm", "items within, %", accuracy.collect()),
        ],
    };
    plot::svg(&figure).map(Some)
}

/// Share of items packed over how far off the camera was, a curve a condition and estimator; none where it was not, or always
/// equally far.
pub fn calibration_errors(sources: &Sources) -> Result<Option<String>> {
    type Of = fn(&CalibrationRecord) -> f64;
    let axes: [(&str, &str, f64, Of); 2] = [
        ("Shifted", "shift of the camera, mm", 5.0, |record| 1e3 * record.camera_shift_m),
        ("Turned", "turn of the camera, degrees", 0.5, |record| record.camera_turn_rad.to_degrees()),
    ];
    let mut panels = Vec::new();
    for (title, label, round_to, of) in axes {
        let mut cases: BTreeMap<String, Vec<(f64, bool)>> = BTreeMap::new();
        for trial in &sources.trials {
            let Some(record) = &trial.calibration else { continue };
            let items = trial.items.iter().map(|item| (of(record), item.outcome == Outcome::Packed));
            cases.entry(format!("{} {}", trial.condition, trial.estimator)).or_default().extend(items);
        }
        let ends = |cases: &[(f64, bool)]| {
            let xs = cases.iter().map(|(x, _)| *x);
            (xs.clone().fold(f64::INFINITY, f64::min), xs.fold(0.0, f64::max))
        };
        cases.retain(|_, cases| ends(cases).1 - ends(cases).0 > 0.2 * round_to);
        let most = cases.values().map(|cases| ends(cases).1).fold(0.0, f64::max);
        if cases.is_empty() {
            continue;
        }
        let most = (most / round_to).ceil() * round_to;
        let xs = || (0..POINTS).map(|i| most * i as f64 / (POINTS - 1) as f64);
        let curves = cases.iter().take(MOST_CURVES);
        panels.push(Panel {
            title: title.into(),
            x: PlotAxis::linear(label, 0.0, most),
            y: PlotAxis::linear("items packed, %", 0.0, 100.0),
            curves: curves
                .map(|(name, cases)| {
                    smooth(format!("{name} ({} items)", cases.len()), cases, xs(), most / 12.0)
                })
                .collect(),
            level: None,
        });
    }
    if panels.is_empty() {
        return Ok(None);
    }
    let figure = Figure {
        title: "Items packed by a camera that is not where it is believed".into(),
        columns: 2,
        panels,
    };
    plot::svg(&figure).map(Some)
}

/// Kernel shares of cases (x, held), per cent, where there are enough.
fn smooth(label: String, cases: &[(f64, bool)], xs: impl Iterator<Item = f64>, width: f64) -> Curve {
    let mut curve = Curve { label, ..Curve::default() };
    for x in xs {
        if let Some((share, [low, high])) = kernel_share(cases, x, width) {
            curve.points.push((x, 100.0 * share));
            curve.band.push((x, 100.0 * low, 100.0 * high));
        }
    }
    curve
}

/// Predicted against observed.
pub fn reliability(calibration: &Calibration) -> Result<String> {
    let percent = |v: f64| 100.0 * v;
    let points = calibration.bins.iter().map(|(p, _, share, _)| (percent(*p), percent(*share)));
    let band =
        calibration.bins.iter().map(|(p, _, _, [low, high])| (percent(*p), percent(*low), percent(*high)));
    let figure = Figure {
        title: "Does the sweep predict the trials?".into(),
        columns: 1,
        panels: vec![Panel {
            title: format!("{} grasps", calibration.grasps),
            x: PlotAxis::linear(
                "chance that the sweep's curve predicts at the estimate's ADD-S, %",
                0.0,
                100.0,
            ),
            y: PlotAxis::linear("grasps held, %", 0.0, 100.0),
            curves: vec![
                Curve {
                    label: "trials".into(),
                    points: points.collect(),
                    band: band.collect(),
                    ..Curve::default()
                },
                Curve {
                    label: "perfect prediction".into(),
                    points: vec![(0.0, 0.0), (100.0, 100.0)],
                    ..Curve::default()
                },
            ],
            level: None,
        }],
    };
    plot::svg(&figure)
}

/// Names of cells' scenes and conditions; the scene's only where there are several.
fn group_of(cells: &[Cell]) -> impl Fn(&Cell) -> String {
    let several = cells.iter().any(|cell| cell.scene != cells[0].scene);
    move |cell| if several { format!("{} {}", cell.scene, cell.condition) } else { cell.condition.clone() }
}

/// Groups and methods, in the order of the cells.
fn names(cells: &[Cell], group_of: impl Fn(&Cell) -> String) -> (Vec<String>, Vec<String>) {
    let mut groups: Vec<String> = Vec::new();
    let mut methods: Vec<String> = Vec::new();
    for cell in cells {
        let group = group_of(cell);
        if !groups.contains(&group) {
            groups.push(group);
        }
        let method = cell.method();
        if !methods.contains(&method) {
            methods.push(method);
        }
    }
    (groups, methods)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::summary::{cells, tests::trial};

    #[test]
    fn more_methods_than_a_chart_can_show_are_in_several() {
        let trials =
            (0..MOST_SERIES + 1).map(|i| trial(1, "base", &format!("e{i:02}"), &[("can", i > 0, None)]));
        let svg = packed(&cells(&trials.collect::<Vec<_>>())).unwrap();
        assert_eq!(svg.matches("<svg").count(), 2);
        assert!(svg.contains("e00") && svg.contains("e14"), "{svg}");
    }
}
