//! An object's surface for sampling and rays, in the object frame.

use grip_sim::mesh::Mesh;
use nalgebra::{Point3, Vector3};
use parry3d::math::Vector;
use parry3d::query::{Ray, RayCullingMode};
use parry3d::shape::TriMesh;
use rand::{Rng, RngExt};

/// A point of the surface and the outward unit normal there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Object frame, metres.
    pub point: Point3<f64>,
    /// Outward unit normal.
    pub normal: Vector3<f64>,
}

/// A triangle mesh with a tree for rays and the areas for sampling.
#[derive(Debug)]
pub struct Surface {
    mesh: TriMesh,
    edges: Vec<SurfacePoint>,
    /// Running sum of the triangles' areas.
    area: Vec<f64>,
    /// Centre of mass of the solid of uniform density, or of the vertices when the mesh is not closed.
    pub center_of_mass: Point3<f64>,
}

/// Centre of mass of the solid of uniform density that a mesh bounds, or of its vertices when it is not closed.
pub fn center_of_mass(mesh: &Mesh) -> Point3<f64> {
    let (mut volume, mut moment) = (0.0, Vector3::zeros());
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize].coords.cast::<f64>());
        // Signed tetrahedron from the origin.
        let v = a.dot(&b.cross(&c)) / 6.0;
        volume += v;
        moment += (a + b + c) * (0.25 * v);
    }
    if volume > 1e-9 {
        return Point3::from(moment / volume);
    }
    let n = mesh.positions.len().max(1) as f64;
    let total: Vector3<f64> = mesh.positions.iter().map(|p| p.coords.cast::<f64>()).sum();
    Point3::from(total / n)
}

impl Surface {
    /// The surface of a mesh; `None` when it has no triangle with an area.
    pub fn new(mesh: &Mesh) -> Option<Self> {
        let vertices: Vec<Vector> = mesh.positions.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        let mut sum = 0.0;
        let mut area = Vec::with_capacity(mesh.triangles.len());
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize].coords.cast::<f64>());
            sum += 0.5 * (b - a).cross(&(c - a)).norm();
            area.push(sum);
        }
        if !(sum > 0.0 && sum.is_finite()) {
            return None;
        }
        let center_of_mass = center_of_mass(mesh);
        let edges = edge_points(mesh);
        let mesh = TriMesh::new(vertices, mesh.triangles.clone()).ok()?;
        Some(Self { mesh, edges, area, center_of_mass })
    }

    /// The mesh's vertices, and points along its longer edges every 2 mm, with their normals: what rays on a grid may miss.
    pub fn edges(&self) -> &[SurfacePoint] {
        &self.edges
    }

    /// Square metres.
    pub fn area(&self) -> f64 {
        self.area[self.area.len() - 1]
    }

    /// A point drawn uniformly by area.
    pub fn sample(&self, rng: &mut impl Rng) -> SurfacePoint {
        let x = rng.random::<f64>() * self.area();
        let i = self.area.partition_point(|a| *a <= x).min(self.area.len() - 1);
        let (mut u, mut v) = (rng.random::<f64>(), rng.random::<f64>());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let t = self.mesh.triangle(i as u32);
        let p = t.a + (t.b - t.a) * u as f32 + (t.c - t.a) * v as f32;
        SurfacePoint { point: to_point(p), normal: self.normal(i as u32) }
    }

    fn normal(&self, triangle: u32) -> Vector3<f64> {
        let t = self.mesh.triangle(triangle);
        let n = (t.b - t.a).cross(t.c - t.a).normalize_or_zero();
        Vector3::new(n.x.into(), n.y.into(), n.z.into())
    }

    fn cast(
        &self,
        from: &Point3<f64>,
        dir: &Vector3<f64>,
        max: f64,
        mode: RayCullingMode,
    ) -> Option<SurfacePoint> {
        let ray = Ray::new(to_vector(&from.coords), to_vector(dir));
        let hit = self.mesh.cast_local_ray_with_culling(&ray, max as f32, mode)?;
        Some(SurfacePoint {
            point: from + dir * f64::from(hit.time_of_impact),
            normal: self.normal(hit.subshape),
        })
    }

    /// Where a ray first enters the solid within `max` metres.
    pub fn enter(&self, from: &Point3<f64>, dir: &Vector3<f64>, max: f64) -> Option<SurfacePoint> {
        self.cast(from, dir, max, RayCullingMode::IgnoreBackfaces)
    }

    /// Where a ray first leaves the solid within `max` metres.
    pub fn leave(&self, from: &Point3<f64>, dir: &Vector3<f64>, max: f64) -> Option<SurfacePoint> {
        self.cast(from, dir, max, RayCullingMode::IgnoreFrontfaces)
    }
}

fn edge_points(mesh: &Mesh) -> Vec<SurfacePoint> {
    const APART: f64 = 0.002;
    let vertex = |i: u32| {
        let normal = mesh.normals.get(i as usize).map_or_else(Vector3::zeros, |n| n.cast());
        SurfacePoint { point: mesh.positions[i as usize].cast(), normal }
    };
    let mut points: Vec<SurfacePoint> = (0..mesh.positions.len() as u32).map(vertex).collect();
    // Each inner edge belongs to two triangles that run along it in opposite directions.
    for t in &mesh.triangles {
        for (i, j) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])].into_iter().filter(|(i, j)| i < j) {
            let (a, b) = (vertex(i), vertex(j));
            let n = ((b.point - a.point).norm() / APART).ceil().min(1e4) as usize;
            points.extend((1..n).map(|k| {
                let share = k as f64 / n as f64;
                SurfacePoint {
                    point: a.point + (b.point - a.point) * share,
                    normal: a.normal.lerp(&b.normal, share),
                }
            }));
        }
    }
    points
}

fn to_vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x as f32, v.y as f32, v.z as f32)
}

fn to_point(v: Vector) -> Point3<f64> {
    Point3::new(v.x.into(), v.y.into(), v.z.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{box_model, cylinder_model};

    #[test]
    fn rays_enter_and_leave_a_box_at_its_faces() {
        let model = box_model("box", [0.1, 0.06, 0.2]);
        let s = Surface::new(&model.visual.mesh).unwrap();
        let from = Point3::new(-0.5, 0.01, 0.02);
        let enter = s.enter(&from, &Vector3::x(), 1.0).unwrap();
        let leave = s.leave(&from, &Vector3::x(), 1.0).unwrap();
        assert!((enter.point.x + 0.05).abs() < 1e-6 && (enter.normal + Vector3::x()).norm() < 1e-6);
        assert!((leave.point.x - 0.05).abs() < 1e-6 && (leave.normal - Vector3::x()).norm() < 1e-6);
        assert!(s.enter(&from, &Vector3::x(), 0.4).is_none());
    }

    #[test]
    fn samples_lie_on_the_surface_and_the_mass_is_in_the_middle() {
        let model = cylinder_model("can", 0.033, 0.1);
        let s = Surface::new(&model.visual.mesh).unwrap();
        assert!(s.center_of_mass.coords.norm() < 1e-6);
        let mut rng = grip_sim::rng::stream(0, "surface");
        for _ in 0..200 {
            let p = s.sample(&mut rng).point;
            let r = p.x.hypot(p.y);
            let on_side = (r - 0.033).abs() < 2e-4 && p.z.abs() < 0.05 + 1e-6;
            let on_end = (p.z.abs() - 0.05).abs() < 1e-6 && r < 0.0331;
            assert!(on_side || on_end, "{p}");
        }
    }
}
