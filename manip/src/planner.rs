//! The planner of one robot: free paths, timing, and what picking and placing share.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use grip_sim::frame::CameraFrame;
use grip_sim::objects::{ObjectInfo, ObjectModel};
use grip_sim::robot::{RobotConfig, RobotModel};
use nalgebra::{Point3, Vector3};
use rand_chacha::ChaCha8Rng;

use crate::belief::BeliefScene;
use crate::collision::{
    CollisionChecker, CollisionQuery, HeldObject, Margins, RobotSolids, unmodelled_obstacles,
};
use crate::grasp::{
    BelievedSurface, GivenGrasp, Grasp, GraspCache, GraspSetError, ObjectGrasps, grip_force, gripped,
    read_poses,
};
use crate::motion::{
    CartesianPath, IkSolver, JointSpace, MotionLimits, SearchStatus, SegmentCheck, SmoothPath, Trajectory,
    Validity, glide, rrt_connect, shortcut, translate,
};
use crate::order::pick_order;
use crate::plan::{Action, Guard, PlanCounters, PlanFailure, PlanStage};
use crate::settings::PlannerSettings;

/// Plans motions, picks and places of one robot. Immutable but for a cache of grasps, and shared between threads.
#[derive(Debug)]
pub struct Planner {
    pub(crate) robot: Arc<RobotSolids>,
    pub(crate) config: Arc<RobotConfig>,
    pub(crate) solver: IkSolver,
    pub(crate) settings: PlannerSettings,
    pub(crate) cache: GraspCache,
}

/// A measured joint may be so far beyond its limits, radians or metres.
const BEYOND_LIMITS: f64 = 0.02;
/// Distance of the waypoints of a way out, metres.
const WAY_OUT_STEP: f64 = 0.02;
/// Half of the way between two checks along an edge where the start leaves no margin, metres.
const LEAST_STEP: f64 = 0.002;
/// Waypoints of a straight motion used for its timing: every third, 15 mm apart.
const THIN: usize = 3;
/// Largest distance of its rounded corners from a straight motion, norm of joint values.
const STRAIGHT_CORNER: f64 = 0.01;

impl Planner {
    /// Prepares a planner; covering the robot with balls takes some 20 ms of it. With settings out of their range
    /// ([`PlannerSettings::validate`]) every plan fails with [`PlanStage::Input`] and says which.
    pub fn new(model: Arc<RobotModel>, config: Arc<RobotConfig>, settings: PlannerSettings) -> Self {
        let robot = Arc::new(RobotSolids::new(model, &config));
        Self {
            solver: IkSolver::new(robot.clone(), &config),
            cache: GraspCache::default(),
            robot,
            config,
            settings,
        }
    }

    /// The robot's solids.
    pub fn robot(&self) -> &Arc<RobotSolids> {
        &self.robot
    }

    /// The inverse kinematics.
    pub fn solver(&self) -> &IkSolver {
        &self.solver
    }

    /// The settings.
    pub fn settings(&self) -> &PlannerSettings {
        &self.settings
    }

    /// A timed free motion from `q_from` to `q_to` (whole configurations; only torso and arm move), with `held` in the
    /// hand.
    ///
    /// A start in collision by belief is first left by a short straight motion.
    ///
    /// # Errors
    /// [`PlanStage::Input`], [`PlanStage::StartInCollision`] or [`PlanStage::NoPath`].
    pub fn free_path(
        &self,
        q_from: &[f64],
        q_to: &[f64],
        belief: &BeliefScene,
        held: Option<&HeldObject>,
        seed: u64,
    ) -> Result<Trajectory, PlanFailure> {
        let clock = Instant::now();
        let mut counters = PlanCounters::default();
        self.check_input(belief, &[q_from, q_to])
            .and_then(|()| {
                let checker = CollisionChecker::new(self.robot.clone(), belief);
                let mut rng = grip_sim::rng::stream(seed, "free path");
                self.search(&checker, held, q_from, &[q_to.to_vec()], &mut counters, &mut rng)
            })
            .map_err(|(stage, reason)| {
                counters.seconds = clock.elapsed().as_secs_f64();
                PlanFailure { stage, object: "free motion".into(), reason, counters: Box::new(counters) }
            })
    }

    /// A free motion to the pose for looking or resting, `q_home` (whole configuration; only torso and arm move).
    ///
    /// # Errors
    /// As [`Planner::free_path`].
    pub fn plan_home(
        &self,
        belief: &BeliefScene,
        q_now: &[f64],
        q_home: &[f64],
        seed: u64,
    ) -> Result<Trajectory, PlanFailure> {
        self.free_path(q_now, q_home, belief, None, seed)
    }

