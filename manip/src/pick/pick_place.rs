//! Picks one object and places it in the bin: grasp and place are chosen together, so that both ends are reachable.

use std::time::Instant;

use grip_sim::pose::{Gripper, Object, Pose};
use nalgebra::{Isometry3, Vector3};
use rand_chacha::ChaCha8Rng;

use crate::belief::{BeliefScene, BinGeometry};
use crate::collision::{
    CollisionBody, CollisionChecker, CollisionPair, CollisionQuery, HeldObject, InTheWay,
};
use crate::grasp::{GivenGrasp, Grasp, HandFrom, ObjectGrasps, hand_may_touch, rank_grasps};
use crate::motion::{CartesianPath, Trajectory, straight_line, translate};
use crate::place::{PlacePose, PlaceSettings, place_poses};
use crate::plan::{
    Action, GripperCommand, PickPlacePlan, PlanCounters, PlanFailure, PlanStage, PlanStep, StepName,
};
use crate::planner::Planner;

/// Lower than this above the table something stands on it, metres.
const ON_TABLE: f64 = 0.005;

/// What a pick may risk: other picks may first make better ones of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Risk {
    /// As little as can be: firm grasps alone ([`crate::grasp::GraspSettings::firm`]), places where the object stands, and lifts that leave
    /// what it leans against within the first centimetres, aside where up does not.
    Averse,
    /// Any grasp, places where the object comes to lean, and lifts that slide along other objects all the way up: they may be taken
    /// along or knocked over.
    Tolerant,
}

/// A grasp with its straight motions.
pub(crate) struct Picked {
    pub(crate) grasp: Grasp,
    held: HeldObject,
    /// From the pre-grasp pose to the grasp, fingers open.
    pub(crate) approach: CartesianPath,
    /// From the grasp upwards, fingers closed.
    lift: CartesianPath,
}

/// A place with its straight motions.
struct Placed {
    place: PlacePose,
    /// From side to side above it, if at all.
    shake: Vec<CartesianPath>,
    /// From above to the release, fingers closed.
    lower: CartesianPath,
    /// From the release back, fingers open.
    retreat: CartesianPath,
    opening: f64,
}

/// The state of one planning call.
pub(crate) struct Attempt<'a> {
    pub(super) planner: &'a Planner,
    pub(super) belief: &'a BeliefScene,
    pub(crate) checker: CollisionChecker,
    pub(super) target: usize,
    risk: Risk,
    /// What becomes of a place: see [`Planner::plan_put_aside`].
    aside: bool,
    /// Grasps by others, and no other ones.
    given: Option<&'a [GivenGrasp]>,
    q_now: Vec<f64>,
    base_from_world: Isometry3<f64>,
    touch: Vec<CollisionPair>,
    pub(crate) counters: PlanCounters,
    /// The farthest failure so far.
    pub(crate) failed: (PlanStage, String),
}

impl Planner {
    /// Plans to pick the belief's object `target` and to put it into the bin, from `q_now` (all movable joints).
    ///
    /// # Errors
    /// The farthest stage that any pair of grasp and place reached.
    pub fn plan_pick_place(
        &self,
        belief: &BeliefScene,
        target: usize,
        q_now: &[f64],
        risk: Risk,
        seed: u64,
    ) -> Result<PickPlacePlan, PlanFailure> {
        self.plan_to(belief, target, None, q_now, (risk, false), seed)
    }

    /// Plans to put the object down elsewhere on the table, without a risk ([`Risk::Averse`]), where it stands on the table itself: from
    /// there it can be gripped in another way. `table` is where, as a bin without walls.
    ///
    /// # Errors
    /// As [`Planner::plan_pick_place`].
    pub fn plan_put_aside(
        &self,
        belief: &BeliefScene,
        target: usize,
        table: BinGeometry,
        q_now: &[f64],
        seed: u64,
    ) -> Result<PickPlacePlan, PlanFailure> {
        let belief = BeliefScene { bin: table, ..belief.clone() };
        self.plan_to(&belief, target, None, q_now, (Risk::Averse, true), seed)
    }

