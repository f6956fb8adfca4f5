//! Properties of whole plans.
#![allow(clippy::print_stderr)]

use std::sync::OnceLock;

use grip_sim::shape::{CollisionShape, Convex};
use nalgebra::{Isometry3, Vector3};

use crate::belief::BeliefScene;
use crate::collision::{CollisionBody, CollisionChecker, CollisionPair, CollisionQuery, HeldObject, Margins};
use crate::grasp::{Grasp, GraspSettings, HandFrom, hand_may_touch, rank_grasps};
use crate::pick::{Risk, snapped_to_ground};
use crate::plan::{Action, PickPlacePlan, PlanStage, StepName};
use crate::planner::Planner;
use crate::settings::PlannerSettings;
use crate::testing::{box_model, empty_scene, fetch, groceries, standing};

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
    plan_by(planner(), belief, target, seed)
}

fn plan_by(planner: &Planner, belief: &BeliefScene, target: usize, seed: u64) -> PickPlacePlan {
    planner
        .plan_pick_place(belief, target, &ready(), Risk::Tolerant, seed)
        .unwrap_or_else(|e| panic!("{:?} {e} {:?}", e.stage, e.counters))
}

#[test]
fn no_finger_closes_on_a_wall_that_is_between_it_and_the_object() {
    let mut belief = empty_scene();
    belief.objects = vec![standing(&box_model("carton", [0.12, 0.05, 0.16]), 0.55, 0.1, 0.0)];
    let (_, config) = fetch();
    let planner = planner();
    let ranked = |belief: &BeliefScene| {
        let checker = CollisionChecker::new(planner.robot().clone(), belief);
        let known = planner.grasps(&belief.objects[0].model);
        rank_grasps(&known, belief, 0, HandFrom::Above, &checker, &config.gripper, &GraspSettings::default())
            .0
    };
    let open = ranked(&belief);
    // As wide as the object, 4 mm thick, 15 mm beside it: a hand that is open straddles it.
    let wall = CollisionShape {
        pose: Isometry3::translation(0.55, 0.1 + 0.025 + 0.017, belief.table_height + 0.1),
        geometry: Convex::Cuboid { half: Vector3::new(0.06, 0.002, 0.1) },
    };
    belief.fixtures.push(wall);
    let checker = CollisionChecker::new(planner.robot().clone(), &belief);
    let touch = hand_may_touch(planner.robot(), 0);
    let query = CollisionQuery {
        held: None,
        allowed: &touch,
        margins: Margins { world: 0.0, own: 0.0, spread: 0.0 },
    };
    let base_from_world = belief.world_from_base.iso().inverse();
    let meets = |grasp: &Grasp| {
        let at = base_from_world * grasp.world_from_gripper.iso();
        let widths = (0..=100).map(|k| grasp.width + (grasp.opening - grasp.width) * f64::from(k) / 100.0);
        widths.into_iter().any(|width| checker.hand_collision(&at, width, &query).is_some())
    };
    assert!(open.iter().any(meets), "the wall is in nobody's way");
    assert!(!ranked(&belief).iter().any(meets));
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
    let belief = snapped_to_ground(&groceries(), 0.015);
    let (model, config) = fetch();
    let shaking = Planner::new(model, config, PlannerSettings { shake: 0.02, ..PlannerSettings::default() });
    let all = (0..belief.objects.len()).map(|target| (planner(), target, 0)).chain([(&shaking, 0, 12)]);
    for (planner, target, shakes) in all {
        let plan = plan_by(planner, &belief, target, 2);
        let names: Vec<StepName> = plan.steps.iter().map(|step| step.name).collect();
        assert_eq!(names.iter().filter(|name| **name == StepName::Shake).count(), shakes);
        let lower = names.iter().position(|name| *name == StepName::Lower).unwrap();
        assert_eq!(names[lower - 1], if shakes > 0 { StepName::Shake } else { StepName::Carry });
        replay(planner, &belief, target, &plan);
    }
}

