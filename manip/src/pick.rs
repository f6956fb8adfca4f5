//! Picks one object and places it in the bin: grasp and place are chosen together, so that both ends are reachable.

use std::time::Instant;

use grip_sim::objects::{Fragility, ObjectInfo};
use grip_sim::pose::Pose;
use nalgebra::{Isometry3, Vector3};
use rand_chacha::ChaCha8Rng;

use crate::antipodal::PAD_FRICTION;
use crate::belief::BeliefScene;
use crate::cartesian::{CartesianPath, straight_line, translate};
use crate::collision::{Body, CollisionChecker, CollisionPair, Held, Query};
use crate::grasp::{Grasp, hand_may_touch, rank_grasps};
use crate::place::{PlacePose, place_poses};
use crate::plan::{
    Action, GripperCommand, Guard, PickPlacePlan, PlanCounters, PlanFailure, PlanStage, PlanStep, StepName,
};
use crate::planner::Planner;
use crate::stable::{nearest_standing, stable_facets};
use crate::timing::Trajectory;

/// Height over which a lifted object may still touch what it touched when it lay, metres.
const LEAVING: f64 = 0.03;
/// Directions tried for a lift that leans.
const LIFTS_ASIDE: u32 = 8;
/// A guarded motion that stops with less than this left has arrived, metres.
const NEAR: f64 = 0.02;

/// What may be risked: other picks may first make better ones of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Care {
    /// Firm grasps alone ([`crate::grasp::GraspSettings::firm`]), and lifts that leave what the object leans against within the
    /// first centimetres, aside where up does not.
    Careful,
    /// Any grasp, and lifts that slide along other objects all the way up: they may be taken along or knocked over.
    Bold,
}

/// A grasp with its straight motions.
pub(crate) struct Picked {
    pub(crate) grasp: Grasp,
    held: Held,
    /// From the pre-grasp pose to the grasp, fingers open.
    pub(crate) approach: CartesianPath,
    /// From the grasp upwards, fingers closed.
    lift: CartesianPath,
}

/// A place with its straight motions.
struct Placed {
    place: PlacePose,
    /// From above to the release, fingers closed.
    lower: CartesianPath,
    /// From the release back, fingers open.
    retreat: CartesianPath,
    opening: f64,
}

