//! Motion planning problems as MoveIt writes them: MotionBenchMaker's YAML files (Chamzas et al. 2022).
//!
//! `sceneNNNN.yaml` (a planning scene) holds the obstacles as primitives in the robot's base frame, `requestNNNN.yaml` (a
//! motion plan request) the start and, as joint constraints, the goal of a group; a `sceneNNNN.scene` is MoveIt's older text.
//! Which links may touch says the robot's own configuration. What would change the problem and is not understood (octomaps, meshes,
//! other frames, attached objects, goals by pose, paddings) is an error, not left out.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use grip_sim::files;
use grip_sim::robot::{RobotConfig, RobotModel};
use grip_sim::shape::{CollisionShape, Convex};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::Deserialize;
use serde_json::Value;

mod messages;
mod scene_text;

use messages::{
    Constraints, JointConstraint, JointState, PosePart, Primitive, Refused, RequestFile, SceneFile, StatePart,
};

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

/// Joints of the Fetch that move with others or turn its wheels; our description has none of them, for they do not reach out of the
/// robot's outline.
const PASSIVE: [&str; 3] = ["l_wheel_joint", "r_wheel_joint", "bellows_joint"];

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
            let text = scene.with_extension("scene");
            let scene = if !scene.is_file() && text.is_file() { text } else { scene };
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
    let is_text = scene.extension().is_some_and(|ending| ending == "scene");
    let Obstacles { shapes: obstacles, names, state: at_scene } = if is_text {
        let text = files::read_to_string(scene).map_err(|e| problem(scene, e.without_file()))?;
        let (shapes, names) = scene_text::parse(&text).map_err(|e| problem(scene, e))?;
        Obstacles { shapes, names, state: StatePart::default() }
    } else {
        obstacles_of(scene, base)?
    };
    let request_file: RequestFile = read(request)?;
    if !request_file.group_name.is_empty() && request_file.group_name != "arm_with_torso" {
        let reason =
            format!("group_name is {:?}; problems of \"arm_with_torso\" are read", request_file.group_name);
        return Err(problem(request, reason));
    }
    let refuse = |refused: &[(&str, &Refused)]| refuse(request, refused);
    let not_a_goal = |constraints: &Constraints, field: &str| {
        refuse(&[
            (&format!("{field}.position_constraints"), &constraints.position_constraints),
            (&format!("{field}.orientation_constraints"), &constraints.orientation_constraints),
            (&format!("{field}.visibility_constraints"), &constraints.visibility_constraints),
        ])
    };
    let path = &request_file.path_constraints;
    not_a_goal(path, "path_constraints")?;
    if !path.joint_constraints.is_empty() {
        return Err(problem(request, "path_constraints.joint_constraints: not supported"));
    }
    refuse(&[
        ("trajectory_constraints", &request_file.trajectory_constraints.constraints),
        ("reference_trajectories", &request_file.reference_trajectories),
        ("max_cartesian_speed", &request_file.max_cartesian_speed),
        ("start_state.attached_collision_objects", &request_file.start_state.attached_collision_objects),
    ])?;
    let mut start = robot.neutral();
    let mut known = vec![false; start.len()];
    // What a request leaves out is as the scene has it.
    for (file, field, state) in
        [(scene, "robot_state", &at_scene), (request, "start_state", &request_file.start_state)]
    {
        let JointState { name, position, .. } = &state.joint_state;
        if name.len() != position.len() {
            let reason =
                format!("{field}.joint_state: {} names, but {} positions", name.len(), position.len());
            return Err(problem(file, reason));
        }
        for (name, position) in name.iter().zip(position) {
            match robot.joint_index(name) {
                Ok(joint) => (start[joint], known[joint]) = (*position, true),
                Err(_) if PASSIVE.contains(&name.as_str()) => {}
                Err(error) => return Err(problem(file, format!("{field}.joint_state: {error}"))),
            }
        }
    }
    if let Some(&joint) = config.arm_with_torso.iter().find(|&&joint| !known[joint]) {
        let name = &robot.joints()[joint].name;
        return Err(problem(
            request,
            format!("start_state.joint_state: {name} is missing, here and in the scene's robot_state"),
        ));
    }
    let [constraints] = request_file.goal_constraints.as_slice() else {
        let n = request_file.goal_constraints.len();
        return Err(problem(request, format!("goal_constraints: {n} goals, not one")));
    };
    not_a_goal(constraints, "goal_constraints")?;
    let mut wanted: BTreeMap<&str, f64> = BTreeMap::new();
    for JointConstraint { joint_name, position, .. } in &constraints.joint_constraints {
        let fail = |reason: String| problem(request, format!("goal_constraints.joint_constraints: {reason}"));
        let joint = robot.joint_index(joint_name).map_err(|error| fail(error.to_string()))?;
        if !config.arm_with_torso.contains(&joint) && *position != start[joint] {
            return Err(fail(format!("{joint_name} is not in the group, and is to move")));
        }
        if wanted.insert(joint_name, *position).is_some() {
            return Err(fail(format!("{joint_name} stands there twice")));
        }
    }
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

