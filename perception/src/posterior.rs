//! What an estimator believes about one object.

use std::collections::BTreeMap;

use crate::grip::ColourVerdict;
use grip_sim::pose::{Camera, Object, Pose};
use serde::{Deserialize, Serialize};

/// One place where an object may be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mode {
    /// The best pose there.
    pub pose: Pose<Camera, Object>,
    /// The mean of the poses there, each taken in that of its equal orientations which is nearest to `pose`.
    pub mean: Pose<Camera, Object>,
    /// Sum of the weights there; over all modes 1.
    pub mass: f64,
    /// Score of `pose`.
    pub score: f64,
    /// Root mean square distance of the origins there from their mean, metres.
    pub position_std_m: f64,
    /// Spread of orientation there, radians, as [`PosePosterior::rotation_std_rad`].
    pub rotation_std_rad: f64,
}

/// The belief about one object's pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PosePosterior {
    /// The object's name.
    pub object: String,
    /// The pose that explains the frame best.
    pub best: Pose<Camera, Object>,
    /// Weighted hypotheses, best first; weights sum to 1.
    pub particles: Vec<(Pose<Camera, Object>, f64)>,
    /// Places where the object may be, that of `best` first, then by falling mass. Orientations that depth cannot tell apart
    /// (turns that keep the convex hull) are one place.
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
    /// Root mean square distance of the particles' origins from their mean, metres.
    pub position_std_m: f64,
    /// Spread of orientation, radians: root mean square change of the convex hull's support function, relative to the
    /// object's radius. Turning a can about its axis changes nothing that depth can see, and counts as no spread.
    pub rotation_std_rad: f64,
    /// Independent searches made.
    pub restarts: usize,
    /// Hypotheses rendered and weighed.
    pub hypotheses: usize,
    /// Wall time, seconds. With those of the trace the only thing that differs between equal calls.
    pub seconds: f64,
    /// What colour said where depth could not decide. None where it was not asked (see
    /// [`crate::GripSettings::colour`]) or had nothing to go by. A pose that colour chose is `best` and the first
    /// particle; weights are those of depth alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub colour: Option<ColourVerdict>,
    /// The answer after each iteration, and at last the whole one; where the settings ask for a trace, else empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub trace: Vec<TracePoint>,
}

/// What a search would have answered after one of its iterations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TracePoint {
    /// Hypotheses rendered and weighed by then.
    pub hypotheses: usize,
    /// Wall time since the object's search began, seconds; what is prepared once a frame is not in it.
    pub seconds: f64,
    /// The best pose by then.
    pub best: Pose<Camera, Object>,
}
