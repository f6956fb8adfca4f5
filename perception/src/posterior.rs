//! What an estimator believes about one object.

use std::collections::BTreeMap;

use grip_sim::pose::{Camera, Object, Pose};
use nalgebra::{Isometry3, Matrix6, UnitQuaternion, Vector6};
use rand::Rng;
use rand_distr::{Distribution, Gamma, StandardNormal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One place where an object may be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mode {
    /// The best pose there, about which it may be off by `covariance`.
    pub pose: Pose<Camera, Object>,
    /// Sum of the weights there; over all modes 1.
    pub mass: f64,
    /// Score of `pose`.
    pub score: f64,
    /// Covariance of position (metres) and of the rotation vector about the object's origin (radians), both along the camera's
    /// optical axes: a pose of this mode has its origin at that of `pose` plus the first three, and the orientation of `pose`
    /// turned by the last three.
    pub covariance: [[f64; 6]; 6],
    /// The distribution is Student's t of so many degrees of freedom, more than 2; normal where there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degrees_of_freedom: Option<f64>,
    /// Square root of the trace of its first half: root mean square distance of the origins there, metres.
    pub position_std_m: f64,
    /// Square root of the trace of its second half, radians.
    pub rotation_std_rad: f64,
    /// Root mean square of the depth image's errors there that do not average out within 16 pixels, metres. None where too little
    /// is seen of the object, and of the paper's filter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_m: Option<f64>,
}

impl Mode {
    /// A mode of this mass and score.
    pub(crate) fn new(pose: Pose<Camera, Object>, mass: f64, score: f64, covariance: &Matrix6<f64>) -> Self {
        let spread = |first: usize| (first..first + 3).map(|i| covariance[(i, i)]).sum::<f64>().sqrt();
        Self {
            pose,
            mass,
            score,
            covariance: std::array::from_fn(|i| std::array::from_fn(|j| covariance[(i, j)])),
            position_std_m: spread(0),
            rotation_std_rad: spread(3),
            degrees_of_freedom: None,
            noise_m: None,
        }
    }

    /// A displacement by chance; `root` is what [`Mode::root`] gives.
    pub(crate) fn drawn(&self, root: &Matrix6<f64>, rng: &mut impl Rng) -> Vector6<f64> {
        let by = root * Vector6::from_fn(|_, _| StandardNormal.sample(rng));
        // A t distribution is a normal one of a scale by chance: inverse gamma, here with mean 1.
        let dof = self.degrees_of_freedom.filter(|dof| *dof > 2.0);
        let scale = dof.and_then(|dof| {
            let gamma: f64 = Gamma::new(dof / 2.0, 1.0).ok()?.sample(rng);
            Some(((dof - 2.0) / (2.0 * gamma)).sqrt())
        });
        by * scale.unwrap_or(1.0)
    }

    /// The covariance's Cholesky factor; zero where it has none.
    pub(crate) fn root(&self) -> Matrix6<f64> {
        self.covariance().cholesky().map_or_else(Matrix6::zeros, |c| c.l())
    }

    /// [`Mode::covariance`] as a matrix.
    pub fn covariance(&self) -> Matrix6<f64> {
        Matrix6::from_fn(|i, j| self.covariance[i][j])
    }

    /// The pose that is off by this, position and rotation vector.
    pub fn displaced(&self, by: &Vector6<f64>) -> Pose<Camera, Object> {
        let turn = UnitQuaternion::from_scaled_axis(by.fixed_rows::<3>(3).into_owned());
        let position = self.pose.iso().translation.vector + by.fixed_rows::<3>(0);
        Pose::new(Isometry3::from_parts(position.into(), turn * self.pose.iso().rotation))
    }

    /// How far `pose` is off from that of the mode, position and rotation vector: what [`Mode::displaced`] undoes.
    pub fn displacement(&self, pose: &Pose<Camera, Object>) -> Vector6<f64> {
        let (own, other) = (self.pose.iso(), pose.iso());
        let shift = other.translation.vector - own.translation.vector;
        let turn = (other.rotation * own.rotation.inverse()).scaled_axis();
        Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
    }
}

/// The belief about one object's pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PosePosterior {
    /// The object's name.
    pub object: String,
    /// The pose that explains the frame best.
    pub best: Pose<Camera, Object>,
    /// Weighted poses that stand for the belief, `best` first; weights sum to 1. Drawn from `modes` (the paper's filter: its
    /// samples).
    pub particles: Vec<(Pose<Camera, Object>, f64)>,
    /// Places where the object may be, that of `best` first, then by falling mass. Turns about the axis of a body of revolution are
    /// one place (the paper's filter: all turns that keep the convex hull). As far as `best` is not believed there is a wide one
    /// about it.
    pub modes: Vec<Mode>,
    /// Entropy of the modes' masses, nats: 0 for a single place.
    pub entropy: f64,
    /// How well `best` explains the frame: 1 is perfect, about 0.5 is what an absent object finds by chance.
    pub score: f64,
    /// Probability-like, 0 to 1: that the object is in view and `best` is its pose. Grows with the score and with
    /// independent restarts that ended in the same place.
    pub confidence: f64,
    /// The verdict: whether the object is in view at all, that is, whether the confidence is 0.5 or more.
    pub there: bool,
    /// What each term of the score gives to that of `best`, by the term's name; they sum to the score.
    #[serde(default)]
    pub terms: BTreeMap<String, f64>,
    /// Root mean square distance of the object's origin from its mean, over all of `modes` but the wide one, metres. Infinite, and
    /// `null` in JSON, where nothing was found.
    #[serde(with = "or_infinite")]
    #[schemars(with = "Option<f64>")]
    pub position_std_m: f64,
    /// That of the first of `modes`, radians; turns about the axis of a body of revolution, which nothing shows, are in it.
    /// Infinite, and `null` in JSON, where nothing was found.
    #[serde(with = "or_infinite")]
    #[schemars(with = "Option<f64>")]
    pub rotation_std_rad: f64,
    /// Independent searches made.
    pub restarts: usize,
    /// Hypotheses rendered and weighed.
    pub hypotheses: usize,
    /// Frames before this one in which it was believed to be there, one after the other; 0 of a single frame.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub followed: usize,
    /// Wall time, seconds. With those of the trace the only thing that differs between equal calls.
    pub seconds: f64,
    /// What colour said where depth could not decide. None where it was not asked (see
    /// [`crate::ColourSettings`]) or had nothing to go by.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub colour: Option<ColourVerdict>,
    /// The answer after each iteration, and at last the whole one; where the settings ask for a trace, else empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub trace: Vec<TracePoint>,
}

