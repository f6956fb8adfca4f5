//! Pushing: what lies so close together that nothing of it can be grasped is moved apart, along the table, by the closed hand.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::pick_place::{joined, snapped_to_ground};
use crate::belief::BeliefScene;
use crate::collision::{CollisionChecker, CollisionPair, CollisionQuery};
use crate::grasp::hand_may_touch;
use crate::motion::{CartesianPath, translate};
use crate::plan::{Action, GripperCommand, Guard, PlanCounters, PlanFailure, PlanStage, PlanStep, StepName};
use crate::planner::Planner;
use crate::ranges::Ranges;

/// Settings of [`Planner::plan_push`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PushSettings {
    /// How far an object is pushed, metres, 0.01 to 0.5. Default 0.08: about the width of what stood beside it.
    pub length: f64,
    /// Room between the closed fingers and the object before, metres, 0 to 0.2. Default 0.02.
    pub room: f64,
    /// How high above what the object stands on the finger tips are at most, metres, 0.005 to 0.2. Default 0.03: low, so that it slides
    /// and does not fall over.
    pub height: f64,
    /// What is pushed must end so far from the bin's walls and the table's edge, metres, 0 to 0.5. Default 0.05.
    pub edge: f64,
    /// Directions that are tried, 1 to 64. Default 12.
    pub directions: usize,
    /// Force at which the hand stops, newtons, 1 to 1000. Default 40: five items of half a kilogram slide by 15.
    pub force: f64,
    /// How far up the hand comes down from and goes again, metres, 0.01 to 0.5. Default 0.15.
    pub rise: f64,
}

impl Default for PushSettings {
    fn default() -> Self {
        Self { length: 0.08, room: 0.02, height: 0.03, edge: 0.05, directions: 12, force: 40.0, rise: 0.15 }
    }
}

impl PushSettings {
    /// What is wrong with a value, if anything: the first field out of its range, its value and the range.
    ///
    /// # Errors
    /// That.
    pub fn validate(&self) -> Result<(), String> {
        Ranges::default()
            .number("length", self.length, 0.01..=0.5, "metres")
            .number("room", self.room, 0.0..=0.2, "metres")
            .number("height", self.height, 0.005..=0.2, "metres")
            .number("edge", self.edge, 0.0..=0.5, "metres")
            .count("directions", self.directions, 1..=64)
            .number("force", self.force, 1.0..=1000.0, "newtons")
            .number("rise", self.rise, 0.01..=0.5, "metres")
            .result()
    }
}

/// A way to push an object.
struct Way {
    /// Unit vector along the table, world frame.
    direction: Vector3<f64>,
    /// Where the finger tips begin.
    from: Point3<f64>,
    /// How far they go, metres.
    length: f64,
    /// How far it leads away from what is near, -1 to 1.
    away: f64,
}

