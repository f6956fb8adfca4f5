//! How far an object's collision pieces are from its mesh.

use nalgebra::{Point3, Vector3};
use parry3d::math::Vector;
use parry3d::query::PointQuery;
use parry3d::shape::{TriMesh, TypedShape};

use super::ObjectModel;
use crate::convert;
use crate::mesh::Mesh;
use crate::rng;
use crate::shape::CollisionShape;

/// Samples of each of the two surfaces.
const SAMPLES: usize = 3000;
/// Cylinders are measured as prisms of this many sides (0.05 mm off at a radius of 40 mm).
const SIDES: u32 = 64;
/// A piece's surface this close to another piece is a seam between the two, metres.
const SEAM: f64 = 5e-4;

/// Distances between the surface of a mesh and the surface of the union of its collision pieces, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CollisionError {
    /// The larger of the two mean distances: mesh to pieces, and pieces to mesh.
    pub mean_m: f64,
    /// The largest distance of any sample, either way (the sampled Hausdorff distance).
    pub max_m: f64,
}

/// Measures how well an object's collision pieces stand for its mesh; samples are the same on every call.
pub fn collision_error(model: &ObjectModel) -> CollisionError {
    between(&model.visual.mesh, &model.collision)
}

/// The distances between a mesh and collision pieces in the same frame. Infinite if either has no surface.
///
/// A mesh point inside the pieces counts with its depth in the piece where it is deepest, which is at most its distance
/// from the union's surface.
pub fn between(mesh: &Mesh, shapes: &[CollisionShape]) -> CollisionError {
    let pieces: Vec<Piece> = shapes.iter().filter_map(Piece::new).collect();
    let mesh_surface = surface(mesh);
    let mut rng = rng::stream(0, "collision error");
    let from_mesh: Vec<f64> = mesh
        .sample_surface(SAMPLES, &mut rng)
        .iter()
        .filter_map(|p| nearest(&pieces, p).map(|(distance, _)| distance.abs()))
        .collect();

    // All pieces' surfaces as one, and the piece that each triangle is of.
    let (mut union, mut owner) = (Mesh::default(), Vec::new());
    for (index, piece) in pieces.iter().enumerate() {
        let base = union.positions.len() as u32;
        union.positions.extend(piece.points.iter().map(|p| p.cast::<f32>()));
        union.triangles.extend(piece.triangles.iter().map(|t| t.map(|i| i + base)));
        owner.resize(union.triangles.len(), index);
    }
    let to_mesh: Vec<f64> = union
        .sample_surface_indexed(SAMPLES, &mut rng)
        .iter()
        .filter(|(p, triangle)| {
            let own = owner[*triangle];
            pieces.iter().enumerate().all(|(index, piece)| index == own || !piece.is_within(p, SEAM))
        })
        .filter_map(|(p, _)| {
            let at = convert::point(p);
            Some(f64::from(mesh_surface.as_ref()?.project_local_point(at, false).point.distance(at)))
        })
        .collect();
    if from_mesh.is_empty() || to_mesh.is_empty() {
        return CollisionError { mean_m: f64::INFINITY, max_m: f64::INFINITY };
    }
    let mean = |distances: &[f64]| distances.iter().sum::<f64>() / distances.len() as f64;
    CollisionError {
        mean_m: mean(&from_mesh).max(mean(&to_mesh)),
        max_m: from_mesh.iter().chain(&to_mesh).copied().fold(0.0, f64::max),
    }
}

/// Distance from the union of `pieces`, negative inside, and the index of the piece that has it; `None` without pieces.
pub(super) fn nearest(pieces: &[Piece], p: &Point3<f64>) -> Option<(f64, usize)> {
    let mut best: Option<(f64, usize)> = None;
    for (index, piece) in pieces.iter().enumerate() {
        // A piece whose planes alone are farther than the best so far cannot be nearer.
        let bound = piece.plane_distance(p);
        if best.is_some_and(|(distance, _)| bound >= distance) {
            continue;
        }
        let distance = if bound <= 0.0 { bound } else { piece.surface_distance(p) };
        if best.is_none_or(|(so_far, _)| distance < so_far) {
            best = Some((distance, index));
        }
    }
    best
}

/// One convex piece as a polyhedron in the object frame.
pub(super) struct Piece {
    points: Vec<Point3<f64>>,
    triangles: Vec<[u32; 3]>,
    /// Unit normals and offsets of planes that the piece is behind, one a facet.
    planes: Vec<(Vector3<f64>, f64)>,
    surface: TriMesh,
}

