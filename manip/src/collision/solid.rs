//! Convex solids in single precision for the hot loop, each with an oriented box and a row of balls for culling.

use grip_sim::lanes::V8;
use grip_sim::shape::{CollisionShape, Convex};
use nalgebra::Isometry3;
use parry3d::math::{Pose, Rotation, Vector};
use parry3d::query::epa::EPA;
use parry3d::query::gjk::{self, CsoPoint, GJKResult, VoronoiSimplex};
use parry3d::shape::SupportMap;

use super::cover::Ball;

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

/// A frame in another: its origin and its axes, for eight points at once.
#[derive(Debug, Clone)]
pub(crate) struct Frame {
    translation: [f32; 3],
    axes: [[f32; 3]; 3],
}

impl Frame {
    pub fn of(pose: &Pose) -> Self {
        let axes = [Vector::X, Vector::Y, Vector::Z].map(|axis| (pose.rotation * axis).to_array());
        Self { translation: pose.translation.to_array(), axes }
    }

    /// Points of the outer frame in this one.
    #[inline(always)]
    pub fn inverse_point(&self, p: V8) -> V8 {
        let d = p - V8::all(self.translation);
        let [x, y, z] = self.axes;
        V8 { x: d.dot(V8::all(x)), y: d.dot(V8::all(y)), z: d.dot(V8::all(z)) }
    }
}

/// A convex solid fixed to an owner: a link, the held object, or the base frame.
#[derive(Debug, Clone)]
pub(crate) struct Piece {
    pub solid: Solid,
    /// Owner from solid.
    pub pose: Pose,
    /// Centre and half extents of the bounding box in the solid's frame.
    pub center: Vector,
    pub half: Vector,
    /// Balls of radius `ball` about these points of the owner's frame cover the solid.
    pub cover: Vec<Vector>,
    pub ball: f32,
    /// Balls of the owner's frame that cover the solid closely, for pieces that move.
    pub balls: Vec<Ball>,
    /// The solid's frame in the owner's.
    pub frame: Frame,
}

/// At most so many covering balls a piece.
const MAX_COVER: usize = 8;

impl Piece {
    /// The piece of `shape` in an owner's frame that lies at `owner_from_parent`.
    pub fn new(shape: &CollisionShape, owner_from_parent: &Isometry3<f64>) -> Self {
        let solid = match &shape.geometry {
            Convex::Cuboid { half } => {
                Solid::Cuboid(Vector::new(half.x as f32, half.y as f32, half.z as f32))
            }
            Convex::Cylinder { half_height, radius } => {
                Solid::Cylinder { half_height: *half_height as f32, radius: *radius as f32 }
            }
            Convex::Sphere { radius } => Solid::Ball(*radius as f32),
            Convex::Hull { points } if points.is_empty() => Solid::Ball(0.0),
            Convex::Hull { points } => Solid::Points(
                points.iter().map(|p| Vector::new(p.x as f32, p.y as f32, p.z as f32)).collect(),
            ),
        };
        let pose = pose32(&(owner_from_parent * shape.pose));
        let high = Vector::new(
            solid.local_support_point(Vector::X).x,
            solid.local_support_point(Vector::Y).y,
            solid.local_support_point(Vector::Z).z,
        );
        let low = Vector::new(
            solid.local_support_point(-Vector::X).x,
            solid.local_support_point(-Vector::Y).y,
            solid.local_support_point(-Vector::Z).z,
        );
        let (center, half) = ((high + low) * 0.5, (high - low) * 0.5);
        let (cover, ball) = cover(center, half);
        Self {
            solid,
            center,
            half,
            cover: cover.into_iter().map(|c| pose * c).collect(),
            ball,
            balls: Vec::new(),
            frame: Frame::of(&pose),
            pose,
        }
    }

    /// With the balls of its row as those that cover it.
    pub fn with_row_of_balls(mut self) -> Self {
        self.balls = self.cover.iter().map(|&center| Ball { center, radius: self.ball }).collect();
        self
    }

    /// With at most `most` balls that cover it and stick out at most `error` metres where that many can.
    pub fn with_balls(mut self, error: f32, most: usize) -> Self {
        let balls = super::cover::cover(&self.solid, error, most);
        self.balls = balls.iter().map(|b| Ball { center: self.pose * b.center, radius: b.radius }).collect();
        self
    }

    /// The squared distance of a point of the owner's frame from the bounding box.
    pub fn box_distance_squared(&self, point: Vector) -> f32 {
        let local = self.pose.inverse_transform_point(point) - self.center;
        let out = (local.abs() - self.half).max(Vector::ZERO);
        out.length_squared()
    }

    /// The eight corners of the bounding box in the owner's frame.
    pub fn corners(&self) -> impl Iterator<Item = Vector> + '_ {
        (0..8).map(move |i| {
            let sign = |bit: usize| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
            self.pose * (self.center + self.half * Vector::new(sign(0), sign(1), sign(2)))
        })
    }
}

/// Balls along the longest axis of a box that cover it.
fn cover(center: Vector, half: Vector) -> (Vec<Vector>, f32) {
    let axis = if half.x >= half.y && half.x >= half.z {
        Vector::X
    } else if half.y >= half.z {
        Vector::Y
    } else {
        Vector::Z
    };
    let long = half.dot(axis);
    let across = (half.length_squared() - long * long).max(0.0).sqrt();
    let n = ((long / across.max(1e-3)).ceil() as usize).clamp(1, MAX_COVER);
    let slab = long / n as f32;
    let balls = (0..n).map(|i| center + axis * (slab * (2.0 * i as f32 + 1.0) - long)).collect();
    (balls, (slab * slab + across * across).sqrt())
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
    use nalgebra::{Point3, Vector3};

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

    #[test]
    fn balls_cover_the_solid_and_the_box_bounds_it() {
        let hull: Vec<Point3<f64>> = (0..40)
            .map(|i| {
                let a = f64::from(i);
                Point3::new(0.3 * a.sin(), 0.05 * a.cos(), 0.02 * (2.3 * a).sin())
            })
            .collect();
        let shape = CollisionShape {
            pose: Isometry3::new(Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.3, 0.5, -0.2)),
            geometry: Convex::Hull { points: hull.clone() },
        };
        let piece = Piece::new(&shape, &Isometry3::identity());
        assert!(piece.cover.len() > 2);
        for p in &hull {
            let q = pose32(&shape.pose) * Vector::new(p.x as f32, p.y as f32, p.z as f32);
            assert!(piece.box_distance_squared(q) < 1e-9);
            assert!(piece.cover.iter().any(|c| (*c - q).length() <= piece.ball + 1e-5));
        }
    }
}