    pub(super) fn plan_to(
        &self,
        belief: &BeliefScene,
        target: usize,
        given: Option<&[GivenGrasp]>,
        q_now: &[f64],
        (risk, aside): (Risk, bool),
        seed: u64,
    ) -> Result<PickPlacePlan, PlanFailure> {
        let clock = Instant::now();
        let name = belief.objects.get(target).map_or_else(|| format!("object {target}"), |o| o.name.clone());
        let fail = |(stage, reason): (PlanStage, String), mut counters: PlanCounters| {
            counters.seconds = clock.elapsed().as_secs_f64();
            PlanFailure { stage, object: name.clone(), reason, counters: Box::new(counters) }
        };
        self.check_input(belief, &[q_now]).map_err(|e| fail(e, PlanCounters::default()))?;
        if target >= belief.objects.len() {
            let reason = format!("the belief has {} objects", belief.objects.len());
            return Err(fail((PlanStage::Input, reason), PlanCounters::default()));
        }
        let belief = snapped_to_ground(belief, self.settings.table_snap);
        let mut attempt = Attempt { aside, given, ..Attempt::new(self, &belief, target, q_now, risk) };
        let mut rng = grip_sim::rng::stream(seed, "pick and place");
        let plan = attempt.plan(&mut rng);
        let Attempt { mut counters, failed, .. } = attempt;
        counters.seconds = clock.elapsed().as_secs_f64();
        match plan {
            Some(mut plan) => {
                plan.counters = counters;
                Ok(plan)
            }
            None => Err(fail(failed, counters)),
        }
    }
}

impl<'a> Attempt<'a> {
    /// At the belief's object `target`, from `q_now`.
    pub(crate) fn new(
        planner: &'a Planner,
        belief: &'a BeliefScene,
        target: usize,
        q_now: &[f64],
        risk: Risk,
    ) -> Self {
        Self {
            planner,
            risk,
            aside: false,
            given: None,
            checker: CollisionChecker::new(planner.robot.clone(), belief),
            target,
            q_now: planner.clamped(q_now),
            base_from_world: belief.world_from_base.iso().inverse(),
            touch: hand_may_touch(&planner.robot, target),
            counters: PlanCounters::default(),
            failed: (PlanStage::NoGrasp, "no antipodal grasp is free".into()),
            belief,
        }
    }

    fn plan(&mut self, rng: &mut ChaCha8Rng) -> Option<PickPlacePlan> {
        let object = &self.belief.objects[self.target];
        let known = self.planner.grasps(&object.model);
        if let Some(given) = self.given {
            return self.plan_given(given, &known, rng);
        }
        let (mut tried, mut places) = (Vec::new(), None);
        for from in [HandFrom::Above, HandFrom::Front] {
            let plan = self.plan_from(from, &known, &mut tried, &mut places, rng);
            // These fail whatever the grasp.
            let hopeless = matches!(self.failed.0, PlanStage::StartInCollision | PlanStage::NoPlacePose);
            // In the open what is too crowded from above is so from the front, too.
            if plan.is_some() || hopeless || !self.under_board() {
                return plan;
            }
        }
        None
    }

    /// Whether the board of a shelf is above the object.
    fn under_board(&self) -> bool {
        self.belief.is_under_board(&self.belief.objects[self.target].world_from_object.translation().into())
    }

