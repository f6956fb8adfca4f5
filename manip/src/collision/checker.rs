//! Collision checks of a configuration against the believed scene, the robot itself and what it holds.
//!
//! Three stages, cheapest first: a ball about each link against a box about each obstacle; the row of balls that covers
//! each convex piece against the oriented box of the other; GJK (parry). A pair counts as colliding when it is closer
//! than a margin. Everything is in the robot's base frame, in single precision.

use std::cell::RefCell;
use std::sync::Arc;

use nalgebra::Isometry3;
use parry3d::math::{Pose, Vector};

use super::cloud::Cloud;
use super::piece::Piece;
use super::query::{CollisionBody, CollisionPair, CollisionQuery};
use super::robot::{LinkSolids, RobotSolids};
use super::solid::{depth, distance, near, pose32};
use crate::belief::BeliefScene;

/// A fixture or object in the base frame.
#[derive(Debug)]
pub(super) struct Obstacle {
    pub body: CollisionBody,
    pub pieces: Vec<Piece>,
    /// Box about all pieces, base axes.
    pub center: Vector,
    pub half: Vector,
    pub spread: f32,
}

/// Buffers of a check.
#[derive(Debug, Default)]
struct Scratch {
    poses: Vec<Isometry3<f64>>,
    links: Vec<Pose>,
}

/// Checks configurations of one robot in one believed scene.
#[derive(Debug)]
pub struct CollisionChecker {
    pub(super) robot: Arc<RobotSolids>,
    pub(super) obstacles: Vec<Obstacle>,
    pub(super) cloud: Option<Cloud>,
    names: Vec<(CollisionBody, String)>,
    scratch: RefCell<Scratch>,
}

impl CollisionChecker {
    /// The scene `belief` about `robot`.
    pub fn new(robot: Arc<RobotSolids>, belief: &BeliefScene) -> Self {
        let base_from_world = belief.world_from_base.iso().inverse();
        let fixtures = belief.fixtures.iter().enumerate().map(|(i, shape)| {
            let piece = Piece::new(shape, &base_from_world);
            obstacle(CollisionBody::Fixture(i), vec![piece], 0.0)
        });
        let objects = belief.objects.iter().enumerate().map(|(i, object)| {
            let base_from_object = base_from_world * object.world_from_object.iso();
            let pieces = object.model.collision.iter().map(|s| Piece::new(s, &base_from_object)).collect();
            obstacle(CollisionBody::Object(i), pieces, object.position_std_m.clamp(0.0, 0.010))
        });
        let names = belief
            .objects
            .iter()
            .enumerate()
            .map(|(i, o)| (CollisionBody::Object(i), o.name.clone()))
            .collect();
        Self {
            obstacles: fixtures.chain(objects).filter(|o| !o.pieces.is_empty()).collect(),
            cloud: Cloud::new(&belief.unmodelled, &base_from_world),
            names,
            robot,
            scratch: RefCell::default(),
        }
    }

    /// The robot's solids.
    pub fn robot(&self) -> &Arc<RobotSolids> {
        &self.robot
    }

    /// A body's name for people.
    pub fn name(&self, body: CollisionBody) -> String {
        match body {
            CollisionBody::Link(i) => self.robot.model.links()[i].name.clone(),
            CollisionBody::Fixture(i) => format!("fixture {i}"),
            CollisionBody::Held => "held object".into(),
            CollisionBody::Unmodelled => "an unmodelled obstacle".into(),
            CollisionBody::Object(_) => self
                .names
                .iter()
                .find(|(b, _)| *b == body)
                .map_or_else(|| "object".into(), |(_, name)| name.clone()),
        }
    }

    /// A pair for people.
    pub fn describe(&self, pair: CollisionPair) -> String {
        format!("{} and {}", self.name(pair.a), self.name(pair.b))
    }

    /// The first pair found too close at `q` (all movable joints, finite), or none.
    pub fn in_collision(&self, q: &[f64], query: &CollisionQuery<'_>) -> Option<CollisionPair> {
        let mut found = None;
        self.visit(q, query, &mut |pair| {
            found = Some(pair);
            true
        });
        found
    }

    /// All pairs too close at `q`, in a fixed order.
    pub fn collisions(&self, q: &[f64], query: &CollisionQuery<'_>) -> Vec<CollisionPair> {
        let mut found = Vec::new();
        self.visit(q, query, &mut |pair| {
            found.push(pair);
            false
        });
        found
    }