/// Fails where a motion of `plan` meets anything of `belief` that it must not meet.
fn replay(planner: &Planner, belief: &BeliefScene, target: usize, plan: &PickPlacePlan) {
    let checker = CollisionChecker::new(planner.robot().clone(), belief);
    let model = &belief.objects[target].model;
    let held = HeldObject::new(model, target, *plan.grasp.object_from_gripper.inverse().iso());
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
                    let near = matches!(step.name, StepName::Approach | StepName::Retreat | StepName::Lift);
                    let query = CollisionQuery {
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

#[test]
fn what_stands_under_a_board_is_taken_out_to_the_front() {
    let mut belief = empty_scene();
    belief.objects = vec![standing(&box_model("carton", [0.09, 0.05, 0.175]), 0.68, 0.12, 0.0)];
    belief.fixtures.push(CollisionShape {
        pose: Isometry3::translation(0.74, 0.12, belief.table_height + 0.25),
        geometry: Convex::Cuboid { half: Vector3::new(0.15, 0.30, 0.01) },
    });
    let (model, config) = fetch();
    // Of hands from above those that come nearly straight down, for which the board leaves no room.
    let mut settings = PlannerSettings::default();
    settings.grasp.least_down = 0.9;
    let both = Planner::new(model.clone(), config.clone(), settings.clone());
    let plan = plan_by(&both, &belief, 0, 1);
    let approach = plan.grasp.world_from_gripper.transform_vector(&Vector3::x());
    assert!(approach.x > 0.7, "{approach}");
    replay(&both, &belief, 0, &plan);
    // No approach leads straight down and level at once.
    (settings.grasp.front_least_away, settings.grasp.front_least_down) = (1.0, 1.0);
    let above = Planner::new(model, config, settings);
    let failure = above.plan_pick_place(&belief, 0, &ready(), Risk::Tolerant, 1).err().map(|e| e.stage);
    assert_eq!(failure, Some(PlanStage::NoGrasp));
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
        planner().plan_pick_place(belief, target, &ready(), Risk::Tolerant, 0).unwrap_err().stage
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
    let mut after = snapped_to_ground(&belief, 0.015);
    after.objects[0].world_from_object = plan.place.world_from_object;
    after.objects[0].packed = true;
    let home = planner().plan_home(&after, &plan.end, &ready(), 3).unwrap();
    assert!(home.duration > 0.5);
    let goal = planner().solver().gather(&ready());
    for (k, (a, b)) in home.last().iter().zip(&goal).enumerate() {
        assert!(crate::motion::wrap(a - b).abs() < 1e-9, "joint {k}");
    }
}

#[test]
fn a_configuration_collides_exactly_when_its_clearance_is_below_the_margin() {
    let belief = snapped_to_ground(&groceries(), 0.015);
    let planner = planner();
    let checker = CollisionChecker::new(planner.robot().clone(), &belief);
    let space = planner.solver().space(0.0);
    let mut rng = grip_sim::rng::stream(1, "clearance test");
    let margin = 0.03;
    // Links may touch each other here: clearance knows the world only.
    let own: Vec<CollisionPair> = (0..planner.robot().model.links().len())
        .flat_map(|a| {
            (0..a).map(move |b| CollisionPair { a: CollisionBody::Link(a), b: CollisionBody::Link(b) })
        })
        .collect();
    let query = CollisionQuery {
        held: None,
        allowed: &own,
        margins: Margins { world: margin, own: 0.0, spread: 0.0 },
    };
    let mut q = ready();
    let (mut hits, mut near) = (0, 0);
    for _ in 0..600 {
        planner.solver().scatter(&space.sample(&mut rng), &mut q);
        let clearance = checker.clearance(&q, &query, 0.1);
        // Single precision and the tolerance of GJK.
        if (clearance - margin).abs() > 5e-4 {
            let pair = checker.in_collision(&q, &query);
            assert_eq!(pair.is_some(), clearance < margin, "{clearance} {pair:?}");
            hits += usize::from(pair.is_some());
            near += usize::from(pair.is_none() && clearance < 0.1);
        }
    }
    assert!(hits > 50 && near > 20, "{hits} {near}: the sample says something");
}

/// Random yaws and places over the whole region, objects standing or lying.
fn random_scene(seed: u64) -> BeliefScene {
    use rand::RngExt;
    let mut rng = grip_sim::rng::stream(seed, "test scene");
    let mut belief = groceries();
    let mut taken: Vec<[f64; 2]> = Vec::new();
    for object in &mut belief.objects {
        let lie = rng.random::<f64>() < 0.3;
        let xy = loop {
            let p = [0.45 + 0.30 * rng.random::<f64>(), -0.13 + 0.42 * rng.random::<f64>()];
            if taken.iter().all(|t: &[f64; 2]| (t[0] - p[0]).hypot(t[1] - p[1]) > 0.14) {
                break p;
            }
        };
        taken.push(xy);
        let roll = if lie { std::f64::consts::FRAC_PI_2 } else { 0.0 };
        let z = 0.65 + if lie { object.model.max.y } else { object.model.max.z };
        let yaw = std::f64::consts::TAU * rng.random::<f64>();
        object.world_from_object = grip_sim::pose::Pose::from_xyz_rpy([xy[0], xy[1], z], [roll, 0.0, yaw]);
    }
    belief
}

#[test]
fn most_random_scenes_have_a_plan_for_every_object() {
    let (mut plans, mut all, mut seconds, mut motion) = (0, 0, 0.0, 0.0);
    for seed in 0..sweep() {
        let belief = random_scene(seed);
        for target in 0..belief.objects.len() {
            all += 1;
            match planner().plan_pick_place(&belief, target, &ready(), Risk::Tolerant, seed) {
                Ok(plan) => {
                    plans += 1;
                    seconds += plan.counters.seconds;
                    motion += plan.motion_seconds();
                    if plan.counters.seconds > 0.4 {
                        eprintln!("slow {seed} {} {:?}", plan.object, plan.counters);
                    }
                }
                Err(e) => eprintln!("{seed} {e} {:?} {:?}", e.stage, e.counters),
            }
        }
    }
    eprintln!(
        "{plans} of {all} planned, {:.3} s a plan, {:.1} s motion",
        seconds / f64::from(plans),
        motion / f64::from(plans)
    );
    assert!(plans * 20 >= all * 19);
}

fn sweep() -> u64 {
    std::env::var("GRIP_SWEEP").ok().and_then(|s| s.parse().ok()).unwrap_or(5)
}

#[test]
fn eight_configurations_at_once_collide_when_one_of_them_does() {
    use crate::collision::batch::Batch;
    use crate::testing::box_model;
    use grip_sim::lanes::{F8, LANES};
    let mut belief = groceries();
    // And a wall of points beside the table, an unmodelled obstacle.
    belief.unmodelled = (0..600)
        .map(|k| nalgebra::Point3::new(0.5 + 0.01 * f64::from(k % 30), 0.4, 0.7 + 0.01 * f64::from(k / 30)))
        .collect();
    let planner = planner();
    let (solver, robot) = (planner.solver(), planner.robot());
    let checker = CollisionChecker::new(robot.clone(), &belief);
    let crate_model = box_model("crate", [0.08, 0.05, 0.2]);
    let held = HeldObject::new(&crate_model, 1, nalgebra::Isometry3::translation(0.05, 0.0, 0.0));
    let allowed = crate::grasp::hand_may_touch(robot, 2);
    let mut rng = grip_sim::rng::stream(4, "batch");
    let space = solver.space(0.0);
    let mut q = ready();
    let mut counts = [0; 2];
    let mut against_points = 0;
    for (held, margin) in [(None, 0.0), (Some(&held), 0.01)] {
        // Links are posed in single precision, and GJK in it ends within a thousandth of a distance.
        let query = |more: f64| CollisionQuery {
            held,
            allowed: &allowed,
            margins: Margins { world: margin + more, own: 0.5 * margin + more, spread: 0.5 },
        };
        let exact = query(0.0);
        let batch = Batch::new(&checker, &exact, solver.joints(), &q);
        for _ in 0..1500 {
            let groups: Vec<Vec<f64>> = (0..LANES).map(|_| space.sample(&mut rng)).collect();
            let lanes: Vec<F8> =
                (0..space.dim()).map(|j| F8(std::array::from_fn(|lane| groups[lane][j] as f32))).collect();
            // Each alone in all lanes, and all together.
            let mut one_collides = false;
            for group in &groups {
                let alone: Vec<F8> = group.iter().map(|v| F8::all(*v as f32)).collect();
                let found = batch.any_collides(&alone);
                one_collides |= found;
                solver.scatter(group, &mut q);
                let collides = |more: f64| checker.in_collision(&q, &query(more)).is_some();
                assert!(if found { collides(3e-5) } else { !collides(-3e-5) }, "{found}: {group:?}");
                counts[usize::from(found)] += 1;
                let pairs = checker.collisions(&q, &exact);
                against_points +=
                    usize::from(!pairs.is_empty() && pairs.iter().all(|p| p.b == CollisionBody::Unmodelled));
            }
            assert_eq!(batch.any_collides(&lanes), one_collides);
        }
    }
    assert!(counts.iter().all(|n| *n > 1000), "{counts:?}");
    assert!(against_points > 20, "{against_points}: some meet nothing but the points");
}

#[test]
fn a_way_out_of_a_narrow_place_is_free_and_leads_away() {
    let belief = groceries();
    let planner = planner();
    let checker = CollisionChecker::new(planner.robot().clone(), &belief);
    let plan = plan(&belief, 1, 1);
    let Action::Move { trajectory, .. } = &plan.steps[2].action else { panic!("{:?}", plan.steps[2].name) };
    let query = CollisionQuery {
        held: None,
        allowed: &[],
        margins: Margins { world: 0.001, own: 0.001, spread: 0.0 },
    };
    // Where the approach has come close, but not too close.
    let near = |q: &Vec<f64>| (0.004..0.02).contains(&checker.clearance(q, &query, 0.5));
    let on_the_way = trajectory.points.iter().rev().map(|point| {
        let mut q = ready();
        planner.solver().scatter(&point.q, &mut q);
        q
    });
    let q = on_the_way.into_iter().find(near).unwrap();
    let space = planner.solver().space(0.0);
    let edges = crate::motion::SegmentCheck::new(&checker, query, &space, planner.solver(), &q, 0.002);
    let chain = planner.way_out(&checker, &query, &space, &edges, &q);
    let clearance = |group: &[f64]| {
        let mut q = q.clone();
        planner.solver().scatter(group, &mut q);
        checker.clearance(&q, &query, 0.5)
    };
    assert!(chain.len() > 5, "{}", chain.len());
    assert!(clearance(&chain[chain.len() - 1]) > clearance(&chain[0]) + 0.05);
    assert!(chain.iter().all(|group| clearance(group) > 0.001));
}

#[test]
fn what_is_wedged_in_is_lifted_only_at_a_risk() {
    let mut belief = empty_scene();
    let (item, wall) = (box_model("item", [0.06, 0.04, 0.12]), box_model("wall", [0.04, 0.20, 0.10]));
    // A millimetre of overlap, as estimates have it.
    belief.objects = vec![
        standing(&item, 0.6, 0.0, 0.0),
        standing(&wall, 0.551, 0.0, 0.0),
        standing(&wall, 0.649, 0.0, 0.0),
    ];
    let plan = |risk| planner().plan_pick_place(&belief, 0, &ready(), risk, 1);
    let averse = plan(Risk::Averse).unwrap_err();
    assert_eq!(averse.stage, PlanStage::NoLift, "{averse}");
    assert!(plan(Risk::Tolerant).is_ok());
    // Alone it is no risk at all.
    belief.objects.truncate(1);
    assert!(planner().plan_pick_place(&belief, 0, &ready(), Risk::Averse, 1).is_ok());
}

#[test]
fn a_poor_grasp_is_left_for_later() {
    let demanding = PlannerSettings {
        grasp: GraspSettings { firm: 11.0, ..GraspSettings::default() },
        ..PlannerSettings::default()
    };
    let (model, config) = fetch();
    let planner = Planner::new(model, config, demanding);
    let belief = groceries();
    let plan = |risk| planner.plan_pick_place(&belief, 0, &ready(), risk, 1);
    assert_eq!(plan(Risk::Averse).unwrap_err().stage, PlanStage::NoGrasp);
    assert!(plan(Risk::Tolerant).is_ok());
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let mut settings = PlannerSettings::default();
    settings.rrt.step = f64::NAN;
    let (model, config) = fetch();
    let planner = Planner::new(model, config, settings);
    let failure = planner.plan_pick_place(&groceries(), 0, &ready(), Risk::Averse, 1).unwrap_err();
    assert_eq!(failure.stage, PlanStage::Input);
    assert!(failure.reason.contains("rrt.step is NaN"), "{failure}");
}
