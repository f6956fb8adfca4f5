//! A grasp over the posterior: how likely it holds the object wherever that may be.
//!
//! The hand goes to one place; the object may be at others than the best pose says. Over weighted poses of the object each
//! grasp is tried again: open fingers must pass on both sides, both pads must meet the object, and with normals within the
//! friction cone. The most robust grasp is seldom the one with the best margin at a single pose (Weisz and Allen 2012).

use grip_sim::pose::{Gripper, Object, Pose, World};
use nalgebra::Vector3;

use super::contact::{RayGrid, pad_contact};
use crate::surface::Surface;

/// Open fingers pass when this much air is left on each side, metres.
const AIR: f64 = 0.001;

/// The share of the poses' weights with which the gripper at `world_from_gripper`, `opening` metres open, grasps the object;
/// `cone` is the largest angle of a contact normal, radians. 1 without poses.
pub fn expected_success(
    surface: &Surface,
    pad_half: &Vector3<f64>,
    world_from_gripper: &Pose<World, Gripper>,
    opening: f64,
    cone: f64,
    poses: &[(Pose<World, Object>, f64)],
) -> f64 {
    let all: f64 = poses.iter().map(|(_, weight)| weight).sum();
    if all <= 0.0 {
        return 1.0;
    }
    // A coarse grid may meet a rounded corner on one side of its crown only, a fine one the edge of a box that closing pads
    // would turn flush: what one of them holds is held.
    let holds = |pose: &Pose<World, Object>| {
        let object_from_gripper = pose.inverse() * *world_from_gripper;
        [RayGrid::Coarse, RayGrid::Fine].into_iter().any(|grid| {
            pad_contact(surface, pad_half, object_from_gripper.iso(), opening, grid).is_some_and(|contact| {
                let outer = 0.5 * contact.width + contact.center.abs();
                contact.cone_angle <= cone && outer <= 0.5 * opening - AIR
            })
        })
    };
    poses.iter().filter(|(pose, _)| holds(pose)).map(|(_, weight)| weight).sum::<f64>() / all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{box_model, fetch};

    /// A brick 60 mm wide, grasped from above in its middle.
    fn chance(opening: f64, poses: &[(Pose<World, Object>, f64)]) -> f64 {
        let brick = box_model("brick", [0.2, 0.06, 0.06]);
        let surface = Surface::new(&brick.visual.mesh).unwrap();
        let (_, config) = fetch();
        let down = Pose::from_xyz_rpy([0.0, 0.0, 0.02], [0.0, std::f64::consts::FRAC_PI_2, 0.0]);
        expected_success(&surface, &config.gripper.pad_half_extents, &down, opening, 0.4, poses)
    }

    #[test]
    fn poses_beyond_the_fingers_count_against_a_grasp() {
        let at = |y: f64, weight: f64| (Pose::from_xyz_rpy([0.0, y, 0.0], [0.0; 3]), weight);
        assert_eq!(chance(0.1, &[]), 1.0);
        assert_eq!(chance(0.1, &[at(0.0, 0.3)]), 1.0);
        // 20 mm of air on each side when wide open, 10 mm when not.
        let spread = [at(0.0, 0.4), at(0.015, 0.3), at(-0.025, 0.3)];
        assert!((chance(0.1, &spread) - 0.7).abs() < 1e-9);
        assert!((chance(0.08, &spread) - 0.4).abs() < 1e-9);
        // Turned by 40 degrees about the vertical its sides face no pad.
        let turned = Pose::from_xyz_rpy([0.0; 3], [0.0, 0.0, 0.7]);
        assert!((chance(0.1, &[at(0.0, 1.0), (turned, 1.0)]) - 0.5).abs() < 1e-9);
    }
}
