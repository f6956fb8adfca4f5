//! Closed forms of the paper's equations, and a slow reference.

use grip_sim::camera::Intrinsics;
use grip_testkit::frames::painted;
use grip_testkit::meshes::mesh;
use nalgebra::Point3;

use super::features::{EDGE, PLANE, Patch, Smoothness, compute, observed};
use super::*;
use crate::hypotheses::{Isa, Raster, render};
use crate::model::fixtures::model;
use crate::support::SupportSettings;

/// The middle 64 x 48 pixels of a usual camera.
const CAMERA: Intrinsics = Intrinsics { width: 64, height: 48, fx: 600.0, fy: 600.0, cx: 31.5, cy: 23.5 };

fn frame(depth: impl Fn(usize, usize) -> f32) -> CameraFrame {
    painted(CAMERA, depth)
}

fn observation(frame: &CameraFrame, epsilon_m: f64) -> Observation {
    let settings =
        ObservationSettings { epsilon_m, support: SupportSettings::off(), ..ObservationSettings::default() };
    Observation::new(frame, &settings, None)
}

/// c^2 of a whole level.
fn smoothness(observation: &Observation, settings: &PaperSettings) -> Vec<f32> {
    let level = observation.level(Stride::One);
    let mut smoothness = Smoothness::default();
    compute(Isa::best(), &mut smoothness, Patch::whole(level), level, settings);
    smoothness.squared
}

/// Equation "c", point by point.
fn reference(frame: &CameraFrame, u: usize, v: usize, settings: &PaperSettings) -> Option<f64> {
    let point = |u: usize, v: usize| {
        let z = f64::from(*frame.depth.at(u, v));
        (z > 0.0).then(|| CAMERA.back_project(u as f64, v as f64, z).coords)
    };
    let p = point(u, v)?;
    let reach = settings.neighbours as i32;
    let (mut sum, mut count) = (Vector3::zeros(), 0);
    for (dv, du) in (-reach..=reach).flat_map(|dv| (-reach..=reach).map(move |du| (dv, du))) {
        if (du, dv) == (0, 0) {
            continue;
        }
        let (nu, nv) = (u as i32 + du, v as i32 + dv);
        let inside = (0..CAMERA.width as i32).contains(&nu) && (0..CAMERA.height as i32).contains(&nv);
        let neighbour = if inside { point(nu as usize, nv as usize) } else { None };
        match (neighbour, settings.holes) {
            (Some(q), _) => {
                sum += q - p;
                count += 1;
            }
            (None, Holes::Origin) => {
                sum -= p;
                count += 1;
            }
            (None, Holes::Skip) => {}
        }
    }
    (count > 0).then(|| sum.norm() / (f64::from(count) * p.norm()))
}

#[test]
fn smoothness_is_the_published_equation() {
    // A step, a slope, holes, and a lonely point.
    let frame = frame(|u, v| match (u, v) {
        (60.., 40..) if (u, v) == (62, 45) => 0.9,
        (60.., 40..) => 0.0,
        _ if (u * 7 + v * 13) % 11 == 0 => 0.0,
        (..30, _) => 1.0,
        _ => 0.7 + 0.004 * u as f32,
    });
    let observation = observation(&frame, 0.005);
    for (neighbours, holes) in [(1, Holes::Skip), (2, Holes::Skip), (2, Holes::Origin), (3, Holes::Origin)] {
        let settings = PaperSettings { neighbours, holes, ..PaperSettings::default() };
        let squared = smoothness(&observation, &settings);
        for v in 0..CAMERA.height {
            for u in 0..CAMERA.width {
                let got = f64::from(squared[v * CAMERA.width + u]);
                match reference(&frame, u, v, &settings) {
                    Some(c) => {
                        let error = (got.max(0.0).sqrt() - c).abs();
                        assert!(got >= 0.0 && error < 2e-6 + 1e-4 * c, "{u} {v}: {got} {c}");
                    }
                    None => assert!(got < 0.0, "{u} {v}: {got}"),
                }
            }
        }
    }
}

