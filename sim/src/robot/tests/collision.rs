//! The Fetch's collision geometry is sane: tight, and free of itself where the robot is.

use nalgebra::Point3;
use parry3d::math::Pose;
use parry3d::query::{Ray, intersection_test};
use parry3d::shape::SharedShape;

use super::super::{Link, RobotConfig, RobotModel};
use super::FETCH;
use crate::convert;

/// The shapes of every link.
struct Geometry(Vec<Vec<(Pose, SharedShape)>>);

impl Geometry {
    fn of(robot: &RobotModel) -> Self {
        let solids = |link: &Link| link.collisions.iter().map(|c| convert::solid(c).unwrap()).collect();
        Self(robot.links().iter().map(solids).collect())
    }

    /// The first two links that touch and may not.
    fn touching(&self, robot: &RobotModel, config: &RobotConfig, q: &[f64]) -> Option<String> {
        let poses: Vec<Pose> = robot.fk(q).iter().map(convert::pose).collect();
        for a in 0..poses.len() {
            for b in a + 1..poses.len() {
                if config.is_allowed(a, b) {
                    continue;
                }
                for (pose_a, shape_a) in &self.0[a] {
                    for (pose_b, shape_b) in &self.0[b] {
                        let (place_a, place_b) = (poses[a] * *pose_a, poses[b] * *pose_b);
                        let hit = intersection_test(&place_a, &**shape_a, &place_b, &**shape_b).unwrap();
                        if hit.intersecting {
                            let name = |link: usize| &robot.links()[link].name;
                            return Some(format!("{} and {}", name(a), name(b)));
                        }
                    }
                }
            }
        }
        None
    }
}

#[test]
fn named_poses_and_the_zero_pose_are_free_of_self_collision() {
    let (robot, config) = &*FETCH;
    let geometry = Geometry::of(robot);
    let mut poses: Vec<(String, Vec<f64>)> =
        config.poses.keys().map(|name| (name.clone(), config.configuration(robot, name).unwrap())).collect();
    poses.push(("zero".into(), robot.neutral()));
    // Tuck with the torso anywhere, as the maker's software allows.
    for lift in [0.0, 0.1, 0.38615] {
        let mut q = config.configuration(robot, "tuck").unwrap();
        q[config.arm_with_torso[0]] = lift;
        poses.push((format!("tuck at {lift}"), q));
    }
    // The wrist and elbow folded as far as they go, whatever the rolls.
    for roll in [0.0, 0.8, 1.6, 2.4, 3.1] {
        for fold in [-1.0, 1.0] {
            let mut q = robot.neutral();
            for (name, value) in [
                ("elbow_flex_joint", 2.251 * fold),
                ("forearm_roll_joint", roll),
                ("upperarm_roll_joint", 1.57),
            ] {
                q[robot.joint_index(name).unwrap()] = value;
            }
            poses.push((format!("elbow {fold} roll {roll}"), q.clone()));
            q[robot.joint_index("elbow_flex_joint").unwrap()] = 0.0;
            q[robot.joint_index("wrist_flex_joint").unwrap()] = 2.16 * fold;
            q[robot.joint_index("wrist_roll_joint").unwrap()] = roll;
            poses.push((format!("wrist {fold} roll {roll}"), q));
        }
    }
    for (name, q) in poses {
        assert_eq!(geometry.touching(robot, config, &q), None, "{name}");
    }
}

#[test]
fn an_arm_bent_into_the_robot_is_noticed() {
    let (robot, config) = &*FETCH;
    let geometry = Geometry::of(robot);
    let mut q = robot.neutral();
    // Upper arm down, elbow bent back: the forearm goes through the base.
    q[robot.joint_index("shoulder_lift_joint").unwrap()] = 1.5;
    q[robot.joint_index("elbow_flex_joint").unwrap()] = 1.2;
    assert!(geometry.touching(robot, config, &q).is_some());
}

#[test]
fn the_table_is_in_full_view_in_the_ready_pose() {
    let (robot, config) = &*FETCH;
    let geometry = Geometry::of(robot);
    let q = config.configuration(robot, "ready").unwrap();
    let poses = robot.fk(&q);
    let camera = poses[config.camera.as_ref().unwrap().optical_link];
    let intrinsics = config.camera.as_ref().unwrap().intrinsics["fetch"];
    let eye = Point3::from(camera.translation.vector);
    for i in 0..=20 {
        for j in 0..=20 {
            let point = Point3::new(0.5 + 0.025 * f64::from(i), -0.35 + 0.035 * f64::from(j), 0.65);
            let pixel = intrinsics.project(&camera.inverse_transform_point(&point)).unwrap();
            let inside = (0.0..640.0).contains(&pixel.x) && (0.0..480.0).contains(&pixel.y);
            assert!(inside, "{point} is seen at {pixel}");
            let ray = Ray::new(convert::point(&eye), convert::vector(&(point - eye)));
            for (link, shapes) in geometry.0.iter().enumerate() {
                for (pose, shape) in shapes {
                    let pose = convert::pose(&poses[link]) * *pose;
                    assert!(
                        !shape.intersects_ray(&pose, &ray, 1.0),
                        "{} hides {point}",
                        robot.links()[link].name
                    );
                }
            }
        }
    }
}

