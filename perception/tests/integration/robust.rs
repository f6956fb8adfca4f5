//! Whatever the frame holds: an error that says what is wrong, or an object that is not there; never a panic, never a
//! number that is none.

use std::sync::Arc;
use std::time::{Duration, Instant};

use grip_perception::{
    Detection, Detections, GripEstimator, GripSettings, PaperEstimator, PaperSettings, PoseEstimator,
    PosePosterior, SupportSettings,
};
use grip_sim::camera::Intrinsics;
use grip_sim::frame::CameraFrame;
use grip_sim::images::{Image, RgbImage};
use grip_sim::objects::ObjectModel;
use grip_sim::pose::Pose;
use grip_sim::rng;
use grip_testkit::cameras::looking_down;
use grip_testkit::frames;
use grip_testkit::meshes::mesh;
use grip_testkit::objects::{box_object, can_object, object};
use nalgebra::Point3;
use rand::{Rng, RngExt};

fn frame(k: Intrinsics, depth: impl FnMut(usize, usize) -> f32) -> CameraFrame {
    CameraFrame { world_from_camera: looking_down(1.1, 0.9), ..frames::painted(k, depth) }
}

fn quick(samples: usize) -> PaperSettings {
    PaperSettings { samples, iterations: 3, ..PaperSettings::default() }
}

fn estimators() -> Vec<Box<dyn PoseEstimator>> {
    let guarded = PaperSettings::guarded();
    let mut without_support = GripSettings::default();
    without_support.observation.support = SupportSettings::off();
    vec![
        Box::new(GripEstimator::default()),
        Box::new(GripEstimator::new(without_support).unwrap()),
        Box::new(PaperEstimator::new(quick(60)).unwrap()),
        Box::new(PaperEstimator::new(PaperSettings { samples: 60, iterations: 3, ..guarded }).unwrap()),
    ]
}

fn boxed(object: &ObjectModel, bbox: [f64; 4]) -> Detections {
    let mut detections = Detections::new();
    detections.push(&object.info.name, Detection { bbox, confidence: 1.0 }).unwrap();
    detections
}

fn sane(p: &PosePosterior) {
    let numbers = p.best.iso().to_matrix();
    assert!(numbers.iter().all(|x| x.is_finite()), "{p:?}");
    assert!(p.score.is_finite() && (0.0..=1.0).contains(&p.confidence), "{p:?}");
    let sum: f64 = p.particles.iter().map(|(_, w)| w).sum();
    assert!((sum - 1.0).abs() < 1e-6 && p.particles.iter().all(|(_, w)| (0.0..=1.0).contains(w)), "{p:?}");
}

#[test]
fn a_frame_without_a_reading_is_refused() {
    let object = box_object("thing", [0.06, 0.09, 0.14]);
    let k = Intrinsics::FETCH;
    for value in [0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 1e30] {
        let empty = frame(k, |_, _| value);
        for detections in [boxed(&object, [200.0, 100.0, 300.0, 250.0]), Detections::new()] {
            for estimator in estimators() {
                let error = estimator.estimate(&empty, &detections, std::slice::from_ref(&object), 1);
                let message = error.unwrap_err().to_string();
                assert!(message.contains("no reading"), "{value}: {message}");
            }
        }
    }
}

#[test]
fn where_nothing_stands_nothing_is_there() {
    let object = box_object("thing", [0.06, 0.09, 0.14]);
    let k = Intrinsics::FETCH;
    // A wall, and a wall with readings in one corner only.
    for limit in [k.width, 40] {
        let wall = frame(k, |u, _| if u < limit { 1.2 } else { 0.0 });
        for detections in [boxed(&object, [200.0, 100.0, 300.0, 250.0]), Detections::new()] {
            let found = GripEstimator::default()
                .estimate(&wall, &detections, std::slice::from_ref(&object), 1)
                .unwrap();
            sane(&found[0]);
            assert!(found[0].confidence < 0.5, "{:?}", found[0]);
        }
    }
}

#[test]
fn boxes_without_area_or_outside_of_the_image_do_no_harm() {
    let object = box_object("thing", [0.06, 0.09, 0.14]);
    let wall = frame(Intrinsics::FETCH, |_, _| 1.2);
    for bbox in [
        [300.0, 200.0, 300.0, 200.0],
        [-500.0, -400.0, -100.0, -50.0],
        [2000.0, 1000.0, 2100.0, 1100.0],
        [-1e9, -1e9, -1e8, -1e8],
    ] {
        for estimator in estimators() {
            let found =
                estimator.estimate(&wall, &boxed(&object, bbox), std::slice::from_ref(&object), 1).unwrap();
            sane(&found[0]);
        }
    }
}

