//! Accuracy and time of the filter over random synthetic scenes. `cargo run --release -p grip-perception --example
//! pose_accuracy -- [scenes] [gap in metres] [first seed] [settings such as restarts.most=1]
//! [builtin]`
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout)]

use std::collections::BTreeMap;
use std::path::Path;

use grip_perception::{Clusters, Detector, GripEstimator, GripSettings, PoseEstimator, metrics};
use grip_sim::objects::{ObjectLibrary, ObjectModel, ObjectSet};
use grip_sim::pose::{Camera, Object, Pose};
use grip_sim::rng;
use grip_testkit::{data, frames};
use rand::seq::SliceRandom;

/// CPU time of this thread, seconds: wall time means nothing on a shared machine.
fn cpu() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split(' ').next().and_then(|t| t.parse::<f64>().ok()).unwrap_or(0.0) * 1e-9
}

/// ADD-S, score, confidence, restarts, seconds.
type Row = (f64, f64, f64, f64, f64);

fn settings(arguments: &[String]) -> GripSettings {
    // Lines of a settings file: `restarts.most = 1`.
    toml::from_str(&arguments.join("\n")).unwrap()
}

fn adds(model: &ObjectModel, truth: &Pose<Camera, Object>, estimate: &Pose<Camera, Object>) -> f64 {
    let points = metrics::sample_points(&model.visual.mesh.positions, 1000);
    metrics::adds(&points, truth, estimate)
}

fn main() {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let overrides: Vec<String> = arguments.extract_if(.., |a| a.contains('=')).collect();
    let numbers: Vec<&String> = arguments.iter().filter(|a| *a != "builtin").collect();
    let scenes: u64 = numbers.first().map_or(10, |a| a.parse().unwrap());
    let first: u64 = numbers.get(2).map_or(1000, |a| a.parse().unwrap());
    let gap: f64 = numbers.get(1).map_or(0.01, |a| a.parse().unwrap());
    // The scans where they are at hand, else the built-in models.
    let ids = [2, 3, 4, 5, 6, 9, 10, 12, 13, 14, 15, 17, 18, 21];
    let scans = data::data("ycbv-real-frame/models").filter(|_| !arguments.iter().any(|a| a == "builtin"));
    let models: Vec<_> = match &scans {
        Some(folder) => ids.map(|i| data::bop_object(folder, i)).to_vec(),
        None => {
            let table = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/objects.toml");
            let library = ObjectLibrary::open(&table, ObjectSet::BuiltIn).unwrap();
            ids.map(|i| library.load(data::NAMES[i - 1]).unwrap()).to_vec()
        }
    };
    println!("models: {}", if scans.is_some() { "scans" } else { "built-in" });
    let estimator = GripEstimator::new(settings(&overrides)).unwrap();
    let detector = Clusters::default();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();

    let mut rows_of: BTreeMap<String, Vec<Row>> = BTreeMap::new();
    let mut absent: Vec<(f64, f64)> = Vec::new();
    let (mut detect_seconds, mut whole, mut searched) = (0.0, 0.0, 0usize);
    for n in 0..scenes {
        let mut rng = rng::stream(first + n, "accuracy");
        let mut chosen = models.clone();
        chosen.shuffle(&mut rng);
        let missing = chosen[5..7].to_vec();
        let scene = frames::scene(&chosen[..5], gap, &mut rng);
        let mut asked: Vec<_> = scene.placed.iter().map(|(m, _)| m.clone()).collect();
        asked.extend(missing);
        let start = cpu();
        let detections = detector.detect(&scene.frame, &asked).unwrap();
        detect_seconds += cpu() - start;
        let (found, spent) = pool.install(|| {
            // Warm the model cache: a trial prepares each model once.
            if n == 0 {
                estimator.estimate(&scene.frame, &detections, &models, n).unwrap();
            }
            let start = cpu();
            (estimator.estimate(&scene.frame, &detections, &asked, n).unwrap(), cpu() - start)
        });
        whole += spent;
        searched += asked.len();
        for (i, p) in found.iter().enumerate() {
            match scene.placed.get(i) {
                Some((model, truth)) => {
                    let error = adds(model, truth, &p.best);
                    if error > 0.01 {
                        println!(
                            "  scene {n} {}: {:.1} mm score {:.3} confidence {:.2} restarts {}",
                            p.object,
                            error * 1e3,
                            p.score,
                            p.confidence,
                            p.restarts
                        );
                    }
                    rows_of.entry(p.object.clone()).or_default().push((
                        error,
                        p.score,
                        p.confidence,
                        p.restarts as f64,
                        p.seconds,
                    ));
                }
                None => absent.push((p.score, p.confidence)),
            }
        }
    }
    println!(
        "{:24} {:>3} {:>6} {:>6} {:>8} {:>6} {:>6} {:>6} {:>7}",
        "object", "n", "<5mm", "<1cm", "median", "score", "conf", "starts", "ms"
    );
    let mut all = Vec::new();
    let row = |name: &str, rows: &[Row]| {
        let n = rows.len() as f64;
        let share = |most: f64| rows.iter().filter(|r| r.0 < most).count() as f64 / n;
        let mean = |f: fn(&Row) -> f64| rows.iter().map(f).sum::<f64>() / n;
        let mut errors: Vec<f64> = rows.iter().map(|r| r.0).collect();
        errors.sort_by(f64::total_cmp);
        println!(
            "{name:24} {:>3} {:6.2} {:6.2} {:6.2}mm {:6.3} {:6.2} {:6.1} {:7.0}",
            rows.len(),
            share(0.005),
            share(0.01),
            errors[errors.len() / 2] * 1e3,
            mean(|r| r.1),
            mean(|r| r.2),
            mean(|r| r.3),
            mean(|r| r.4) * 1e3
        );
    };
    for (name, rows) in &rows_of {
        row(name, rows);
        all.extend(rows.iter().copied());
    }
    row("all", &all);
    let quantile = |mut x: Vec<f64>, q: f64| {
        x.sort_by(f64::total_cmp);
        x[((x.len() - 1) as f64 * q) as usize]
    };
    let right: Vec<f64> = all.iter().filter(|r| r.0 < 0.01).map(|r| r.2).collect();
    let scores: Vec<f64> = all.iter().filter(|r| r.0 < 0.01).map(|r| r.1).collect();
    let confidences: Vec<f64> = absent.iter().map(|a| a.1).collect();
    let absent_scores: Vec<f64> = absent.iter().map(|a| a.0).collect();
    for (name, s, c) in [("right", &scores, &right), ("absent", &absent_scores, &confidences)] {
        println!(
            "{name:7} score 5/50/95 %: {:.3} {:.3} {:.3}  confidence {:.2} {:.2} {:.2}",
            quantile(s.clone(), 0.05),
            quantile(s.clone(), 0.5),
            quantile(s.clone(), 0.95),
            quantile(c.clone(), 0.05),
            quantile(c.clone(), 0.5),
            quantile(c.clone(), 0.95)
        );
    }
    println!(
        "CPU: clusters {:.1} ms a frame, estimate {:.0} ms a pose (frame preparation and conflicts included)",
        1e3 * detect_seconds / scenes as f64,
        1e3 * whole / searched as f64
    );
}
