//! The joint space of a group: limits, wrapping joints, and a metric that bounds how far the robot can move.

use rand::{Rng, RngExt};

/// One joint of a [`JointSpace`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// Lower limit, radians or metres; ignored when `wraps`.
    pub lower: f64,
    /// Upper limit, radians or metres; ignored when `wraps`.
    pub upper: f64,
    /// A continuous joint: positions that differ by a full turn are the same.
    pub wraps: bool,
    /// Metres that the farthest point of the robot moves for one unit (radian or metre) of this joint, at most.
    pub reach: f64,
}

/// The product of a group's joints.
///
/// No point of the robot moves farther than [`JointSpace::travel`] between two configurations, so an edge whose
/// checked configurations are at most twice the collision margin apart is free of collision in between as well.
#[derive(Debug, Clone, PartialEq)]
pub struct JointSpace {
    axes: Vec<Axis>,
}

/// Wraps an angle to `[-pi, pi)`.
pub fn wrap(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    angle - TAU * ((angle + PI) / TAU).floor()
}

impl JointSpace {
    /// The space of these joints.
    pub fn new(axes: Vec<Axis>) -> Self {
        Self { axes }
    }

    /// The joints.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Number of joints.
    pub fn dim(&self) -> usize {
        self.axes.len()
    }

    /// `to - from`, the short way round for joints that wrap.
    pub fn difference(&self, from: &[f64], to: &[f64]) -> Vec<f64> {
        self.axes
            .iter()
            .zip(from.iter().zip(to))
            .map(|(axis, (a, b))| if axis.wraps { wrap(b - a) } else { b - a })
            .collect()
    }

    /// Bound of the distance that any point of the robot moves between `a` and `b`, metres (a sum over the joints).
    pub fn travel(&self, a: &[f64], b: &[f64]) -> f64 {
        let mut sum = 0.0;
        for (axis, (a, b)) in self.axes.iter().zip(a.iter().zip(b)) {
            let d = if axis.wraps { wrap(b - a) } else { b - a };
            sum += d.abs() * axis.reach;
        }
        sum
    }

    /// Root of the sum of squares of each joint's motion, metres: the metric for nearest neighbours.
    pub fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let mut sum = 0.0;
        for (axis, (a, b)) in self.axes.iter().zip(a.iter().zip(b)) {
            let d = if axis.wraps { wrap(b - a) } else { b - a };
            sum += (d * axis.reach).powi(2);
        }
        sum.sqrt()
    }

    /// The configuration at the share `t` of the short way from `a` to `b`; a joint that wraps may leave `[-pi, pi]`.
    pub fn interpolate(&self, a: &[f64], b: &[f64], t: f64) -> Vec<f64> {
        self.difference(a, b).iter().zip(a).map(|(d, a)| a + d * t).collect()
    }

    /// `b`, with whole turns added to joints that wrap so that it lies nearest to `a`.
    pub fn unwrap_near(&self, a: &[f64], b: &[f64]) -> Vec<f64> {
        use std::f64::consts::TAU;
        self.axes
            .iter()
            .zip(a.iter().zip(b))
            .map(|(axis, (a, b))| if axis.wraps { b + TAU * ((a - b) / TAU).round() } else { *b })
            .collect()
    }

    /// A uniform random configuration.
    pub fn sample(&self, rng: &mut impl Rng) -> Vec<f64> {
        use std::f64::consts::PI;
        self.axes
            .iter()
            .map(|axis| {
                let (lo, hi) = if axis.wraps { (-PI, PI) } else { (axis.lower, axis.upper) };
                lo + (hi - lo) * rng.random::<f64>()
            })
            .collect()
    }

    /// Every joint finite and within its limits, to a tolerance of 1e-9.
    pub fn within_limits(&self, q: &[f64]) -> bool {
        q.len() == self.axes.len()
            && self.axes.iter().zip(q).all(|(axis, v)| {
                v.is_finite() && (axis.wraps || (axis.lower - 1e-9..=axis.upper + 1e-9).contains(v))
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn space() -> JointSpace {
        let axis = |wraps| Axis { lower: -1.0, upper: 1.0, wraps, reach: 0.5 };
        JointSpace::new(vec![axis(false), axis(true)])
    }

    #[test]
    fn continuous_joints_take_the_short_way() {
        let d = space().difference(&[0.2, 3.0], &[0.1, -3.0]);
        assert!((d[0] + 0.1).abs() < 1e-12);
        assert!((d[1] - (2.0 * PI - 6.0)).abs() < 1e-12);
        let travel = space().travel(&[0.2, 3.0], &[0.1, -3.0]);
        assert!((travel - 0.5 * (0.1 + d[1])).abs() < 1e-12);
        let near = space().unwrap_near(&[0.2, 3.0], &[0.1, -3.0]);
        assert!((near[1] - (2.0 * PI - 3.0)).abs() < 1e-12);
    }

    #[test]
    fn limits_refuse_nan_and_excess_but_let_continuous_joints_turn() {
        assert!(space().within_limits(&[1.0, 40.0]));
        assert!(!space().within_limits(&[1.01, 0.0]));
        assert!(!space().within_limits(&[f64::NAN, 0.0]));
        assert!(!space().within_limits(&[0.0]));
    }
}