#[test]
fn a_step_has_edges_and_a_wall_planar_points_no_more_than_a_window_may() {
    let frame = frame(|u, _| if u < 32 { 0.8 } else { 1.2 });
    let settings = PaperSettings::default();
    let observation = observation(&frame, 0.005);
    let level = observation.level(Stride::One);
    let kinds = observed(level, &settings);
    let at = |u: usize, v: usize| kinds[level.index(u as i32, v as i32)];
    let mut edges = 0;
    for top in (0..45).step_by(5) {
        for left in (0..60).step_by(5) {
            let count = |kind| (0..25).filter(|i| at(left + i % 5, top + i / 5) == kind).count();
            assert!(count(EDGE) <= 5 && count(PLANE) <= 2, "{left} {top}");
            edges += count(EDGE);
            // Two pixels from the step all is flat.
            if left + 5 <= 30 || left >= 34 {
                assert_eq!((count(EDGE), count(PLANE)), (0, 2), "{left} {top}");
            }
        }
    }
    // The step runs through the nine windows that begin at column 30.
    assert_eq!(edges, 9 * 5);
}

#[test]
fn features_may_match_within_epsilon() {
    // At 0.8 and 0.9 m a pixel is 1.3 and 1.5 mm wide, so 5 mm are three pixels; 10 cm of depth are far.
    let frame = frame(|u, v| if (u * 7 + v * 13) % 11 == 0 { 0.0 } else { [0.8, 0.9][usize::from(u >= 32)] });
    let settings = PaperSettings { feature_match: FeatureMatch::Near, ..PaperSettings::default() };
    let observation = observation(&frame, 0.005);
    let level = observation.level(Stride::One);
    let own = observed(level, &PaperSettings { feature_match: FeatureMatch::Pixel, ..settings.clone() });
    let near = observed(level, &settings);
    let pixels = || (0..CAMERA.height).flat_map(|v| (0..CAMERA.width).map(move |u| (u, v)));
    let points: Vec<(usize, Point3<f64>)> = pixels()
        .map(|(u, v)| (u, v, f64::from(*frame.depth.at(u, v))))
        .filter(|(_, _, z)| *z > 0.0)
        .map(|(u, v, z)| (level.index(u as i32, v as i32), CAMERA.back_project(u as f64, v as f64, z)))
        .collect();
    let mut more = 0;
    for (at, point) in &points {
        let within = |kind| points.iter().any(|(other, p)| own[*other] == kind && (p - point).norm() < 0.005);
        assert_eq!([EDGE, PLANE].map(|kind| near[*at] & kind != 0), [EDGE, PLANE].map(within), "{point}");
        more += usize::from(near[*at] != own[*at]);
    }
    assert!(more > 500, "{more}");
}

/// A square plate of half-width 0.01 m that faces the camera.
fn plate() -> Model {
    let corner = |x: f32, y: f32| Point3::new(x, y, 0.0);
    // Towards the camera is -z; seen from there counter-clockwise.
    let positions = vec![corner(-0.01, -0.01), corner(-0.01, 0.01), corner(0.01, 0.01), corner(0.01, -0.01)];
    model(mesh(positions, vec![[0, 1, 2], [0, 2, 3]]))
}

