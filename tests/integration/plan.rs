//! `grip plan` on problems of our own and, where they are, on those of MotionBenchMaker.

use std::fs;
use std::path::Path;

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
