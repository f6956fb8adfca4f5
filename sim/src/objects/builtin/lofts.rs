//! Closed surfaces through rings of points, and the convex pieces between the same rings.
//!
//! A [`Part`] is one closed surface. A model is a union of closed parts that may run into each other, such as a handle
//! into a mug: each is watertight, so inside and outside stay defined everywhere.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};

use super::canvas::Canvas;
use crate::mesh::{Material, Mesh, Visual};
use crate::shape::{CollisionShape, Convex};

/// Points round a section, counter-clockwise seen from the next ring.
pub(super) type Ring = Vec<Point3<f64>>;

/// Millimetres to metres: the tables of profiles are in the unit of the published sizes.
pub(super) const MM: f64 = 1e-3;

/// Faces that meet at more than this angle keep their edge, radians.
const CREASE: f64 = 38.0 / 180.0 * PI;

/// Colour and texture coordinates of a corner.
#[derive(Debug, Clone, Copy)]
pub(super) struct Look {
    /// sRGB.
    pub color: [u8; 3],
    /// Texture coordinates.
    pub uv: [f32; 2],
}

/// The top of every texture, white, for surfaces with a colour and no print: this share of its height.
pub(super) const MARGIN: f32 = 0.06;

/// The middle of that margin.
const PLAIN: [f32; 2] = [0.5, 0.5 * MARGIN];

/// A plain colour.
pub(super) fn plain(color: [u8; 3]) -> Look {
    Look { color, uv: PLAIN }
}

/// Where on a part a corner is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    /// The strip between rings `band` and `band + 1`; `None` on the two ends.
    pub band: Option<usize>,
    /// Share of the way round, 0 to 1.
    pub around: f64,
    /// The same of the middle of its facet: tells the two sides of a seam apart.
    pub facet: f64,
    /// Position, metres.
    pub point: Point3<f64>,
}

/// One closed surface.
#[derive(Debug, Clone, Default)]
pub(super) struct Part {
    points: Vec<Point3<f64>>,
    triangles: Vec<[usize; 3]>,
    looks: Vec<[Look; 3]>,
}

impl Part {
    /// The surface through `rings`, all of the same length, closed by a fan on each end.
    pub(super) fn loft(rings: &[Ring], look: impl Fn(Spot) -> Look) -> Self {
        let mut part = Self::sides(rings, false, &look);
        let n = rings.first().map_or(0, Vec::len);
        let ends = [(0, true), (rings.len().saturating_sub(1), false)];
        for (row, start) in ends {
            let Some(ring) = rings.get(row) else { continue };
            let center = centroid(ring);
            let hub = part.points.len();
            part.points.push(center);
            for j in 0..n {
                let (a, b) = (row * n + j, row * n + (j + 1) % n);
                let (from, to) = (j as f64 / n as f64, (j + 1) as f64 / n as f64);
                let spot = |index: usize, around| {
                    look(Spot { band: None, around, facet: 0.5 * (from + to), point: part.points[index] })
                };
                let (corner, looks) = if start {
                    ([hub, b, a], [spot(hub, from), spot(b, to), spot(a, from)])
                } else {
                    ([hub, a, b], [spot(hub, from), spot(a, from), spot(b, to)])
                };
                part.triangles.push(corner);
                part.looks.push(looks);
            }
        }
        part
    }

    /// The surface through `rings` and back from the last to the first, such as the loop of a handle.
    pub(super) fn closed_loop(rings: &[Ring], look: impl Fn(Spot) -> Look) -> Self {
        Self::sides(rings, true, &look)
    }

    fn sides(rings: &[Ring], wrap: bool, look: &impl Fn(Spot) -> Look) -> Self {
        let n = rings.first().map_or(0, Vec::len);
        let mut part = Self { points: rings.iter().flatten().copied().collect(), ..Self::default() };
        let rows = rings.len();
        for i in 0..if wrap { rows } else { rows.saturating_sub(1) } {
            let above = (i + 1) % rows;
            for j in 0..n {
                let right = (j + 1) % n;
                let (from, to) = (j as f64 / n as f64, (j + 1) as f64 / n as f64);
                let corner = |row: usize, column: usize, around: f64| {
                    let index = row * n + column;
                    (
                        index,
                        look(Spot {
                            band: Some(i),
                            around,
                            facet: 0.5 * (from + to),
                            point: part.points[index],
                        }),
                    )
                };
                let [a, b, c, d] = [
                    corner(i, j, from),
                    corner(i, right, to),
                    corner(above, right, to),
                    corner(above, j, from),
                ];
                for [p, q, r] in [[a, b, c], [a, c, d]] {
                    part.triangles.push([p.0, q.0, r.0]);
                    part.looks.push([p.1, q.1, r.1]);
                }
            }
        }
        part
    }