#[test]
fn weights_are_shares_of_inliers() {
    // A plate at 0.8 m before a wall at 1.2 m: 15 pixels wide.
    let inside = |at: usize, middle: f64| (at as f64 - middle).abs() <= 7.5;
    let frame = frame(|u, v| if inside(u, 31.5) && inside(v, 23.5) { 0.8 } else { 1.2 });
    let settings = PaperSettings { window_edges: 25, window_planes: 25, ..PaperSettings::default() };
    let observation = observation(&frame, settings.epsilon_m);
    let features = observed(observation.level(Stride::One), &settings);
    let plate = plate();
    // The whole plate, its left half, and a box elsewhere.
    let boxes = [[0.0, 0.0, 63.0, 47.0], [0.0, 0.0, 31.0, 47.0], [0.0, 0.0, 5.0, 5.0]]
        .map(|bbox| Detection { bbox, confidence: 0.5 });
    let likelihood = Likelihood {
        settings: &settings,
        observation: &observation,
        features: &features,
        lod: plate.lod(12),
        boxes: &boxes,
    };
    let mut scratch = Scratch::default();
    let mut weigh =
        |x: f32, z: f32, index| likelihood.weigh(&mut scratch, &Isometry3::translation(x, 0.0, z), index);
    // True pose: every point is an inlier. The plate alone is smooth everywhere; the observed step beside its rim is not.
    let right = weigh(0.0, 0.8, 0);
    assert_eq!((right.confidence, right.all, right.in_box), (0.5, 1.0, 1.0));
    assert_eq!(right.edges, 0.0);
    // Observed planar points are those at least two pixels inside.
    assert!((right.planes - (11.0_f32 / 15.0).powi(2)).abs() < 0.05, "{right:?}");
    assert_eq!(weigh(0.0, 0.8, 2).in_box, 0.0);
    // Behind by more than epsilon, and out of the picture.
    assert_eq!(weigh(0.0, 0.81, 0).all, 0.0);
    assert_eq!(weigh(5.0, 0.8, 0), weight::Weight { confidence: 0.5, ..Default::default() });
    // Moved right by a quarter of its width: a quarter hangs in the air.
    let moved = weigh(0.005, 0.8, 0);
    assert!((moved.all - 0.75).abs() <= 1.0 / 15.0, "{moved:?}");
    let total = 0.1 * 0.5 + 0.1 * moved.in_box + 0.3 * moved.all + 0.25 * moved.edges + 0.25 * moved.planes;
    assert!((moved.total(&settings) - total).abs() < 1e-6);
    // In the left half of the picture the moved plate lies wholly on the true one.
    assert_eq!(weigh(0.005, 0.8, 1).in_box, 1.0);
}

#[test]
fn the_diffusion_decays_as_published() {
    let settings = PaperSettings::default();
    assert_eq!([0.0, 0.3, 0.6].map(|best| decay(best, &settings)), [1.0; 3]);
    assert!((decay(0.8, &settings) - 0.5_f32.powi(5)).abs() < 1e-6);
    assert_eq!(decay(1.0, &settings), 0.0);
}

#[test]
fn samples_begin_uniformly_in_the_space_of_their_box() {
    let frame = frame(|_, v| if v < 24 { 1.0 } else { 2.0 });
    let bbox = [10.0, 10.0, 50.0, 40.0];
    let frustum = |bbox: [f64; 4]| Space::frustum(&bbox, &frame);
    let space = frustum(bbox).unwrap();
    assert_eq!(space, Space::Frustum { bbox, near: 1.0, far: 2.0 });
    let near_only = [10.0, 10.0, 50.0, 20.0];
    assert_eq!(frustum(near_only), Some(Space::Frustum { bbox: near_only, near: 1.0, far: 1.0 }));
    assert_eq!(frustum([70.0, 10.0, 90.0, 20.0]), None);
    // At readings: only those that are an object's.
    let readings = Space::readings(&bbox, &frame, |_, v| v >= 24).unwrap();
    let Space::Readings(points) = &readings else { unreachable!() };
    assert_eq!(points.len(), 41 * 17);
    assert!(points.contains(&readings.draw(&frame, &mut rng::stream(1, "test"))));
    assert_eq!(Space::readings(&bbox, &frame, |_, _| false), None);
    let mut rng = rng::stream(1, "test");
    let mut near = 0;
    for _ in 0..4000 {
        let point = space.draw(&frame, &mut rng);
        let at = CAMERA.project(&point).unwrap();
        assert!((10.0..=50.0).contains(&at.x) && (10.0..=40.0).contains(&at.y));
        near += usize::from(point.z < 1.5);
    }
    // Volume grows with the cube of depth: (1.5^3 - 1) / (2^3 - 1) = 0.339.
    assert!((f64::from(near as u32) / 4000.0 - 0.339).abs() < 0.03, "{near}");
}