/// What a scene file holds.
struct Obstacles {
    shapes: Vec<CollisionShape>,
    /// One each.
    names: Vec<String>,
    state: StatePart,
}

fn obstacles_of(scene: &Path, base: &str) -> Result<Obstacles, ProblemError> {
    let file: SceneFile = read(scene)?;
    let octomap = file.world.octomap.octomap.as_ref().map(|octomap| ("world.octomap", &octomap.data));
    let refused = [
        ("robot_state.attached_collision_objects", &file.robot_state.attached_collision_objects),
        ("link_padding", &file.link_padding),
        ("link_scale", &file.link_scale),
        ("is_diff", &file.is_diff),
    ];
    refuse(scene, &octomap.into_iter().chain(refused).collect::<Vec<_>>())?;
    let allowed = &file.allowed_collision_matrix;
    let (mut shapes, mut names) = (Vec::new(), Vec::new());
    for object in &file.world.collision_objects {
        let fail =
            |reason: String| problem(scene, format!("world.collision_objects, {:?}: {reason}", object.id));
        let unsupported = [
            ("meshes", &object.meshes),
            ("mesh_poses", &object.mesh_poses),
            ("planes", &object.planes),
            ("plane_poses", &object.plane_poses),
        ];
        if let Some((field, _)) = unsupported.into_iter().find(|(_, refused)| !refused.is_empty()) {
            return Err(fail(format!("{field}: not supported, only primitives are")));
        }
        let adds = match &object.operation {
            Value::Null => true,
            Value::Number(number) => number.as_u64() == Some(0),
            Value::String(text) => ["", "\0", "add", "ADD"].contains(&text.as_str()),
            _ => false,
        };
        if !adds {
            return Err(fail(format!(
                "operation: {}; objects can be added (0), and nothing else",
                object.operation
            )));
        }
        if [&allowed.entry_names, &allowed.default_entry_names].into_iter().any(|n| n.contains(&object.id)) {
            return Err(fail(
                "allowed_collision_matrix: names it; what may be touched is not supported".into(),
            ));
        }
        if !object.header.frame_id.is_empty() && object.header.frame_id != *base {
            return Err(fail(format!(
                "frame_id is {:?}, not the robot's base {base:?}",
                object.header.frame_id
            )));
        }
        let of_object = object.pose.as_ref().map_or(Ok(Isometry3::identity()), isometry).map_err(&fail)?;
        let (count, poses) = (object.primitives.len(), object.primitive_poses.len());
        // MoveIt takes the object's own pose for all when there are no others.
        if poses != count && !(poses == 0 && object.pose.is_some()) {
            return Err(fail(format!("{count} primitives, but {poses} primitive_poses")));
        }
        if count == 0 {
            return Err(fail("has no primitives".into()));
        }
        if !object.id.is_empty() && names.contains(&object.id) {
            return Err(fail("stands there twice; MoveIt takes the later one for the former".into()));
        }
        for (i, primitive) in object.primitives.iter().enumerate() {
            let own = object.primitive_poses.get(i).map_or(Ok(Isometry3::identity()), isometry);
            shapes.push(CollisionShape {
                pose: of_object * own.map_err(&fail)?,
                geometry: geometry(primitive).map_err(&fail)?,
            });
            names.push(object.id.clone());
        }
    }
    Ok(Obstacles { shapes, names, state: file.robot_state })
}

/// An error for the first that is not empty.
fn refuse(file: &Path, refused: &[(&str, &Refused)]) -> Result<(), ProblemError> {
    match refused.iter().find(|(_, refused)| !refused.is_empty()) {
        Some((field, _)) => {
            Err(problem(file, format!("{field}: not supported; it would change the problem")))
        }
        None => Ok(()),
    }
}

