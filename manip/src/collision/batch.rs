//! Eight configurations at once: what is certainly free is found by balls, lane by lane; the exact check has the rest.
//!
//! The balls cover the links' solids (module `cover`), so a configuration whose balls keep clear is free. Where a ball
//! comes too close, the pair of convex solids that it belongs to is checked exactly, for that configuration alone. The
//! answer is thus that of [`CollisionChecker::in_collision`], but for rounding: links are posed in single precision,
//! within some micrometres.
//!
//! One configuration a lane along a motion, far apart at first: "vectorised edge checks" (Thomason, Kingston and Kavraki
//! 2024, VAMP).

use std::cell::RefCell;

use grip_sim::lanes::{F8, Isa, LANES, V8, per_machine};
use grip_sim::robot::{GroupKinematics, Pose8};
use parry3d::math::{Pose, Rotation, Vector};

use super::checker::{CollisionChecker, Obstacle, pieces_meet};
use super::cloud::Cloud;
use super::cover::Ball;
use super::piece::{Frame, Piece};
use super::query::{CollisionBody, CollisionQuery};
use super::robot::LinkSolids;
use super::solid::{Solid, pose32};

/// Checks of a group's configurations, all other joints fixed, for one query.
#[derive(Debug)]
pub(crate) struct Batch<'a> {
    checker: &'a CollisionChecker,
    kinematics: GroupKinematics,
    margin: f32,
    own: f32,
    spread: f32,
    /// What moves, and what it may meet that moves with it or stands.
    parts: Vec<MovingPart<'a>>,
    /// Pairs of `parts` that must not meet.
    pairs: Vec<(usize, usize)>,
    scratch: RefCell<Scratch>,
}

/// A link, or the held object.
#[derive(Debug)]
struct MovingPart<'a> {
    /// Its rigid body in the kinematics, and its pose there.
    body: usize,
    body_from_part: Pose,
    /// About all of it.
    bound: Ball,
    pieces: Vec<MovingPiece<'a>>,
    /// Obstacles that it may meet, by index, and whether it may meet the point cloud.
    obstacles: Vec<usize>,
    cloud: bool,
}

/// A convex piece of a part, in the part's body.
#[derive(Debug)]
struct MovingPiece<'a> {
    piece: &'a Piece,
    frame: Frame,
    balls: Vec<Ball>,
    /// The first of its balls among all of the part.
    first: usize,
}

/// Buffers of a check.
#[derive(Debug, Default)]
struct Scratch {
    poses: Vec<Pose8>,
    /// Centres of each part's bound, and of its balls where they were asked for.
    bounds: Vec<V8>,
    balls: Vec<Vec<V8>>,
}

impl<'a> Batch<'a> {
    /// For the joints `joints`; the others are as in `q`. Pairs that never move against each other are left out: whoever
    /// starts a search has checked one configuration.
    pub fn new(
        checker: &'a CollisionChecker,
        query: &CollisionQuery<'a>,
        joints: &[usize],
        q: &[f64],
    ) -> Self {
        let robot = &checker.robot;
        let kinematics = robot.model.group_kinematics(joints, q);
        let skip = query.held.map(|h| CollisionBody::Object(h.object));
        let part = |name: CollisionBody, link: usize, solids: &'a LinkSolids| {
            let (body, body_from_part) = kinematics.body_of(link);
            let (body, pose) = (*body, pose32(body_from_part));
            let moved = |b: &Ball| Ball { center: pose * b.center, radius: b.radius };
            let obstacles = checker.obstacles.iter().enumerate().filter(|(_, o)| {
                body != 0 && solids.moves && Some(o.body) != skip && !query.allows(name, o.body)
            });
            let mut first = 0;
            let pieces = solids.pieces.iter().map(|piece| {
                let before = first;
                first += piece.balls.len();
                let balls = piece.balls.iter().map(moved).collect();
                MovingPiece { piece, frame: Frame::of(&(pose * piece.pose)), balls, first: before }
            });
            MovingPart {
                body,
                body_from_part: pose,
                bound: moved(&solids.bound),
                pieces: pieces.collect(),
                obstacles: obstacles.map(|(i, _)| i).collect(),
                cloud: body != 0 && solids.moves && !query.allows(name, CollisionBody::Unmodelled),
            }
        };
        let mut parts = Vec::new();
        let mut of_link = vec![None; robot.links.len()];
        for (i, solids) in robot.links.iter().enumerate().filter(|(_, l)| !l.pieces.is_empty()) {
            of_link[i] = Some(parts.len());
            parts.push(part(CollisionBody::Link(i), i, solids));
        }
        let mut pairs: Vec<(usize, usize)> = robot
            .pairs
            .iter()
            .filter(|&&(a, b)| !query.allows(CollisionBody::Link(a), CollisionBody::Link(b)))
            .filter_map(|&(a, b)| Some((of_link[a]?, of_link[b]?)))
            .collect();
        if let Some(held) = query.held {
            let at = parts.len();
            parts.push(part(CollisionBody::Held, robot.gripper, &held.solids));
            let others = (0..robot.links.len()).filter(|i| {
                !robot.hand.contains(i) && !query.allows(CollisionBody::Held, CollisionBody::Link(*i))
            });
            pairs.extend(others.filter_map(|i| Some((at, of_link[i]?))));
        }
        pairs.retain(|&(a, b)| parts[a].body != parts[b].body);
        // The balls of the smaller one are held against the solids of the other.
        for pair in &mut pairs {
            if parts[pair.0].bound.radius > parts[pair.1].bound.radius {
                *pair = (pair.1, pair.0);
            }
        }
        let balls = parts.iter().map(|_| Vec::new()).collect();
        Self {
            checker,
            margin: query.margins.world as f32,
            own: query.margins.own as f32,
            spread: query.margins.spread as f32,
            kinematics,
            parts,
            pairs,
            scratch: RefCell::new(Scratch { balls, ..Scratch::default() }),
        }
    }

    /// Whether any of eight configurations of the group is in collision; `q[j]` holds joint `j` of all of them.
    pub fn any_collides(&self, q: &[F8]) -> bool {
        any_collides(Isa::best(), self, q)
    }
}