    /// The part turned and moved.
    pub(super) fn moved(mut self, pose: &Isometry3<f64>) -> Self {
        for point in &mut self.points {
            *point = pose * *point;
        }
        self
    }
}

/// Joins `parts` into one visual. Vertices are shared where position, look and smoothed normal agree.
pub(super) fn visual(parts: &[Part], roughness: f32, texture: Canvas) -> Visual {
    let mut mesh = Mesh::default();
    for part in parts {
        append(&mut mesh, part);
    }
    let texture = Some(texture.finish());
    let material = Material { base_color: [1.0; 3], roughness, metallic: 0.0, texture };
    Visual { mesh: Arc::new(mesh), material }
}

/// What makes two corners one vertex: point, colour, the bits of the texture point, rounded normal.
type VertexKey = (usize, [u8; 3], [u32; 2], [i32; 3]);

fn append(mesh: &mut Mesh, part: &Part) {
    let area_normals: Vec<Vector3<f64>> = part
        .triangles
        .iter()
        .map(|&[a, b, c]| (part.points[b] - part.points[a]).cross(&(part.points[c] - part.points[a])))
        .collect();
    let mut faces_at: Vec<Vec<usize>> = vec![Vec::new(); part.points.len()];
    for (face, corners) in part.triangles.iter().enumerate() {
        for &corner in corners {
            faces_at[corner].push(face);
        }
    }
    let limit = CREASE.cos();
    // Looked up by key alone, so that the map's order never shows in the mesh.
    let mut seen: HashMap<VertexKey, u32> = HashMap::new();
    for (face, corners) in part.triangles.iter().enumerate() {
        let own = area_normals[face].normalize();
        let mut triangle = [0; 3];
        for (slot, &corner) in corners.iter().enumerate() {
            let smooth: Vector3<f64> = faces_at[corner]
                .iter()
                .map(|&other| area_normals[other])
                .filter(|normal| normal.dot(&own) >= limit * normal.norm())
                .sum();
            let normal = smooth.try_normalize(0.0).unwrap_or(own);
            let look = part.looks[face][slot];
            let key = (
                corner,
                look.color,
                look.uv.map(f32::to_bits),
                [normal.x, normal.y, normal.z].map(|value| (value * 1e4).round() as i32),
            );
            triangle[slot] = *seen.entry(key).or_insert_with(|| {
                mesh.positions.push(part.points[corner].cast());
                mesh.normals.push(normal.cast());
                mesh.uvs.push(look.uv);
                mesh.colors.push(look.color);
                (mesh.positions.len() - 1) as u32
            });
        }
        mesh.triangles.push(triangle);
    }
}

/// A superellipse |x/a|^p + |y/b|^p = 1 of `n` points evenly along its length: 2 is an ellipse, 6 a rectangle with round
/// corners.
pub(super) fn superellipse(a: f64, b: f64, power: f64, n: usize) -> Vec<[f64; 2]> {
    let fine: Vec<[f64; 2]> = (0..16 * n)
        .map(|j| {
            let (sin, cos) = (TAU * j as f64 / (16 * n) as f64).sin_cos();
            let radius = ((cos / a).abs().powf(power) + (sin / b).abs().powf(power)).powf(-1.0 / power);
            [radius * cos, radius * sin]
        })
        .collect();
    resampled(&fine, n)
}

/// A closed outline as `n` points evenly along its length, starting at its first point.
pub(super) fn resampled(outline: &[[f64; 2]], n: usize) -> Vec<[f64; 2]> {
    let corner = |i: usize| outline[i % outline.len()];
    let lengths: Vec<f64> = (0..outline.len())
        .map(|i| {
            let ([x0, y0], [x1, y1]) = (corner(i), corner(i + 1));
            (x1 - x0).hypot(y1 - y0)
        })
        .collect();
    let total: f64 = lengths.iter().sum();
    let (mut edge, mut passed) = (0, 0.0);
    (0..n)
        .map(|j| {
            let target = total * j as f64 / n as f64;
            while edge + 1 < outline.len() && passed + lengths[edge] < target {
                passed += lengths[edge];
                edge += 1;
            }
            let t = if lengths[edge] > 0.0 { (target - passed) / lengths[edge] } else { 0.0 };
            let ([x0, y0], [x1, y1]) = (corner(edge), corner(edge + 1));
            [x0 + t * (x1 - x0), y0 + t * (y1 - y0)]
        })
        .collect()
}

