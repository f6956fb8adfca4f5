//! The table.

use nalgebra::Isometry3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::fixture::{Fixture, FixtureKind, block, default_friction};

/// A rectangular table, sides along the world axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// Centre of the top, metres.
    pub center: [f64; 2],
    /// Extents along x and y, metres.
    pub size: [f64; 2],
    /// Height of the top above the floor, metres.
    pub height: f64,
    /// Thickness of the top, metres.
    #[serde(default = "default_thickness")]
    pub thickness: f64,
    /// Coulomb friction.
    #[serde(default = "default_friction")]
    pub friction: f64,
}

fn default_thickness() -> f64 {
    0.04
}

impl Table {
    /// Lower corner of the top, metres.
    pub fn low(&self) -> [f64; 2] {
        [self.center[0] - self.size[0] / 2.0, self.center[1] - self.size[1] / 2.0]
    }

    /// Upper corner of the top, metres.
    pub fn high(&self) -> [f64; 2] {
        [self.center[0] + self.size[0] / 2.0, self.center[1] + self.size[1] / 2.0]
    }

    /// Whether (x, y) is over the table's top.
    pub fn holds(&self, x: f64, y: f64) -> bool {
        let ([x0, y0], [x1, y1]) = (self.low(), self.high());
        (x0..=x1).contains(&x) && (y0..=y1).contains(&y)
    }

    pub(super) fn solids(&self) -> Vec<Fixture> {
        const LEG: f64 = 0.03;
        let [x, y] = self.center;
        let top = block(
            FixtureKind::TableTop,
            Isometry3::translation(x, y, self.height - self.thickness / 2.0),
            [self.size[0] / 2.0, self.size[1] / 2.0, self.thickness / 2.0],
            self.friction,
        );
        let leg_half = (self.height - self.thickness) / 2.0;
        let mut solids = vec![top];
        for (sx, sy) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            let at = Isometry3::translation(
                x + sx * (self.size[0] / 2.0 - 2.0 * LEG),
                y + sy * (self.size[1] / 2.0 - 2.0 * LEG),
                leg_half,
            );
            solids.push(block(FixtureKind::TableLeg, at, [LEG, LEG, leg_half], self.friction));
        }
        solids
    }
}
