//! A convex solid fixed to a link or an obstacle, with an oriented box and balls for culling.

use grip_sim::lanes::V8;
use grip_sim::shape::{CollisionShape, Convex};
use nalgebra::Isometry3;
use parry3d::math::{Pose, Vector};
use parry3d::shape::SupportMap;

use super::cover::{Ball, cover};
use super::solid::{Solid, pose32};

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
        let (cover, ball) = row_of_balls(center, half);
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
        let balls = cover(&self.solid, error, most);
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
fn row_of_balls(center: Vector, half: Vector) -> (Vec<Vector>, f32) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};

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
