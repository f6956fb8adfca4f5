//! Properties of whole plans.
#![allow(clippy::print_stderr)]

use std::sync::OnceLock;

use crate::belief::BeliefScene;
use crate::collision::{CollisionChecker, Held, Margins, Query};
use crate::pick::settled;
use crate::plan::{Action, PickPlacePlan, PlanStage, StepName};
use crate::planner::Planner;
use crate::settings::PlannerSettings;
use crate::testing::{fetch, groceries};

fn planner() -> &'static Planner {
    static PLANNER: OnceLock<Planner> = OnceLock::new();
    PLANNER.get_or_init(|| {
        let (model, config) = fetch();
        Planner::new(model, config, PlannerSettings::default())
    })
}

fn ready() -> Vec<f64> {
    let (model, config) = fetch();
    config.configuration(&model, "ready").unwrap()
}

fn plan(belief: &BeliefScene, target: usize, seed: u64) -> PickPlacePlan {
    planner()
        .plan_pick_place(belief, target, &ready(), seed)
        .unwrap_or_else(|e| panic!("{:?} {e} {:?}", e.stage, e.counters))
}

#[test]
fn every_grocery_gets_a_plan_whose_motions_meet_and_respect_all_limits() {
    let belief = groceries();
    let (model, config) = fetch();
    for target in 0..belief.objects.len() {
        let plan = plan(&belief, target, 1);
        eprintln!(
            "{}: {:.3} s planning, {:.1} s motion, score {:.2}, {:?}",
            plan.object,
            plan.counters.seconds,
            plan.motion_seconds(),
            plan.grasp.score,
            plan.counters
        );
        let names: Vec<StepName> = plan.steps.iter().map(|s| s.name).collect();
        assert!(names.is_sorted() && names.len() == 9);
        let mut last: Option<Vec<f64>> = None;
        for step in &plan.steps {
            let Action::Move { trajectory, .. } = &step.action else {
                continue;
            };
            if let Some(last) = &last {
                for (a, b) in last.iter().zip(trajectory.first()) {
                    assert!((a - b).abs() < 1e-6, "{:?} begins elsewhere", step.name);
                }
            }
            last = Some(trajectory.last().to_vec());
            let dt = trajectory.dt;
            for (k, &j) in trajectory.joints.iter().enumerate() {
                let limit = config.limits[j];
                let range = model.joints()[j].limits;
                let p = &trajectory.points;
                for w in p.windows(2) {
                    assert!(w[0].qd[k].abs() <= limit.velocity + 1e-9);
                    assert!(
                        range.clamp(w[0].q[k]) == w[0].q[k]
                            || (range.clamp(w[0].q[k]) - w[0].q[k]).abs() < 1e-6
                    );
                }
                for w in p[..p.len() - 1].windows(3) {
                    let a = (w[2].q[k] - 2.0 * w[1].q[k] + w[0].q[k]) / (dt * dt);
                    assert!(a.abs() <= limit.acceleration + 1e-6, "{:?} {a}", step.name);
                }
            }
        }
    }
}

