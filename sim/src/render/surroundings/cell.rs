//! The space that table and bin take.

use crate::scene::{Fixture, FixtureKind};
use crate::shape::Convex;

/// The space that table and bin take.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    /// Lower and upper corner of all fixtures seen from above, metres.
    pub low: [f64; 2],
    pub high: [f64; 2],
    /// The table's centre along x, metres.
    pub center_x: f64,
    /// Height of the table's top, metres.
    pub top: f64,
}

impl Cell {
    pub fn of(fixtures: &[Fixture]) -> Self {
        let mut cell =
            Self { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2], center_x: 0.0, top: 0.0 };
        for fixture in fixtures {
            let Convex::Cuboid { half } = &fixture.shape.geometry else { continue };
            let reach = fixture.shape.pose.rotation.to_rotation_matrix().matrix().abs() * half;
            let center = fixture.shape.pose.translation.vector;
            for axis in 0..2 {
                cell.low[axis] = cell.low[axis].min(center[axis] - reach[axis]);
                cell.high[axis] = cell.high[axis].max(center[axis] + reach[axis]);
            }
            if fixture.kind == FixtureKind::TableTop {
                cell.center_x = center.x;
                cell.top = center.z + half.z;
            }
        }
        if cell.low[0] > cell.high[0] {
            (cell.low, cell.high) = ([0.0; 2], [0.0; 2]);
        }
        cell
    }
}
