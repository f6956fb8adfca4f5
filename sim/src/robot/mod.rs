//! The robot model: read from a URDF, immutable, with its kinematics.
//!
//! | file | what it holds |
//! |---|---|
//! | `mod` | the model as data: links, joints, limits |
//! | `load` | URDF to model, with every check |
//! | `resolve` | `package://`, `file://` and relative mesh paths |
//! | `mesh_files`, `mesh_part`, `collada`, `primitives`, `hull` | meshes for drawing and convex hulls for collision |
//! | `kinematics` | forward kinematics and Jacobian on flat arrays |
//! | `lanes` | forward kinematics of eight configurations at once |
//! | `ik` | inverse kinematics: Levenberg-Marquardt within joint limits |
//! | `config`, `config_file` | `fetch.toml`: groups, named poses, planning limits, camera, gripper |
//! | `adapt` | what that file adds to a URDF: further URDFs, the gripper's frame, narrower limits |
//! | `guess` | a first such file, guessed from a URDF |
//! | `srdf`, `pairs` | pairs of links that may touch, from an SRDF or by sampling |
//! | `head` | pointing the camera |
//!
//! A [`RobotModel`] holds no joint values: a configuration `q` is a slice with one value a movable joint, in the order
//! of [`RobotModel::joints`], radians or metres, and is passed to each call.
//!
//! ```no_run
//! use std::path::Path;
//! use grip_sim::robot::{RobotConfig, RobotModel};
//! # fn main() -> grip_sim::Result<()> {
//! let robot = RobotModel::load(Path::new("robots/fetch/fetch.urdf"), &[])?;
//! let (robot, config) = RobotConfig::load(Path::new("robots/fetch/fetch.toml"), robot)?;
//! let q = config.configuration(&robot, "ready")?;
//! let base_from_gripper = robot.fk_link(&q, config.gripper.link);
//! # let _ = base_from_gripper;
//! # Ok(())
//! # }
//! ```

mod adapt;
mod collada;
mod config;
mod config_file;
mod guess;
mod head;
mod hull;
mod ik;
mod kinematics;
mod lanes;
mod load;
mod mesh_files;
mod mesh_part;
pub mod pairs;
mod primitives;
mod resolve;
mod srdf;
mod stl;
#[cfg(test)]
mod tests;
mod urdf;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Unit, Vector3};

pub use adapt::find_urdf;
pub use config::{CameraConfig, GripperConfig, HeadConfig, NamedPose, PlanningLimits, RobotConfig};
pub use config_file::RobotConfigFile;
pub use ik::{IkOutcome, IkRequest};
pub use lanes::{GroupKinematics, Pose8};

use crate::error::{Error, Result};
use crate::mesh::Visual;
use crate::shape::CollisionShape;
use kinematics::Step;

/// A robot: links, joints and their geometry. Immutable, cheap to share (`Send + Sync`).
#[derive(Debug, Clone)]
pub struct RobotModel {
    name: String,
    source: PathBuf,
    links: Vec<Link>,
    joints: Vec<Joint>,
    /// One step of forward kinematics a link, parents first.
    steps: Vec<Step>,
    /// Those that a URDF lets mimic others.
    followers: Vec<Follower>,
    /// Where `package://` was looked up.
    package_paths: Vec<PathBuf>,
    loaded: LoadSummary,
}

/// A joint that follows another.
#[derive(Debug, Clone)]
struct Follower {
    /// The link that it moves.
    link: usize,
    kind: JointKind,
    limits: JointLimits,
}

/// A rigid body of the robot. Geometry and inertia are in the link frame.
#[derive(Debug, Clone)]
pub struct Link {
    /// Name in the URDF.
    pub name: String,
    /// Kilograms; 0 for a mere frame.
    pub mass: f64,
    /// Inertia about the centre of mass, link axes, kg m^2.
    pub inertia: Matrix3<f64>,
    /// Centre of mass, metres.
    pub com: Point3<f64>,
    /// What to draw.
    pub visuals: Vec<LinkVisual>,
    /// Convex pieces for physics and planning.
    pub collisions: Vec<CollisionShape>,
    /// How this link hangs on its parent; `None` for the root.
    pub parent_joint: Option<ParentJoint>,
}

/// A mesh at its place in a link.
#[derive(Debug, Clone)]
pub struct LinkVisual {
    /// Link from mesh.
    pub pose: Isometry3<f64>,
    /// Mesh and material.
    pub visual: Arc<Visual>,
}

/// The joint between a link and its parent, movable or not.
#[derive(Debug, Clone, PartialEq)]
pub struct ParentJoint {
    /// Name in the URDF.
    pub name: String,
    /// Index of the parent link, always less than the link's own.
    pub parent: usize,
    /// Index into [`RobotModel::joints`] of the joint that moves it; `None` when fixed. A URDF `mimic` joint names the
    /// joint that it follows.
    pub moved_by: Option<usize>,
}

/// A movable joint: one entry of the configuration `q`.
#[derive(Debug, Clone)]
pub struct Joint {
    /// Name in the URDF.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Axis of motion in the joint frame (which is the child link's frame at zero).
    pub axis: Unit<Vector3<f64>>,
    /// Parent link index.
    pub parent: usize,
    /// Child link index.
    pub child: usize,
    /// Parent link from joint frame.
    pub origin: Isometry3<f64>,
    /// Position, velocity and effort limits.
    pub limits: JointLimits,
}

