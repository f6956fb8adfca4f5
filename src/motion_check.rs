//! Checks afterwards, by the exact checker, that no motion that was carried out passed through table, bin or robot.

use grip_manip::collision::{CollisionChecker, Margins, Query};
use grip_manip::{BeliefScene, Planner};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Where the joints were at each control period of a trial's motions.
#[derive(Debug, Default)]
pub struct JointLog {
    /// Time, seconds, and the measured positions of all movable joints.
    samples: Vec<(f64, Vec<f64>)>,
}

/// What the check of a trial's motions found.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct MotionCheck {
    /// Configurations looked at, at most 1 ms apart.
    pub checked: usize,
    /// The first instants of collisions, at most ten.
    pub collisions: Vec<MotionCollision>,
}

/// Two bodies that met.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MotionCollision {
    /// Simulated seconds since the trial's beginning.
    pub time_s: f64,
    /// A link, and a link or fixture.
    pub bodies: String,
}

/// Configurations from one sample to the next, the latter left out: the control period is 4.2 ms.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Cli, Command};
    use crate::setup::Setup;
    use clap::Parser;

    #[test]
    fn an_arm_that_swings_through_the_table_is_found_and_one_at_rest_is_not() {
        let Command::Pack(args) = Cli::parse_from(["grip", "pack"]).command else { unreachable!() };
        let setup = Setup::load(&args.scene, &args.condition).unwrap();
        let planner = setup.planner(grip_manip::GraspAt::Best);
        let mut log = JointLog::default();
        log.push(0.0, &setup.start);
        log.push(0.1, &setup.start);
        assert_eq!(log.check(&planner, &setup.empty_belief()).collisions, []);
        // Straight ahead and down, where the table is.
        let shoulder = setup.robot.joint_index("shoulder_lift_joint").unwrap();
        let mut down = setup.start.clone();
        setup.config.arm_with_torso.iter().for_each(|&joint| down[joint] = 0.0);
        down[shoulder] = 1.0;
        log.push(0.2, &down);
        log.push(0.3, &setup.start);
        let check = log.check(&planner, &setup.empty_belief());
        assert_eq!(check.checked, 15);
        assert!(!check.collisions.is_empty());
        let hit = &check.collisions[0];
        assert!(hit.time_s > 0.1 && hit.time_s <= 0.3 && hit.bodies.contains("fixture"), "{hit:?}");
    }
}
