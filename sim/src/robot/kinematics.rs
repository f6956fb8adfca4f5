//! Forward kinematics and Jacobian.
//!
//! One flat array of steps, parents first: no recursion, no locks, no hidden state.

use nalgebra::{Isometry3, Matrix6xX, Translation3, UnitQuaternion, Vector3};

use super::RobotModel;

/// How one link follows from its parent.
#[derive(Debug, Clone)]
pub(super) struct Step {
    /// Parent link; the root's is itself and is never read.
    pub parent: usize,
    /// Parent link from joint frame.
    pub origin: Isometry3<f64>,
    /// Unit axis in the joint frame.
    pub axis: Vector3<f64>,
    pub motion: Motion,
}

/// What moves a link against its parent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Motion {
    Fixed,
    Turn(Drive),
    Slide(Drive),
}

/// Position of a joint as a function of the configuration: `multiplier * q[joint] + offset`.
/// All but URDF `mimic` joints have multiplier 1 and offset 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Drive {
    pub joint: usize,
    pub multiplier: f64,
    pub offset: f64,
}

impl Drive {
    fn position(&self, q: &[f64]) -> f64 {
        self.multiplier * q[self.joint] + self.offset
    }
}

impl Motion {
    pub fn drive(&self) -> Option<Drive> {
        match *self {
            Motion::Fixed => None,
            Motion::Turn(drive) | Motion::Slide(drive) => Some(drive),
        }
    }
}

impl Step {
    /// Pose of the link, given that of its parent.
    pub fn follow(&self, parent: &Isometry3<f64>, q: &[f64]) -> Isometry3<f64> {
        let joint_frame = parent * self.origin;
        match self.motion {
            Motion::Fixed => joint_frame,
            Motion::Turn(drive) => Isometry3::from_parts(
                joint_frame.translation,
                joint_frame.rotation * turn(&self.axis, drive.position(q)),
            ),
            Motion::Slide(drive) => {
                let slide = joint_frame.rotation * (self.axis * drive.position(q));
                Isometry3::from_parts(
                    Translation3::from(joint_frame.translation.vector + slide),
                    joint_frame.rotation,
                )
            }
        }
    }

    /// Velocity (linear, angular) of a point at `point` fixed to the link, per unit of its driving joint, when the link
    /// itself is at `pose`. All in the base frame.
    pub fn velocity(&self, pose: &Isometry3<f64>, point: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        // The axis is the same in the joint frame and in the link frame, since the motion keeps it.
        let axis = pose.rotation * self.axis;
        match self.motion {
            Motion::Fixed => (Vector3::zeros(), Vector3::zeros()),
            Motion::Turn(drive) => {
                (axis.cross(&(point - pose.translation.vector)) * drive.multiplier, axis * drive.multiplier)
            }
            Motion::Slide(drive) => (axis * drive.multiplier, Vector3::zeros()),
        }
    }
}

/// Rotation by `angle` about a unit axis.
fn turn(axis: &Vector3<f64>, angle: f64) -> UnitQuaternion<f64> {
    let (sin, cos) = (0.5 * angle).sin_cos();
    UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(cos, axis.x * sin, axis.y * sin, axis.z * sin))
}

impl RobotModel {
    /// Poses of all links in the root link's frame (`base_from_link`), in the order of [`RobotModel::links`].
    ///
    /// # Panics
    /// When `q` does not have one value a movable joint.
    pub fn fk(&self, q: &[f64]) -> Vec<Isometry3<f64>> {
        let mut poses = Vec::new();
        self.fk_into(q, &mut poses);
        poses
    }

    /// [`RobotModel::fk`] into a buffer, which is overwritten; no allocation when it was used before.
    ///
    /// # Panics
    /// When `q` does not have one value a movable joint.
    pub fn fk_into(&self, q: &[f64], poses: &mut Vec<Isometry3<f64>>) {
        self.check_length(q);
        poses.clear();
        poses.reserve(self.steps.len());
        poses.push(Isometry3::identity());
        for step in &self.steps[1..] {
            let pose = step.follow(&poses[step.parent], q);
            poses.push(pose);
        }
    }

    /// Pose of one link in the root link's frame.
    ///
    /// # Panics
    /// When `q` does not have one value a movable joint, or `link` is not a link.
    pub fn fk_link(&self, q: &[f64], link: usize) -> Isometry3<f64> {
        self.check_length(q);
        self.chain(link)
            .into_iter()
            .fold(Isometry3::identity(), |pose, link| self.steps[link].follow(&pose, q))
    }

    /// Links from the root's child down to `link`; the root itself is left out.
    pub(super) fn chain(&self, link: usize) -> Vec<usize> {
        let mut chain = Vec::new();
        let mut above = link;
        while above != 0 {
            chain.push(above);
            above = self.steps[above].parent;
        }
        chain.reverse();
        chain
    }

    /// Geometric Jacobian of a link's origin: rows are linear then angular velocity in the base frame, one column for
    /// each of `joints` (indices into `q`). A joint that does not move the link has a zero column.
    ///
    /// # Panics
    /// When `q` does not have one value a movable joint, or `link` is not a link.
    pub fn jacobian(&self, q: &[f64], link: usize, joints: &[usize]) -> Matrix6xX<f64> {
        self.check_length(q);
        let chain = self.chain(link);
        let mut poses = Vec::with_capacity(chain.len());
        let mut pose = Isometry3::identity();
        for &index in &chain {
            pose = self.steps[index].follow(&pose, q);
            poses.push(pose);
        }
        let point = pose.translation.vector;
        let mut jacobian = Matrix6xX::zeros(joints.len());
        for (&index, pose) in chain.iter().zip(&poses) {
            let step = &self.steps[index];
            let Some(drive) = step.motion.drive() else {
                continue;
            };
            let (linear, angular) = step.velocity(pose, &point);
            // A sum, because several mimic joints may follow one joint.
            for (column, &joint) in joints.iter().enumerate() {
                if joint == drive.joint {
                    let mut column = jacobian.column_mut(column);
                    for row in 0..3 {
                        column[row] += linear[row];
                        column[row + 3] += angular[row];
                    }
                }
            }
        }
        jacobian
    }

    pub(super) fn check_length(&self, q: &[f64]) {
        assert_eq!(
            q.len(),
            self.joints.len(),
            "{}: a configuration has one value a movable joint",
            self.name
        );
    }
}
