//! `grip pack`: a trial, its run folder, and what to print of it.

use std::path::PathBuf;

use crate::estimators::{DetectorKind, Estimator, EstimatorKind};
use crate::graspers::{GRIP, Grasper, GrasperKind};
use crate::pictures;
use crate::run_dir::RunDir;
use crate::score::outcome::TrialResult;
use crate::settings::SuccessCriteria;
use crate::setup::{GROCERY, Setup};
use crate::trial::{self, Pictures, TrialOptions, TrialRecord, bop, film, report};
use anyhow::{Result, ensure};
use grip_perception::HypothesisRenderer;
use grip_sim::objects::ObjectSet;
use grip_sim::render;

use super::Done;
use super::output::{self, Bar};
use crate::cli::PackArgs;

/// Folder of the recording in a run's folder.
const RECORD: &str = "record";

/// Packs, saves the run, prints the score.
pub fn run(args: &PackArgs) -> Result<Done> {
    // What a full disk or a wrong --out would spoil is found out before the work, not after it.
    let named = args.out.as_deref().map(RunDir::begin).transpose()?;
    let options = args.scene.options(GROCERY, &args.condition)?;
    let mut setup = Setup::load(&options)?;
    if args.bop {
        bop::check_seed(setup.seed)?;
    }
    if args.estimator == EstimatorKind::Grip {
        setup.hypotheses = HypothesisRenderer::open(args.hypotheses.into())?;
    }
    let run = match named {
        Some(run) => run,
        None => RunDir::begin(&default_folder(args, &setup))?,
    };
    let most = setup.packable();
    let items = args.items.unwrap_or(most);
    ensure!(
        (1..=most).contains(&items),
        "--items {items}: the scene has {most} objects that can be packed; give 1 to {most}"
    );
    let (detector, network) = (args.detector.into(), args.network.options());
    network.check_used(
        args.estimator.second_stage().is_some() && detector == DetectorKind::Pyramid,
        "--detector pyramid and --estimator grip or paper",
    )?;
    ensure!(
        args.estimator.second_stage().is_some() || network.min_confidence == 0.0,
        "--min-confidence is for --estimator grip or paper; leave it out"
    );
    ensure!(
        args.grasps.is_none() || args.grasper == GrasperKind::Grip,
        "--grasps is for --grasper grip; leave one of them out"
    );
    let estimator = Estimator::open(&setup, &args.estimator, detector, &network)?;
    let grasper = Grasper::open(&setup, &args.grasper)?;
    let planner = setup.planner_with_grasps(args.grasps.as_deref())?;
    let mut renderer = render::open(args.scene.renderer.into())?;
    let options = TrialOptions {
        estimator: args.estimator.name(),
        grasper,
        items: Some(items),
        grasps: args.grasps.clone(),
        pictures: Pictures::All { record: args.animation },
        record: args.record.options(&args.record_rate),
    };
    let progress = Bar::spinner();
    let trial = trial::run(&setup, &estimator, &planner, renderer.as_mut(), options, &progress);
    progress.finish();
    let trial = trial?;

    save(&run, &trial)?;
    if args.bop {
        bop::write(&run.folder("bop")?, &setup, &trial.looks)?;
    }
    let folder = run.finish()?;
    if args.json {
        output::data(format_args!("{}", serde_json::to_string_pretty(&trial.result)?))?;
    } else {
        output::data(format_args!("{}", table(&trial.result)))?;
        if args.strict {
            output::data(format_args!("\n{}", clauses(&trial.result, &setup.settings.success)))?;
        }
    }
    output::made("report", &folder.join("report.html"));
    let packed = trial.result.packed == trial.result.requested;
    let touched = !trial.result.motion_check.collisions.is_empty();
    Ok(if packed && !touched { Done::Fully } else { Done::Short })
}

fn default_folder(args: &PackArgs, setup: &Setup) -> PathBuf {
    let mut parts = vec![setup.cell.scene.name.clone(), setup.condition.name.clone(), args.estimator.name()];
    let detector = DetectorKind::from(args.detector);
    if detector != DetectorKind::Pyramid {
        parts.push(detector.name().into());
    }
    if let Some(model) = &args.network.detector_model {
        parts.push(model.label());
    }
    if args.network.min_confidence > 0.0 {
        parts.push(format!("min-confidence-{}", args.network.min_confidence));
    }
    let set = setup.object_set();
    if set != ObjectSet::BuiltIn.label() {
        parts.push(set);
    }
    if setup.hypotheses.name() != "cpu" {
        parts.push(setup.hypotheses.name().into());
    }
    if args.grasper != GrasperKind::Grip {
        parts.push(args.grasper.name());
    }
    if args.grasps.is_some() {
        parts.push("grasps".into());
    }
    if let Some(file) = &args.scene.settings.settings {
        parts.push(file.file_stem().unwrap_or_default().to_string_lossy().into_owned());
    }
    if let Some(items) = args.items {
        parts.push(format!("items{items}"));
    }
    parts.push(args.scene.seed.to_string());
    PathBuf::from("runs").join(parts.join("-"))
}

