//! Things behind and beside the table that have nothing to do with the task: boxes, cylinders and boards on the floor,
//! and now and then a shelf on the wall.
//!
//! None can stand between the camera and what is on the table, as long as the camera is nearer than the table's centre
//! along x and higher than the table's top: behind the table all is farther away than its far edge, and beside it all is
//! lower than its top.

use std::sync::Arc;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::cell::Cell;
use super::look::{Look, Odds};
use crate::mesh::Visual;
use crate::render::textures::Family::*;

/// What they are made of.
const ODDS: &Odds = &[
    (Plain, 14),
    (Plastic, 16),
    (Cardboard, 14),
    (Clutter, 12),
    (Print, 10),
    (Wood, 10),
    (Cloth, 8),
    (Metal, 6),
    (Checker, 4),
    (Stone, 3),
    (Tiles, 3),
];
/// They are seen from afar.
const SIDE_PX: u32 = 128;
/// Free floor between the cell and what stands behind it, metres.
const BEHIND_M: f64 = 0.15;
/// Free floor at the cell's sides, where the robot's elbow may go, metres.
const BESIDE_M: f64 = 0.30;
/// What stands behind the table at distance d rises at most this much above its top, in d: light that falls more steeply
/// reaches the table.
const RISE: f64 = 1.5;
/// How far to the sides things stand, metres.
const SIDEWAYS_M: f64 = 1.2;

type Drawn = (Isometry3<f64>, Arc<Visual>);

/// Between three and nine of them, and perhaps a shelf. The wall's face stands at `wall_x`.
pub(super) fn draw(cell: &Cell, wall_x: f64, rng: &mut ChaCha8Rng) -> Vec<Drawn> {
    let mut drawn = Vec::new();
    // Circles about what stands already: middle and radius.
    let mut taken: Vec<([f64; 2], f64)> = Vec::new();
    for _ in 0..rng.random_range(3..=9) {
        let thing = Thing::draw(rng);
        let reach = thing.reach();
        // A few tries for a free place; without one, the thing is left out.
        for _ in 0..6 {
            let (at, highest) = if rng.random_bool(0.7) {
                behind(cell, wall_x, reach, rng)
            } else {
                beside(cell, wall_x, reach, rng)
            };
            let free = |(other, radius): &([f64; 2], f64)| {
                (at[0] - other[0]).hypot(at[1] - other[1]) > reach + radius
            };
            if at[0] + reach < wall_x - 0.02 && taken.iter().all(free) {
                taken.push((at, reach));
                drawn.push(thing.stand(at, 0.0, highest, rng));
                break;
            }
        }
    }
    if rng.random_bool(0.35) {
        shelf(cell, wall_x, &mut drawn, rng);
    }
    drawn
}

/// A place behind the table, and how high things may be there.
fn behind(cell: &Cell, wall_x: f64, reach: f64, rng: &mut ChaCha8Rng) -> ([f64; 2], f64) {
    let nearest = cell.high[0] + BEHIND_M + reach;
    let x = nearest + rng.random_range(0.0..1.0) * (wall_x - reach - nearest - 0.02).max(0.0);
    let y = rng.random_range(cell.low[1] - SIDEWAYS_M..cell.high[1] + SIDEWAYS_M);
    ([x, y], cell.top + RISE * (x - reach - cell.high[0]))
}

/// A place beside the far half of the table, and how high things may be there.
fn beside(cell: &Cell, wall_x: f64, reach: f64, rng: &mut ChaCha8Rng) -> ([f64; 2], f64) {
    let x =
        cell.center_x + reach + rng.random_range(0.0..1.0) * (wall_x - cell.center_x - 2.0 * reach).max(0.0);
    let out = BESIDE_M + reach + rng.random_range(0.0..1.0_f64).powi(2) * SIDEWAYS_M;
    let y = if rng.random() { cell.high[1] + out } else { cell.low[1] - out };
    ([x, y], cell.top)
}

