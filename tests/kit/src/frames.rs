//! Frames of objects on a table before a Fetch-like camera.
//!
//! The renderer here is another one than the filter's, on purpose: barycentric, in f64, on the full mesh.

use std::sync::Arc;

use grip_sim::camera::Intrinsics;
use grip_sim::frame::CameraFrame;
use grip_sim::images::{DepthImage, Image, RgbImage};
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Camera, Object, Pose, World};
use grip_sim::render::Rendering;
use grip_sim::sensor::depth::DepthNoise;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::cameras::looking_down;

/// A black frame whose depth is painted pixel by pixel, column and row, row by row: metres, 0 for no reading. The camera's frame is
/// the world's.
pub fn painted(k: Intrinsics, mut depth: impl FnMut(usize, usize) -> f32) -> CameraFrame {
    let mut image = Image::filled(k.width, k.height, 0.0f32);
    for v in 0..k.height {
        for u in 0..k.width {
            *image.at_mut(u, v) = depth(u, v);
        }
    }
    CameraFrame {
        rgb: RgbImage::new(k.width as u32, k.height as u32),
        depth: image,
        intrinsics: k,
        world_from_camera: Pose::identity(),
    }
}

/// Height of the table top over the floor, metres.
pub const TABLE: f64 = 0.7;

/// Perfect depth of posed objects on a table top (z = [`TABLE`], x 0.35 .. 1.35) over a floor.
pub fn depth(
    k: &Intrinsics,
    world_from_camera: &Pose<World, Camera>,
    placed: &[(Arc<ObjectModel>, Pose<Camera, Object>)],
) -> DepthImage {
    let mut out = Image::filled(k.width, k.height, 0.0f32);
    let iso = world_from_camera.iso();
    let height = iso.translation.z;
    for v in 0..k.height {
        for u in 0..k.width {
            let ray = iso.rotation * k.back_project(u as f64, v as f64, 1.0).coords;
            let table = (TABLE - height) / ray.z;
            let on_table = table > 0.0 && (0.35..1.35).contains(&(iso.translation.x + table * ray.x));
            let z = if on_table { table } else { -height / ray.z };
            *out.at_mut(u, v) = if z > 0.0 && z < 4.0 { z as f32 } else { 0.0 };
        }
    }
    for (model, pose) in placed {
        let mesh = &model.visual.mesh;
        let points: Vec<(f64, f64, f64)> = mesh
            .positions
            .iter()
            .map(|p| {
                let q = pose.transform_point(&p.cast());
                let uv = k.project(&q).unwrap();
                (uv.x, uv.y, 1.0 / q.z)
            })
            .collect();
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| points[i as usize]);
            let area = (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0);
            if area.abs() < 1e-12 {
                continue;
            }
            let range = |x: [f64; 3], most: usize| {
                let low = x.iter().copied().fold(f64::MAX, f64::min).ceil().max(0.0) as usize;
                let high = x.iter().copied().fold(f64::MIN, f64::max).floor().min(most as f64 - 1.0);
                low..(high.max(-1.0) + 1.0) as usize
            };
            for v in range([a.1, b.1, c.1], k.height) {
                for u in range([a.0, b.0, c.0], k.width) {
                    let (x, y) = (u as f64, v as f64);
                    let wb = ((x - a.0) * (c.1 - a.1) - (y - a.1) * (c.0 - a.0)) / area;
                    let wc = ((b.0 - a.0) * (y - a.1) - (b.1 - a.1) * (x - a.0)) / area;
                    if wb >= 0.0 && wc >= 0.0 && wb + wc <= 1.0 {
                        let z = (1.0 / (a.2 + wb * (b.2 - a.2) + wc * (c.2 - a.2))) as f32;
                        let pixel = out.at_mut(u, v);
                        if *pixel == 0.0 || z < *pixel {
                            *pixel = z;
                        }
                    }
                }
            }
        }
    }
    out
}

