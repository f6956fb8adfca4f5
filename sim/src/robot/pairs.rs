//! Pairs of links that may touch, found by sampling as MoveIt's setup assistant finds them: a pair is of no use to collision checks
//! when it is in collision in every configuration, when it is in the robot's neutral one, or when it is in none of many.

use parry3d::query::intersection_test;
use parry3d::shape::SharedShape;

use super::RobotModel;
use crate::convert;
use crate::rng;
use rand::RngExt;

/// Configurations that are tried.
pub const SAMPLES: usize = 10_000;
/// A share of the samples from which on a pair always touches.
const ALWAYS: f64 = 0.95;

/// Why a pair of links need not be checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// They touch in nearly every configuration.
    Always,
    /// They touch with every joint at zero, or at its limit nearest to zero.
    Neutral,
    /// They touch in none of the configurations tried.
    Never,
}

impl std::fmt::Display for Reason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Always => "always touch",
            Self::Neutral => "touch with all joints at zero",
            Self::Never => "never touch",
        })
    }
}

/// A pair of links that need not be checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FreePair {
    /// Indices of the links, the lower first.
    pub links: (usize, usize),
    /// Why.
    pub reason: Reason,
}

/// The pairs of `robot` that need not be checked, beside those that are adjacent. The same ones every time.
pub fn sampled(robot: &RobotModel) -> Vec<FreePair> {
    let solids: Vec<Vec<(parry3d::math::Pose, SharedShape)>> = robot
        .links()
        .iter()
        .map(|link| link.collisions.iter().filter_map(convert::solid).collect())
        .collect();
    let adjacent = robot.adjacent_pairs();
    let mut pairs: Vec<((usize, usize), usize, bool)> = (0..solids.len())
        .flat_map(|a| (a + 1..solids.len()).map(move |b| (a, b)))
        .filter(|&(a, b)| !solids[a].is_empty() && !solids[b].is_empty())
        .filter(|pair| adjacent.binary_search(pair).is_err())
        .map(|pair| (pair, 0, false))
        .collect();
    let touch = |poses: &[nalgebra::Isometry3<f64>], (a, b): (usize, usize)| {
        let [at_a, at_b] = [a, b].map(|link| convert::pose(&poses[link]));
        solids[a].iter().any(|(place, solid)| {
            solids[b].iter().any(|(other_place, other)| {
                intersection_test(&(at_a * *place), &**solid, &(at_b * *other_place), &**other)
                    .is_ok_and(|hit| hit.intersecting)
            })
        })
    };
    let mut poses = robot.fk(&robot.neutral());
    for (pair, _, neutral) in &mut pairs {
        *neutral = touch(&poses, *pair);
    }
    let mut random = rng::stream(0, "pairs that may touch");
    for _ in 0..SAMPLES {
        let q: Vec<f64> = robot
            .joints()
            .iter()
            .map(|joint| {
                let turn = std::f64::consts::PI;
                let (low, high) = (joint.limits.lower.max(-turn), joint.limits.upper.min(turn));
                low + (high - low) * random.random::<f64>()
            })
            .collect();
        robot.fk_into(&q, &mut poses);
        for (pair, count, _) in &mut pairs {
            *count += usize::from(touch(&poses, *pair));
        }
    }
    pairs
        .into_iter()
        .filter_map(|(links, count, neutral)| {
            let reason = if count as f64 >= ALWAYS * SAMPLES as f64 {
                Reason::Always
            } else if neutral {
                Reason::Neutral
            } else if count == 0 {
                Reason::Never
            } else {
                return None;
            };
            Some(FreePair { links, reason })
        })
        .collect()
}
