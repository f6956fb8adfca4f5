//! The page itself.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use crate::benchmark::quantile;
use anyhow::{Context, Result};

use super::calibration::calibration;
use super::origin::title;
use super::{Sources, SweepSource, figures, sweep_figures, why};
use crate::experiment::plan::Key;
use crate::experiment::summary::{Cell, cells, pairs};
use crate::experiment::sweep::errors::Axis;
use crate::experiment::sweep::fits::{Fall, ObjectResult, results};
use crate::experiment::sweep::layout::GraspOutcome;
use crate::graspers::GRIP;
use crate::html::{self, escape, picture, table};
use crate::plot::MOST_CURVES;

/// Films shown of trials that packed everything, and of others.
const GOOD_FILMS: usize = 3;
const BAD_FILMS: usize = 12;
/// Published distances at which half of the grasps fail, millimetres: a simulated parallel gripper that acted on the poses of
/// learned estimators, 5,348 trials.
const PUBLISHED_D50: [(&str, f64); 4] = [
    ("005_tomato_soup_can", 8.0),
    ("010_potted_meat_can", 11.2),
    ("003_cracker_box", 14.1),
    ("004_sugar_box", 26.3),
];

/// The page.
///
/// # Errors
/// When a film cannot be read, or a figure cannot be drawn.
pub fn html(sources: &Sources) -> Result<String> {
    let mut page = String::new();
    let (kind, title) = title(sources);
    let renderers: BTreeSet<&str> = sources.trials.iter().map(|trial| trial.renderer.as_str()).collect();
    let renderers: Vec<&str> = renderers.into_iter().collect();
    html::begin(&mut page, &kind, &title, (!renderers.is_empty()).then(|| renderers.join(", ")).as_deref());
    let rows = sources.origins.iter().map(|o| vec![o.folder.clone(), o.what(), o.program.clone()]);
    table(&mut page, &["folder", "what it is", "made by"], &[], rows);
    // Writing to a String cannot fail.
    for note in &sources.notes {
        let _ = write!(page, "<p class=note>{}</p>", escape(note));
    }
    let curves = sources.sweeps.iter().map(|sweep| results(&sweep.lines).len()).max().unwrap_or(0);
    if curves > MOST_CURVES {
        let _ = write!(
            page,
            "<p class=note>Figures have curves of the first {MOST_CURVES} of {curves} objects; tables have all.</p>"
        );
    }
    let by_cell = cells(&sources.trials);
    if !sources.trials.is_empty() {
        why::section(&mut page, sources, &by_cell);
        packed(&mut page, sources, &by_cell)?;
    }
    for (i, sweep) in sources.sweeps.iter().enumerate() {
        sweep_section(&mut page, sources, sweep, i)?;
    }
    for (name, svg) in &sources.figures {
        let _ = write!(page, "<h2>{}</h2>{svg}", escape(name));
    }
    films(&mut page, sources)?;
    page.push_str("</html>\n");
    Ok(page)
}

fn percent(share: f64) -> String {
    format!("{:.1}", 100.0 * share)
}

