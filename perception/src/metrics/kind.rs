//! How an estimate is wrong: turned so that the object nearly lies on itself, shifted, in another place altogether.

use grip_sim::bop::Symmetries;
use grip_sim::pose::{Camera, Object, Pose};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::Serialize;

use super::surface_distance::SYMMETRY_STEP;
use crate::hull::extreme_points;
use crate::symmetry::oriented_box;

/// Right is an MSSD below this share of the diameter.
const RIGHT: f64 = 0.1;
/// Centres farther apart than this share of the diameter are in different places.
const ELSEWHERE: f64 = 0.5;
/// A turn is one from here on, radians: less is a shift that leans.
const LEAST_TURN: f64 = std::f64::consts::FRAC_PI_6;
/// How near an axis of the box, and a quarter or half of a full turn, a turn must be to bear their names, radians.
const NEAR: f64 = 0.35;
/// Directions in which extreme points are taken for the box.
const DIRECTIONS: usize = 96;

/// How an estimate stands to the truth, at the best of the object's symmetries. Turns are about the sides of the smallest box
/// around the object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ErrorKind {
    /// No point is off by more than a tenth of the diameter (MSSD).
    Right,
    /// In its place, and turned by a half about the longest side: front and back are exchanged.
    HalfTurnLong,
    /// By a half about the middle side.
    HalfTurnMiddle,
    /// By a half about the shortest side: upside down.
    HalfTurnShort,
    /// By a quarter about the longest side,
    QuarterTurnLong,
    /// the middle side,
    QuarterTurnMiddle,
    /// or the shortest side.
    QuarterTurnShort,
    /// By any other angle of 30 degrees or more.
    Turned,
    /// In its place, hardly turned, and yet not right.
    Shifted,
    /// Its centre is off by more than half of the diameter.
    Elsewhere,
    /// There is no estimate.
    Missing,
}

impl ErrorKind {
    /// In the order of tables.
    pub const ALL: [Self; 11] = [
        Self::Right,
        Self::HalfTurnLong,
        Self::HalfTurnMiddle,
        Self::HalfTurnShort,
        Self::QuarterTurnLong,
        Self::QuarterTurnMiddle,
        Self::QuarterTurnShort,
        Self::Turned,
        Self::Shifted,
        Self::Elsewhere,
        Self::Missing,
    ];

    /// As in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::HalfTurnLong => "half_turn_long",
            Self::HalfTurnMiddle => "half_turn_middle",
            Self::HalfTurnShort => "half_turn_short",
            Self::QuarterTurnLong => "quarter_turn_long",
            Self::QuarterTurnMiddle => "quarter_turn_middle",
            Self::QuarterTurnShort => "quarter_turn_short",
            Self::Turned => "turned",
            Self::Shifted => "shifted",
            Self::Elsewhere => "elsewhere",
            Self::Missing => "missing",
        }
    }
}

/// What tells the kinds of an object's errors.
#[derive(Debug)]
pub struct ErrorKinds {
    /// Motions that carry the object onto itself, none among them.
    symmetries: Vec<Isometry3<f64>>,
    /// The middle of its box, object frame, metres.
    middle: Point3<f64>,
    /// The sides of the box, object frame, the longest first.
    sides: [Vector3<f64>; 3],
    diameter_m: f64,
}

