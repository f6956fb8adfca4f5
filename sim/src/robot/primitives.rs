//! URDF's boxes, cylinders, capsules and spheres as meshes and as collision shapes.

use std::f32::consts::{PI, TAU};

use nalgebra::{Isometry3, Point3, Translation3, Vector3};

use crate::mesh::Mesh;
use crate::shape::{CollisionShape, Convex};

/// Facets around a cylinder or sphere: its outline is off by less than 0.5 % of the radius.
const SEGMENTS: u32 = 32;

pub(super) fn cuboid_mesh(size: [f64; 3]) -> Mesh {
    let half = size.map(|s| (0.5 * s) as f32);
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for sign in [-1.0f32, 1.0] {
            let mut normal = Vector3::zeros();
            normal[axis] = sign;
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let first = mesh.positions.len() as u32;
            for (a, b) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                let mut p = Point3::origin();
                p[axis] = sign * half[axis];
                // Mirrored on the negative side, so that the winding stays counter-clockwise from outside.
                p[u] = sign * a * half[u];
                p[v] = b * half[v];
                mesh.positions.push(p);
                mesh.normals.push(normal);
            }
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
    }
    mesh
}

pub(super) fn cylinder_mesh(radius: f64, length: f64) -> Mesh {
    let (radius, half) = (radius as f32, (0.5 * length) as f32);
    let mut mesh = Mesh::default();
    for i in 0..=SEGMENTS {
        let (sin, cos) = (TAU * i as f32 / SEGMENTS as f32).sin_cos();
        for z in [-half, half] {
            mesh.positions.push(Point3::new(radius * cos, radius * sin, z));
            mesh.normals.push(Vector3::new(cos, sin, 0.0));
        }
        if i < SEGMENTS {
            let low = 2 * i;
            mesh.triangles.extend([[low, low + 2, low + 3], [low, low + 3, low + 1]]);
        }
    }
    for sign in [-1.0f32, 1.0] {
        let centre = mesh.positions.len() as u32;
        mesh.positions.push(Point3::new(0.0, 0.0, sign * half));
        mesh.normals.push(Vector3::new(0.0, 0.0, sign));
        for i in 0..=SEGMENTS {
            let (sin, cos) = (TAU * i as f32 / SEGMENTS as f32).sin_cos();
            mesh.positions.push(Point3::new(radius * cos, sign * radius * sin, sign * half));
            mesh.normals.push(Vector3::new(0.0, 0.0, sign));
            if i < SEGMENTS {
                mesh.triangles.push([centre, centre + 1 + i, centre + 2 + i]);
            }
        }
    }
    mesh
}

pub(super) fn sphere_mesh(radius: f64) -> Mesh {
    let radius = radius as f32;
    let rings = SEGMENTS / 2;
    let mut mesh = Mesh::default();
    for ring in 0..=rings {
        let (sin_polar, cos_polar) = (PI * ring as f32 / rings as f32).sin_cos();
        for i in 0..=SEGMENTS {
            let (sin, cos) = (TAU * i as f32 / SEGMENTS as f32).sin_cos();
            let normal = Vector3::new(sin_polar * cos, sin_polar * sin, cos_polar);
            mesh.positions.push(Point3::from(radius * normal));
            mesh.normals.push(normal);
        }
    }
    let row = SEGMENTS + 1;
    for ring in 0..rings {
        for i in 0..SEGMENTS {
            let (above, below) = (ring * row + i, (ring + 1) * row + i);
            // The triangles at the poles that have no area are left out.
            if ring > 0 {
                mesh.triangles.push([above, below + 1, above + 1]);
            }
            if ring + 1 < rings {
                mesh.triangles.push([above, below, below + 1]);
            }
        }
    }
    mesh
}

/// A cylinder and two spheres, overlapping.
pub(super) fn capsule_mesh(radius: f64, length: f64) -> Mesh {
    let mut mesh = cylinder_mesh(radius, length);
    for end in capsule_ends(length) {
        let sphere = sphere_mesh(radius);
        let first = mesh.positions.len() as u32;
        let shift = end.translation.vector.cast::<f32>();
        mesh.positions.extend(sphere.positions.iter().map(|p| p + shift));
        mesh.normals.extend(sphere.normals);
        mesh.triangles.extend(sphere.triangles.iter().map(|t| t.map(|index| index + first)));
    }
    mesh
}

/// The convex pieces of a capsule: the same union, exactly.
pub(super) fn capsule_shapes(pose: &Isometry3<f64>, radius: f64, length: f64) -> Vec<CollisionShape> {
    let mut shapes = vec![CollisionShape {
        pose: *pose,
        geometry: Convex::Cylinder { half_height: 0.5 * length, radius },
    }];
    shapes.extend(
        capsule_ends(length)
            .map(|end| CollisionShape { pose: pose * end, geometry: Convex::Sphere { radius } }),
    );
    shapes
}

fn capsule_ends(length: f64) -> [Isometry3<f64>; 2] {
    [-0.5, 0.5].map(|end| Translation3::new(0.0, 0.0, end * length).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume by the divergence theorem: right only when closed and wound outwards.
    fn volume(mesh: &Mesh) -> f64 {
        mesh.triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize].coords.cast::<f64>());
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum()
    }

    #[test]
    fn meshes_are_closed_and_wound_outwards_with_normals_along() {
        let meshes = [
            (cuboid_mesh([0.2, 0.3, 0.5]), 0.03),
            (cylinder_mesh(0.1, 0.4), std::f64::consts::PI * 0.004),
            (sphere_mesh(0.3), 4.0 / 3.0 * std::f64::consts::PI * 0.027),
        ];
        for (mesh, exact) in &meshes {
            let v = volume(mesh);
            assert!(v <= exact * (1.0 + 1e-5) && v > 0.98 * exact, "{v} {exact}");
            for t in &mesh.triangles {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
                let facet = (b - a).cross(&(c - a));
                for &i in t {
                    assert!(facet.dot(&mesh.normals[i as usize]) > 0.0);
                }
            }
        }
        assert_eq!(capsule_mesh(0.1, 0.2).positions.len(), capsule_mesh(0.1, 0.2).normals.len());
    }
}