fn packed(page: &mut String, sources: &Sources, cells: &[Cell]) -> Result<()> {
    if cells.iter().any(|c| c.estimator.starts_with("truth")) {
        page.push_str(
            "<p class=note><b>Estimator truth</b> reads poses from the simulator: a ceiling, and no result.</p>",
        );
    }
    page.push_str("<h2>Items packed</h2>");
    page.push_str(&figures::packed(cells)?);
    let rows = cells.iter().map(|c| {
        vec![
            c.scene.clone(),
            c.condition.clone(),
            c.method(),
            c.trials.to_string(),
            c.full.to_string(),
            format!("{} of {}", c.packed, c.items),
            percent(c.share),
            c.interval.map(percent).join("-"),
            c.collisions.to_string(),
        ]
    });
    let header = [
        "scene",
        "condition",
        "estimator",
        "trials",
        "all packed",
        "items packed",
        "%",
        "95 %",
        "motions in collision",
    ];
    table(page, &header, &[3, 4, 5, 6, 7, 8], rows);
    page.push_str("<p>Intervals are Wilson's; items of one trial count as independent.</p>");
    if cells.iter().any(|c| c.grasper != GRIP) {
        page.push_str("<p>Behind a plus: who planned grasps, where that is not GRIP's own planner.</p>");
    }

    let pairs = pairs(&sources.trials);
    if !pairs.is_empty() {
        page.push_str("<h2>Pairs: the same items, two estimators</h2>");
        let rows = pairs.iter().map(|p| {
            let [both, first, second, none] = p.counts;
            vec![
                p.scene.clone(),
                p.condition.clone(),
                p.estimators.join(" and "),
                p.items.to_string(),
                both.to_string(),
                first.to_string(),
                second.to_string(),
                none.to_string(),
                p_value(p.p),
            ]
        });
        let header =
            ["scene", "condition", "estimators", "items", "both", "first alone", "second alone", "none", "p"];
        table(page, &header, &[3, 4, 5, 6, 7, 8], rows);
        page.push_str("<p>p: McNemar's test, exact, two-sided; items of one trial count as independent, so small values are too small.</p>");
    }

    if cells.iter().any(|c| c.packed < c.items) {
        page.push_str("<h2>Failures</h2>");
        page.push_str(&figures::failures(cells)?);
        let mut reasons: BTreeMap<[String; 4], usize> = BTreeMap::new();
        for trial in &sources.trials {
            for item in trial.items.iter().filter(|i| !i.reason.is_empty()) {
                let reason = without_numbers(&item.reason);
                let key = [&*trial.condition, &trial.method(), item.outcome.words(), &reason];
                let key = key.map(str::to_owned);
                *reasons.entry(key).or_default() += 1;
            }
        }
        let mut reasons: Vec<_> = reasons.into_iter().collect();
        reasons.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
        let rows = reasons.iter().take(40).map(|(key, n)| {
            let mut row = key.to_vec();
            row.push(n.to_string());
            row
        });
        table(page, &["condition", "estimator", "outcome", "why", "items"], &[4], rows);
    }
    if let Some(svg) = figures::calibration_errors(sources)? {
        page.push_str("<h2>Errors of calibration</h2>");
        page.push_str(&svg);
        page.push_str(
            "<p>Items packed against how far the camera was from where the robot believed it: kernel estimates with 95 % intervals, \
             of the conditions in which it was not always equally far.</p>",
        );
    }
    if let Some(svg) = figures::errors(sources)? {
        page.push_str("<h2>Estimates</h2>");
        page.push_str(&svg);
        page.push_str(
            "<p>Grasps that held: fingers, lift, carry and slip in the hand, wherever the item came to lie. Kernel \
             estimates with 95 % intervals; ADD-S is that of the last look before the last attempt.</p>",
        );
    }
    times(page, sources);
    Ok(())
}

