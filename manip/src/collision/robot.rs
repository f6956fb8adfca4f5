//! The robot's solids, made once for a robot and shared by all planners.

use std::sync::Arc;

use grip_sim::robot::{JointKind, RobotConfig, RobotModel};
use nalgebra::Isometry3;
use parry3d::math::Vector;

use super::cover::Ball;
use super::piece::Piece;

/// Solids fixed to one link, in its frame.
#[derive(Debug, Clone)]
pub(crate) struct LinkSolids {
    pub pieces: Vec<Piece>,
    /// Bounding ball.
    pub center: Vector,
    pub radius: f32,
    /// About the pieces' closely covering balls.
    pub bound: Ball,
    /// Moves against the base.
    pub moves: bool,
}

/// Most that a ball of the robot's cover is to stick out of a solid, metres, and the most balls of a solid.
const COVER: (f32, usize) = (0.04, 4);

/// How the balls cover the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoverSummary {
    /// Balls of all links.
    pub balls: usize,
    /// Farthest that one sticks out of its solid, metres.
    pub worst: f64,
    /// Mean over the balls.
    pub mean: f64,
}

impl LinkSolids {
    pub fn new(pieces: Vec<Piece>, moves: bool) -> Self {
        let points = || pieces.iter().flat_map(|p| p.cover.iter().map(move |c| (*c, p.ball)));
        let n = points().count().max(1) as f32;
        let center = points().fold(Vector::ZERO, |sum, (c, _)| sum + c) / n;
        let radius = points().fold(0.0_f32, |r, (c, ball)| r.max((c - center).length() + ball));
        let balls: Vec<Ball> = pieces.iter().flat_map(|p| p.balls.iter().copied()).collect();
        Self { bound: Ball::about_balls(&balls), pieces, center, radius, moves }
    }
}

/// The solids of a robot and what of it may touch what.
#[derive(Debug)]
pub struct RobotSolids {
    /// The model.
    pub model: Arc<RobotModel>,
    pub(crate) links: Vec<LinkSolids>,
    /// Pairs of links with solids that must not meet.
    pub(crate) pairs: Vec<(usize, usize)>,
    /// The link that holds.
    pub gripper: usize,
    /// Movable joints of the two fingers.
    pub fingers: [usize; 2],
    /// Links of the hand: those rigidly joined to the gripper link, and the fingers.
    pub hand: Vec<usize>,
    /// The finger links.
    pub finger_links: [usize; 2],
    /// For each of `hand`, gripper from link with the fingers closed, and the link's motion a metre of finger joint.
    hand_closed: Vec<(Isometry3<f64>, nalgebra::Vector3<f64>)>,
}

impl RobotSolids {
    /// Collects the solids of `model`; links that `config` allows to touch, and adjacent ones, are not paired.
    pub fn new(model: Arc<RobotModel>, config: &RobotConfig) -> Self {
        let identity = Isometry3::identity();
        let mut moves = vec![false; model.links().len()];
        // The rigid body of a link, named by its topmost link.
        let mut body: Vec<usize> = (0..model.links().len()).collect();
        for (i, link) in model.links().iter().enumerate() {
            if let Some(joint) = &link.parent_joint {
                moves[i] = moves[joint.parent] || joint.moved_by.is_some();
                if joint.moved_by.is_none() {
                    body[i] = body[joint.parent];
                }
            }
        }
        let links: Vec<LinkSolids> = model
            .links()
            .iter()
            .zip(&moves)
            .map(|(link, &moves)| {
                let pieces =
                    link.collisions.iter().map(|s| Piece::new(s, &identity).with_balls(COVER.0, COVER.1));
                LinkSolids::new(pieces.collect(), moves)
            })
            .collect();
        let mut pairs = Vec::new();
        for a in 0..links.len() {
            for b in a + 1..links.len() {
                let solid = !links[a].pieces.is_empty() && !links[b].pieces.is_empty();
                if solid && (moves[a] || moves[b]) && !config.is_allowed(a, b) {
                    pairs.push((a, b));
                }
            }
        }
        let gripper = config.gripper.link;
        let finger_links = config.gripper.finger_links;
        let fingers = config.gripper.fingers;
        let hand: Vec<usize> =
            (0..links.len()).filter(|&i| body[i] == body[gripper] || finger_links.contains(&i)).collect();
        let mut q = model.neutral();
        let mut relative = |opening: f64| -> Vec<Isometry3<f64>> {
            for finger in fingers {
                q[finger] = opening;
            }
            let poses = model.fk(&q);
            hand.iter().map(|&link| poses[gripper].inverse() * poses[link]).collect()
        };
        let (closed, open) = (relative(0.0), relative(0.01));
        let hand_closed = closed
            .into_iter()
            .zip(open)
            .map(|(c, o)| (c, (o.translation.vector - c.translation.vector) / 0.01))
            .collect();
        Self { links, pairs, gripper, fingers, finger_links, hand, hand_closed, model }
    }

