//! Surfaces and no more: positions and triangles, counter-clockwise from outside. All sizes in metres, about the origin.

use std::f32::consts::{PI, TAU};

use grip_sim::mesh::Mesh;
use nalgebra::{Point3, Vector3};

/// A mesh of these; its normals point away from the origin.
pub fn mesh(positions: Vec<Point3<f32>>, triangles: Vec<[u32; 3]>) -> Mesh {
    let away = |p: &Point3<f32>| p.coords.try_normalize(0.0).unwrap_or_else(Vector3::z);
    let normals = positions.iter().map(away).collect();
    Mesh { positions, normals, triangles, ..Mesh::default() }
}

/// Two meshes as one, the second moved by `shift`.
pub fn joined(first: Mesh, second: Mesh, shift: Vector3<f32>) -> Mesh {
    let count = first.positions.len() as u32;
    let moved = second.positions.into_iter().map(|p| p + shift);
    let positions = first.positions.into_iter().chain(moved).collect();
    let triangles = second.triangles.into_iter().map(|t| t.map(|i| i + count));
    mesh(positions, first.triangles.into_iter().chain(triangles).collect())
}

/// A box of full extents `size`.
pub fn cuboid(size: [f32; 3]) -> Mesh {
    box_with_corner(size, 0.5)
}

/// A box with one corner cut off by moving it inwards, so that no turn maps it to itself.
pub fn skew_box(size: [f32; 3]) -> Mesh {
    box_with_corner(size, 0.2)
}

/// The last corner stands at this share of the size.
fn box_with_corner(size: [f32; 3], last: f32) -> Mesh {
    let positions = (0..8)
        .map(|i| {
            let high = if i == 7 { last } else { 0.5 };
            let side = |b: i32, s: f32| if i >> b & 1 == 1 { high * s } else { -0.5 * s };
            Point3::new(side(0, size[0]), side(1, size[1]), side(2, size[2]))
        })
        .collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    mesh(positions, quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

/// A closed cylinder about z with this many sides.
pub fn can(radius: f32, height: f32, sides: u32) -> Mesh {
    let mut positions = vec![Point3::new(0.0, 0.0, -0.5 * height), Point3::new(0.0, 0.0, 0.5 * height)];
    let mut triangles = Vec::new();
    for i in 0..sides {
        let (sin, cos) = (TAU * i as f32 / sides as f32).sin_cos();
        for z in [-0.5 * height, 0.5 * height] {
            positions.push(Point3::new(radius * cos, radius * sin, z));
        }
        let (a, b) = (2 + 2 * i, 2 + 2 * ((i + 1) % sides));
        triangles.extend([[a, b, b + 1], [a, b + 1, a + 1], [0, b, a], [1, a + 1, b + 1]]);
    }
    mesh(positions, triangles)
}

/// A cylinder about z with a handle on the side of x.
pub fn mug(radius: f32, height: f32) -> Mesh {
    let handle = skew_box([0.04, 0.015, 0.6 * height]);
    joined(can(radius, height, 48), handle, Vector3::x() * (radius + 0.015))
}

/// A ball of 24 rings of 48 corners.
pub fn sphere(radius: f32) -> Mesh {
    let (rings, sectors) = (24u32, 48u32);
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..=rings {
        for j in 0..sectors {
            let (st, ct) = (PI * i as f32 / rings as f32).sin_cos();
            let (sp, cp) = (TAU * j as f32 / sectors as f32).sin_cos();
            positions.push(Point3::new(radius * st * cp, radius * st * sp, radius * ct));
        }
    }
    for i in 0..rings {
        for j in 0..sectors {
            let (a, b) = (i * sectors + j, i * sectors + (j + 1) % sectors);
            let (c, d) = (a + sectors, b + sectors);
            triangles.extend([[a, c, b], [b, c, d]]);
        }
    }
    mesh(positions, triangles)
}

/// A ball with a bar beside it, so that parts hide each other.
pub fn ball_and_bar() -> Mesh {
    joined(sphere(0.05), skew_box([0.03, 0.03, 0.12]), Vector3::new(0.06, 0.0, 0.01))
}

/// A cup without a lid, so that it is seen from inside too, and its surface has two sides.
pub fn cup() -> Mesh {
    let n = 24u32;
    let mut positions = vec![Point3::new(0.0, 0.0, -0.05), Point3::new(0.0, 0.0, -0.045)];
    let mut triangles = Vec::new();
    for i in 0..n {
        let (s, c) = (TAU * i as f32 / n as f32).sin_cos();
        for (radius, z) in [(0.04, -0.05), (0.04, 0.05), (0.035, 0.05), (0.035, -0.045)] {
            positions.push(Point3::new(radius * c, radius * s, z));
        }
        let (a, b) = (2 + 4 * i, 2 + 4 * ((i + 1) % n));
        for side in 0..3 {
            let (a, b) = (a + side, b + side);
            triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
        }
        triangles.extend([[0, b, a], [1, a + 3, b + 3]]);
    }
    mesh(positions, triangles)
}
