//! What a URDF does not say: groups, named poses, planning limits, the camera, the gripper. Read from `fetch.toml` and
//! checked against the model, so that a [`RobotConfig`] that exists fits its robot.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{JointKind, RobotModel, list};
use crate::camera::Intrinsics;
use crate::error::{Error, Result};
use crate::files;

/// Slack for positions and speeds copied from tables with rounded digits.
const ROUNDING: f64 = 1e-6;

/// Configuration of a robot, all names resolved to indices of its [`RobotModel`].
#[derive(Debug, Clone)]
pub struct RobotConfig {
    /// The arm's joints, shoulder to wrist, indices into `q`.
    pub arm: Vec<usize>,
    /// The torso and the arm's joints.
    pub arm_with_torso: Vec<usize>,
    /// The finger joints, right then left.
    pub gripper_joints: [usize; 2],
    /// Named poses.
    pub poses: BTreeMap<String, NamedPose>,
    /// Limits for planned motion, one a joint of `q`.
    pub limits: Vec<PlanningLimits>,
    /// How far a servo gives way under a load, rad/(N m) or m/N, one a joint of `q`.
    pub compliance: Vec<f64>,
    /// The head camera.
    pub camera: CameraConfig,
    /// The head's joints.
    pub head: HeadConfig,
    /// The gripper.
    pub gripper: GripperConfig,
    allowed: Vec<(usize, usize)>,
}

/// Positions of some joints.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedPose {
    /// Joint index and its position, radians or metres; ordered by index.
    pub positions: Vec<(usize, f64)>,
}

/// How fast a joint may be planned to move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanningLimits {
    /// Highest speed, rad/s or m/s; never above the joint's own limit.
    pub velocity: f64,
    /// Highest acceleration, rad/s^2 or m/s^2.
    pub acceleration: f64,
}

/// The head camera.
#[derive(Debug, Clone)]
pub struct CameraConfig {
    /// Link whose frame is the colour camera's optical frame (x right, y down, z forward).
    pub optical_link: usize,
    /// Named intrinsics.
    pub intrinsics: BTreeMap<String, Intrinsics>,
    /// The name used when none is asked for.
    pub default_intrinsics: String,
}

/// The joints that point the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HeadConfig {
    /// Joint index of the pan.
    pub pan: usize,
    /// Joint index of the tilt.
    pub tilt: usize,
}

/// A parallel gripper with two sliding fingers. In the gripper link's frame x points out along the fingers and y along
/// the closing direction.
#[derive(Debug, Clone)]
pub struct GripperConfig {
    /// The gripper's link; its origin is between the pads.
    pub link: usize,
    /// Joint indices of the fingers, right then left.
    pub fingers: [usize; 2],
    /// Links of the fingers, right then left.
    pub finger_links: [usize; 2],
    /// Half extents of a finger's pad, a box, metres.
    pub pad_half_extents: Vector3<f64>,
    /// Centres of the pads in their finger links' frames, right then left, metres.
    pub pad_centers: [Vector3<f64>; 2],
    /// Widest opening between the pads, metres.
    pub opening: f64,
    /// Length of the fingers from the palm's front to the tips, metres: no object reaches deeper.
    pub finger_depth: f64,
    /// Highest closing force of a finger, newtons.
    pub max_force: f64,
}

/// The file of a robot's configuration: what a URDF does not say.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RobotConfigFile {
    groups: GroupsFile,
    /// Named poses: joints and their positions, radians or metres.
    poses: BTreeMap<String, BTreeMap<String, f64>>,
    /// What planning keeps to, by joint; lower than the URDF's.
    limits: BTreeMap<String, LimitsFile>,
    /// Stiffness of the servos, by joint, N m/rad or N/m: how far they give way under a load that they do not know of. A joint that is
    /// not named does not.
    #[serde(default)]
    stiffness: BTreeMap<String, f64>,
    camera: CameraFile,
    head: HeadFile,
    gripper: GripperFile,
    #[serde(default)]
    self_collision: SelfCollisionFile,
}

