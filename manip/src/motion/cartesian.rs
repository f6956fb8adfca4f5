//! Straight motions of the gripper by continuation: each step solves the inverse kinematics from the one before.

use nalgebra::{Isometry3, Translation3};

use super::ik::IkSolver;
use crate::collision::CollisionPair;

/// Metres (and radians, by quarter metre) between solutions.
const STEP: f64 = 0.005;
/// A joint that moves more than this in one step has jumped to another branch of solutions, radians or metres.
const JUMP: f64 = 0.25;

/// Tolerance of the solutions, metres: tight, so that the path does not jitter and can be driven fast.
const SMOOTH: f64 = 1e-6;

/// The same where nothing is driven along it, metres.
const LOOSE: f64 = 1e-3;

/// A straight motion: whole configurations, evenly spaced along the line.
#[derive(Debug, Clone)]
pub struct CartesianPath {
    /// From the start on, the start included.
    pub waypoints: Vec<Vec<f64>>,
    /// Metres that the gripper moves between waypoints.
    pub step: f64,
}

impl CartesianPath {
    /// Where it ends.
    pub fn end(&self) -> &[f64] {
        &self.waypoints[self.waypoints.len() - 1]
    }

    /// The same motion backwards.
    pub fn reversed(&self) -> Self {
        Self { waypoints: self.waypoints.iter().rev().cloned().collect(), step: self.step }
    }

    /// Length of the gripper's way, metres.
    pub fn length(&self) -> f64 {
        self.step * (self.waypoints.len() - 1) as f64
    }
}

/// Why a straight motion does not exist.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CartesianFailure {
    /// Out of reach.
    NoIk,
    /// Only with a jump of a joint.
    Jump,
    /// Something is in the way.
    Collision(CollisionPair),
}

/// Moves the gripper from `q` (whole configuration) straight to `base_from_goal`, turning evenly on the way.
///
/// `check` is asked at every step, with the metres gone, for a pair in collision.
pub fn straight_line(
    solver: &IkSolver,
    q: &[f64],
    base_from_goal: &Isometry3<f64>,
    mut check: impl FnMut(f64, &[f64]) -> Option<CollisionPair>,
) -> Result<CartesianPath, CartesianFailure> {
    let robot = solver.robot();
    let start = robot.model.fk_link(q, robot.gripper);
    let length = (base_from_goal.translation.vector - start.translation.vector).norm();
    let turn = start.rotation.angle_to(&base_from_goal.rotation);
    let n = ((length.max(0.25 * turn) / STEP).ceil() as usize).max(1);
    let target = |t: f64| {
        let position = start.translation.vector.lerp(&base_from_goal.translation.vector, t);
        let rotation =
            start.rotation.try_slerp(&base_from_goal.rotation, t, 1e-6).unwrap_or(base_from_goal.rotation);
        Isometry3::from_parts(Translation3::from(position), rotation)
    };
    let (waypoints, failure) = follow(solver, q, n, (SMOOTH, JUMP), target, |t, q| check(t * length, q));
    match failure {
        Some(failure) => Err(failure),
        None => Ok(CartesianPath { waypoints, step: length / n as f64 }),
    }
}

/// `q` and what follows it at `n` shares of a motion of the gripper, each solved from the one before to `tolerance` metres, as
/// far as that succeeds, no joint moves by more than `jump` and `check` finds no pair in collision.
fn follow(
    solver: &IkSolver,
    q: &[f64],
    n: usize,
    (tolerance, jump): (f64, f64),
    target: impl Fn(f64) -> Isometry3<f64>,
    mut check: impl FnMut(f64, &[f64]) -> Option<CollisionPair>,
) -> (Vec<Vec<f64>>, Option<CartesianFailure>) {
    let mut waypoints = vec![q.to_vec()];
    for k in 1..=n {
        let t = k as f64 / n as f64;
        let last = &waypoints[k - 1];
        let Some(next) = solver.descend(last, &target(t), 16, tolerance) else {
            return (waypoints, Some(CartesianFailure::NoIk));
        };
        if last.iter().zip(&next).any(|(a, b)| (a - b).abs() > jump) {
            return (waypoints, Some(CartesianFailure::Jump));
        }
        if let Some(pair) = check(t, &next) {
            return (waypoints, Some(CartesianFailure::Collision(pair)));
        }
        waypoints.push(next);
    }
    (waypoints, None)
}

/// The hand moved from `q` (whole configuration) along a displacement in the base frame, orientation kept, every `step`
/// metres as far as `check` finds no pair in collision and no joint jumps; `q` itself comes first.
pub fn glide(
    solver: &IkSolver,
    q: &[f64],
    displacement: &nalgebra::Vector3<f64>,
    step: f64,
    mut check: impl FnMut(&[f64]) -> Option<CollisionPair>,
) -> Vec<Vec<f64>> {
    let robot = solver.robot();
    let start = robot.model.fk_link(q, robot.gripper);
    let n = (displacement.norm() / step).ceil().max(1.0) as usize;
    let target = |t: f64| Translation3::from(displacement * t) * start;
    follow(solver, q, n, (LOOSE, 2.0 * JUMP), target, |_, q| check(q)).0
}

/// [`straight_line`] along a displacement in the base frame, orientation kept.
pub fn translate(
    solver: &IkSolver,
    q: &[f64],
    displacement: nalgebra::Vector3<f64>,
    check: impl FnMut(f64, &[f64]) -> Option<CollisionPair>,
) -> Result<CartesianPath, CartesianFailure> {
    let robot = solver.robot();
    let mut goal = robot.model.fk_link(q, robot.gripper);
    goal.translation.vector += displacement;
    straight_line(solver, q, &goal, check)
}