/// A reason with an ellipsis for each number, so that equal ones are counted together.
fn without_numbers(reason: &str) -> String {
    let word = |word: &str| if word.parse::<f64>().is_ok() { "…".to_owned() } else { word.to_owned() };
    reason.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

fn times(page: &mut String, sources: &Sources) {
    let methods: BTreeSet<&str> = sources.timings.iter().map(|(name, _)| name.as_str()).collect();
    if methods.is_empty() {
        return;
    }
    page.push_str("<h2>Time, seconds</h2>");
    let rows = methods.into_iter().flat_map(|method| {
        let timings = || sources.timings.iter().filter(move |(name, _)| name == method).map(|(_, t)| t);
        let items = || timings().flat_map(|t| &t.items);
        let trials = sources.trials.iter().filter(move |t| t.method() == method);
        let simulated = trials.map(|t| t.sim_s / t.requested.max(1) as f64).collect();
        [
            ("trial, wall", timings().map(|t| t.wall_s).collect()),
            ("item: estimating its pose, wall", items().map(|t| t.estimate_s).collect()),
            ("item: planning, wall", items().map(|t| t.plan_s).collect()),
            ("item, simulated", simulated),
        ]
        .into_iter()
        .map(|(name, mut values): (&str, Vec<f64>)| {
            values.sort_by(f64::total_cmp);
            let sum: f64 = values.iter().sum();
            let at =
                |q: f64| if values.is_empty() { "-".into() } else { format!("{:.2}", quantile(&values, q)) };
            vec![
                method.to_owned(),
                name.to_owned(),
                values.len().to_string(),
                at(0.5),
                format!("{:.2}", sum / values.len().max(1) as f64),
                at(0.95),
            ]
        })
        .collect::<Vec<_>>()
    });
    table(page, &["estimator", "what", "of", "median", "mean", "95 % under"], &[2, 3, 4, 5], rows);
    page.push_str(
        "<p>Wall times are those of as many trials at a time as were run, films of failures included.</p>",
    );
}

/// A p value as text.
pub fn p_value(p: f64) -> String {
    if p < 0.001 { "< 0.001".into() } else { format!("{p:.3}") }
}

fn sweep_section(page: &mut String, sources: &Sources, sweep: &SweepSource, which: usize) -> Result<()> {
    let objects = results(&sweep.lines);
    let manifest = &sweep.manifest;
    let own = |field: &str, unit: &str, default: &str| {
        manifest[field].as_f64().map_or_else(|| default.to_owned(), |v| format!("{v}{unit}"))
    };
    let _ = write!(
        page,
        "<h2>Grasps under known pose errors: {}</h2><p>{} grasps at {} layouts an object, objects {}, grasps {}, friction {}, \
         force of a finger {}. Frame of the gripper: x approach, y closing, z sideways. A grasp has held when both fingers \
         pressed, the object was lifted clear, shaken, and moved by at most 20 mm and 20 degrees in the hand.</p>",
        escape(&sweep.name),
        sweep.lines.len(),
        manifest["seeds"],
        escape(manifest["object_set"].as_str().unwrap_or("-")),
        escape(manifest["strategy"].as_str().unwrap_or("-")),
        own("friction", "", "of each object"),
        own("force_n", " N", "as weight and friction need"),
    );
    let axes = sweep_figures::axes(sweep, &objects)?;
    if !axes.is_empty() {
        side_by_side(page, &axes);
        let mut header = vec!["object", "held without error, %"];
        let tried = |axis: &Axis| objects.iter().any(|o| o.axes.iter().any(|result| result.axis == *axis));
        let names = ["x mm", "y mm", "z mm", "roll deg", "pitch deg", "yaw deg"];
        let columns: Vec<(Axis, &str)> =
            Axis::ALL.into_iter().zip(names).filter(|(axis, _)| tried(axis)).collect();
        header.extend(columns.iter().map(|(_, name)| name));
        let right: Vec<usize> = (1..header.len()).collect();
        let d50 = ("half still hold (D50)", ", with its 95 % interval", true);
        for (title, interval, which) in [d50, ("nine tenths still hold (D90)", "", false)] {
            let _ = write!(page, "<p><b>Error at which {title}, to either side{interval}</b></p>");
            let rows = objects.iter().map(|o| {
                let without = o.without_error.as_ref().map_or("-".to_owned(), |s| {
                    format!("{} ({})", percent(s.share), s.interval.map(percent).join("-"))
                });
                let mut row = vec![o.object.clone(), without];
                row.extend(columns.iter().map(|&(axis, _)| {
                    let unit = if axis.turns() { 1f64.to_degrees() } else { 1e3 };
                    let Some(result) = o.axes.iter().find(|r| r.axis == axis) else { return "-".into() };
                    let [minus, plus] = result.falls.each_ref().map(|fall| shown(fall.as_ref(), which, unit));
                    format!("-{minus}; +{plus}")
                }));
                row
            });
            table(page, &header, &right, rows);
        }
        page.push_str("<p>…: beyond the errors tried; –: fewer hold even without an error.</p>");
    }
    side_by_side(page, &sweep_figures::sizes(sweep, &objects)?);
    // Errors along axes are not how poses err: their size says nothing.
    if objects.iter().any(|object| object.adds.is_some() || object.add.is_some()) {
        random_errors(page, &objects);
    }
    page.push_str("<p><b>What became of the grasps</b></p>");
    let kinds = [
        (GraspOutcome::Held, "held"),
        (GraspOutcome::CollisionOnApproach, "collision on approach"),
        (GraspOutcome::Missed, "missed"),
        (GraspOutcome::SlippedOnLift, "slipped on lift"),
        (GraspOutcome::LostInShake, "lost in the shake"),
        (GraspOutcome::SlippedInHand, "slipped in the hand"),
        (GraspOutcome::Unreachable, "out of reach"),
    ];
    let mut header = vec!["object"];
    header.extend(kinds.iter().map(|(_, name)| *name));
    let rows = objects.iter().map(|o| {
        let counts = kinds.iter().map(|(kind, _)| o.outcomes.get(kind).copied().unwrap_or(0).to_string());
        std::iter::once(o.object.clone()).chain(counts).collect()
    });
    table(page, &header, &[1, 2, 3, 4, 5, 6, 7], rows);

    if let Some(c) = calibration(sources, which) {
        page.push_str("<h2>Does the sweep predict the trials?</h2>");
        page.push_str(&figures::reliability(&c)?);
        let _ = write!(
            page,
            "<p>{} grasps in trials, of objects that the sweep knows: {} % held, {} % were predicted by the curves over \
             ADD-S. Brier score {:.4}; saying {} % of each would have {:.4}.</p>",
            c.grasps,
            percent(c.held),
            percent(c.predicted),
            c.brier,
            percent(c.held),
            c.brier_of_share
        );
    }
    Ok(())
}

/// What random errors of a size come to, object by object.
fn random_errors(page: &mut String, objects: &[ObjectResult]) {
    page.push_str("<p><b>Random errors</b></p>");
    let header = [
        "object",
        "grasps",
        "out of reach",
        "ADD-S: D50 mm",
        "D90 mm",
        "ADD: D50 mm",
        "D90 mm",
        "published D50 mm",
        "random errors: intercept",
        "a mm",
        "a degree",
    ];
    let rows = objects.iter().map(|o| {
        let published = PUBLISHED_D50.iter().find(|(name, _)| *name == o.object);
        let coefficient = |i: usize, unit: f64| {
            let value = o.isotropic.as_ref().and_then(|fit| fit.coefficients.get(i));
            value.map_or("-".to_owned(), |v| format!("{:.3}", v * unit))
        };
        vec![
            o.object.clone(),
            o.tried.to_string(),
            o.unreachable.to_string(),
            shown(o.adds.as_ref(), true, 1e3),
            shown(o.adds.as_ref(), false, 1e3),
            shown(o.add.as_ref(), true, 1e3),
            shown(o.add.as_ref(), false, 1e3),
            published.map_or("-".to_owned(), |(_, d50)| format!("{d50:.1}")),
            coefficient(0, 1.0),
            coefficient(1, 1e-3),
            coefficient(2, 1f64.to_radians()),
        ]
    });
    table(page, &header, &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10], rows);
    page.push_str(
        "<p>Published: a simulated parallel gripper on the poses of learned estimators, 5,348 trials, distance between poses. \
         Random errors: log odds of a grasp that holds.</p>",
    );
}

