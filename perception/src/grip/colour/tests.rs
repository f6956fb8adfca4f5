//! What colour decides, on frames that are painted from the same function as the models.

use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use grip_sim::frame::CameraFrame;
use grip_sim::mesh::{Material, Mesh, Visual};
use grip_sim::objects::ObjectModel;
use grip_sim::render::srgb::from_linear;
use grip_sim::rng;
use grip_testkit::objects::info;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::grip::{GripEstimator, GripSettings};
use crate::hypotheses::Cpu;
use crate::hypotheses::tests::shown;
use crate::particles::ScoredPose;
use crate::support::SupportSettings;
use crate::{Detection, Detections, PoseEstimator, PosePosterior};

/// Linear RGB of a place on the surface, object frame.
type Paint = fn(&Vector3<f32>) -> [f32; 3];

const SIZE: [f32; 3] = [0.06, 0.16, 0.21];
const RADIUS: f32 = 0.034;
const HEIGHT: f32 = 0.1;

fn encoded(linear: f32) -> u8 {
    (255.0 * from_linear(linear.clamp(0.0, 1.0)) + 0.5) as u8
}

/// A model of a closed surface given as a grid of `u` by `v` patches, with a colour a vertex.
fn object(sheets: &[&dyn Fn(f32, f32) -> Vector3<f32>], paint: Paint) -> Arc<ObjectModel> {
    let side = 48u32;
    let mut mesh = Mesh::default();
    for sheet in sheets {
        let first = mesh.positions.len() as u32;
        for i in 0..=side {
            for j in 0..=side {
                let p = sheet(i as f32 / side as f32, j as f32 / side as f32);
                mesh.positions.push(Point3::from(p));
                mesh.colors.push(paint(&p).map(encoded));
            }
        }
        for i in 0..side {
            for j in 0..side {
                let a = first + i * (side + 1) + j;
                let (b, c, d) = (a + 1, a + side + 1, a + side + 2);
                mesh.triangles.extend([[a, c, b], [b, c, d]]);
            }
        }
    }
    mesh.normals = vec![Vector3::z(); mesh.positions.len()];
    let material = Material { base_color: [1.0; 3], ..Material::default() };
    Arc::new(ObjectModel::new(info("thing"), Visual { mesh: Arc::new(mesh), material }, vec![]))
}

/// A box whose sides along x shrink by `taper` towards +y.
fn box_object(paint: Paint, taper: f32) -> Arc<ObjectModel> {
    let at = move |x: f32, y: f32, z: f32| {
        let narrow = 1.0 - taper * y;
        Vector3::new((x - 0.5) * SIZE[0] * narrow, (y - 0.5) * SIZE[1], (z - 0.5) * SIZE[2])
    };
    object(
        &[
            &|a, b| at(0.0, b, a),
            &|a, b| at(1.0, a, b),
            &|a, b| at(a, 0.0, b),
            &|a, b| at(b, 1.0, a),
            &|a, b| at(b, a, 0.0),
            &|a, b| at(a, b, 1.0),
        ],
        paint,
    )
}

fn box_model(paint: Paint, taper: f32) -> Model {
    Model::new(&box_object(paint, taper), &[1000]).unwrap()
}

fn can_model(paint: Paint) -> Model {
    let round = |a: f32, r: f32, z: f32| Vector3::new(r * (TAU * a).cos(), r * (TAU * a).sin(), z * HEIGHT);
    let can = object(
        &[&|a, b| round(a, RADIUS, b - 0.5), &|a, b| round(a, RADIUS * b, -0.5), &|a, b| {
            round(a, RADIUS * (1.0 - b), 0.5)
        }],
        paint,
    );
    Model::new(&can, &[1000]).unwrap()
}

/// Red in front and blue behind, with a pale band and a dark corner.
fn two_coloured(p: &Vector3<f32>) -> [f32; 3] {
    match (p.x * SIZE[1] + 0.3 * p.y * SIZE[0] > 0.0, p.z) {
        (_, z) if z > 0.06 && z < 0.08 => [0.7, 0.65, 0.5],
        (true, z) if z < -0.05 => [0.25, 0.05, 0.03],
        (true, _) => [0.55, 0.08, 0.05],
        (false, _) => [0.06, 0.1, 0.5],
    }
}

fn uniform(_: &Vector3<f32>) -> [f32; 3] {
    [0.4, 0.3, 0.1]
}

