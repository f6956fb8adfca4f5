//! MSSD and MSPD: how far the farthest point is off, in space and in the picture, at the best of the object's symmetries
//! (Hodan et al., "BOP Challenge 2020 on 6D Object Localization", 2020, equations 3 and 4).

use grip_sim::bop::Symmetries;
use grip_sim::camera::Intrinsics;
use grip_sim::pose::{Camera, Object, Pose};
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

/// Continuous symmetries are taken in steps that move no point by more than this share of the diameter.
pub const SYMMETRY_STEP: f64 = 0.01;

/// Points, spread wide, that tell before all others which symmetries need no closer look.
const SCOUTS: usize = 8;

/// The points of a model and the motions that carry it onto itself.
#[derive(Debug)]
pub struct SymmetricShape {
    /// Metres, object frame; the [`SCOUTS`] first.
    points: Vec<Point3<f64>>,
    /// Motions that carry the shape onto itself, the identity among them.
    symmetries: Vec<Isometry3<f64>>,
}

impl SymmetricShape {
    /// Of these points, metres, object frame. Discrete symmetries are combined with the steps of continuous ones.
    ///
    /// The step of no turn is among them, so that the truth has no error. (Versions of the toolkit leave it out where there is a
    /// continuous symmetry, which gives the truth an error of up to one step.)
    pub fn new(points: Vec<Point3<f64>>, symmetries: &Symmetries) -> Self {
        Self { points: scouts_first(points), symmetries: symmetries.transforms(SYMMETRY_STEP) }
    }

    /// Maximum symmetry-aware surface distance, metres: the largest distance between corresponding points, at the symmetry
    /// where that is least. 0 for no points, infinite for a pose that is not finite.
    pub fn mssd(&self, truth: &Pose<Camera, Object>, estimate: &Pose<Camera, Object>) -> f64 {
        let estimate = Rigid::new(estimate.iso());
        let moved: Vec<Vector3<f64>> = self.points.iter().map(|p| estimate.apply(p)).collect();
        let squared = self.least_of_largest(|turn| {
            let turned = Rigid::new(&(truth.iso() * turn));
            let (points, moved) = (&self.points, &moved);
            move |i: usize| (turned.apply(&points[i]) - moved[i]).norm_squared()
        });
        squared.sqrt()
    }

    /// Maximum symmetry-aware projection distance, pixels: the same of the points' projections. 0 for no points, infinite
    /// where the estimate has a point that is not in front of the camera. (The toolkit projects such points through the
    /// camera to its front.)
    pub fn mspd(
        &self,
        truth: &Pose<Camera, Object>,
        estimate: &Pose<Camera, Object>,
        intrinsics: &Intrinsics,
    ) -> f64 {
        let estimate = Rigid::new(estimate.iso());
        let seen = |pose: &Rigid, p: &Point3<f64>| intrinsics.project(&Point3::from(pose.apply(p)));
        let Some(moved) = self.points.iter().map(|p| seen(&estimate, p)).collect::<Option<Vec<_>>>() else {
            return f64::INFINITY;
        };
        let squared = self.least_of_largest(|turn| {
            let turned = Rigid::new(&(truth.iso() * turn));
            let (points, moved) = (&self.points, &moved);
            move |i: usize| seen(&turned, &points[i]).map_or(f64::INFINITY, |p| (p - moved[i]).norm_squared())
        });
        squared.sqrt()
    }

    /// The least over all turns of the largest over all points of `error(turn)(point)`. Turns are tried in the order of what
    /// the scouts say, and each is given up at the first point that is worse than the best turn so far: exact, and most of
    /// the hundreds of turns of a round object cost no more than the scouts.
    fn least_of_largest<E: Fn(usize) -> f64>(&self, error: impl Fn(&Isometry3<f64>) -> E) -> f64 {
        let scouts = SCOUTS.min(self.points.len());
        let mut turns: Vec<(f64, E)> = self
            .symmetries
            .iter()
            .map(|turn| {
                let error = error(turn);
                ((0..scouts).map(&error).fold(0.0, larger), error)
            })
            .collect();
        turns.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut least = f64::INFINITY;
        for (at_scouts, error) in turns {
            if at_scouts >= least {
                break;
            }
            let mut largest = at_scouts;
            for i in scouts..self.points.len() {
                largest = larger(largest, error(i));
                if largest >= least {
                    break;
                }
            }
            least = least.min(largest);
        }
        least
    }
}

/// NaN counts as infinite.
fn larger(a: f64, b: f64) -> f64 {
    if b.is_nan() { f64::INFINITY } else { a.max(b) }
}

/// A pose as a matrix, which moves many points faster than a quaternion does.
struct Rigid {
    rotation: Matrix3<f64>,
    shift: Vector3<f64>,
}

impl Rigid {
    fn new(iso: &Isometry3<f64>) -> Self {
        Self { rotation: *iso.rotation.to_rotation_matrix().matrix(), shift: iso.translation.vector }
    }

