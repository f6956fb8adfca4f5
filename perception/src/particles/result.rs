//! What a search found, before it is a posterior.

use grip_sim::pose::Pose;
use nalgebra::{Isometry3, UnitQuaternion};

use crate::posterior::TracePoint;

/// A pose and how well it explains the frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ScoredPose {
    /// Camera from object, metres.
    pub pose: Isometry3<f32>,
    /// 1 is a perfect explanation.
    pub score: f32,
}

/// What a search found.
#[derive(Debug, Clone)]
pub(crate) struct SearchResult {
    /// The pose that explains the frame best.
    pub best: ScoredPose,
    /// Polished hypotheses of all restarts, with their scores at full resolution.
    pub population: Vec<ScoredPose>,
    /// Further instances.
    pub others: Vec<SearchResult>,
    /// Independent searches made,
    pub restarts: usize,
    /// and those that ended at the best one's place, itself included.
    pub agreeing: usize,
    /// Hypotheses rendered and weighed.
    pub hypotheses: usize,
    /// Confidence of the best box, 0 to 1.
    pub box_confidence: f64,
    /// The answer after each iteration of each level and restart, after each polish and after the near-symmetric poses.
    pub trace: Vec<TracePoint>,
}

/// In f64, between typed frames.
pub(crate) fn typed<From, To>(pose: &Isometry3<f32>) -> Pose<From, To> {
    let q = UnitQuaternion::from_quaternion(pose.rotation.into_inner().cast());
    Pose::new(Isometry3::from_parts(pose.translation.vector.cast::<f64>().into(), q))
}