/// Figures as many in a row as there is room for.
fn side_by_side(page: &mut String, figures: &[String]) {
    if figures.is_empty() {
        return;
    }
    let _ = write!(page, "<div class=figures><div>{}</div></div>", figures.join("</div><div>"));
    page.push_str(
        "<p>Curves: the logistic fits of which D50 and D90 are read. Dots: shares of the grasps that held, of few objects \
         with 95 % intervals. Ticks: single grasps, above those that held, below those that did not.</p>",
    );
}

/// A D50 or D90 in units, the first with its interval.
fn shown(fall: Option<&Fall>, d50: bool, unit: f64) -> String {
    let number = |v: Option<f64>| v.map_or("…".to_owned(), |v| format!("{:.1}", unit * v));
    let Some(fall) = fall else { return "-".into() };
    let low_from_the_start = fall.chance(0.0) < if d50 { 0.5 } else { 0.9 };
    match (d50, low_from_the_start) {
        (_, true) => "–".into(),
        (true, _) if fall.d50.is_none() && fall.d50_interval == [None; 2] => "…".into(),
        (true, _) => {
            let [low, high] = fall.d50_interval.map(number);
            format!("{} ({low}-{high})", number(fall.d50))
        }
        (false, _) => number(fall.d90),
    }
}

fn films(page: &mut String, sources: &Sources) -> Result<()> {
    let full: BTreeMap<Key, bool> =
        sources.trials.iter().map(|trial| (Key::of(trial), trial.packed == trial.requested)).collect();
    for (good, most, title) in [
        (false, BAD_FILMS, "Films of trials that did not pack everything"),
        (true, GOOD_FILMS, "Films of trials that did"),
    ] {
        let which: Vec<_> = sources.films.iter().filter(|(key, _)| full.get(key) == Some(&good)).collect();
        if which.is_empty() {
            continue;
        }
        let _ = write!(page, "<h2>{title}: {} of {}</h2>", which.len().min(most), which.len());
        // Spread over them, so that not one condition alone is shown.
        for i in 0..most.min(which.len()) {
            let (key, path) = which[i * which.len() / most.min(which.len())];
            let film = std::fs::read(path).with_context(|| format!("{}: cannot be read", path.display()))?;
            let trial = sources.trials.iter().find(|t| &Key::of(t) == key);
            let failed: Vec<String> = trial
                .iter()
                .flat_map(|t| &t.items)
                .filter(|item| !item.reason.is_empty())
                .map(|item| format!("{}: {}, {}", item.name(), item.outcome.words(), item.reason))
                .collect();
            let Key { seed, scene, condition, .. } = key;
            let mut caption = format!("{scene}, {condition}, {}, seed {seed}", key.method());
            if !failed.is_empty() {
                caption += &format!(". {}", failed.join("; "));
            }
            page.push_str("<div class=look>");
            picture(page, "image/jpeg", &film, &escape(&caption));
            page.push_str("</div>");
        }
    }
    Ok(())
}
