//! The bridge between the search, which knows joint spaces only, and the collision checker.

use std::cell::{Cell, RefCell};

use grip_sim::lanes::{F8, LANES};

use super::ik::IkSolver;
use super::joint_space::JointSpace;
use super::rrt::Validity;
use crate::collision::batch::Batch;
use crate::collision::{CollisionChecker, CollisionQuery};

/// Collision checks of a group's configurations and motions, all other joints fixed.
///
/// Motions are checked at configurations between which no point of the robot moves more than a step; with a step of twice
/// the margin every checked configuration is at least `margin` away from everything, and the whole motion is free.
pub struct SegmentCheck<'a> {
    checker: &'a CollisionChecker,
    query: CollisionQuery<'a>,
    space: &'a JointSpace,
    solver: &'a IkSolver,
    batch: Batch<'a>,
    q: RefCell<Vec<f64>>,
    lanes: RefCell<Vec<F8>>,
    step: f64,
    checks: Cell<usize>,
}

impl<'a> SegmentCheck<'a> {
    /// Checks with `query`, every `step` metres at most; joints outside the group are as in `q`.
    pub fn new(
        checker: &'a CollisionChecker,
        query: CollisionQuery<'a>,
        space: &'a JointSpace,
        solver: &'a IkSolver,
        q: &[f64],
        step: f64,
    ) -> Self {
        Self {
            checker,
            batch: Batch::new(checker, &query, solver.joints(), q),
            query,
            space,
            solver,
            q: RefCell::new(q.to_vec()),
            lanes: RefCell::default(),
            step,
            checks: Cell::new(0),
        }
    }

    /// Configurations checked so far.
    pub fn checks(&self) -> usize {
        self.checks.get()
    }
}

impl Validity for SegmentCheck<'_> {
    fn free(&self, group: &[f64]) -> bool {
        self.checks.set(self.checks.get() + 1);
        let mut q = self.q.borrow_mut();
        self.solver.scatter(group, &mut q);
        self.checker.in_collision(&q, &self.query).is_none()
    }

    fn motion_free(&self, a: &[f64], b: &[f64]) -> bool {
        let steps = (self.space.travel(a, b) / self.step).ceil().max(1.0) as usize;
        let rounds = steps.div_ceil(LANES);
        let way = self.space.difference(a, b);
        let mut lanes = self.lanes.borrow_mut();
        // Each round looks at eight configurations spread over the whole motion: one that is blocked is soon found.
        (0..rounds).all(|round| {
            let share: [f64; LANES] =
                std::array::from_fn(|lane| ((lane + 1) * rounds - round) as f64 / (LANES * rounds) as f64);
            lanes.clear();
            lanes.extend(a.iter().zip(&way).map(|(a, d)| F8(share.map(|t| (a + d * t) as f32))));
            self.checks.set(self.checks.get() + LANES);
            !self.batch.any_collides(&lanes)
        })
    }
}
