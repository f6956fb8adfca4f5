//! The file of a robot's configuration as it is written, TOML; [`super::config`] checks it against the robot.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::camera::Intrinsics;

/// The file of a robot's configuration: what a URDF does not say.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RobotConfigFile {
    pub(super) groups: GroupsFile,
    /// Further URDFs that are fixed to links of the robot, such as a gripper for the bare arm of its maker.
    #[serde(default)]
    pub(super) attach: Vec<AttachFile>,
    /// Named poses: joints and their positions, radians or metres.
    pub(super) poses: BTreeMap<String, BTreeMap<String, f64>>,
    /// What planning keeps to, by joint; lower than the URDF's.
    pub(super) limits: BTreeMap<String, LimitsFile>,
    /// Stiffness of the servos, by joint, N m/rad or N/m: how far they give way under a load that they do not know of. A joint that is
    /// not named does not.
    #[serde(default)]
    pub(super) stiffness: BTreeMap<String, f64>,
    /// Where hands work, as seen from the root link: inverse kinematics starts from configurations with the hand there. Left out, it
    /// starts from all.
    pub(super) workspace: Option<WorkspaceFile>,
    /// The camera on the robot, if it has one; a scene can have one of its own.
    pub(super) camera: Option<CameraFile>,
    /// The joints that point it, if it can be pointed.
    pub(super) head: Option<HeadFile>,
    pub(super) gripper: GripperFile,
    /// Left out, pairs that may touch are found by sampling.
    pub(super) self_collision: Option<SelfCollisionFile>,
}

/// A URDF fixed to a link.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct AttachFile {
    /// URDF, relative to this file, or `package://`.
    pub(super) urdf: String,
    /// The link that its root is fixed to.
    pub(super) link: String,
    /// Where its root is in that link, metres.
    #[serde(default)]
    pub(super) xyz: [f64; 3],
    /// How it is turned there: roll, pitch and yaw as in a URDF, radians.
    #[serde(default)]
    pub(super) rpy: [f64; 3],
}

/// A box.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct WorkspaceFile {
    /// Its least x, y and z, metres.
    pub(super) min: [f64; 3],
    /// Its greatest.
    pub(super) max: [f64; 3],
}

/// A frame.
#[derive(Deserialize, JsonSchema, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct FrameFile {
    /// Its origin, metres.
    pub(super) xyz: [f64; 3],
    /// How it is turned: roll, pitch and yaw as in a URDF, radians.
    pub(super) rpy: [f64; 3],
}

/// Groups of joints.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct GroupsFile {
    /// The arm's joints, shoulder to wrist.
    pub(super) arm: Vec<String>,
    /// The torso and the arm's joints; left out, the arm's.
    pub(super) arm_with_torso: Option<Vec<String>>,
    /// The joints of the two fingers, right and left: zero where the pads meet, and more the wider they are open. One that mimics the
    /// other has a drive of its own.
    pub(super) gripper: [String; 2],
}

/// Limits of a joint in planned motion.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LimitsFile {
    /// Radians or metres a second.
    pub(super) velocity: f64,
    /// Radians or metres a second squared.
    pub(super) acceleration: f64,
    /// Lowest position, radians or metres, where it is to be above the URDF's.
    pub(super) lower: Option<f64>,
    /// Highest position, radians or metres, where it is to be below the URDF's.
    pub(super) upper: Option<f64>,
}

/// The camera on the robot.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraFile {
    /// The link whose z looks out, x right, y down.
    pub(super) optical_link: String,
    /// Name of those used where a scene names none.
    pub(super) default_intrinsics: String,
    /// By name.
    pub(super) intrinsics: BTreeMap<String, Intrinsics>,
}

/// The joints that point the head.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct HeadFile {
    pub(super) pan: String,
    pub(super) tilt: String,
}

/// A gripper of two parallel fingers.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct GripperFile {
    /// The link that the fingers slide on.
    pub(super) link: String,
    /// The gripper's frame in that link: origin between the pads, x out along the fingers, y along the closing direction. Left out, it
    /// is the link's own.
    pub(super) frame: Option<FrameFile>,
    /// Half of a pad's extents in the frame of its finger, metres.
    pub(super) pad_half_extents: [f64; 3],
    /// Where the pads are in the frames of their fingers, metres.
    pub(super) pad_centers: [[f64; 3]; 2],
    /// Widest opening between the pads, metres.
    pub(super) opening: f64,
    /// Length of the fingers from the palm's front to the tips, metres.
    pub(super) finger_depth: f64,
    /// Highest closing force of a finger, newtons.
    pub(super) max_force: f64,
    /// Coulomb friction of the pads, in place of the settings' `physics.fingers.pad_friction` and
    /// `planner.grasp.antipodal.pad_friction`, unless a settings file names these. A contact has the mean of both sides'.
    pub(super) pad_friction: Option<f64>,
}

/// Collisions of the robot with itself that are none.
#[derive(Deserialize, JsonSchema, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct SelfCollisionFile {
    /// An SRDF of the robot, relative to this file: its `disable_collisions` are pairs that may touch. `package://` is looked up as for
    /// meshes.
    pub(super) srdf: Option<String>,
    /// Pairs of links.
    #[serde(default)]
    pub(super) allowed: Vec<[String; 2]>,
}
