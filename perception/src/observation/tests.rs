//! Levels and edges of frames that are painted by hand.

use super::edges::soft_distance;
use super::*;
use crate::support::{SupportSettings, stepped};
use grip_testkit::frames::painted;

fn settings() -> ObservationSettings {
    ObservationSettings { support: SupportSettings::off(), ..ObservationSettings::default() }
}

fn frame(paint: impl Fn(usize, usize) -> f32) -> CameraFrame {
    painted(Intrinsics::FETCH, paint)
}

#[test]
fn blocks_take_the_surface_with_more_readings_and_skip_holes() {
    let frame = frame(|u, v| match (u, v) {
        (0..4, 0..4) if u < 3 => 1.0,
        (0..4, 0..4) => 2.0,
        (4..8, 0..4) if u == 4 && v < 3 => 1.0,
        (8..12, 0..4) if v == 0 => f32::NAN,
        (8..12, 0..4) => 0.5,
        _ => 0.0,
    });
    let observation = Observation::new(&frame, &settings(), None);
    let level = observation.level(Stride::Four);
    let at = |u| level.w[level.index(u, 0)];
    assert_eq!([at(0), at(1), at(2)], [1.0, 0.0, 2.0]);
    let two = observation.level(Stride::Two);
    assert_eq!(two.w[two.index(0, 0)], 1.0);
    // The tolerance is epsilon along the ray.
    let x = (0.0 - level.cx) / level.fx;
    let y = (0.0 - level.cy) / level.fy;
    let tol = settings().epsilon_m as f32 / (x * x + y * y + 1.0).sqrt();
    assert!((level.tol[level.index(0, 0)] - tol).abs() < 1e-8);
}

#[test]
fn edges_are_on_the_near_side_also_across_a_shadow() {
    let frame = frame(|u, _| match u {
        0..100 => 1.0,
        100..108 => 0.0,
        _ => 1.1,
    });
    let edges = near_edges(&frame, &settings());
    let row = &edges[640 * 7..640 * 8];
    let marked: Vec<usize> = (0..640).filter(|&u| row[u]).collect();
    assert_eq!(marked, [99]);
    let observation = Observation::new(&frame, &settings(), None);
    let one = observation.level(Stride::One);
    assert_eq!(one.edge[one.index(99, 9)], 1.0);
    let expected = (-0.5f32 * (2.0f32 / 1.5).powi(2)).exp();
    assert!((one.edge[one.index(101, 9)] - expected).abs() < 1e-6);
    assert_eq!(one.edge[one.index(200, 9)], 0.0);
}

#[test]
fn soft_distance_is_euclidean() {
    let pitch = 32;
    let mut marked = vec![false; pitch * 32];
    marked[10 * pitch + 10] = true;
    let soft = soft_distance(&marked, pitch, 2.0);
    let expected = (-(9.0f32 + 4.0) / 8.0).exp();
    assert!((soft[12 * pitch + 13] - expected).abs() < 1e-6);
}

#[test]
fn what_is_on_a_step_weighs_nothing_and_what_stands_on_it_or_beside_it_does() {
    let frame = stepped(0.08);
    let observation = Observation::new(&frame, &ObservationSettings::default(), None);
    let weight = |x: f64, y: f64, z: f64| {
        let p = frame.world_from_camera.inverse().transform_point(&Point3::new(x, y, z));
        let at = frame.intrinsics.project(&p).unwrap();
        let level = observation.level(Stride::One);
        level.weight[level.index(at.x.round() as i32, at.y.round() as i32)]
    };
    assert_eq!([weight(0.4, 0.2, 0.78), weight(0.4, -0.2, 0.7)], [0.0, 0.0], "step and table");
    assert_eq!([weight(0.525, 0.15, 0.82), weight(0.525, -0.15, 0.74)], [1.0, 1.0], "blocks on them");
    // The ground under each block is its own.
    let camera_from_world = frame.world_from_camera.inverse();
    let base = observation.flat_plane().unwrap();
    let rise = |y: f64| {
        let centre = camera_from_world.transform_point(&Point3::new(0.525, y, 0.8));
        observation.rise(&base, &centre.coords.cast())
    };
    assert!((rise(0.15) - 0.08).abs() < 1e-3 && rise(-0.15) == 0.0, "{} {}", rise(0.15), rise(-0.15));
}
