//! The errors of a sweep.

use std::f64::consts::TAU;
use std::str::FromStr;

use grip_sim::rng;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_distr::{Distribution, UnitSphere};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A direction in the gripper's frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// Along the fingers: the approach.
    X,
    /// From finger to finger: the closing direction.
    Y,
    /// Sideways, along the pads' width.
    Z,
    /// Turn about x.
    Roll,
    /// Turn about y.
    Pitch,
    /// Turn about z.
    Yaw,
}

impl Axis {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::X, Self::Y, Self::Z, Self::Roll, Self::Pitch, Self::Yaw];

    /// Whether it is a turn, in radians and not metres.
    pub fn turns(self) -> bool {
        matches!(self, Self::Roll | Self::Pitch | Self::Yaw)
    }

    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
            Self::Roll => "roll",
            Self::Pitch => "pitch",
            Self::Yaw => "yaw",
        }
    }

    fn unit(self) -> Vector3<f64> {
        match self {
            Self::X | Self::Roll => Vector3::x(),
            Self::Y | Self::Pitch => Vector3::y(),
            Self::Z | Self::Yaw => Vector3::z(),
        }
    }
}

impl FromStr for Axis {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let axis = Self::ALL.into_iter().find(|axis| axis.name() == text);
        axis.ok_or_else(|| format!("{text}: give x, y, z, roll, pitch or yaw"))
    }
}

/// Where the hand goes instead, seen from where it should.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PoseError {
    /// The one axis that it is along, if it is.
    pub axis: Option<Axis>,
    /// Gripper's frame, metres.
    pub translation: [f64; 3],
    /// Gripper's frame, axis times angle, radians.
    pub rotation: [f64; 3],
}

impl PoseError {
    /// Along an axis, metres or radians.
    pub fn along(axis: Axis, value: f64) -> Self {
        let v = (axis.unit() * value).into();
        let (translation, rotation) = if axis.turns() { ([0.0; 3], v) } else { (v, [0.0; 3]) };
        Self { axis: Some(axis), translation, rotation }
    }

    /// A random error: direction and axis of the turn even over the sphere, length and angle even up to their ends.
    pub fn isotropic(metres: f64, radians: f64, seed: u64, number: usize) -> Self {
        let mut random = rng::stream(seed, &format!("pose error/{number}"));
        let mut vector = |most: f64| {
            let direction: [f64; 3] = UnitSphere.sample(&mut random);
            let length = most * random.random::<f64>();
            direction.map(|v| v * length)
        };
        let (translation, rotation) = (vector(metres), vector(radians));
        Self { axis: None, translation, rotation }
    }

    /// The displaced gripper in the frame of the right one.
    pub fn iso(&self) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::from(self.translation),
            UnitQuaternion::from_scaled_axis(Vector3::from(self.rotation)),
        )
    }

    /// Its length, metres, and its angle, radians.
    pub fn size(&self) -> [f64; 2] {
        [self.translation, self.rotation].map(|v| Vector3::from(v).norm())
    }

    /// The part along `axis`, metres or radians.
    pub fn value(&self, axis: Axis) -> f64 {
        let v = if axis.turns() { self.rotation } else { self.translation };
        Vector3::from(v).dot(&axis.unit())
    }
}

/// An error to be tried at each layout.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ErrorCase {
    /// The same at all.
    Fixed(PoseError),
    /// Drawn anew for each.
    Isotropic {
        /// Longest translation, metres.
        metres: f64,
        /// Largest angle, radians.
        radians: f64,
        /// Number of the draw.
        number: usize,
    },
}

impl ErrorCase {
    /// The error at the layout of a seed.
    pub fn at(&self, seed: u64) -> PoseError {
        match *self {
            Self::Fixed(error) => error,
            Self::Isotropic { metres, radians, number } => {
                PoseError::isotropic(metres, radians, seed, number)
            }
        }
    }
}

/// `samples` errors along each axis, evenly from -range to range; no error at all is one of them, once for all axes.
pub fn along_axes(axes: &[Axis], metres: f64, radians: f64, samples: u32) -> Vec<ErrorCase> {
    let none = PoseError { axis: None, translation: [0.0; 3], rotation: [0.0; 3] };
    let steps = samples.max(2) - 1;
    let moved = axes.iter().flat_map(|&axis| {
        (0..=steps).filter_map(move |k| {
            let share = 2.0 * f64::from(k) / f64::from(steps) - 1.0;
            let most = if axis.turns() { radians } else { metres };
            (share.abs() > 1e-9).then(|| ErrorCase::Fixed(PoseError::along(axis, share * most)))
        })
    });
    std::iter::once(ErrorCase::Fixed(none)).chain(moved).collect()
}

/// `samples` random errors a layout.
pub fn isotropic(metres: f64, radians: f64, samples: u32) -> Vec<ErrorCase> {
    let radians = radians.min(TAU / 2.0);
    (0..samples as usize).map(|number| ErrorCase::Isotropic { metres, radians, number }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_the_grippers() {
        let moved = PoseError::along(Axis::Y, 0.01).iso();
        assert_eq!(moved.translation.vector, Vector3::new(0.0, 0.01, 0.0));
        // A positive yaw turns the approach, x, towards y.
        let turned = PoseError::along(Axis::Yaw, 0.3).iso() * Vector3::x();
        assert!((turned - Vector3::new(0.3_f64.cos(), 0.3_f64.sin(), 0.0)).norm() < 1e-12);
        for axis in Axis::ALL {
            let error = PoseError::along(axis, -0.2);
            assert!((error.value(axis) + 0.2).abs() < 1e-12);
            assert_eq!(error.size()[usize::from(axis.turns())], 0.2);
        }
    }

    #[test]
    fn an_axis_has_its_ends_and_no_error_comes_once() {
        let cases = along_axes(&[Axis::X, Axis::Roll], 0.04, 0.5, 9);
        assert_eq!(cases.len(), 1 + 2 * 8);
        let values: Vec<f64> = cases.iter().map(|c| c.at(0).value(Axis::X)).collect();
        assert!(
            values.iter().any(|v| (v + 0.04).abs() < 1e-12)
                && values.iter().any(|v| (v - 0.04).abs() < 1e-12)
        );
        assert_eq!(cases.iter().filter(|c| c.at(0).size() == [0.0, 0.0]).count(), 1);
    }

    #[test]
    fn isotropic_errors_are_even_and_repeat() {
        let cases = isotropic(0.03, 0.5, 400);
        let errors: Vec<PoseError> = cases.iter().map(|c| c.at(7)).collect();
        assert_eq!(errors[3], cases[3].at(7));
        assert_ne!(errors[3], cases[3].at(8));
        let mean = |of: &dyn Fn(&PoseError) -> f64| errors.iter().map(of).sum::<f64>() / 400.0;
        // Lengths even from 0 to the end: mean a half, with a standard error of 0.3 / sqrt(400).
        assert!((mean(&|e| e.size()[0]) - 0.015).abs() < 0.0015);
        assert!((mean(&|e| e.size()[1]) - 0.25).abs() < 0.025);
        for axis in Axis::ALL {
            let scale = if axis.turns() { 0.5 } else { 0.03 };
            assert!(mean(&|e| e.value(axis)).abs() < 0.06 * scale, "{axis:?}");
        }
    }
}