    /// With a hand that comes `from` there and grasps as none of `tried` did, to which its own are added. `places` are made on first use.
    fn plan_from(
        &mut self,
        from: HandFrom,
        known: &ObjectGrasps,
        tried: &mut Vec<Pose<Object, Gripper>>,
        places: &mut Option<Vec<PlacePose>>,
        rng: &mut ChaCha8Rng,
    ) -> Option<PickPlacePlan> {
        let planner = self.planner;
        let settings = &planner.settings;
        let (mut grasps, counters) = rank_grasps(
            known,
            self.belief,
            self.target,
            from,
            &self.checker,
            &planner.config.gripper,
            &settings.grasp,
        );
        self.counters.grasps.add(&counters);
        if counters.candidates == 0 {
            self.failed.1 = "the object has no antipodal grasp for this gripper".into();
        }
        let averse = self.risk == Risk::Averse;
        grasps.retain(|grasp| {
            (!averse || grasp.score >= settings.grasp.firm) && !tried.contains(&grasp.object_from_gripper)
        });
        grasps.truncate(settings.grasp_tries);
        tried.extend(grasps.iter().map(|grasp| grasp.object_from_gripper));
        self.plan_by(grasps, places, rng)
    }

    /// By the first of these grasps that leads to a place.
    pub(super) fn plan_by(
        &mut self,
        grasps: Vec<Grasp>,
        places: &mut Option<Vec<PlacePose>>,
        rng: &mut ChaCha8Rng,
    ) -> Option<PickPlacePlan> {
        let planner = self.planner;
        let settings = &planner.settings;
        let averse = self.risk == Risk::Averse;
        for grasp in grasps {
            let Some(picked) = self.pick(grasp) else {
                continue;
            };
            let places = places.get_or_insert_with(|| {
                // Beside the bin the middle of the table is as good as its edge, and easier to reach.
                let middle_cost =
                    if self.aside { -settings.place.middle_cost } else { settings.place.middle_cost };
                let place = PlaceSettings { middle_cost, ..settings.place.clone() };
                let mut places = place_poses(self.belief, self.target, &place);
                places.retain(|place| place.stands || !averse);
                places.retain(|place| !self.aside || place.support_height < ON_TABLE);
                places
            });
            self.counters.places = places.len();
            if places.is_empty() {
                self.note(PlanStage::NoPlacePose, "the bin has no room for it".into());
                return None;
            }
            // A way to the grasp first: without it no place helps.
            let open = self.planner.with_fingers(&self.q_now, picked.grasp.opening);
            let to_pregrasp = match self.path(None, &open, picked.approach.waypoints[0].clone(), rng) {
                Ok(trajectory) => trajectory,
                Err((PlanStage::StartInCollision, reason)) => {
                    self.note(PlanStage::StartInCollision, reason);
                    return None;
                }
                Err((_, reason)) => {
                    self.note(PlanStage::NoApproachPath, reason);
                    continue;
                }
            };
            let (mut reached_for, mut searches) = (0, 0);
            for place in places.iter() {
                // The hand alone first: cheap, and decides most cases.
                if !self.hand_fits(&picked, place) {
                    continue;
                }
                reached_for += 1;
                if reached_for > settings.place_tries {
                    break;
                }
                let Some(placed) = self.place(&picked, place) else {
                    continue;
                };
                let above = placed.lower.waypoints[0].clone();
                match self.path(Some(&picked.held), picked.lift.end(), above, rng) {
                    Ok(carry) => return Some(self.assemble(picked, placed, to_pregrasp, carry)),
                    Err((_, reason)) => self.note(PlanStage::NoTransitPath, reason),
                }
                searches += 1;
                if searches >= settings.carry_tries {
                    break;
                }
            }
        }
        None
    }

    /// Remembers the farthest failure.
    fn note(&mut self, stage: PlanStage, reason: String) {
        if stage >= self.failed.0 || stage == PlanStage::StartInCollision {
            self.failed = (stage, reason);
        }
    }

    fn path(
        &mut self,
        held: Option<&HeldObject>,
        from: &[f64],
        to: Vec<f64>,
        rng: &mut ChaCha8Rng,
    ) -> Result<Trajectory, (PlanStage, String)> {
        let planner = self.planner;
        planner.search(&self.checker, held, from, &[to], &mut self.counters, rng)
    }

