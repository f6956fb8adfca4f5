//! Further solids that never move: shelves, steps, ramps, walls.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::fixture::{Fixture, FixtureKind, block, default_friction};

/// A box that stays where it is. The robot knows it, as it knows the table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Block {
    /// Its centre in the world, metres.
    pub center: [f64; 3],
    /// Extents along its own axes, metres.
    pub size: [f64; 3],
    /// Roll, pitch and yaw about the world's axes, in that order, radians.
    #[serde(default)]
    pub rpy: [f64; 3],
    /// Coulomb friction.
    #[serde(default = "default_friction")]
    pub friction: f64,
    /// Whether nothing is put down on it when a scene is laid out: the board of a shelf, under which things stand.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub overhead: bool,
}

impl Block {
    /// World from block.
    pub fn pose(&self) -> Isometry3<f64> {
        let [roll, pitch, yaw] = self.rpy;
        Isometry3::from_parts(
            Translation3::from(self.center),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        )
    }

    /// Half of its extents, metres.
    fn half(&self) -> Vector3<f64> {
        0.5 * Vector3::from(self.size)
    }

    pub(super) fn solid(&self) -> Fixture {
        block(FixtureKind::Block, self.pose(), self.half().into(), self.friction)
    }

    /// Its highest point, metres.
    pub(super) fn highest(&self) -> f64 {
        self.center[2] + (self.pose().rotation.to_rotation_matrix().matrix().abs() * self.half()).z
    }

    /// What it is to something with an outline of `radius` metres about (x, y) that comes down from above.
    fn below(&self, x: f64, y: f64, radius: f64) -> Below {
        let pose = self.pose();
        let half = self.half();
        let rotation: Rotation3<f64> = pose.rotation.to_rotation_matrix();
        // The block's extent along the vertical, and the axis that is it, if one is.
        let reach = rotation.matrix().abs() * half;
        let level = (0..3).find(|&axis| rotation.matrix()[(2, axis)].abs() > 1.0 - 1e-6);
        let top = self.highest();
        let Some(up) = level else {
            let near = (x - self.center[0]).abs() < reach.x + radius
                && (y - self.center[1]).abs() < reach.y + radius;
            return if near { Below::Uneven } else { Below::Nothing };
        };
        let mut at = pose.inverse_transform_point(&Point3::new(x, y, self.center[2])).coords;
        at[up] = 0.0;
        let beyond = (0..3).filter(|&axis| axis != up).map(|axis| at[axis].abs() - half[axis]);
        let beyond = beyond.fold(f64::NEG_INFINITY, f64::max);
        if beyond >= radius {
            Below::Nothing
        } else if beyond <= -radius {
            Below::Level(top)
        } else {
            Below::Uneven
        }
    }
}

enum Below {
    Nothing,
    /// A level surface, and its height, metres.
    Level(f64),
    /// An edge or a slope.
    Uneven,
}

/// Height of the level ground on which something with an outline of `radius` metres about (x, y) can stand: the highest block
/// there, else `table`; `None` where it would stand on an edge or a slope.
pub(super) fn ground(blocks: &[Block], table: f64, x: f64, y: f64, radius: f64) -> Option<f64> {
    blocks.iter().filter(|block| !block.overhead).try_fold(table, |highest, block| {
        match block.below(x, y, radius) {
            Below::Nothing => Some(highest),
            Below::Level(top) => Some(highest.max(top)),
            Below::Uneven => None,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn things_stand_on_the_table_or_on_a_block_but_not_on_an_edge_or_a_slope() {
        let step = Block {
            center: [0.6, 0.2, 0.75],
            size: [0.2, 0.4, 0.1],
            rpy: [0.0; 3],
            friction: 0.6,
            overhead: false,
        };
        // On its side and turned by a quarter: 0.4 along x, 0.2 high.
        let turned = Block {
            center: [0.6, -0.4, 0.8],
            rpy: [1.5 * std::f64::consts::PI, 0.0, 0.0],
            size: [0.4, 0.2, 0.1],
            ..step.clone()
        };
        let ramp = Block { center: [0.9, 0.2, 0.75], rpy: [0.0, 0.2, 0.0], ..step.clone() };
        let board = Block { center: [0.9, -0.3, 1.0], overhead: true, ..step.clone() };
        let blocks = [step, turned, ramp, board];
        let ground = |x: f64, y: f64| ground(&blocks, 0.7, x, y, 0.03);
        assert!((ground(0.6, 0.3).unwrap() - 0.8).abs() < 1e-9);
        assert_eq!(ground(0.6, 0.39), None);
        assert_eq!(ground(0.6, -0.1), Some(0.7));
        assert!((ground(0.7, -0.4).unwrap() - 0.9).abs() < 1e-9);
        assert_eq!(ground(0.9, -0.3), Some(0.7));
        assert_eq!(ground(0.9, 0.2), None);
        assert_eq!(ground(1.2, 0.2), Some(0.7));
    }
}
