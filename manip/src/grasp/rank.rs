//! Ranks an object's antipodal grasps in the believed scene.

use grip_sim::pose::{Gripper, Object, Pose, World};
use grip_sim::robot::GripperConfig;
use nalgebra::{Isometry3, Vector3};
use serde::Serialize;

use super::antipodal::narrow_opening;
use super::object_grasps::ObjectGrasps;
use super::oriented::{HandFrom, Scored, oriented};
use super::settings::GraspSettings;
use crate::belief::BeliefScene;
use crate::collision::{
    CollisionBody, CollisionChecker, CollisionPair, CollisionQuery, InTheWay, Margins, RobotSolids,
};

/// A grasp of a believed object in the scene.
#[derive(Debug, Clone, Serialize)]
pub struct Grasp {
    /// The gripper in the object's frame.
    pub object_from_gripper: Pose<Object, Gripper>,
    /// The gripper in the world.
    pub world_from_gripper: Pose<World, Gripper>,
    /// Expected distance of the pads when closed, metres.
    pub width: f64,
    /// Opening to approach with, metres.
    pub opening: f64,
    /// Distance of the hand from everything but the object, metres, at most [`GraspSettings::clearance_full`].
    pub clearance: f64,
    /// Horizontal distance of the object's centre of mass from the grasp's centre, metres.
    pub lever: f64,
    /// Share of the pads in contact, 0 to 1.
    pub contact_share: f64,
    /// Sum of the weighted terms of [`super::GraspWeights`]; larger is better.
    pub score: f64,
}

/// Pairs of every hand link with one object.
pub fn hand_may_touch(robot: &RobotSolids, object: usize) -> Vec<CollisionPair> {
    robot
        .hand
        .iter()
        .map(|&link| CollisionPair { a: CollisionBody::Link(link), b: CollisionBody::Object(object) })
        .collect()
}

/// What [`rank_grasps`] looked at.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct GraspCounters {
    /// Antipodal candidates of the object.
    pub candidates: usize,
    /// Of those, approached from where the hand is to come from and clear of the table by their pose alone.
    pub oriented: usize,
    /// Of those, tried with the hand's solids.
    pub tried: usize,
    /// Of those, free.
    pub free: usize,
    /// What the hand ran into at the others, at the grasp or on the way in,
    pub blocked: InTheWay,
    /// or while it closed. Both and `free` sum to `tried`.
    pub closing: InTheWay,
}

impl GraspCounters {
    /// Counts what a second look at the same candidates found, too.
    pub(crate) fn add(&mut self, again: &Self) {
        self.candidates = again.candidates;
        self.oriented += again.oriented;
        self.tried += again.tried;
        self.free += again.free;
        self.blocked.add(&again.blocked);
        self.closing.add(&again.closing);
    }
}

/// Distance of the pads between two checks while the hand closes, metres: a finger, which goes half as far, is thicker.
const CLOSING_STEP: f64 = 0.01;