/// Groups of joints.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct GroupsFile {
    /// The arm's joints, shoulder to wrist.
    arm: Vec<String>,
    /// The torso and the arm's joints.
    arm_with_torso: Vec<String>,
    /// The joints of the two fingers.
    gripper: [String; 2],
}

/// Limits of a joint in planned motion.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct LimitsFile {
    /// Radians or metres a second.
    velocity: f64,
    /// Radians or metres a second squared.
    acceleration: f64,
}

/// The head camera.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct CameraFile {
    /// The link whose z looks out, x right, y down.
    optical_link: String,
    /// Name of those used where a scene names none.
    default_intrinsics: String,
    /// By name.
    intrinsics: BTreeMap<String, Intrinsics>,
}

/// The joints that point the head.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct HeadFile {
    pan: String,
    tilt: String,
}

/// A gripper of two parallel fingers.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct GripperFile {
    /// The link between the fingers: x out along them, y along the closing direction.
    link: String,
    /// Half of a pad's extents in the frame of its finger, metres.
    pad_half_extents: [f64; 3],
    /// Where the pads are in the frames of their fingers, metres.
    pad_centers: [[f64; 3]; 2],
    /// Widest opening between the pads, metres.
    opening: f64,
    /// Length of the fingers from the palm's front to the tips, metres.
    finger_depth: f64,
    /// Highest closing force of a finger, newtons.
    max_force: f64,
}

/// Collisions of the robot with itself that are none.
#[derive(Deserialize, JsonSchema, Default)]
#[serde(deny_unknown_fields)]
struct SelfCollisionFile {
    /// Pairs of links.
    allowed: Vec<[String; 2]>,
}

impl RobotConfig {
    /// Reads a configuration and checks it against the robot.
    ///
    /// # Errors
    /// When the file cannot be read, has an unknown or missing field, names a joint or link that the robot does not
    /// have, a pose is out of limits, or a number makes no sense. The message names file and field.
    pub fn load(path: &Path, robot: &RobotModel) -> Result<Self> {
        let text = files::read_to_string(path)?;
        let file: RobotConfigFile =
            files::from_toml(&text).map_err(|message| Error::invalid(path, message))?;
        check(file, robot).map_err(|message| Error::invalid(path, message))
    }

    /// A named pose.
    ///
    /// # Errors
    /// When there is none of that name; the message lists those there are.
    pub fn pose(&self, robot: &RobotModel, name: &str) -> Result<&NamedPose> {
        self.poses.get(name).ok_or_else(|| {
            robot.error(format!("no pose '{name}'; poses: {}", list(self.poses.keys().map(String::as_str))))
        })
    }

    /// A whole configuration in a named pose; joints that the pose does not name are at [`RobotModel::neutral`].
    ///
    /// # Errors
    /// When there is no pose of that name.
    pub fn configuration(&self, robot: &RobotModel, name: &str) -> Result<Vec<f64>> {
        let mut q = robot.neutral();
        self.pose(robot, name)?.apply(&mut q);
        Ok(q)
    }

    /// Intrinsics by name; without one, the default.
    ///
    /// # Errors
    /// When there are none of that name; the message lists those there are.
    pub fn intrinsics(&self, robot: &RobotModel, name: Option<&str>) -> Result<Intrinsics> {
        let name = name.unwrap_or(&self.camera.default_intrinsics);
        self.camera.intrinsics.get(name).copied().ok_or_else(|| {
            robot.error(format!(
                "no [camera.intrinsics.{name}] in its settings; there are {}",
                list(self.camera.intrinsics.keys().map(String::as_str))
            ))
        })
    }

    /// Pairs of links (lower index first, sorted) that may touch: those adjacent in the tree, and those the file names.
    pub fn allowed_pairs(&self) -> &[(usize, usize)] {
        &self.allowed
    }

    /// Whether two links may touch.
    pub fn is_allowed(&self, a: usize, b: usize) -> bool {
        a == b || self.allowed.binary_search(&(a.min(b), a.max(b))).is_ok()
    }
}

impl NamedPose {
    /// Writes the pose's joints into a configuration.
    pub fn apply(&self, q: &mut [f64]) {
        for &(joint, position) in &self.positions {
            q[joint] = position;
        }
    }
}

