//! The whole second stage on noisy synthetic frames: boxes and cans on a table before a Fetch-like camera.

use std::sync::Arc;

use grip_perception::{
    Clusters, Detection, Detections, Detector, Error, GripEstimator, GripSettings, PaperEstimator,
    PaperSettings, PoseEstimator, PosePosterior, WholeImage,
};
use grip_sim::mesh::Mesh;
use grip_sim::objects::ObjectModel;
use grip_sim::rng;
use grip_testkit::frames;
use grip_testkit::objects::{box_object, can_object, object};

use crate::adds;

fn groceries() -> Vec<Arc<ObjectModel>> {
    vec![
        box_object("cracker box", [0.072, 0.164, 0.213]),
        can_object("soup can", 0.034, 0.102),
        box_object("pudding box", [0.11, 0.089, 0.038]),
        can_object("tuna can", 0.0425, 0.0335),
        box_object("foam brick", [0.052, 0.078, 0.051]),
    ]
}

fn estimate(
    threads: usize,
    scene: &frames::Scene,
    detections: &Detections,
    asked: &[Arc<ObjectModel>],
    seed: u64,
) -> Vec<PosePosterior> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let estimator = GripEstimator::default();
    pool.install(|| estimator.estimate(&scene.frame, detections, asked, seed)).unwrap()
}

#[test]
fn finds_groceries_to_five_millimetres_and_tells_present_from_absent() {
    let models = groceries();
    let absent = can_object("pitcher", 0.065, 0.24);
    let (mut good, mut all) = (0, 0);
    for seed in 0..3 {
        let scene = frames::scene(&models, 0.01, &mut rng::stream(seed, "synthetic"));
        let mut asked: Vec<_> = scene.placed.iter().map(|(m, _)| m.clone()).collect();
        asked.push(absent.clone());
        let detections = Clusters::default().detect(&scene.frame, &asked).unwrap();
        let found = estimate(2, &scene, &detections, &asked, seed);
        for (p, (model, truth)) in found.iter().zip(&scene.placed) {
            let error = adds(model, truth, &p.best);
            println!(
                "{seed} {:12} ADD-S {:.1} mm score {:.3} confidence {:.2}",
                p.object,
                error * 1e3,
                p.score,
                p.confidence
            );
            all += 1;
            if error < 0.005 {
                good += 1;
                assert!(p.confidence > 0.5, "{}: confidence {}", p.object, p.confidence);
                assert!(p.position_std_m < 0.02, "{}: {} m", p.object, p.position_std_m);
            }
            let sum: f64 = p.particles.iter().map(|(_, w)| w).sum();
            assert!((sum - 1.0).abs() < 1e-9);
        }
        let p = &found[scene.placed.len()];
        println!("{seed} absent: score {:.3} confidence {:.2}", p.score, p.confidence);
        assert!(p.confidence < 0.2, "absent, but confidence {}", p.confidence);
    }
    assert!(good * 10 >= all * 9, "{good} of {all} under 5 mm");
}

#[test]
fn the_same_bits_whatever_the_number_of_threads() {
    let models = groceries();
    let scene = frames::scene(&models, 0.0, &mut rng::stream(11, "synthetic"));
    let detections = Clusters::default().detect(&scene.frame, &models).unwrap();
    let bits = |threads| {
        let mut found = estimate(threads, &scene, &detections, &models[..3], 5);
        for p in &mut found {
            p.seconds = 0.0;
        }
        serde_json::to_string(&found).unwrap()
    };
    let one = bits(1);
    assert_eq!(one, bits(2));
    assert_eq!(one, bits(1));
}

#[test]
fn two_of_a_kind_are_two_places() {
    let can = can_object("soup can", 0.034, 0.102);
    let scene = frames::scene(&[can.clone(), can.clone()], 0.05, &mut rng::stream(4, "synthetic"));
    let asked = [can.clone(), can.clone()];
    let detections = Clusters::default().detect(&scene.frame, &asked).unwrap();
    let found = estimate(2, &scene, &detections, &asked, 1);
    for (_, truth) in &scene.placed {
        let nearest = found.iter().map(|p| adds(&can, truth, &p.best)).fold(f64::MAX, f64::min);
        assert!(nearest < 0.005, "nearest estimate {nearest}");
    }
}