#[test]
fn collision_shapes_stay_within_two_centimetres_of_the_looks() {
    let (robot, _) = &*FETCH;
    for link in robot.links().iter().filter(|link| !link.collisions.is_empty()) {
        // Compare extents along many directions.
        for i in 0..64 {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 64.0;
            let angle = 2.4 * f64::from(i);
            let r = (1.0 - z * z).sqrt();
            let direction = nalgebra::vector![r * angle.cos(), r * angle.sin(), z];
            let looks = link
                .visuals
                .iter()
                .flat_map(|visual| {
                    visual
                        .visual
                        .mesh
                        .positions
                        .iter()
                        .map(|p| direction.dot(&(visual.pose * p.cast::<f64>()).coords))
                })
                .fold(f64::NEG_INFINITY, f64::max);
            let solid = link
                .collisions
                .iter()
                .map(|collision| {
                    let (pose, shape) = convert::solid(collision).unwrap();
                    let local = pose.rotation.inverse() * convert::vector(&direction);
                    let point = pose * shape.as_support_map().unwrap().local_support_point(local);
                    direction.dot(&convert::from_vector(point))
                })
                .fold(f64::NEG_INFINITY, f64::max);
            assert!(
                (looks - solid).abs() < 0.02,
                "{}: looks reach {looks:.3}, collision {solid:.3} along {direction:?}",
                link.name
            );
        }
    }
}

/// Starts and goals of MotionBenchMaker's problems are free of self-collision for the robot's real shape, so they must be
/// for ours. Data outside the repository: skipped where it is absent.
#[test]
fn motion_bench_maker_configurations_are_free_of_self_collision() {
    // At run time, so that a checkout elsewhere finds its own neighbour.
    let here = std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_else(|| env!("CARGO_MANIFEST_DIR").into());
    let data = std::path::Path::new(&here).join("../../shared/data/motion-problems");
    let Ok(scenes) = std::fs::read_dir(&data) else {
        println!("skipped: {} is absent", data.display());
        return;
    };
    let (robot, config) = &*FETCH;
    let geometry = Geometry::of(robot);
    let (mut seen, mut touching) = (0, Vec::new());
    for scene in scenes {
        for file in std::fs::read_dir(scene.unwrap().path()).unwrap() {
            let file = file.unwrap().path();
            if !file.file_name().unwrap().to_string_lossy().starts_with("request") {
                continue;
            }
            let text = std::fs::read_to_string(&file).unwrap();
            for q in configurations(robot, &text) {
                seen += 1;
                if let Some(pair) = geometry.touching(robot, config, &q) {
                    touching.push(format!("{}: {pair}", file.display()));
                }
            }
        }
    }
    assert_eq!(seen, 700);
    for line in &touching {
        println!("{line}");
    }
    assert!(touching.is_empty(), "{} of {seen}", touching.len());
}

/// Start and goal of a problem file: as much YAML as these files use.
fn configurations(robot: &RobotModel, text: &str) -> [Vec<f64>; 2] {
    let list = |key: &str| -> Vec<String> {
        let (_, rest) = text
            .split_once(&format!("{key}: [l_wheel"))
            .map_or_else(|| text.split_once(&format!("{key}: [")).unwrap(), |(before, rest)| (before, rest));
        let start = if text.contains(&format!("{key}: [l_wheel")) { "l_wheel" } else { "" };
        let (inside, _) = rest.split_once(']').unwrap();
        format!("{start}{inside}").split(',').map(|item| item.trim().to_string()).collect()
    };
    let mut start = robot.neutral();
    for (name, value) in list("name").iter().zip(list("position")) {
        if let Ok(joint) = robot.joint_index(name) {
            start[joint] = value.parse().unwrap();
        }
    }
    let mut goal = start.clone();
    let (mut name, mut position) = (None, None);
    for line in text.lines() {
        let line = line
            .trim()
            .trim_start_matches("- ")
            .trim_start_matches("joint_constraints:")
            .trim()
            .trim_start_matches("- ");
        if let Some(value) = line.strip_prefix("position: ") {
            if let Ok(value) = value.parse::<f64>() {
                position = Some(value);
            }
        } else if let Some(value) = line.strip_prefix("joint_name: ") {
            name = Some(value.to_string());
        }
        if let (Some(joint), Some(value)) = (&name, position) {
            goal[robot.joint_index(joint).unwrap()] = value;
            (name, position) = (None, None);
        }
    }
    [start, goal]
}