fn check(file: RobotConfigFile, robot: &RobotModel) -> std::result::Result<RobotConfig, String> {
    let joint =
        |field: &str, name: &str| robot.joint_index(name).map_err(|error| format!("{field}: {error}"));
    let link = |field: &str, name: &str| robot.link_index(name).map_err(|error| format!("{field}: {error}"));
    let group = |field: &str, names: &[String]| -> std::result::Result<Vec<usize>, String> {
        let joints: Vec<usize> =
            names.iter().map(|name| joint(field, name)).collect::<std::result::Result<_, _>>()?;
        if joints.is_empty() || joints.iter().collect::<BTreeSet<_>>().len() < joints.len() {
            return Err(format!("{field}: must name at least one joint, and none twice"));
        }
        Ok(joints)
    };
    let arm = group("groups.arm", &file.groups.arm)?;
    let arm_with_torso = group("groups.arm_with_torso", &file.groups.arm_with_torso)?;
    let fingers = group("groups.gripper", &file.groups.gripper)?;
    let fingers = [fingers[0], fingers[1]];

    let mut poses = BTreeMap::new();
    for (name, positions) in &file.poses {
        poses.insert(name.clone(), pose(name, positions, robot)?);
    }
    let limits = planning_limits(&file.limits, robot, &[&arm, &arm_with_torso, &fingers])?;

    let mut compliance = vec![0.0; robot.joints().len()];
    for (name, &stiffness) in &file.stiffness {
        let index = joint("stiffness", name)?;
        // Softer than that would be no servo.
        if !(1.0..=1e12).contains(&stiffness) {
            return Err(format!("stiffness.{name} = {stiffness} must be from 1 to 1e12 N m/rad or N/m"));
        }
        compliance[index] = 1.0 / stiffness;
    }

    for (name, intrinsics) in &file.camera.intrinsics {
        if let Some(problem) = intrinsics.problem() {
            return Err(format!("camera.intrinsics.{name}: {problem}"));
        }
    }
    if !file.camera.intrinsics.contains_key(&file.camera.default_intrinsics) {
        return Err(format!(
            "camera.default_intrinsics: no camera.intrinsics.{}; there are {}",
            file.camera.default_intrinsics,
            list(file.camera.intrinsics.keys().map(String::as_str))
        ));
    }
    let camera = CameraConfig {
        optical_link: link("camera.optical_link", &file.camera.optical_link)?,
        intrinsics: file.camera.intrinsics,
        default_intrinsics: file.camera.default_intrinsics,
    };
    let head =
        HeadConfig { pan: joint("head.pan", &file.head.pan)?, tilt: joint("head.tilt", &file.head.tilt)? };
    let gripper_link = link("gripper.link", &file.gripper.link)?;
    let gripper = gripper(&file.gripper, robot, gripper_link, fingers)?;

    let mut allowed = robot.adjacent_pairs();
    for [a, b] in &file.self_collision.allowed {
        let (a, b) = (link("self_collision.allowed", a)?, link("self_collision.allowed", b)?);
        allowed.push((a.min(b), a.max(b)));
    }
    allowed.sort_unstable();
    allowed.dedup();
    Ok(RobotConfig {
        arm,
        arm_with_torso,
        gripper_joints: fingers,
        poses,
        limits,
        compliance,
        camera,
        head,
        gripper,
        allowed,
    })
}

fn pose(
    name: &str,
    positions: &BTreeMap<String, f64>,
    robot: &RobotModel,
) -> std::result::Result<NamedPose, String> {
    let mut result = Vec::new();
    for (joint, &position) in positions {
        let index = robot.joint_index(joint).map_err(|error| format!("poses.{name}: {error}"))?;
        let limits = robot.joints()[index].limits;
        if !position.is_finite() || !limits.contains(position) {
            return Err(format!(
                "poses.{name}.{joint} = {position} is outside the joint's limits {} to {}",
                limits.lower, limits.upper
            ));
        }
        result.push((index, position));
    }
    result.sort_by_key(|&(index, _)| index);
    Ok(NamedPose { positions: result })
}

