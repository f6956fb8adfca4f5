//! Pairs of links that may touch, found by sampling as MoveIt's setup assistant finds them: a pair is of no use to collision checks
//! when it is in collision in every configuration, when it is in the robot's neutral one, or when it is in none of many.

use nalgebra::Isometry3;
use parry3d::math::Pose;
use parry3d::query::intersection_test;
use parry3d::shape::SharedShape;
use rand::RngExt;

use super::RobotModel;
use crate::convert;
use crate::rng;

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

/// Solids of a robot's links, and which pairs of links could touch.
struct Solids {
    links: Vec<Vec<(Pose, SharedShape)>>,
    pairs: Vec<(usize, usize)>,
}

impl Solids {
    fn new(robot: &RobotModel) -> Self {
        let links: Vec<Vec<_>> = robot
            .links()
            .iter()
            .map(|link| link.collisions.iter().filter_map(convert::solid).collect())
            .collect();
        let adjacent = robot.adjacent_pairs();
        let pairs = (0..links.len())
            .flat_map(|a| (a + 1..links.len()).map(move |b| (a, b)))
            .filter(|&(a, b)| !links[a].is_empty() && !links[b].is_empty())
            .filter(|pair| adjacent.binary_search(pair).is_err())
            .collect();
        Self { links, pairs }
    }

    fn touch(&self, poses: &[Isometry3<f64>], (a, b): (usize, usize)) -> bool {
        let [at_a, at_b] = [a, b].map(|link| convert::pose(&poses[link]));
        self.links[a].iter().any(|(place, solid)| {
            self.links[b].iter().any(|(other_place, other)| {
                intersection_test(&(at_a * *place), &**solid, &(at_b * *other_place), &**other)
                    .is_ok_and(|hit| hit.intersecting)
            })
        })
    }
}

/// The first pair of links that touch with links at `poses` and are not next to each other in the tree.
pub(super) fn touching(robot: &RobotModel, poses: &[Isometry3<f64>]) -> Option<(usize, usize)> {
    let solids = Solids::new(robot);
    solids.pairs.iter().copied().find(|&pair| solids.touch(poses, pair))
}

/// The pairs of `robot` that need not be checked, beside those that are adjacent. The same ones every time.
pub fn sampled(robot: &RobotModel) -> Vec<FreePair> {
    let solids = Solids::new(robot);
    let mut poses = robot.fk(&robot.neutral());
    let neutral: Vec<bool> = solids.pairs.iter().map(|&pair| solids.touch(&poses, pair)).collect();
    let mut counts = vec![0_usize; solids.pairs.len()];
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
        for (&pair, count) in solids.pairs.iter().zip(&mut counts) {
            *count += usize::from(solids.touch(&poses, pair));
        }
    }
    let found = solids.pairs.iter().zip(counts).zip(neutral);
    found
        .filter_map(|((&links, count), neutral)| {
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