/// The state of one planning call.
pub(crate) struct Attempt<'a> {
    planner: &'a Planner,
    belief: &'a BeliefScene,
    pub(crate) checker: CollisionChecker,
    target: usize,
    care: Care,
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
        care: Care,
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
        let belief = settled(belief, self.settings.snap);
        let mut attempt = Attempt::new(self, &belief, target, q_now, care);
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
        care: Care,
    ) -> Self {
        Self {
            planner,
            care,
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
        let planner = self.planner;
        let settings = &planner.settings;
        let object = &self.belief.objects[self.target];
        let known = planner.grasps(&object.model);
        let (grasps, counters) = rank_grasps(
            &known,
            self.belief,
            self.target,
            &self.checker,
            &planner.config.gripper,
            &settings.grasp,
        );
        self.counters.grasps = counters;
        if counters.candidates == 0 {
            self.failed.1 = "the object has no antipodal grasp for this gripper".into();
        }
        let mut places: Option<Vec<PlacePose>> = None;
        let careful = self.care == Care::Careful;
        let ranked = grasps.into_iter().filter(|grasp| !careful || grasp.score >= settings.grasp.firm);
        for grasp in ranked.take(settings.tries[0]) {
            let Some(picked) = self.pick(grasp) else {
                continue;
            };
            let places = places.get_or_insert_with(|| place_poses(self.belief, self.target, &settings.place));
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
                if reached_for > settings.tries[1] {
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
                if searches >= 3 {
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
        held: Option<&Held>,
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
        let near = Query { held: None, allowed: &touch, margins: settings.near };
        let free = Query { held: None, allowed: &[], margins: settings.free };
        let object = &self.belief.objects[self.target];
        let held = Held::new(&object.model, self.target, *grasp.object_from_gripper.inverse().iso());
        let solutions = solver.solutions(&base_from_gripper, &open, settings.ik_seeds, 3, |q| {
            self.checker.in_collision(q, &near).is_none()
        });
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

    fn lift(&self, closed: &[f64], held: &Held) -> Option<CartesianPath> {
        let settings = &self.planner.settings;
        let near = Query { held: Some(held), allowed: &[], margins: settings.near };
        // What it lies on, leans against or overlaps, since estimates do, is left within the first centimetres; if need be,
        // other objects slide along it all the way up.
        let lying = self.checker.collisions(closed, &near);
        let beside: Vec<CollisionPair> =
            lying.iter().copied().filter(|p| p.a == Body::Held && matches!(p.b, Body::Object(_))).collect();
        let leaving = Query { allowed: &lying, ..near };
        let rising = match self.care {
            Care::Careful => near,
            Care::Bold => Query { allowed: &beside, ..near },
        };
        let clear = Query { margins: settings.free, ..near };
        let up = settings.lifts.iter().map(|&height| Vector3::z() * height);
        // Beside a wall or another object: away from it, to whichever side that is.
        let tallest = settings.lifts.iter().copied().fold(0.0, f64::max);
        let aside = (0..LIFTS_ASIDE).map(|k| {
            let azimuth = std::f64::consts::TAU * f64::from(k) / f64::from(LIFTS_ASIDE);
            let lean = tallest * settings.lift_lean.tan();
            Vector3::new(lean * azimuth.cos(), lean * azimuth.sin(), tallest)
        });
        up.chain(aside).find_map(|way| {
            let path = translate(&self.planner.solver, closed, way, |gone, q| {
                let query = if gone < LEAVING { &leaving } else { &rising };
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
        let opening = (picked.grasp.width + settings.release).min(self.planner.config.gripper.opening);
        (base_from_gripper, opening)
    }

    /// Whether the hand with the object, closed and open, is free at a place.
    fn hand_fits(&self, picked: &Picked, place: &PlacePose) -> bool {
        let (base_from_gripper, opening) = self.release(picked, place);
        let holding = Query { held: Some(&picked.held), allowed: &[], margins: self.planner.settings.near };
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
        let holding = Query { held: Some(&picked.held), allowed: &[], margins: settings.near };
        let closed = picked.lift.end();
        let q = solver
            .solutions(&base_from_gripper, closed, settings.ik_seeds, 1, |q| {
                self.checker.in_collision(q, &holding).is_none()
            })
            .into_iter()
            .next()?;
        // Up until the object is above the walls.
        let up = (self.belief.bin.wall_height + settings.over_walls - place.support_height).max(0.08);
        let raise =
            translate(solver, &q, Vector3::z() * up, |_, q| self.checker.in_collision(q, &holding)).ok()?;
        let clear = Query { margins: settings.free, ..holding };
        if self.checker.in_collision(raise.end(), &clear).is_some() {
            return None;
        }
        let empty = Query { held: None, allowed: &self.touch, margins: settings.near };
        let open = self.planner.with_fingers(&q, opening);
        let back = base_from_gripper.rotation * -Vector3::x();
        let retreat = [back * settings.retreat, Vector3::z() * up].into_iter().find_map(|way| {
            translate(solver, &open, way, |_, q| self.checker.in_collision(q, &empty)).ok()
        })?;
        self.counters.places_reached += 1;
        Some(Placed { place: place.clone(), lower: raise.reversed(), retreat, opening })
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
        let straight = |path: &CartesianPath, speed, guarded: bool, holding| Action::Move {
            trajectory: self.planner.time_straight(path, speed, holding),
            guard: guarded.then(|| Guard {
                force_n: settings.guard_force,
                near: NEAR,
                length: path.length(),
            }),
            holding,
        };
        let grip = |command, width| Action::Gripper { command, width };
        let force_n =
            grip_force(&object.model.info, picked.grasp.lever, self.planner.config.gripper.max_force);
        let (slow, fast) = (settings.guarded_speed, settings.straight_speed);
        let opening = picked.grasp.opening;
        let width = picked.grasp.width;
        let released = placed.opening;
        let steps = [
            (StepName::Open, grip(GripperCommand::Open { width: opening }, opening)),
            (StepName::ToPregrasp, free(to_pregrasp, false)),
            (StepName::Approach, straight(&picked.approach, slow, true, false)),
            (StepName::Close, grip(GripperCommand::Close { force_n }, width)),
            (StepName::Lift, straight(&picked.lift, fast, false, true)),
            (StepName::Carry, free(carry, true)),
            (StepName::Lower, straight(&placed.lower, slow, true, true)),
            (StepName::Release, grip(GripperCommand::Open { width: released }, released)),
            (StepName::Retreat, straight(&placed.retreat, fast, false, false)),
        ];
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

/// The belief with objects that nearly stand on the table moved vertically so that they do: a table's height is known
/// far better than an object's.
pub fn settled(belief: &BeliefScene, tolerance: f64) -> BeliefScene {
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
        let gap = lowest - belief.table_height;
        if gap.abs() <= tolerance {
            let mut pose = *object.world_from_object.iso();
            pose.translation.vector.z -= gap;
            object.world_from_object = Pose::new(pose);
        }
    }
    belief
}

/// Force of each finger, newtons: two contacts carry weight and acceleration (together 1.3 g) with a safety factor of
/// 4, more for a centre of mass beside the pads (`lever`, metres), about which it would turn; within 30 to `max_force`,
/// less for what breaks.
pub fn grip_force(info: &ObjectInfo, lever: f64, max_force: f64) -> f64 {
    const LOAD: f64 = 1.3 * 9.81;
    const SAFETY: f64 = 4.0;
    let friction = 0.5 * (PAD_FRICTION + info.friction);
    let need = SAFETY * info.mass_kg * LOAD / (2.0 * friction.max(0.1)) * (1.0 + lever / 0.02);
    let (low, high) = match info.fragility {
        Fragility::Sturdy => (30.0, max_force),
        Fragility::Delicate => (20.0, 0.7 * max_force),
        Fragility::Fragile => (10.0, 0.4 * max_force),
    };
    need.clamp(low, high.max(low))
}

/// Tilted by more than this from where it would stand, an object leans, radians.
const LEANS: f64 = 0.1;
/// What leans and is nearer than this to something leans on it, metres.
const LEANS_ON: f64 = 0.01;

/// The order in which to pick the objects that are not packed yet, in tiers: those that nothing lies on or leans against,
/// then those that one other object does, and so on. In a tier first those with the fewest neighbours within 4 cm, then the
/// nearest to the robot, a decimetre of height counting like one of distance.
pub fn pick_order(belief: &BeliefScene) -> Vec<Vec<usize>> {
    let base = belief.world_from_base.translation();
    let waiting: Vec<usize> = (0..belief.objects.len()).filter(|&i| !belief.objects[i].packed).collect();
    // Half extents along the world's axes about the centre.
    let reach = |i: usize| {
        let o = &belief.objects[i];
        let half = 0.5 * o.model.size();
        let r = o.world_from_object.rotation().to_rotation_matrix();
        r.matrix().abs() * half
    };
    let leans: Vec<bool> = belief
        .objects
        .iter()
        .map(|o| {
            let now = o.world_from_object.rotation();
            !o.packed && nearest_standing(&stable_facets(&o.model.visual.mesh), &now).angle_to(&now) > LEANS
        })
        .collect();
    let mut keyed: Vec<(usize, usize, f64, usize)> = waiting
        .iter()
        .map(|&i| {
            let (t, half) = (belief.objects[i].world_from_object.translation(), reach(i));
            let (mut carries, mut crowd) = (0, 0);
            for &k in waiting.iter().filter(|&&k| k != i) {
                let (u, other) = (belief.objects[k].world_from_object.translation(), reach(k));
                let gap = |axis: usize| (t[axis] - u[axis]).abs() - half[axis] - other[axis];
                let beside = gap(0).max(gap(1));
                let above = u.z - other.z > t.z + 0.5 * half.z;
                let leaned_on = leans[k] && beside < LEANS_ON && gap(2) < LEANS_ON;
                carries += usize::from(beside < 0.0 && above || leaned_on);
                crowd += usize::from(beside < 0.04 && !above);
            }
            let distance = (t - base).xy().norm() - 2.0 * half.z;
            (carries, crowd, distance, i)
        })
        .collect();
    keyed.sort_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)).then(a.3.cmp(&b.3)));
    keyed.chunk_by(|a, b| a.0 == b.0).map(|tier| tier.iter().map(|k| k.3).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{box_model, cylinder_model, empty_scene, standing};

    #[test]
    fn what_others_lie_on_or_lean_against_comes_last() {
        let mut belief = empty_scene();
        let (carton, can) = (box_model("carton", [0.09, 0.04, 0.18]), cylinder_model("can", 0.033, 0.10));
        belief.objects = vec![standing(&carton, 0.55, 0.0, 0.0), standing(&can, 0.75, 0.2, 0.0)];
        assert_eq!(pick_order(&belief), [[0, 1]], "the nearest first");
        // The can on top of the carton.
        let table = belief.table_height;
        belief.objects[1].world_from_object = Pose::from_xyz_rpy([0.55, 0.0, table + 0.23], [0.0; 3]);
        assert_eq!(pick_order(&belief), [[1], [0]]);
        // A bottle beside it is no hindrance while it stands, and one to come first when it leans.
        let bottle = box_model("bottle", [0.04, 0.04, 0.16]);
        belief.objects[1] = standing(&bottle, 0.55, 0.045, 0.0);
        assert_eq!(pick_order(&belief), [[0, 1]]);
        belief.objects[1].world_from_object =
            Pose::from_xyz_rpy([0.55, 0.075, table + 0.09], [0.4, 0.0, 0.0]);
        assert_eq!(pick_order(&belief), [[1], [0]]);
    }

    #[test]
    fn the_grip_carries_the_weight_four_times_over_and_spares_what_breaks() {
        let mut info = box_model("brick", [0.05; 3]).info.clone();
        (info.mass_kg, info.friction, info.fragility) = (1.0, 0.5, Fragility::Sturdy);
        // Mean friction 0.7, two pads: 4 * 1.3 g / (2 * 0.7).
        let force = grip_force(&info, 0.0, 60.0);
        assert!((force - 4.0 * 1.3 * 9.81 / 1.4).abs() < 1e-9, "{force}");
        assert!((grip_force(&info, 0.01, 60.0) - 1.5 * force).abs() < 1e-9, "a lever of a centimetre");
        assert_eq!(grip_force(&info, 0.1, 60.0), 60.0);
        info.fragility = Fragility::Fragile;
        assert_eq!(grip_force(&info, 0.1, 60.0), 24.0);
        info.mass_kg = 0.01;
        assert_eq!(grip_force(&info, 0.0, 60.0), 10.0);
    }
}
