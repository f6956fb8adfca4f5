//! Checks afterwards, by the exact checker, that no motion that was carried out passed through table, bin or robot.

use grip_manip::collision::{CollisionBody, CollisionChecker, CollisionPair, CollisionQuery, Margins};
use grip_manip::{BeliefScene, Planner};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where the joints were at each control period of a trial's motions.
#[derive(Debug, Default)]
pub struct JointLog {
    /// Time, seconds, and the measured positions of all movable joints.
    samples: Vec<(f64, Vec<f64>)>,
}

/// What the check of a trial's motions found.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MotionCheck {
    /// Configurations looked at, at most 1 ms apart.
    pub checked: usize,
    /// Collisions.
    pub collisions: Vec<Meeting>,
    /// Fingers that physics pressed against something fixed: bodies of their own behind springs, they give way and do not pass
    /// through.
    pub finger_touches: Vec<Meeting>,
}

/// Two bodies that met for a while.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Meeting {
    /// Simulated seconds since the trial's beginning.
    pub time_s: f64,
    /// How long it lasted, seconds.
    pub seconds: f64,
    /// A link, and a link or fixture.
    pub bodies: String,
    /// How deep they were in each other, metres.
    pub depth_m: f64,
}

/// Configurations from one sample to the next, the latter left out: the control period is 4.2 ms.
const BETWEEN: usize = 5;
/// Deepest that a finger may be in something fixed and only touch it, metres: the contact solver lets pressed bodies overlap by
/// up to a millimetre, and the corners that the checker gives a finger stick out of its round ones by up to 0.7 mm.
const TOUCH_M: f64 = 0.002;
/// Nothing seen for this long ends a meeting, seconds.
const PAUSE_S: f64 = 0.05;

impl JointLog {
    /// Adds where the joints are now.
    pub fn push(&mut self, time: f64, joints: &[f64]) {
        self.samples.push((time, joints.to_vec()));
    }

    /// Holds the robot's measured motion, which is linear between two samples, against what stands in the cell, objects
    /// aside: those the physics has an eye on.
    pub fn check(&self, planner: &Planner, cell: &BeliefScene) -> MotionCheck {
        let query = CollisionQuery { held: None, allowed: &[], margins: Margins::TOUCHING };
        let pairs: Vec<_> = self.samples.windows(2).collect();
        let found: Vec<Vec<(f64, CollisionPair, f64)>> = pairs
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
                        if checker.in_collision(&q, &query).is_some() {
                            let time_s = t0 + (t1 - t0) * share;
                            let all = checker.collisions(&q, &query).into_iter();
                            found.extend(all.map(|pair| (time_s, pair, checker.depth(&q, pair))));
                        }
                    }
                }
                found
            })
            .collect();
        let robot = planner.robot();
        let checker = CollisionChecker::new(robot.clone(), cell);
        let fingers = robot.fingers.map(|joint| CollisionBody::Link(robot.model.joints()[joint].child));
        let mut check = MotionCheck { checked: BETWEEN * pairs.len(), ..MotionCheck::default() };
        for (pair, meeting) in meetings(found.into_iter().flatten()) {
            let finger = fingers.contains(&pair.a) && matches!(pair.b, CollisionBody::Fixture(_));
            let meeting = Meeting { bodies: checker.describe(pair), ..meeting };
            if finger && meeting.depth_m <= TOUCH_M {
                check.finger_touches.push(meeting);
            } else {
                check.collisions.push(meeting);
            }
        }
        check
    }
}

/// Puts instants at which pairs were found in each other together, in the order in which they began.
fn meetings(found: impl Iterator<Item = (f64, CollisionPair, f64)>) -> Vec<(CollisionPair, Meeting)> {
    let mut meetings: Vec<(CollisionPair, Meeting)> = Vec::new();
    for (time_s, pair, depth_m) in found {
        let goes_on = |(other, m): &&mut (CollisionPair, Meeting)| {
            *other == pair && time_s - (m.time_s + m.seconds) <= PAUSE_S
        };
        match meetings.iter_mut().rev().find(goes_on) {
            Some((_, meeting)) => {
                meeting.seconds = time_s - meeting.time_s;
                meeting.depth_m = meeting.depth_m.max(depth_m);
            }
            None => {
                meetings.push((pair, Meeting { time_s, seconds: 0.0, bodies: String::new(), depth_m }));
            }
        }
    }
    meetings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setup::{Setup, SetupOptions};

    #[test]
    fn an_arm_that_swings_through_the_table_is_found_and_one_at_rest_is_not() {
        let setup = Setup::load(&SetupOptions::default()).unwrap();
        let planner = setup.planner();
        let mut log = JointLog::default();
        log.push(0.0, &setup.cell.start);
        log.push(0.1, &setup.cell.start);
        assert_eq!(log.check(&planner, &setup.cell.empty_belief()).collisions, []);
        // Straight ahead and down, where the table is.
        let shoulder = setup.cell.robot.joint_index("shoulder_lift_joint").unwrap();
        let mut down = setup.cell.start.clone();
        setup.cell.config.arm_with_torso.iter().for_each(|&joint| down[joint] = 0.0);
        down[shoulder] = 1.0;
        log.push(0.2, &down);
        log.push(0.3, &setup.cell.start);
        let check = log.check(&planner, &setup.cell.empty_belief());
        assert_eq!(check.checked, 15);
        assert!(!check.collisions.is_empty());
        let hit = &check.collisions[0];
        assert!(hit.time_s > 0.1 && hit.time_s <= 0.3 && hit.bodies.contains("fixture"), "{hit:?}");
        assert!(hit.depth_m > 0.01, "{hit:?}");
    }

    #[test]
    fn instants_of_a_pair_are_one_meeting_until_a_pause() {
        let pair = |b| CollisionPair { a: CollisionBody::Link(1), b: CollisionBody::Fixture(b) };
        let found = [(1.0, 0, 0.001), (1.01, 0, 0.003), (1.01, 2, 0.004), (1.02, 0, 0.002), (1.2, 0, 0.001)];
        let met = meetings(found.into_iter().map(|(time, b, depth)| (time, pair(b), depth)));
        let met: Vec<_> = met.iter().map(|(p, m)| (*p, m.time_s, m.depth_m)).collect();
        assert_eq!(met, [(pair(0), 1.0, 0.003), (pair(2), 1.01, 0.004), (pair(0), 1.2, 0.001)]);
    }
}
