//! The space that table and bin take.

use crate::scene::{Fixture, FixtureKind};

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
            let corners = fixture.shape.corners();
            for (axis, corner) in corners.iter().flat_map(|corner| [(0, corner), (1, corner)]) {
                cell.low[axis] = cell.low[axis].min(corner[axis]);
                cell.high[axis] = cell.high[axis].max(corner[axis]);
            }
            if fixture.kind == FixtureKind::TableTop {
                cell.center_x = fixture.shape.pose.translation.x;
                cell.top = corners.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
            }
        }
        if cell.low[0] > cell.high[0] {
            (cell.low, cell.high) = ([0.0; 2], [0.0; 2]);
        }
        cell
    }
}
