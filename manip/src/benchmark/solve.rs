//! Solves motion planning problems and checks the solutions: what `grip plan` measures.

use std::time::Instant;

use rand_chacha::ChaCha8Rng;
use schemars::JsonSchema;
use serde::Serialize;

use super::moveit::MotionProblem;
use crate::belief::BeliefScene;
use crate::collision::{CollisionChecker, CollisionQuery, Margins};
use crate::motion::{
    RrtSettings, SearchStatus, SegmentCheck, SmoothPath, Trajectory, Validity, rrt_connect, shortcut,
};
use crate::planner::Planner;

/// What became of a problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProblemStatus {
    /// A path was found, and its trajectory is free at every check.
    Solved,
    /// The start is in collision in our model.
    InvalidStart,
    /// The goal is in collision in our model.
    InvalidGoal,
    /// No path was found.
    NoPath,
    /// A path was found, but its trajectory is not free.
    Recheck,
}

/// A problem's result.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct ProblemResult {
    /// The problem.
    pub name: String,
    /// What became of it.
    pub status: ProblemStatus,
    /// Who collides, or why there is no path.
    pub reason: Option<String>,
    /// Wall milliseconds from the problem to a path: preparing the scene's solids and searching.
    pub search_ms: f64,
    /// Wall milliseconds of shortening it.
    pub simplify_ms: f64,
    /// Wall milliseconds of rounding its corners and timing it.
    pub timing_ms: f64,
    /// Extensions of the search's trees.
    pub iterations: usize,
    /// Nodes of both trees.
    pub nodes: usize,
    /// Configurations checked while searching and shortening.
    pub checks: usize,
    /// Distance that the solution was planned to keep from obstacles, metres.
    pub margin_m: f64,
    /// Length of the found and of the shortened path, Euclidean norm of joint values (radians and metres).
    pub path_length: [f64; 2],
    /// Duration of the trajectory, seconds.
    pub duration_s: f64,
    /// Instants of the trajectory that the exact checker looked at, 1 ms apart.
    pub rechecked: usize,
    /// Distance from obstacles at the nearest of them, metres, at most 0.05.
    pub clearance_m: Option<f64>,
}

/// The trajectory's instants are checked this far apart, seconds.
const RECHECK_S: f64 = 0.001;
/// Distances from obstacles that are tried to be kept, metres: as far as start and goal allow.
const MARGINS: [f64; 3] = [0.005, 0.002, 0.0];
/// The robot moves at most this far between two checks of a search, metres, or twice the margin where that is more. It is a
/// sum over the joints and four times what a point moves, as a rule; what lies between two checks shows when the trajectory
/// is checked again.
const LEAST_STEP: f64 = 0.03;
/// No robot waits here: a search goes on until this many extensions.
const MOST_ITERATIONS: usize = 200_000;

impl Planner {
    /// Solves a problem and checks the timed trajectory every millisecond.
    pub fn solve(&self, problem: &MotionProblem, seed: u64) -> (ProblemResult, Option<Trajectory>) {
        let mut result = ProblemResult {
            name: problem.name.clone(),
            status: ProblemStatus::NoPath,
            reason: None,
            search_ms: 0.0,
            simplify_ms: 0.0,
            timing_ms: 0.0,
            iterations: 0,
            nodes: 0,
            checks: 0,
            margin_m: 0.0,
            path_length: [0.0; 2],
            duration_s: 0.0,
            rechecked: 0,
            clearance_m: None,
        };
        let clock = Instant::now();
        // A world whose frame is the robot's base.
        let scene = BeliefScene::without_bin(problem.obstacles.clone());
        let checker = CollisionChecker::new(self.robot.clone(), &scene);
        let (start, goal) = (self.clamped(&problem.start), self.clamped(&problem.goal));
        let touching = Margins::TOUCHING;
        let exact = CollisionQuery { held: None, allowed: &[], margins: touching };
        for (q, status, what) in
            [(&start, ProblemStatus::InvalidStart, "start"), (&goal, ProblemStatus::InvalidGoal, "goal")]
        {
            if let Some(pair) = checker.in_collision(q, &exact) {
                result.status = status;
                result.reason = Some(format!("{what}: {}", describe(&checker, problem, pair)));
                return (result, None);
            }
        }
        let keeps = |margins: Margins| {
            let query = CollisionQuery { held: None, allowed: &[], margins };
            [&start, &goal].iter().all(|q| checker.in_collision(q, &query).is_none())
        };
        let own = [0.005, 0.0].into_iter().find(|&own| keeps(Margins { own, ..touching })).unwrap_or(0.0);
        let world =
            MARGINS.into_iter().find(|&world| keeps(Margins { world, own, spread: 0.0 })).unwrap_or(0.0);
        result.margin_m = world;
        let query = CollisionQuery { margins: Margins { world, own, spread: 0.0 }, ..exact };
        let prepared = clock.elapsed().as_secs_f64();

        let mut rng = grip_sim::rng::stream(seed, &problem.name);
        let mut step = (2.0 * world).max(LEAST_STEP);
        // Where no distance is kept, a motion may graze what lies between two checks: then again, with finer ones.
        for attempt in 0..3 {
            let solution = self.attempt(&checker, query, (&start, &goal), step, &mut rng, &mut result);
            if attempt == 0 {
                result.search_ms += prepared * 1e3;
            }
            let Some(trajectory) = solution else {
                return (result, None);
            };
            if self.recheck(&checker, &exact, &start, &trajectory, problem, &mut result) {
                result.status = ProblemStatus::Solved;
                result.reason = None;
                return (result, Some(trajectory));
            }
            result.status = ProblemStatus::Recheck;
            step *= 0.25;
        }
        (result, None)
    }

