//! Checks afterwards, by the exact checker, that no motion that was carried out passed through table, bin or robot.

use grip_manip::collision::{CollisionChecker, Margins, Query};
use grip_manip::{BeliefScene, Planner};
use rayon::prelude::*;
use serde::Serialize;

/// Where the joints were at each control period of a trial's motions.
#[derive(Debug, Default)]
pub struct JointLog {
    /// Time, seconds, and the measured positions of all movable joints.
    samples: Vec<(f64, Vec<f64>)>,
}

/// What the check of a trial's motions found.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct MotionCheck {
    /// Configurations looked at, at most 1 ms apart.
    pub checked: usize,
    /// The first instants of collisions, at most ten.
    pub collisions: Vec<MotionCollision>,
}

/// Two bodies that met.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MotionCollision {
    /// Simulated seconds since the trial's beginning.
    pub time_s: f64,
    /// A link, and a link or fixture.
    pub bodies: String,
}

/// Configurations between two samples, both ends included once: the control period is 4.2 ms.
const BETWEEN: usize = 5;
/// Collisions that are listed.
const LISTED: usize = 10;

impl JointLog {
    /// Adds where the joints are now.
    pub fn push(&mut self, time: f64, joints: &[f64]) {
        self.samples.push((time, joints.to_vec()));
    }

    /// Holds the robot's measured motion, which is linear between two samples, against what stands in the cell, objects
    /// aside: those the physics has an eye on.
    pub fn check(&self, planner: &Planner, cell: &BeliefScene) -> MotionCheck {
        let query =
            Query { held: None, allowed: &[], margins: Margins { world: 0.0, own: 0.0, spread: 0.0 } };
        let pairs: Vec<_> = self.samples.windows(2).collect();
        let found: Vec<Vec<MotionCollision>> = pairs
            .par_chunks(512)
            .map(|chunk| {
                let checker = CollisionChecker::new(planner.robot().clone(), cell);
                let mut q = Vec::new();
                let mut found = Vec::new();
                for pair in chunk {
                    let ((t0, a), (t1, b)) = (&pair[0], &pair[1]);
                    for k in 0..BETWEEN {
                        let share = k as f64 / BETWEEN as f64;
                        q.clear();
                        q.extend(a.iter().zip(b).map(|(a, b)| a + (b - a) * share));
                        if let Some(pair) = checker.in_collision(&q, &query) {
                            let time_s = t0 + (t1 - t0) * share;
                            found.push(MotionCollision { time_s, bodies: checker.describe(pair) });
                        }
                    }
                }
                found
            })
            .collect();
        let collisions = found.into_iter().flatten().take(LISTED).collect();
        MotionCheck { checked: BETWEEN * pairs.len(), collisions }
    }
}