/// How a joint moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointKind {
    /// Turns between two limits, radians.
    Revolute,
    /// Turns without end, radians.
    Continuous,
    /// Slides between two limits, metres.
    Prismatic,
}

/// Limits of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointLimits {
    /// Lowest position, radians or metres; minus infinity for a continuous joint.
    pub lower: f64,
    /// Highest position, radians or metres; infinity for a continuous joint.
    pub upper: f64,
    /// Highest speed, rad/s or m/s; infinity where the URDF has none.
    pub velocity: f64,
    /// Highest effort, N m or N; infinity where the URDF has none.
    pub effort: f64,
}

impl JointLimits {
    /// Whether a position is within the limits.
    pub fn contains(&self, position: f64) -> bool {
        (self.lower..=self.upper).contains(&position)
    }

    /// The nearest position within the limits; NaN stays NaN.
    pub fn clamp(&self, position: f64) -> f64 {
        // `max` and `min` drop a NaN.
        if position.is_nan() { position } else { position.max(self.lower).min(self.upper) }
    }
}

/// What was read, so that a missing mesh cannot hide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LoadSummary {
    /// Distinct mesh files read.
    pub meshes: usize,
    /// `<visual>` elements, all of them with geometry.
    pub visuals: usize,
    /// `<collision>` elements, all of them with geometry.
    pub collisions: usize,
    /// Links.
    pub links: usize,
    /// Movable joints.
    pub joints: usize,
}

impl RobotModel {
    /// Reads a URDF and every mesh that it names.
    ///
    /// `package://NAME/...` is looked up in `package_paths`, each of which is the package itself or a folder that
    /// contains it; when `package_paths` is empty, in the environment's `ROS_PACKAGE_PATH`; and at last among the
    /// folders above the URDF. Supported meshes: STL (ASCII, binary), COLLADA (`.dae`), OBJ.
    ///
    /// # Errors
    /// When a file is missing, cut off or not what it should be, when the joints do not form one tree, or when a number
    /// is not finite. A mesh that cannot be read is an error that names mesh, link and URDF.
    pub fn load(urdf: &Path, package_paths: &[PathBuf]) -> Result<Self> {
        load::load(urdf, package_paths)
    }

    /// The robot's name in the URDF.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The URDF that this model was read from.
    pub fn source(&self) -> &Path {
        &self.source
    }

    /// All links, parents before children; the root is the first.
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// The movable joints, in the order of a configuration `q`.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// How much was read.
    pub fn loaded(&self) -> LoadSummary {
        self.loaded
    }

    /// Index of a link by name.
    ///
    /// # Errors
    /// When there is none; the message lists the names.
    pub fn link_index(&self, name: &str) -> Result<usize> {
        self.links.iter().position(|link| link.name == name).ok_or_else(|| {
            self.error(format!(
                "no link '{name}'; links: {}",
                list(self.links.iter().map(|link| link.name.as_str()))
            ))
        })
    }

    /// Index of a movable joint by name.
    ///
    /// # Errors
    /// When there is none; the message lists the names.
    pub fn joint_index(&self, name: &str) -> Result<usize> {
        self.joints.iter().position(|joint| joint.name == name).ok_or_else(|| {
            self.error(format!(
                "no movable joint '{name}'; movable joints: {}",
                list(self.joints.iter().map(|joint| joint.name.as_str()))
            ))
        })
    }

    /// Every joint at zero, or at its limit nearest to zero.
    pub fn neutral(&self) -> Vec<f64> {
        self.joints.iter().map(|joint| joint.limits.clamp(0.0)).collect()
    }

    /// The first joint of `q` that is not a number or beyond its limits by more than `tolerance`, as a message.
    pub fn problem_with(&self, q: &[f64], tolerance: f64) -> Option<String> {
        if q.len() != self.joints.len() {
            return Some(format!(
                "{} joint values for a robot with {} movable joints",
                q.len(),
                self.joints.len()
            ));
        }
        self.joints.iter().zip(q).find_map(|(joint, &value)| {
            let JointLimits { lower, upper, .. } = joint.limits;
            (!(lower - tolerance..=upper + tolerance).contains(&value) || !value.is_finite())
                .then(|| format!("{} = {value} is outside its limits {lower} to {upper}", joint.name))
        })
    }

    /// Pairs of links (lower index first) that touch by construction: links without a movable joint between them, and
    /// links of two such rigid bodies that one joint connects. Sorted.
    pub fn adjacent_pairs(&self) -> Vec<(usize, usize)> {
        // The rigid body of a link is named by its topmost link.
        let mut body = vec![0; self.links.len()];
        let mut parent_body = vec![None; self.links.len()];
        for (index, link) in self.links.iter().enumerate() {
            match &link.parent_joint {
                Some(joint) if joint.moved_by.is_none() => body[index] = body[joint.parent],
                Some(joint) => {
                    body[index] = index;
                    parent_body[index] = Some(body[joint.parent]);
                }
                None => body[index] = index,
            }
        }
        let touches = |a: usize, b: usize| {
            body[a] == body[b]
                || parent_body[body[a]] == Some(body[b])
                || parent_body[body[b]] == Some(body[a])
        };
        (0..self.links.len())
            .flat_map(|a| (a + 1..self.links.len()).map(move |b| (a, b)))
            .filter(|&(a, b)| touches(a, b))
            .collect()
    }

    pub(crate) fn error(&self, message: impl Into<String>) -> Error {
        Error::Robot { robot: self.name.clone(), message: message.into() }
    }
}

/// Names joined by commas.
fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.collect::<Vec<_>>().join(", ")
}