    /// Calls `report` for each pair too close until it says stop.
    fn visit(&self, q: &[f64], query: &CollisionQuery<'_>, report: &mut impl FnMut(CollisionPair) -> bool) {
        let scratch = &mut *self.scratch.borrow_mut();
        self.robot.model.fk_into(q, &mut scratch.poses);
        scratch.links.clear();
        scratch.links.extend(scratch.poses.iter().map(pose32));
        let poses = &scratch.links;

        let margin = query.margins.world as f32;
        let skip = query.held.map(|h| CollisionBody::Object(h.object));
        for (i, (link, pose)) in self.robot.links.iter().zip(poses).enumerate() {
            if link.moves && !link.pieces.is_empty() {
                for o in self.obstacles.iter().filter(|o| Some(o.body) != skip) {
                    let pair = CollisionPair { a: CollisionBody::Link(i), b: o.body };
                    if o.meets(link, pose, margin, query) && !query.allows(pair.a, pair.b) && report(pair) {
                        return;
                    }
                }
                let pair = CollisionPair { a: CollisionBody::Link(i), b: CollisionBody::Unmodelled };
                if self.meets_cloud(link, pose, margin) && !query.allows(pair.a, pair.b) && report(pair) {
                    return;
                }
            }
        }
        let own = query.margins.own as f32;
        for &(a, b) in &self.robot.pairs {
            let pair = CollisionPair { a: CollisionBody::Link(a), b: CollisionBody::Link(b) };
            if links_meet((&self.robot.links[a], &poses[a]), (&self.robot.links[b], &poses[b]), own)
                && !query.allows(pair.a, pair.b)
                && report(pair)
            {
                return;
            }
        }
        let Some(held) = query.held else { return };
        let pose = &poses[self.robot.gripper];
        for o in self.obstacles.iter().filter(|o| Some(o.body) != skip) {
            let pair = CollisionPair { a: CollisionBody::Held, b: o.body };
            if o.meets(&held.solids, pose, margin, query) && !query.allows(pair.a, pair.b) && report(pair) {
                return;
            }
        }
        let pair = CollisionPair { a: CollisionBody::Held, b: CollisionBody::Unmodelled };
        if self.meets_cloud(&held.solids, pose, margin) && !query.allows(pair.a, pair.b) && report(pair) {
            return;
        }
        for (i, link) in self.robot.links.iter().enumerate() {
            if link.pieces.is_empty() || self.robot.hand.contains(&i) {
                continue;
            }
            let pair = CollisionPair { a: CollisionBody::Held, b: CollisionBody::Link(i) };
            if links_meet((&held.solids, pose), (link, &poses[i]), own)
                && !query.allows(pair.a, pair.b)
                && report(pair)
            {
                return;
            }
        }
    }

    /// How deep the two bodies of a pair of links, fixtures and objects are in each other at `q`, metres; 0 for others and where
    /// they do not meet.
    pub fn depth(&self, q: &[f64], pair: CollisionPair) -> f64 {
        let poses: Vec<Pose> = self.robot.model.fk(q).iter().map(pose32).collect();
        let solids = |body: CollisionBody| match body {
            CollisionBody::Link(i) => Some((&self.robot.links[i].pieces, poses[i])),
            _ => self.obstacles.iter().find(|o| o.body == body).map(|o| (&o.pieces, Pose::IDENTITY)),
        };
        let (Some((a, pose_a)), Some((b, pose_b))) = (solids(pair.a), solids(pair.b)) else { return 0.0 };
        let mut deepest = 0.0_f32;
        for a in a {
            for b in b {
                let pose12 = (pose_b * b.pose).inverse() * (pose_a * a.pose);
                deepest = deepest.max(depth(&pose12, &b.solid, &a.solid));
            }
        }
        deepest.into()
    }

    fn meets_cloud(&self, solids: &LinkSolids, pose: &Pose, margin: f32) -> bool {
        self.cloud.as_ref().is_some_and(|cloud| cloud.meets(solids, pose, margin))
    }

    /// Distance of the robot and what it holds from fixtures and objects, metres: at most `max`, 0 in contact.
    /// Allowed pairs do not count, margins are ignored.
    pub fn clearance(&self, q: &[f64], query: &CollisionQuery<'_>, max: f64) -> f64 {
        let poses: Vec<Pose> = self.robot.model.fk(q).iter().map(pose32).collect();
        let links = self.robot.links.iter().enumerate().filter(|(_, l)| l.moves);
        let held = query.held.map(|h| (CollisionBody::Held, &h.solids, &poses[self.robot.gripper]));
        let skip = query.held.map(|h| CollisionBody::Object(h.object));
        links
            .map(|(i, link)| (CollisionBody::Link(i), link, &poses[i]))
            .chain(held)
            .fold(max as f32, |best, (body, solids, pose)| {
                self.body_clearance(body, solids, pose, skip, query, best)
            })
            .into()
    }

    fn body_clearance(
        &self,
        body: CollisionBody,
        solids: &LinkSolids,
        pose: &Pose,
        skip: Option<CollisionBody>,
        query: &CollisionQuery<'_>,
        mut best: f32,
    ) -> f32 {
        if let Some(cloud) = self.cloud.as_ref().filter(|_| !query.allows(body, CollisionBody::Unmodelled)) {
            for piece in &solids.pieces {
                let reachable =
                    piece.cover.iter().any(|c| cloud.may_meet_ball(*pose * *c, piece.ball + best));
                if reachable {
                    best = best.min(cloud.piece_distance(piece, pose, best));
                }
            }
        }
        for o in &self.obstacles {
            if Some(o.body) == skip || query.allows(body, o.body) {
                continue;
            }
            let center = *pose * solids.center;
            if o.box_distance(center) > solids.radius + best {
                continue;
            }
            for piece in &solids.pieces {
                let at = *pose * piece.pose;
                for other in &o.pieces {
                    let reachable = piece
                        .cover
                        .iter()
                        .any(|c| other.box_distance_squared(*pose * *c) <= (piece.ball + best).powi(2));
                    if reachable {
                        let pose12 = other.pose.inverse() * at;
                        best = best.min(distance(&pose12, &other.solid, &piece.solid, best));
                    }
                }
            }
        }
        best
    }

