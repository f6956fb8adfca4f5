//! Inverse kinematics of the gripper with many seeds: collision checked, near the present configuration, away from
//! limits, deterministic.
//!
//! One descent of [`RobotModel::solve_ik`](grip_sim::robot::RobotModel::solve_ik) may end in a local minimum. The seeds are the present configuration and those
//! of a table of random, self-collision free configurations whose gripper poses lie nearest to the target.

use std::sync::Arc;

use grip_sim::robot::{IkRequest, RobotConfig};
use nalgebra::Isometry3;

use super::joint_space::{Axis, JointSpace};
use crate::collision::RobotSolids;

/// Tolerance of a solution, metres: far below what matters for a grasp, loose enough for a few iterations.
const POSITION_TOL: f64 = 2e-4;
/// Radians of rotation for a metre of position tolerance.
const ROTATION_TOL: f64 = 5.0;
/// Metres that a radian of rotation error counts when seeds are compared with the target: about the wrist's length.
const RADIAN: f64 = 0.25;
/// Size of the seed table.
const TABLE: usize = 6000;

/// A configuration of the group and where it puts the gripper.
#[derive(Debug)]
struct Entry {
    base_from_gripper: Isometry3<f64>,
    group: Vec<f64>,
}

/// The inverse kinematics of a robot's arm with torso.
#[derive(Debug)]
pub struct IkSolver {
    robot: Arc<RobotSolids>,
    joints: Vec<usize>,
    /// Planning speed of each joint, per second.
    speeds: Vec<f64>,
    table: Vec<Entry>,
}

impl IkSolver {
    /// Prepares the seed table for the joints `joints` of the robot (from a fixed stream: the same on every run).
    pub fn new(robot: Arc<RobotSolids>, config: &RobotConfig) -> Self {
        let joints = config.arm_with_torso.clone();
        let speeds = joints.iter().map(|&j| config.limits[j].velocity.max(1e-3)).collect();
        let mut solver = Self { robot, joints, speeds, table: Vec::new() };
        let space = solver.space(0.0);
        let mut rng = grip_sim::rng::stream(0, "ik seed table");
        let mut q = solver.robot.model.neutral();
        for _ in 0..20 * TABLE {
            if solver.table.len() == TABLE {
                break;
            }
            let group = space.sample(&mut rng);
            solver.scatter(&group, &mut q);
            let base_from_gripper = solver.robot.model.fk_link(&q, solver.robot.gripper);
            let at = base_from_gripper.translation.vector;
            let within = |[low, high]: [[f64; 3]; 2]| (0..3).all(|i| low[i] < at[i] && at[i] < high[i]);
            if config.workspace.is_none_or(within) {
                solver.table.push(Entry { base_from_gripper, group });
            }
        }
        solver
    }

    /// The joints of the group, indices into the robot's movable joints.
    pub fn joints(&self) -> &[usize] {
        &self.joints
    }

    /// The robot.
    pub fn robot(&self) -> &Arc<RobotSolids> {
        &self.robot
    }

    /// The group's joint space; `held` is the extent of a held object from the gripper link, metres.
    pub fn space(&self, held: f64) -> JointSpace {
        let reach = self.robot.reach(&self.joints, held);
        JointSpace::new(
            self.joints
                .iter()
                .zip(reach)
                .map(|(&j, reach)| {
                    let limits = self.robot.model.joints()[j].limits;
                    Axis {
                        lower: limits.lower,
                        upper: limits.upper,
                        wraps: !limits.lower.is_finite() || !limits.upper.is_finite(),
                        reach,
                    }
                })
                .collect(),
        )
    }

    /// The group's part of a whole configuration.
    pub fn gather(&self, q: &[f64]) -> Vec<f64> {
        self.joints.iter().map(|&j| q[j]).collect()
    }

    /// Writes the group's part into a whole configuration.
    pub fn scatter(&self, group: &[f64], q: &mut [f64]) {
        for (&j, v) in self.joints.iter().zip(group) {
            q[j] = *v;
        }
    }

    /// One descent from `q` (whole configuration) to `base_from_gripper`, to `position_tol` metres.
    pub fn descend(
        &self,
        q: &[f64],
        base_from_gripper: &Isometry3<f64>,
        max_iterations: usize,
        position_tol: f64,
    ) -> Option<Vec<f64>> {
        self.robot.model.solve_ik(IkRequest {
            link: self.robot.gripper,
            target: *base_from_gripper,
            joints: &self.joints,
            seed: q,
            position_tol,
            rotation_tol: position_tol * ROTATION_TOL,
            max_iterations,
        })
    }