impl PosePosterior {
    /// The belief of who knows: one pose, no doubt.
    pub fn certain(object: &str, best: Pose<Camera, Object>) -> Self {
        let mode = Mode::new(best, 1.0, 1.0, &Matrix6::zeros());
        Self {
            object: object.to_string(),
            best,
            particles: vec![(best, 1.0)],
            modes: vec![mode],
            entropy: 0.0,
            score: 1.0,
            confidence: 1.0,
            there: true,
            terms: BTreeMap::new(),
            position_std_m: 0.0,
            rotation_std_rad: 0.0,
            restarts: 0,
            hypotheses: 0,
            followed: 0,
            seconds: 0.0,
            colour: None,
            trace: Vec::new(),
        }
    }

    /// Mass of the likeliest place beside that of the best pose; 0 where there is none. (The wide mode is no place.)
    pub fn doubt(&self) -> f64 {
        let others = self.modes.iter().skip(1).filter(|mode| mode.pose != self.best);
        others.map(|mode| mode.mass).fold(0.0, f64::max)
    }

    /// The same as seen by a camera that has moved; `to_from_here` is the new camera's frame from this one.
    #[must_use]
    pub fn seen_from(&self, to_from_here: &Pose<Camera, Camera>) -> Self {
        let turn = to_from_here.iso().rotation.to_rotation_matrix();
        let mut both = Matrix6::zeros();
        both.fixed_view_mut::<3, 3>(0, 0).copy_from(turn.matrix());
        both.fixed_view_mut::<3, 3>(3, 3).copy_from(turn.matrix());
        let mode = |mode: &Mode| {
            let covariance = both * mode.covariance() * both.transpose();
            Mode {
                pose: *to_from_here * mode.pose,
                covariance: std::array::from_fn(|i| std::array::from_fn(|j| covariance[(i, j)])),
                ..mode.clone()
            }
        };
        Self {
            best: *to_from_here * self.best,
            particles: self.particles.iter().map(|(pose, w)| (*to_from_here * *pose, *w)).collect(),
            modes: self.modes.iter().map(mode).collect(),
            ..self.clone()
        }
    }
}