    /// How closely balls cover the robot: what they keep clear of, the robot keeps clear of.
    pub fn cover(&self) -> CoverSummary {
        let errors: Vec<f64> = self
            .links
            .iter()
            .flat_map(|link| &link.pieces)
            .flat_map(|piece| {
                piece.balls.iter().map(|ball| {
                    let center = piece.pose.inverse_transform_point(ball.center);
                    f64::from(Ball { center, ..*ball }.error(&piece.solid))
                })
            })
            .collect();
        CoverSummary {
            balls: errors.len(),
            worst: errors.iter().copied().fold(0.0, f64::max),
            mean: errors.iter().sum::<f64>() / errors.len().max(1) as f64,
        }
    }

    /// Gripper from each link of the hand with `opening` metres between the pads.
    pub(crate) fn hand_poses(&self, opening: f64) -> impl Iterator<Item = (usize, Isometry3<f64>)> + '_ {
        self.hand.iter().zip(&self.hand_closed).map(move |(&link, (closed, slope))| {
            let mut pose = *closed;
            pose.translation.vector += slope * (0.5 * opening);
            (link, pose)
        })
    }

    /// For each joint of a group, metres that the farthest point of the robot moves per unit of the joint, at most.
    /// `held` is the extent of a held object from the gripper link's origin, metres.
    pub fn reach(&self, joints: &[usize], held: f64) -> Vec<f64> {
        joints.iter().map(|&j| self.joint_reach(j, held)).collect()
    }

    fn joint_reach(&self, joint: usize, held: f64) -> f64 {
        let model = &self.model;
        let joint = &model.joints()[joint];
        if joint.kind == JointKind::Prismatic {
            return 1.0;
        }
        // Farthest that a link's origin can be from the joint's axis: the sum of the links' lengths below.
        let n = model.links().len();
        let mut far = vec![f64::NAN; n];
        far[joint.child] = 0.0;
        let mut reach: f64 = 0.0;
        // While everything below is rigid (fingers aside) the distance from the axis is exact.
        let mut frame: Vec<Option<Isometry3<f64>>> = vec![None; n];
        frame[joint.child] = Some(Isometry3::identity());
        let axis = joint.axis;
        let neutral = model.fk(&model.neutral());
        for (i, link) in model.links().iter().enumerate().skip(joint.child) {
            if i != joint.child {
                let Some(parent) = &link.parent_joint else {
                    continue;
                };
                if far[parent.parent].is_nan() {
                    continue;
                }
                let step = neutral[parent.parent].inverse() * neutral[i];
                let moved_by = parent.moved_by.map(|j| &model.joints()[j]);
                let slide = match moved_by {
                    Some(j) if j.kind == JointKind::Prismatic => j.limits.upper - j.limits.lower,
                    _ => 0.0,
                };
                far[i] = far[parent.parent] + step.translation.vector.norm() + slide;
                if moved_by.is_none_or(|j| j.kind == JointKind::Prismatic) {
                    frame[i] = frame[parent.parent].map(|f| f * step);
                }
            }
            let slide = if self.finger_links.contains(&i) { 0.05 } else { 0.0 };
            for piece in &self.links[i].pieces {
                for corner in piece.corners() {
                    let p =
                        nalgebra::Point3::new(f64::from(corner.x), f64::from(corner.y), f64::from(corner.z));
                    let bound = match &frame[i] {
                        Some(f) => (f * p).coords.cross(&axis).norm() + slide,
                        None => far[i] + p.coords.norm(),
                    };
                    reach = reach.max(bound);
                }
            }
            if i == self.gripper && held > 0.0 {
                let bound = match &frame[i] {
                    Some(f) => f.translation.vector.cross(&axis).norm() + held,
                    None => far[i] + held,
                };
                reach = reach.max(bound);
            }
        }
        reach.max(0.05)
    }
}
