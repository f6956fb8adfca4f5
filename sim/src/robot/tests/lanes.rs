//! Eight configurations at once are what one at a time is.

use super::{FETCH, random_configuration};
use crate::lanes::{F8, LANES};
use crate::rng;

#[test]
fn eight_at_once_agree_with_one_at_a_time() {
    let (robot, config) = &*FETCH;
    let mut random = rng::stream(5, "lanes");
    for joints in [&config.arm_with_torso, &config.gripper.fingers.to_vec()] {
        let still = random_configuration(robot, &mut random);
        let kinematics = robot.group_kinematics(joints, &still);
        let configurations: Vec<Vec<f64>> = (0..LANES)
            .map(|_| {
                let mut q = still.clone();
                let other = random_configuration(robot, &mut random);
                joints.iter().for_each(|&j| q[j] = other[j]);
                q
            })
            .collect();
        let lanes: Vec<F8> =
            joints.iter().map(|&j| F8(std::array::from_fn(|lane| configurations[lane][j] as f32))).collect();
        let mut bodies = Vec::new();
        kinematics.poses(&lanes, &mut bodies);
        assert_eq!(bodies.len(), kinematics.len());
        for (lane, q) in configurations.iter().enumerate() {
            for (link, expected) in robot.fk(q).iter().enumerate() {
                let (body, body_from_link) = kinematics.body_of(link);
                let point = nalgebra::Point3::new(0.1, -0.2, 0.3);
                let in_body = body_from_link * point;
                let found = bodies[*body].point([0, 1, 2].map(|r| in_body[r] as f32));
                let found = nalgebra::Point3::from(found.lane(lane)).cast::<f64>();
                let error = (found - expected * point).norm();
                assert!(error < 5e-6, "{}: {error}", robot.links()[link].name);
            }
        }
    }
}