/// Metal ends; around the side stripes of unequal widths and colours, that lean.
fn striped(p: &Vector3<f32>) -> [f32; 3] {
    if p.z.abs() > 0.49 * HEIGHT {
        return [0.5; 3];
    }
    let turn = ((p.y.atan2(p.x) / TAU + 0.8 * p.z / HEIGHT * 0.1) * 100.0).rem_euclid(100.0);
    match turn as u32 {
        0..12 => [0.6, 0.05, 0.05],
        12..30 => [0.7, 0.7, 0.65],
        30..35 => [0.05, 0.3, 0.1],
        35..58 => [0.1, 0.1, 0.45],
        58..64 => [0.7, 0.7, 0.65],
        64..80 => [0.65, 0.5, 0.05],
        _ => [0.3, 0.3, 0.32],
    }
}

/// How a frame is lit and seen.
#[derive(Clone, Copy)]
struct Light {
    brightness: f32,
    tint: [f32; 3],
    /// Standard deviation, linear light.
    noise: f32,
    seed: u64,
}

const DAY: Light = Light { brightness: 1.0, tint: [1.0; 3], noise: 0.004, seed: 1 };

/// The model at a pose before a grey wall 1.5 m away, shaded from one side.
fn frame(model: &Model, paint: Paint, pose: &Isometry3<f32>, light: Light) -> CameraFrame {
    let mut frame = shown(model, pose, 1.5);
    let k = frame.intrinsics;
    let mut random = rng::stream(light.seed, "picture");
    for v in 0..k.height {
        for u in 0..k.width {
            let z = *frame.depth.at(u, v);
            let p = k.back_project(u as f64, v as f64, f64::from(z)).cast::<f32>();
            let colour = if z < 1.4 { paint(&pose.inverse_transform_point(&p).coords) } else { [0.25; 3] };
            let shade = light.brightness * (0.8 + 2.0 * p.x);
            let mut seen = |c: usize| {
                let noise: f32 = StandardNormal.sample(&mut random);
                encoded(shade * light.tint[c] * colour[c] + light.noise * noise)
            };
            frame.rgb.put_pixel(u as u32, v as u32, image::Rgb([seen(0), seen(1), seen(2)]));
        }
    }
    frame
}

fn grip_settings() -> GripSettings {
    let mut settings = GripSettings::default();
    settings.observation.support = SupportSettings::off();
    settings
}

/// What colour makes of `start` in the frame.
fn decided(
    model: &Model,
    frame: &CameraFrame,
    start: &Isometry3<f32>,
    settings: &ColourSettings,
) -> (Isometry3<f32>, Option<ColourVerdict>) {
    let grip = grip_settings();
    let observation = Observation::new(frame, &grip.observation, None);
    let mut renderer = Cpu::default();
    let mut search = Search::new(model, &observation, &[], &grip, &mut renderer);
    let best = search.polished(vec![*start]).unwrap()[0];
    let mut found = SearchResult {
        best,
        population: Vec::<ScoredPose>::new(),
        others: Vec::new(),
        restarts: 1,
        agreeing: 1,
        hypotheses: 1,
        box_confidence: 1.0,
        trace: Vec::new(),
    };
    let picture = Picture::new(frame).unwrap();
    let verdict = decide(model, &mut found, &observation, &picture, &mut search, settings);
    (found.best.pose, verdict.map(|verdict| verdict.unwrap()))
}

fn placed(turn: Vector3<f32>) -> Isometry3<f32> {
    Isometry3::from_parts(Translation3::new(0.03, -0.02, 0.7), UnitQuaternion::from_scaled_axis(turn))
}

/// Standing, seen from obliquely above, turned about the vertical by `yaw`.
fn standing(yaw: f32) -> Isometry3<f32> {
    let tilt = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2 + 0.6);
    placed(Vector3::zeros()) * tilt * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw)
}

fn half_turns() -> [UnitQuaternion<f32>; 3] {
    [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()]
        .map(|axis| UnitQuaternion::from_axis_angle(&axis, PI))
}

fn off(a: &Isometry3<f32>, b: &Isometry3<f32>) -> f32 {
    a.rotation.angle_to(&b.rotation).to_degrees()
}

/// How the print of the model at a pose agrees with the frame.
fn agreement(model: &Model, frame: &CameraFrame, pose: &Isometry3<f32>) -> Agreement {
    let observation = Observation::new(frame, &grip_settings().observation, None);
    let picture = Picture::new(frame).unwrap();
    let settings = ColourSettings::default();
    let view = View::new(model.print().unwrap(), pose, &observation, &picture, &settings).unwrap();
    view.agreement(pose).unwrap()
}