/// A section in the plane at height `z`, its centre moved by `(x, y)`.
pub(super) fn level(section: &[[f64; 2]], x: f64, y: f64, z: f64) -> Ring {
    section.iter().map(|&[u, v]| Point3::new(x + u, y + v, z)).collect()
}

/// Rings of circles about z through `(radius, z)` in millimetres.
pub(super) fn revolved(profile: &[[f64; 2]], n: usize) -> Vec<Ring> {
    profile.iter().map(|&[r, z]| level(&superellipse(r * MM, r * MM, 2.0, n), 0.0, 0.0, z * MM)).collect()
}

/// Catmull-Rom through rows of numbers, `steps` intervals between two rows.
pub(super) fn spline<const N: usize>(rows: &[[f64; N]], steps: usize) -> Vec<[f64; N]> {
    let last = rows.len() - 1;
    let mut out = Vec::with_capacity(last * steps + 1);
    for i in 0..last {
        let (before, from, to, after) =
            (rows[i.saturating_sub(1)], rows[i], rows[i + 1], rows[(i + 2).min(last)]);
        for step in 0..steps {
            let t = step as f64 / steps as f64;
            out.push(std::array::from_fn(|k| {
                let (a, b, c, d) = (before[k], from[k], to[k], after[k]);
                b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)))
            }));
        }
    }
    out.push(rows[last]);
    out
}

/// Rings along a plane curve. `path` holds points, `binormal` is the plane's normal; `section(i)` gives the ring at point
/// `i` as (along binormal x tangent, along binormal). `closed` joins the last point's tangent to the first.
pub(super) fn swept(
    path: &[Point3<f64>],
    binormal: Vector3<f64>,
    closed: bool,
    section: impl Fn(usize) -> Vec<[f64; 2]>,
) -> Vec<Ring> {
    let n = path.len();
    (0..n)
        .map(|i| {
            let (before, after) = if closed {
                ((i + n - 1) % n, (i + 1) % n)
            } else {
                (i.saturating_sub(1), (i + 1).min(n - 1))
            };
            let tangent = (path[after] - path[before]).normalize();
            let side = binormal.cross(&tangent);
            // side x binormal = tangent: a counter-clockwise section stays so.
            section(i).iter().map(|&[u, v]| path[i] + side * u + binormal * v).collect()
        })
        .collect()
}

/// The convex hull of `points`.
pub(super) fn hull(points: Vec<Point3<f64>>) -> CollisionShape {
    CollisionShape { pose: Isometry3::identity(), geometry: Convex::Hull { points } }
}

/// Hulls between the rings at consecutive `breaks`, `per_ring` points of each ring.
pub(super) fn hulls(rings: &[Ring], breaks: &[usize], per_ring: usize) -> Vec<CollisionShape> {
    breaks
        .windows(2)
        .map(|pair| hull(pair.iter().flat_map(|&row| thinned(&rings[row], per_ring)).collect()))
        .collect()
}

/// `count` points of a ring, evenly by index.
pub(super) fn thinned(ring: &[Point3<f64>], count: usize) -> Vec<Point3<f64>> {
    let count = count.min(ring.len());
    (0..count).map(|k| ring[k * ring.len() / count]).collect()
}

/// A wall round the z axis as `count` wedges between `outer` and `inner` profiles of `(radius, z)` in millimetres.
pub(super) fn wall(outer: &[[f64; 2]], inner: &[[f64; 2]], count: usize) -> Vec<CollisionShape> {
    // Chords cut the circle; scaling the polygon puts as much of it outside as inside.
    let scale = MM * 2.0 / (1.0 + (PI / count as f64).cos());
    (0..count)
        .map(|k| {
            let at = |[r, z]: [f64; 2]| {
                [k, k + 1].map(|edge| {
                    let (sin, cos) = (TAU * edge as f64 / count as f64).sin_cos();
                    Point3::new(r * scale * cos, r * scale * sin, z * MM)
                })
            };
            hull(outer.iter().chain(inner).flat_map(|&corner| at(corner)).collect())
        })
        .collect()
}

/// The mean of a ring's points.
pub(super) fn centroid(ring: &[Point3<f64>]) -> Point3<f64> {
    let sum: Vector3<f64> = ring.iter().map(|point| point.coords).sum();
    Point3::from(sum / ring.len().max(1) as f64)
}