impl Planner {
    /// Plans to push the belief's object `target` away from what is near it, from `q_now` (all movable joints): the closed hand comes
    /// down beside it, goes straight along the table until the way is done or something holds it up, and rises.
    ///
    /// # Errors
    /// The farthest stage that any way reached.
    pub fn plan_push(
        &self,
        belief: &BeliefScene,
        target: usize,
        q_now: &[f64],
        seed: u64,
    ) -> Result<Vec<PlanStep>, PlanFailure> {
        let settings = &self.settings;
        let mut counters = PlanCounters::default();
        let name = belief.objects.get(target).map_or_else(|| format!("object {target}"), |o| o.name.clone());
        let fail = |(stage, reason): (PlanStage, String), counters: PlanCounters| PlanFailure {
            stage,
            object: name.clone(),
            reason,
            counters: Box::new(counters),
        };
        self.check_input(belief, &[q_now]).map_err(|problem| fail(problem, counters))?;
        if target >= belief.objects.len() {
            let reason = format!("the belief has {} objects", belief.objects.len());
            return Err(fail((PlanStage::Input, reason), counters));
        }
        let belief = snapped_to_ground(belief, settings.table_snap);
        let checker = CollisionChecker::new(self.robot.clone(), &belief);
        let closed = self.with_fingers(q_now, 0.0);
        let touch: Vec<CollisionPair> =
            (0..belief.objects.len()).flat_map(|object| hand_may_touch(&self.robot, object)).collect();
        let near = CollisionQuery { held: None, allowed: &[], margins: settings.near_margins };
        let pushing = CollisionQuery { allowed: &touch, ..near };
        let free = CollisionQuery { margins: settings.free_margins, ..near };
        let world_from_base = belief.world_from_base.iso();
        let mut rng = grip_sim::rng::stream(seed, "push");
        let mut failed =
            (PlanStage::NoIk, "nothing is near it, or no way to push it is within reach and free".to_owned());
        for way in ways(&belief, target, &settings.push) {
            for across in [0.0, FRAC_PI_2] {
                let world_from_gripper = self.above(&way, across);
                let base_from_gripper = world_from_base.inverse() * world_from_gripper;
                let accept = |q: &[f64]| checker.in_collision(q, &near).is_none();
                let beside = self.solver.solutions(
                    &base_from_gripper,
                    &closed,
                    settings.ik_seeds,
                    settings.ik_solutions,
                    accept,
                );
                for q in beside {
                    let along = world_from_base.inverse() * way.direction * way.length;
                    let up = Vector3::z() * settings.push.rise;
                    let path = |q: &[f64], by: Vector3<f64>, query: &CollisionQuery<'_>| {
                        translate(&self.solver, q, by, |_, q| checker.in_collision(q, query)).ok()
                    };
                    let Some(down) = path(&q, up, &near)
                        .filter(|raise| checker.in_collision(raise.end(), &free).is_none())
                        .map(|raise| raise.reversed())
                    else {
                        continue;
                    };
                    let Some(push) = path(&q, along, &pushing) else { continue };
                    let Some(rise) = path(push.end(), up, &pushing) else { continue };
                    let above = down.waypoints[0].clone();
                    match self.search(&checker, None, &closed, &[above], &mut counters, &mut rng) {
                        Ok(there) => return Ok(self.push_steps(there, &down, &push, &rise)),
                        Err((_, reason)) => failed = (PlanStage::NoApproachPath, reason),
                    }
                }
            }
        }
        Err(fail(failed, counters))
    }

    /// World from the gripper that points down with its finger tips where a way begins, its closing axis `across` radians from the way.
    fn above(&self, way: &Way, across: f64) -> Isometry3<f64> {
        let down = -Vector3::z();
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), across);
        let closing = turn * way.direction;
        let rotation =
            Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[down, closing, down.cross(&closing)]));
        let tip = self.config.gripper.pad_half_extents.x;
        Isometry3::from_parts(
            (way.from.coords - down * tip).into(),
            UnitQuaternion::from_rotation_matrix(&rotation),
        )
    }

    fn push_steps(
        &self,
        there: crate::motion::Trajectory,
        down: &CartesianPath,
        push: &CartesianPath,
        rise: &CartesianPath,
    ) -> Vec<PlanStep> {
        let (slow, fast) = (self.settings.speed.guarded, self.settings.speed.straight);
        let mut along = self.straight(push, slow, true, false);
        if let Action::Move { guard: Some(guard), .. } = &mut along {
            // Wherever it is held up, it has pushed.
            *guard = Guard { force_n: self.settings.push.force, near: push.length(), ..guard.clone() };
        }
        let close = Action::Gripper { command: GripperCommand::Open { width: 0.0 }, width: 0.0 };
        let steps = [
            (StepName::Open, close),
            (StepName::ToPregrasp, Action::Move { trajectory: there, guard: None, holding: false }),
            (StepName::Approach, self.straight(down, slow, true, false)),
            (StepName::Push, along),
            (StepName::Retreat, self.straight(rise, fast, false, false)),
        ];
        joined(steps.into_iter().map(|(name, action)| PlanStep { name, action }).collect())
    }
}

/// Half of the thickness of closed fingers, metres.
const FINGERS: f64 = 0.015;
/// What is nearer than this to an object is what it is pushed away from, metres.
const BESIDE: f64 = 0.05;

