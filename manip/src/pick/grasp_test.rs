//! One grasp on its own: approach, close, lift, shake. For experiments that ask when grasps hold; packing does not use it.

use nalgebra::{Isometry3, Vector3};

use super::pick_place::{Attempt, Risk, joined};
use crate::belief::BeliefScene;
use crate::collision::{CollisionBody, CollisionChecker, CollisionQuery};
use crate::grasp::{Grasp, HandFrom, rank_grasps};
use crate::motion::{CartesianPath, straight_line, translate};
use crate::plan::{Action, GripperCommand, PlanFailure, PlanStage, PlanStep, StepName};
use crate::planner::Planner;

/// Configurations of the arm at the grasp that are tried.
const SOLUTIONS: usize = 8;

/// What to do to try a grasp.
#[derive(Debug, Clone)]
pub struct GraspTest {
    /// Where it begins: all movable joints at the pre-grasp pose, fingers open.
    pub start: Vec<f64>,
    /// Approach, close, lift, and the shake, which is several motions.
    pub steps: Vec<PlanStep>,
}

impl Planner {
    /// The grasp that would be chosen for the belief's object `target` if it went anywhere: the best one from above that the arm
    /// reaches, approaches and lifts without collision from around `q_now`; and the configuration at it. With `only`, that grasp of
    /// the object or none.
    ///
    /// # Errors
    /// The farthest stage that any grasp reached.
    pub fn choose_grasp(
        &self,
        belief: &BeliefScene,
        target: usize,
        q_now: &[f64],
        only: Option<&Grasp>,
    ) -> Result<(Grasp, Vec<f64>), PlanFailure> {
        let mut attempt = Attempt::new(self, belief, target, q_now, Risk::Tolerant);
        let fail = |attempt: Attempt<'_>, name: &str| {
            let Attempt { counters, failed: (stage, reason), .. } = attempt;
            PlanFailure { stage, object: name.to_owned(), reason, counters: Box::new(counters) }
        };
        let Some(object) = belief.objects.get(target) else {
            attempt.failed = (PlanStage::Input, format!("the belief has {} objects", belief.objects.len()));
            return Err(fail(attempt, "object"));
        };
        if let Err(problem) = self.check_input(belief, &[q_now]) {
            attempt.failed = problem;
            return Err(fail(attempt, &object.name));
        }
        let grasps = match only {
            Some(only) => {
                let world_from_gripper = object.world_from_object * only.object_from_gripper;
                vec![Grasp { world_from_gripper, ..only.clone() }]
            }
            None => {
                let known = self.grasps(&object.model);
                let settings = &self.settings.grasp;
                let gripper = &self.config.gripper;
                let (grasps, counters) =
                    rank_grasps(&known, belief, target, HandFrom::Above, &attempt.checker, gripper, settings);
                attempt.counters.grasps = counters;
                grasps
            }
        };
        for grasp in grasps.into_iter().take(self.settings.grasp_tries) {
            if let Some(picked) = attempt.pick(grasp) {
                let q = picked.approach.end().to_vec();
                return Ok((picked.grasp, q));
            }
        }
        Err(fail(attempt, &object.name))
    }

    /// How to try `grasp` of an object with the gripper at `base_from_gripper`, wherever that is: nothing is asked about what the
    /// hand meets there, while the arm keeps clear of the table and of itself. `near` is a configuration to stay close to, and
    /// `force_n` what each finger presses with; by default what [`crate::grasp::grip_force`] gives. `None` when the arm does not reach all of it.
    pub fn plan_grasp_test(
        &self,
        belief: &BeliefScene,
        target: usize,
        grasp: &Grasp,
        base_from_gripper: &Isometry3<f64>,
        near: &[f64],
        force_n: Option<f64>,
    ) -> Option<GraspTest> {
        let (settings, solver) = (&self.settings, &self.solver);
        let info = &belief.objects.get(target)?.model.info;
        let open = self.with_fingers(near, grasp.opening);
        let mut pregrasp = *base_from_gripper;
        pregrasp.translation.vector -= base_from_gripper * Vector3::x() * settings.grasp.standoff;
        let checker = CollisionChecker::new(self.robot.clone(), belief);
        let query = CollisionQuery { held: None, allowed: &[], margins: settings.near_margins };
        // Where the arm goes is this planner's business, what the hand runs into is the experiment's.
        let arm_meets = |_: f64, q: &[f64]| {
            let of_hand = |body: CollisionBody| match body {
                CollisionBody::Link(link) => self.robot.hand.contains(&link),
                CollisionBody::Object(_) => true,
                _ => false,
            };
            checker.collisions(q, &query).into_iter().find(|pair| !of_hand(pair.a) && !of_hand(pair.b))
        };
        let solutions = solver.solutions(base_from_gripper, &open, settings.ik_seeds, SOLUTIONS, |q| {
            arm_meets(0.0, q).is_none()
        });
        solutions.into_iter().find_map(|q| {
            let approach = straight_line(solver, &q, &pregrasp, arm_meets).ok()?.reversed();
            let closed = self.with_fingers(&q, grasp.width);
            let lift = translate(solver, &closed, Vector3::z() * settings.grasp_test.lift, arm_meets).ok()?;
            let far = settings.grasp_test.shake;
            let mut shake: Vec<CartesianPath> = Vec::new();
            for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
                for way in [far, -2.0 * far, far] {
                    let from = shake.last().unwrap_or(&lift).end().to_vec();
                    shake.push(translate(solver, &from, axis * way, arm_meets).ok()?);
                }
            }
            let straight = |name, path: &CartesianPath, speed, guarded, holding| PlanStep {
                name,
                action: self.straight(path, speed, guarded, holding),
            };
            let force_n = force_n.unwrap_or_else(|| self.grip_force(info, grasp));
            let close = PlanStep {
                name: StepName::Close,
                action: Action::Gripper { command: GripperCommand::Close { force_n }, width: grasp.width },
            };
            let open = PlanStep {
                name: StepName::Open,
                action: Action::Gripper {
                    command: GripperCommand::Open { width: grasp.opening },
                    width: grasp.opening,
                },
            };
            let mut steps = vec![
                open,
                straight(StepName::Approach, &approach, settings.speed.guarded, true, false),
                close,
                straight(StepName::Lift, &lift, settings.speed.straight, false, true),
            ];
            let speed = settings.grasp_test.shake_speed;
            steps.extend(shake.iter().map(|path| straight(StepName::Shake, path, speed, false, true)));
            Some(GraspTest { start: approach.waypoints[0].clone(), steps: joined(steps) })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::PlannerSettings;
    use crate::testing::{fetch, groceries};

    #[test]
    fn a_test_begins_at_the_pregrasp_and_goes_through_the_grasp() {
        let (model, config) = fetch();
        let q = config.configuration(&model, "ready").unwrap();
        let planner = Planner::new(model, config, PlannerSettings::default());
        let belief = groceries();
        let (grasp, q) = planner.choose_grasp(&belief, 0, &q, None).unwrap();
        // The same one is found again when it alone is asked for.
        let (again, _) = planner.choose_grasp(&belief, 0, &q, Some(&grasp)).unwrap();
        assert_eq!(grasp.object_from_gripper, again.object_from_gripper);

        let base_from_world = belief.world_from_base.iso().inverse();
        let goal = base_from_world * grasp.world_from_gripper.iso();
        let test = planner.plan_grasp_test(&belief, 0, &grasp, &goal, &q, Some(33.0)).unwrap();
        let gripper = |q: &[f64]| planner.robot.model.fk_link(q, planner.robot.gripper);
        let standoff = gripper(&test.start).translation.vector - goal.translation.vector;
        assert!((standoff.norm() - planner.settings.grasp.standoff).abs() < 1e-3, "{standoff}");
        let mut q = test.start.clone();
        let mut names = Vec::new();
        for step in &test.steps {
            names.push(step.name);
            match &step.action {
                Action::Move { trajectory, .. } => {
                    trajectory.joints.iter().zip(trajectory.last()).for_each(|(&j, v)| q[j] = *v);
                    if step.name == StepName::Approach {
                        let off = gripper(&q).translation.vector - goal.translation.vector;
                        assert!(off.norm() < 1e-3, "{off}");
                    }
                }
                Action::Gripper { command: GripperCommand::Close { force_n }, .. } => {
                    assert_eq!(*force_n, 33.0);
                }
                Action::Gripper { .. } => {}
            }
        }
        assert_eq!(names.iter().filter(|name| **name == StepName::Shake).count(), 9);
        let up = gripper(&q).translation.vector - goal.translation.vector;
        assert!(
            (up - Vector3::z() * planner.settings.grasp_test.lift).norm() < 2e-3,
            "the shake ends where it began: {up}"
        );
        // Out of reach is said, not guessed.
        let far = nalgebra::Translation3::new(2.0, 0.0, 0.0) * goal;
        assert!(planner.plan_grasp_test(&belief, 0, &grasp, &far, &q, None).is_none());
    }
}
