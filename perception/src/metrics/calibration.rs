//! Whether a posterior means what it says: where the truth lies in it.
//!
//! Of a belief that is right the truth is one more draw. So the share of draws that are more probable than the truth is uniform
//! between 0 and 1 over many cases (simulation-based calibration, Talts et al. 2018, with the density itself as the
//! statistic), and the smallest region that holds 90 % of the belief holds the truth in 90 % of the cases.

use grip_sim::bop::Symmetries;
use grip_sim::pose::{Camera, Object, Pose};
use grip_sim::rng;
use nalgebra::{Isometry3, Matrix6, OMatrix, OVector, U5, U6, Unit, UnitQuaternion, Vector3};
use rand::RngExt;

use super::surface_distance::SYMMETRY_STEP;
use crate::posterior::Mode;

/// Draws a case: the same standard ones for all, so that their own error, a hundredth, is common.
const DRAWS: usize = 2000;

/// The credible level of the truth: the belief's mass at poses that are more probable than it, 0 to 1. Poses that the
/// object's symmetries make equal are one. `None` without modes, or where one has no spread.
pub fn credible_level(modes: &[Mode], truth: &Pose<Camera, Object>, symmetries: &Symmetries) -> Option<f64> {
    let axis = match symmetries.continuous.as_slice() {
        [one] => Some(one.axis),
        _ => None,
    };
    // With one axis all turns about it are one pose: what is left are the others.
    let discrete = match axis {
        Some(_) => Symmetries { continuous: Vec::new(), ..symmetries.clone() }.transforms(SYMMETRY_STEP),
        None => symmetries.transforms(SYMMETRY_STEP),
    };
    let places: Vec<Density<'_>> =
        modes.iter().map(|mode| Density::new(mode, axis)).collect::<Option<_>>()?;
    let density = |pose: &Pose<Camera, Object>| -> f64 {
        let equal = || discrete.iter().map(|s| Pose::new(pose.iso() * s));
        places.iter().map(|place| equal().map(|pose| place.density(&pose)).sum::<f64>()).sum()
    };
    let at_truth = density(truth);
    let mut rng = rng::stream(0, "credible level");
    let all: f64 = modes.iter().map(|mode| mode.mass).sum();
    let mut above = 0;
    for _ in 0..DRAWS {
        let mut left = rng.random::<f64>() * all;
        let drawn = places.iter().find(|place| {
            left -= place.mode.mass;
            left < 0.0
        });
        let place = drawn.or(places.last())?;
        let by = place.mode.drawn(&place.root, &mut rng);
        above += usize::from(density(&place.mode.displaced(&by)) > at_truth);
    }
    Some(above as f64 / DRAWS as f64)
}

/// A mode as a distribution of displacements.
struct Density<'a> {
    mode: &'a Mode,
    /// Camera axes from those in which the last is that of the object's turns, if it has one.
    basis: Matrix6<f64>,
    axis: Option<Unit<Vector3<f64>>>,
    root: Matrix6<f64>,
    precision: OMatrix<f64, U5, U5>,
    precision_of_all: Matrix6<f64>,
    log_scale: f64,
}

impl<'a> Density<'a> {
    fn new(mode: &'a Mode, axis: Option<Unit<Vector3<f64>>>) -> Option<Self> {
        let covariance = mode.covariance();
        let root = covariance.cholesky()?.l();
        let mut basis = Matrix6::identity();
        if let Some(axis) = axis {
            let turned = UnitQuaternion::rotation_between(&Vector3::z(), &(mode.pose.iso().rotation * *axis));
            let turned = turned
                .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
            let matrix = turned.to_rotation_matrix().into_inner();
            basis.fixed_view_mut::<3, 3>(3, 3).copy_from(&matrix);
        }
        let turned = basis.transpose() * covariance * basis;
        let without: OMatrix<f64, U5, U5> = turned.fixed_view::<5, 5>(0, 0).into_owned();
        let determinant = if axis.is_some() { without.determinant() } else { turned.determinant() };
        Some(Self {
            mode,
            basis,
            axis,
            root,
            precision: without.try_inverse()?,
            precision_of_all: turned.try_inverse()?,
            log_scale: mode.mass.ln() - 0.5 * determinant.ln(),
        })
    }

    /// Up to a factor that all modes share (they have the same degrees of freedom).
    fn density(&self, pose: &Pose<Camera, Object>) -> f64 {
        let pose = self.axis.map_or(*pose, |axis| turned_nearest(pose, &self.mode.pose, &axis));
        let off: OVector<f64, U6> = self.basis.transpose() * self.mode.displacement(&pose);
        let (squared, free) = if self.axis.is_some() {
            let off: OVector<f64, U5> = off.fixed_rows::<5>(0).into_owned();
            (off.dot(&(self.precision * off)), 5.0)
        } else {
            (off.dot(&(self.precision_of_all * off)), 6.0)
        };
        let shape = match self.mode.degrees_of_freedom {
            // The covariance is dof / (dof - 2) times the scale of the t distribution.
            Some(dof) => -0.5 * (dof + free) * (squared / (dof - 2.0)).ln_1p(),
            None => -0.5 * squared,
        };
        (self.log_scale + shape).exp()
    }
}

