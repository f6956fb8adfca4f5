//! The same robot as a chain of the `k` crate, for users of its solvers and as an oracle of ours.
//!
//! `k` has an older nalgebra of its own: this file is the only place where the two meet.

use k::nalgebra as na_k;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::kinematics::Motion;
use super::{JointKind, RobotModel};
use crate::error::Result;

/// A pose for `k`.
pub fn to_k(pose: &Isometry3<f64>) -> k::Isometry3<f64> {
    let (t, q) = (pose.translation.vector, pose.rotation);
    k::Isometry3::from_parts(
        k::Translation3::new(t.x, t.y, t.z),
        k::UnitQuaternion::new_unchecked(na_k::Quaternion::new(q.w, q.i, q.j, q.k)),
    )
}

/// A pose from `k`.
pub fn from_k(pose: &k::Isometry3<f64>) -> Isometry3<f64> {
    let (t, q) = (&pose.translation.vector, &pose.rotation);
    Isometry3::from_parts(
        Translation3::new(t.x, t.y, t.z),
        UnitQuaternion::new_unchecked(Quaternion::new(q.w, q.i, q.j, q.k)),
    )
}

impl RobotModel {
    /// The joints from the root down to `end_link` as a serial chain of `k`, all at zero. Its movable joints keep the
    /// order of [`RobotModel::joints`] along the chain; limits are kept, continuous joints have none.
    ///
    /// # Errors
    /// When a joint on the way is a mimic joint, which a serial chain cannot express.
    pub fn serial_chain(&self, end_link: usize) -> Result<k::SerialChain<f64>> {
        let root = k::NodeBuilder::<f64>::new().name(&self.links[0].name).into_node();
        // A node holds its parent weakly: all are kept until the chain owns them.
        let mut nodes = vec![root];
        for index in self.chain(end_link) {
            let step = &self.steps[index];
            let name = self.links[index].parent_joint.as_ref().map_or("", |joint| joint.name.as_str());
            let axis = axis_to_k(&step.axis);
            let mut limits = None;
            if let Some(drive) = step.motion.drive() {
                let joint = &self.joints[drive.joint];
                if joint.child != index {
                    return Err(self.error(format!(
                        "joint '{name}' follows '{}' (mimic), which a chain of the k crate cannot express; use the model's own kinematics",
                        joint.name
                    )));
                }
                if joint.kind != JointKind::Continuous {
                    limits = Some(k::joint::Range::new(joint.limits.lower, joint.limits.upper));
                }
            }
            let origin = to_k(&step.origin);
            let node = k::NodeBuilder::<f64>::new()
                .name(name)
                .joint_type(match step.motion {
                    Motion::Fixed => k::JointType::Fixed,
                    Motion::Turn(_) => k::JointType::Rotational { axis },
                    Motion::Slide(_) => k::JointType::Linear { axis },
                })
                .limits(limits)
                .translation(origin.translation)
                .rotation(origin.rotation)
                .into_node();
            node.set_parent(&nodes[nodes.len() - 1]);
            nodes.push(node);
        }
        Ok(k::SerialChain::from_end(&nodes[nodes.len() - 1]))
    }
}

fn axis_to_k(axis: &Vector3<f64>) -> na_k::Unit<k::Vector3<f64>> {
    na_k::Unit::new_normalize(k::Vector3::new(axis.x, axis.y, axis.z))
}
