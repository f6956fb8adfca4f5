//! The whole second stage with hypotheses rendered on a graphics adapter.

use std::time::Instant;

use grip_perception::{
    Clusters, Detector, GripEstimator, HypothesisRenderer, HypothesisRendererChoice, PoseEstimator,
};
use grip_sim::rng;
use grip_testkit::frames;
use grip_testkit::objects::{box_object, can_object};

use crate::adds;

/// Perfect depth, so that what is left is the search's own error.
#[test]
fn finds_known_poses_to_two_millimetres_and_repeats_them() {
    let renderer = match HypothesisRenderer::open(HypothesisRendererChoice::Gpu) {
        Ok(renderer) => renderer,
        Err(error) => {
            assert!(
                std::env::var_os("GRIP_REQUIRE_ADAPTER").is_none_or(|v| v != "1"),
                "GRIP_REQUIRE_ADAPTER=1, but {error}"
            );
            return println!("SKIPPED the search on the GPU: {error}");
        }
    };
    println!("{renderer}");
    assert_eq!(renderer.name(), "gpu");
    let models = [box_object("cracker box", [0.072, 0.164, 0.213]), can_object("soup can", 0.034, 0.102)];
    let mut scene = frames::scene(&models, 0.05, &mut rng::stream(3, "synthetic"));
    scene.frame.depth = frames::depth(&scene.frame.intrinsics, &scene.frame.world_from_camera, &scene.placed);
    let detections = Clusters::default().detect(&scene.frame, &models).unwrap();
    let estimate = |estimator: GripEstimator| {
        let began = Instant::now();
        let mut found = estimator.estimate(&scene.frame, &detections, &models, 7).unwrap();
        for (p, (model, truth)) in found.iter_mut().zip(&scene.placed) {
            let error = adds(model, truth, &p.best);
            println!(
                "{:12} ADD-S {:.2} mm, score {:.3}, {} hypotheses",
                p.object,
                1e3 * error,
                p.score,
                p.hypotheses
            );
            assert!(error < 0.002, "{}: ADD-S {error} m", p.object);
            p.seconds = 0.0;
        }
        println!("{:.0} ms", 1e3 * began.elapsed().as_secs_f64());
        serde_json::to_string(&found).unwrap()
    };
    let on_gpu = || estimate(GripEstimator::default().with_renderer(renderer.clone()));
    let first = on_gpu();
    assert_eq!(first, on_gpu(), "the same bits twice");
    estimate(GripEstimator::default());
}