#[test]
fn samples_are_drawn_by_weight_and_moved_by_sigma() {
    let sample = |weight| Sample { pose: Isometry3::identity(), index: 0, weight };
    let mut samples = vec![sample(0.6), sample(0.3), sample(0.1)];
    for (sample, x) in samples.iter_mut().zip([10.0, 20.0, 30.0]) {
        sample.pose.translation.x = x;
    }
    let settings = PaperSettings::default();
    let (mut counts, mut squares, mut angles) = ([0.0; 3], 0.0, 0.0);
    let rounds = 2000;
    for round in 0..rounds {
        for drawn in resampled(&samples, 1.0, &settings, 1, &mut rng::stream(round, "test")) {
            let which = (drawn.pose.translation.x / 10.0).round();
            counts[which as usize - 1] += 1.0 / (3.0 * rounds as f64);
            squares += f64::from(drawn.pose.translation.x - 10.0 * which).powi(2) / (3.0 * rounds as f64);
            angles += f64::from(drawn.pose.rotation.scaled_axis().x).powi(2) / (3.0 * rounds as f64);
        }
    }
    for (count, share) in counts.into_iter().zip([0.6, 0.3, 0.1]) {
        assert!((count - share).abs() < 0.03, "{counts:?}");
    }
    assert!((squares.sqrt() / 0.07 - 1.0).abs() < 0.04 && (angles.sqrt() / 0.3 - 1.0).abs() < 0.04);
    let kept = resampled(
        &samples,
        1.0,
        &PaperSettings { keep_best: true, ..settings },
        1,
        &mut rng::stream(1, "test"),
    );
    assert_eq!(kept[0].pose, samples[0].pose);
}

#[test]
fn steps_of_a_length_are_often_small() {
    let start = Sample { pose: Isometry3::identity(), index: 0, weight: 1.0 };
    let settings = PaperSettings { diffusion: Diffusion::Length, ..PaperSettings::default() };
    let moved = resampled(&vec![start; 20_000], 1.0, &settings, 1, &mut rng::stream(1, "test"));
    let count = moved.len() as f32;
    for (sigma, length) in [
        (0.07, moved.iter().map(|s| s.pose.translation.vector).collect::<Vec<_>>()),
        (0.3, moved.iter().map(|s| s.pose.rotation.scaled_axis()).collect()),
    ] {
        let square = length.iter().map(Vector3::norm_squared).sum::<f32>() / count;
        assert!((square.sqrt() / sigma - 1.0).abs() < 0.02, "{square}");
        // A normal number is below a seventh of its deviation in 0.1136 of cases; three axes in 0.00077.
        let small = length.iter().filter(|step| step.norm() < sigma / 7.0).count() as f32 / count;
        assert!((small - 0.1136).abs() < 0.01, "{small}");
        // In every direction.
        let mean = length.iter().sum::<Vector3<f32>>() / count;
        assert!(mean.norm() < 0.02 * sigma, "{mean}");
    }
}

#[test]
fn the_tile_and_the_frame_count_the_same_pixels() {
    // What is drawn of the plate is what projects: 15 x 15 pixels and a rim.
    let frame = frame(|_, _| 0.8);
    let observation = observation(&frame, 0.005);
    let plate = plate();
    let mut raster = Raster::default();
    let pose = Isometry3::translation(0.0, 0.0, 0.8);
    render(&mut raster, plate.lod(12), &pose, observation.level(Stride::One), None).unwrap();
    let drawn = raster.tile.values().iter().filter(|&&w| w > 0.0).count();
    assert!((225..=256).contains(&drawn), "{drawn}");
}

#[test]
fn hypotheses_are_weighed_without_allocation() {
    let frame = frame(|u, v| if u > 24 && v > 16 { 0.8 } else { 1.2 });
    let settings = PaperSettings::default();
    let prepared = Prepared::new(&settings, &frame);
    let plate = plate();
    let boxes = [Detection { bbox: [0.0, 0.0, 63.0, 47.0], confidence: 1.0 }];
    let likelihood = prepared.likelihood(&plate, &boxes);
    let mut scratch = Scratch::default();
    let mut weigh_all = || {
        for i in 0..50 {
            let x = 0.0005 * i as f32;
            std::hint::black_box(likelihood.weigh(&mut scratch, &Isometry3::translation(x, 0.0, 0.8), 0));
        }
    };
    // The first time makes room.
    weigh_all();
    assert_eq!(crate::allocations::allocations(weigh_all), 0);
}
