//! V-HACD, mended: hulls that cover the surface, by few points each.

use nalgebra::{Isometry3, Point3, Vector3};
use parry3d::math::Vector;
use parry3d::transformation::try_convex_hull;
use parry3d::transformation::vhacd::{VHACD, VHACDParameters};

use crate::convert;
use crate::mesh::Mesh;
use crate::objects::collision_error::{self, Piece};
use crate::rng;
use crate::shape::{CollisionShape, Convex};

/// Everything below that shapes the result, for the cache's key.
pub(super) const PARAMETERS: &str = "resolution 64, concavity 0.004/0.003, points 32, gap 0.5 mm";

/// Most points of a hull.
const MAX_POINTS: usize = 32;
/// A hull's points stop being added when all others are this close to it, metres.
const POINT_GAP: f64 = 2e-4;
/// Surface points farther than this from every hull are added to the nearest one, metres.
const COVER_GAP: f64 = 5e-4;
/// Surface samples that must be covered.
const COVER_SAMPLES: usize = 4000;
/// A solid that fills less than this part of its hull has thin walls or arms, and is cut more finely.
const THIN: f64 = 0.35;

/// Hulls that together stand for the solid inside `mesh`.
pub(super) fn decompose(mesh: &Mesh) -> Result<Vec<CollisionShape>, String> {
    let points: Vec<Vector> = mesh.positions.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
    let (low, high) = mesh.bounds().ok_or("has no vertices")?;
    if (high - low).min() < 1e-4 {
        return Err("is flat: a collision mesh must enclose a volume".into());
    }
    let (hull, facets) = try_convex_hull(&points).map_err(|error| format!("has no convex hull: {error}"))?;
    let hull_volume = Mesh {
        positions: hull.iter().map(|p| Point3::new(p.x, p.y, p.z)).collect(),
        triangles: facets,
        ..Mesh::default()
    }
    .volume();
    let thin = mesh.volume() < THIN * hull_volume;
    // The number of hulls stays open: parry turns a limit into a depth of cuts, and a mug's cavity stays filled at depth 6.
    let concavity = if thin { 0.003 } else { 0.004 };
    let parameters = VHACDParameters { resolution: 64, concavity, ..VHACDParameters::default() };
    let parts = VHACD::decompose(&parameters, &points, &mesh.triangles, true)
        .compute_exact_convex_hulls(&points, &mesh.triangles);
    let mut parts: Vec<Vec<Vector>> = parts.into_iter().map(|(points, _)| points).collect();
    cover(mesh, &mut parts);
    let shapes: Vec<CollisionShape> = parts.iter().filter_map(|part| few_points(part)).map(shape).collect();
    if shapes.is_empty() {
        return Ok(few_points(&hull).map(shape).into_iter().collect());
    }
    Ok(shapes)
}

fn shape(points: Vec<Point3<f64>>) -> CollisionShape {
    CollisionShape { pose: Isometry3::identity(), geometry: Convex::Hull { points } }
}

/// Adds the surface points that V-HACD left outside of all hulls to the nearest hull.
fn cover(mesh: &Mesh, parts: &mut [Vec<Vector>]) {
    // The pieces with the part that each is of; slivers are no pieces.
    let (pieces, part_of): (Vec<Piece>, Vec<usize>) = parts
        .iter()
        .enumerate()
        .filter_map(|(index, part)| Some((Piece::new(&shape(few_points(part)?))?, index)))
        .unzip();
    for point in mesh.sample_surface(COVER_SAMPLES, &mut rng::stream(0, "hull cover")) {
        if let Some((distance, piece)) = collision_error::nearest(&pieces, &point)
            && distance > COVER_GAP
        {
            parts[part_of[piece]].push(convert::point(&point));
        }
    }
}

/// At most [`MAX_POINTS`] of the points whose hull comes close to the hull of all: starting from extremes, always the
/// point farthest outside is added. `None` if the points have no volume.
fn few_points(points: &[Vector]) -> Option<Vec<Point3<f64>>> {
    let (corners, _) = try_convex_hull(points).ok()?;
    let exact =
        |points: &[Vector]| points.iter().map(|p| Point3::from(convert::from_vector(*p))).collect::<Vec<_>>();
    if corners.len() <= 8 {
        return is_solid(&corners).then(|| exact(&corners));
    }
    // Extremes along the axes and the diagonals.
    let mut kept: Vec<usize> = (0i8..27)
        .map(|i| Vector::new(f32::from(i % 3 - 1), f32::from(i / 3 % 3 - 1), f32::from(i / 9 - 1)))
        .filter(|direction| matches!(direction.length_squared(), 1.0 | 3.0))
        .filter_map(|direction| {
            (0..corners.len())
                .max_by(|&a, &b| corners[a].dot(direction).total_cmp(&corners[b].dot(direction)))
        })
        .collect();
    kept.sort_unstable();
    kept.dedup();
    loop {
        let chosen: Vec<Vector> = kept.iter().map(|&index| corners[index]).collect();
        let farthest = planes(&chosen).map(|planes| {
            let outside = |p: &Vector| {
                let p = convert::from_vector(*p);
                planes
                    .iter()
                    .map(|(normal, offset)| normal.dot(&p) - offset)
                    .fold(f64::NEG_INFINITY, f64::max)
            };
            (0..corners.len())
                .filter(|index| !kept.contains(index))
                .map(|index| (outside(&corners[index]), index))
                .max_by(|a, b| a.0.total_cmp(&b.0))
        });
        match farthest {
            Some(Some((gap, index))) if gap > POINT_GAP && kept.len() < MAX_POINTS => kept.push(index),
            Some(_) => return is_solid(&chosen).then(|| exact(&chosen)),
            // No hull of so few: go on with whatever point is left.
            None => match (0..corners.len()).find(|index| !kept.contains(index)) {
                Some(index) if kept.len() < MAX_POINTS => kept.push(index),
                _ => return None,
            },
        }
    }
}

/// Outward unit normals and offsets of the facets of the points' hull.
fn planes(points: &[Vector]) -> Option<Vec<(Vector3<f64>, f64)>> {
    let (points, facets) = try_convex_hull(points).ok()?;
    let planes = facets.iter().filter_map(|facet| {
        let [a, b, c] = facet.map(|i| convert::from_vector(points[i as usize]));
        let normal = (b - a).cross(&(c - a)).try_normalize(1e-14)?;
        Some((normal, normal.dot(&a)))
    });
    Some(planes.collect())
}

/// Slivers thinner than 0.1 mm are no solids to a physics engine.
fn is_solid(points: &[Vector]) -> bool {
    planes(points).is_some_and(|planes| {
        planes.len() >= 4
            && planes.iter().all(|(normal, offset)| {
                points.iter().any(|p| offset - normal.dot(&convert::from_vector(*p)) > 1e-4)
            })
    })
}
