//! The same robot as a chain of the `k` crate, an oracle of our kinematics.
//!
//! `k` has an older nalgebra of its own: this file is the only place where the two meet.

use k::nalgebra as na_k;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::super::kinematics::Motion;
use super::super::{JointKind, RobotModel};

/// A pose for `k`.
pub(super) fn to_k(pose: &Isometry3<f64>) -> k::Isometry3<f64> {
    let (t, q) = (pose.translation.vector, pose.rotation);
    k::Isometry3::from_parts(
        k::Translation3::new(t.x, t.y, t.z),
        k::UnitQuaternion::new_unchecked(na_k::Quaternion::new(q.w, q.i, q.j, q.k)),
    )
}

/// A pose from `k`.
pub(super) fn from_k(pose: &k::Isometry3<f64>) -> Isometry3<f64> {
    let (t, q) = (&pose.translation.vector, &pose.rotation);
    Isometry3::from_parts(
        Translation3::new(t.x, t.y, t.z),
        UnitQuaternion::new_unchecked(Quaternion::new(q.w, q.i, q.j, q.k)),
    )
}

/// The joints from the root down to `end_link` as a serial chain of `k`, all at zero. Its movable joints keep the
/// order of [`RobotModel::joints`] along the chain; limits are kept, continuous joints have none.
/// None of them may be a mimic joint, which a serial chain cannot express.
pub(super) fn serial_chain(robot: &RobotModel, end_link: usize) -> k::SerialChain<f64> {
    let root = k::NodeBuilder::<f64>::new().name(&robot.links[0].name).into_node();
    // A node holds its parent weakly: all are kept until the chain owns them.
    let mut nodes = vec![root];
    for index in robot.chain(end_link) {
        let step = &robot.steps[index];
        let name = robot.links[index].parent_joint.as_ref().map_or("", |joint| joint.name.as_str());
        let axis = axis_to_k(&step.axis);
        let mut limits = None;
        if let Some(drive) = step.motion.drive() {
            let joint = &robot.joints[drive.joint];
            assert_eq!(joint.child, index, "mimic joint {name}");
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
    k::SerialChain::from_end(&nodes[nodes.len() - 1])
}

fn axis_to_k(axis: &Vector3<f64>) -> na_k::Unit<k::Vector3<f64>> {
    na_k::Unit::new_normalize(k::Vector3::new(axis.x, axis.y, axis.z))
}
