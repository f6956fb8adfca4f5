//! What a trial produced, as plain data: the schema of result.json and of `--json`.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::motion_check::MotionCheck;
use crate::graspers::GRIP;
use crate::setup::CalibrationRecord;

/// Version of the trial result; changes with every change that could break a reader.
pub const TRIAL_SCHEMA: &str = "grip.trial/5";

/// What became of an item. Everything but [`Outcome::Packed`] is a failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Grasped, lifted, carried and at rest inside the bin at the end, with nothing knocked out on the way.
    Packed,
    /// The estimator was not confident enough to act.
    NotPerceived,
    /// An estimator of others crashed, was silent or talked nonsense.
    EstimatorFailed,
    /// A grasp planner of others crashed, was silent or talked nonsense.
    GrasperFailed,
    /// Another object than the one believed to be there was handled.
    WrongObject,
    /// No grasp that the arm reaches without collision.
    NoGrasp,
    /// Grasps, but no free place in the bin that the arm reaches.
    NoPlace,
    /// Grasp and place, but no path between them.
    NoPath,
    /// The arm or hand ran into something before the grasp.
    CollisionOnApproach,
    /// The fingers closed on nothing.
    Missed,
    /// Lost while lifting.
    SlippedOnLift,
    /// Lost on the way to the bin.
    DroppedInTransit,
    /// The arm or the held object ran into something on the way.
    CollisionInTransit,
    /// Released, but not at rest inside the bin at the end.
    PlacedOutside,
    /// In the bin, but another item was knocked off the table or out of the bin.
    Disturbed,
    /// In the bin, but it slipped or turned in the hand beyond the bounds.
    Slipped,
    /// In the bin, but tipped over although it must stand.
    NotUpright,
    /// In the bin, but let fall, or landed too fast.
    Dropped,
    /// In the bin, but by a blow that does it harm.
    Harmed,
    /// In the bin, but not by a grasp that counts: see `clauses`.
    NotGrasped,
    /// Knocked off the table or out of the bin while another item was handled.
    KnockedOut,
    /// Never tried, because the trial ended before.
    NotAttempted,
}

/// The stage that an item reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Looking and estimating.
    Look,
    /// Planning grasp, place and motion.
    Plan,
    /// Moving to the object.
    Approach,
    /// Closing the fingers.
    Grasp,
    /// Lifting.
    Lift,
    /// Carrying to the bin.
    Carry,
    /// Lowering and releasing.
    Place,
    /// At rest at the end of the trial.
    Done,
}

/// The clauses of a success, each with what was measured. All must hold.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Clauses {
    /// Both fingers pressed with opposing normals (dot product at most -0.3) and at least 1 N each, for 25 ms before the
    /// lift began.
    pub opposing_contacts: bool,
    /// The object left everything it lay on or touched, and its lowest point rose by at least 3 cm.
    pub lifted_clear: bool,
    /// Still pinched and clear of everything during the last 0.1 s of the carry.
    pub held_after_carry: bool,
    /// Moved by at most 20 mm and turned by at most 20 degrees in the hand from the grasp to the end of the carry.
    pub slip_within: bool,
    /// At the end of the trial: at rest, its centre between the bin's walls, its lowest point below their edge, touching
    /// nothing but the bin and other items.
    pub in_bin: bool,
    /// Stands within 30 degrees of upright at the end, if it is an item that must.
    pub upright: bool,
    /// Let go near where it came to rest, and slow then, as far as the criteria ask for it.
    pub set_down: bool,
    /// Took no blow that does it harm from the attempt that packed it on, as far as the criteria ask for it.
    pub unharmed: bool,
    /// No other item left the table or the bin while this one was handled, in any attempt.
    pub nothing_knocked_out: bool,
}

impl Clauses {
    /// Each clause with its name in words.
    pub fn by_name(&self) -> [(&'static str, bool); 9] {
        let Self {
            opposing_contacts,
            lifted_clear,
            held_after_carry,
            slip_within,
            in_bin,
            upright,
            set_down,
            unharmed,
            nothing_knocked_out,
        } = *self;
        [
            ("opposing contacts", opposing_contacts),
            ("lifted clear", lifted_clear),
            ("held after carry", held_after_carry),
            ("slip within bounds", slip_within),
            ("at rest in the bin", in_bin),
            ("upright", upright),
            ("set down", set_down),
            ("unharmed", unharmed),
            ("nothing knocked out", nothing_knocked_out),
        ]
    }

    /// Whether all hold.
    pub fn all(&self) -> bool {
        self.by_name().iter().all(|(_, holds)| *holds)
    }
}

/// What the clauses were judged by, in their order. Nothing here decides anything.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Measures {
    /// Force of the finger that pressed less when the lift began, newtons.
    pub pinch_n: f64,
    /// Dot product of the unit forces of the two fingers then; -1 is straight against each other.
    pub pinch_dot: f64,
    /// How far the object's lowest point had risen at most while it touched nothing but the hand, metres.
    pub risen_m: f64,
    /// How long the object had been pinched and clear of everything when the carry ended, seconds.
    pub clear_s: f64,
    /// How far it moved in the hand, metres.
    pub slip_m: f64,
    /// How far it turned in the hand, degrees.
    pub slip_deg: f64,
    /// How far its lowest point lies below the edge of the bin's walls at the end, metres; negative above it.
    pub below_edge_m: f64,
    /// Its speed at the end, m/s.
    pub speed_m_s: f64,
    /// How far a point of it moved in the trial's last second, metres.
    pub moved_m: f64,
    /// Angle between its z axis and the vertical at the end, degrees.
    pub tilt_deg: f64,
    /// How far its lowest point fell when it was let go, metres.
    pub release_m: f64,
    /// Its largest speed after the fingers had left it, m/s.
    pub landing_m_s: f64,
    /// The largest blow that it took from the attempt that packed it on, newton seconds.
    #[serde(default)]
    pub packed_impulse_n_s: f64,
    /// Other items that left the table or the bin during its attempts.
    pub knocked_out: u32,
}