/// Rings between two edges drawn in the x-y plane. A row is, in millimetres, x and y of the edge on the left of the
/// direction of travel, x and y of the one on the right, half the thickness, and the height of the middle.
pub(super) fn ribbon(rows: &[[f64; 6]], power: f64, n: usize) -> Vec<Ring> {
    rows.iter()
        .map(|&[left_x, left_y, right_x, right_y, half, z]| {
            let (left, right) = (Point3::new(left_x, left_y, z) * MM, Point3::new(right_x, right_y, z) * MM);
            let across = 0.5 * (left - right);
            let width = across.norm();
            superellipse(width, half * MM, power, n)
                .iter()
                .map(|&[u, v]| nalgebra::center(&left, &right) + across * (u / width) + Vector3::z() * v)
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::build;
    use super::*;
    use nalgebra::Matrix3;

    const LOFTED: [&str; 11] = [
        "006_mustard_bottle",
        "011_banana",
        "019_pitcher_base",
        "021_bleach_cleanser",
        "024_bowl",
        "025_mug",
        "035_power_drill",
        "037_scissors",
        "040_large_marker",
        "051_large_clamp",
        "052_extra_large_clamp",
    ];

    #[test]
    fn a_loft_through_circles_has_the_volume_of_its_cone() {
        let part = Part::loft(&revolved(&[[30.0, 0.0], [15.0, 60.0]], 256), |_| plain([255; 3]));
        let volume: f64 = part
            .triangles
            .iter()
            .map(|&[a, b, c]| {
                part.points[a].coords.dot(&part.points[b].coords.cross(&part.points[c].coords)) / 6.0
            })
            .sum();
        let exact = PI * 0.06 / 3.0 * (0.03_f64.powi(2) + 0.03 * 0.015 + 0.015_f64.powi(2));
        assert!((volume / exact - 1.0).abs() < 5e-4, "{volume} for {exact}");
    }

    #[test]
    fn a_spline_passes_through_its_rows_and_follows_a_line() {
        let rows = [[0.0, 1.0], [2.0, 5.0], [4.0, 9.0], [6.0, 13.0]];
        let fine = spline(&rows, 4);
        for (i, row) in rows.iter().enumerate() {
            assert_eq!(&fine[4 * i], row);
        }
        assert!(fine[4..=8].iter().all(|&[x, y]| (y - 2.0 * x - 1.0).abs() < 1e-12));
    }

    #[test]
    fn every_convex_piece_has_few_points_and_a_volume() {
        for name in LOFTED {
            let model = build(name).unwrap();
            // The vessels' walls and rims are rings of wedges.
            let most = match name {
                "024_bowl" => 32,
                "025_mug" => 25,
                _ => 24,
            };
            assert!(model.collision.len() <= most, "{name}: {} pieces", model.collision.len());
            for (k, piece) in model.collision.iter().enumerate() {
                let Convex::Hull { points } = &piece.geometry else { panic!("{name}: piece {k} is no hull") };
                assert!(points.len() <= 32, "{name}: piece {k} has {} points", points.len());
                let mean = centroid(points);
                let spread: Matrix3<f64> = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum();
                let thinnest = (spread.symmetric_eigenvalues().min() / points.len() as f64).sqrt();
                assert!(thinnest > 3e-4, "{name}: piece {k} is flat, {thinnest} m");
            }
        }
    }

    #[test]
    fn the_pieces_reach_as_far_as_the_mesh() {
        let far = Point3::from([f64::MAX; 3]);
        let bounds = |points: Vec<Point3<f64>>| {
            points.iter().fold((far, -far), |(low, high), p| (low.inf(p), high.sup(p)))
        };
        for name in LOFTED {
            let model = build(name).unwrap();
            let corners = model.collision.iter().flat_map(|piece| match &piece.geometry {
                Convex::Hull { points } => points.iter().map(|p| piece.pose * p).collect(),
                _ => Vec::new(),
            });
            let (low, high) = bounds(corners.collect());
            let (mesh_low, mesh_high) =
                bounds(model.visual.mesh.positions.iter().map(|p| p.cast()).collect());
            let miss = (low - mesh_low).amax().max((high - mesh_high).amax());
            assert!(miss < 3e-3, "{name}: the solid ends {miss} m away from the mesh");
        }
    }

    #[test]
    fn a_model_is_neither_coarse_nor_heavy() {
        for name in LOFTED {
            let count = build(name).unwrap().visual.mesh.triangles.len();
            assert!((1000..=8000).contains(&count), "{name}: {count} triangles");
        }
    }
}