    fn apply(&self, p: &Point3<f64>) -> Vector3<f64> {
        self.rotation * p.coords + self.shift
    }
}

/// Brings to the front the point farthest from the middle, then again and again the one farthest from those in front.
fn scouts_first(mut points: Vec<Point3<f64>>) -> Vec<Point3<f64>> {
    let sum: Vector3<f64> = points.iter().map(|p| p.coords).sum();
    let middle = Point3::from(sum / points.len().max(1) as f64);
    // Squared distances to the nearest point in front; at first, to the middle.
    let mut off: Vec<f64> = points.iter().map(|p| nalgebra::distance_squared(&middle, p)).collect();
    for first in 0..SCOUTS {
        let farthest = (first..points.len()).max_by(|&a, &b| off[a].total_cmp(&off[b]));
        let Some(farthest) = farthest else { break };
        points.swap(first, farthest);
        off.swap(first, farthest);
        let chosen = points[first];
        for (off, p) in off.iter_mut().zip(&points) {
            let squared = nalgebra::distance_squared(&chosen, p);
            *off = if first == 0 { squared } else { off.min(squared) };
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI, TAU};

    use grip_sim::bop::SymmetryAxis;
    use nalgebra::{Translation3, UnitQuaternion};

    const K: Intrinsics = Intrinsics { width: 640, height: 480, fx: 500.0, fy: 400.0, cx: 319.5, cy: 239.5 };

    fn box_of(half: [f64; 3]) -> Vec<Point3<f64>> {
        let side = |i: i32, axis: usize| if i >> axis & 1 == 0 { -half[axis] } else { half[axis] };
        (0..8).map(|i| Point3::new(side(i, 0), side(i, 1), side(i, 2))).collect()
    }

    /// Two rims of a can about z that stands off the origin, 360 points each, 0.1 high, of radius 0.04.
    fn can(middle: [f64; 2]) -> Vec<Point3<f64>> {
        let point = |i: i32, z: f64| {
            let (sin, cos) = (f64::from(i) / 360.0 * TAU).sin_cos();
            Point3::new(middle[0] + 0.04 * cos, middle[1] + 0.04 * sin, z)
        };
        (0..360).flat_map(|i| [point(i, -0.05), point(i, 0.05)]).collect()
    }

    fn at(xyz: [f64; 3]) -> Pose<Camera, Object> {
        Pose::new(Isometry3::translation(xyz[0], xyz[1], xyz[2]))
    }

    fn turned(pose: &Pose<Camera, Object>, axis: Vector3<f64>, angle: f64) -> Pose<Camera, Object> {
        let turn = UnitQuaternion::from_scaled_axis(axis * angle);
        Pose::new(pose.iso() * Isometry3::from_parts(Translation3::identity(), turn))
    }

    fn none() -> Symmetries {
        Symmetries::default()
    }

    #[test]
    fn translations_in_closed_form() {
        let shape = SymmetricShape::new(box_of([0.1, 0.2, 0.3]), &none());
        let truth = at([0.05, -0.1, 1.0]);
        assert_eq!((shape.mssd(&truth, &truth), shape.mspd(&truth, &truth, &K)), (0.0, 0.0));
        // Along x the nearest face, at z = 0.7, moves most in the picture: f dx / z.
        let x = at([0.06, -0.1, 1.0]);
        assert!((shape.mssd(&truth, &x) - 0.01).abs() < 1e-12);
        assert!((shape.mspd(&truth, &x, &K) - 500.0 * 0.01 / 0.7).abs() < 1e-9);
        // Along z the near corner farthest from the axis, (0.15, -0.3) at 0.7, moves by f r (1/0.7 - 1/0.8).
        let z = at([0.05, -0.1, 1.1]);
        let scale: f64 = 1.0 / 0.7 - 1.0 / 0.8;
        assert!((shape.mssd(&truth, &z) - 0.1).abs() < 1e-12);
        assert!(
            (shape.mspd(&truth, &z, &K) - (500.0 * 0.15 * scale).hypot(400.0 * 0.3 * scale)).abs() < 1e-9
        );
    }

    #[test]
    fn a_round_can_may_turn_about_its_axis_by_steps_and_be_upside_down() {
        let through = Point3::new(0.3, -0.2, 0.0);
        let axis = SymmetryAxis { axis: Vector3::z_axis(), through };
        let shape =
            SymmetricShape::new(can([0.3, -0.2]), &Symmetries { discrete: vec![], continuous: vec![axis] });
        let truth = Pose::from_xyz_rpy([0.1, 0.05, 0.9], [0.4, -0.2, 1.0]);
        let about = |angle: f64| {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
            Pose::new(truth.iso() * Isometry3::rotation_wrt_point(turn, through))
        };
        let step = TAU / 315.0;
        for steps in [1.0, 77.0, 300.0] {
            assert!(shape.mssd(&truth, &about(steps * step)) < 1e-12, "{steps}");
            assert!(shape.mspd(&truth, &about(steps * step), &K) < 1e-9, "{steps}");
        }
        // Between two steps a rim is off by the chord of half a step.
        let chord = 2.0 * 0.04 * (step / 4.0).sin();
        assert!((shape.mssd(&truth, &about(20.5 * step)) - chord).abs() < 1e-12);
        // Upside down about the axis x through its middle: the rims are 0.1 apart, unless that is a symmetry as well.
        let half =
            Isometry3::rotation_wrt_point(UnitQuaternion::from_scaled_axis(Vector3::x() * PI), through);
        let upside_down = Pose::new(about(100.0 * step).iso() * half);
        assert!(shape.mssd(&truth, &upside_down) > 0.099);
        let both = Symmetries { discrete: vec![half], continuous: vec![axis] };
        let shape = SymmetricShape::new(can([0.3, -0.2]), &both);
        assert!(shape.mssd(&truth, &upside_down) < 1e-12);
        assert!(shape.mspd(&truth, &upside_down, &K) < 1e-9);
    }

    #[test]
    fn a_discrete_symmetry_is_free_and_a_turn_that_is_none_is_not() {
        let half_turn = Isometry3::rotation(Vector3::z() * PI);
        let symmetries = Symmetries { discrete: vec![half_turn], continuous: vec![] };
        let shape = SymmetricShape::new(box_of([0.1, 0.2, 0.3]), &symmetries);
        let truth = at([0.0, 0.0, 1.0]);
        let half = turned(&truth, Vector3::z(), PI);
        assert!(shape.mssd(&truth, &half) < 1e-12 && shape.mspd(&truth, &half, &K) < 1e-9);
        let plain = SymmetricShape::new(box_of([0.1, 0.2, 0.3]), &none());
        assert!((plain.mssd(&truth, &half) - 2.0 * 0.1_f64.hypot(0.2)).abs() < 1e-12);
        // A quarter turn carries a corner along the chord of its circle.
        let quarter = turned(&truth, Vector3::z(), FRAC_PI_2);
        assert!((shape.mssd(&truth, &quarter) - 2_f64.sqrt() * 0.1_f64.hypot(0.2)).abs() < 1e-12);
    }

    #[test]
    fn giving_up_early_changes_nothing() {
        let points: Vec<Point3<f64>> = (0..300)
            .map(|i| {
                let x = f64::from(i);
                Point3::new((1.3 * x).sin(), (2.1 * x).cos(), (0.7 * x).sin() * (0.2 * x).cos()) * 0.1
            })
            .collect();
        let axis = SymmetryAxis { axis: Vector3::y_axis(), through: Point3::new(0.01, 0.0, -0.02) };
        let symmetries =
            Symmetries { discrete: vec![Isometry3::rotation(Vector3::x() * PI)], continuous: vec![axis] };
        let shape = SymmetricShape::new(points.clone(), &symmetries);
        for i in 0..20 {
            let x = f64::from(i) * 0.37;
            let a = Pose::from_xyz_rpy([0.1, 0.2, 0.9], [0.3 * x, 0.1, x]);
            let b = Pose::from_xyz_rpy([0.1 + 0.02 * x.sin(), 0.2, 0.9], [0.1 * x, x, 0.2]);
            let mut least = [f64::INFINITY; 2];
            for turn in symmetries.transforms(SYMMETRY_STEP) {
                let a: Pose<Camera, Object> = Pose::new(a.iso() * turn);
                let largest =
                    |error: &dyn Fn(&Point3<f64>) -> f64| points.iter().map(error).fold(0.0, f64::max);
                let space = largest(&|p| (a.transform_point(p) - b.transform_point(p)).norm());
                let seen = |pose: &Pose<Camera, Object>, p: &Point3<f64>| {
                    K.project(&pose.transform_point(p)).unwrap()
                };
                let picture = largest(&|p| (seen(&a, p) - seen(&b, p)).norm());
                least = [least[0].min(space), least[1].min(picture)];
            }
            assert!((shape.mssd(&a, &b) - least[0]).abs() < 1e-12);
            assert!((shape.mspd(&a, &b, &K) - least[1]).abs() < 1e-9);
        }
    }

    #[test]
    fn poses_that_are_nowhere_are_infinitely_far_off() {
        let shape = SymmetricShape::new(box_of([0.1; 3]), &none());
        let truth = at([0.0, 0.0, 1.0]);
        for pose in [at([f64::NAN, 0.0, 1.0]), at([0.0, 0.0, f64::INFINITY])] {
            assert_eq!(shape.mssd(&truth, &pose), f64::INFINITY);
            assert!(shape.mspd(&truth, &pose, &K) > 50.0);
        }
        let behind = at([0.0, 0.0, -1.0]);
        assert_eq!(shape.mspd(&truth, &behind, &K), f64::INFINITY);
        assert!((shape.mssd(&truth, &behind) - 2.0).abs() < 1e-12);
        let empty = SymmetricShape::new(vec![], &none());
        assert_eq!((empty.mssd(&truth, &behind), empty.mspd(&truth, &behind, &K)), (0.0, 0.0));
    }
}