    /// The first obstacle that the hand alone, at `base_from_gripper` with `opening` metres between the pads, is too
    /// close to. What is held is checked along with it.
    pub fn hand_collision(
        &self,
        base_from_gripper: &Isometry3<f64>,
        opening: f64,
        query: &CollisionQuery<'_>,
    ) -> Option<CollisionPair> {
        let margin = query.margins.world as f32;
        let skip = query.held.map(|h| CollisionBody::Object(h.object));
        let gripper = pose32(base_from_gripper);
        let held = query.held.map(|h| (CollisionBody::Held, &h.solids, gripper));
        self.robot
            .hand_poses(opening)
            .map(|(i, gripper_from_link)| {
                let pose = pose32(&(base_from_gripper * gripper_from_link));
                (CollisionBody::Link(i), &self.robot.links[i], pose)
            })
            .chain(held)
            .find_map(|(body, solids, pose)| {
                self.obstacles
                    .iter()
                    .filter(|o| Some(o.body) != skip)
                    .find(|o| o.meets(solids, &pose, margin, query) && !query.allows(body, o.body))
                    .map(|o| o.body)
                    .or_else(|| {
                        let touches = self.meets_cloud(solids, &pose, margin)
                            && !query.allows(body, CollisionBody::Unmodelled);
                        touches.then_some(CollisionBody::Unmodelled)
                    })
                    .map(|b| CollisionPair { a: body, b })
            })
    }

    /// Distance of the hand alone from the obstacles, metres: at most `max`, 0 in contact.
    pub fn hand_clearance(
        &self,
        base_from_gripper: &Isometry3<f64>,
        opening: f64,
        query: &CollisionQuery<'_>,
        max: f64,
    ) -> f64 {
        let skip = query.held.map(|h| CollisionBody::Object(h.object));
        self.robot
            .hand_poses(opening)
            .fold(max as f32, |best, (i, gripper_from_link)| {
                let pose = pose32(&(base_from_gripper * gripper_from_link));
                let solids = &self.robot.links[i];
                self.body_clearance(CollisionBody::Link(i), solids, &pose, skip, query, best)
            })
            .into()
    }
}

fn obstacle(body: CollisionBody, pieces: Vec<Piece>, spread: f64) -> Obstacle {
    let mut low = Vector::splat(f32::INFINITY);
    let mut high = Vector::splat(f32::NEG_INFINITY);
    for corner in pieces.iter().flat_map(Piece::corners) {
        low = low.min(corner);
        high = high.max(corner);
    }
    Obstacle { body, pieces, center: (low + high) * 0.5, half: (high - low) * 0.5, spread: spread as f32 }
}

impl Obstacle {
    pub fn box_distance(&self, point: Vector) -> f32 {
        ((point - self.center).abs() - self.half).max(Vector::ZERO).length()
    }

    /// Whether solids at `pose` are closer than the margin.
    fn meets(&self, solids: &LinkSolids, pose: &Pose, margin: f32, query: &CollisionQuery<'_>) -> bool {
        let margin = margin + self.spread * query.margins.spread as f32;
        if self.box_distance(*pose * solids.center) > solids.radius + margin {
            return false;
        }
        solids.pieces.iter().any(|piece| {
            let bound = piece.ball + margin;
            let touches_box = piece.cover.iter().any(|c| self.box_distance(*pose * *c) <= bound);
            touches_box
                && self.pieces.iter().any(|other| pieces_meet(piece, pose, other, &Pose::IDENTITY, margin))
        })
    }
}

fn links_meet(a: (&LinkSolids, &Pose), b: (&LinkSolids, &Pose), margin: f32) -> bool {
    let apart = (*a.1 * a.0.center - *b.1 * b.0.center).length();
    apart <= a.0.radius + b.0.radius + margin
        && a.0.pieces.iter().any(|p| b.0.pieces.iter().any(|other| pieces_meet(p, a.1, other, b.1, margin)))
}

pub(super) fn pieces_meet(a: &Piece, pose_a: &Pose, b: &Piece, pose_b: &Pose, margin: f32) -> bool {
    let b_from_a = pose_b.inverse() * *pose_a;
    let bound = (a.ball + margin).powi(2);
    if !a.cover.iter().any(|c| b.box_distance_squared(b_from_a * *c) <= bound) {
        return false;
    }
    // The other way round too: a long piece's balls are loose about a short one.
    let a_from_b = b_from_a.inverse();
    let bound = (b.ball + margin).powi(2);
    if !b.cover.iter().any(|c| a.box_distance_squared(a_from_b * *c) <= bound) {
        return false;
    }
    let pose12 = b.pose.inverse() * b_from_a * a.pose;
    near(&pose12, &b.solid, &a.solid, margin)
}
