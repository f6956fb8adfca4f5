//! Motion planning problems as MoveIt writes them: MotionBenchMaker's YAML files (Chamzas et al. 2022).
//!
//! `sceneNNNN.yaml` (a planning scene) holds the obstacles as primitives in the robot's base frame, `requestNNNN.yaml` (a
//! motion plan request) the start and, as joint constraints, the goal of a group. Of each file only these are read;
//! which links may touch says the robot's own configuration. What would change the problem and is not understood (meshes,
//! other frames, attached objects, goals by pose) is an error, not left out.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use grip_sim::robot::{RobotConfig, RobotModel};
use grip_sim::shape::{CollisionShape, Convex};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::Deserialize;

/// A planning problem for the group `arm_with_torso`.
#[derive(Debug, Clone)]
pub struct MotionProblem {
    /// Folder and number, such as `cage_fetch/0001`.
    pub name: String,
    /// Obstacles in the base frame.
    pub obstacles: Vec<CollisionShape>,
    /// Their names, one each.
    pub names: Vec<String>,
    /// Whole configuration at the start, radians and metres.
    pub start: Vec<f64>,
    /// Whole configuration at the goal.
    pub goal: Vec<f64>,
}

/// A file that cannot be read, or says what is not understood.
#[derive(Debug, thiserror::Error)]
#[error("{}: {reason}", path.display())]
pub struct ProblemError {
    /// The file.
    pub path: PathBuf,
    /// Field and value, in words.
    pub reason: String,
}

#[derive(Deserialize)]
struct SceneFile {
    #[serde(default)]
    world: WorldPart,
    #[serde(default)]
    robot_state: StatePart,
}

#[derive(Deserialize, Default)]
struct WorldPart {
    #[serde(default)]
    collision_objects: Vec<ObjectPart>,
}

#[derive(Deserialize)]
struct ObjectPart {
    #[serde(default)]
    id: String,
    #[serde(default)]
    header: Header,
    #[serde(default)]
    primitives: Vec<Primitive>,
    #[serde(default)]
    primitive_poses: Vec<PosePart>,
    #[serde(default)]
    meshes: Vec<serde::de::IgnoredAny>,
    #[serde(default)]
    planes: Vec<serde::de::IgnoredAny>,
}

#[derive(Deserialize, Default)]
struct Header {
    #[serde(default)]
    frame_id: String,
}

#[derive(Deserialize)]
struct Primitive {
    #[serde(rename = "type")]
    kind: String,
    dimensions: Vec<f64>,
}

#[derive(Deserialize)]
struct PosePart {
    position: [f64; 3],
    /// x, y, z, w.
    orientation: [f64; 4],
}

#[derive(Deserialize)]
struct RequestFile {
    #[serde(default)]
    group_name: String,
    start_state: StatePart,
    #[serde(default)]
    goal_constraints: Vec<Constraints>,
}

#[derive(Deserialize, Default)]
struct StatePart {
    #[serde(default)]
    joint_state: JointState,
    #[serde(default)]
    attached_collision_objects: Vec<serde::de::IgnoredAny>,
}

#[derive(Deserialize, Default)]
struct JointState {
    #[serde(default)]
    name: Vec<String>,
    #[serde(default)]
    position: Vec<f64>,
}

#[derive(Deserialize)]
struct Constraints {
    #[serde(default)]
    joint_constraints: Vec<JointConstraint>,
    #[serde(default)]
    position_constraints: Vec<serde::de::IgnoredAny>,
    #[serde(default)]
    orientation_constraints: Vec<serde::de::IgnoredAny>,
}

#[derive(Deserialize)]
struct JointConstraint {
    joint_name: String,
    position: f64,
}

