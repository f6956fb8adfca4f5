//! Objects followed through frames of a camera that moves.

use std::sync::Arc;

use grip_perception::{Clusters, Detector, GripEstimator, PoseEstimator, PosePosterior};
use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Camera, Object, Pose};
use grip_sim::rng;
use grip_testkit::frames;
use grip_testkit::objects::{box_object, can_object};

use crate::adds;

type Placed = Vec<(Arc<ObjectModel>, Pose<Camera, Object>)>;

/// The scene as a camera sees it that has moved `steps` times by 8 mm and a degree, which is 20 mm as it sees the objects.
fn moved(scene: &frames::Scene, steps: i32, seen: &[usize]) -> (CameraFrame, Placed) {
    let n = f64::from(steps);
    let by = Pose::<Camera, Camera>::from_xyz_rpy([0.006 * n, -0.004 * n, 0.003 * n], [0.0, 0.0175 * n, 0.0]);
    let placed: Placed =
        scene.placed.iter().map(|(model, pose)| (model.clone(), by.inverse() * *pose)).collect();
    let there: Placed = seen.iter().map(|&i| placed[i].clone()).collect();
    let k = scene.frame.intrinsics;
    let world_from_camera = scene.frame.world_from_camera * by;
    let clean = frames::depth(&k, &world_from_camera, &there);
    let depth = frames::sensed(&clean, &k, &mut rng::stream(1, &format!("noise {steps}")));
    (CameraFrame { rgb: scene.frame.rgb.clone(), depth, intrinsics: k, world_from_camera }, placed)
}

fn scene() -> (frames::Scene, Vec<Arc<ObjectModel>>) {
    let models = [
        box_object("cracker box", [0.072, 0.164, 0.213]),
        can_object("soup can", 0.034, 0.102),
        box_object("pudding box", [0.11, 0.089, 0.038]),
    ];
    let scene = frames::scene(&models, 0.02, &mut rng::stream(3, "track"));
    let asked = scene.placed.iter().map(|(model, _)| model.clone()).collect();
    (scene, asked)
}

/// What is believed in each of the frames, one after the other.
fn tracked(
    estimator: &GripEstimator,
    asked: &[Arc<ObjectModel>],
    frames: &[CameraFrame],
) -> Vec<Vec<PosePosterior>> {
    let mut before: Vec<Option<PosePosterior>> = vec![None; asked.len()];
    let look = |frame: &CameraFrame| {
        let detections = Clusters::default().detect(frame, asked).unwrap();
        let found = estimator.follow(&before, frame, &detections, asked, 1).unwrap();
        before = found.iter().cloned().map(Some).collect();
        found
    };
    frames.iter().map(look).collect()
}

#[test]
fn objects_are_followed_with_few_hypotheses_and_searched_for_from_time_to_time() {
    let (scene, asked) = scene();
    let all: Vec<usize> = (0..asked.len()).collect();
    let sequence: Vec<_> = (0..12).map(|i: i32| moved(&scene, 3 - (i % 6 - 3).abs(), &all)).collect();
    let (frames, truths): (Vec<CameraFrame>, Vec<Placed>) = sequence.into_iter().unzip();
    let estimator = GripEstimator::default();
    let again = estimator.settings().track.search_again;
    let found = tracked(&estimator, &asked, &frames);
    for (i, (found, truth)) in found.iter().zip(&truths).enumerate() {
        for (p, (model, pose)) in found.iter().zip(truth) {
            let error = adds(model, pose, &p.best);
            assert!(error < 0.005, "frame {i}, {}: {:.1} mm", p.object, 1e3 * error);
            println!(
                "{i} {} {:.1} mm, {} hypotheses, score {:.3}",
                p.object,
                1e3 * error,
                p.hypotheses,
                p.score
            );
            assert_eq!(p.followed, i, "{}", p.object);
            // A search weighs hundreds.
            assert_eq!(p.hypotheses < 200, i % again != 0, "frame {i}, {}: {}", p.object, p.hypotheses);
        }
    }
    let bits = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut found = pool.install(|| tracked(&GripEstimator::default(), &asked, &frames[..3]));
        found.iter_mut().flatten().for_each(|p| p.seconds = 0.0);
        serde_json::to_string(&found).unwrap()
    };
    assert_eq!(bits(1), bits(2));
}

#[test]
fn what_is_taken_away_is_not_followed_and_found_again_where_it_is_put() {
    let (scene, asked) = scene();
    let (first, _) = moved(&scene, 0, &[0, 1, 2]);
    let (without, _) = moved(&scene, 0, &[0, 2]);
    // Back, and the camera elsewhere: the others are not where they were.
    let (back, truth) = moved(&scene, 3, &[0, 1, 2]);
    let found = tracked(&GripEstimator::default(), &asked, &[first, without, back]);
    assert!(found[0][1].there && found[0][1].confidence > 0.9);
    assert!(!found[1][1].there, "{} is believed: {}", asked[1].info.name, found[1][1].confidence);
    assert!(found[1][0].there && found[1][2].there);
    for (p, (model, pose)) in found[2].iter().zip(&truth) {
        let error = adds(model, pose, &p.best);
        assert!(p.there && error < 0.005, "{}: {:.1} mm, confidence {}", p.object, 1e3 * error, p.confidence);
    }
    assert_eq!(found[2][1].followed, 0);
}