impl Piece {
    /// `None` for a hull without volume.
    pub(super) fn new(shape: &CollisionShape) -> Option<Self> {
        let (at, solid) = convert::solid(shape)?;
        let (points, triangles) = match solid.as_typed_shape() {
            TypedShape::Cuboid(cuboid) => cuboid.to_trimesh(),
            TypedShape::Cylinder(cylinder) => cylinder.to_trimesh(SIDES),
            TypedShape::Ball(ball) => ball.to_trimesh(SIDES, SIDES / 2),
            TypedShape::ConvexPolyhedron(hull) => hull.to_trimesh(),
            _ => return None,
        };
        let points: Vec<Vector> = points.into_iter().map(|p| at.transform_point(p)).collect();
        let exact: Vec<Point3<f64>> = points.iter().map(|p| Point3::from(convert::from_vector(*p))).collect();
        let planes = triangles
            .iter()
            .filter_map(|t| {
                let [a, b, c] = t.map(|i| exact[i as usize]);
                let normal = (b - a).cross(&(c - a)).try_normalize(1e-14)?;
                // Through the outermost vertex: a sliver's normal is inexact, and its plane must not cut the solid.
                let offset = exact.iter().map(|p| normal.dot(&p.coords)).fold(f64::NEG_INFINITY, f64::max);
                Some((normal, offset))
            })
            .collect();
        let surface = TriMesh::new(points, triangles.clone()).ok()?;
        Some(Self { points: exact, triangles, planes, surface })
    }

    /// The largest signed distance from a facet's plane: minus the depth inside, and outside a lower bound of the distance.
    fn plane_distance(&self, p: &Point3<f64>) -> f64 {
        self.planes
            .iter()
            .map(|(normal, offset)| normal.dot(&p.coords) - offset)
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// Distance from the surface.
    fn surface_distance(&self, p: &Point3<f64>) -> f64 {
        let at = convert::point(p);
        f64::from(self.surface.project_local_point(at, false).point.distance(at))
    }

    /// Whether the point is inside or closer than `distance`.
    fn is_within(&self, p: &Point3<f64>, distance: f64) -> bool {
        let bound = self.plane_distance(p);
        bound <= 0.0 || (bound <= distance && self.surface_distance(p) <= distance)
    }
}

/// The mesh for point queries; `None` without triangles.
fn surface(mesh: &Mesh) -> Option<TriMesh> {
    let points = mesh.positions.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
    TriMesh::new(points, mesh.triangles.clone()).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects::{ObjectLibrary, ObjectSet};
    use crate::shape::Convex;
    use nalgebra::Isometry3;
    use std::path::Path;

    fn cuboid(half: [f64; 3], center: [f64; 3]) -> CollisionShape {
        CollisionShape {
            pose: Isometry3::translation(center[0], center[1], center[2]),
            geometry: Convex::Cuboid { half: half.into() },
        }
    }

    fn mesh_of(shape: &CollisionShape) -> Mesh {
        let piece = Piece::new(shape).unwrap();
        Mesh {
            positions: piece.points.iter().map(|p| p.cast()).collect(),
            triangles: piece.triangles,
            ..Mesh::default()
        }
    }

    #[test]
    fn a_box_against_itself_whole_or_in_two_halves_is_exact() {
        let whole = cuboid([0.05; 3], [0.0; 3]);
        let mesh = mesh_of(&whole);
        let halves =
            [cuboid([0.025, 0.05, 0.05], [-0.025, 0.0, 0.0]), cuboid([0.025, 0.05, 0.05], [0.025, 0.0, 0.0])];
        for shapes in [&[whole][..], &halves] {
            let error = between(&mesh, shapes);
            assert!(error.max_m < 1e-6, "{error:?}");
        }
    }

    #[test]
    fn a_box_one_millimetre_larger_is_a_millimetre_off() {
        let mesh = mesh_of(&cuboid([0.05; 3], [0.0; 3]));
        let error = between(&mesh, &[cuboid([0.051; 3], [0.0; 3])]);
        assert!((error.mean_m - 1e-3).abs() < 2e-5, "{error:?}");
        assert!(error.max_m >= 1e-3 && error.max_m < 1e-3 * 3f64.sqrt() + 1e-6, "{error:?}");
        assert_eq!(error, between(&mesh, &[cuboid([0.051; 3], [0.0; 3])]), "same samples on every call");
        // A missing half shows from the mesh's side: the far face is 5 cm from what is left.
        let half = between(&mesh, &[cuboid([0.025, 0.05, 0.05], [-0.025, 0.0, 0.0])]);
        assert!((half.max_m - 0.05).abs() < 1e-3, "{half:?}");
        assert_eq!(between(&mesh, &[]).mean_m, f64::INFINITY);
    }

    #[test]
    fn built_in_collision_pieces_are_close_to_their_meshes() {
        let table = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/objects.toml");
        let library = ObjectLibrary::open(&table, ObjectSet::BuiltIn).unwrap();
        let mut failed = Vec::new();
        for name in library.names() {
            let model = library.load(name).unwrap();
            let error = collision_error(&model);
            let thin =
                model.size().min() < 0.025 || ["024_bowl", "025_mug", "019_pitcher_base"].contains(&name);
            println!(
                "{name:24} {:3} pieces  mean {:5.2} mm  max {:5.2} mm",
                model.collision.len(),
                error.mean_m * 1e3,
                error.max_m * 1e3
            );
            if error.mean_m > if thin { 3e-3 } else { 2e-3 } {
                failed.push(name);
            }
        }
        assert!(failed.is_empty(), "too far off: {failed:?}");
    }
}