/// Ways to push an object along the table, those first that lead away from what is near.
fn ways(belief: &BeliefScene, target: usize, settings: &PushSettings) -> Vec<Way> {
    let vertices = |k: usize| {
        let object = &belief.objects[k];
        let all = object.model.visual.mesh.positions.iter();
        all.map(|p| object.world_from_object.transform_point(&p.cast::<f64>())).collect::<Vec<_>>()
    };
    let span = |points: &[Point3<f64>], along: &Vector3<f64>| {
        let places = points.iter().map(|p| p.coords.dot(along));
        places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
    };
    let itself = vertices(target);
    let middle = |points: &[Point3<f64>]| {
        [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| {
            let (low, high) = span(points, &axis);
            0.5 * (low + high)
        })
    };
    let center = Point3::from(middle(&itself));
    let (bottom, top) = span(&itself, &Vector3::z());
    let others = (0..belief.objects.len()).filter(|&k| k != target && !belief.objects[k].packed);
    // From all that is near to it.
    let mut away = Vector3::zeros();
    for other in others.map(vertices) {
        let gap = |axis: &Vector3<f64>| {
            let ((a, b), (c, d)) = (span(&itself, axis), span(&other, axis));
            (c - b).max(a - d)
        };
        if gap(&Vector3::x()).max(gap(&Vector3::y())) < BESIDE {
            let to = center - Point3::from(middle(&other));
            away += Vector3::new(to.x, to.y, 0.0).try_normalize(1e-6).unwrap_or_default();
        }
    }
    // What stands alone is not freed by a push.
    let Some(away) = away.try_normalize(1e-6) else { return Vec::new() };
    let tips = bottom + settings.height.min(0.5 * (top - bottom));
    let mut ways: Vec<Way> = (0..settings.directions)
        .filter_map(|k| {
            let angle = TAU * k as f64 / settings.directions as f64;
            let direction = Vector3::new(angle.cos(), angle.sin(), 0.0);
            let (back, front) = span(&itself, &direction);
            let here = center.coords.dot(&direction);
            let mut from = center + direction * (back - here - settings.room - FINGERS);
            from.z = tips;
            let end = center + direction * (front - here + settings.length + settings.edge);
            let safe = belief.is_over_table(&end) && !belief.bin.is_near(&end, settings.edge);
            let length = settings.room + settings.length;
            safe.then(|| Way { direction, from, length, away: direction.dot(&away) })
        })
        .collect();
    ways.sort_by(|a, b| b.away.total_cmp(&a.away));
    ways
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{box_model, empty_scene, standing};

    #[test]
    fn a_push_leads_away_from_what_is_near_and_not_over_the_edge() {
        let mut belief = empty_scene();
        let carton = box_model("carton", [0.06, 0.06, 0.1]);
        belief.objects = vec![standing(&carton, 0.6, 0.1, 0.0), standing(&carton, 0.6, 0.17, 0.0)];
        let settings = PushSettings::default();
        let found = ways(&belief, 0, &settings);
        // The other one is on the left.
        assert!(found[0].direction.y < -0.99, "{}", found[0].direction);
        // From the other side of it, 3 cm half of its width and 2 cm of room, low.
        let from = found[0].from;
        assert!((from.y - (0.1 + 0.03 + 0.02 + FINGERS)).abs() < 1e-6, "{from}");
        assert!((from.z - belief.table_height - 0.03).abs() < 1e-6, "{from}");
        for way in ways(&belief, 1, &settings) {
            let end = Point3::from([0.6, 0.17, 0.7]) + way.direction * (0.03 + settings.length);
            assert!(belief.is_over_table(&end));
        }
        let edge = edge(&belief);
        belief.objects =
            vec![standing(&carton, 0.6, edge - 0.04, 0.0), standing(&carton, 0.6, edge - 0.11, 0.0)];
        let found = ways(&belief, 0, &settings);
        assert!(!found.is_empty() && found.iter().all(|way| way.direction.y < 0.5), "over the edge");
        belief.objects.truncate(1);
        assert!(ways(&belief, 0, &settings).is_empty(), "it stands alone");
    }

    /// Where the table ends at the left.
    fn edge(belief: &BeliefScene) -> f64 {
        (0..400)
            .map(|k| 0.005 * f64::from(k))
            .find(|y| !belief.is_over_table(&Point3::new(0.6, *y, 1.0)))
            .unwrap()
    }
}
