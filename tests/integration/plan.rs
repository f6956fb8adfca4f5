//! `grip plan` on problems of our own and, where they are, on those of MotionBenchMaker.

use std::fs;
use std::path::Path;

use grip_sim::robot::{RobotConfig, RobotModel};
use serde::Deserialize;

use crate::common::{code, grip, root, stderr, stdout};

pub const REQUEST: &str = "
group_name: arm_with_torso
start_state:
  joint_state:
    name: [torso_lift_joint, shoulder_pan_joint, shoulder_lift_joint, elbow_flex_joint, wrist_flex_joint, upperarm_roll_joint,
      forearm_roll_joint, wrist_roll_joint]
    position: [0.2, 0.8, 0.0, 0.5, 0.5, 0.0, 0.0, 0.0]
goal_constraints:
  - joint_constraints:
      - {joint_name: torso_lift_joint, position: 0.2}
      - {joint_name: shoulder_pan_joint, position: -0.8}
      - {joint_name: shoulder_lift_joint, position: 0.0}
      - {joint_name: upperarm_roll_joint, position: 0.0}
      - {joint_name: elbow_flex_joint, position: 0.5}
      - {joint_name: forearm_roll_joint, position: 0.0}
      - {joint_name: wrist_flex_joint, position: 0.5}
      - {joint_name: wrist_roll_joint, position: 0.0}
";

/// A column of this height where the arm swings through.
pub fn problem(folder: &Path, number: &str, at: [f64; 2], request: &str) {
    let scene = format!(
        "world: {{collision_objects: [{{id: column, header: {{frame_id: base_link}}, \
         primitives: [{{type: cylinder, dimensions: [1.6, 0.05]}}], \
         primitive_poses: [{{position: [{}, {}, 0.8], orientation: [0, 0, 0, 1]}}]}}]}}\n",
        at[0], at[1]
    );
    fs::write(folder.join(format!("scene{number}.yaml")), scene).unwrap();
    fs::write(folder.join(format!("request{number}.yaml")), request).unwrap();
}

#[test]
fn a_column_is_gone_round_and_the_same_seed_gives_the_same_path() {
    let folder = tempfile::tempdir().unwrap();
    problem(folder.path(), "0001", [0.75, 0.0], REQUEST);
    problem(folder.path(), "0002", [0.9, 0.1], REQUEST);
    let solve = || {
        let output = grip(&["plan", folder.path().to_str().unwrap(), "--json"]);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let json: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
        assert_eq!(json["schema"], "grip.plan/1");
        assert!(json["cover"]["balls"].as_u64().unwrap() > 50);
        let problems = json["problems"].as_array().unwrap().clone();
        let figures = |p: &serde_json::Value| {
            assert_eq!(p["status"], "solved", "{p}");
            assert!(p["clearance_m"].as_f64().unwrap() > 0.0);
            // Straight through the column would be 1.6 radians.
            assert!(p["path_length"][1].as_f64().unwrap() > 1.7, "{p}");
            assert!(p["rechecked"].as_f64().unwrap() >= 1e3 * p["duration_s"].as_f64().unwrap());
            (p["path_length"].clone(), p["duration_s"].clone(), p["iterations"].clone())
        };
        problems.iter().map(figures).collect::<Vec<_>>()
    };
    assert_eq!(solve(), solve());
}