#[test]
fn a_trace_ends_at_the_answer_and_changes_nothing() {
    // Two of a kind: one of them may be searched a second time.
    let can = can_object("soup can", 0.034, 0.102);
    let scene = frames::scene(&[can.clone(), can.clone()], 0.05, &mut rng::stream(4, "synthetic"));
    let asked = [can.clone(), can];
    let detections = Clusters::default().detect(&scene.frame, &asked).unwrap();
    let ours = GripEstimator::default;
    let short = PaperSettings { samples: 50, iterations: 7, ..PaperSettings::default() };
    let paper = || PaperEstimator::new(short.clone()).unwrap();
    let pairs: [[Box<dyn PoseEstimator>; 2]; 2] =
        [[Box::new(ours()), Box::new(ours().traced())], [Box::new(paper()), Box::new(paper().traced())]];
    for [without, with] in pairs {
        let run =
            |estimator: &dyn PoseEstimator| estimator.estimate(&scene.frame, &detections, &asked, 1).unwrap();
        for (plain, traced) in run(&*without).into_iter().zip(run(&*with)) {
            assert!(plain.trace.is_empty());
            assert!(!serde_json::to_string(&plain).unwrap().contains("trace"));
            let points = &traced.trace;
            let last = points.last().unwrap();
            assert_eq!((last.best, last.hypotheses), (traced.best, traced.hypotheses));
            assert!(points.is_sorted_by(|a, b| a.hypotheses <= b.hypotheses && a.seconds <= b.seconds));
            assert!(last.seconds <= traced.seconds);
            if without.name() == "paper" {
                assert_eq!(points.len(), 7);
            }
            let bare = PosePosterior { trace: vec![], seconds: plain.seconds, ..traced.clone() };
            assert_eq!(bare, plain);
        }
    }
}

#[test]
fn no_detector_at_all_still_finds_a_lone_box() {
    let models = [box_object("cracker box", [0.072, 0.164, 0.213])];
    let scene = frames::scene(&models, 0.0, &mut rng::stream(8, "synthetic"));
    let detections = WholeImage.detect(&scene.frame, &models).unwrap();
    let found = estimate(2, &scene, &detections, &models, 2);
    let error = adds(&models[0], &scene.placed[0].1, &found[0].best);
    assert!(error < 0.005, "{error}");
}

#[test]
fn bad_input_is_named() {
    let can = can_object("soup can", 0.034, 0.102);
    let mut scene = frames::scene(std::slice::from_ref(&can), 0.05, &mut rng::stream(4, "synthetic"));
    let estimator = GripEstimator::default();
    let none = Detections::new();
    let empty = object("ghost", Mesh::default());
    let error = estimator.estimate(&scene.frame, &none, &[empty], 0).unwrap_err();
    assert!(error.to_string().contains("ghost") && error.to_string().contains("no triangles"), "{error}");
    scene.frame.depth.data_mut().fill(0.0);
    let error = estimator.estimate(&scene.frame, &none, std::slice::from_ref(&can), 0).unwrap_err();
    assert!(matches!(error, Error::Frame(_)), "{error}");
    assert!(Clusters::default().detect(&scene.frame, &[can]).is_err());
    let mut settings = GripSettings::default();
    settings.observation.epsilon_m = f64::NAN;
    let error = GripEstimator::new(settings).unwrap_err();
    assert!(
        error.to_string().contains("setting observation.epsilon_m = NaN: 0.0001 to 0.1 metres"),
        "{error}"
    );
}

#[test]
fn a_frame_of_garbage_gives_posteriors_without_confidence() {
    use rand::RngExt;
    let can = can_object("soup can", 0.034, 0.102);
    let mut scene = frames::scene(std::slice::from_ref(&can), 0.05, &mut rng::stream(4, "synthetic"));
    let mut rng = rng::stream(9, "garbage");
    for z in scene.frame.depth.data_mut() {
        *z = match rng.random_range(0..6) {
            0 => f32::NAN,
            1 => f32::INFINITY,
            2 => -1.0,
            _ => 3.0 * rng.random::<f32>(),
        };
    }
    let mut detections = Detections::new();
    detections.push("soup can", Detection { bbox: [-1e9, -50.0, 1e9, 1e9], confidence: 1.0 }).unwrap();
    let found = estimate(2, &scene, &detections, &[can], 0);
    assert!(found[0].best.is_finite() && found[0].confidence < 0.1, "{:?}", found[0].confidence);
}