#[test]
fn objects_of_any_size_and_a_lonely_triangle_do_no_harm() {
    let k = Intrinsics::FETCH;
    let wall = frame(k, |_, v| 0.8 + 0.001 * v as f32);
    let corner = |x: f32, y: f32| Point3::new(x, y, 0.0);
    let objects = [
        box_object("larger than the image", [3.0, 3.0, 3.0]),
        box_object("a speck", [0.002, 0.002, 0.002]),
        box_object("a needle", [0.001, 0.001, 0.4]),
        object(
            "a triangle",
            mesh(vec![corner(-0.05, -0.05), corner(0.05, -0.05), corner(0.0, 0.05)], vec![[0, 2, 1]]),
        ),
    ];
    for object in objects {
        for estimator in estimators() {
            let found = estimator
                .estimate(
                    &wall,
                    &boxed(&object, [250.0, 150.0, 400.0, 300.0]),
                    std::slice::from_ref(&object),
                    1,
                )
                .unwrap();
            sane(&found[0]);
        }
    }
    // No surface at all, or one that is not finite: said, with the object's name.
    for positions in [vec![], vec![corner(f32::NAN, 0.0), corner(0.1, 0.0), corner(0.0, 0.1)]] {
        let triangles = if positions.is_empty() { vec![] } else { vec![[0, 1, 2]] };
        let object = object("broken", mesh(positions, triangles));
        for estimator in estimators() {
            let error = estimator.estimate(&wall, &Detections::new(), std::slice::from_ref(&object), 1);
            let message = error.unwrap_err().to_string();
            assert!(message.contains("broken") && message.contains("model"), "{message}");
        }
    }
}

/// A frame and boxes with little sense.
fn nonsense(random: &mut impl Rng) -> (CameraFrame, Detections, Vec<Arc<ObjectModel>>) {
    let width = random.random_range(8..200usize);
    let height = random.random_range(8..150usize);
    let focal = 10f64.powf(random.random_range(1.0..3.5));
    let k = Intrinsics {
        width,
        height,
        fx: focal,
        fy: focal * random.random_range(0.5..2.0),
        cx: random.random_range(-50.0..250.0),
        cy: random.random_range(-50.0..200.0),
    };
    let odd = [0.0, f32::NAN, f32::INFINITY, -0.7, 1e-30, 1e30, f32::MIN_POSITIVE, 65.535];
    let (base, slope) = (random.random_range(0.05..3.0f32), random.random_range(-0.01..0.01f32));
    let (noise, holes) = (10f32.powf(random.random_range(-4.0..0.5)), random.random::<f32>().powi(3));
    let steps = random.random_range(1..40usize);
    let mut depth = |u: usize, v: usize| {
        if random.random::<f32>() < holes {
            return odd[random.random_range(0..odd.len())];
        }
        let block = ((u / steps) * 7 + (v / steps) * 13) % 5;
        base + slope * v as f32 + 0.1 * block as f32 + noise * (random.random::<f32>() - 0.5)
    };
    let mut image = Image::filled(width, height, 0.0f32);
    for v in 0..height {
        for u in 0..width {
            *image.at_mut(u, v) = depth(u, v);
        }
    }
    let mut rgb = RgbImage::new(width as u32, height as u32);
    for byte in rgb.iter_mut() {
        *byte = random.random();
    }
    let frame = CameraFrame {
        rgb,
        depth: image,
        intrinsics: k,
        world_from_camera: Pose::from_xyz_rpy(
            std::array::from_fn(|_| random.random_range(-2.0..2.0)),
            std::array::from_fn(|_| random.random_range(-3.0..3.0)),
        ),
    };
    let count = random.random_range(1..4usize);
    let mut detections = Detections::new();
    let objects = (0..count)
        .map(|i| {
            let size = std::array::from_fn(|_| 10f32.powf(random.random_range(-2.5..0.3)));
            let object = match random.random_range(0..3) {
                0 => box_object(&format!("box {i}"), size),
                1 => can_object(&format!("can {i}"), size[0], size[1]),
                _ => {
                    let points = (0..12)
                        .map(|_| Point3::from(size.map(|s| s * (random.random::<f32>() - 0.5))))
                        .collect();
                    let triangles = (0..20).map(|_| std::array::from_fn(|_| random.random_range(0..12)));
                    object(&format!("soup {i}"), mesh(points, triangles.collect()))
                }
            };
            for _ in 0..random.random_range(0..6) {
                let wide = 10f64.powf(random.random_range(0.0..4.0));
                let bbox: [f64; 4] = std::array::from_fn(|_| random.random_range(-0.5..1.0) * wide);
                let confidence = random.random::<f64>();
                // Boxes that the detections refuse are refused with an error; that is all right.
                let _ = detections.push(&object.info.name, Detection { bbox, confidence });
            }
            object
        })
        .collect();
    (frame, detections, objects)
}

fn fuzz(case: u64) {
    let mut random = rng::stream(case, "fuzz");
    let (frame, detections, objects) = nonsense(&mut random);
    for estimator in estimators() {
        // Errors are answers too.
        for found in estimator.estimate(&frame, &detections, &objects, case).iter().flatten() {
            sane(found);
        }
    }
}

#[test]
fn random_frames_do_no_harm() {
    for case in 0..60 {
        fuzz(case);
    }
}

/// `cargo test --release -p grip-perception --test integration robust -- --ignored`
#[test]
#[ignore = "takes ten minutes"]
fn ten_minutes_of_random_frames_do_no_harm() {
    let began = Instant::now();
    let mut case = 1000;
    while began.elapsed() < Duration::from_secs(600) {
        if let Err(panic) = std::panic::catch_unwind(|| fuzz(case)) {
            println!("case {case}");
            std::panic::resume_unwind(panic);
        }
        case += 1;
    }
    println!("{} cases", case - 1000);
}
