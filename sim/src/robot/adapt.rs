//! What a robot's configuration adds to its URDF: further URDFs, narrower limits, the frame of its gripper, drives of its fingers.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::config_file::{AttachFile, FrameFile, LimitsFile, RobotConfigFile};
use super::kinematics::{Drive, Motion, Step};
use super::resolve::{ROS_PACKAGE_PATH, Resolver};
use super::{Joint, JointKind, Link, LinkVisual, ParentJoint, RobotModel};
use crate::error::Error;
use crate::files;

type Result<T> = std::result::Result<T, String>;

impl RobotModel {
    /// The robot with all that `file`, which lies in `folder`, adds to it.
    pub(super) fn adapted(mut self, file: &RobotConfigFile, folder: &Path) -> Result<Self> {
        for (number, part) in file.attach.iter().enumerate() {
            self.attach(part, folder).map_err(|message| format!("attach[{number}]: {message}"))?;
        }
        for (name, limits) in &file.limits {
            self.narrow(name, limits)?;
        }
        for name in &file.groups.gripper {
            self.free(name);
        }
        let gripper = &file.gripper;
        let link = self.link_index(&gripper.link).map_err(|error| format!("gripper.link: {error}"))?;
        let mut fingers = Vec::new();
        for name in &file.groups.gripper {
            let joint = self.joint_index(name).map_err(|error| format!("groups.gripper: {error}"))?;
            if self.joints[joint].parent != link || self.joints[joint].kind != JointKind::Prismatic {
                return Err(format!(
                    "groups.gripper: '{name}' must be a prismatic joint on gripper.link '{}'",
                    gripper.link
                ));
            }
            fingers.push(joint);
        }
        if let Some(frame) = &gripper.frame {
            let pose = isometry(frame).map_err(|message| format!("gripper.frame: {message}"))?;
            self.insert_frame(link, &pose, &fingers);
        }
        for finger in fingers {
            self.fuse(self.joints[finger].child);
        }
        Ok(self)
    }

    /// The file of a `package://` name, looked up as for meshes, or of one relative to `folder`.
    pub(super) fn locate(&self, name: &str, folder: &Path) -> Result<PathBuf> {
        located(name, folder, &self.source, &self.package_paths)
    }

    /// Fixes another URDF to a link.
    fn attach(&mut self, part: &AttachFile, folder: &Path) -> Result<()> {
        let link = self.link_index(&part.link).map_err(|error| format!("link: {error}"))?;
        let pose = isometry(&FrameFile { xyz: part.xyz, rpy: part.rpy })?;
        let urdf = self.locate(&part.urdf, folder)?;
        let other = Self::load(&urdf, &self.package_paths).map_err(|error: Error| error.to_string())?;
        let (links, joints) = (self.links.len(), self.joints.len());
        for name in other.links.iter().map(|link| &link.name) {
            if self.links.iter().any(|link| link.name == *name) {
                return Err(format!("two links are called '{name}'; rename that of {}", part.urdf));
            }
        }
        for name in other.joints.iter().map(|joint| &joint.name) {
            if self.joints.iter().any(|joint| joint.name == *name) {
                return Err(format!("two joints are called '{name}'; rename that of {}", part.urdf));
            }
        }
        let name = format!("{}_to_{}", part.link, other.links[0].name);
        for (mut link_of, mut step) in other.links.into_iter().zip(other.steps) {
            match &mut link_of.parent_joint {
                Some(joint) => {
                    joint.parent += links;
                    joint.moved_by = joint.moved_by.map(|joint| joint + joints);
                    step.parent += links;
                }
                at_root => {
                    *at_root = Some(ParentJoint { name: name.clone(), parent: link, moved_by: None });
                    step = fixed(link, pose);
                }
            }
            if let Motion::Turn(drive) | Motion::Slide(drive) = &mut step.motion {
                drive.joint += joints;
            }
            self.links.push(link_of);
            self.steps.push(step);
        }
        self.joints.extend(other.joints.into_iter().map(|joint| Joint {
            parent: joint.parent + links,
            child: joint.child + links,
            ..joint
        }));
        self.followers.extend(other.followers.into_iter().map(|mut follower| {
            follower.link += links;
            follower
        }));
        let (own, more) = (&mut self.loaded, other.loaded);
        own.meshes += more.meshes;
        own.visuals += more.visuals;
        own.collisions += more.collisions;
        own.links += more.links;
        own.joints += more.joints;
        Ok(())
    }

    /// Keeps a joint within narrower limits than the URDF's. A joint that is not there is told of where limits are checked.
    fn narrow(&mut self, name: &str, file: &LimitsFile) -> Result<()> {
        let (Ok(index), true) = (self.joint_index(name), file.lower.is_some() || file.upper.is_some()) else {
            return Ok(());
        };
        let joint = &mut self.joints[index];
        let limits = &mut joint.limits;
        let (lower, upper) = (file.lower.unwrap_or(limits.lower), file.upper.unwrap_or(limits.upper));
        if !(limits.contains(lower) && limits.contains(upper) && lower < upper) {
            return Err(format!(
                "limits.{name}: lower {lower} and upper {upper} must be in order and within the URDF's {} to {}",
                limits.lower, limits.upper
            ));
        }
        (limits.lower, limits.upper) = (lower, upper);
        if lower.is_finite() && upper.is_finite() && joint.kind == JointKind::Continuous {
            joint.kind = JointKind::Revolute;
        }
        Ok(())
    }

