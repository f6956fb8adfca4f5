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
