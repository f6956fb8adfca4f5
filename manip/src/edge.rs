//! The bridge between the search, which knows joint spaces only, and the collision checker.

use std::cell::{Cell, RefCell};

use crate::collision::{CollisionChecker, Query};
use crate::ik::IkSolver;
use crate::rrt::Validity;
use crate::space::JointSpace;

/// Collision checks of a group's configurations and motions, all other joints fixed.
///
/// Motions are checked at configurations between which no point of the robot moves more than `2 * margin`: with every
/// checked configuration at least `margin` away from everything, the whole motion is free.
pub struct EdgeCheck<'a> {
    checker: &'a CollisionChecker,
    query: Query<'a>,
    space: &'a JointSpace,
    solver: &'a IkSolver,
    q: RefCell<Vec<f64>>,
    step: f64,
    checks: Cell<usize>,
}

impl<'a> EdgeCheck<'a> {
    /// Checks with `query`; joints outside the group are as in `q`.
    pub fn new(
        checker: &'a CollisionChecker,
        query: Query<'a>,
        space: &'a JointSpace,
        solver: &'a IkSolver,
        q: &[f64],
    ) -> Self {
        Self {
            checker,
            step: (2.0 * query.margins.world).max(0.004),
            query,
            space,
            solver,
            q: RefCell::new(q.to_vec()),
            checks: Cell::new(0),
        }
    }

    /// The same with another bound on the motion between checks, metres.
    pub fn with_step(mut self, step: f64) -> Self {
        self.step = step;
        self
    }

    /// Configurations checked so far.
    pub fn checks(&self) -> usize {
        self.checks.get()
    }
}

impl Validity for EdgeCheck<'_> {
    fn free(&self, group: &[f64]) -> bool {
        self.checks.set(self.checks.get() + 1);
        let mut q = self.q.borrow_mut();
        self.solver.scatter(group, &mut q);
        self.checker.in_collision(&q, &self.query).is_none()
    }

    fn motion_free(&self, a: &[f64], b: &[f64]) -> bool {
        let n = (self.space.travel(a, b) / self.step).ceil().max(1.0) as usize;
        // Coarse to fine: a blocked motion is found after a few checks. Every k in 1..=n has one odd multiple of a
        // power of two, so each is visited once.
        let mut stride = n.next_power_of_two();
        if !self.free(b) {
            return false;
        }
        while stride >= 1 {
            let mut k = stride;
            while k < n {
                if !self.free(&self.space.interpolate(a, b, k as f64 / n as f64)) {
                    return false;
                }
                k += 2 * stride;
            }
            stride /= 2;
        }
        true
    }
}
