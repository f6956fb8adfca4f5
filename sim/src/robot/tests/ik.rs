//! Inverse kinematics finds what exists, says when it does not, and does no worse than `k`.

use k::InverseKinematicsSolver as _;
use nalgebra::{Isometry3, Translation3};
use rand::RngExt;

use super::super::{IkRequest, JointKind, RobotModel};
use super::k_chain::{serial_chain, to_k};
use super::{FETCH, random_configuration};
use crate::rng;

fn request<'a>(link: usize, target: Isometry3<f64>, joints: &'a [usize], seed: &'a [f64]) -> IkRequest<'a> {
    IkRequest { link, target, joints, seed, position_tol: 1e-4, rotation_tol: 1e-3, max_iterations: 100 }
}

/// Every joint off by up to `range`, within limits.
fn shaken(robot: &RobotModel, q: &[f64], range: f64, rng: &mut impl rand::Rng) -> Vec<f64> {
    robot
        .joints()
        .iter()
        .zip(q)
        .map(|(joint, &value)| joint.limits.clamp(value + rng.random_range(-range..range)))
        .collect()
}

#[test]
fn solutions_reach_the_target_within_limits_and_leave_other_joints_alone() {
    let (robot, config) = &*FETCH;
    let link = config.gripper.link;
    let mut rng = rng::stream(11, "ik");
    let mut solved = 0;
    for round in 0..200 {
        let joints = if round % 2 == 0 { &config.arm } else { &config.arm_with_torso };
        let truth = random_configuration(robot, &mut rng);
        let mut seed = shaken(robot, &truth, 0.5, &mut rng);
        for joint in 0..seed.len() {
            if !joints.contains(&joint) {
                seed[joint] = truth[joint];
            }
        }
        let target = robot.fk_link(&truth, link);
        let Some(q) = robot.solve_ik(request(link, target, joints, &seed)) else {
            continue;
        };
        solved += 1;
        let reached = robot.fk_link(&q, link);
        assert!((reached.translation.vector - target.translation.vector).norm() <= 1e-4);
        assert!(reached.rotation.angle_to(&target.rotation) <= 1e-3 + 1e-9);
        assert_eq!(robot.problem_with(&q, 0.0), None);
        for (joint, (&value, &start)) in q.iter().zip(&seed).enumerate() {
            assert!(joints.contains(&joint) || value == start);
            if robot.joints()[joint].kind == JointKind::Continuous {
                assert!((value - start).abs() <= std::f64::consts::PI + 1e-9);
            }
        }
    }
    assert!(solved >= 195, "{solved} of 200");
}

#[test]
fn solves_at_least_as_many_targets_as_the_k_crate() {
    let (robot, config) = &*FETCH;
    let link = config.gripper.link;
    let chain = serial_chain(robot, link);
    let solver = k::JacobianIkSolver::new(1e-4, 1e-3, 0.5, 100);
    let mut rng = rng::stream(12, "ik");
    let (mut ours, mut theirs) = (0, 0);
    // From near seeds to seeds that have nothing to do with the target.
    for range in [0.2, 0.8, 3.0] {
        for _ in 0..60 {
            let truth = random_configuration(robot, &mut rng);
            let seed = shaken(robot, &truth, range, &mut rng);
            let target = robot.fk_link(&truth, link);
            let found = robot.solve_ik(request(link, target, &config.arm_with_torso, &seed));
            ours += usize::from(found.is_some());
            let start: Vec<f64> = config.arm_with_torso.iter().map(|&j| seed[j]).collect();
            chain.set_joint_positions(&start).unwrap();
            theirs += usize::from(solver.solve(&chain, &to_k(&target)).is_ok());
        }
    }
    println!("of 180: ours {ours}, k {theirs}");
    assert!(ours >= theirs, "ours {ours}, k {theirs}");
    assert!(ours >= 170, "{ours} of 180");
}

#[test]
fn out_of_reach_is_no_solution_but_comes_as_near_as_the_arm_can() {
    let (robot, config) = &*FETCH;
    let seed = config.configuration(robot, "ready").unwrap();
    let target = Isometry3::from_parts(Translation3::new(5.0, 0.0, 0.9), Default::default());
    let outcome = robot.ik(request(config.gripper.link, target, &config.arm, &seed));
    assert!(!outcome.converged);
    assert_eq!(robot.problem_with(&outcome.q, 0.0), None);
    // Shoulder at x = 0.15, arm 0.98 m long: 3.87 m are missing at best.
    assert!(outcome.position_error > 3.8 && outcome.position_error < 4.2, "{outcome:?}");
}

#[test]
fn numbers_that_are_not_finite_end_without_a_solution() {
    let (robot, config) = &*FETCH;
    let seed = config.configuration(robot, "ready").unwrap();
    for x in [f64::NAN, f64::INFINITY, 1e300] {
        let target = Isometry3::from_parts(Translation3::new(x, 0.0, 0.9), Default::default());
        let outcome = robot.ik(request(config.gripper.link, target, &config.arm, &seed));
        assert!(!outcome.converged);
        assert_eq!(robot.problem_with(&outcome.q, 0.0), None);
    }
    let here = robot.fk_link(&seed, config.gripper.link);
    let mut bad = seed.clone();
    bad[3] = f64::NAN;
    assert!(!robot.ik(request(config.gripper.link, here, &config.arm, &bad)).converged);
    // No joints: solved only when already there.
    assert!(robot.ik(request(config.gripper.link, here, &[], &seed)).converged);
}

#[test]
fn a_straight_line_upwards_is_followed_without_jumps() {
    let (robot, config) = &*FETCH;
    let link = config.gripper.link;
    let mut q = config.configuration(robot, "ready").unwrap();
    let start = robot.fk_link(&q, link);
    for step in 1..=40 {
        let mut target = start;
        target.translation.z -= 0.005 * f64::from(step);
        let next = robot.solve_ik(request(link, target, &config.arm, &q)).unwrap();
        let largest = next.iter().zip(&q).fold(0.0, |max: f64, (a, b)| max.max((a - b).abs()));
        assert!(largest < 0.05, "step {step}: {largest}");
        q = next;
    }
}