    /// Points the head from how it stands in `q_now` to how it stands in `q_goal`; `None` where that is the same. Nothing is
    /// near enough to a head for it to be planned. `None` without a head, too.
    pub fn plan_head(&self, q_now: &[f64], q_goal: &[f64]) -> Option<Trajectory> {
        let head = self.config.head.map(|head| [head.pan, head.tilt])?;
        let [from, to] = [q_now, q_goal].map(|q| head.map(|joint| q[joint]).to_vec());
        if from.iter().zip(&to).all(|(a, b)| (a - b).abs() < 5e-3) {
            return None;
        }
        let path = SmoothPath::round(&[from.clone(), to], self.settings.speed.corner, &[], |_, _, _| true);
        Some(self.settings.speed.time(&head, &from, &path, &self.limits_of(&head)))
    }

    /// The grasps of `model`, made on first use.
    pub fn grasps(&self, model: &Arc<ObjectModel>) -> Arc<ObjectGrasps> {
        let settings = &self.settings.grasp.antipodal;
        self.cache.get(model, &self.robot, &self.config.gripper, settings)
    }

    /// Grasps `model` as a file says ([`crate::grasp::GraspSet`]). Returns how many of its grasps hold the object, and of how many.
    ///
    /// # Errors
    /// When the file cannot be used, or none of its grasps holds the object.
    pub fn use_grasps(&self, model: &Arc<ObjectModel>, path: &Path) -> Result<[usize; 2], GraspSetError> {
        let poses = read_poses(path, &model.info.name)?;
        let settings = &self.settings.grasp.antipodal;
        let held = self.cache.set(model, &self.robot, &self.config.gripper, settings, &poses);
        if held == 0 {
            let reason = format!(
                "none of {} grasps holds the object: the frame is the gripper's, x out along the fingers, y along the closing \
                 direction, metres",
                poses.len()
            );
            return Err(GraspSetError { path: path.to_path_buf(), reason });
        }
        Ok([held, poses.len()])
    }

    /// Which of the belief's objects that are not packed yet each of these grasps is of: the one of which most is between the fingers, or
    /// else the nearest, up to 3 cm from the middle between the pads; none where there is none.
    pub fn gripped_objects(&self, belief: &BeliefScene, given: &[GivenGrasp]) -> Vec<Option<usize>> {
        let surfaces: Vec<(usize, BelievedSurface)> = belief
            .objects
            .iter()
            .enumerate()
            .filter(|(_, object)| !object.packed)
            .filter_map(|(i, object)| Some((i, BelievedSurface::new(object, &self.grasps(&object.model))?)))
            .collect();
        let surfaces = surfaces.iter().map(|(i, surface)| (*i, surface));
        given.iter().map(|grasp| gripped(grasp, surfaces.clone(), &self.config.gripper)).collect()
    }

    /// What of a frame nothing in `belief` explains, the robot standing at `q` (all movable joints): points of the world for
    /// [`BeliefScene::unmodelled`].
    pub fn unmodelled_obstacles(
        &self,
        belief: &BeliefScene,
        frame: &CameraFrame,
        q: &[f64],
    ) -> Vec<Point3<f64>> {
        let checker = CollisionChecker::new(self.robot.clone(), belief);
        unmodelled_obstacles(frame.points(), belief, &checker, q, &self.settings.unmodelled)
    }

    /// The order in which to pick the belief's objects that are not packed yet: see [`crate::order::pick_order`].
    pub fn pick_order(&self, belief: &BeliefScene) -> Vec<Vec<usize>> {
        pick_order(belief, &self.settings.order)
    }

    /// Force of each finger on an object in a grasp, newtons: see [`crate::grasp::grip_force`].
    pub(crate) fn grip_force(&self, info: &ObjectInfo, grasp: &Grasp) -> f64 {
        let antipodal = &self.settings.grasp.antipodal;
        let max_force = self.config.gripper.max_force;
        grip_force(info, grasp.lever, antipodal.pad_friction, max_force, &self.settings.grip_force)
    }

    pub(crate) fn check_input(
        &self,
        belief: &BeliefScene,
        configurations: &[&[f64]],
    ) -> Result<(), (PlanStage, String)> {
        let in_settings = self.settings.validate().err().map(|problem| format!("settings: {problem}"));
        let problem = in_settings
            .or_else(|| belief.problem())
            .or_else(|| configurations.iter().find_map(|q| self.robot.model.problem_with(q, BEYOND_LIMITS)));
        match problem {
            Some(problem) => Err((PlanStage::Input, problem)),
            None => Ok(()),
        }
    }

    /// Whole configuration with every joint within its limits (a measured one may be a hair outside).
    pub(crate) fn clamped(&self, q: &[f64]) -> Vec<f64> {
        self.robot.model.joints().iter().zip(q).map(|(joint, v)| joint.limits.clamp(*v)).collect()
    }