    /// Searches, shortens and times, adding to the figures.
    fn attempt(
        &self,
        checker: &CollisionChecker,
        query: CollisionQuery<'_>,
        (start, goal): (&[f64], &[f64]),
        step: f64,
        rng: &mut ChaCha8Rng,
        result: &mut ProblemResult,
    ) -> Option<Trajectory> {
        let clock = Instant::now();
        let space = self.solver.space(0.0);
        let segments = SegmentCheck::new(checker, query, &space, &self.solver, start, step);
        let [from, to] = [start, goal].map(|q| self.way_out(checker, &query, &space, &segments, q));
        let settings = RrtSettings { max_iterations: MOST_ITERATIONS, ..self.settings.rrt };
        let found = rrt_connect(&space, &segments, &from, &[to], &settings, rng);
        result.search_ms += clock.elapsed().as_secs_f64() * 1e3;
        result.iterations += found.iterations;
        result.nodes = result.nodes.max(found.nodes);
        result.checks += segments.checks();
        if found.status != SearchStatus::Solved {
            result.reason = Some(format!("no path after {} iterations", found.iterations));
            return None;
        }
        let before = segments.checks();
        let clock = Instant::now();
        let path = shortcut(&space, &segments, &found.path, &settings, rng);
        result.simplify_ms += clock.elapsed().as_secs_f64() * 1e3;
        result.checks += segments.checks() - before;
        result.path_length = [length(&found.path), length(&path)];
        let clock = Instant::now();
        let rounded =
            SmoothPath::round(&path, self.settings.speed.corner, &[], |_, a, b| segments.motion_free(a, b));
        let trajectory = self.settings.speed.time(self.solver.joints(), &path[0], &rounded, &self.limits());
        result.timing_ms += clock.elapsed().as_secs_f64() * 1e3;
        result.duration_s = trajectory.duration;
        Some(trajectory)
    }

    /// Whether the trajectory is free at every millisecond by the exact checker.
    fn recheck(
        &self,
        checker: &CollisionChecker,
        exact: &CollisionQuery<'_>,
        start: &[f64],
        trajectory: &Trajectory,
        problem: &MotionProblem,
        result: &mut ProblemResult,
    ) -> bool {
        let instants = (trajectory.duration / RECHECK_S).ceil() as usize;
        result.rechecked = instants + 1;
        let mut q = start.to_vec();
        let mut clearance: f64 = 0.05;
        for i in 0..=instants {
            let t = i as f64 * RECHECK_S;
            for (&joint, v) in trajectory.joints.iter().zip(trajectory.sample(t).0) {
                q[joint] = v;
            }
            if let Some(pair) = checker.in_collision(&q, exact) {
                result.reason = Some(format!("after {t:.3} s: {}", describe(checker, problem, pair)));
                return false;
            }
            // The distance costs more than the check: every 20 ms is enough to tell how near the way leads.
            if i % 20 == 0 {
                clearance = clearance.min(checker.clearance(&q, exact, clearance));
            }
        }
        result.clearance_m = Some(clearance);
        true
    }
}

fn describe(
    checker: &CollisionChecker,
    problem: &MotionProblem,
    pair: crate::collision::CollisionPair,
) -> String {
    let name = |body| match body {
        crate::collision::CollisionBody::Fixture(i) => problem.names[i].clone(),
        other => checker.name(other),
    };
    format!("{} and {}", name(pair.a), name(pair.b))
}

fn length(path: &[Vec<f64>]) -> f64 {
    path.windows(2).map(|w| w[0].iter().zip(&w[1]).map(|(a, b)| (b - a).powi(2)).sum::<f64>().sqrt()).sum()
}