/// One entry a joint of the robot: as the file says, and for joints outside all groups their own speed, reached in 1 s.
fn planning_limits(
    file: &BTreeMap<String, LimitsFile>,
    robot: &RobotModel,
    groups: &[&[usize]],
) -> std::result::Result<Vec<PlanningLimits>, String> {
    let mut limits: Vec<PlanningLimits> = robot
        .joints()
        .iter()
        .map(|joint| PlanningLimits { velocity: joint.limits.velocity, acceleration: joint.limits.velocity })
        .collect();
    let mut given = BTreeSet::new();
    for (name, values) in file {
        let index = robot.joint_index(name).map_err(|error| format!("limits: {error}"))?;
        let highest = robot.joints()[index].limits.velocity;
        let LimitsFile { velocity, acceleration } = *values;
        if !(velocity > 0.0 && velocity <= highest + ROUNDING) {
            return Err(format!(
                "limits.{name}.velocity = {velocity} must be above 0 and not above the URDF's {highest}"
            ));
        }
        if !(acceleration > 0.0 && acceleration.is_finite()) {
            return Err(format!("limits.{name}.acceleration = {acceleration} must be above 0"));
        }
        limits[index] = PlanningLimits { velocity, acceleration };
        given.insert(index);
    }
    for &joint in groups.iter().copied().flatten() {
        if !given.contains(&joint) {
            return Err(format!(
                "limits: joint '{}' is in a group but has no [limits.{0}] with velocity and acceleration",
                robot.joints()[joint].name
            ));
        }
    }
    Ok(limits)
}

fn gripper(
    file: &GripperFile,
    robot: &RobotModel,
    link: usize,
    fingers: [usize; 2],
) -> std::result::Result<GripperConfig, String> {
    for finger in fingers {
        let joint = &robot.joints()[finger];
        if joint.kind != JointKind::Prismatic || joint.parent != link {
            return Err(format!(
                "groups.gripper: '{}' must be a prismatic joint on gripper.link '{}'",
                joint.name,
                robot.links()[link].name
            ));
        }
    }
    let positive =
        [("opening", file.opening), ("finger_depth", file.finger_depth), ("max_force", file.max_force)]
            .into_iter()
            .chain(file.pad_half_extents.map(|extent| ("pad_half_extents", extent)));
    for (field, value) in positive {
        if !(value > 0.0 && value.is_finite()) {
            return Err(format!("gripper.{field}: {value} must be above 0"));
        }
    }
    if file.pad_centers.iter().flatten().any(|value| !value.is_finite()) {
        return Err(format!("gripper.pad_centers: {:?} must be finite", file.pad_centers));
    }
    let strongest =
        fingers.iter().map(|&finger| robot.joints()[finger].limits.effort).fold(f64::INFINITY, f64::min);
    if file.max_force > strongest + ROUNDING {
        return Err(format!(
            "gripper.max_force = {} N is above the finger joints' effort limit {strongest} N",
            file.max_force
        ));
    }
    let gripper = GripperConfig {
        link,
        fingers,
        finger_links: fingers.map(|finger| robot.joints()[finger].child),
        pad_half_extents: Vector3::from(file.pad_half_extents),
        pad_centers: file.pad_centers.map(Vector3::from),
        opening: file.opening,
        finger_depth: file.finger_depth,
        max_force: file.max_force,
    };
    let widest = gripper.gap(robot, fingers.map(|finger| robot.joints()[finger].limits.upper));
    if (widest - file.opening).abs() > 1e-3 {
        return Err(format!(
            "gripper.opening = {} m, but with both fingers at their upper limits the pads are {widest:.4} m apart; check opening, pad_centers and pad_half_extents",
            file.opening
        ));
    }
    Ok(gripper)
}

impl GripperConfig {
    /// Distance between the pads' inner faces with the fingers at `positions` (right, left), metres.
    pub fn gap(&self, robot: &RobotModel, positions: [f64; 2]) -> f64 {
        let center = |side: usize| {
            let joint = &robot.joints()[self.fingers[side]];
            let slide = joint.axis.into_inner() * positions[side];
            (joint.origin * nalgebra::Point3::from(slide + self.pad_centers[side])).y
        };
        (center(0) - center(1)).abs() - 2.0 * self.pad_half_extents.y
    }
}
