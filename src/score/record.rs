//! What is known about each item while a trial goes on, and the verdict that it leaves.

use grip_manip::executor::{ExecCause, ExecStage, ExecutionReport};
use grip_physics::World;
use grip_sim::pose::{Object, Pose, World as WorldFrame};
use grip_sim::scene::Scene;

use super::bodies::Bodies;
use super::outcome::{Clauses, FailedAttempt, FirstAttempt, ItemResult, Measures, Outcome, Stage};
use super::{below_edge_m, in_bin, tilt_deg, upright};
use crate::settings::SuccessCriteria;

/// Everything that is known about one item while the trial goes on.
#[derive(Debug, Clone, Default)]
pub struct ItemRecord {
    pub attempts: u32,
    /// How often it was put aside on the table.
    pub put_aside: u32,
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

impl ItemRecord {
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

    /// Whether it is to be tried, again or for the first time, when so many attempts are allowed.
    pub fn is_open(&self, max_attempts: u32) -> bool {
        self.believed_packed.is_none() && self.attempts < max_attempts
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

/// Final outcomes, when everything has come to rest; how far each body has moved in the last second comes with the world.
pub fn finish(
    scene: &Scene,
    (world, moved): (&World, &[f64]),
    criteria: &SuccessCriteria,
    (records, bodies): (&mut [ItemRecord], &Bodies),
    items: usize,
) -> Vec<ItemResult> {
    records
        .iter_mut()
        .enumerate()
        .take(items)
        .map(|(i, record)| {
            let body = bodies.of(i);
            let info = &world.object(body).info;
            let at_rest = world.speed(body) < criteria.at_rest_m_s && moved[body] <= criteria.rest_m;
            record.clauses.in_bin = in_bin(world, scene, body) && at_rest;
            record.clauses.upright = upright(world, body, criteria);
            record.clauses.set_down = record.measures.release_m <= criteria.release_m
                && record.measures.landing_m_s <= criteria.landing_m_s;
            record.clauses.unharmed =
                !criteria.unharmed || record.measures.packed_impulse_n_s <= info.harmless_impulse_n_s();
            record.clauses.nothing_knocked_out = !record.knocked_others;
            record.measures.below_edge_m = below_edge_m(world, scene, body);
            record.measures.speed_m_s = world.speed(body);
            record.measures.tilt_deg = tilt_deg(world, body);
            record.measures.moved_m = moved[body];
            let (outcome, stage, reason) = verdict(record, criteria);
            ItemResult {
                object: info.name.clone(),
                instance: instance(world, body),
                outcome,
                stage,
                reason,
                attempts: record.attempts,
                add_m: record.add_m,
                adds_m: record.adds_m,
                slip_m: record.slip_m,
                peak_force_n: record.peak_force_n,
                peak_impulse_n_s: record.peak_impulse_n_s,
                harmless_impulse_n_s: info.harmless_impulse_n_s(),
                others_moved_m: record.others_moved_m,
                first_attempt: record.first_attempt,
                failed_attempts: record.failed_attempts.clone(),
                clauses: record.clauses,
                measures: record.measures,
            }
        })
        .collect()
}

/// The number of body `i` among those of its kind, from 1 on.
fn instance(world: &World, i: usize) -> u32 {
    let name = &world.object(i).info.name;
    1 + (0..i).filter(|&other| world.object(other).info.name == *name).count() as u32
}

/// The outcome that the clauses of the last attempt leave, whatever the robot believed.
fn verdict(record: &ItemRecord, criteria: &SuccessCriteria) -> (Outcome, Stage, String) {
    let c = record.clauses;
    if record.knocked_out && !c.in_bin {
        return (Outcome::KnockedOut, Stage::Done, "knocked out while another item was handled".into());
    }
    if record.wrong_object {
        return (Outcome::WrongObject, Stage::Grasp, "the fingers closed on another object".into());
    }
    if let Some((outcome, stage, reason)) = &record.failure {
        return (*outcome, *stage, reason.clone());
    }
    if record.attempts == 0 {
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
        let (mm, deg) = (1e3 * criteria.slip_m, criteria.slip_deg);
        let reason = format!("moved over {mm} mm or turned over {deg} degrees in the hand");
        failed(Outcome::Slipped, Stage::Carry, &reason)
    } else if !c.upright {
        let reason = format!("leans over {} degrees, but must stand", criteria.tilt_deg);
        failed(Outcome::NotUpright, Stage::Done, &reason)
    } else if !c.set_down {
        let Measures { release_m, landing_m_s, .. } = record.measures;
        let reason = format!("let fall by {:.0} mm, at up to {landing_m_s:.2} m/s", 1e3 * release_m);
        failed(Outcome::Dropped, Stage::Place, &reason)
    } else if !c.unharmed {
        let reason = format!("took a blow of {:.2} N s", record.measures.packed_impulse_n_s);
        failed(Outcome::Harmed, Stage::Done, &reason)
    } else if !c.nothing_knocked_out {
        failed(Outcome::Disturbed, Stage::Done, "another item was knocked off the table or out of the bin")
    } else {
        failed(Outcome::NotGrasped, Stage::Done, "in the bin, but not by a grasp that held all the way")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(record: &ItemRecord) -> (Outcome, Stage, String) {
        verdict(record, &SuccessCriteria::default())
    }

    fn packed() -> ItemRecord {
        let clauses = Clauses {
            opposing_contacts: true,
            lifted_clear: true,
            held_after_carry: true,
            slip_within: true,
            in_bin: true,
            upright: true,
            set_down: true,
            unharmed: true,
            nothing_knocked_out: true,
        };
        ItemRecord { attempts: 1, clauses, ..ItemRecord::default() }
    }

    #[test]
    fn each_clause_alone_undoes_a_success() {
        assert_eq!(judged(&packed()).0, Outcome::Packed);
        type Break = fn(&mut Clauses);
        let breaks: [(Break, Outcome); 9] = [
            (|c| c.opposing_contacts = false, Outcome::NotGrasped),
            (|c| c.lifted_clear = false, Outcome::NotGrasped),
            (|c| c.held_after_carry = false, Outcome::NotGrasped),
            (|c| c.slip_within = false, Outcome::Slipped),
            (|c| c.in_bin = false, Outcome::PlacedOutside),
            (|c| c.upright = false, Outcome::NotUpright),
            (|c| c.set_down = false, Outcome::Dropped),
            (|c| c.unharmed = false, Outcome::Harmed),
            (|c| c.nothing_knocked_out = false, Outcome::Disturbed),
        ];
        for (break_it, outcome) in breaks {
            let mut record = packed();
            break_it(&mut record.clauses);
            assert_eq!(judged(&record).0, outcome);
        }
    }

    #[test]
    fn the_first_attempt_stays_what_it_was() {
        let mut record = packed();
        assert_eq!(record.first_attempt, None);
        record.clauses.held_after_carry = false;
        record.record_errors(Some((0.02, 0.01)));
        record.close_attempt();
        record.clauses.held_after_carry = true;
        record.record_errors(Some((0.001, 0.001)));
        record.close_attempt();
        let first = FirstAttempt { add_m: Some(0.02), adds_m: Some(0.01), held: false };
        assert_eq!(record.first_attempt, Some(first));
    }

    #[test]
    fn what_the_robot_reports_as_failed_is_never_a_success() {
        let mut record = packed();
        record.fail(Outcome::DroppedInTransit, Stage::Carry, "fingers closed");
        assert_eq!(judged(&record).0, Outcome::DroppedInTransit);
        let wrong = ItemRecord { wrong_object: true, ..packed() };
        assert_eq!(judged(&wrong).0, Outcome::WrongObject);
        assert_eq!(judged(&ItemRecord::default()).0, Outcome::NotAttempted);
    }

    /// A can that stands in the bin, let fall there by 4 cm: where it is, its blow, and whether it is packed.
    #[test]
    fn what_still_creeps_or_was_let_fall_hard_is_not_packed() {
        let (setup, _) = crate::score::tests::empty();
        let can = setup.library.load("005_tomato_soup_can").unwrap();
        let outcome = |fall: f64, fragility, moved_m: f64| {
            let mut model = (*can).clone();
            model.info.fragility = fragility;
            let (_, mut world) = crate::score::tests::empty();
            let above = nalgebra::Isometry3::translation(0.0, 0.0, 0.052 + fall);
            let at = setup.cell.scene.bin.world_from_bin() * above;
            world.add_object(std::sync::Arc::new(model), &Pose::new(at)).unwrap();
            world.reset_peaks();
            world.settle(3.0);
            let mut record = packed();
            record.measures.packed_impulse_n_s = world.peak_impulse(0);
            let (mut records, bodies) = ([record], Bodies::new(1));
            let criteria = &setup.settings.success;
            let scene = &setup.cell.scene;
            finish(scene, (&world, &[moved_m]), criteria, (&mut records, &bodies), 1).remove(0).outcome
        };
        use grip_sim::objects::Fragility::{Fragile, Sturdy};
        assert_eq!(outcome(0.001, Fragile, 0.001), Outcome::Packed);
        assert_eq!(outcome(0.001, Fragile, 0.003), Outcome::PlacedOutside);
        assert_eq!(outcome(0.04, Fragile, 0.001), Outcome::Harmed);
        assert_eq!(outcome(0.04, Sturdy, 0.001), Outcome::Packed);
    }
}
