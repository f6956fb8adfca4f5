//! Closed meshes from few numbers: rounded boxes, and surfaces through rings of points.
//!
//! Lengths in metres. A picture lies on a surface as a person outside sees it: its right is the surface's right, its top
//! the surface's top. Neighbouring pieces repeat the points on their common edge to the bit, so that the whole is closed.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, Translation3, Vector3};

use crate::mesh::Mesh;
use crate::shape::{CollisionShape, Convex};

/// Surfaces that bend by more than this between two pieces, radians, have an edge there.
const CREASE: f64 = 0.7;

/// A rectangle of the texture, `[u0, v0, u1, v1]`, `(0, 0)` at the texture's top left.
pub(super) type UvRect = [f64; 4];

/// How a picture lies on rings of points.
#[derive(Debug, Clone, Copy)]
pub(super) enum UvMap {
    /// Wrapped around: its left edge at the rings' first points, its right edge there again; its top at the first ring.
    Around(UvRect),
    /// Laid on from above (right is +x, top +y) over `[-half_x, half_x] x [-half_y, half_y]`.
    FromAbove(UvRect, [f64; 2]),
    /// Laid on from below (right is +x, top -y).
    FromBelow(UvRect, [f64; 2]),
}

/// A mesh being put together. The pieces must make a closed surface in the end.
#[derive(Debug, Clone, Default)]
pub(super) struct MeshBuilder {
    positions: Vec<Point3<f64>>,
    normals: Vec<Vector3<f64>>,
    uvs: Vec<[f64; 2]>,
    /// First vertex with a finish (roughness, metallic), in order; before the first such vertex the material's own.
    finishes: Vec<(usize, [f64; 2])>,
    triangles: Vec<[u32; 3]>,
}

/// A circle's points, counter-clockwise seen from above, the first at +x.
pub(super) fn circle(radius: f64, z: f64, count: usize) -> Vec<Point3<f64>> {
    ellipse(radius, radius, z, count)
}

/// An ellipse's points, counter-clockwise seen from above, the first at +x.
pub(super) fn ellipse(rx: f64, ry: f64, z: f64, count: usize) -> Vec<Point3<f64>> {
    (0..count)
        .map(|k| {
            let (sin, cos) = (TAU * k as f64 / count as f64).sin_cos();
            Point3::new(rx * cos, ry * sin, z)
        })
        .collect()
}

/// The points of a rectangle with round corners, counter-clockwise seen from above; `per_corner` points on each arc, the
/// first in the middle of the edge at +x. `grow` moves the outline outwards.
pub(super) fn rounded_rectangle(
    [half_x, half_y]: [f64; 2],
    radius: f64,
    grow: f64,
    z: f64,
    per_corner: usize,
) -> Vec<Point3<f64>> {
    let (cx, cy) = (half_x - radius, half_y - radius);
    let r = (radius + grow).max(0.0);
    let mut points = vec![Point3::new(cx + r, 0.0, z)];
    for (quarter, (sx, sy)) in [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].into_iter().enumerate() {
        for k in 0..per_corner {
            let angle = TAU / 4.0 * (quarter as f64 + k as f64 / (per_corner - 1) as f64);
            points.push(Point3::new(sx * cx + r * angle.cos(), sy * cy + r * angle.sin(), z));
        }
    }
    points
}

/// A ring shrunk to one point: closes a surface.
pub(super) fn pole(x: f64, y: f64, z: f64, count: usize) -> Vec<Point3<f64>> {
    vec![Point3::new(x, y, z); count]
}

impl MeshBuilder {
    /// Nothing yet.
    pub(super) fn new() -> Self {
        Self::default()
    }

    /// Adds a vertex and returns its index.
    pub(super) fn vertex(&mut self, position: Point3<f64>, normal: Vector3<f64>, uv: [f64; 2]) -> u32 {
        self.positions.push(position);
        self.normals.push(normal.try_normalize(1e-12).unwrap_or_else(Vector3::z));
        self.uvs.push(uv);
        (self.positions.len() - 1) as u32
    }