/// A board on the wall with things on it.
fn shelf(cell: &Cell, wall_x: f64, drawn: &mut Vec<Drawn>, rng: &mut ChaCha8Rng) {
    let half = Vector3::new(0.15, rng.random_range(0.4..1.2), 0.012);
    let z = rng.random_range(0.5..1.3);
    let y = rng.random_range(cell.low[1] - 0.3..cell.high[1] + 0.3);
    let x = wall_x - 0.01 - half.x;
    let board = Look::drawn(&[(Wood, 50), (Plain, 30), (Metal, 20)], 0.6..1.4, SIDE_PX, rng).cuboid(half);
    drawn.push((Isometry3::translation(x, y, z), board));
    let mut along = y - half.y + 0.02;
    for _ in 0..6 {
        let thing = Thing::draw(rng).shrunk(0.14);
        let reach = thing.reach();
        along += reach + rng.random_range(0.0..0.15);
        if along + reach > y + half.y {
            break;
        }
        drawn.push(thing.stand([x, along], z + half.z, z + half.z + 0.4, rng));
        along += reach;
    }
}

/// A solid, upright on its ground.
#[derive(Debug, Clone, Copy)]
enum Thing {
    /// Half extents, metres.
    Box(Vector3<f64>),
    /// Radius and half height, metres.
    Cylinder(f64, f64),
}

impl Thing {
    fn draw(rng: &mut ChaCha8Rng) -> Self {
        let mut between = |low: f64, high: f64| rng.random_range(low..high);
        let kind = between(0.0, 1.0);
        if kind < 0.45 {
            Self::Box(Vector3::new(between(0.05, 0.25), between(0.05, 0.30), between(0.08, 0.45)))
        } else if kind < 0.75 {
            Self::Cylinder(between(0.04, 0.22), between(0.08, 0.50))
        } else {
            // A board on its edge.
            Self::Box(Vector3::new(between(0.008, 0.02), between(0.15, 0.45), between(0.2, 0.7)))
        }
    }

    /// Radius of the circle about its ground plan, metres.
    fn reach(self) -> f64 {
        match self {
            Self::Box(half) => half.x.hypot(half.y),
            Self::Cylinder(radius, _) => radius,
        }
    }

    /// So small that its ground plan has at most this reach.
    fn shrunk(self, reach: f64) -> Self {
        let factor = (reach / self.reach()).min(1.0);
        match self {
            Self::Box(half) => Self::Box(half * factor),
            Self::Cylinder(radius, half) => Self::Cylinder(radius * factor, half * factor),
        }
    }

    /// Stands it, turned at random, on `ground`, cut off at `highest`.
    fn stand(self, at: [f64; 2], ground: f64, highest: f64, rng: &mut ChaCha8Rng) -> Drawn {
        let look = Look::drawn(ODDS, 0.3..1.0, SIDE_PX, rng);
        let tallest = (0.5 * (highest - ground)).max(0.01);
        let (half, visual) = match self {
            Self::Box(half) => {
                let half = Vector3::new(half.x, half.y, half.z.min(tallest));
                (half.z, look.cuboid(half))
            }
            Self::Cylinder(radius, half) => {
                let half = half.min(tallest);
                (half, look.cylinder(radius, half))
            }
        };
        let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, rng.random_range(-3.1..3.1));
        let place = Translation3::new(at[0], at[1], ground + half);
        (Isometry3::from_parts(place, turn), visual)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng;

    #[test]
    fn nothing_can_stand_between_camera_and_table() {
        let cell = Cell { low: [0.34, -0.65], high: [0.94, 0.55], center_x: 0.64, top: 0.65 };
        let mut count = 0;
        for seed in 0..60 {
            let wall_x = 1.9 + 0.04 * seed as f64;
            for (pose, visual) in draw(&cell, wall_x, &mut rng::stream(seed, "t")) {
                count += 1;
                let corners = visual.mesh.positions.iter().map(|p| pose * p.cast::<f64>());
                let (mut low, mut high) =
                    (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
                for corner in corners {
                    low = low.inf(&corner.coords);
                    high = high.sup(&corner.coords);
                }
                let is_behind = low.x > cell.high[0] + 0.1;
                let is_low = high.z <= cell.top + 1e-5 && low.x >= cell.center_x - 1e-5;
                let is_beside = low.y > cell.high[1] + 0.2 || high.y < cell.low[1] - 0.2;
                assert!(is_behind || (is_beside && is_low), "{seed}: {low} {high}");
                assert!(high.x < wall_x && low.z > -1e-5, "{seed}: {low} {high}");
            }
        }
        assert!(count > 200, "{count}");
    }
}
