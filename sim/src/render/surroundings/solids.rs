//! Boxes and cylinders with texture coordinates in world scale.

use std::f32::consts::TAU;

use nalgebra::{Point3, Vector3};

use crate::mesh::Mesh;
use crate::objects::mass;

/// A box about the origin whose texture repeats every `metres`, in world scale on every face.
pub(super) fn cuboid(half: Vector3<f64>, metres: f64) -> Mesh {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        // The longer side of a face runs along the texture's width, as the grain does.
        let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut flip = false;
        if half[u] < half[v] {
            std::mem::swap(&mut u, &mut v);
            flip = true;
        }
        for sign in [-1.0, 1.0] {
            let mut normal = Vector3::zeros();
            normal[axis] = sign as f32;
            let first = mesh.positions.len() as u32;
            for (a, b) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                let mut p = Vector3::zeros();
                p[axis] = sign * half[axis];
                p[u] = a * half[u];
                p[v] = b * half[v];
                mesh.positions.push(Point3::from(p.cast::<f32>()));
                mesh.normals.push(normal);
                mesh.uvs.push([((p[u] + half[u]) / metres) as f32, ((p[v] + half[v]) / metres) as f32]);
            }
            let outward = (sign > 0.0) != flip;
            let quad: [[u32; 3]; 2] = if outward { [[0, 1, 2], [0, 2, 3]] } else { [[0, 2, 1], [0, 3, 2]] };
            mesh.triangles.extend(quad.map(|t| t.map(|i| first + i)));
        }
    }
    mesh
}

/// The convex hull of `points` (empty where it is flat) whose texture repeats about every `metres`, seen along the axis that
/// each face looks along most.
pub(super) fn hull(points: &[Point3<f64>], metres: f64) -> Mesh {
    let positions = points.iter().map(|p| p.cast::<f32>()).collect();
    let hull = mass::hull(&Mesh { positions, ..Mesh::default() }).unwrap_or_default();
    let mut mesh = Mesh::default();
    for triangle in &hull.triangles {
        let corners = triangle.map(|i| hull.positions[i as usize]);
        let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0])).normalize();
        let axis = normal.iamax();
        let first = mesh.positions.len() as u32;
        for p in corners {
            mesh.positions.push(p);
            mesh.normals.push(normal);
            mesh.uvs.push([(axis + 1) % 3, (axis + 2) % 3].map(|a| p[a] / metres as f32));
        }
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    mesh
}

/// A closed cylinder about the origin, its axis along z. The texture repeats about every `metres`, a whole number of
/// times around, so that it has no seam.
pub(super) fn cylinder(radius: f64, half_height: f64, metres: f64) -> Mesh {
    const SEGMENTS: u32 = 32;
    let around = (std::f64::consts::TAU * radius / metres).round().max(1.0) as f32;
    let (radius, half, metres) = (radius as f32, half_height as f32, metres as f32);
    let mut mesh = Mesh::default();
    let mut vertex = |p: [f32; 3], normal: [f32; 3], uv| {
        mesh.positions.push(Point3::from(p));
        mesh.normals.push(Vector3::from(normal));
        mesh.uvs.push(uv);
    };
    let angle = |i: u32| (TAU * i as f32 / SEGMENTS as f32).sin_cos();
    for i in 0..=SEGMENTS {
        let (sin, cos) = angle(i);
        let u = around * i as f32 / SEGMENTS as f32;
        for z in [-half, half] {
            vertex([radius * cos, radius * sin, z], [cos, sin, 0.0], [u, (half - z) / metres]);
        }
    }
    for z in [-half, half] {
        for i in 0..SEGMENTS {
            let (sin, cos) = angle(i);
            let (x, y) = (radius * cos, radius * sin);
            vertex([x, y, z], [0.0, 0.0, z.signum()], [x / metres, y / metres]);
        }
    }
    for i in 0..SEGMENTS {
        let low = 2 * i;
        mesh.triangles.extend([[low, low + 2, low + 3], [low, low + 3, low + 1]]);
    }
    let bottom = 2 * (SEGMENTS + 1);
    let top = bottom + SEGMENTS;
    for i in 1..SEGMENTS - 1 {
        mesh.triangles.push([bottom, bottom + i + 1, bottom + i]);
        mesh.triangles.push([top, top + i, top + i + 1]);
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_look_outwards() {
        let boxes = [Vector3::new(1.0, 2.0, 3.0), Vector3::new(3.0, 1.0, 2.0)].map(|half| cuboid(half, 1.0));
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let tetrahedron = hull(&corners.map(|p| Point3::from(p) - Vector3::repeat(0.2)), 1.0);
        assert!((tetrahedron.volume() - 1.0 / 6.0).abs() < 1e-6);
        for mesh in boxes.into_iter().chain([cylinder(0.3, 0.5, 0.4), tetrahedron]) {
            for t in &mesh.triangles {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
                let winding = (b - a).cross(&(c - a));
                assert!(winding.dot(&mesh.normals[t[0] as usize]) > 0.0);
                assert!(winding.dot(&a.coords) > 0.0);
            }
            assert!(mesh.validate().is_ok());
        }
        assert!((cylinder(0.3, 0.5, 0.4).volume() / (std::f64::consts::PI * 0.09) - 1.0).abs() < 0.01);
    }
}