#[test]
fn print_and_picture_agree_whatever_the_light() {
    for (model, paint) in
        [(box_model(two_coloured, 0.0), two_coloured as Paint), (can_model(striped), striped)]
    {
        let truth = standing(0.4);
        let day = agreement(&model, &frame(&model, paint, &truth, DAY), &truth);
        assert!(day.total > 0.6 && day.shift == [0, 0], "{day:?}");
        for light in
            [Light { brightness: 0.3, ..DAY }, Light { tint: [1.0, 0.7, 0.5], brightness: 0.6, ..DAY }]
        {
            let other = agreement(&model, &frame(&model, paint, &truth, light), &truth);
            assert!((other.total - day.total).abs() < 0.15, "{day:?} {other:?}");
        }
        let wrong = agreement(&model, &frame(&model, paint, &truth, DAY), &(truth * half_turns()[2]));
        assert!(wrong.total < day.total - 0.3, "{day:?} {wrong:?}");
    }
}

#[test]
fn colour_beside_depth_is_found_there() {
    let model = box_model(two_coloured, 0.0);
    let truth = standing(0.4);
    let straight = frame(&model, two_coloured, &truth, DAY);
    let mut beside = straight.clone();
    for (u, v, pixel) in beside.rgb.enumerate_pixels_mut() {
        let from = |at: u32, by: i32, size: u32| (at as i32 - by).clamp(0, size as i32 - 1) as u32;
        let size = straight.rgb.dimensions();
        *pixel = *straight.rgb.get_pixel(from(u, 4, size.0), from(v, -4, size.1));
    }
    let (straight, beside) = (agreement(&model, &straight, &truth), agreement(&model, &beside, &truth));
    // The shift is a whole number of pixels of the level, and costs.
    assert!(beside.shift[0] > 0 && beside.shift[1] < 0, "{beside:?}");
    assert!(beside.total > straight.total - 0.25, "{straight:?} {beside:?}");
}

#[test]
fn a_box_turned_by_half_a_turn_is_put_right_in_any_light() {
    let model = box_model(two_coloured, 0.0);
    let lights = [
        DAY,
        Light { brightness: 0.3, ..DAY },
        Light { tint: [1.0, 0.7, 0.5], ..DAY },
        Light { tint: [0.7, 0.8, 1.0], brightness: 0.5, ..DAY },
    ];
    for (i, light) in lights.into_iter().enumerate() {
        let truth = standing(0.4 + i as f32);
        let frame = frame(&model, two_coloured, &truth, light);
        for turn in half_turns() {
            let start = truth * turn;
            let (pose, verdict) = decided(&model, &frame, &start, &ColourSettings::default());
            assert!(off(&pose, &truth) < 2.0, "light {i}: {} degrees off, {verdict:?}", off(&pose, &truth));
            assert!(!verdict.unwrap().abstained);
        }
        let (pose, verdict) = decided(&model, &frame, &truth, &ColourSettings::default());
        assert!(off(&pose, &truth) < 2.0 && verdict.unwrap().abstained);
    }
}

#[test]
fn a_can_is_turned_to_where_its_label_is() {
    let model = can_model(striped);
    assert_eq!(model.symmetry().revolution, Some(Vector3::z_axis()));
    for i in 0..8 {
        let truth = standing(0.8 * i as f32);
        let frame = frame(&model, striped, &truth, Light { seed: i, ..DAY });
        let wrong = [0.3, 1.3, 2.2, 3.1, -0.6][i as usize % 5];
        let mut start = truth * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), wrong);
        if i % 3 == 0 {
            start *= half_turns()[0];
        }
        let (pose, verdict) = decided(&model, &frame, &start, &ColourSettings::default());
        assert!(off(&pose, &truth) < 4.0, "{i}: {} degrees off, {verdict:?}", off(&pose, &truth));
    }
}

#[test]
fn an_object_of_one_colour_is_left_alone() {
    let model = box_model(uniform, 0.0);
    let truth = standing(0.7);
    let frame = frame(&model, uniform, &truth, DAY);
    let (pose, verdict) = decided(&model, &frame, &(truth * half_turns()[2]), &ColourSettings::default());
    assert!(off(&pose, &(truth * half_turns()[2])) < 1.0 && verdict.is_none());
}

#[test]
fn a_picture_of_noise_agrees_with_nothing_and_decides_nothing() {
    let settings = ColourSettings::default();
    for (model, paint) in
        [(box_model(two_coloured, 0.0), two_coloured as Paint), (can_model(striped), striped)]
    {
        for seed in 0..10 {
            let truth = standing(seed as f32);
            let mut frame = frame(&model, paint, &truth, DAY);
            let mut random = rng::stream(seed, "noise");
            for code in frame.rgb.iter_mut() {
                *code = random.random();
            }
            let found = agreement(&model, &frame, &truth).total;
            assert!(found.abs() < settings.min_agreement, "{seed}: {found}");
            let (pose, verdict) = decided(&model, &frame, &truth, &settings);
            assert!(off(&pose, &truth) < 1.0, "{seed}: {verdict:?}");
        }
    }
}