    /// From here on vertices have this roughness and metallic, each 0 to 1, in place of the material's.
    pub(super) fn finish_with(&mut self, roughness: f64, metallic: f64) {
        self.finishes.push((self.positions.len(), [roughness, metallic]));
    }

    /// A triangle, counter-clockwise seen from outside. One without area (two corners in one place) is left out.
    pub(super) fn triangle(&mut self, a: u32, b: u32, c: u32) {
        let p = |i: u32| self.positions[i as usize];
        if p(a) != p(b) && p(b) != p(c) && p(c) != p(a) {
            self.triangles.push([a, b, c]);
        }
    }

    /// A quadrilateral, counter-clockwise seen from outside.
    pub(super) fn quad(&mut self, a: u32, b: u32, c: u32, d: u32) {
        self.triangle(a, b, c);
        self.triangle(a, c, d);
    }

    /// A patch of `rows x columns` vertices: `at(row, column)` gives place, normal and texture point; rows go down and
    /// columns right, seen from outside.
    pub(super) fn patch(
        &mut self,
        rows: usize,
        columns: usize,
        at: impl Fn(usize, usize) -> (Point3<f64>, Vector3<f64>, [f64; 2]),
    ) {
        let first = self.positions.len() as u32;
        for i in 0..rows {
            for j in 0..columns {
                let (position, normal, uv) = at(i, j);
                self.vertex(position, normal, uv);
            }
        }
        let index = |i: usize, j: usize| first + (i * columns + j) as u32;
        for i in 1..rows {
            for j in 1..columns {
                self.quad(index(i - 1, j - 1), index(i, j - 1), index(i, j), index(i - 1, j));
            }
        }
    }

    /// A box about the origin with round edges. `faces` are the pictures on +x, -x, +y, -y, +z, -z; up is +z on the
    /// sides, +y on the top, -y on the bottom.
    pub(super) fn rounded_box(&mut self, half: Vector3<f64>, radius: f64, faces: [UvRect; 6]) {
        let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
        let axes = [(y, z), (-y, z), (-x, z), (x, z), (x, y), (x, -y)];
        // Tangents of the angle from the face's normal, and which end of the face: at 1 two faces meet.
        let steps: [(f64, f64); 6] =
            [(-1.0, -1.0), (-0.414, -1.0), (0.0, -1.0), (0.0, 1.0), (0.414, 1.0), (1.0, 1.0)];
        for ((right, up), [u0, v0, u1, v1]) in axes.into_iter().zip(faces) {
            let out = right.cross(&up);
            let inner = half - Vector3::repeat(radius);
            let reach = |axis: &Vector3<f64>| axis.abs().dot(&half);
            self.patch(6, 6, |i, j| {
                let ((a, side_a), (b, side_b)) = (steps[j], steps[5 - i]);
                let normal = (right * a + up * b + out).normalize();
                let corner = (right * side_a + up * side_b + out).component_mul(&inner);
                let position = Point3::from(corner + normal * radius);
                let s = 0.5 + 0.5 * position.coords.dot(&right) / reach(&right);
                let t = 0.5 - 0.5 * position.coords.dot(&up) / reach(&up);
                (position, normal, [u0 + s * (u1 - u0), v0 + t * (v1 - v0)])
            });
        }
    }

