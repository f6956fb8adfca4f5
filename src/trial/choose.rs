//! What is to be done next: an object to pack, one to put aside, or one to push.

use std::time::Instant;

use grip_manip::{PickPlacePlan, PlanFailure, PlanStage, PlanStep, Risk};

use super::Trial;
use super::belief::Belief;
use super::look::Seen;
use crate::graspers::Grasper;
use crate::record::Action;
use crate::score::outcome::{Outcome, Stage};

/// What is to be done next.
pub struct Choice {
    /// The object, a position in the setup's list.
    pub object: usize,
    /// How.
    pub plan: PickPlacePlan,
    /// Whether it goes to another place on the table only.
    pub aside: bool,
}

impl Trial<'_> {
    /// Plans for the first open object that can be packed, first what can be picked without a risk in each tier of the
    /// picking order. With [`Risk::Averse`] only of what nothing lies on, and what cannot be packed as it lies is put aside; with
    /// [`Risk::Tolerant`] what that did not find. What is passed over is told why.
    pub fn choose(&mut self, belief: &Belief, seen: &Seen, risk: Risk) -> Option<Choice> {
        let open = self.open_items();
        let mut order = self.planner.pick_order(&belief.scene);
        order.iter_mut().for_each(|tier| tier.retain(|&b| open.contains(&belief.index[b])));
        let targets: Vec<usize> = order.iter().flatten().map(|&b| belief.index[b]).collect();
        for &i in open.iter().filter(|i| !targets.contains(i)) {
            let (outcome, reason) = if belief.index.contains(&i) {
                (Outcome::NotGrasped, "fell into the bin while another item was handled".to_owned())
            } else {
                let of = seen.estimates.iter().find(|(object, _)| *object == i);
                let confidence = of.map_or(0.0, |(_, posterior)| posterior.confidence);
                (Outcome::NotPerceived, format!("confidence {confidence:.2}"))
            };
            self.records[i].pass_over(outcome, Stage::Look, reason);
        }
        let mut tiers = order.into_iter().filter(|tier| !tier.is_empty());
        let free = tiers.next()?;
        let any =
            |trial: &mut Self, tier: &[usize], risk| tier.iter().find_map(|&b| trial.plan(belief, b, risk));
        let choice = any(self, &free, risk);
        if risk == Risk::Averse {
            return choice.or_else(|| free.iter().find_map(|&b| self.plan_aside(belief, b)));
        }
        choice.or_else(|| {
            let risks = [Risk::Averse, Risk::Tolerant];
            tiers.find_map(|tier| risks.into_iter().find_map(|risk| any(self, &tier, risk)))
        })
    }

    /// A plan for object `b` of the belief, or a word in its record why there is none.
    fn plan(&mut self, belief: &Belief, b: usize, risk: Risk) -> Option<Choice> {
        let (i, number) = (belief.index[b], self.number());
        let name = self.name(i);
        self.progress.message(&format!("look {}: planning for {name}", number + 1));
        let clock = Instant::now();
        let seed = self.setup.stream(&format!("plan/{number}/{i}"));
        let (scene, q) = (&belief.scene, &self.joints());
        let plan = match &belief.grasps {
            None => self.planner.plan_pick_place(scene, b, q, risk, seed),
            Some(given) => self.planner.plan_pick_place_with(scene, b, &given[b], q, risk, seed),
        };
        self.records[i].plan_s += clock.elapsed().as_secs_f64();
        self.searched(i, Action::Pack, risk, plan.as_ref(), clock);
        match plan {
            Ok(plan) => Some(Choice { object: i, plan, aside: false }),
            Err(failure) => {
                log::debug!("{failure}: {:?}", failure.counters);
                let outcome = match failure.stage {
                    PlanStage::NoPlacePose | PlanStage::NoPlaceIk => Outcome::NoPlace,
                    PlanStage::NoGrasp | PlanStage::NoIk | PlanStage::NoApproach | PlanStage::NoLift => {
                        Outcome::NoGrasp
                    }
                    _ => Outcome::NoPath,
                };
                let reason = match &self.options.grasper {
                    Grasper::Grip => failure.to_string(),
                    Grasper::Other { name, .. } => format!("{failure}, by grasps of {name}"),
                };
                self.records[i].pass_over(outcome, Stage::Plan, reason);
                None
            }
        }
    }

    fn searched(
        &mut self,
        item: usize,
        action: Action,
        risk: Risk,
        plan: Result<&PickPlacePlan, &PlanFailure>,
        clock: Instant,
    ) {
        let body = self.bodies.of(item);
        self.recorder.took("plan", Some(body), clock.elapsed());
        self.recorder.planned((body, self.world.time()), action, risk, plan);
    }

    /// A plan to put object `b` of the belief elsewhere on the table, where it can be gripped anew.
    fn plan_aside(&mut self, belief: &Belief, b: usize) -> Option<Choice> {
        let i = belief.index[b];
        if self.records[i].put_aside >= self.setup.settings.trial.max_put_aside {
            return None;
        }
        let clock = Instant::now();
        let seed = self.setup.stream(&format!("aside/{}/{i}", self.number()));
        let table = self.setup.cell.free_table();
        let (scene, q) = (&belief.scene, &self.joints());
        let plan = match &belief.grasps {
            None => self.planner.plan_put_aside(scene, b, table, q, seed),
            Some(given) => self.planner.plan_put_aside_with(scene, b, &given[b], table, q, seed),
        };
        self.records[i].plan_s += clock.elapsed().as_secs_f64();
        self.searched(i, Action::Aside, Risk::Averse, plan.as_ref(), clock);
        plan.map_err(|failure| log::debug!("aside: {failure}")).ok().map(|plan| Choice {
            object: i,
            plan,
            aside: true,
        })
    }

    /// How to push an open object, a position in the setup's list, away from what is near it, so that the next look finds something
    /// that can be picked; none where no push is possible, or there were enough.
    pub fn plan_push(&self, belief: &Belief) -> Option<(usize, Vec<PlanStep>)> {
        let setup = self.setup;
        if self.pushes >= setup.settings.trial.max_pushes {
            return None;
        }
        let open = self.open_items();
        let mut targets = self.planner.pick_order(&belief.scene).concat();
        targets.retain(|&b| open.contains(&belief.index[b]));
        // Each time another one: what did not come apart by one push hardly does by the same again.
        let first = self.pushes as usize % targets.len().max(1);
        targets.rotate_left(first);
        let seed = setup.stream(&format!("push/{}", self.number()));
        targets.into_iter().find_map(|b| {
            let plan = self.planner.plan_push(&belief.scene, b, &self.joints(), seed);
            plan.map_err(|failure| log::debug!("push: {failure}")).ok().map(|steps| (belief.index[b], steps))
        })
    }
}