    /// The same configuration with the pads `opening` metres apart, every joint within its limits.
    pub(crate) fn with_fingers(&self, q: &[f64], opening: f64) -> Vec<f64> {
        let mut q = q.to_vec();
        for finger in self.robot.fingers {
            q[finger] = 0.5 * opening;
        }
        self.clamped(&q)
    }

    /// Searches, shortens, rounds and times a path from `q` to one of `goals` (whole configurations).
    pub(crate) fn search(
        &self,
        checker: &CollisionChecker,
        held: Option<&HeldObject>,
        q: &[f64],
        goals: &[Vec<f64>],
        counters: &mut PlanCounters,
        rng: &mut ChaCha8Rng,
    ) -> Result<Trajectory, (PlanStage, String)> {
        let mut q = self.clamped(q);
        let mut head: Vec<Vec<f64>> = vec![self.solver.gather(&q)];
        let (margins, escape) = self.leave_start(checker, held, &q)?;
        if let Some(escape) = escape {
            head.extend(escape.waypoints[1..].iter().map(|w| self.solver.gather(w)));
            q = escape.end().to_vec();
        }
        let space = self.solver.space(held.map_or(0.0, |h| h.extent));
        let query = CollisionQuery { held, allowed: &[], margins };
        // Between two checks nothing comes nearer than the margin, where there is one.
        let step = 2.0 * margins.world.max(LEAST_STEP);
        let segments = SegmentCheck::new(checker, query, &space, &self.solver, &q, step);
        let from = self.way_out(checker, &query, &space, &segments, &q);
        let goals: Vec<Vec<Vec<f64>>> =
            goals.iter().map(|goal| self.way_out(checker, &query, &space, &segments, goal)).collect();
        let found = rrt_connect(&space, &segments, &from, &goals, &self.settings.rrt, rng);
        counters.searches += 1;
        counters.iterations += found.iterations;
        let result = match found.status {
            SearchStatus::Solved => {
                let path = shortcut(&space, &segments, &found.path, &self.settings.rrt, rng);
                let share = if held.is_some() { self.settings.speed.holding_share } else { 1.0 };
                let limits = self.limits().scaled(share, share);
                // On the way out of a tight start there is less room than the search asks for; its short pieces hardly stray.
                let escaped = head.len();
                let mut points = head;
                points.extend_from_slice(&path[1..]);
                let rounded = SmoothPath::round(&points, self.settings.speed.corner, &[], |corner, a, b| {
                    corner + 1 < escaped || segments.motion_free(a, b)
                });
                Ok(self.settings.speed.time(self.solver.joints(), &points[0], &rounded, &limits))
            }
            SearchStatus::InvalidStart => {
                Err((PlanStage::StartInCollision, self.explain(checker, &q, &query, "the start")))
            }
            SearchStatus::InvalidGoal => {
                let mut goal = q.clone();
                if let Some(first) = goals.first() {
                    self.solver.scatter(&first[0], &mut goal);
                }
                Err((PlanStage::NoPath, self.explain(checker, &goal, &query, "the goal")))
            }
            SearchStatus::Exhausted => Err((
                PlanStage::NoPath,
                format!("no path within {} iterations and {} nodes", found.iterations, found.nodes),
            )),
        };
        counters.checks += segments.checks();
        result
    }

    /// A configuration of the group and, where something is near, a straight way of the hand from it, back or up, as far as
    /// that is free: searches hardly find out of a shelf by themselves.
    pub(crate) fn way_out(
        &self,
        checker: &CollisionChecker,
        query: &CollisionQuery<'_>,
        space: &JointSpace,
        segments: &SegmentCheck<'_>,
        q: &[f64],
    ) -> Vec<Vec<f64>> {
        let near = self.settings.way_out_near;
        let mut chain = vec![self.solver.gather(q)];
        if checker.clearance(q, query, near) >= near {
            return chain;
        }
        let gripper = self.robot.model.fk_link(q, self.robot.gripper);
        let ways = [gripper.rotation * -Vector3::x(), Vector3::z()];
        let longest = ways
            .map(|way| {
                glide(&self.solver, q, &(way * self.settings.way_out_length), WAY_OUT_STEP, |q| {
                    checker.in_collision(q, query)
                })
            })
            .into_iter()
            .max_by_key(Vec::len);
        for q in longest.iter().flatten().skip(1) {
            let next = space.unwrap_near(&chain[chain.len() - 1], &self.solver.gather(q));
            if !space.within_limits(&next) || !segments.motion_free(&chain[chain.len() - 1], &next) {
                break;
            }
            chain.push(next);
        }
        chain
    }