/// What colour had to say about a pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ColourVerdict {
    /// Poses compared with the one that depth prefers.
    pub candidates: usize,
    /// How the print at the best of them agrees with the picture in structure: the mean of six correlations, of brightness and
    /// of colour, in small and in larger cells and over the whole object; -1 to 1.
    pub agreement: f64,
    /// How much better that is than the agreement of the pose that depth prefers.
    pub gain: f64,
    /// Whether the pose was left as depth has it: also where geometry refused the winner, and where a small turn explains the
    /// picture as well.
    pub abstained: bool,
}

/// What a search would have answered after one of its iterations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TracePoint {
    /// Hypotheses rendered and weighed by then.
    pub hypotheses: usize,
    /// Wall time since the object's search began, seconds; what is prepared once a frame is not in it.
    pub seconds: f64,
    /// The best pose by then.
    pub best: Pose<Camera, Object>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "as serde has it")]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// A number that may be infinite: JSON has none, so `null` stands for it.
mod or_infinite {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        value.is_finite().then_some(*value).serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_posterior_that_knows_nothing_is_read_back_from_json() {
        let nothing = PosePosterior {
            position_std_m: f64::INFINITY,
            rotation_std_rad: f64::INFINITY,
            ..PosePosterior::certain("can", Pose::identity())
        };
        let text = serde_json::to_string(&nothing).unwrap();
        assert!(text.contains("\"position_std_m\":null"), "{text}");
        assert_eq!(serde_json::from_str::<PosePosterior>(&text).unwrap(), nothing);
        let certain = PosePosterior::certain("can", Pose::identity());
        let text = serde_json::to_string(&certain).unwrap();
        assert_eq!(serde_json::from_str::<PosePosterior>(&text).unwrap(), certain);
    }

    #[test]
    fn a_moved_camera_sees_the_same_belief() {
        let pose = Pose::from_xyz_rpy([0.1, 0.2, 0.9], [0.3, -0.2, 0.5]);
        let covariance = Matrix6::from_diagonal(&Vector6::new(1e-6, 4e-6, 9e-6, 1e-4, 4e-4, 9e-4));
        let posterior = PosePosterior {
            modes: vec![Mode::new(pose, 1.0, 0.7, &covariance)],
            ..PosePosterior::certain("can", pose)
        };
        // A quarter turn about the optical axis swaps what was along x and y.
        let by =
            Pose::<Camera, Camera>::from_xyz_rpy([0.0, 0.0, 0.1], [0.0, 0.0, std::f64::consts::FRAC_PI_2]);
        let seen = posterior.seen_from(&by);
        let diagonal = seen.modes[0].covariance().diagonal();
        assert!((diagonal - Vector6::new(4e-6, 1e-6, 9e-6, 4e-4, 1e-4, 9e-4)).norm() < 1e-12, "{diagonal}");
        assert!((seen.best.translation() - nalgebra::Vector3::new(-0.2, 0.1, 1.0)).norm() < 1e-12);
        // A displacement is as likely from there: turned with it.
        let off = posterior.modes[0].displaced(&Vector6::new(1e-3, 0.0, 0.0, 0.0, 0.02, 0.0));
        let there = seen.modes[0].displacement(&(by * off));
        assert!((there - Vector6::new(0.0, 1e-3, 0.0, -0.02, 0.0, 0.0)).norm() < 1e-9, "{there}");
        let back = seen.seen_from(&by.inverse());
        assert!((back.best.translation() - pose.translation()).norm() < 1e-12);
    }
}