/// `pose` turned about the object's axis to where it is nearest to `other`.
fn turned_nearest(
    pose: &Pose<Camera, Object>,
    other: &Pose<Camera, Object>,
    axis: &Unit<Vector3<f64>>,
) -> Pose<Camera, Object> {
    let rest = pose.iso().rotation.inverse() * other.iso().rotation;
    let along = rest.coords.xyz().dot(axis);
    let turn = UnitQuaternion::from_axis_angle(axis, 2.0 * along.atan2(rest.w));
    Pose::new(Isometry3::from_parts(pose.iso().translation, pose.iso().rotation * turn))
}

#[cfg(test)]
mod tests {
    use grip_sim::bop::SymmetryAxis;
    use nalgebra::Point3;

    use super::*;

    fn pose(x: f64) -> Pose<Camera, Object> {
        Pose::from_xyz_rpy([x, 0.1, 0.9], [0.4, -0.2, 2.0])
    }

    fn covariance(scale: f64) -> Matrix6<f64> {
        let root = Matrix6::from_fn(|i, j| {
            let unit = if i < 3 { 0.002 } else { 0.02 };
            unit * if i == j { 1.0 } else { 0.3 * ((i * 7 + j * 3) % 5) as f64 / 5.0 - 0.1 }
        });
        root * root.transpose() * scale
    }

    /// Levels of truths that are drawn from `belief`, where `believed` is claimed.
    fn levels(belief: &[Mode], believed: &[Mode], symmetries: &Symmetries) -> Vec<f64> {
        let mut rng = rng::stream(3, "t");
        (0..600)
            .map(|i| {
                let u = (i as f64 + 0.5) / 600.0;
                let mode = if u < belief[0].mass { &belief[0] } else { &belief[belief.len() - 1] };
                let by = mode.drawn(&mode.root(), &mut rng);
                credible_level(believed, &mode.displaced(&by), symmetries).unwrap()
            })
            .collect()
    }

    fn within(levels: &[f64], level: f64) -> f64 {
        levels.iter().filter(|l| **l <= level).count() as f64 / levels.len() as f64
    }

    #[test]
    fn a_belief_that_is_right_holds_the_truth_as_often_as_it_says() {
        let modes = [
            Mode::new(pose(0.0), 0.7, 0.8, &covariance(1.0)),
            Mode::new(pose(0.2), 0.3, 0.8, &covariance(2.0)),
        ];
        let levels = levels(&modes, &modes, &Symmetries::default());
        for level in [0.1, 0.5, 0.9] {
            assert!((within(&levels, level) - level).abs() < 0.06, "{level}: {}", within(&levels, level));
        }
    }

    #[test]
    fn heavy_tails_hold_what_they_say_too() {
        let heavy = |x: f64, mass: f64| Mode {
            degrees_of_freedom: Some(4.5),
            ..Mode::new(pose(x), mass, 0.8, &covariance(1.0))
        };
        let modes = [heavy(0.0, 0.6), heavy(0.2, 0.4)];
        let right = levels(&modes, &modes, &Symmetries::default());
        for level in [0.1, 0.5, 0.9] {
            assert!((within(&right, level) - level).abs() < 0.06, "{level}: {}", within(&right, level));
        }
        // Of the same covariance a normal distribution holds less in its tails, and more before them.
        let normal = modes.clone().map(|mode| Mode { degrees_of_freedom: None, ..mode });
        let other = levels(&modes, &normal, &Symmetries::default());
        assert!(within(&other, 0.5) > 0.6 && within(&other, 0.99) < 0.97);
    }

    #[test]
    fn a_belief_that_is_too_sure_does_not() {
        let right = [Mode::new(pose(0.0), 1.0, 0.8, &covariance(1.0))];
        let sure = [Mode::new(pose(0.0), 1.0, 0.8, &covariance(0.25))];
        let vague = [Mode::new(pose(0.0), 1.0, 0.8, &covariance(4.0))];
        let none = Symmetries::default();
        // chi^2 of 6 degrees: P(x < 5.35 / 4) = 0.031 and P(x < 4 * 5.35) = 0.998, the medians of the others.
        assert!((within(&levels(&right, &sure, &none), 0.5) - 0.031).abs() < 0.03);
        assert!(within(&levels(&right, &vague, &none), 0.5) > 0.98);
    }

    #[test]
    fn equal_orientations_are_one() {
        let can = Symmetries {
            continuous: vec![SymmetryAxis { axis: Vector3::z_axis(), through: Point3::origin() }],
            ..Symmetries::default()
        };
        let modes = [Mode::new(pose(0.0), 1.0, 0.8, &covariance(1.0))];
        let turned = Pose::new(pose(0.0).iso() * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 2.0));
        assert!(credible_level(&modes, &turned, &can).unwrap() < 0.02);
        assert_eq!(credible_level(&modes, &turned, &Symmetries::default()), Some(1.0));
        let levels = levels(&modes, &modes, &can);
        for level in [0.5, 0.9] {
            assert!((within(&levels, level) - level).abs() < 0.06, "{level}: {}", within(&levels, level));
        }
    }
}
