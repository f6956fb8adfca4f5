//! What the robot knows of its cell before it looks.

use nalgebra::Point3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The part of the world that holds the objects, an axis-aligned box in the world frame, metres: what the robot knows
/// of its cell (its table, not what is on it).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Workspace {
    /// Lower corner.
    pub min: [f64; 3],
    /// Upper corner.
    pub max: [f64; 3],
}

impl Workspace {
    /// Whether a point of the world is inside.
    pub fn contains(&self, point: &Point3<f64>) -> bool {
        (0..3).all(|i| point[i] >= self.min[i] && point[i] <= self.max[i])
    }
}
