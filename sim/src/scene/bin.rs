//! The bin that is packed, and the solids that it is built of.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::fixture::{BinKind, Fixture, FixtureKind, block, default_friction};
use crate::shape::Convex;

/// How far the walls of a tote lean outwards, radians: 8 degrees.
const TOTE_LEAN: f64 = 0.14;
/// Height of a crate's slats and of the gaps between them, metres: no can fits through.
const SLAT: [f64; 2] = [0.036, 0.018];

/// An open bin with a floor and four walls.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bin {
    /// `carton`, the default, `crate`, `tote` or `bag`.
    #[serde(default)]
    pub kind: BinKind,
    /// Centre of the floor, metres.
    pub center: [f64; 2],
    /// Height of what the bin stands on, metres: the table's height, or lower beside it.
    pub base_height: f64,
    /// Heading, radians.
    #[serde(default)]
    pub yaw: f64,
    /// Inner extents of its floor along its own x and y, metres.
    pub inner: [f64; 2],
    /// Height of the walls above the bin's floor, metres.
    pub wall_height: f64,
    /// Thickness of walls and floor, metres.
    pub wall_thickness: f64,
    /// Coulomb friction.
    #[serde(default = "default_friction")]
    pub friction: f64,
}

impl Bin {
    /// World from the bin's frame: centre of the upper side of its floor, z up.
    pub fn world_from_bin(&self) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::new(self.center[0], self.center[1], self.base_height + self.wall_thickness),
            UnitQuaternion::from_euler_angles(0.0, 0.0, self.yaw),
        )
    }

    /// Whether a world point is inside the bin: between its walls and below `margin` above their upper edge.
    pub fn contains(&self, point: &Point3<f64>, margin: f64) -> bool {
        let p = self.world_from_bin().inverse_transform_point(point);
        let wider = self.lean().tan() * p.z.clamp(0.0, self.wall_height);
        p.x.abs() <= self.inner[0] / 2.0 + wider
            && p.y.abs() <= self.inner[1] / 2.0 + wider
            && (-0.005..=self.wall_height + margin).contains(&p.z)
    }

    /// The bin's outline seen from above, walls included, as lower and upper corner of its bounding rectangle, metres.
    pub fn outline(&self) -> ([f64; 2], [f64; 2]) {
        let (sin, cos) = self.yaw.sin_cos();
        let half = self.inner.map(|v| v / 2.0 + self.wall_reach());
        let reach = [half[0] * cos.abs() + half[1] * sin.abs(), half[0] * sin.abs() + half[1] * cos.abs()];
        ([0, 1].map(|a| self.center[a] - reach[a]), [0, 1].map(|a| self.center[a] + reach[a]))
    }

    /// Distance of (x, y) from the bin's outline seen from above, metres; 0 inside.
    pub fn distance(&self, x: f64, y: f64) -> f64 {
        let p = self.world_from_bin().inverse_transform_point(&Point3::new(x, y, 0.0));
        let over = |v: f64, inner: f64| (v.abs() - inner / 2.0 - self.wall_reach()).max(0.0);
        over(p.x, self.inner[0]).hypot(over(p.y, self.inner[1]))
    }

    /// How far the walls lean outwards, radians.
    fn lean(&self) -> f64 {
        if self.kind == BinKind::Tote { TOTE_LEAN } else { 0.0 }
    }

    /// How far the walls reach beyond the inner floor, seen from above, metres.
    fn wall_reach(&self) -> f64 {
        self.wall_thickness / self.lean().cos() + self.wall_height * self.lean().tan()
    }

    /// Lower and upper edge of each board of a wall above the floor, metres: one, or a crate's slats.
    fn boards(&self) -> Vec<[f64; 2]> {
        let [slat, gap] = SLAT;
        let n = ((self.wall_height + gap) / (slat + gap)).round();
        if self.kind != BinKind::Crate || n < 2.0 {
            return vec![[0.0, self.wall_height]];
        }
        // The first slat stands on the floor, the last one ends at the edge; as many as fit, spread evenly.
        let slat = slat.min(self.wall_height / n);
        let step = (self.wall_height - slat) / (n - 1.0);
        (0..n as usize).map(|k| [k as f64 * step, k as f64 * step + slat]).collect()
    }

    pub(super) fn solids(&self, table_height: f64) -> Vec<Fixture> {
        let world_from_bin = self.world_from_bin();
        let (hx, hy) = (self.inner[0] / 2.0, self.inner[1] / 2.0);
        let t = self.wall_thickness / 2.0;
        let kind = FixtureKind::Bin(self.kind);
        let part = |pose: Isometry3<f64>, half| block(kind, world_from_bin * pose, half, self.friction);
        let mut solids = vec![part(Isometry3::translation(0.0, 0.0, -t), [hx + 2.0 * t, hy + 2.0 * t, t])];
        let lean = self.lean();
        for (axis, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)] {
            // Walls at x cover the corners. A wall turns about the floor's edge, its upper end outwards.
            let (out, along) = if axis == 0 { (hx, hy + 2.0 * t) } else { (hy, hx) };
            let edge = Translation3::from(Vector3::ith(axis, sign * out));
            let about = if axis == 0 { Vector3::y() * sign * lean } else { Vector3::x() * -sign * lean };
            for [low, high] in self.boards().into_iter().map(|edges| edges.map(|z| z / lean.cos())) {
                let mut centre = Vector3::ith(axis, sign * t);
                centre.z = 0.5 * (low + high);
                let mut half = [along, along, 0.5 * (high - low)];
                half[axis] = t;
                let pose = edge * UnitQuaternion::from_scaled_axis(about) * Translation3::from(centre);
                let mut wall = part(pose, half);
                if lean > 0.0 {
                    wall.shape.geometry = flared(half, 1 - axis, lean.sin());
                }
                solids.push(wall);
            }
        }
        if self.kind == BinKind::Crate {
            // Posts that hold the slats.
            for (sx, sy) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                let h = self.wall_height / 2.0;
                solids.push(part(Isometry3::translation(sx * (hx + t), sy * (hy + t), h), [t, t, h]));
            }
        }
        // A bin that does not stand on the table or the floor gets a stand under it.
        if (self.base_height - table_height).abs() > 1e-6 && self.base_height > 1e-3 {
            let half = self.base_height / 2.0;
            let pose = Isometry3::from_parts(
                Translation3::new(self.center[0], self.center[1], half),
                world_from_bin.rotation,
            );
            solids.push(block(FixtureKind::Stand, pose, [hx + 2.0 * t, hy + 2.0 * t, half], self.friction));
        }
        solids
    }
}