    /// Up to `wanted` different solutions that `accept` takes, whole configurations, best first by [`IkSolver::cost`].
    ///
    /// Descends from `q_now` and from the `seeds` nearest entries of the table; joints outside the group keep the
    /// values of `q_now`.
    pub fn solutions(
        &self,
        base_from_gripper: &Isometry3<f64>,
        q_now: &[f64],
        seeds: usize,
        wanted: usize,
        mut accept: impl FnMut(&[f64]) -> bool,
    ) -> Vec<Vec<f64>> {
        let space = self.space(0.0);
        let mut found: Vec<(f64, Vec<f64>)> = Vec::new();
        let mut seed = q_now.to_vec();
        let nearest = self.nearest(base_from_gripper, seeds);
        for i in 0..=nearest.len() {
            if found.len() >= wanted {
                break;
            }
            if i > 0 {
                self.scatter(&nearest[i - 1].group, &mut seed);
            }
            let Some(mut q) = self.descend(&seed, base_from_gripper, 30, POSITION_TOL) else {
                continue;
            };
            let group = space.unwrap_near(&self.gather(q_now), &self.gather(&q));
            self.scatter(&group, &mut q);
            let known = found.iter().any(|(_, other)| space.distance(&self.gather(other), &group) < 0.05);
            if !known && accept(&q) {
                found.push((self.cost(&space, q_now, &group), q));
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.into_iter().map(|(_, q)| q).collect()
    }

    /// Seconds that the slowest joint takes from the present configuration (the Fetch's torso is slow), a fifth of the
    /// others', and a penalty for joints in the outer tenth of their range.
    pub fn cost(&self, space: &JointSpace, q_now: &[f64], group: &[f64]) -> f64 {
        let near_limits: f64 = space
            .axes()
            .iter()
            .zip(group)
            .filter(|(axis, _)| !axis.wraps)
            .map(|(axis, v)| {
                let range = (axis.upper - axis.lower).max(1e-6);
                let inside = (v - axis.lower).min(axis.upper - v) / range;
                (1.0 - inside / 0.1).max(0.0)
            })
            .sum();
        let times: Vec<f64> = space
            .difference(&self.gather(q_now), group)
            .iter()
            .zip(&self.speeds)
            .map(|(d, v)| d.abs() / v)
            .collect();
        let slowest = times.iter().copied().fold(0.0, f64::max);
        slowest + 0.2 * (times.iter().sum::<f64>() - slowest) + near_limits
    }

    fn nearest(&self, target: &Isometry3<f64>, count: usize) -> Vec<&Entry> {
        let mut scored: Vec<(f64, usize)> = self
            .table
            .iter()
            .enumerate()
            .map(|(i, entry)| {
                let pose = &entry.base_from_gripper;
                let position = (pose.translation.vector - target.translation.vector).norm();
                let dot = pose.rotation.coords.dot(&target.rotation.coords).abs().min(1.0);
                (position + RADIAN * 2.0 * dot.acos(), i)
            })
            .collect();
        let count = count.min(scored.len());
        if count > 0 && count < scored.len() {
            scored.select_nth_unstable_by(count, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        }
        scored.truncate(count);
        scored.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        scored.iter().map(|&(_, i)| &self.table[i]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::fetch;
    use proptest::prelude::*;
    use std::sync::OnceLock;

    fn solver() -> &'static IkSolver {
        static SOLVER: OnceLock<IkSolver> = OnceLock::new();
        SOLVER.get_or_init(|| {
            let (model, config) = fetch();
            IkSolver::new(Arc::new(RobotSolids::new(model, &config)), &config)
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn every_solution_reproduces_the_pose_within_the_limits(seed in any::<u64>()) {
            let solver = solver();
            let robot = solver.robot();
            let space = solver.space(0.0);
            let mut q = robot.model.neutral();
            solver.scatter(&space.sample(&mut grip_sim::rng::stream(seed, "ik")), &mut q);
            let target = robot.model.fk_link(&q, robot.gripper);
            let found = solver.solutions(&target, &q, 8, 4, |_| true);
            prop_assert!(!found.is_empty(), "there is one at least");
            for other in &found {
                let pose = robot.model.fk_link(other, robot.gripper);
                let off = (pose.translation.vector - target.translation.vector).norm();
                let turned = pose.rotation.angle_to(&target.rotation);
                // The descent returns the iterate of least error in all, metres and radians alike; the one that met both
                // tolerances may be another.
                let most = POSITION_TOL.hypot(POSITION_TOL * ROTATION_TOL);
                prop_assert!(off.hypot(turned) <= most + 1e-9, "{off} m, {turned} rad");
                prop_assert!(space.within_limits(&solver.gather(other)));
            }
        }
    }
}