    /// Gives a joint that follows another a drive of its own: the fingers of a gripper have two, which the program keeps together.
    fn free(&mut self, name: &str) {
        let of = |link: usize| self.links[link].parent_joint.as_ref().filter(|joint| joint.name == name);
        let Some(at) = self.followers.iter().position(|follower| of(follower.link).is_some()) else { return };
        let follower = self.followers.remove(at);
        let (link, own) = (follower.link, self.joints.len());
        let step = &mut self.steps[link];
        let drive = Drive { joint: own, multiplier: 1.0, offset: 0.0 };
        step.motion = match follower.kind {
            JointKind::Prismatic => Motion::Slide(drive),
            JointKind::Revolute | JointKind::Continuous => Motion::Turn(drive),
        };
        self.joints.push(Joint {
            name: name.to_owned(),
            kind: follower.kind,
            axis: nalgebra::Unit::new_normalize(step.axis),
            parent: step.parent,
            child: link,
            origin: step.origin,
            limits: follower.limits,
        });
        if let Some(joint) = &mut self.links[link].parent_joint {
            joint.moved_by = Some(own);
        }
    }

    /// Puts a link without a body at `pose` in `link` and lets the joints `fingers` of `link` hang on it.
    fn insert_frame(&mut self, link: usize, pose: &Isometry3<f64>, fingers: &[usize]) {
        let at = link + 1;
        let shifted = |index: usize| if index >= at { index + 1 } else { index };
        for step in &mut self.steps {
            step.parent = shifted(step.parent);
        }
        for joint in self.links.iter_mut().filter_map(|link| link.parent_joint.as_mut()) {
            joint.parent = shifted(joint.parent);
        }
        for joint in &mut self.joints {
            (joint.parent, joint.child) = (shifted(joint.parent), shifted(joint.child));
        }
        for follower in &mut self.followers {
            follower.link = shifted(follower.link);
        }
        let mut name = format!("{}_gripper_frame", self.links[link].name);
        while self.links.iter().any(|link| link.name == name) {
            name.push('_');
        }
        self.steps.insert(at, fixed(link, *pose));
        self.links.insert(
            at,
            Link {
                parent_joint: Some(ParentJoint {
                    name: format!("{name}_joint"),
                    parent: link,
                    moved_by: None,
                }),
                name,
                mass: 0.0,
                inertia: nalgebra::Matrix3::zeros(),
                com: nalgebra::Point3::origin(),
                visuals: Vec::new(),
                collisions: Vec::new(),
            },
        );
        let inverse = pose.inverse();
        for &finger in fingers {
            let joint = &mut self.joints[finger];
            joint.parent = at;
            joint.origin = inverse * joint.origin;
            let step = &mut self.steps[joint.child];
            (step.parent, step.origin) = (at, joint.origin);
            if let Some(parent) = &mut self.links[joint.child].parent_joint {
                parent.parent = at;
            }
        }
        self.loaded.links += 1;
    }

    /// Gives a finger the solids and looks of all that is fixed to it: in physics it is one body.
    fn fuse(&mut self, finger: usize) {
        let mut place = vec![None; self.links.len()];
        place[finger] = Some(Isometry3::identity());
        for index in finger + 1..self.links.len() {
            let step = &self.steps[index];
            let (Some(parent), Motion::Fixed) = (place[step.parent], step.motion) else { continue };
            let finger_from_link: Isometry3<f64> = parent * step.origin;
            place[index] = Some(finger_from_link);
            let link = &mut self.links[index];
            let (visuals, collisions) =
                (std::mem::take(&mut link.visuals), std::mem::take(&mut link.collisions));
            let finger = &mut self.links[finger];
            finger.visuals.extend(
                visuals
                    .into_iter()
                    .map(|visual| LinkVisual { pose: finger_from_link * visual.pose, ..visual }),
            );
            finger.collisions.extend(collisions.into_iter().map(|mut shape| {
                shape.pose = finger_from_link * shape.pose;
                shape
            }));
        }
    }
}

/// The file of a `package://` name, looked up as for the meshes of `urdf`, or of one relative to `folder`.
fn located(name: &str, folder: &Path, urdf: &Path, package_paths: &[PathBuf]) -> Result<PathBuf> {
    let environment = std::env::var_os(ROS_PACKAGE_PATH);
    if name.contains("://") {
        Resolver::new(urdf, package_paths, environment).resolve(name)
    } else {
        Ok(files::named(folder, name))
    }
}

/// The URDF that a file in `folder` names: relative to it, or `package://`, which is looked up as [`RobotModel::load`] does for meshes.
///
/// # Errors
/// When the package is not found; says where it was looked for.
pub fn find_urdf(name: &Path, folder: &Path, package_paths: &[PathBuf]) -> crate::error::Result<PathBuf> {
    match name.to_str().filter(|name| name.contains("://")) {
        Some(package) => located(package, folder, &folder.join("scene.urdf"), package_paths)
            .map_err(|message| Error::invalid(folder, format!("robot.urdf: {message} (--package-path)"))),
        None => Ok(folder.join(name)),
    }
}

/// The step of a link that is fixed to `parent` at `origin`.
fn fixed(parent: usize, origin: Isometry3<f64>) -> Step {
    Step { parent, origin, axis: Vector3::z(), motion: Motion::Fixed }
}

fn isometry(file: &FrameFile) -> Result<Isometry3<f64>> {
    let ([x, y, z], [roll, pitch, yaw]) = (file.xyz, file.rpy);
    if ![x, y, z, roll, pitch, yaw].iter().all(|value| value.is_finite() && value.abs() < 100.0) {
        return Err(format!("xyz {:?} rpy {:?} must be metres and radians below 100", file.xyz, file.rpy));
    }
    let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    Ok(Isometry3::from_parts(Translation3::new(x, y, z), rotation))
}
