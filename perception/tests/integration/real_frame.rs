//! One real frame of YCB-Video: five objects on a table, depth of a real structured-light camera.

use std::path::Path;
use std::sync::Arc;

use grip_perception::{
    ClusterSettings, Clusters, Detection, Detections, Detector, GripEstimator, GripSettings, PoseEstimator,
    SupportSettings,
};
use grip_sim::camera::Intrinsics;
use grip_sim::frame::CameraFrame;
use grip_sim::images::DepthImage;
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Camera, Object, Pose};
use grip_sim::rng;
use grip_testkit::data;
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion};
use rand::RngExt;
use serde_json::Value;

use crate::adds;

struct Real {
    frame: CameraFrame,
    objects: Vec<Arc<ObjectModel>>,
    truth: Vec<Pose<Camera, Object>>,
}

fn load(root: &Path) -> Real {
    let scene = root.join("test/000050");
    let json = |name: &str| -> Value {
        serde_json::from_str(&std::fs::read_to_string(scene.join(name)).unwrap()).unwrap()
    };
    let camera = &json("scene_camera.json")["1"];
    let k = |i: usize| camera["cam_K"][i].as_f64().unwrap();
    let to_metres = camera["depth_scale"].as_f64().unwrap() * 1e-3;
    let depth = image::open(scene.join("depth/000001.png")).unwrap().into_luma16();
    let (w, h) = depth.dimensions();
    let data = depth.pixels().map(|p| (f64::from(p.0[0]) * to_metres) as f32).collect();
    let frame = CameraFrame {
        rgb: image::open(scene.join("rgb/000001.png")).unwrap().into_rgb8(),
        depth: DepthImage::from_vec(w as usize, h as usize, data).unwrap(),
        intrinsics: Intrinsics {
            width: w as usize,
            height: h as usize,
            fx: k(0),
            fy: k(4),
            cx: k(2),
            cy: k(5),
        },
        // The data set does not tell the camera's pose in the world.
        world_from_camera: Pose::identity(),
    };
    let mut real = Real { frame, objects: vec![], truth: vec![] };
    for gt in json("scene_gt.json")["1"].as_array().unwrap() {
        let number = |key: &str, i: usize| gt[key][i].as_f64().unwrap();
        let rotation = Matrix3::from_fn(|i, j| number("cam_R_m2c", 3 * i + j));
        let t = Translation3::new(number("cam_t_m2c", 0), number("cam_t_m2c", 1), number("cam_t_m2c", 2));
        let t = Translation3::from(t.vector * 1e-3);
        let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
        real.truth.push(Pose::new(Isometry3::from_parts(t, q)));
        real.objects.push(data::bop_object(&root.join("models"), gt["obj_id"].as_u64().unwrap() as usize));
    }
    real
}

/// No world pose: the plane is whatever is largest.
fn support() -> SupportSettings {
    SupportSettings { max_tilt_rad: SupportSettings::ANY_TILT, ..Default::default() }
}

/// The box of the true pose jittered by 5 % of its sides, and the boxes of the other four as false ones: what a
/// mediocre network says. Not a result of ours: labelled so in the output.
fn truth_boxes(real: &Real, seed: u64) -> Detections {
    let mut rng = rng::stream(seed, "boxes");
    let boxes: Vec<[f64; 4]> = real
        .objects
        .iter()
        .zip(&real.truth)
        .map(|(o, t)| {
            let mut b = [f64::MAX, f64::MAX, f64::MIN, f64::MIN];
            for p in &o.visual.mesh.positions {
                let q = real.frame.intrinsics.project(&t.transform_point(&p.cast())).unwrap();
                b = [b[0].min(q.x), b[1].min(q.y), b[2].max(q.x), b[3].max(q.y)];
            }
            b
        })
        .collect();
    let mut detections = Detections::new();
    for (i, object) in real.objects.iter().enumerate() {
        for (j, b) in boxes.iter().enumerate() {
            let mut jitter = |x: f64, side: f64| x + 0.1 * (rng.random::<f64>() - 0.5) * side;
            let (w, h) = (b[2] - b[0], b[3] - b[1]);
            let bbox = [jitter(b[0], w), jitter(b[1], h), jitter(b[2], w), jitter(b[3], h)];
            let confidence = if i == j { 0.6 } else { 0.1 };
            detections.push(&object.info.name, Detection { bbox, confidence }).unwrap();
        }
    }
    detections
}

/// Errors (ADD-S, metres) of the five objects, printed.
fn run(real: &Real, detections: &Detections, settings: GripSettings, seed: u64, label: &str) -> Vec<f64> {
    let estimator = GripEstimator::new(settings).unwrap();
    let found = estimator.estimate(&real.frame, detections, &real.objects, seed).unwrap();
    println!("boxes: {label}, seed {seed}");
    found
        .iter()
        .zip(real.objects.iter().zip(&real.truth))
        .map(|(p, (object, truth))| {
            let error = adds(object, truth, &p.best);
            println!(
                "  {:22} ADD-S {:6.1} mm  score {:.3} confidence {:.2} restarts {} {:4.0} ms",
                p.object,
                error * 1e3,
                p.score,
                p.confidence,
                p.restarts,
                p.seconds * 1e3
            );
            error
        })
        .collect()
}

fn check(errors: &[f64]) {
    let good = errors.iter().filter(|e| **e < 0.01).count();
    assert!(good >= 4, "{good} of 5 under 1 cm: {errors:?}");
}

fn settings() -> GripSettings {
    let mut settings = GripSettings::default();
    settings.observation.support = support();
    settings
}

#[test]
fn finds_real_objects_from_depth_clusters() {
    let Some(root) = data::data("ycbv-real-frame") else {
        println!("SKIPPED: no shared/data/ycbv-real-frame");
        return;
    };
    let real = load(&root);
    let clusters = Clusters::new(ClusterSettings { support: support(), ..Default::default() }).unwrap();
    let detections = clusters.detect(&real.frame, &real.objects).unwrap();
    println!("{} clusters", detections.of(&real.objects[0].info.name).len());
    check(&run(&real, &detections, settings(), 1, "clusters"));
}

#[test]
fn finds_real_objects_from_mediocre_boxes() {
    let Some(root) = data::data("ycbv-real-frame") else {
        println!("SKIPPED: no shared/data/ycbv-real-frame");
        return;
    };
    let real = load(&root);
    check(&run(&real, &truth_boxes(&real, 1), settings(), 1, "true ones jittered 5 % and four false"));
}