/// What the simulated Carmine 1.09 reads of a perfect depth image of grey surfaces.
pub fn sensed(depth: &DepthImage, k: &Intrinsics, rng: &mut ChaCha8Rng) -> DepthImage {
    let mut cos_incidence = Image::filled(k.width, k.height, 0.0f32);
    for v in 1..k.height - 1 {
        for u in 1..k.width - 1 {
            let z = *depth.at(u, v);
            // The smaller of the two differences is the one on the same surface.
            let slope = |a: f32, b: f32| {
                let (a, b) = (z - a, b - z);
                f64::from(if a.abs() < b.abs() { a } else { b })
            };
            let (du, dv) = (
                slope(*depth.at(u - 1, v), *depth.at(u + 1, v)),
                slope(*depth.at(u, v - 1), *depth.at(u, v + 1)),
            );
            let p = |u: f64, v: f64, z: f64| k.back_project(u, v, z);
            let (x, y, z) = (u as f64, v as f64, f64::from(z));
            if z > 0.0 {
                let at = p(x, y, z);
                let normal = (p(x + 1.0, y, z + du) - at).cross(&(p(x, y + 1.0, z + dv) - at));
                let cos = normal.normalize().dot(&at.coords.normalize()).abs();
                *cos_incidence.at_mut(u, v) = cos as f32;
            }
        }
    }
    let rendering = Rendering {
        radiance: Image::filled(k.width, k.height, [50.0; 3]),
        depth: depth.clone(),
        labels: Image::filled(k.width, k.height, 0),
        cos_incidence,
    };
    DepthNoise::default().apply(&rendering, k, rng)
}

/// Objects on a table, seen.
#[derive(Debug)]
pub struct Scene {
    /// What the sensor reads; without colour.
    pub frame: CameraFrame,
    /// What stands there, and where.
    pub placed: Vec<(Arc<ObjectModel>, Pose<Camera, Object>)>,
}

/// Objects on the table at random: one of the six faces of the bounding box down (the upright one half of the time),
/// free yaw, apart from each other by `gap` metres between bounding circles (negative: they may occlude and touch).
pub fn scene(models: &[Arc<ObjectModel>], gap: f64, rng: &mut ChaCha8Rng) -> Scene {
    let k = Intrinsics::FETCH;
    let world_from_camera =
        looking_down(1.2 + 0.1 * (rng.random::<f64>() - 0.5), 0.8 + 0.2 * rng.random::<f64>());
    let mut circles: Vec<(f64, f64, f64)> = Vec::new();
    let mut placed = Vec::new();
    for model in models {
        for _ in 0..200 {
            let tip = match rng.random_range(0..10) {
                0..5 => [0.0, 0.0],
                5 => [std::f64::consts::PI, 0.0],
                i => [[1.57, 0.0], [-1.57, 0.0], [0.0, 1.57], [0.0, -1.57]][i as usize - 6],
            };
            let yaw = rng.random::<f64>() * std::f64::consts::TAU;
            let rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, yaw)
                * UnitQuaternion::from_euler_angles(tip[0], tip[1], 0.0);
            let turned: Vec<Vector3<f64>> =
                model.visual.mesh.positions.iter().map(|p| rotation * p.coords.cast()).collect();
            let lowest = turned.iter().map(|p| p.z).fold(f64::MAX, f64::min);
            let radius = turned.iter().map(|p| p.xy().norm()).fold(0.0, f64::max);
            let (x, y) = (0.45 + 0.45 * rng.random::<f64>(), 0.7 * (rng.random::<f64>() - 0.5));
            if circles.iter().any(|(cx, cy, r)| (cx - x).hypot(cy - y) < r + radius + gap) {
                continue;
            }
            let world_from_object: Pose<World, Object> =
                Pose::new(Isometry3::from_parts(Translation3::new(x, y, TABLE - lowest), rotation));
            let pose = world_from_camera.inverse() * world_from_object;
            let inside = turned.iter().all(|p| {
                let p = world_from_camera
                    .inverse()
                    .transform_point(&Point3::from(p + world_from_object.translation()));
                k.project(&p).is_some_and(|q| q.x > 2.0 && q.y > 2.0 && q.x < 637.0 && q.y < 477.0)
            });
            if inside {
                circles.push((x, y, radius));
                placed.push((model.clone(), pose));
                break;
            }
        }
    }
    let clean = depth(&k, &world_from_camera, &placed);
    Scene {
        frame: CameraFrame {
            rgb: RgbImage::new(640, 480),
            depth: sensed(&clean, &k, rng),
            intrinsics: k,
            world_from_camera,
        },
        placed,
    }
}