/// Base from a part in one lane.
fn part_pose(part: &MovingPart<'_>, poses: &[Pose8], lane: usize) -> Pose {
    let body = &poses[part.body];
    let column = |v: &V8| Vector::from_array(v.lane(lane));
    let matrix = parry3d::glamx::Mat3::from_cols(column(&body.x), column(&body.y), column(&body.z));
    let rotation = Rotation::from_mat3(&matrix).normalize();
    Pose::from_parts(column(&body.translation), rotation) * part.body_from_part
}

/// Bit `i` says whether lane `i` is at most `bound`.
#[inline(always)]
fn lanes_within(x: F8, bound: f32) -> u32 {
    let mut mask = 0;
    for (lane, v) in x.0.iter().enumerate() {
        mask |= u32::from(*v <= bound) << lane;
    }
    mask
}

/// Squared distance of points of a piece's frame from it: of a cylinder exactly, of others from the box about them.
#[inline(always)]
fn solid_distance_squared(p: V8, piece: &Piece) -> F8 {
    match piece.solid {
        Solid::Cylinder { half_height, radius } => {
            let flat = ((p.x * p.x + p.y * p.y).sqrt() - F8::all(radius)).max(F8::ZERO);
            let high = (p.z.abs() - F8::all(half_height)).max(F8::ZERO);
            flat * flat + high * high
        }
        _ => box_distance_squared(p, piece.center, piece.half),
    }
}

/// Squared distance of points from a box about `center` with half extents `half`.
#[inline(always)]
fn box_distance_squared(p: V8, center: Vector, half: Vector) -> F8 {
    let d = p - V8::all(center.to_array());
    let x = (d.x.abs() - F8::all(half.x)).max(F8::ZERO);
    let y = (d.y.abs() - F8::all(half.y)).max(F8::ZERO);
    let z = (d.z.abs() - F8::all(half.z)).max(F8::ZERO);
    x * x + y * y + z * z
}

/// Whether two pieces meet exactly in one of the lanes in `mask`.
#[inline(never)]
fn confirm(mask: u32, meets: impl Fn(usize) -> bool) -> bool {
    (0..LANES).any(|lane| mask >> lane & 1 == 1 && meets(lane))
}