    /// The surface through rings of equally many points. Seen from outside, the rings follow each other downwards and
    /// each runs to the right (for a standing body: top to bottom, counter-clockwise seen from above). Sharp bends from
    /// ring to ring become edges; along the rings the surface is smooth. It is open at the first and last ring, unless
    /// they are poles.
    pub(super) fn rings(&mut self, rings: &[Vec<Point3<f64>>], map: UvMap) {
        let count = rings.first().map_or(0, Vec::len);
        if count < 3 || rings.iter().any(|r| r.len() != count) {
            return;
        }
        let rows = rings.len();
        // Texture coordinates run with the length on the surface.
        let widest = rings.iter().max_by(|a, b| perimeter(a).total_cmp(&perimeter(b))).unwrap_or(&rings[0]);
        let mut across = vec![0.0];
        for j in 0..count {
            across.push(across[j] + (widest[(j + 1) % count] - widest[j]).norm());
        }
        let mut down = vec![0.0];
        for i in 1..rows {
            let step: f64 = (0..count).map(|j| (rings[i][j] - rings[i - 1][j]).norm()).sum();
            down.push(down[i - 1] + step / count as f64);
        }
        let (width, length) = (across[count].max(1e-12), down[rows - 1].max(1e-12));
        let uv = |i: usize, j: usize| {
            let p = rings[i][j % count];
            let (s, t, [u0, v0, u1, v1]) = match map {
                UvMap::Around(rect) => (across[j] / width, down[i] / length, rect),
                UvMap::FromAbove(rect, [hx, hy]) => (0.5 + 0.5 * p.x / hx, 0.5 - 0.5 * p.y / hy, rect),
                UvMap::FromBelow(rect, [hx, hy]) => (0.5 + 0.5 * p.x / hx, 0.5 + 0.5 * p.y / hy, rect),
            };
            [u0 + s * (u1 - u0), v0 + t * (v1 - v0)]
        };
        // The normal at point j of the strip between rings i and i + 1.
        let strip_normal = |i: usize, j: usize| {
            let (before, j, after) = ((j + count - 1) % count, j % count, (j + 1) % count);
            let around = |ring: &[Point3<f64>]| ring[after] - ring[before];
            let along = around(&rings[i]) + around(&rings[i + 1]);
            let mut step = rings[i + 1][j] - rings[i][j];
            if step.norm() < 1e-12 {
                step = rings[i + 1][after] - rings[i][after];
            }
            step.cross(&along).try_normalize(1e-18).unwrap_or_else(Vector3::zeros)
        };
        let cos_crease = CREASE.cos();
        for i in 0..rows - 1 {
            let normal = |row: usize, j: usize| {
                let own = strip_normal(i, j);
                let other = if row == i && i > 0 {
                    strip_normal(i - 1, j)
                } else if row == i + 1 && i + 2 < rows {
                    strip_normal(i + 1, j)
                } else {
                    return own;
                };
                if own.dot(&other) > cos_crease { own + other } else { own }
            };
            self.patch(2, count + 1, |row, j| {
                (rings[i + row][j % count], normal(i + row, j), uv(i + row, j))
            });
        }
    }

    /// The mesh, done. Where any vertex has a finish of its own, all need one: the first must come before any vertex.
    pub(super) fn finish(self) -> Mesh {
        let mut finish = Vec::new();
        for (i, (from, values)) in self.finishes.iter().enumerate() {
            let to = self.finishes.get(i + 1).map_or(self.positions.len(), |next| next.0);
            finish.extend(std::iter::repeat_n(values.map(|v| (v * 255.0).round() as u8), to - from));
        }
        Mesh {
            positions: self.positions.iter().map(|p| p.cast()).collect(),
            normals: self.normals.iter().map(|n| n.cast()).collect(),
            uvs: self.uvs.iter().map(|uv| uv.map(|v| v as f32)).collect(),
            colors: Vec::new(),
            finish,
            triangles: self.triangles,
        }
    }
}

/// Length of a closed ring.
fn perimeter(ring: &[Point3<f64>]) -> f64 {
    (0..ring.len()).map(|k| (ring[(k + 1) % ring.len()] - ring[k]).norm()).sum()
}

/// An upright box about `center`.
pub(super) fn cuboid(center: [f64; 3], half: [f64; 3]) -> CollisionShape {
    CollisionShape {
        pose: Translation3::from(Vector3::from(center)).into(),
        geometry: Convex::Cuboid { half: half.into() },
    }
}

/// An upright cylinder about `center`.
pub(super) fn cylinder(center: [f64; 3], half_height: f64, radius: f64) -> CollisionShape {
    CollisionShape {
        pose: Translation3::from(Vector3::from(center)).into(),
        geometry: Convex::Cylinder { half_height, radius },
    }
}

/// The hull of some points.
pub(super) fn hull(points: Vec<Point3<f64>>) -> CollisionShape {
    CollisionShape { pose: Isometry3::identity(), geometry: Convex::Hull { points } }
}