/// One item of a trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ItemResult {
    /// YCB name.
    pub object: String,
    /// Which of several of that name, from 1 on; left out of the first.
    #[serde(default = "first", skip_serializing_if = "is_first")]
    pub instance: u32,
    /// What became of it.
    pub outcome: Outcome,
    /// The stage reached in the last attempt.
    pub stage: Stage,
    /// Why, in words; empty when packed.
    pub reason: String,
    /// Attempts made.
    pub attempts: u32,
    /// Mean distance of corresponding model points at the last look before the last attempt, metres.
    pub add_m: Option<f64>,
    /// The same to the nearest point, for objects whose turned copies look the same, metres.
    pub adds_m: Option<f64>,
    /// How far the object moved in the hand between grasp and release, metres.
    pub slip_m: Option<f64>,
    /// Largest normal force by any one body on the object during its attempts, newtons.
    pub peak_force_n: f64,
    /// Largest blow on the object by everything but the fingers in the whole trial, newton seconds: normal impulse within 21 ms beyond
    /// that of the 21 ms before and of the 21 ms after.
    pub peak_impulse_n_s: f64,
    /// What it takes unharmed: its momentum after the fall that its fragility allows, newton seconds.
    pub harmless_impulse_n_s: f64,
    /// Farthest that a point of any other item moved during its attempts, metres.
    pub others_moved_m: f64,
    /// The first attempt; none when there was none.
    pub first_attempt: Option<FirstAttempt>,
    /// Attempts that failed by the robot's own account, in order.
    pub failed_attempts: Vec<FailedAttempt>,
    /// The clauses of success.
    pub clauses: Clauses,
    /// What they were judged by.
    pub measures: Measures,
}

fn first() -> u32 {
    1
}

fn is_first(instance: &u32) -> bool {
    *instance == first()
}

impl ItemResult {
    /// Its name; of several of one name with a number behind it.
    pub fn name(&self) -> String {
        instance_name(&self.object, self.instance)
    }
}

/// The name of a further one of a kind, from 2 on, has its number behind it.
pub(crate) fn instance_name(object: &str, instance: u32) -> String {
    if is_first(&instance) { object.to_owned() } else { format!("{object} ({instance})") }
}

/// How the first grasp of an item went, whatever came after it: what pose errors cost without a second chance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FirstAttempt {
    /// Mean distance of corresponding model points at the look before it, metres.
    pub add_m: Option<f64>,
    /// The same to the nearest point, metres.
    pub adds_m: Option<f64>,
    /// Whether the grasp held to the end of the carry: opposing contacts, lifted clear, not lost, slip within bounds.
    pub held: bool,
}

/// An attempt that did not end with the item released in the bin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FailedAttempt {
    /// What the robot noticed.
    pub outcome: Outcome,
    /// The stage it came to.
    pub stage: Stage,
    /// In words.
    pub reason: String,
}

/// What a trial was like. Nothing here decides whether an item was packed; that is what [`Clauses`] are for.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct ScoreCard {
    /// Attempts at all items.
    pub attempts: u32,
    /// Items put aside on the table because they could not be packed as they lay.
    pub put_aside: u32,
    /// Pushes where nothing could be picked.
    pub pushes: u32,
    /// Attempts that lost the item between the lift and the release.
    pub lost_in_transit: u32,
    /// Attempts in which the fingers closed on another object.
    pub wrong_objects: u32,
    /// Items on the table of which a point moved by more than a centimetre while another item was handled, once an attempt.
    pub disturbed: u32,
    /// The same for items that lay in the bin.
    pub disturbed_in_bin: u32,
    /// Items that took a larger blow than a fall gives that does them no harm (`scenes/objects.toml`, fragility).
    pub rough: u32,
    /// Items in the bin that must stand and do not.
    pub not_upright: u32,
    /// Pairs in the bin of which the upper one rests on one that must not bear it.
    pub bad_packs: Vec<BadPack>,
    /// Volume of the items in the bin over the volume below the height map of their tops; none when it is empty.
    pub density: Option<f64>,
    /// Farthest that a point of any item moved in the second after everything had come to rest, metres.
    pub drift_m: f64,
}