/// As `trajectory_msgs/msg/JointTrajectory` has it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JointTrajectory {
    header: Header,
    joint_names: Vec<String>,
    points: Vec<TrajectoryPoint>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    stamp: RosDuration,
    frame_id: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TrajectoryPoint {
    positions: Vec<f64>,
    velocities: Vec<f64>,
    accelerations: Vec<f64>,
    effort: Vec<f64>,
    time_from_start: RosDuration,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RosDuration {
    sec: i32,
    nanosec: u32,
}

impl RosDuration {
    fn seconds(&self) -> f64 {
        assert!(self.sec >= 0 && self.nanosec < 1_000_000_000);
        f64::from(self.sec) + 1e-9 * f64::from(self.nanosec)
    }
}

#[test]
fn trajectories_are_written_for_ros_and_keep_to_the_robots_limits() {
    let folder = tempfile::tempdir().unwrap();
    let problems = folder.path().join("swing");
    fs::create_dir(&problems).unwrap();
    problem(&problems, "0001", [0.75, 0.0], REQUEST);
    let out = folder.path().join("out");
    let plan = || grip(&["plan", problems.to_str().unwrap(), "--out", out.to_str().unwrap()]);
    let output = plan();
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let text = fs::read_to_string(out.join("swing/0001.yaml")).unwrap();
    let message: JointTrajectory = serde_saphyr::from_str(&text).unwrap();

    let urdf = root().join("robots/fetch/fetch.urdf");
    let robot = RobotModel::load(&urdf, &[]).unwrap();
    let (robot, config) = RobotConfig::load(&root().join("robots/fetch/fetch.toml"), robot).unwrap();
    assert_eq!((message.header.frame_id.as_str(), message.header.stamp.seconds()), ("base_link", 0.0));
    assert_eq!(message.joint_names.len(), 8, "{:?}", message.joint_names);
    let joints: Vec<usize> =
        message.joint_names.iter().map(|name| robot.joint_index(name).unwrap()).collect();
    // From the request's start to its goal, at rest at both.
    let at = |point: &TrajectoryPoint, name: &str| {
        point.positions[message.joint_names.iter().position(|joint| joint == name).unwrap()]
    };
    let (first, last) = (&message.points[0], message.points.last().unwrap());
    for (name, start, goal) in [("shoulder_pan_joint", 0.8, -0.8), ("torso_lift_joint", 0.2, 0.2)] {
        assert!((at(first, name) - start).abs() < 1e-6 && (at(last, name) - goal).abs() < 1e-6, "{name}");
    }
    assert!(first.velocities.iter().chain(&last.velocities).all(|v| v.abs() < 1e-9));
    assert_eq!(first.time_from_start.seconds(), 0.0);
    for point in &message.points {
        assert!(point.effort.is_empty());
        for (k, &joint) in joints.iter().enumerate() {
            let name = &message.joint_names[k];
            assert!(
                robot.joints()[joint].limits.contains(point.positions[k]),
                "{name} {}",
                point.positions[k]
            );
            let limits = &config.limits[joint];
            assert!(point.velocities[k].abs() <= limits.velocity, "{name} {}", point.velocities[k]);
            assert!(
                point.accelerations[k].abs() <= 1.001 * limits.acceleration,
                "{name} {}",
                point.accelerations[k]
            );
        }
    }
    // Time goes on, and positions are the sums of the velocities.
    for pair in message.points.windows(2) {
        let seconds = pair[1].time_from_start.seconds() - pair[0].time_from_start.seconds();
        assert!(seconds > 1e-4, "{seconds}");
        for k in 0..joints.len() {
            let moved = pair[1].positions[k] - pair[0].positions[k];
            let driven = 0.5 * (pair[0].velocities[k] + pair[1].velocities[k]) * seconds;
            assert!((moved - driven).abs() < 1e-4, "{}: {moved} {driven}", message.joint_names[k]);
        }
    }

    // The same in JSON, and a picture in which the path is drawn.
    let json: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(out.join("swing/0001.json")).unwrap()).unwrap();
    assert_eq!((&json["schema"], &json["name"]), (&"grip.trajectory/1".into(), &"swing/0001".into()));
    assert_eq!(json["points"].as_array().unwrap().len(), message.points.len());
    assert!((json["duration_s"].as_f64().unwrap() - last.time_from_start.seconds()).abs() < 1e-8);
    let picture = image::open(out.join("swing/0001.png")).unwrap().into_rgb8();
    let near = |p: &image::Rgb<u8>, c: [u8; 3]| p.0.iter().zip(c).all(|(a, b)| a.abs_diff(b) < 30);
    for end in [[20, 150, 60], [215, 40, 130]] {
        let drawn = picture.pixels().filter(|p| near(p, end)).count();
        assert!(drawn > 100, "{end:?}: {drawn}");
    }
    let report: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(out.join("plan.json")).unwrap()).unwrap();
    assert_eq!(report["schema"], "grip.plan/1");

    // An earlier run is replaced, a folder of others is not.
    assert_eq!(code(&plan()), 0);
    fs::remove_file(out.join("plan.json")).unwrap();
    let output = plan();
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("choose another --out"), "{}", stderr(&output));
}

#[test]
fn a_goal_inside_an_obstacle_is_named_and_no_fault_of_the_planner() {
    let folder = tempfile::tempdir().unwrap();
    problem(folder.path(), "0001", [0.60, -0.50], REQUEST);
    let output = grip(&["plan", folder.path().to_str().unwrap()]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.contains("goal: ") && text.contains("column"), "{text}");
}

#[test]
fn bad_folders_and_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let complaint = || {
        let output = grip(&["plan", folder.path().to_str().unwrap()]);
        assert_eq!((code(&output), stdout(&output)), (2, String::new()));
        stderr(&output)
    };
    assert!(complaint().contains("no file request*.yaml"));
    fs::write(folder.path().join("request0001.yaml"), REQUEST).unwrap();
    assert!(complaint().contains("scene0001.yaml is missing"));
    problem(folder.path(), "0001", [0.7, 0.0], "goal_constraints: 3");
    assert!(complaint().contains("request0001.yaml"));
}

#[test]
fn the_problems_of_motion_bench_maker_are_solved() {
    let folder = root().join("../shared/data/motion-problems");
    if !folder.exists() {
        eprintln!("SKIPPED: {} is not there", folder.display());
        return;
    }
    for (set, valid) in [("box_fetch", 50), ("table_pick_fetch", 50), ("cage_fetch", 50)] {
        let output = grip(&["plan", folder.join(set).to_str().unwrap(), "--jobs", "2", "--json"]);
        assert_eq!(code(&output), 0, "{set}: {}", stderr(&output));
        let json: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
        let all = &json["summary"][1];
        assert_eq!((all["valid"].as_u64(), all["solved"].as_u64()), (Some(valid), Some(valid)), "{all}");
    }
}