/// Replays a plan at the resolution of its control points with smaller margins than it was planned with.
#[test]
fn plans_are_free_of_collision_at_every_control_point() {
    let belief = settled(&groceries(), 0.015);
    let planner = planner();
    let checker = CollisionChecker::new(planner.robot().clone(), &belief);
    for target in 0..belief.objects.len() {
        let plan = plan(&belief, target, 2);
        let model = &belief.objects[target].model;
        let held = Held::new(model, target, *plan.grasp.object_from_gripper.inverse().iso());
        let touch = crate::grasp::hand_may_touch(planner.robot(), target);
        let mut q = ready();
        let mut opening = plan.grasp.opening;
        for step in &plan.steps {
            match &step.action {
                Action::Gripper { width, .. } => opening = *width,
                Action::Move { trajectory, holding, .. } => {
                    for finger in planner.robot().fingers {
                        q[finger] = 0.5 * opening;
                    }
                    for (i, point) in trajectory.points.iter().enumerate() {
                        planner.solver().scatter(&point.q, &mut q);
                        // The first 3 cm of a lift may touch what the object lies on.
                        let leaving = step.name == StepName::Lift && i < trajectory.points.len() / 4;
                        let near =
                            matches!(step.name, StepName::Approach | StepName::Retreat | StepName::Lift);
                        let query = Query {
                            held: (*holding && !leaving).then_some(&held),
                            allowed: if near { &touch } else { &[] },
                            margins: Margins { world: 0.0, own: 0.0, spread: 0.0 },
                        };
                        if let Some(pair) = checker.in_collision(&q, &query) {
                            panic!("{} {:?} {i}: {}", plan.object, step.name, checker.describe(pair));
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn same_seed_same_plan() {
    let belief = groceries();
    let mut a = plan(&belief, 1, 7);
    let mut b = plan(&belief, 1, 7);
    (a.counters.seconds, b.counters.seconds) = (0.0, 0.0);
    assert_eq!(a.steps, b.steps);
    assert_eq!(a.counters, b.counters);
}

#[test]
fn failures_name_their_stage() {
    let mut belief = groceries();
    let fail = |belief: &BeliefScene, target| {
        planner().plan_pick_place(belief, target, &ready(), 0).unwrap_err().stage
    };
    assert_eq!(fail(&belief, 9), PlanStage::Input);
    let mut far = belief.clone();
    far.objects[0].world_from_object = grip_sim::pose::Pose::from_xyz_rpy([2.0, 0.0, 0.701], [0.0; 3]);
    assert_eq!(fail(&far, 0), PlanStage::NoIk);
    let mut small = belief.clone();
    small.bin.inner = [0.05, 0.05];
    assert_eq!(fail(&small, 0), PlanStage::NoPlacePose);
    belief.objects[0].model = crate::testing::box_model("crate", [0.2, 0.2, 0.2]);
    assert_eq!(fail(&belief, 0), PlanStage::NoGrasp);
    belief.objects[1].world_from_object = grip_sim::pose::Pose::from_xyz_rpy([f64::NAN, 0.0, 0.7], [0.0; 3]);
    assert_eq!(fail(&belief, 0), PlanStage::Input);
}

#[test]
fn goes_home_from_the_end_of_a_plan() {
    let belief = groceries();
    let plan = plan(&belief, 0, 3);
    let mut after = settled(&belief, 0.015);
    after.objects[0].world_from_object = plan.place.world_from_object;
    after.objects[0].packed = true;
    let home = planner().plan_home(&after, &plan.end, &ready(), 3).unwrap();
    assert!(home.duration > 0.5);
    let goal = planner().solver().gather(&ready());
    for (k, (a, b)) in home.last().iter().zip(&goal).enumerate() {
        assert!(crate::space::wrap(a - b).abs() < 1e-9, "joint {k}");
    }
}

/// Not a test of speed (nothing here can fail): prints what a collision check costs.
#[test]
fn collision_checks_of_random_configurations() {
    use rand::SeedableRng;
    let belief = settled(&groceries(), 0.015);
    let planner = planner();
    let checker = CollisionChecker::new(planner.robot().clone(), &belief);
    let space = planner.solver().space(0.0);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let query = Query { held: None, allowed: &[], margins: planner.settings().free };
    let mut q = ready();
    let clock = std::time::Instant::now();
    let n = 20_000;
    let mut free = 0;
    for _ in 0..n {
        planner.solver().scatter(&space.sample(&mut rng), &mut q);
        free += usize::from(checker.in_collision(&q, &query).is_none());
    }
    eprintln!("{:.2} us a check, {free} of {n} free", 1e6 * clock.elapsed().as_secs_f64() / f64::from(n));
    let clock = std::time::Instant::now();
    let q = ready();
    for _ in 0..n {
        assert!(checker.in_collision(&q, &query).is_none());
    }
    eprintln!("{:.2} us a check of a free configuration", 1e6 * clock.elapsed().as_secs_f64() / f64::from(n));
}