/// Something heavy on something that breaks.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct BadPack {
    /// What rests.
    pub above: String,
    /// What it rests on.
    pub below: String,
}

impl fmt::Display for ScoreCard {
    /// In one line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let density = self.density.map_or("-".to_string(), |d| format!("{d:.2}"));
        write!(
            f,
            "{} attempts, {} lost in transit, {} wrong objects; {} items disturbed on the table, {} in the bin; \
             {} handled roughly, {} not upright, {} bad packs; density {density}, drift {:.1} mm",
            self.attempts,
            self.lost_in_transit,
            self.wrong_objects,
            self.disturbed,
            self.disturbed_in_bin,
            self.rough,
            self.not_upright,
            self.bad_packs.len(),
            1e3 * self.drift_m
        )?;
        for pack in &self.bad_packs {
            write!(f, "; {} lies on {}", pack.above, pack.below)?;
        }
        Ok(())
    }
}

/// A whole trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TrialResult {
    /// [`TRIAL_SCHEMA`].
    pub schema: String,
    /// SHA-256 of all that the trial depends on, seed and all ([`crate::scenario::Scenario::hash`]): trials with the same
    /// one have the same result.
    pub scenario: String,
    /// The seed of everything random.
    pub seed: u64,
    /// The scene's name.
    pub scene: String,
    /// The condition's name.
    pub condition: String,
    /// `grip`, or `truth` for a ceiling that is no result.
    pub estimator: String,
    /// Who planned grasps: `grip`, or a program of others.
    #[serde(default = "grip")]
    pub grasper: String,
    /// `pyramid`, `clusters` or `none`.
    pub detector: String,
    /// `built-in`, `ycb` or `bop`.
    pub object_set: String,
    /// `wgpu` or `cpu`.
    pub renderer: String,
    /// Who rendered pose hypotheses: `cpu` or `gpu`.
    pub hypotheses: String,
    /// Items asked for.
    pub requested: usize,
    /// Items packed.
    pub packed: usize,
    /// Simulated seconds.
    pub sim_s: f64,
    /// How far the robot was off from what it believed of itself, where it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<CalibrationRecord>,
    /// What the trial was like beside what was packed.
    pub score: ScoreCard,
    /// What a check of all motions by the exact collision checker found afterwards.
    pub motion_check: MotionCheck,
    /// Item by item, in the scene's order.
    pub items: Vec<ItemResult>,
    /// SHA-256 of the final state of the physics world.
    pub state_hash: String,
    /// How long it took: all that differs from run to run. None in an experiment's records, which keep it apart.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timing: Option<Timing>,
}

fn grip() -> String {
    GRIP.into()
}

impl TrialResult {
    /// Who estimated, and who planned grasps where that is not our own planner.
    pub fn method(&self) -> String {
        method(&self.estimator, &self.grasper)
    }
}

/// An estimator's name; with that of the grasp planner behind it where that is not our own.
pub(crate) fn method(estimator: &str, grasper: &str) -> String {
    if grasper == GRIP { estimator.to_owned() } else { format!("{estimator} + {grasper}") }
}

/// Wall times of a trial, seconds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Timing {
    /// The whole trial.
    pub wall_s: f64,
    /// Item by item, as in [`TrialResult::items`].
    pub items: Vec<ItemTiming>,
}

/// Wall times of an item, seconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ItemTiming {
    /// Estimation of its pose, all looks.
    pub estimate_s: f64,
    /// Planning, all attempts.
    pub plan_s: f64,
}

impl Outcome {
    /// In words, for people.
    pub fn words(self) -> &'static str {
        match self {
            Self::Packed => "packed",
            Self::NotPerceived => "not perceived",
            Self::EstimatorFailed => "estimator failed",
            Self::GrasperFailed => "grasper failed",
            Self::WrongObject => "wrong object",
            Self::NoGrasp => "no reachable grasp",
            Self::NoPlace => "no place in the bin",
            Self::NoPath => "no path",
            Self::CollisionOnApproach => "collision on approach",
            Self::Missed => "missed",
            Self::SlippedOnLift => "slipped on lift",
            Self::DroppedInTransit => "dropped in transit",
            Self::CollisionInTransit => "collision in transit",
            Self::PlacedOutside => "placed outside",
            Self::Disturbed => "others knocked out",
            Self::Slipped => "slipped in the hand",
            Self::NotUpright => "not upright",
            Self::Dropped => "dropped into the bin",
            Self::Harmed => "handled roughly",
            Self::NotGrasped => "in the bin, not by a grasp",
            Self::KnockedOut => "knocked out",
            Self::NotAttempted => "not attempted",
        }
    }
}