/// The files `request*.yaml` in `folder` and the folders in it, each with the scene of its number, in the order of their
/// names.
///
/// # Errors
/// When a folder cannot be read, when there is no request, or when a request has no scene.
pub fn find_problems(folder: &Path) -> Result<Vec<(PathBuf, PathBuf)>, ProblemError> {
    let mut found = Vec::new();
    collect(folder, 3, &mut found)?;
    found.sort();
    if found.is_empty() {
        return Err(problem(
            folder,
            "no file request*.yaml here or in the folders below; name a folder of MotionBenchMaker problems",
        ));
    }
    Ok(found)
}

fn collect(folder: &Path, depth: usize, found: &mut Vec<(PathBuf, PathBuf)>) -> Result<(), ProblemError> {
    for entry in fs::read_dir(folder).map_err(|e| problem(folder, e))? {
        let path = entry.map_err(|e| problem(folder, e))?.path();
        if path.is_dir() && depth > 0 {
            collect(&path, depth - 1, found)?;
            continue;
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let number = name.strip_prefix("request").and_then(|rest| rest.strip_suffix(".yaml"));
        if let Some(number) = number {
            let scene = folder.join(format!("scene{number}.yaml"));
            if !scene.is_file() {
                return Err(problem(&path, format!("its scene {} is missing", scene.display())));
            }
            found.push((path, scene));
        }
    }
    Ok(())
}

/// Reads one problem.
///
/// # Errors
/// When a file cannot be read, does not fit the robot, or says what is not understood.
pub fn load_problem(
    request: &Path,
    scene: &Path,
    robot: &RobotModel,
    config: &RobotConfig,
) -> Result<MotionProblem, ProblemError> {
    let base = &robot.links()[0].name;
    let scene_file: SceneFile = read(scene)?;
    let request_file: RequestFile = read(request)?;
    if !scene_file.robot_state.attached_collision_objects.is_empty() {
        return Err(problem(scene, "robot_state.attached_collision_objects: not supported"));
    }
    let (mut obstacles, mut names) = (Vec::new(), Vec::new());
    for object in &scene_file.world.collision_objects {
        let fail =
            |reason: String| problem(scene, format!("world.collision_objects, {:?}: {reason}", object.id));
        if !object.meshes.is_empty() || !object.planes.is_empty() {
            return Err(fail("meshes and planes are not supported, only primitives".into()));
        }
        if !object.header.frame_id.is_empty() && object.header.frame_id != *base {
            return Err(fail(format!(
                "frame_id is {:?}, not the robot's base {base:?}",
                object.header.frame_id
            )));
        }
        if object.primitives.len() != object.primitive_poses.len() {
            let (n, m) = (object.primitives.len(), object.primitive_poses.len());
            return Err(fail(format!("{n} primitives, but {m} primitive_poses")));
        }
        for (primitive, pose) in object.primitives.iter().zip(&object.primitive_poses) {
            obstacles.push(CollisionShape {
                pose: isometry(pose).map_err(&fail)?,
                geometry: geometry(primitive).map_err(&fail)?,
            });
            names.push(object.id.clone());
        }
    }
    if !request_file.group_name.is_empty() && request_file.group_name != "arm_with_torso" {
        let reason =
            format!("group_name is {:?}; problems of \"arm_with_torso\" are read", request_file.group_name);
        return Err(problem(request, reason));
    }
    let mut start = robot.neutral();
    let state = &request_file.start_state;
    if !state.attached_collision_objects.is_empty() {
        return Err(problem(request, "start_state.attached_collision_objects: not supported"));
    }
    let JointState { name, position } = &state.joint_state;
    if name.len() != position.len() {
        let reason =
            format!("start_state.joint_state: {} names, but {} positions", name.len(), position.len());
        return Err(problem(request, reason));
    }
    // Wheels and bellows, which our description has no joints for, do not reach out of the robot's outline.
    for (name, position) in name.iter().zip(position) {
        if let Ok(joint) = robot.joint_index(name) {
            start[joint] = *position;
        }
    }
    let [constraints] = request_file.goal_constraints.as_slice() else {
        let n = request_file.goal_constraints.len();
        return Err(problem(request, format!("goal_constraints: {n} goals, not one")));
    };
    if !constraints.position_constraints.is_empty() || !constraints.orientation_constraints.is_empty() {
        return Err(problem(request, "goal_constraints: only joint_constraints are supported"));
    }
    let wanted: BTreeMap<&str, f64> =
        constraints.joint_constraints.iter().map(|c| (c.joint_name.as_str(), c.position)).collect();
    let mut goal = start.clone();
    for &joint in &config.arm_with_torso {
        let name = robot.joints()[joint].name.as_str();
        let Some(position) = wanted.get(name) else {
            return Err(problem(request, format!("goal_constraints.joint_constraints: {name} is missing")));
        };
        goal[joint] = *position;
    }
    if let Some(reason) = robot.problem_with(&start, 1e-3) {
        return Err(problem(request, format!("start_state: {reason}")));
    }
    if let Some(reason) = robot.problem_with(&goal, 1e-3) {
        return Err(problem(request, format!("goal_constraints: {reason}")));
    }
    Ok(MotionProblem { name: problem_name(request), obstacles, names, start, goal })
}

/// `cage_fetch/0001` of `.../cage_fetch/request0001.yaml`.
fn problem_name(request: &Path) -> String {
    let stem = request.file_stem().unwrap_or_default().to_string_lossy();
    let set = request.parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy();
    format!("{set}/{}", stem.trim_start_matches("request"))
}

fn isometry(pose: &PosePart) -> Result<Isometry3<f64>, String> {
    let [x, y, z, w] = pose.orientation;
    let q = Quaternion::new(w, x, y, z);
    let finite = pose.position.iter().chain(&pose.orientation).all(|v| v.is_finite());
    if !finite || (q.norm() - 1.0).abs() > 1e-2 {
        return Err(format!(
            "position {:?} and orientation {:?} are not a pose (a unit quaternion x, y, z, w)",
            pose.position, pose.orientation
        ));
    }
    let rotation = UnitQuaternion::from_quaternion(q);
    Ok(Isometry3::from_parts(Translation3::from(Vector3::from(pose.position)), rotation))
}

fn geometry(primitive: &Primitive) -> Result<Convex, String> {
    let size = &primitive.dimensions;
    if let Some(bad) = size.iter().find(|v| !(**v > 0.0 && **v < 1e3)) {
        return Err(format!("dimensions: {bad} is not a length in metres"));
    }
    match (primitive.kind.as_str(), size.as_slice()) {
        ("box", [x, y, z]) => Ok(Convex::Cuboid { half: Vector3::new(*x, *y, *z) * 0.5 }),
        ("cylinder", [height, radius]) => Ok(Convex::Cylinder { half_height: 0.5 * height, radius: *radius }),
        ("sphere", [radius]) => Ok(Convex::Sphere { radius: *radius }),
        (kind, size) => Err(format!(
            "type {kind:?} with {} dimensions; box (3), cylinder (2: height, radius) and sphere (1) are read",
            size.len()
        )),
    }
}

fn read<T: for<'de> Deserialize<'de>>(path: &Path) -> Result<T, ProblemError> {
    let text = fs::read_to_string(path).map_err(|e| problem(path, e))?;
    serde_saphyr::from_str(&text).map_err(|e| problem(path, e))
}

fn problem(path: &Path, reason: impl ToString) -> ProblemError {
    ProblemError { path: path.to_path_buf(), reason: reason.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::fetch;

    const SCENE: &str = "
world:
  collision_objects:
    - id: shelf
      header: {frame_id: base_link}
      primitives:
        - {type: box, dimensions: [0.4, 0.2, 0.1]}
        - {type: cylinder, dimensions: [0.3, 0.05]}
      primitive_poses:
        - {position: [0.8, 0, 0.5], orientation: [0, 0, 0.7071067811865476, 0.7071067811865476]}
        - {position: [0.8, 0.1, 0.7], orientation: [0, 0, 0, 1]}
";
    const REQUEST: &str = "
group_name: arm_with_torso
start_state:
  joint_state:
    name: [l_wheel_joint, torso_lift_joint, shoulder_pan_joint, head_tilt_joint]
    position: [1.5, 0.1, 1.32, 0.2]
goal_constraints:
  - joint_constraints:
      - {joint_name: torso_lift_joint, position: 0.2}
      - {joint_name: shoulder_pan_joint, position: 0.3}
      - {joint_name: shoulder_lift_joint, position: 0.4}
      - {joint_name: upperarm_roll_joint, position: 0.5}
      - {joint_name: elbow_flex_joint, position: 0.6}
      - {joint_name: forearm_roll_joint, position: 0.7}
      - {joint_name: wrist_flex_joint, position: 0.8}
      - {joint_name: wrist_roll_joint, position: 0.9}
";

    fn load(scene: &str, request: &str) -> Result<MotionProblem, ProblemError> {
        let folder = std::env::temp_dir().join(format!("grip-moveit-{:x}", rand::random::<u64>()));
        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("scene0001.yaml"), scene).unwrap();
        fs::write(folder.join("request0001.yaml"), request).unwrap();
        let (robot, config) = fetch();
        let found = find_problems(&folder).unwrap();
        let loaded = load_problem(&found[0].0, &found[0].1, &robot, &config);
        fs::remove_dir_all(&folder).unwrap();
        loaded
    }

    #[test]
    fn obstacles_start_and_goal_are_those_of_the_files() {
        let problem = load(SCENE, REQUEST).unwrap();
        assert!(problem.name.ends_with("/0001") && problem.names == ["shelf", "shelf"]);
        assert_eq!(problem.obstacles[0].geometry, Convex::Cuboid { half: Vector3::new(0.2, 0.1, 0.05) });
        assert_eq!(problem.obstacles[1].geometry, Convex::Cylinder { half_height: 0.15, radius: 0.05 });
        // A quarter turn about z.
        let x = problem.obstacles[0].pose.rotation * Vector3::x();
        assert!((x - Vector3::y()).norm() < 1e-9);
        let (robot, config) = fetch();
        let at = |q: &[f64], name: &str| q[robot.joint_index(name).unwrap()];
        assert_eq!(at(&problem.start, "shoulder_pan_joint"), 1.32);
        assert_eq!(at(&problem.goal, "head_tilt_joint"), 0.2, "what the goal does not name stays");
        let goal: Vec<f64> = config.arm_with_torso.iter().map(|&j| problem.goal[j]).collect();
        assert_eq!(goal, [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]);
    }

    #[test]
    fn what_is_not_understood_is_named() {
        for (scene, request, parts) in [
            (SCENE.replace("type: box", "type: cone"), REQUEST.into(), ["scene0001.yaml", "shelf", "cone"]),
            (
                SCENE.replace("0.4, 0.2", "-0.4, 0.2"),
                REQUEST.into(),
                ["scene0001.yaml", "dimensions", "-0.4"],
            ),
            (SCENE.replace("base_link", "map"), REQUEST.into(), ["scene0001.yaml", "frame_id", "map"]),
            (SCENE.replace("0.8, 0.1", ".nan, 0.1"), REQUEST.into(), ["scene0001.yaml", "shelf", "NaN"]),
            (
                SCENE.into(),
                REQUEST.replace("elbow_flex", "elbow"),
                ["request0001.yaml", "elbow_flex_joint", "missing"],
            ),
            (
                SCENE.into(),
                REQUEST.replace("arm_with_torso", "arm"),
                ["request0001.yaml", "group_name", "\"arm\""],
            ),
            (
                SCENE.into(),
                REQUEST.replace("position: 0.6", "position: 9"),
                ["request0001.yaml", "goal", "9"],
            ),
            (SCENE.into(), "start_state: [".into(), ["request0001.yaml", "line", ""]),
        ] {
            let message = load(&scene, &request).unwrap_err().to_string();
            assert!(parts.iter().all(|part| message.contains(part)), "{parts:?}: {message}");
        }
    }
}