    /// Reaches a grasp, its approach and its lift.
    pub(crate) fn pick(&mut self, grasp: Grasp) -> Option<Picked> {
        let planner = self.planner;
        let (settings, solver) = (&planner.settings, &planner.solver);
        self.counters.grasps_tried += 1;
        let base_from_gripper = self.base_from_world * grasp.world_from_gripper.iso();
        let open = self.planner.with_fingers(&self.q_now, grasp.opening);
        let touch = self.touch.clone();
        let near = CollisionQuery { held: None, allowed: &touch, margins: settings.near_margins };
        let free = CollisionQuery { held: None, allowed: &[], margins: settings.free_margins };
        let object = &self.belief.objects[self.target];
        let held = HeldObject::new(&object.model, self.target, *grasp.object_from_gripper.inverse().iso());
        let mut blocked = InTheWay::default();
        let solutions =
            solver.solutions(&base_from_gripper, &open, settings.ik_seeds, settings.ik_solutions, |q| {
                let pair = self.checker.in_collision(q, &near);
                pair.inspect(|pair| blocked.count(*pair)).is_none()
            });
        self.counters.arms_blocked.add(&blocked);
        if solutions.is_empty() {
            self.note(PlanStage::NoIk, "no free grasp is within reach without collision".into());
            return None;
        }
        self.counters.grasps_reached += 1;
        let mut pregrasp = base_from_gripper;
        pregrasp.translation.vector -= base_from_gripper * Vector3::x() * settings.grasp.standoff;
        for q in solutions {
            // Backwards from the grasp, so that the approach ends on it exactly.
            let back = straight_line(solver, &q, &pregrasp, |_, q| self.checker.in_collision(q, &near));
            let back = match back {
                Ok(back) if self.checker.in_collision(back.end(), &free).is_none() => back,
                _ => {
                    self.note(PlanStage::NoApproach, "no grasp can be approached straight".into());
                    continue;
                }
            };
            self.counters.grasps_approached += 1;
            let closed = self.planner.with_fingers(&q, grasp.width);
            let Some(lift) = self.lift(&closed, &held) else {
                self.note(PlanStage::NoLift, "no grasp can be lifted straight".into());
                continue;
            };
            self.counters.grasps_lifted += 1;
            return Some(Picked { approach: back.reversed(), grasp, held, lift });
        }
        None
    }

    fn lift(&self, closed: &[f64], held: &HeldObject) -> Option<CartesianPath> {
        let settings = &self.planner.settings;
        let near = CollisionQuery { held: Some(held), allowed: &[], margins: settings.near_margins };
        // What it lies on, leans against or overlaps, since estimates do, is left within the first centimetres; if need be,
        // other objects slide along it all the way up.
        let lying = self.checker.collisions(closed, &near);
        let beside: Vec<CollisionPair> = lying
            .iter()
            .copied()
            .filter(|p| p.a == CollisionBody::Held && matches!(p.b, CollisionBody::Object(_)))
            .collect();
        let leaving = CollisionQuery { allowed: &lying, ..near };
        let rising = match self.risk {
            Risk::Averse => near,
            Risk::Tolerant => CollisionQuery { allowed: &beside, ..near },
        };
        let clear = CollisionQuery { margins: settings.free_margins, ..near };
        let up = settings.lift.heights.iter().map(|&height| Vector3::z() * height);
        // Beside a wall or another object: away from it, to whichever side that is.
        let tallest = settings.lift.heights.iter().copied().fold(0.0, f64::max);
        let aside = (0..settings.lift.lean_directions).map(|k| {
            let azimuth = std::f64::consts::TAU * k as f64 / settings.lift.lean_directions as f64;
            let lean = tallest * settings.lift.lean.tan();
            Vector3::new(lean * azimuth.cos(), lean * azimuth.sin(), tallest)
        });
        // Only there does a lower one help.
        let low = self.under_board().then(|| Vector3::z() * settings.lift.low);
        up.chain(aside).chain(low).find_map(|way| {
            let path = translate(&self.planner.solver, closed, way, |gone, q| {
                let query = if gone < settings.lift.leaving { &leaving } else { &rising };
                self.checker.in_collision(q, query)
            })
            .ok()?;
            self.checker.in_collision(path.end(), &clear).is_none().then_some(path)
        })
    }