impl ErrorKinds {
    /// Of an object with these points, object frame, metres.
    pub fn new(points: &[Point3<f64>], symmetries: &Symmetries, diameter_m: f64) -> Self {
        let points: Vec<Vector3<f32>> = points.iter().map(|p| p.coords.cast()).collect();
        let hull = extreme_points(&points, DIRECTIONS);
        let of_box = oriented_box(&hull);
        let mut sides = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| {
            let side = of_box.rotation * axis;
            let along = || hull.iter().map(|p| p.dot(&side));
            let length = along().fold(f32::MIN, f32::max) - along().fold(f32::MAX, f32::min);
            (length, side.cast())
        });
        sides.sort_by(|a, b| b.0.total_cmp(&a.0));
        Self {
            symmetries: symmetries.transforms(SYMMETRY_STEP),
            middle: Point3::from(of_box.translation.vector.cast()),
            sides: sides.map(|(_, side)| side),
            diameter_m,
        }
    }

    /// The kind of an estimate with this MSSD, metres.
    pub fn kind(
        &self,
        truth: &Pose<Camera, Object>,
        estimate: &Pose<Camera, Object>,
        mssd_m: f64,
    ) -> ErrorKind {
        if mssd_m < RIGHT * self.diameter_m {
            return ErrorKind::Right;
        }
        let (truth, estimate) = (truth.iso(), estimate.iso());
        let off = (truth * self.middle - estimate * self.middle).norm();
        if off.is_nan() || off > ELSEWHERE * self.diameter_m {
            return ErrorKind::Elsewhere;
        }
        let turns = self.symmetries.iter().map(|s| (truth * s).rotation.inverse() * estimate.rotation);
        let least = turns.min_by(|a, b| a.angle().total_cmp(&b.angle()));
        self.turn(&least.unwrap_or_else(UnitQuaternion::identity))
    }

    fn turn(&self, turn: &UnitQuaternion<f64>) -> ErrorKind {
        let angle = turn.angle();
        let Some(axis) = turn.axis().filter(|_| angle >= LEAST_TURN) else { return ErrorKind::Shifted };
        let about = self.sides.iter().position(|side| side.dot(&axis).abs() > NEAR.cos());
        let near = |turn: f64| (angle - turn).abs() < NEAR;
        match about {
            Some(0) if near(std::f64::consts::PI) => ErrorKind::HalfTurnLong,
            Some(1) if near(std::f64::consts::PI) => ErrorKind::HalfTurnMiddle,
            Some(2) if near(std::f64::consts::PI) => ErrorKind::HalfTurnShort,
            Some(0) if near(std::f64::consts::FRAC_PI_2) => ErrorKind::QuarterTurnLong,
            Some(1) if near(std::f64::consts::FRAC_PI_2) => ErrorKind::QuarterTurnMiddle,
            Some(2) if near(std::f64::consts::FRAC_PI_2) => ErrorKind::QuarterTurnShort,
            _ => ErrorKind::Turned,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use grip_sim::bop::SymmetryAxis;
    use nalgebra::Translation3;

    use super::*;
    use crate::metrics::SymmetricShape;

    const SIZE: [f64; 3] = [0.06, 0.21, 0.16];

    fn corners() -> Vec<Point3<f64>> {
        let corner = |i: usize| Point3::from(Vector3::from_fn(|a, _| SIZE[a] * ((i >> a & 1) as f64 - 0.5)));
        (0..8).map(corner).collect()
    }

    /// The kind of the error of a box that is turned in its own frame, then shifted along x by metres.
    fn kind(symmetries: &Symmetries, turn: Vector3<f64>, shift: f64) -> ErrorKind {
        let truth = Isometry3::new(Vector3::new(0.1, -0.1, 0.9), Vector3::new(0.4, 1.3, -0.7));
        let estimate = Translation3::new(shift, 0.0, 0.0) * truth * UnitQuaternion::from_scaled_axis(turn);
        let (truth, estimate) = (Pose::new(truth), Pose::new(estimate));
        let diameter = Vector3::from(SIZE).norm();
        let mssd = SymmetricShape::new(corners(), symmetries).mssd(&truth, &estimate);
        ErrorKinds::new(&corners(), symmetries, diameter).kind(&truth, &estimate, mssd)
    }

    #[test]
    fn errors_bear_the_names_of_what_was_done() {
        let none = Symmetries::default();
        for (turn, shift, wanted) in [
            (Vector3::zeros(), 0.0, ErrorKind::Right),
            (Vector3::new(0.05, 0.0, 0.05), 0.01, ErrorKind::Right),
            // The sides are y, z, x by length.
            (Vector3::y() * PI, 0.0, ErrorKind::HalfTurnLong),
            (Vector3::z() * PI, 0.02, ErrorKind::HalfTurnMiddle),
            (Vector3::x() * (PI - 0.2), 0.0, ErrorKind::HalfTurnShort),
            (-Vector3::y() * FRAC_PI_2, 0.0, ErrorKind::QuarterTurnLong),
            (Vector3::z() * (FRAC_PI_2 + 0.1), 0.0, ErrorKind::QuarterTurnMiddle),
            (Vector3::x() * FRAC_PI_2, 0.0, ErrorKind::QuarterTurnShort),
            (Vector3::x() * 0.8, 0.0, ErrorKind::Turned),
            (Vector3::new(1.0, 1.0, 0.0).normalize() * PI, 0.0, ErrorKind::Turned),
            (Vector3::zeros(), 0.05, ErrorKind::Shifted),
            (Vector3::y() * PI, 0.2, ErrorKind::Elsewhere),
            (Vector3::zeros(), f64::NAN, ErrorKind::Elsewhere),
        ] {
            assert_eq!(kind(&none, turn, shift), wanted, "{turn:?} {shift}");
        }
    }

    #[test]
    fn what_a_symmetry_undoes_is_no_turn() {
        let half = Isometry3::from_parts(
            Translation3::identity(),
            UnitQuaternion::from_axis_angle(&Vector3::y_axis(), PI),
        );
        let twofold = Symmetries { discrete: vec![half], continuous: vec![] };
        assert_eq!(kind(&twofold, Vector3::y() * PI, 0.0), ErrorKind::Right);
        assert_eq!(kind(&twofold, Vector3::y() * PI, 0.05), ErrorKind::Shifted);
        assert_eq!(kind(&twofold, Vector3::z() * PI, 0.0), ErrorKind::HalfTurnMiddle);
        let round = Symmetries {
            discrete: vec![],
            continuous: vec![SymmetryAxis { axis: Vector3::y_axis(), through: Point3::origin() }],
        };
        assert_eq!(kind(&round, Vector3::y() * 1.234, 0.0), ErrorKind::Right);
        assert_eq!(kind(&round, Vector3::x() * PI, 0.0), ErrorKind::HalfTurnShort);
    }

    #[test]
    fn names_are_those_of_the_files() {
        for kind in ErrorKind::ALL {
            assert_eq!(serde_json::to_value(kind).unwrap(), kind.name());
        }
    }
}