/// A board that is `2 half` large at its lower edge, and wider along `axis` by `2 slope` for each metre above that: as wide
/// as a bin whose walls lean is at each height, so that no corner sticks out.
fn flared(half: [f64; 3], axis: usize, slope: f64) -> Convex {
    let points = (0..8).map(|i| {
        let mut p = [0, 1, 2].map(|a| if i >> a & 1 == 0 { -half[a] } else { half[a] });
        p[axis] += (slope * (p[2] + half[2])).copysign(p[axis]);
        Point3::from(p)
    });
    Convex::Hull { points: points.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE_HEIGHT: f64 = 0.6;

    /// On the table, 10 mm thick.
    fn bin() -> Bin {
        Bin {
            kind: BinKind::Carton,
            center: [0.7, 0.45],
            base_height: TABLE_HEIGHT,
            yaw: 0.0,
            inner: [0.3, 0.4],
            wall_height: 0.12,
            wall_thickness: 0.01,
            friction: 0.6,
        }
    }

    #[test]
    fn bins_of_all_kinds_hold_water_or_at_least_cans() {
        for kind in [BinKind::Carton, BinKind::Crate, BinKind::Tote, BinKind::Bag] {
            let bin = Bin { kind, wall_height: 0.14, ..bin() };
            let solids = bin.solids(TABLE_HEIGHT);
            let inside = |p: Point3<f64>| {
                solids.iter().any(|f| {
                    let (pose, solid) = crate::convert::solid(&f.shape).unwrap();
                    solid.distance_to_point(&pose, crate::convert::point(&p), true) <= 1e-6
                })
            };
            let world_from_bin = bin.world_from_bin();
            let at = |x: f64, y: f64, z: f64| world_from_bin * Point3::new(x, y, z);
            // Outwards from the middle at all heights up to the edge: a wall, or a gap that no can fits through.
            for side in 0..4 {
                let (axis, sign) = (side / 2, if side % 2 == 0 { 1.0 } else { -1.0 });
                let (mut gap, mut widest) = (0.0_f64, 0.0_f64);
                for k in 0..140 {
                    let z = 0.001 * f64::from(k) + 0.0005;
                    let hit = (0..400).find(|step| {
                        let mut p = [0.0, 0.0, z];
                        p[axis] = sign * 0.001 * f64::from(*step);
                        inside(at(p[0], p[1], p[2]))
                    });
                    match hit {
                        Some(step) => {
                            gap = 0.0;
                            let lean = if kind == BinKind::Tote { z * TOTE_LEAN.tan() } else { 0.0 };
                            let wall = bin.inner[axis] / 2.0 + lean;
                            assert!((0.001 * f64::from(step) - wall).abs() < 0.0015, "{kind:?} {side} {z}");
                        }
                        None => gap += 0.001,
                    }
                    widest = widest.max(gap);
                }
                let most = if kind == BinKind::Crate { 0.025 } else { 0.0 };
                assert!(widest <= most, "{kind:?} {side}: {widest}");
                assert_eq!(kind == BinKind::Crate, widest > 0.0);
            }
            let (low, high) = bin.outline();
            let corners = solids.iter().flat_map(|f| f.shape.corners());
            for p in corners {
                assert!((0..2).all(|a| p[a] >= low[a] - 1e-3 && p[a] <= high[a] + 1e-3), "{kind:?}: {p}");
            }
        }
    }

    #[test]
    fn walls_of_a_tote_meet_at_the_corners() {
        let bin = Bin { kind: BinKind::Tote, wall_height: 0.22, ..bin() };
        let from_bin = bin.world_from_bin().inverse();
        for corner in bin.solids(TABLE_HEIGHT).iter().flat_map(|f| f.shape.corners()) {
            let p = from_bin * corner;
            // Outside of the walls by as much as they lean at this height.
            let outer =
                |axis: usize| bin.inner[axis] / 2.0 + 0.01 / TOTE_LEAN.cos() + p.z.max(0.0) * TOTE_LEAN.tan();
            assert!((0..2).all(|a| p[a].abs() < outer(a) + 1e-3), "{p}");
        }
    }

    #[test]
    fn bin_contains_its_inside_only() {
        let bin = bin();
        assert!(bin.contains(&Point3::new(0.7, 0.45, 0.65), 0.0));
        assert!(!bin.contains(&Point3::new(0.7, 0.24, 0.65), 0.0));
        assert!(!bin.contains(&Point3::new(0.7, 0.45, 0.9), 0.05));
        assert!((bin.distance(0.7, 0.0) - (0.45 - 0.21)).abs() < 1e-9 && bin.distance(0.6, 0.5) == 0.0);
        // Floor and four walls meet without gap: their volume is the closed form of the shell.
        let volume: f64 = bin
            .solids(TABLE_HEIGHT)
            .iter()
            .map(|f| match &f.shape.geometry {
                Convex::Cuboid { half } => 8.0 * half.product(),
                _ => 0.0,
            })
            .sum();
        let shell = 0.32 * 0.42 * 0.13 - 0.3 * 0.4 * 0.12;
        assert!((volume - shell).abs() < 1e-9, "{volume} {shell}");
    }
}
