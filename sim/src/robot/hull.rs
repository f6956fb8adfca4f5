//! Convex hulls of collision meshes, with few points.

use nalgebra::{Point3, Vector3};
use parry3d::math::Vector;
use parry3d::transformation::try_convex_hull;

/// Most points of a hull. Collision queries cost about linearly in them; 64 keep a 0.5 m body within a few millimetres.
const MAX_POINTS: usize = 64;
/// A hull thinner than this is not a solid, metres.
const MIN_THICKNESS: f64 = 1e-5;

/// The convex hull of `points` by at most [`MAX_POINTS`] of them.
pub(super) fn convex_hull(points: &[Point3<f32>]) -> Result<Vec<Point3<f64>>, String> {
    let flat = "is flat or a single point: a collision mesh must enclose a volume".to_string();
    let input: Vec<Vector> = points.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
    if thickness(points) < MIN_THICKNESS {
        return Err(flat);
    }
    let (hull, _) = try_convex_hull(&input).map_err(|error| format!("has no convex hull: {error}"))?;
    let hull: Vec<Point3<f64>> =
        hull.iter().map(|p| Point3::new(f64::from(p.x), f64::from(p.y), f64::from(p.z))).collect();
    if hull.len() <= MAX_POINTS {
        return Ok(hull);
    }
    let mut kept: Vec<usize> = directions(MAX_POINTS).map(|direction| support(&hull, &direction)).collect();
    kept.sort_unstable();
    kept.dedup();
    Ok(kept.into_iter().map(|index| hull[index]).collect())
}

/// Smallest extent of the points over a spread of directions; 0 for fewer than four points.
fn thickness(points: &[Point3<f32>]) -> f64 {
    if points.len() < 4 {
        return 0.0;
    }
    // Normal of the largest triangle through three far points; then the farthest point from its plane.
    let at = |i: usize| points[i].cast::<f64>();
    let far = |score: &dyn Fn(&Point3<f64>) -> f64| {
        (0..points.len())
            .max_by(|&a, &b| score(&at(a)).total_cmp(&score(&at(b))))
            .map_or_else(Point3::origin, at)
    };
    let a = at(0);
    let b = far(&|p| (p - a).norm());
    let c = far(&|p| (b - a).cross(&(p - a)).norm());
    let normal = (b - a).cross(&(c - a));
    if normal.norm() <= 0.0 {
        return 0.0;
    }
    let normal = normal.normalize();
    let d = far(&|p| normal.dot(&(p - a)).abs());
    normal.dot(&(d - a)).abs()
}

fn support(points: &[Point3<f64>], direction: &Vector3<f64>) -> usize {
    (0..points.len())
        .max_by(|&a, &b| direction.dot(&points[a].coords).total_cmp(&direction.dot(&points[b].coords)))
        .unwrap_or(0)
}

/// Directions spread evenly over the sphere (golden spiral).
fn directions(count: usize) -> impl Iterator<Item = Vector3<f64>> {
    let golden_angle = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..count).map(move |i| {
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
        let radius = (1.0 - z * z).sqrt();
        let angle = golden_angle * i as f64;
        Vector3::new(radius * angle.cos(), radius * angle.sin(), z)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fine_sphere_keeps_64_points_and_its_size() {
        let sphere: Vec<Point3<f32>> =
            directions(2000).map(|d| Point3::from((0.3 * d).cast::<f32>())).collect();
        let hull = convex_hull(&sphere).unwrap();
        assert!(hull.len() <= MAX_POINTS && hull.len() > 50, "{}", hull.len());
        assert!(hull.iter().all(|p| (p.coords.norm() - 0.3).abs() < 1e-6));
    }

    #[test]
    fn flat_or_tiny_point_sets_are_refused() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.2]]
            .map(|[x, y]: [f32; 2]| Point3::new(x, y, 0.5 * x + y));
        assert!(convex_hull(&square).unwrap_err().contains("flat"));
        assert!(convex_hull(&[Point3::origin(); 10]).is_err());
        assert!(convex_hull(&[]).is_err());
    }
}