#[test]
fn in_the_dark_a_right_pose_stays_right() {
    for (model, paint) in
        [(box_model(two_coloured, 0.0), two_coloured as Paint), (can_model(striped), striped)]
    {
        for seed in 0..16 {
            let truth = standing(0.5 * seed as f32);
            for (brightness, noise) in [(0.02, 0.01), (0.003, 0.002), (0.001, 0.002), (0.0, 0.001)] {
                let light = Light { brightness, noise, seed, ..DAY };
                let frame = frame(&model, paint, &truth, light);
                let (pose, verdict) = decided(&model, &frame, &truth, &ColourSettings::default());
                assert!(
                    off(&pose, &truth) < 10.0,
                    "{seed}, {brightness}: {} off, {verdict:?}",
                    off(&pose, &truth)
                );
            }
        }
    }
}

#[test]
fn colour_never_overrules_geometry() {
    // The print is on the other side of where the tapered shape says.
    let model = box_model(two_coloured, 0.3);
    let truth = standing(0.9);
    let frame = frame(&model, |p| two_coloured(&(half_turns()[2] * p)), &truth, DAY);
    let settings = ColourSettings::default();
    let (pose, verdict) = decided(&model, &frame, &truth, &settings);
    assert!(off(&pose, &truth) < 2.0, "{} degrees off, {verdict:?}", off(&pose, &truth));
    let (pose, _) = decided(&model, &frame, &truth, &ColourSettings { depth_margin: 1.0, ..settings });
    assert!(off(&pose, &truth) > 170.0, "the print does prefer the other side");
}

#[test]
fn the_estimator_ends_with_colour_unless_it_is_switched_off() {
    let model = box_object(two_coloured, 0.0);
    let prepared = Model::new(&model, &[1000]).unwrap();
    let off_truth = |posterior: &PosePosterior, truth: &Isometry3<f32>| {
        posterior.best.iso().rotation.angle_to(&truth.rotation.cast()).to_degrees()
    };
    let mut turned = 0;
    for seed in 0..4 {
        let truth = standing(1.0 + seed as f32);
        let frame = frame(&prepared, two_coloured, &truth, DAY);
        let estimate = |colour: ColourSettings, threads: usize| {
            let estimator = GripEstimator::new(GripSettings { colour, ..grip_settings() }).unwrap();
            let objects = [model.clone()];
            let mut boxes = Detections::new();
            let bbox = [200.0, 80.0, 480.0, 400.0];
            boxes.push("thing", Detection { bbox, confidence: 1.0 }).unwrap();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let found = pool.install(|| estimator.estimate(&frame, &boxes, &objects, seed)).unwrap();
            PosePosterior { seconds: 0.0, ..found[0].clone() }
        };
        let with = estimate(ColourSettings::default(), 1);
        assert_eq!(with, estimate(ColourSettings::default(), 2));
        assert!(off_truth(&with, &truth) < 2.0, "{seed}: {:?}", with.colour);
        let weights: f64 = with.particles.iter().map(|p| p.1).sum();
        assert!((weights - 1.0).abs() < 1e-9);
        let back: PosePosterior = serde_json::from_str(&serde_json::to_string(&with).unwrap()).unwrap();
        assert_eq!(back.colour, with.colour);
        let without = estimate(ColourSettings::off(), 2);
        assert!(without.colour.is_none());
        turned += usize::from(off_truth(&without, &truth) > 90.0);
    }
    assert!(turned > 0, "depth alone cannot tell");
}

#[test]
fn settings_that_make_no_sense_are_refused() {
    let refused = |settings: ColourSettings| {
        let grip = GripSettings { colour: settings, ..GripSettings::default() };
        crate::GripEstimator::new(grip).unwrap_err().to_string()
    };
    let good = ColourSettings::default;
    assert!(refused(ColourSettings { weight: -0.1, ..good() }).contains("colour.weight"));
    assert!(refused(ColourSettings { margin: 2.0, ..good() }).contains("colour.margin"));
    assert!(refused(ColourSettings { depth_margin: -0.1, ..good() }).contains("colour.depth_margin"));
    assert!(refused(ColourSettings { min_agreement: f32::NAN, ..good() }).contains("colour.min_agreement"));
    assert!(refused(ColourSettings { min_pixels: 0, ..good() }).contains("colour.min_pixels"));
    assert!(refused(ColourSettings { most_shift_px: 9.0, ..good() }).contains("colour.most_shift_px"));
    assert!(refused(ColourSettings { revolution_steps: 1, ..good() }).contains("colour.revolution_steps"));
}
