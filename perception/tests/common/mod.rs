//! Synthetic frames for tests and the example: objects on a table before a Fetch-like camera.
//!
//! The renderer here is another one than the filter's, on purpose: barycentric, in f64, on the full mesh.
#![allow(dead_code, missing_docs, clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::sync::Arc;

use grip_perception::metrics;
use grip_sim::camera::Intrinsics;
use grip_sim::frame::CameraFrame;
use grip_sim::images::{DepthImage, Image, RgbImage};
use grip_sim::mesh::{Material, Mesh, Visual};
use grip_sim::objects::{Fragility, ObjectInfo, ObjectModel};
use grip_sim::pose::{Camera, Object, Pose, World};
use grip_sim::render::Rendering;
use grip_sim::sensor::depth::DepthNoise;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

pub const TABLE: f64 = 0.7;

/// An object from a mesh; positions are shifted so that the origin is the centre of the bounding box.
pub fn object(name: &str, positions: Vec<Point3<f32>>, triangles: Vec<[u32; 3]>) -> Arc<ObjectModel> {
    let normals = vec![Vector3::z(); positions.len()];
    let info = ObjectInfo {
        name: name.to_owned(),
        bop_id: 1,
        mass_kg: 0.3,
        friction: 0.5,
        symmetric: true,
        fragility: Fragility::Sturdy,
        upright: false,
        revolution: None,
        half_turns: vec![],
    };
    let visual = Visual {
        mesh: Arc::new(Mesh { positions, normals, triangles, ..Mesh::default() }),
        material: Material::default(),
    };
    Arc::new(ObjectModel::new(info, visual, vec![]))
}

pub fn box_object(name: &str, size: [f32; 3]) -> Arc<ObjectModel> {
    let positions = (0..8)
        .map(|i| {
            Point3::new(
                size[0] * ((i & 1) as f32 - 0.5),
                size[1] * ((i >> 1 & 1) as f32 - 0.5),
                size[2] * ((i >> 2) as f32 - 0.5),
            )
        })
        .collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    object(name, positions, triangles)
}

pub fn can_object(name: &str, radius: f32, height: f32) -> Arc<ObjectModel> {
    let n = 64u32;
    let mut positions = vec![Point3::new(0.0, 0.0, -height / 2.0), Point3::new(0.0, 0.0, height / 2.0)];
    let mut triangles = Vec::new();
    for i in 0..n {
        let (s, c) = (std::f32::consts::TAU * i as f32 / n as f32).sin_cos();
        for z in [-height / 2.0, height / 2.0] {
            positions.push(Point3::new(radius * c, radius * s, z));
        }
        let (a, b) = (2 + 2 * i, 2 + 2 * ((i + 1) % n));
        triangles.extend([[a, b, b + 1], [a, b + 1, a + 1], [0, b, a], [1, a + 1, b + 1]]);
    }
    object(name, positions, triangles)
}

/// The folder of real data, if this checkout has it.
pub fn data(sub: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data").join(sub);
    let path = if path.exists() {
        path
    } else {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(sub)
    };
    path.exists().then_some(path)
}

/// YCB-Video's names in the order of its BOP numbers, 1 to 21.
pub const NAMES: [&str; 21] = [
    "002_master_chef_can",
    "003_cracker_box",
    "004_sugar_box",
    "005_tomato_soup_can",
    "006_mustard_bottle",
    "007_tuna_fish_can",
    "008_pudding_box",
    "009_gelatin_box",
    "010_potted_meat_can",
    "011_banana",
    "019_pitcher_base",
    "021_bleach_cleanser",
    "024_bowl",
    "025_mug",
    "035_power_drill",
    "036_wood_block",
    "037_scissors",
    "040_large_marker",
    "051_large_clamp",
    "052_extra_large_clamp",
    "061_foam_brick",
];

/// A model of a BOP folder: binary PLY with float x, y, z and triangles only, millimetres.
pub fn bop_object(models: &Path, id: usize) -> Arc<ObjectModel> {
    let bytes = std::fs::read(models.join(format!("obj_{id:06}.ply"))).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8_lossy(&bytes[..end]).into_owned();
    let count = |what: &str| -> usize {
        let line = header.lines().find(|l| l.starts_with(what)).unwrap();
        line.split(' ').next_back().unwrap().parse().unwrap()
    };
    let (vertices, faces) = (count("element vertex"), count("element face"));
    let body = &bytes[end..];
    let float = |i: usize| f32::from_le_bytes(body[i..i + 4].try_into().unwrap()) * 1e-3;
    let positions =
        (0..vertices).map(|i| Point3::new(float(12 * i), float(12 * i + 4), float(12 * i + 8))).collect();
    let index = |i: usize| u32::from_le_bytes(body[i..i + 4].try_into().unwrap());
    let start = 12 * vertices;
    let triangles = (0..faces)
        .map(|i| {
            let at = start + 13 * i;
            assert_eq!(body[at], 3);
            [index(at + 1), index(at + 5), index(at + 9)]
        })
        .collect();
    object(NAMES[id - 1], positions, triangles)
}

/// A camera `height` up that looks `down` radians below the horizon along world x.
pub fn camera(height: f64, down: f64) -> Pose<World, Camera> {
    let forward = Vector3::new(down.cos(), 0.0, -down.sin());
    let right = Vector3::new(0.0, -1.0, 0.0);
    let columns = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
    Pose::new(Isometry3::from_parts(
        Translation3::new(0.0, 0.0, height),
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(columns)),
    ))
}

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

pub struct Scene {
    pub frame: CameraFrame,
    pub placed: Vec<(Arc<ObjectModel>, Pose<Camera, Object>)>,
}

/// Objects on the table at random: one of the six faces of the bounding box down (the upright one half of the time),
/// free yaw, apart from each other by `gap` metres between bounding circles (negative: they may occlude and touch).
pub fn scene(models: &[Arc<ObjectModel>], gap: f64, rng: &mut ChaCha8Rng) -> Scene {
    let k = Intrinsics::FETCH;
    let world_from_camera = camera(1.2 + 0.1 * (rng.random::<f64>() - 0.5), 0.8 + 0.2 * rng.random::<f64>());
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

pub fn adds(model: &ObjectModel, truth: &Pose<Camera, Object>, estimate: &Pose<Camera, Object>) -> f64 {
    let points = metrics::sample_points(&model.visual.mesh.positions, 1000);
    metrics::adds(&points, truth, estimate)
}
