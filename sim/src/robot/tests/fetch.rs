//! The Fetch as we describe it has the published figures.

use nalgebra::{Isometry3, Point3, Translation3};

use super::super::{JointKind, JointLimits, RobotConfig, RobotModel};
use super::k_chain::{from_k, serial_chain, to_k};
use super::{FETCH, folder, random_configuration};
use crate::camera::Intrinsics;
use crate::rng;

/// Joint, kind, origin, axis, lower, upper, velocity, effort.
type Row = (&'static str, JointKind, [f64; 3], [f64; 3], f64, f64, f64, f64);

/// NaN once became the lower limit: a target that is no number sent the arm there.
#[test]
fn a_position_that_is_no_number_is_not_clamped_to_a_limit() {
    let limits = JointLimits { lower: -1.0, upper: 2.0, velocity: 1.0, effort: 1.0 };
    assert!(limits.clamp(f64::NAN).is_nan());
    for (position, nearest) in [(0.5, 0.5), (-3.0, -1.0), (f64::INFINITY, 2.0), (f64::NEG_INFINITY, -1.0)] {
        assert_eq!(limits.clamp(position), nearest);
    }
}

#[test]
fn joints_have_the_published_origins_axes_and_limits() {
    use JointKind::{Continuous, Prismatic, Revolute};
    let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let inf = f64::INFINITY;
    #[rustfmt::skip]
    let table: [Row; 12] = [
        ("torso_lift_joint", Prismatic, [-0.086875, 0.0, 0.37743], z, 0.0, 0.38615, 0.1, 450.0),
        ("shoulder_pan_joint", Revolute, [0.119525, 0.0, 0.34858], z, -1.6056, 1.6056, 1.256, 33.82),
        ("shoulder_lift_joint", Revolute, [0.117, 0.0, 0.06], y, -1.221, 1.518, 1.454, 131.76),
        ("upperarm_roll_joint", Continuous, [0.219, 0.0, 0.0], x, -inf, inf, 1.571, 76.94),
        ("elbow_flex_joint", Revolute, [0.133, 0.0, 0.0], y, -2.251, 2.251, 1.521, 66.18),
        ("forearm_roll_joint", Continuous, [0.197, 0.0, 0.0], x, -inf, inf, 1.571, 29.35),
        ("wrist_flex_joint", Revolute, [0.1245, 0.0, 0.0], y, -2.16, 2.16, 2.268, 25.7),
        ("wrist_roll_joint", Continuous, [0.1385, 0.0, 0.0], x, -inf, inf, 2.268, 7.36),
        ("r_gripper_finger_joint", Prismatic, [0.0, 0.015425, 0.0], y, 0.0, 0.05, 0.05, 60.0),
        ("l_gripper_finger_joint", Prismatic, [0.0, -0.015425, 0.0], [0.0, -1.0, 0.0], 0.0, 0.05, 0.05, 60.0),
        ("head_pan_joint", Revolute, [0.053125, 0.0, 0.603001], z, -1.57, 1.57, 1.57, 0.32),
        ("head_tilt_joint", Revolute, [0.14253, 0.0, 0.057999], y, -0.76, 1.45, 1.57, 0.68),
    ];
    let (robot, _) = &*FETCH;
    assert_eq!(robot.joints().len(), table.len());
    for (joint, row) in robot.joints().iter().zip(table) {
        let l = joint.limits;
        let found = (
            joint.name.as_str(),
            joint.kind,
            joint.origin.translation.vector.into(),
            joint.axis.into_inner().into(),
            l.lower,
            l.upper,
            l.velocity,
            l.effort,
        );
        assert_eq!(found, row);
        assert!(joint.origin.rotation.angle() < 1e-12);
    }
}

#[test]
fn heights_and_lengths_are_those_of_the_robot() {
    let (robot, config) = &*FETCH;
    let mut q = robot.neutral();
    let height = |q: &[f64]| robot.fk_link(q, config.camera.as_ref().unwrap().optical_link).translation.z;
    assert!((height(&q) - 1.061).abs() < 5e-4);
    // Straight ahead at zero: all origins add up.
    let gripper = robot.fk_link(&q, config.gripper.link);
    let wrist = robot.fk_link(&q, robot.link_index("wrist_roll_link").unwrap());
    assert!((gripper.translation.vector - nalgebra::vector![1.1281, 0.0, 0.78601]).norm() < 1e-9);
    // DIFFERENCE: some tables give 0.216 m from the wrist's roll axis origin to the fingertips. The published frames
    // (gripper_link at 0.16645 m) and pads (0.060 m long, centred on it) give 0.196 m, and the palm's front at -0.032 m
    // makes the fingers 0.062 m long, as published.
    let tip = gripper * Point3::new(config.gripper.pad_half_extents.x, 0.0, 0.0);
    assert!((tip.x - wrist.translation.x - 0.19645).abs() < 1e-9);
    q[robot.joint_index("torso_lift_joint").unwrap()] = 0.38615;
    assert!((height(&q) - 1.447).abs() < 5e-4);
}

#[test]
fn the_camera_looks_ahead_with_x_right_and_y_down() {
    let (robot, config) = &*FETCH;
    let camera = robot.fk_link(&robot.neutral(), config.camera.as_ref().unwrap().optical_link);
    let turned = |v| camera.rotation * nalgebra::Vector3::from(v);
    assert!((turned([0.0, 0.0, 1.0]) - nalgebra::Vector3::x()).norm() < 1e-9);
    assert!((turned([1.0, 0.0, 0.0]) + nalgebra::Vector3::y()).norm() < 1e-9);
    assert!((turned([0.0, 1.0, 0.0]) + nalgebra::Vector3::z()).norm() < 1e-9);
    assert!((camera.translation.y - 0.02).abs() < 1e-12);
}

#[test]
fn pads_touch_when_closed_and_are_ten_centimetres_apart_when_open() {
    let (robot, config) = &*FETCH;
    let gripper = &config.gripper;
    assert!(gripper.gap(robot, [0.0, 0.0]).abs() < 1e-12);
    assert!((gripper.gap(robot, [0.05, 0.05]) - 0.10).abs() < 1e-12);
    // The collision box of a finger is its pad.
    for side in 0..2 {
        let finger = &robot.links()[gripper.finger_links[side]];
        let [shape] = &finger.collisions[..] else { panic!("one box") };
        let crate::shape::Convex::Cuboid { half } = &shape.geometry else { panic!("a box") };
        assert!((half - gripper.pad_half_extents).norm() < 1e-12);
        let center = shape.pose.translation.vector;
        assert!((center - gripper.pad_centers[side]).norm() < 1e-12);
    }
}

#[test]
fn everything_in_the_urdf_was_loaded() {
    let (robot, _) = &*FETCH;
    let text = std::fs::read_to_string(folder().join("fetch.urdf")).unwrap();
    let count = |tag: &str| text.matches(tag).count();
    let loaded = robot.loaded();
    assert_eq!(loaded.links, count("<link name="));
    assert_eq!(loaded.visuals, count("<visual>"));
    assert_eq!(loaded.collisions, count("<collision>"));
    assert_eq!(loaded.meshes, count("<mesh "));
    assert_eq!(loaded.joints, 12);
    let shapes: usize = robot.links().iter().map(|l| l.collisions.len()).sum();
    assert_eq!(shapes, loaded.collisions);
    // Bodies that move have an inertia that physics can use.
    for joint in robot.joints() {
        let link = &robot.links()[joint.child];
        let moments = link.inertia.symmetric_eigenvalues();
        assert!(link.mass > 0.0 && moments.iter().all(|&m| m > 0.0), "{}", link.name);
        // No body has a moment above the sum of the other two.
        assert!(2.0 * moments.max() <= moments.sum() * (1.0 + 1e-9), "{}", link.name);
    }
    fn send_and_sync<T: Send + Sync>(_: &T) {}
    send_and_sync(robot);
}

#[test]
fn kinematics_equal_those_of_the_k_crate() {
    let (robot, config) = &*FETCH;
    let mut rng = rng::stream(7, "robot test");
    for name in ["gripper_link", "l_gripper_finger_link", "head_camera_rgb_optical_frame"] {
        let link = robot.link_index(name).unwrap();
        let chain = serial_chain(robot, link);
        let joints: Vec<usize> =
            chain.iter_joints().map(|joint| robot.joint_index(&joint.name).unwrap()).collect();
        for _ in 0..200 {
            let q = random_configuration(robot, &mut rng);
            let positions: Vec<f64> = joints.iter().map(|&j| q[j]).collect();
            chain.set_joint_positions(&positions).unwrap();
            let expected = from_k(&chain.end_transform());
            let poses = robot.fk(&q);
            let found = robot.fk_link(&q, link);
            assert_eq!(found, poses[link]);
            assert!((found.translation.vector - expected.translation.vector).norm() < 1e-9);
            assert!(found.rotation.angle_to(&expected.rotation) < 1e-9);

            let expected = k::jacobian(&chain);
            let found = robot.jacobian(&q, link, &joints);
            for row in 0..6 {
                for column in 0..joints.len() {
                    assert!((found[(row, column)] - expected[(row, column)]).abs() < 1e-9);
                }
            }
        }
    }
    // A joint that does not move the link has no part in its Jacobian.
    let jacobian = robot.jacobian(&robot.neutral(), config.gripper.link, &[config.head.unwrap().pan]);
    assert_eq!(jacobian.norm(), 0.0);
}

#[test]
fn poses_survive_the_way_to_k_and_back() {
    let pose = Isometry3::from_parts(
        Translation3::new(0.1, -2.0, 3.0),
        nalgebra::UnitQuaternion::from_euler_angles(0.3, -0.8, 2.0),
    );
    assert_eq!(from_k(&to_k(&pose)), pose);
}

#[test]
fn named_poses_are_those_of_the_maker() {
    let (robot, config) = &*FETCH;
    let arm = |name: &str| -> Vec<f64> {
        let q = config.configuration(robot, name).unwrap();
        config.arm.iter().map(|&joint| q[joint]).collect()
    };
    assert_eq!(arm("tuck"), [1.32, 1.40, -0.2, 1.72, 0.0, 1.66, 0.0]);
    assert_eq!(arm("stow"), [1.32, 0.7, 0.0, -2.0, 0.0, -0.57, 0.0]);
    assert_eq!(arm("stow_via"), [0.7, -0.3, 0.0, -0.3, 0.0, -0.57, 0.0]);
    assert_eq!(config.arm_with_torso[1..], config.arm[..]);
    let error = config.configuration(robot, "sleep").unwrap_err().to_string();
    assert!(error.contains("'sleep'") && error.contains("ready, stow"), "{error}");
    // In `ready` the gripper is open and points down.
    let q = config.configuration(robot, "ready").unwrap();
    let gripper = robot.fk_link(&q, config.gripper.link);
    let fingers = gripper.rotation * nalgebra::Vector3::x();
    assert!((fingers + nalgebra::Vector3::z()).norm() < 1e-3);
    assert!(config.gripper.gap(robot, config.gripper.fingers.map(|f| q[f])) > 0.099);
}

#[test]
fn camera_presets_are_the_known_ones() {
    let (robot, config) = &*FETCH;
    let preset = |name| config.intrinsics(robot, name).unwrap();
    assert_eq!(preset(Some("fetch")), Intrinsics::FETCH);
    assert_eq!(preset(Some("grip-paper")), Intrinsics::GRIP_PAPER);
    assert_eq!(preset(None), Intrinsics::FETCH);
    assert!(config.intrinsics(robot, Some("zed")).is_err());
}

#[test]
fn the_head_turns_the_camera_to_a_point_as_far_as_it_can() {
    let (robot, config) = &*FETCH;
    let start = config.configuration(robot, "ready").unwrap();
    for point in [[0.45, 0.0, 0.75], [0.8, 0.4, 0.7], [0.6, -0.5, 1.2], [3.0, 1.0, 1.5]] {
        let point = Point3::from(point);
        let q = config.look_at(robot, &start, &point);
        let seen =
            robot.fk_link(&q, config.camera.as_ref().unwrap().optical_link).inverse_transform_point(&point);
        assert!(seen.x.hypot(seen.y) < 1e-6 * seen.z, "{seen}");
        for joint in 0..q.len() {
            let is_head = [config.head.unwrap().pan, config.head.unwrap().tilt].contains(&joint);
            assert!(is_head || q[joint] == start[joint]);
        }
    }
    let behind = config.look_at(robot, &start, &Point3::new(-2.0, 0.5, 1.0));
    assert_eq!(robot.problem_with(&behind, 0.0), None);
}

#[test]
fn configuration_errors_name_the_field_and_what_there_is() {
    let (robot, _) = &*FETCH;
    let good = std::fs::read_to_string(folder().join("fetch.toml")).unwrap();
    let cases = [
        (
            "    \"shoulder_pan_joint\",\n    \"shoulder_lift",
            "    \"sholder_pan_joint\",\n    \"shoulder_lift",
            "groups.arm: robot fetch: no movable joint 'sholder_pan_joint'",
        ),
        (
            "shoulder_lift_joint = 1.40",
            "shoulder_lift_joint = 1.60",
            "poses.tuck.shoulder_lift_joint = 1.6 is outside",
        ),
        ("shoulder_lift_joint = 1.40", "shoulder_lift_joint = nan", "poses.tuck.shoulder_lift_joint = NaN"),
        ("velocity = 1.256", "velocity = 3.0", "limits.shoulder_pan_joint.velocity = 3"),
        (
            "acceleration = 0.5 }\nshoulder",
            "acceleration = -0.5 }\nshoulder",
            "limits.torso_lift_joint.acceleration",
        ),
        (
            "head_camera_rgb_optical_frame",
            "head_camera",
            "camera.optical_link: robot fetch: no link 'head_camera'",
        ),
        (
            "default_intrinsics = \"fetch\"",
            "default_intrinsics = \"zed\"",
            "camera.default_intrinsics: no camera.intrinsics.zed",
        ),
        ("fx = 554.26", "fx = 0.0", "camera.intrinsics.fetch: fx 0"),
        ("opening = 0.10", "opening = 0.08", "gripper.opening = 0.08 m, but with both fingers"),
        ("max_force = 60.0", "max_force = 90.0", "gripper.max_force = 90"),
        ("max_force = 60.0", "max_force = 60.0\ncolour = 1", "unknown field `colour`"),
        ("[head]\n", "", "unknown field `pan`"),
    ];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.toml");
    for (from, to, expected) in cases {
        assert!(good.contains(from), "{from}");
        std::fs::write(&path, good.replacen(from, to, 1)).unwrap();
        let error = RobotConfig::load(&path, robot.clone()).unwrap_err().to_string();
        assert!(error.contains(expected) && error.contains("bad.toml"), "{error}");
    }
    assert!(RobotConfig::load(&folder.path().join("none.toml"), robot.clone()).is_err());
}

#[test]
fn configurations_out_of_limits_are_told() {
    let (robot, _) = &*FETCH;
    let mut q = robot.neutral();
    assert_eq!(robot.problem_with(&q, 0.0), None);
    q[2] = 1.6;
    let problem = robot.problem_with(&q, 0.0).unwrap();
    assert!(problem.contains("shoulder_lift_joint = 1.6"), "{problem}");
    q[2] = f64::NAN;
    assert!(robot.problem_with(&q, 0.0).is_some());
    assert!(robot.problem_with(&q[1..], 0.0).is_some());
    let _: &RobotModel = robot;
}
