//! Convex collision shapes as plain data, so that physics (rapier) and planning (parry) build the same geometry.

use nalgebra::{Isometry3, Point3, Vector3};
use serde::{Deserialize, Serialize};

/// A convex solid in some parent frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CollisionShape {
    /// Parent frame from shape frame.
    pub pose: Isometry3<f64>,
    /// The solid in its own frame.
    pub geometry: Convex,
}

/// A convex solid about its own origin, metres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Convex {
    /// A box by its half extents.
    Cuboid {
        /// Half extents along x, y, z.
        half: Vector3<f64>,
    },
    /// A cylinder along z.
    Cylinder {
        /// Half of its height.
        half_height: f64,
        /// Radius.
        radius: f64,
    },
    /// A ball.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// The convex hull of these points (at least four, not in one plane).
    Hull {
        /// Points of the hull.
        points: Vec<Point3<f64>>,
    },
}

impl Convex {
    /// Lower and upper corner of the box about the solid in its own frame, metres.
    pub fn bounds(&self) -> [Point3<f64>; 2] {
        let around = |half: Vector3<f64>| [Point3::from(-half), Point3::from(half)];
        match self {
            Self::Cuboid { half } => around(*half),
            Self::Sphere { radius } => around(Vector3::repeat(*radius)),
            Self::Cylinder { half_height, radius } => around(Vector3::new(*radius, *radius, *half_height)),
            Self::Hull { points } => points.iter().fold(
                [
                    Point3::from(Vector3::repeat(f64::INFINITY)),
                    Point3::from(Vector3::repeat(f64::NEG_INFINITY)),
                ],
                |[low, high], p| [low.inf(p), high.sup(p)],
            ),
        }
    }
}

impl CollisionShape {
    /// In the parent frame, the points of a hull, or the corners of the box about any other solid.
    pub fn corners(&self) -> Vec<Point3<f64>> {
        let local = match &self.geometry {
            Convex::Hull { points } => points.clone(),
            other => {
                let ends = other.bounds();
                (0..8).map(|i| Point3::from([0, 1, 2].map(|a| ends[i >> a & 1][a]))).collect()
            }
        };
        local.iter().map(|p| self.pose * p).collect()
    }
}