fn save(run: &RunDir, trial: &TrialRecord) -> Result<()> {
    run.write("scenario.json", serde_json::to_string_pretty(trial.scenario.json())?)?;
    run.write("result.json", serde_json::to_string_pretty(&trial.result)?)?;
    for (i, look) in trial.looks.iter().enumerate() {
        run.write(&format!("frames/{i:02}_rgb.png"), pictures::rgb_png(&look.rgb)?)?;
        run.write(&format!("frames/{i:02}_depth.png"), pictures::depth_png_mm(&look.depth)?)?;
        run.write(&format!("frames/{i:02}_overlay.png"), pictures::rgb_png(&look.overlay)?)?;
        if let Some((bright, _)) = pictures::brightened(&look.rgb) {
            run.write(&format!("frames/{i:02}_bright.png"), pictures::rgb_png(&bright)?)?;
        }
    }
    if let Some(after) = &trial.after {
        run.write("frames/end_rgb.png", pictures::rgb_png(after)?)?;
    }
    if let Some(summary) = report::summary(trial) {
        run.write("summary.png", pictures::rgb_png(&summary)?)?;
    }
    if !trial.strips.is_empty() {
        run.write("film.jpg", pictures::jpeg(&film::sheet(&trial.strips))?)?;
    }
    if let Some(replay) = &trial.replay {
        run.write("replay.png", replay)?;
    }
    if let Some(recording) = &trial.recording {
        for (name, content) in recording.files()? {
            run.write(&format!("{RECORD}/{name}"), content)?;
        }
        recording.add_mcap(&run.folder(RECORD)?)?;
    }
    run.write("report.html", report::html(trial)?)
}

/// Each clause of each item that was tried, with its value and its bound.
fn clauses(result: &TrialResult, bound: &SuccessCriteria) -> String {
    let rows = result.items.iter().filter(|item| item.attempts > 0).flat_map(|item| {
        let m = &item.measures;
        let values = [
            format!(
                "{:.1} N, dot product {:.2} (at least {} N for {:.0} ms, at most {})",
                m.pinch_n,
                m.pinch_dot,
                bound.finger_force_n,
                1e3 * bound.pinch_s,
                bound.opposing_dot
            ),
            format!("rose {:.0} mm (at least {:.0}, touching nothing)", 1e3 * m.risen_m, 1e3 * bound.lift_m),
            format!("for {:.2} s at the end of the carry (at least {})", m.clear_s, bound.hold_s),
            format!(
                "{:.1} mm and {:.1} degrees (at most {:.0} and {:.0})",
                1e3 * m.slip_m,
                m.slip_deg,
                1e3 * bound.slip_m,
                bound.slip_deg
            ),
            format!(
                "{:.0} mm below the edge, {:.1} mm/s, moved by {:.1} mm in the last second (centre within the walls, under {:.0} mm/s, touching only bin and items)",
                1e3 * m.below_edge_m,
                1e3 * m.speed_m_s,
                1e3 * m.moved_m,
                1e3 * bound.at_rest_m_s
            ),
            format!("leans {:.0} degrees (at most {:.0} if it must stand)", m.tilt_deg, bound.tilt_deg),
            format!(
                "fell by {:.0} mm, at up to {:.2} m/s (at most {:.0} mm and {:.2} m/s)",
                1e3 * m.release_m,
                m.landing_m_s,
                1e3 * bound.release_m,
                bound.landing_m_s
            ),
            format!(
                "largest blow {:.2} N s (harmless: {:.2} N s{})",
                m.packed_impulse_n_s,
                item.harmless_impulse_n_s,
                if bound.unharmed { "" } else { ", not asked for" }
            ),
            format!("{} other items (none)", m.knocked_out),
        ];
        item.clauses.by_name().into_iter().zip(values).enumerate().map(|(i, ((name, holds), value))| {
            let object = if i == 0 { item.name() } else { String::new() };
            [object, name.to_string(), if holds { "yes" } else { "NO" }.to_string(), value]
        })
    });
    output::table(["object", "clause", "holds", "measured"], &[], rows)
}

fn table(result: &TrialResult) -> String {
    let mm = |metres: Option<f64>| metres.map_or("-".to_string(), |m| format!("{:.1}", m * 1e3));
    let rows = result.items.iter().map(|item| {
        [
            item.name(),
            item.outcome.words().to_string(),
            mm(item.adds_m),
            mm(item.slip_m),
            format!("{:.0}", item.peak_force_n),
            item.attempts.to_string(),
            item.reason.clone(),
        ]
    });
    let header = ["object", "outcome", "ADD-S mm", "slip mm", "peak N", "tries", "why"];
    let table = output::table(header, &[2, 3, 4, 5], rows);
    let hypotheses = if result.hypotheses == "cpu" { "" } else { ", hypotheses: gpu" };
    let grasper =
        if result.grasper == GRIP { String::new() } else { format!(", grasps of {}", result.grasper) };
    let collisions: String = (result.motion_check.collisions.iter())
        .map(|c| {
            let depth_mm = 1e3 * c.depth_m;
            format!("\nin collision after {:.3} s: {}, {depth_mm:.1} mm deep", c.time_s, c.bodies)
        })
        .collect();
    let score = &result.score;
    let wall_s = result.timing.as_ref().map_or(0.0, |timing| timing.wall_s);
    let mark = if result.estimator == "truth" { " [estimator: truth, a ceiling and no result]" } else { "" };
    format!(
        "{table}\n\n{} of {} packed in {:.1} s ({:.1} s simulated), objects: {}, renderer: {}{hypotheses}{grasper}{mark}\n{score}{collisions}",
        result.packed, result.requested, wall_s, result.sim_s, result.object_set, result.renderer
    )
}