/// The best free grasps of object `target` with a hand that comes `from` there, best first, no two of them alike.
pub fn rank_grasps(
    grasps: &ObjectGrasps,
    belief: &BeliefScene,
    target: usize,
    from: HandFrom,
    checker: &CollisionChecker,
    gripper: &GripperConfig,
    settings: &GraspSettings,
) -> (Vec<Grasp>, GraspCounters) {
    let base_from_world = belief.world_from_base.iso().inverse();
    let scored = oriented(grasps, belief, target, from, gripper, settings);
    let mut counters =
        GraspCounters { candidates: grasps.candidates.len(), oriented: scored.len(), ..Default::default() };

    let allowed = hand_may_touch(checker.robot(), target);
    let hand = HandCheck::new(checker, &allowed, settings);
    let mut kept: Vec<Grasp> = Vec::new();
    for Scored { score, lever, candidate, world_from_gripper } in scored {
        // A bound on the work in hopeless clutter.
        if kept.len() >= settings.keep || counters.tried >= settings.most_tried {
            break;
        }
        if kept.iter().any(|g| alike(&g.world_from_gripper, &world_from_gripper, settings)) {
            continue;
        }
        counters.tried += 1;
        let base_from_gripper = base_from_world * world_from_gripper.iso();
        let blocked = |opening: f64| {
            let entering = hand.blocked(&base_from_gripper, opening).map(|pair| (pair, false));
            let closing = || hand.blocked_closing(&base_from_gripper, opening, candidate.width);
            entering.or_else(|| closing().map(|pair| (pair, true)))
        };
        let narrow = narrow_opening(candidate.width, gripper, &settings.antipodal);
        let opening = if candidate.fits_wide && blocked(gripper.opening).is_none() {
            gripper.opening
        } else {
            match blocked(narrow) {
                None => narrow,
                Some((pair, closing)) => {
                    if closing { &mut counters.closing } else { &mut counters.blocked }.count(pair);
                    continue;
                }
            }
        };
        counters.free += 1;
        let clearance = hand.clearance(&base_from_gripper, opening);
        kept.push(Grasp {
            object_from_gripper: candidate.object_from_gripper,
            world_from_gripper,
            width: candidate.width,
            opening,
            clearance,
            lever,
            contact_share: candidate.contact_share,
            score: score + settings.weights.clearance * clearance / settings.clearance_full,
        });
    }
    kept.sort_by(|a, b| b.score.total_cmp(&a.score));
    (kept, counters)
}

/// Whether the hand is free of everything but the object that it grasps.
pub(super) struct HandCheck<'a> {
    checker: &'a CollisionChecker,
    settings: &'a GraspSettings,
    query: CollisionQuery<'a>,
}

impl<'a> HandCheck<'a> {
    /// `allowed` is what the hand may touch ([`hand_may_touch`]).
    pub fn new(
        checker: &'a CollisionChecker,
        allowed: &'a [CollisionPair],
        settings: &'a GraspSettings,
    ) -> Self {
        let margins = Margins { world: settings.margin, own: 0.0, spread: settings.spread_share };
        Self { checker, settings, query: CollisionQuery { held: None, allowed, margins } }
    }

    /// What is in the way at a grasp and on the way in.
    pub fn blocked(&self, base_from_gripper: &Isometry3<f64>, opening: f64) -> Option<CollisionPair> {
        let approach = base_from_gripper * Vector3::x();
        [0.0, 0.03, 0.06, self.settings.standoff].iter().find_map(|back| {
            let mut at = *base_from_gripper;
            at.translation.vector -= approach * *back;
            self.checker.hand_collision(&at, opening, &self.query)
        })
    }

    /// What is in the way while it closes from `opening` to `width`: a finger must not stand beyond a wall or a neighbour that is between
    /// it and the object.
    pub fn blocked_closing(
        &self,
        base_from_gripper: &Isometry3<f64>,
        opening: f64,
        width: f64,
    ) -> Option<CollisionPair> {
        let sweep = CollisionQuery { margins: Margins { world: 0.0, ..self.query.margins }, ..self.query };
        let steps = ((opening - width) / CLOSING_STEP).ceil().max(1.0);
        (1..=steps as usize).find_map(|k| {
            let at = opening + (width - opening) * k as f64 / steps;
            self.checker.hand_collision(base_from_gripper, at, &sweep)
        })
    }

    /// Its distance from everything else, metres, at most [`GraspSettings::clearance_full`].
    pub fn clearance(&self, base_from_gripper: &Isometry3<f64>, opening: f64) -> f64 {
        self.checker.hand_clearance(base_from_gripper, opening, &self.query, self.settings.clearance_full)
    }
}

/// Whether two grasps count as one.
pub(super) fn alike(a: &Pose<World, Gripper>, b: &Pose<World, Gripper>, settings: &GraspSettings) -> bool {
    (a.translation() - b.translation()).norm() < settings.distinct_distance
        && a.angle_to(b) < settings.distinct_angle
}