    /// Where the gripper lets go at a place, base frame, and how wide it opens.
    fn release(&self, picked: &Picked, place: &PlacePose) -> (Isometry3<f64>, f64) {
        let settings = &self.planner.settings;
        let mut world_from_object = *place.world_from_object.iso();
        world_from_object.translation.vector.z += settings.place.release_height;
        let base_from_gripper =
            self.base_from_world * world_from_object * picked.grasp.object_from_gripper.iso();
        let opening =
            (picked.grasp.width + settings.release_opening).min(self.planner.config.gripper.opening);
        (base_from_gripper, opening)
    }

    /// Whether the hand with the object, closed and open, is free at a place.
    fn hand_fits(&self, picked: &Picked, place: &PlacePose) -> bool {
        let (base_from_gripper, opening) = self.release(picked, place);
        let holding = CollisionQuery {
            held: Some(&picked.held),
            allowed: &[],
            margins: self.planner.settings.near_margins,
        };
        [opening, picked.grasp.width]
            .into_iter()
            .all(|opening| self.checker.hand_collision(&base_from_gripper, opening, &holding).is_none())
    }

    /// Reaches a place with a grasp, lowering to it and retreating from it.
    fn place(&mut self, picked: &Picked, place: &PlacePose) -> Option<Placed> {
        let planner = self.planner;
        let (settings, solver) = (&planner.settings, &planner.solver);
        self.counters.places_tried += 1;
        self.note(PlanStage::NoPlaceIk, "no place in the bin can be reached with any grasp".into());
        let (base_from_gripper, opening) = self.release(picked, place);
        let holding =
            CollisionQuery { held: Some(&picked.held), allowed: &[], margins: settings.near_margins };
        let closed = picked.lift.end();
        let q = solver
            .solutions(&base_from_gripper, closed, settings.ik_seeds, 1, |q| {
                self.checker.in_collision(q, &holding).is_none()
            })
            .into_iter()
            .next()?;
        // Up until the object is above the walls.
        let up = (self.belief.bin.wall_height + settings.wall_clearance - place.support_height)
            .max(settings.least_lower);
        let raise =
            translate(solver, &q, Vector3::z() * up, |_, q| self.checker.in_collision(q, &holding)).ok()?;
        let clear = CollisionQuery { margins: settings.free_margins, ..holding };
        if self.checker.in_collision(raise.end(), &clear).is_some() {
            return None;
        }
        // Out and back, so that the lowering begins where it would without.
        let mut shake: Vec<CartesianPath> = Vec::new();
        let axes: &[Vector3<f64>] = &[Vector3::x(), Vector3::y(), Vector3::z()];
        for axis in if settings.shake > 0.0 { axes } else { &[] } {
            for way in [settings.shake, -settings.shake] {
                let free = |_: f64, q: &[f64]| self.checker.in_collision(q, &holding);
                let out = translate(solver, raise.end(), *axis * way, free).ok()?;
                let back = out.reversed();
                shake.extend([out, back]);
            }
        }
        let empty = CollisionQuery { held: None, allowed: &self.touch, margins: settings.near_margins };
        let open = self.planner.with_fingers(&q, opening);
        let back = base_from_gripper.rotation * -Vector3::x();
        let retreat = [back * settings.retreat, Vector3::z() * up].into_iter().find_map(|way| {
            translate(solver, &open, way, |_, q| self.checker.in_collision(q, &empty)).ok()
        })?;
        self.counters.places_reached += 1;
        Some(Placed { place: place.clone(), shake, lower: raise.reversed(), retreat, opening })
    }

