//! Small meshes with normals and texture coordinates, and a table of them, for pictures. All sizes in metres.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use grip_sim::mesh::{Material, Mesh, Visual};
use grip_sim::render::{Instance, RenderScene, textures};
use nalgebra::{Point3, Vector3};

use crate::cameras::at;

/// Adds a grid of quads over (s, t) in 0..1; `surface` gives position and normal.
fn sweep(
    mesh: &mut Mesh,
    [columns, rows]: [u32; 2],
    surface: impl Fn(f32, f32) -> (Point3<f32>, Vector3<f32>),
) {
    let base = mesh.positions.len() as u32;
    for j in 0..=rows {
        for i in 0..=columns {
            let (s, t) = (i as f32 / columns as f32, j as f32 / rows as f32);
            let (p, n) = surface(s, t);
            mesh.positions.push(p);
            mesh.normals.push(n);
            mesh.uvs.push([s, t]);
        }
    }
    for j in 0..rows {
        for i in 0..columns {
            let a = base + j * (columns + 1) + i;
            let (b, c, d) = (a + 1, a + columns + 1, a + columns + 2);
            mesh.triangles.extend([[a, c, b], [b, c, d]]);
        }
    }
}

/// A box about the origin; each face shows the whole texture, `repeat` times.
pub fn cuboid(size: [f32; 3], repeat: f32) -> Mesh {
    let mut mesh = Mesh::default();
    let half = Vector3::from(size) / 2.0;
    for axis in 0..3 {
        for sign in [-1.0_f32, 1.0] {
            let normal = Vector3::ith(axis, sign);
            // Texture upright on the sides: its top is up.
            let down = if axis == 2 { -Vector3::x() } else { -Vector3::z() };
            let right = normal.cross(&down);
            sweep(&mut mesh, [1, 1], |s, t| {
                let p = normal + right * (2.0 * s - 1.0) + down * (2.0 * t - 1.0);
                (Point3::from(p.component_mul(&half)), normal)
            });
        }
    }
    for uv in &mut mesh.uvs {
        *uv = uv.map(|c| c * repeat);
    }
    mesh
}

/// A closed cylinder along z about the origin.
pub fn cylinder(radius: f32, height: f32, segments: u32) -> Mesh {
    let mut mesh = Mesh::default();
    sweep(&mut mesh, [segments, 1], |s, t| {
        let n = Vector3::new((TAU * s).cos(), (TAU * s).sin(), 0.0);
        (Point3::from(n * radius + Vector3::z() * height * (0.5 - t)), n)
    });
    for sign in [-1.0_f32, 1.0] {
        sweep(&mut mesh, [segments, 1], |s, t| {
            let a = TAU * s * sign;
            let rim = Vector3::new(a.cos(), a.sin(), 0.0) * radius;
            (Point3::from(rim * t + Vector3::z() * (sign * height / 2.0)), Vector3::z() * sign)
        });
    }
    mesh
}

/// A sphere about the origin.
pub fn sphere(radius: f32, segments: u32) -> Mesh {
    let mut mesh = Mesh::default();
    sweep(&mut mesh, [2 * segments, segments], |s, t| {
        let (a, b) = (TAU * s, PI * t);
        let n = Vector3::new(a.cos() * b.sin(), a.sin() * b.sin(), b.cos());
        (Point3::from(n * radius), n)
    });
    mesh
}

/// A mesh of one material.
pub fn visual(mesh: Mesh, material: Material) -> Arc<Visual> {
    Arc::new(Visual { mesh: Arc::new(mesh), material })
}

/// A table with eight things on it, floor and wall; labels 1 to 8 for the things.
pub fn tabletop() -> RenderScene {
    let textured = |image: image::RgbImage, roughness| Material {
        base_color: [1.0; 3],
        roughness,
        metallic: 0.0,
        texture: Some(Arc::new(image)),
    };
    let plain = |base_color, roughness, metallic| Material { base_color, roughness, metallic, texture: None };
    let label = image::RgbImage::from_fn(256, 256, |x, y| {
        let stripe = (y / 32) % 2 == 0;
        let blob = (x as i32 - 128).pow(2) + (y as i32 - 128).pow(2) < 4900;
        image::Rgb(match (blob, stripe) {
            (true, _) => [245, 235, 220],
            (_, true) => [190, 30, 35],
            _ => [215, 60, 40],
        })
    });
    let mut painted = sphere(0.036, 24);
    painted.colors =
        painted.uvs.iter().map(|uv| if uv[1] < 0.5 { [230, 140, 30] } else { [60, 120, 60] }).collect();
    let top = 0.72;
    let things: Vec<(Mesh, Material, [f64; 3], f64)> = vec![
        (cuboid([0.06, 0.16, 0.21], 1.0), textured(label.clone(), 0.4), [0.85, 0.22, top + 0.105], 0.3),
        (cuboid([0.09, 0.04, 0.17], 1.0), plain([0.9, 0.85, 0.2], 0.5, 0.0), [0.70, 0.25, top + 0.085], -0.5),
        (
            cuboid([0.10, 0.10, 0.06], 1.0),
            textured(textures::cardboard(), 0.9),
            [0.62, -0.02, top + 0.03],
            0.6,
        ),
        (cylinder(0.033, 0.10, 48), textured(label, 0.3), [0.80, 0.05, top + 0.05], 0.0),
        (cylinder(0.051, 0.14, 48), plain([0.15, 0.25, 0.6], 0.35, 0.0), [0.88, -0.12, top + 0.07], 0.0),
        (cylinder(0.042, 0.08, 48), plain([0.9, 0.9, 0.88], 0.3, 0.9), [0.68, -0.22, top + 0.04], 0.0),
        (painted, plain([1.0; 3], 0.5, 0.0), [0.72, 0.10, top + 0.036], 0.0),
        (sphere(0.05, 32), plain([0.8, 0.1, 0.1], 0.25, 0.0), [0.80, -0.30, top + 0.05], 0.0),
    ];
    let mut instances: Vec<Instance> = things
        .into_iter()
        .enumerate()
        .map(|(i, (mesh, material, xyz, yaw))| Instance {
            visual: visual(mesh, material),
            pose: at(xyz, yaw),
            label: i as u16 + 1,
        })
        .collect();
    let mut furniture = |mesh, material, xyz| {
        instances.push(Instance { visual: visual(mesh, material), pose: at(xyz, 0.0), label: 0 });
    };
    furniture(cuboid([0.7, 1.2, 0.04], 1.5), textured(textures::wood(7), 0.55), [0.85, 0.0, top - 0.02]);
    furniture(cuboid([8.0, 8.0, 0.02], 8.0), textured(textures::floor(3), 0.7), [0.0, 0.0, -0.01]);
    furniture(cuboid([0.02, 8.0, 3.0], 3.0), textured(textures::wall(), 0.9), [2.5, 0.0, 1.5]);
    RenderScene { instances, bounce: None }
}