per_machine! {
    /// [`Batch::any_collides`].
    fn any_collides(batch: &Batch<'_>, q: &[F8]) -> bool => check
}

#[inline(always)]
fn check(batch: &Batch<'_>, q: &[F8]) -> bool {
    let scratch = &mut *batch.scratch.borrow_mut();
    let Scratch { poses, bounds, balls } = scratch;
    batch.kinematics.poses(q, poses);
    bounds.clear();
    for part in &batch.parts {
        bounds.push(poses[part.body].point(part.bound.center.to_array()));
    }
    balls.iter_mut().for_each(Vec::clear);
    // What is farthest out meets something first.
    for (i, part) in batch.parts.iter().enumerate().rev() {
        for &o in &part.obstacles {
            let obstacle = &batch.checker.obstacles[o];
            let margin = batch.margin + obstacle.spread * batch.spread;
            let reach = part.bound.radius + margin;
            let apart = box_distance_squared(bounds[i], obstacle.center, obstacle.half);
            if apart.least() > reach * reach {
                continue;
            }
            place(&mut balls[i], part, poses);
            if meets_obstacle(part, &balls[i], obstacle, margin, poses) {
                return true;
            }
        }
    }
    if let Some(cloud) = &batch.checker.cloud {
        for (i, part) in batch.parts.iter().enumerate().rev().filter(|(_, part)| part.cloud) {
            let reach = part.bound.radius + batch.margin;
            if !(0..LANES).any(|lane| cloud.may_meet_ball(at_lane(&bounds[i], lane), reach)) {
                continue;
            }
            place(&mut balls[i], part, poses);
            if meets_cloud(part, &balls[i], cloud, batch.margin, poses) {
                return true;
            }
        }
    }
    for &(a, b) in &batch.pairs {
        let reach = batch.parts[a].bound.radius + batch.parts[b].bound.radius + batch.own;
        let between = bounds[a] - bounds[b];
        if between.dot(between).least() > reach * reach {
            continue;
        }
        place(&mut balls[a], &batch.parts[a], poses);
        if parts_meet(batch.own, (&batch.parts[a], &batch.parts[b]), &balls[a], poses) {
            return true;
        }
    }
    false
}

/// The centres of a part's balls, if they are not there yet.
#[inline(always)]
fn place(centers: &mut Vec<V8>, part: &MovingPart<'_>, poses: &[Pose8]) {
    if centers.is_empty() {
        let pose = &poses[part.body];
        for piece in &part.pieces {
            centers.extend(piece.balls.iter().map(|ball| pose.point(ball.center.to_array())));
        }
    }
}

#[inline(always)]
fn meets_obstacle(
    part: &MovingPart<'_>,
    centers: &[V8],
    obstacle: &Obstacle,
    margin: f32,
    poses: &[Pose8],
) -> bool {
    for moving in &part.pieces {
        let mut lanes = 0;
        for (ball, center) in moving.balls.iter().zip(&centers[moving.first..]) {
            let reach = ball.radius + margin;
            let apart = box_distance_squared(*center, obstacle.center, obstacle.half);
            if apart.least() > reach * reach {
                continue;
            }
            for other in &obstacle.pieces {
                let apart = solid_distance_squared(other.frame.inverse_point(*center), other);
                lanes |= lanes_within(apart, reach * reach);
            }
        }
        let meets = |lane| {
            let pose = part_pose(part, poses, lane);
            obstacle
                .pieces
                .iter()
                .any(|other| pieces_meet(moving.piece, &pose, other, &Pose::IDENTITY, margin))
        };
        if lanes != 0 && confirm(lanes, meets) {
            return true;
        }
    }
    false
}

#[inline(always)]
fn at_lane(v: &V8, lane: usize) -> Vector {
    Vector::from_array(v.lane(lane))
}

fn meets_cloud(part: &MovingPart<'_>, centers: &[V8], cloud: &Cloud, margin: f32, poses: &[Pose8]) -> bool {
    part.pieces.iter().any(|moving| {
        let mut lanes = 0;
        for (ball, center) in moving.balls.iter().zip(&centers[moving.first..]) {
            for lane in 0..LANES {
                let touches = lanes >> lane & 1 == 1
                    || cloud.may_meet_ball(at_lane(center, lane), ball.radius + margin);
                lanes |= u32::from(touches) << lane;
            }
        }
        let meets = |lane| cloud.meets_piece(moving.piece, &part_pose(part, poses, lane), margin);
        lanes != 0 && confirm(lanes, meets)
    })
}

/// The balls of one part against the boxes of another that moves.
#[inline(always)]
fn parts_meet(own: f32, (a, b): (&MovingPart<'_>, &MovingPart<'_>), centers: &[V8], poses: &[Pose8]) -> bool {
    let body = &poses[b.body];
    for one in &a.pieces {
        for other in &b.pieces {
            let mut lanes = 0;
            for (ball, center) in one.balls.iter().zip(&centers[one.first..]) {
                let reach = ball.radius + own;
                let local = other.frame.inverse_point(body.inverse_point(*center));
                lanes |= lanes_within(solid_distance_squared(local, other.piece), reach * reach);
            }
            let meets = |lane| {
                let (pose_a, pose_b) = (part_pose(a, poses, lane), part_pose(b, poses, lane));
                pieces_meet(one.piece, &pose_a, other.piece, &pose_b, own)
            };
            if lanes != 0 && confirm(lanes, meets) {
                return true;
            }
        }
    }
    false
}
