//! What a URDF does not say: groups, named poses, planning limits, the camera, the gripper. Read from `fetch.toml` and
//! checked against the model, so that a [`RobotConfig`] that exists fits its robot.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use nalgebra::{Point3, Vector3};

use super::config_file::{CameraFile, GripperFile, HeadFile, LimitsFile, RobotConfigFile, SelfCollisionFile};
use super::{JointKind, RobotModel, list, pairs, srdf};
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
    /// The torso and the arm's joints; the arm's alone where there is no torso.
    pub arm_with_torso: Vec<usize>,
    /// The finger joints, right then left.
    pub gripper_joints: [usize; 2],
    /// Named poses.
    pub poses: BTreeMap<String, NamedPose>,
    /// Limits for planned motion, one a joint of `q`.
    pub limits: Vec<PlanningLimits>,
    /// How far a servo gives way under a load, rad/(N m) or m/N, one a joint of `q`.
    pub compliance: Vec<f64>,
    /// Where hands work, in the root link's frame: least and greatest x, y and z, metres.
    pub workspace: Option<[[f64; 3]; 2]>,
    /// The camera on the robot.
    pub camera: Option<CameraConfig>,
    /// The head's joints; a robot with a head has a camera.
    pub head: Option<HeadConfig>,
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

/// The camera on the robot.
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
    /// Half extents of a finger's pad, a box, along the gripper's axes, metres.
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