    fn explain(
        &self,
        checker: &CollisionChecker,
        q: &[f64],
        query: &CollisionQuery<'_>,
        what: &str,
    ) -> String {
        match checker.in_collision(q, query) {
            Some(pair) => format!("{what} is in collision: {}", checker.describe(pair)),
            None => format!("{what} is outside the joint limits"),
        }
    }

    /// The margins to search with, and a straight way out when the start is too close to something.
    fn leave_start(
        &self,
        checker: &CollisionChecker,
        held: Option<&HeldObject>,
        q: &[f64],
    ) -> Result<(Margins, Option<CartesianPath>), (PlanStage, String)> {
        let mut margins = self.settings.free_margins;
        let collisions =
            |margins: Margins| checker.collisions(q, &CollisionQuery { held, allowed: &[], margins });
        let mut close = collisions(margins);
        if close.is_empty() {
            return Ok((margins, None));
        }
        // Links that are close to each other in this pose: without the margin between links.
        margins.own = 0.0;
        close = collisions(margins);
        if close.is_empty() {
            return Ok((margins, None));
        }
        let gripper = self.robot.model.fk_link(q, self.robot.gripper);
        let back = gripper.rotation * -Vector3::x();
        let query = CollisionQuery { held, allowed: &close, margins: self.settings.near_margins };
        let clear = CollisionQuery { held, allowed: &[], margins };
        for way in [Vector3::z() * 0.05, back * 0.05, Vector3::z() * 0.12, back * 0.12] {
            let path = translate(&self.solver, q, way, |_, q| checker.in_collision(q, &query));
            if let Ok(path) = path
                && checker.in_collision(path.end(), &clear).is_none()
            {
                return Ok((margins, Some(path)));
            }
        }
        // Not free, but not in contact either: go on with what room there is.
        margins.world = 0.0;
        margins.spread = 0.0;
        match collisions(margins).first() {
            None => Ok((margins, None)),
            Some(pair) => Err((
                PlanStage::StartInCollision,
                format!("the robot is in collision where it stands: {}", checker.describe(*pair)),
            )),
        }
    }

    /// The group's limits times the shares that are used.
    pub(crate) fn limits(&self) -> MotionLimits {
        self.limits_of(self.solver.joints())
    }

    fn limits_of(&self, joints: &[usize]) -> MotionLimits {
        let of = |f: fn(&grip_sim::robot::PlanningLimits) -> f64| {
            joints.iter().map(|&j| f(&self.config.limits[j])).collect()
        };
        let speed = &self.settings.speed;
        MotionLimits { velocity: of(|l| l.velocity), acceleration: of(|l| l.acceleration) }
            .scaled(speed.velocity_share, speed.acceleration_share)
    }

    /// A straight motion at up to `speed` m/s, which stops on contact if it is guarded.
    pub(crate) fn straight(&self, path: &CartesianPath, speed: f64, guarded: bool, holding: bool) -> Action {
        let trajectory = self.time_straight(path, speed, holding);
        let guard = guarded.then(|| {
            let mut q = path.end().to_vec();
            let mut at = |arm: &[f64]| {
                trajectory.joints.iter().zip(arm).for_each(|(&joint, value)| q[joint] = *value);
                self.robot.model.fk_link(&q, self.config.gripper.link).translation.vector
            };
            let end = at(trajectory.last());
            Guard {
                force_n: self.settings.guard_force,
                near: self.settings.guard_near,
                left: trajectory.points.iter().map(|point| (end - at(&point.q)).norm()).collect(),
            }
        });
        Action::Move { trajectory, guard, holding }
    }

    /// Times a straight motion so that the gripper keeps below `speed` m/s.
    pub(crate) fn time_straight(&self, path: &CartesianPath, speed: f64, holding: bool) -> Trajectory {
        let last = path.waypoints.len() - 1;
        let kept: Vec<usize> = (0..last).step_by(THIN).chain([last]).collect();
        let points: Vec<Vec<f64>> = kept.iter().map(|&i| self.solver.gather(&path.waypoints[i])).collect();
        let rates: Vec<f64> = kept
            .windows(2)
            .zip(points.windows(2))
            .map(|(k, p)| {
                let joint: f64 = p[0].iter().zip(&p[1]).map(|(a, b)| (b - a).powi(2)).sum();
                let tool = path.step * (k[1] - k[0]) as f64;
                if tool > 1e-9 { speed * joint.sqrt() / tool } else { f64::INFINITY }
            })
            .collect();
        let share = if holding { self.settings.speed.holding_share } else { 1.0 };
        let limits = self.limits().scaled(share, share);
        let rounded = SmoothPath::round(&points, STRAIGHT_CORNER, &rates, |_, _, _| true);
        self.settings.speed.time(self.solver.joints(), &points[0], &rounded, &limits)
    }
}
