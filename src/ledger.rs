//! What is known about each item while a trial goes on, and the verdict that it leaves.

use grip_manip::executor::{ExecCause, ExecStage, ExecutionReport};
use grip_sim::physics::World;
use grip_sim::pose::{Object, Pose, World as WorldFrame};

use crate::outcome::{Clauses, FailedAttempt, FirstAttempt, ItemResult, Measures, Outcome, Stage};
use crate::score;
use crate::scorecard::harmless_impulse;
use crate::setup::Setup;

/// An object is given up after this many attempts.
const MAX_ATTEMPTS: u32 = 3;
/// Speed below which an item counts as at rest, m/s.
const AT_REST_M_S: f64 = 0.01;

/// Everything that is known about one item while the trial goes on.
#[derive(Debug, Clone, Default)]
pub struct Ledger {
    pub attempts: u32,
    /// The executor says that it lies in the bin, and where.
    pub believed_packed: Option<Pose<WorldFrame, Object>>,
    pub failure: Option<(Outcome, Stage, String)>,
    pub clauses: Clauses,
    pub measures: Measures,
    pub add_m: Option<f64>,
    pub adds_m: Option<f64>,
    pub estimate_s: f64,
    pub plan_s: f64,
    pub slip_m: Option<f64>,
    pub peak_force_n: f64,
    pub knocked_out: bool,
    /// Another item was knocked out during an attempt at this one.
    pub knocked_others: bool,
    /// The fingers pinched another object instead.
    pub wrong_object: bool,
    /// Attempts in which they did.
    pub wrong_objects: u32,
    /// How the first attempt went.
    pub first_attempt: Option<FirstAttempt>,
    /// Attempts that failed by the robot's own account.
    pub failed_attempts: Vec<FailedAttempt>,
    /// Other items that moved during attempts at this one: on the table, in the bin.
    pub disturbed: [u32; 2],
    /// Farthest that a point of another item moved meanwhile, metres.
    pub others_moved_m: f64,
    /// Largest blow in the whole trial, newton seconds.
    pub peak_impulse_n_s: f64,
}

impl Ledger {
    pub fn fail(&mut self, outcome: Outcome, stage: Stage, reason: impl Into<String>) {
        self.failure = Some((outcome, stage, reason.into()));
    }

    /// An attempt failed, as far as the robot could tell.
    pub fn fail_attempt(&mut self, outcome: Outcome, stage: Stage, reason: String) {
        self.failed_attempts.push(FailedAttempt { outcome, stage, reason: reason.clone() });
        self.fail(outcome, stage, reason);
    }

    pub fn record_errors(&mut self, add_and_adds: Option<(f64, f64)>) {
        self.add_m = add_and_adds.map(|(add, _)| add);
        self.adds_m = add_and_adds.map(|(_, adds)| adds);
    }

    /// An attempt has ended, by whatever account; clauses and errors are known.
    pub fn close_attempt(&mut self) {
        let c = self.clauses;
        self.first_attempt.get_or_insert(FirstAttempt {
            add_m: self.add_m,
            adds_m: self.adds_m,
            held: c.opposing_contacts && c.lifted_clear && c.held_after_carry && c.slip_within,
        });
    }

    /// Why an item was not even tried again; what an attempt has shown weighs more.
    pub fn pass_over(&mut self, outcome: Outcome, stage: Stage, reason: impl Into<String>) {
        if self.attempts == 0 {
            self.fail(outcome, stage, reason);
        }
    }

    pub fn is_open(&self) -> bool {
        self.believed_packed.is_none() && self.attempts < MAX_ATTEMPTS
    }
}

/// What went wrong by the executor's own account; `None` when it says that all is well.
pub fn failure_of(report: &ExecutionReport) -> Option<(Outcome, Stage, String)> {
    let (stage, cause, reason) = report.failure()?;
    let outcome = match (stage, cause) {
        (ExecStage::Approach, _) => Outcome::CollisionOnApproach,
        (_, ExecCause::Missed) | (ExecStage::Grasp, _) => Outcome::Missed,
        (ExecStage::Lift, ExecCause::Lost) => Outcome::SlippedOnLift,
        (ExecStage::Carry | ExecStage::Place, ExecCause::Lost) => Outcome::DroppedInTransit,
        (_, ExecCause::Contact | ExecCause::Astray) => Outcome::CollisionInTransit,
    };
    let stage = match stage {
        ExecStage::Approach => Stage::Approach,
        ExecStage::Grasp => Stage::Grasp,
        ExecStage::Lift => Stage::Lift,
        ExecStage::Carry => Stage::Carry,
        ExecStage::Place => Stage::Place,
    };
    Some((outcome, stage, reason.to_owned()))
}

