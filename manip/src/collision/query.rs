//! What a collision check is asked: which bodies, how near, which pairs may touch, what is in the hand.

use grip_sim::objects::ObjectModel;
use nalgebra::Isometry3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::piece::Piece;
use super::robot::LinkSolids;
use crate::ranges::Ranges;

/// Something that can collide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum CollisionBody {
    /// A link, by its index in the robot model.
    Link(usize),
    /// A fixture, by its index in the belief.
    Fixture(usize),
    /// An object, by its index in the belief.
    Object(usize),
    /// What the depth image shows and nothing believed explains.
    Unmodelled,
    /// The object in the hand.
    Held,
}

/// Two bodies closer than the margin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CollisionPair {
    /// A link or the held object.
    pub a: CollisionBody,
    /// The other one.
    pub b: CollisionBody,
}

/// How often a body of which kind was in the way.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct InTheWay {
    /// Table, bin, shelf.
    pub fixtures: usize,
    /// Other believed objects.
    pub objects: usize,
    /// What the depth image shows and nothing believed explains.
    pub unmodelled: usize,
    /// The robot itself, or what it holds.
    pub robot: usize,
}

impl InTheWay {
    /// Counts the second body of a pair.
    pub(crate) fn count(&mut self, pair: CollisionPair) {
        *match pair.b {
            CollisionBody::Fixture(_) => &mut self.fixtures,
            CollisionBody::Object(_) => &mut self.objects,
            CollisionBody::Unmodelled => &mut self.unmodelled,
            CollisionBody::Link(_) | CollisionBody::Held => &mut self.robot,
        } += 1;
    }

    /// Counts what was counted elsewhere, too.
    pub(crate) fn add(&mut self, other: &Self) {
        self.fixtures += other.fixtures;
        self.objects += other.objects;
        self.unmodelled += other.unmodelled;
        self.robot += other.robot;
    }

    /// Of all kinds.
    pub fn total(&self) -> usize {
        self.fixtures + self.objects + self.unmodelled + self.robot
    }
}

/// How close is too close.
///
/// As a part of [`crate::PlannerSettings`] it may be given in part: each of its two places there has defaults of its own.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Margins {
    /// Robot and held object to fixtures and objects, metres, 0 to 0.2.
    pub world: f64,
    /// Between links, and of the held object to links, metres, 0 to 0.1.
    pub own: f64,
    /// Share of an object's position spread (capped at 10 mm) that is added to its margin, 0 to 10.
    pub spread: f64,
}

impl Margins {
    /// None: only what overlaps collides.
    pub const TOUCHING: Self = Self { world: 0.0, own: 0.0, spread: 0.0 };

    /// What is wrong with a value, if anything: the first field out of its range, its value and the range.
    ///
    /// # Errors
    /// That.
    pub fn validate(&self) -> Result<(), String> {
        Ranges::default()
            .number("world", self.world, 0.0..=0.2, "metres")
            .number("own", self.own, 0.0..=0.1, "metres")
            .number("spread", self.spread, 0.0..=10.0, "a share")
            .result()
    }
}

/// The object in the hand, rigid in the gripper link's frame.
#[derive(Debug, Clone)]
pub struct HeldObject {
    pub(super) solids: LinkSolids,
    /// Index of the object in the belief; it is no obstacle while it is held.
    pub object: usize,
    /// Gripper link from object.
    pub gripper_from_object: Isometry3<f64>,
    /// Distance of the farthest point from the gripper link's origin, metres.
    pub extent: f64,
}

impl HeldObject {
    /// `model`, the belief's object number `object`, held at `gripper_from_object`.
    pub fn new(model: &ObjectModel, object: usize, gripper_from_object: Isometry3<f64>) -> Self {
        let pieces: Vec<Piece> =
            model.collision.iter().map(|s| Piece::new(s, &gripper_from_object)).collect();
        let extent = pieces.iter().flat_map(Piece::corners).fold(0.0_f32, |m, c| m.max(c.length()));
        let pieces = pieces.into_iter().map(Piece::with_row_of_balls).collect();
        Self { solids: LinkSolids::new(pieces, true), object, gripper_from_object, extent: f64::from(extent) }
    }
}

/// What a check takes into account.
#[derive(Debug, Clone, Copy)]
pub struct CollisionQuery<'a> {
    /// The object in the hand.
    pub held: Option<&'a HeldObject>,
    /// Pairs that may meet, each in either order.
    pub allowed: &'a [CollisionPair],
    /// How close is too close.
    pub margins: Margins,
}

impl CollisionQuery<'_> {
    pub(super) fn allows(&self, a: CollisionBody, b: CollisionBody) -> bool {
        self.allowed.iter().any(|p| (p.a == a && p.b == b) || (p.a == b && p.b == a))
    }
}
