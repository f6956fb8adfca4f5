//! Convex solids in single precision for the hot loop, and their distances.

use nalgebra::Isometry3;
use parry3d::math::{Pose, Rotation, Vector};
use parry3d::query::epa::EPA;
use parry3d::query::gjk::{self, CsoPoint, GJKResult, VoronoiSimplex};
use parry3d::shape::SupportMap;

/// Single precision copy of a transform.
pub(crate) fn pose32(iso: &Isometry3<f64>) -> Pose {
    let (t, q) = (iso.translation.vector, iso.rotation);
    Pose::from_parts(
        Vector::new(t.x as f32, t.y as f32, t.z as f32),
        Rotation::from_xyzw(q.i as f32, q.j as f32, q.k as f32, q.w as f32),
    )
}

#[derive(Debug, Clone)]
pub(crate) enum Solid {
    Cuboid(Vector),
    /// Along z.
    Cylinder {
        half_height: f32,
        radius: f32,
    },
    Ball(f32),
    Points(Vec<Vector>),
}

impl SupportMap for Solid {
    fn local_support_point(&self, dir: Vector) -> Vector {
        match self {
            Solid::Cuboid(h) => Vector::new(h.x.copysign(dir.x), h.y.copysign(dir.y), h.z.copysign(dir.z)),
            Solid::Cylinder { half_height, radius } => {
                let flat = (dir.x * dir.x + dir.y * dir.y).sqrt();
                let z = half_height.copysign(dir.z);
                if flat > 1e-12 {
                    Vector::new(dir.x / flat * radius, dir.y / flat * radius, z)
                } else {
                    Vector::new(0.0, 0.0, z)
                }
            }
            Solid::Ball(r) => dir.normalize_or_zero() * *r,
            Solid::Points(points) => {
                let mut best = points[0];
                let mut far = best.dot(dir);
                for p in &points[1..] {
                    let d = p.dot(dir);
                    if d > far {
                        far = d;
                        best = *p;
                    }
                }
                best
            }
        }
    }
}

/// Distance of a point of a solid's own frame from it, 0 inside.
pub(crate) fn distance_from_point(solid: &Solid, p: Vector) -> f32 {
    match solid {
        Solid::Cuboid(half) => (p.abs() - *half).max(Vector::ZERO).length(),
        Solid::Cylinder { half_height, radius } => {
            let flat = (p.x.hypot(p.y) - radius).max(0.0);
            flat.hypot((p.z.abs() - half_height).max(0.0))
        }
        Solid::Ball(radius) => (p.length() - radius).max(0.0),
        Solid::Points(_) => {
            let at = Pose::from_parts(p, Rotation::IDENTITY);
            distance(&at, solid, &Solid::Ball(0.0), f32::INFINITY)
        }
    }
}

/// Whether two solids are closer than `margin` (0: whether they meet), the second at `pose12` in the first's frame.
pub(crate) fn near(pose12: &Pose, a: &Solid, b: &Solid, margin: f32) -> bool {
    let mut simplex = VoronoiSimplex::new();
    let dir = pose12.translation.try_normalize().unwrap_or(Vector::X);
    simplex.reset(CsoPoint::from_shapes(pose12, a, b, dir));
    match gjk::closest_points(pose12, a, b, margin, false, &mut simplex) {
        GJKResult::NoIntersection(_) => false,
        GJKResult::Intersection => true,
        // Separate, but closer than the margin.
        GJKResult::ClosestPoints(..) | GJKResult::Proximity(_) => margin > 0.0,
    }
}

/// Distance between two solids, 0 when they meet; anything beyond `max` is reported as `max`.
pub(crate) fn distance(pose12: &Pose, a: &Solid, b: &Solid, max: f32) -> f32 {
    let mut simplex = VoronoiSimplex::new();
    let dir = pose12.translation.try_normalize().unwrap_or(Vector::X);
    simplex.reset(CsoPoint::from_shapes(pose12, a, b, dir));
    match gjk::closest_points(pose12, a, b, max, true, &mut simplex) {
        GJKResult::Intersection => 0.0,
        GJKResult::ClosestPoints(p, q, _) => (p - q).length().min(max),
        GJKResult::Proximity(_) | GJKResult::NoIntersection(_) => max,
    }
}

/// Depth of what certainly meets where the search for it gives up, metres: deep, and finite, since it is written to files.
const UNKNOWN_DEPTH: f32 = 1.0;

/// How deep two solids are in each other: the shortest way that parts them, 0 when they do not meet.
pub(crate) fn depth(pose12: &Pose, a: &Solid, b: &Solid) -> f32 {
    let mut simplex = VoronoiSimplex::new();
    let dir = pose12.translation.try_normalize().unwrap_or(Vector::X);
    simplex.reset(CsoPoint::from_shapes(pose12, a, b, dir));
    match gjk::closest_points(pose12, a, b, 0.0, true, &mut simplex) {
        GJKResult::Intersection => EPA::new()
            .closest_points(pose12, a, b, &simplex)
            .map_or(UNKNOWN_DEPTH, |(p, q, _)| (p - q).length()),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f32, y: f32, z: f32) -> Pose {
        Pose::from_parts(Vector::new(x, y, z), Rotation::IDENTITY)
    }

    #[test]
    fn distances_between_solids_are_the_closed_forms() {
        let cube = Solid::Cuboid(Vector::splat(0.1));
        let can = Solid::Cylinder { half_height: 0.2, radius: 0.05 };
        let ball = Solid::Ball(0.03);
        // The iteration in single precision stops at a relative error of 1e-3.
        let d = distance(&at(0.5, 0.0, 0.0), &cube, &can, 1.0);
        assert!((d - 0.35).abs() < 1e-4, "{d}");
        let d = distance(&at(0.0, 0.0, 0.5), &cube, &can, 1.0);
        assert!((d - 0.2).abs() < 1e-4, "{d}");
        // Corner of the cube to the ball.
        let corner = 3.0_f32.sqrt() * 0.1 - 0.03;
        assert!((distance(&at(0.2, 0.2, 0.2), &cube, &ball, 1.0) - corner).abs() < 1e-5);
        assert!(near(&at(0.5, 0.0, 0.0), &cube, &can, 0.351));
        assert!(!near(&at(0.5, 0.0, 0.0), &cube, &can, 0.349));
        assert!(near(&at(0.1499, 0.0, 0.0), &cube, &can, 0.0));
        assert!(!near(&at(0.1501, 0.0, 0.0), &cube, &can, 0.0));
    }

    #[test]
    fn depths_are_the_closed_forms() {
        let cube = Solid::Cuboid(Vector::splat(0.1));
        let can = Solid::Cylinder { half_height: 0.2, radius: 0.05 };
        let ball = Solid::Ball(0.03);
        for (pose, b, expected) in [
            (at(0.148, 0.02, 0.0), &can, 0.002),
            (at(0.0, 0.0, 0.295), &can, 0.005),
            (at(0.12, 0.0, 0.0), &ball, 0.01),
            (at(0.1501, 0.0, 0.0), &can, 0.0),
        ] {
            let d = depth(&pose, &cube, b);
            assert!((d - expected).abs() < 1e-4, "{d} for {expected}");
        }
    }
}