impl RobotConfig {
    /// Reads a configuration and checks it against the robot, which is given what the file adds to it: further URDFs, the frame of its
    /// gripper, narrower limits.
    ///
    /// # Errors
    /// When a file cannot be read, has an unknown or missing field, names a joint or link that the robot does not
    /// have, a pose is out of limits, or a number makes no sense. The message names file and field.
    pub fn load(path: &Path, robot: RobotModel) -> Result<(RobotModel, Self)> {
        let text = files::read_to_string(path)?;
        let file: RobotConfigFile =
            files::from_toml(&text).map_err(|message| Error::invalid(path, message))?;
        let folder = path.parent().unwrap_or(Path::new("."));
        let robot = robot.adapted(&file, folder).map_err(|message| Error::invalid(path, message))?;
        let config = check(file, &robot, folder).map_err(|message| Error::invalid(path, message))?;
        Ok((robot, config))
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

    /// The joint that lifts the arm, if there is one.
    pub fn torso(&self) -> Option<usize> {
        self.arm_with_torso.iter().copied().find(|joint| !self.arm.contains(joint))
    }

    /// Intrinsics of the robot's camera by name; without one, the default.
    ///
    /// # Errors
    /// When the robot has no camera, or none of that name; the message lists those there are.
    pub fn intrinsics(&self, robot: &RobotModel, name: Option<&str>) -> Result<Intrinsics> {
        let camera = self.camera.as_ref().ok_or_else(|| {
            robot.error(
                "no [camera] in its settings; give the scene's [camera] a `calibration` (width, height, fx, fy, cx, cy), or name a \
                 ROS calibration file (intrinsics = \"NAME.yaml\")",
            )
        })?;
        let name = name.unwrap_or(&camera.default_intrinsics);
        camera.intrinsics.get(name).copied().ok_or_else(|| {
            robot.error(format!(
                "no [camera.intrinsics.{name}] in its settings; there are {}",
                list(camera.intrinsics.keys().map(String::as_str))
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

fn check(
    file: RobotConfigFile,
    robot: &RobotModel,
    folder: &Path,
) -> std::result::Result<RobotConfig, String> {
    let joint =
        |field: &str, name: &str| robot.joint_index(name).map_err(|error| format!("{field}: {error}"));
    let group = |field: &str, names: &[String]| -> std::result::Result<Vec<usize>, String> {
        let joints: Vec<usize> =
            names.iter().map(|name| joint(field, name)).collect::<std::result::Result<_, _>>()?;
        if joints.is_empty() || joints.iter().collect::<BTreeSet<_>>().len() < joints.len() {
            return Err(format!("{field}: must name at least one joint, and none twice"));
        }
        Ok(joints)
    };
    let arm = group("groups.arm", &file.groups.arm)?;
    let arm_with_torso = match &file.groups.arm_with_torso {
        Some(names) => group("groups.arm_with_torso", names)?,
        None => arm.clone(),
    };
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
    let workspace = match file.workspace {
        Some(within) if within.min.iter().zip(&within.max).all(|(low, high)| low < high) => {
            Some([within.min, within.max])
        }
        Some(within) => {
            return Err(format!("workspace: min {:?} must be below max {:?}", within.min, within.max));
        }
        None => None,
    };
    let camera = file.camera.map(|camera| check_camera(camera, robot)).transpose()?;
    let head = match file.head {
        Some(_) if camera.is_none() => {
            return Err(
                "[head] points the robot's camera, but there is no [camera]; add it, or leave [head] out"
                    .into(),
            );
        }
        Some(HeadFile { pan, tilt }) => {
            Some(HeadConfig { pan: joint("head.pan", &pan)?, tilt: joint("head.tilt", &tilt)? })
        }
        None => None,
    };
    let gripper = gripper(&file.gripper, robot, fingers)?;
    let allowed = allowed_pairs(file.self_collision, robot, folder)?;
    Ok(RobotConfig {
        arm,
        arm_with_torso,
        gripper_joints: fingers,
        poses,
        limits,
        compliance,
        workspace,
        camera,
        head,
        gripper,
        allowed,
    })
}

fn check_camera(file: CameraFile, robot: &RobotModel) -> std::result::Result<CameraConfig, String> {
    for (name, intrinsics) in &file.intrinsics {
        if let Some(problem) = intrinsics.problem() {
            return Err(format!("camera.intrinsics.{name}: {problem}"));
        }
    }
    if !file.intrinsics.contains_key(&file.default_intrinsics) {
        return Err(format!(
            "camera.default_intrinsics: no camera.intrinsics.{}; there are {}",
            file.default_intrinsics,
            list(file.intrinsics.keys().map(String::as_str))
        ));
    }
    let optical_link =
        robot.link_index(&file.optical_link).map_err(|error| format!("camera.optical_link: {error}"))?;
    Ok(CameraConfig {
        optical_link,
        intrinsics: file.intrinsics,
        default_intrinsics: file.default_intrinsics,
    })
}

/// Pairs that may touch: by construction, and those of the file and its SRDF; without any, those that sampling finds.
fn allowed_pairs(
    file: Option<SelfCollisionFile>,
    robot: &RobotModel,
    folder: &Path,
) -> std::result::Result<Vec<(usize, usize)>, String> {
    let mut allowed = robot.adjacent_pairs();
    match file {
        Some(SelfCollisionFile { srdf, allowed: named }) => {
            let link = |name: &str| {
                robot.link_index(name).map_err(|error| format!("self_collision.allowed: {error}"))
            };
            for [a, b] in &named {
                let (a, b) = (link(a)?, link(b)?);
                allowed.push((a.min(b), a.max(b)));
            }
            if let Some(name) = srdf {
                let pairs = srdf::disabled_pairs(&name, robot, folder);
                allowed.extend(pairs.map_err(|message| format!("self_collision.srdf: {message}"))?);
            }
        }
        None => {
            let found = pairs::sampled(robot);
            log::info!(
                "{}: no [self_collision] in its settings; {} pairs of links may touch, by {} samples",
                robot.name(),
                found.len(),
                pairs::SAMPLES
            );
            allowed.extend(found.iter().map(|pair| pair.links));
        }
    }
    allowed.sort_unstable();
    allowed.dedup();
    Ok(allowed)
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
        let LimitsFile { velocity, acceleration, .. } = *values;
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
    fingers: [usize; 2],
) -> std::result::Result<GripperConfig, String> {
    // What the fingers slide on has the gripper's frame: see `adapt`.
    let link = robot.joints()[fingers[0]].parent;
    for finger in fingers {
        let joint = &robot.joints()[finger];
        if joint.kind != JointKind::Prismatic || joint.parent != link {
            return Err(format!(
                "groups.gripper: '{}' must be a prismatic joint on gripper.link '{}'",
                joint.name, file.link
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
    let turned = robot.joints()[fingers[0]].origin.rotation.to_rotation_matrix();
    let gripper = GripperConfig {
        link,
        fingers,
        finger_links: fingers.map(|finger| robot.joints()[finger].child),
        pad_half_extents: turned.matrix().abs() * Vector3::from(file.pad_half_extents),
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
    let least = gripper.gap(robot, [0.0; 2]);
    if least.abs() > 1e-3 {
        return Err(format!(
            "gripper.pad_centers: with both fingers at zero the pads are {least:.4} m apart, and must meet; check pad_centers and \
             pad_half_extents, or move the origins of the finger joints in the URDF",
        ));
    }
    let [right, left] = [0, 1].map(|side| gripper.pad_center(robot, side, 0.0));
    let middle = nalgebra::center(&right, &left).coords;
    if middle.norm() > 5e-3 {
        return Err(format!(
            "gripper.frame: its origin must lie between the pads, whose middle is at [{:.4}, {:.4}, {:.4}] m in it",
            middle.x, middle.y, middle.z
        ));
    }
    Ok(gripper)
}

impl GripperConfig {
    /// Distance between the pads' inner faces with the fingers at `positions` (right, left), metres.
    pub fn gap(&self, robot: &RobotModel, positions: [f64; 2]) -> f64 {
        let center = |side: usize| self.pad_center(robot, side, positions[side]).y;
        (center(0) - center(1)).abs() - 2.0 * self.pad_half_extents.y
    }

    /// Centre of the pad of finger `side` (right, left) at `position`, gripper frame.
    fn pad_center(&self, robot: &RobotModel, side: usize, position: f64) -> Point3<f64> {
        let joint = &robot.joints()[self.fingers[side]];
        let slide = joint.axis.into_inner() * position;
        joint.origin * Point3::from(slide + self.pad_centers[side])
    }
}