    fn assemble(
        &self,
        picked: Picked,
        placed: Placed,
        to_pregrasp: Trajectory,
        carry: Trajectory,
    ) -> PickPlacePlan {
        let settings = &self.planner.settings;
        let object = &self.belief.objects[self.target];
        let free = |trajectory, holding| Action::Move { trajectory, guard: None, holding };
        let straight = |path: &CartesianPath, speed, guarded, holding| {
            self.planner.straight(path, speed, guarded, holding)
        };
        let grip = |command, width| Action::Gripper { command, width };
        let force_n = self.planner.grip_force(&object.model.info, &picked.grasp);
        let (slow, fast) = (settings.speed.guarded, settings.speed.straight);
        let opening = picked.grasp.opening;
        let width = picked.grasp.width;
        let released = placed.opening;
        let mut steps = vec![
            (StepName::Open, grip(GripperCommand::Open { width: opening }, opening)),
            (StepName::ToPregrasp, free(to_pregrasp, false)),
            (StepName::Approach, straight(&picked.approach, slow, true, false)),
            (StepName::Close, grip(GripperCommand::Close { force_n }, width)),
            (StepName::Lift, straight(&picked.lift, fast, false, true)),
            (StepName::Carry, free(carry, true)),
        ];
        let speed = settings.grasp_test.shake_speed;
        steps.extend(placed.shake.iter().map(|path| (StepName::Shake, straight(path, speed, false, true))));
        steps.extend([
            (StepName::Lower, straight(&placed.lower, slow, true, true)),
            (StepName::Release, grip(GripperCommand::Open { width: released }, released)),
            (StepName::Retreat, straight(&placed.retreat, fast, false, false)),
        ]);
        let mut world_from_object = *placed.place.world_from_object.iso();
        world_from_object.translation.vector.z += settings.place.release_height;
        PickPlacePlan {
            target: self.target,
            object: object.name.clone(),
            grasp: picked.grasp,
            world_from_object_released: Pose::new(world_from_object),
            place: placed.place,
            steps: joined(steps.into_iter().map(|(name, action)| PlanStep { name, action }).collect()),
            end: placed.retreat.end().to_vec(),
            counters: self.counters,
        }
    }
}

/// Makes consecutive trajectories meet in joints that wrap: one may end whole turns from where the next begins.
pub(crate) fn joined(mut steps: Vec<PlanStep>) -> Vec<PlanStep> {
    use std::f64::consts::TAU;
    let mut last: Option<Vec<f64>> = None;
    for step in &mut steps {
        if let Action::Move { trajectory, .. } = &mut step.action {
            if let Some(last) = &last {
                for (k, last) in last.iter().enumerate() {
                    let turns = ((last - trajectory.points[0].q[k]) / TAU).round();
                    if turns != 0.0 {
                        for point in &mut trajectory.points {
                            point.q[k] += turns * TAU;
                        }
                    }
                }
            }
            last = Some(trajectory.last().to_vec());
        }
    }
    steps
}

/// The belief with objects that nearly stand on the table, or on another level fixture, moved vertically so that they do: its
/// height is known far better than an object's.
pub fn snapped_to_ground(belief: &BeliefScene, tolerance: f64) -> BeliefScene {
    let fixed = belief;
    let mut belief = belief.clone();
    for object in belief.objects.iter_mut().filter(|o| !o.packed) {
        let lowest = object
            .model
            .visual
            .mesh
            .positions
            .iter()
            .map(|p| object.world_from_object.transform_point(&p.cast()).z)
            .fold(f64::INFINITY, f64::min);
        let center = object.world_from_object.translation();
        let gap = lowest - fixed.ground(&center.into());
        if gap.abs() <= tolerance {
            let mut pose = *object.world_from_object.iso();
            pose.translation.vector.z -= gap;
            object.world_from_object = Pose::new(pose);
        }
    }
    belief
}