/// `cage_fetch/0001` of `.../cage_fetch/request0001.yaml`.
fn problem_name(request: &Path) -> String {
    let stem = request.file_stem().unwrap_or_default().to_string_lossy();
    let set = request.parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy();
    format!("{set}/{}", stem.trim_start_matches("request"))
}

fn isometry(part: &PosePart) -> Result<Isometry3<f64>, String> {
    pose(part.position.0, part.orientation.0)
}

/// Of a position and a unit quaternion x, y, z, w.
fn pose(position: [f64; 3], orientation: [f64; 4]) -> Result<Isometry3<f64>, String> {
    let [x, y, z, w] = orientation;
    let q = Quaternion::new(w, x, y, z);
    let finite = position.iter().chain(&orientation).all(|v| v.is_finite());
    if !finite || (q.norm() - 1.0).abs() > 1e-2 {
        return Err(format!(
            "position {position:?} and orientation {orientation:?} are not a pose (a unit quaternion x, y, z, w)"
        ));
    }
    let rotation = UnitQuaternion::from_quaternion(q);
    Ok(Isometry3::from_parts(Translation3::from(Vector3::from(position)), rotation))
}

fn geometry(primitive: &Primitive) -> Result<Convex, String> {
    let size = &primitive.dimensions;
    if let Some(bad) = size.iter().find(|v| !(**v > 0.0 && **v < 1e3)) {
        return Err(format!("dimensions: {bad} is not a length in metres"));
    }
    if !primitive.polygon.points.is_empty() {
        return Err("polygon: prisms are not supported".into());
    }
    let kind = match &primitive.kind {
        Value::String(name) => name.to_lowercase(),
        // shape_msgs/SolidPrimitive.
        Value::Number(number) => match number.as_u64() {
            Some(1) => "box".into(),
            Some(2) => "sphere".into(),
            Some(3) => "cylinder".into(),
            Some(4) => "cone".into(),
            _ => number.to_string(),
        },
        other => other.to_string(),
    };
    match (kind.as_str(), size.as_slice()) {
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
    let text = files::read_to_string(path).map_err(|e| problem(path, e.without_file()))?;
    // What ROS prints ends in the sign of a next document, which does not come.
    let mut text = text.trim_end();
    while let Some(before) = text.strip_suffix("---") {
        text = before.trim_end();
    }
    serde_saphyr::from_str(text).map_err(|e| problem(path, e))
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
    name: [l_wheel_joint, wrist_roll_joint, shoulder_lift_joint, upperarm_roll_joint, elbow_flex_joint, forearm_roll_joint, wrist_flex_joint, torso_lift_joint, shoulder_pan_joint, head_tilt_joint]
    position: [1.5, 0.9, 1.4, -0.2, 1.72, 0, 1.66, 0.1, 1.32, 0.2]
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
                REQUEST.replace("      - {joint_name: elbow_flex_joint, position: 0.6}\n", ""),
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

    /// MoveIt since 2020: an object has a pose, and its shapes are relative to it.
    #[test]
    fn an_objects_own_pose_moves_its_shapes() {
        let turned =
            "pose: {position: [0.8, 0, 0.5], orientation: [0, 0, 0.7071067811865476, 0.7071067811865476]}";
        let before = load(SCENE, REQUEST).unwrap();
        let relative = SCENE
            .replace("header: {frame_id", &format!("{turned}\n      header: {{frame_id"))
            .replace("{position: [0.8, 0, 0.5], orientation: [0, 0, 0.7071067811865476, 0.7071067811865476]}\n        -", "{position: [0, 0, 0], orientation: [0, 0, 0, 1]}\n        -")
            // A quarter turn back: y of the base is x of the object.
            .replace("{position: [0.8, 0.1, 0.7], orientation: [0, 0, 0, 1]}", "{position: {x: 0.1, y: 0, z: 0.2}, orientation: {x: 0, y: 0, z: -0.7071067811865476, w: 0.7071067811865476}}");
        let after = load(&relative, REQUEST).unwrap();
        for (a, b) in before.obstacles.iter().zip(&after.obstacles) {
            assert!((a.pose.translation.vector - b.pose.translation.vector).norm() < 1e-9, "{}", b.pose);
            assert!(a.pose.rotation.angle_to(&b.pose.rotation) < 1e-6);
        }
        // Its pose alone.
        let alone = "world: {collision_objects: [{id: a, pose: {position: {x: 1, y: 2, z: 3}, orientation: {x: 0, y: 0, z: 0, w: 1}}, \
                     primitives: [{type: 1, dimensions: [1, 1, 1], polygon: {points: []}}], primitive_poses: [], operation: 0}]}";
        let obstacle = &load(alone, REQUEST).unwrap().obstacles[0];
        assert_eq!(obstacle.pose.translation.vector, Vector3::new(1.0, 2.0, 3.0));
    }

    /// Messages have fields that say nothing; those are passed over, and what says something is refused by its name.
    #[test]
    fn what_would_change_the_problem_is_refused_by_name() {
        let empty = format!(
            "{SCENE}  octomap: {{header: {{seq: 0, stamp: 0, frame_id: ''}}, octomap: {{binary: false, resolution: 0.0, data: []}}}}\n\
             link_padding: []\nis_diff: false\nrobot_state: {{attached_collision_objects: [], is_diff: false}}\nobject_colors: []\n"
        );
        assert_eq!(load(&empty, REQUEST).unwrap().obstacles.len(), 2);
        let request = format!(
            "{REQUEST}path_constraints: {{name: '', joint_constraints: []}}\ntrajectory_constraints: {{constraints: []}}\n"
        );
        load(SCENE, &request).unwrap();
        let in_object =
            |field: &str| SCENE.replace("header: {frame_id", &format!("{field}\n      header: {{frame_id"));
        for (scene, wanted) in [
            (
                format!("{SCENE}  octomap: {{octomap: {{id: OcTree, data: [0, 5]}}}}\n"),
                "world.octomap: not supported",
            ),
            (
                format!("{SCENE}link_padding: [{{link_name: gripper_link, padding: 0.1}}]\n"),
                "link_padding: not supported",
            ),
            (format!("{SCENE}is_diff: true\n"), "is_diff: not supported"),
            (format!("{SCENE}weather: fine\n"), "weather"),
            (
                format!("{SCENE}allowed_collision_matrix: {{entry_names: [shelf]}}\n"),
                "\"shelf\": allowed_collision_matrix",
            ),
            (in_object("operation: 1"), "\"shelf\": operation: 1"),
            (in_object("operation: remove"), "\"shelf\": operation: \"remove\""),
            (in_object("meshes: [{vertices: []}]"), "\"shelf\": meshes"),
            (in_object("velocity: 2"), "velocity"),
            ("robot_model_name: fetch\n".into(), "world"),
        ] {
            let error = load(&scene, REQUEST).unwrap_err().to_string();
            assert!(error.contains("scene0001.yaml") && error.contains(wanted), "{wanted}: {error}");
        }
        for (request, wanted) in [
            (
                format!("{REQUEST}path_constraints: {{orientation_constraints: [{{weight: 1}}]}}\n"),
                "path_constraints.orientation_constraints",
            ),
            (
                format!(
                    "{REQUEST}path_constraints: {{joint_constraints: [{{joint_name: a, position: 1}}]}}\n"
                ),
                "path_constraints.joint_constraints",
            ),
            (
                REQUEST.replace(
                    "  - joint_constraints:",
                    "  - position_constraints: [1]\n    joint_constraints:",
                ),
                "goal_constraints.position_constraints",
            ),
            (
                format!("{REQUEST}      - {{joint_name: head_pan_joint, position: 0.5}}\n"),
                "head_pan_joint is not in the group",
            ),
            (
                format!("{REQUEST}      - {{joint_name: elbow_flex_joint, position: 0.5}}\n"),
                "elbow_flex_joint stands there twice",
            ),
            (REQUEST.replace("shoulder_pan_joint, head", "shoulder_pan, head"), "'shoulder_pan'"),
            (
                REQUEST.replace("wrist_roll_joint, shoulder", "shoulder").replace("1.5, 0.9", "1.5"),
                "wrist_roll_joint is missing, here and in",
            ),
        ] {
            let error = load(SCENE, &request).unwrap_err().to_string();
            assert!(error.contains("request0001.yaml") && error.contains(wanted), "{wanted}: {error}");
        }
        // What the request leaves out, the scene may have.
        let scene =
            format!("{SCENE}robot_state: {{joint_state: {{name: [wrist_roll_joint], position: [0.9]}}}}\n");
        let request = REQUEST.replace("wrist_roll_joint, shoulder", "shoulder").replace("1.5, 0.9", "1.5");
        load(&scene, &request).unwrap();
        assert!(load("", REQUEST).unwrap_err().to_string().contains("is empty"));
    }
}
