//! Picks by grasps of others: they say where to grip, and the rest is planned as always.

use rand_chacha::ChaCha8Rng;

use super::pick_place::{Attempt, Risk};
use crate::belief::{BeliefScene, BinGeometry};
use crate::grasp::{GivenGrasp, ObjectGrasps, free_given};
use crate::place::wished_places;
use crate::plan::{PickPlacePlan, PlanFailure};
use crate::planner::Planner;

impl Planner {
    /// As [`Planner::plan_pick_place`], by grasps of others alone, best first by their score, and to where the first of them that says so
    /// wants the object. A risk is one of places and lifts; whether a grasp is firm is for
    /// their score to say.
    ///
    /// # Errors
    /// As [`Planner::plan_pick_place`].
    pub fn plan_pick_place_with(
        &self,
        belief: &BeliefScene,
        target: usize,
        given: &[GivenGrasp],
        q_now: &[f64],
        risk: Risk,
        seed: u64,
    ) -> Result<PickPlacePlan, PlanFailure> {
        self.plan_to(belief, target, Some(given), q_now, (risk, false), seed)
    }

    /// As [`Planner::plan_put_aside`], by grasps of others alone.
    ///
    /// # Errors
    /// As [`Planner::plan_pick_place`].
    pub fn plan_put_aside_with(
        &self,
        belief: &BeliefScene,
        target: usize,
        given: &[GivenGrasp],
        table: BinGeometry,
        q_now: &[f64],
        seed: u64,
    ) -> Result<PickPlacePlan, PlanFailure> {
        let belief = BeliefScene { bin: table, ..belief.clone() };
        self.plan_to(&belief, target, Some(given), q_now, (Risk::Averse, true), seed)
    }
}

impl Attempt<'_> {
    /// By grasps of others.
    pub(super) fn plan_given(
        &mut self,
        given: &[GivenGrasp],
        known: &ObjectGrasps,
        rng: &mut ChaCha8Rng,
    ) -> Option<PickPlacePlan> {
        let planner = self.planner;
        let settings = &planner.settings.grasp;
        let gripper = &planner.config.gripper;
        let mut grasps = free_given(given, known, self.belief, self.target, &self.checker, gripper, settings);
        self.counters.grasps.candidates = given.len();
        self.counters.grasps.free = grasps.len();
        self.failed.1 = match given.len() {
            0 => "no grasp is given".into(),
            n => format!("the hand is free at none of {n} given grasps"),
        };
        grasps.truncate(planner.settings.grasp_tries);
        let wish = given.iter().find_map(|grasp| grasp.place);
        let place = &planner.settings.place;
        let mut places = wish.map(|wish| wished_places(self.belief, self.target, place, &wish));
        self.plan_by(grasps, &mut places, rng)
    }
}