/// Final outcomes, when everything has come to rest.
pub fn finish(setup: &Setup, world: &World, ledgers: &mut [Ledger], items: usize) -> Vec<ItemResult> {
    ledgers
        .iter_mut()
        .enumerate()
        .take(items)
        .map(|(i, ledger)| {
            ledger.clauses.in_bin = score::in_bin(world, &setup.scene, i) && world.speed(i) < AT_REST_M_S;
            ledger.clauses.upright = score::upright(world, i);
            ledger.clauses.nothing_knocked_out = !ledger.knocked_others;
            ledger.measures.below_edge_m = score::below_edge_m(world, &setup.scene, i);
            ledger.measures.speed_m_s = world.speed(i);
            ledger.measures.tilt_deg = score::tilt_deg(world, i);
            let (outcome, stage, reason) = verdict(ledger);
            ItemResult {
                object: setup.models[i].info.name.clone(),
                outcome,
                stage,
                reason,
                attempts: ledger.attempts,
                add_m: ledger.add_m,
                adds_m: ledger.adds_m,
                slip_m: ledger.slip_m,
                peak_force_n: ledger.peak_force_n,
                peak_impulse_n_s: ledger.peak_impulse_n_s,
                harmless_impulse_n_s: harmless_impulse(world, i),
                others_moved_m: ledger.others_moved_m,
                first_attempt: ledger.first_attempt,
                failed_attempts: ledger.failed_attempts.clone(),
                clauses: ledger.clauses,
                measures: ledger.measures,
            }
        })
        .collect()
}

/// The outcome that the clauses of the last attempt leave, whatever the robot believed.
fn verdict(ledger: &Ledger) -> (Outcome, Stage, String) {
    let c = ledger.clauses;
    if ledger.knocked_out && !c.in_bin {
        return (Outcome::KnockedOut, Stage::Done, "knocked out while another item was handled".into());
    }
    if ledger.wrong_object {
        return (Outcome::WrongObject, Stage::Grasp, "the fingers closed on another object".into());
    }
    if let Some((outcome, stage, reason)) = &ledger.failure {
        return (*outcome, *stage, reason.clone());
    }
    if ledger.attempts == 0 {
        return (Outcome::NotAttempted, Stage::Look, "the trial ended before".into());
    }
    let failed = |outcome, stage, reason: &str| (outcome, stage, reason.to_string());
    if c.all() {
        failed(Outcome::Packed, Stage::Done, "")
    } else if !c.opposing_contacts && !c.in_bin {
        failed(Outcome::Missed, Stage::Grasp, "no opposing finger contacts when the lift began")
    } else if !c.lifted_clear && !c.in_bin {
        failed(Outcome::SlippedOnLift, Stage::Lift, "never lifted clear")
    } else if !c.held_after_carry && !c.in_bin {
        failed(Outcome::DroppedInTransit, Stage::Carry, "not held at the end of the carry")
    } else if !c.in_bin {
        failed(Outcome::PlacedOutside, Stage::Place, "not at rest in the bin at the end")
    } else if c.opposing_contacts && c.lifted_clear && c.held_after_carry && !c.slip_within {
        failed(Outcome::Slipped, Stage::Carry, "moved over 20 mm or turned over 20 degrees in the hand")
    } else if !c.upright {
        failed(Outcome::NotUpright, Stage::Done, "leans over 30 degrees, but must stand")
    } else if !c.nothing_knocked_out {
        failed(Outcome::Disturbed, Stage::Done, "another item was knocked off the table or out of the bin")
    } else {
        failed(Outcome::NotGrasped, Stage::Done, "in the bin, but not by a grasp that held all the way")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packed() -> Ledger {
        let clauses = Clauses {
            opposing_contacts: true,
            lifted_clear: true,
            held_after_carry: true,
            slip_within: true,
            in_bin: true,
            upright: true,
            nothing_knocked_out: true,
        };
        Ledger { attempts: 1, clauses, ..Ledger::default() }
    }

    #[test]
    fn each_clause_alone_undoes_a_success() {
        assert_eq!(verdict(&packed()).0, Outcome::Packed);
        type Break = fn(&mut Clauses);
        let breaks: [(Break, Outcome); 7] = [
            (|c| c.opposing_contacts = false, Outcome::NotGrasped),
            (|c| c.lifted_clear = false, Outcome::NotGrasped),
            (|c| c.held_after_carry = false, Outcome::NotGrasped),
            (|c| c.slip_within = false, Outcome::Slipped),
            (|c| c.in_bin = false, Outcome::PlacedOutside),
            (|c| c.upright = false, Outcome::NotUpright),
            (|c| c.nothing_knocked_out = false, Outcome::Disturbed),
        ];
        for (break_it, outcome) in breaks {
            let mut ledger = packed();
            break_it(&mut ledger.clauses);
            assert_eq!(verdict(&ledger).0, outcome);
        }
    }

    #[test]
    fn the_first_attempt_stays_what_it_was() {
        let mut ledger = packed();
        assert_eq!(ledger.first_attempt, None);
        ledger.clauses.held_after_carry = false;
        ledger.record_errors(Some((0.02, 0.01)));
        ledger.close_attempt();
        ledger.clauses.held_after_carry = true;
        ledger.record_errors(Some((0.001, 0.001)));
        ledger.close_attempt();
        let first = FirstAttempt { add_m: Some(0.02), adds_m: Some(0.01), held: false };
        assert_eq!(ledger.first_attempt, Some(first));
    }

    #[test]
    fn what_the_robot_reports_as_failed_is_never_a_success() {
        let mut ledger = packed();
        ledger.fail(Outcome::DroppedInTransit, Stage::Carry, "fingers closed");
        assert_eq!(verdict(&ledger).0, Outcome::DroppedInTransit);
        let wrong = Ledger { wrong_object: true, ..packed() };
        assert_eq!(verdict(&wrong).0, Outcome::WrongObject);
        assert_eq!(verdict(&Ledger::default()).0, Outcome::NotAttempted);
    }
}
