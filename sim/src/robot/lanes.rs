//! Forward kinematics of eight configurations at once, in single precision: for collision checks along motions.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::RobotModel;
use super::kinematics::{Drive, Motion};
use crate::lanes::{F8, V8};

/// Eight rigid transforms, lane by lane.
#[derive(Debug, Clone, Copy)]
pub struct Pose8 {
    /// The columns of the rotation matrices.
    pub x: V8,
    /// Second column.
    pub y: V8,
    /// Third column.
    pub z: V8,
    /// Translations, metres.
    pub translation: V8,
}

impl Pose8 {
    /// The same transform in all lanes.
    pub fn all(iso: &Isometry3<f64>) -> Self {
        let m = iso.rotation.to_rotation_matrix();
        let column = |c: usize| V8::all([0, 1, 2].map(|r| m[(r, c)] as f32));
        let t = iso.translation.vector;
        let translation = V8::all([t.x as f32, t.y as f32, t.z as f32]);
        Self { x: column(0), y: column(1), z: column(2), translation }
    }

    /// A point of the transformed frame in the outer one.
    #[inline(always)]
    pub fn point(&self, p: [f32; 3]) -> V8 {
        self.turn(V8::all(p)) + self.translation
    }

    /// Points of the outer frame in the transformed one.
    #[inline(always)]
    pub fn inverse_point(&self, p: V8) -> V8 {
        let d = p - self.translation;
        V8 { x: d.dot(self.x), y: d.dot(self.y), z: d.dot(self.z) }
    }

    #[inline(always)]
    fn turn(&self, v: V8) -> V8 {
        self.x.times(v.x) + self.y.times(v.y) + self.z.times(v.z)
    }

    #[inline(always)]
    fn times(&self, other: &Self) -> Self {
        Self {
            x: self.turn(other.x),
            y: self.turn(other.y),
            z: self.turn(other.z),
            translation: self.turn(other.translation) + self.translation,
        }
    }
}

/// A link, or several that are rigidly joined, that some joint of the group moves.
#[derive(Debug, Clone)]
struct Body {
    parent: usize,
    /// Parent body from this one with the joint at zero; the joint's axis is this frame's z axis.
    parent_from_body: Pose8,
    /// Index into the group, its multiplier and offset.
    joint: usize,
    multiplier: f32,
    offset: f32,
    slides: bool,
}

/// The kinematics of a group of joints while all others stand still.
///
/// Links that do not move against each other make one body. Body 0 is the base and does not move.
#[derive(Debug, Clone)]
pub struct GroupKinematics {
    bodies: Vec<Body>,
    links: Vec<(usize, Isometry3<f64>)>,
}

impl RobotModel {
    /// Prepares [`GroupKinematics`] for `joints` (indices into `q`); the others stay as they are in `q`.
    ///
    /// # Panics
    /// When `q` does not have one value a movable joint.
    pub fn group_kinematics(&self, joints: &[usize], q: &[f64]) -> GroupKinematics {
        self.check_length(q);
        let mut bodies = Vec::new();
        let mut links = vec![(0, Isometry3::identity())];
        for step in &self.steps[1..] {
            let (parent, parent_from_link): (usize, Isometry3<f64>) = links[step.parent];
            let driven = match step.motion {
                Motion::Turn(drive) => Some((drive, false)),
                Motion::Slide(drive) => Some((drive, true)),
                Motion::Fixed => None,
            };
            let driven = driven.and_then(|(drive, slides): (Drive, bool)| {
                joints.iter().position(|&j| j == drive.joint).map(|k| (k, drive, slides))
            });
            let Some((joint, drive, slides)) = driven else {
                links.push((parent, step.follow(&parent_from_link, q)));
                continue;
            };
            let to_axis = UnitQuaternion::rotation_between(&Vector3::z(), &step.axis)
                .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
            bodies.push(Body {
                parent,
                parent_from_body: Pose8::all(&(parent_from_link * step.origin * to_axis)),
                joint,
                multiplier: drive.multiplier as f32,
                offset: drive.offset as f32,
                slides,
            });
            links.push((bodies.len(), Isometry3::from_parts(Default::default(), to_axis.inverse())));
        }
        GroupKinematics { bodies, links }
    }
}

impl GroupKinematics {
    /// Number of bodies, the base included.
    pub fn len(&self) -> usize {
        self.bodies.len() + 1
    }

    /// Whether no joint moves anything.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// The body that a link belongs to, and the link's pose in it.
    pub fn body_of(&self, link: usize) -> &(usize, Isometry3<f64>) {
        &self.links[link]
    }

    /// Base from each body, for eight configurations of the group: `q[j]` holds joint `j` of all of them.
    #[inline(always)]
    pub fn poses(&self, q: &[F8], out: &mut Vec<Pose8>) {
        out.clear();
        out.push(Pose8::all(&Isometry3::identity()));
        for body in &self.bodies {
            let mut pose = out[body.parent].times(&body.parent_from_body);
            let at = q[body.joint] * F8::all(body.multiplier) + F8::all(body.offset);
            if body.slides {
                pose.translation = pose.translation + pose.z.times(at);
            } else {
                let (sin, cos) = at.sin_cos();
                let Pose8 { x, y, .. } = pose;
                pose.x = x.times(cos) + y.times(sin);
                pose.y = y.times(cos) - x.times(sin);
            }
            out.push(pose);
        }
    }
}
