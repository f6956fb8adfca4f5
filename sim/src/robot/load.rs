//! From a URDF file to a [`RobotModel`], with every check.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use urdf_rs::{Geometry, JointType};

use super::kinematics::{Drive, Motion, Step};
use super::resolve::{ROS_PACKAGE_PATH, Resolver};
use super::{
    Follower, Joint, JointKind, JointLimits, Link, LinkVisual, LoadSummary, ParentJoint, RobotModel, hull,
    list, mesh_files, primitives, urdf,
};
use crate::error::{Error, Result};
use crate::files::{self, text};
use crate::mesh::{Material, Mesh, Visual};
use crate::shape::{CollisionShape, Convex};

/// Origins and sizes beyond this are a slip of units, metres.
const FARTHEST: f64 = 1e3;

pub(super) fn load(urdf: &Path, package_paths: &[PathBuf]) -> Result<RobotModel> {
    let text = text::xml(files::read(urdf)?).map_err(|message| Error::invalid(urdf, message))?;
    let is_xacro = urdf.extension().is_some_and(|ending| ending == "xacro");
    if is_xacro || text.contains("<xacro:") {
        return Err(Error::invalid(
            urdf,
            "is a xacro file, which is a template of a URDF; expand it first: xacro FILE.urdf.xacro > FILE.urdf",
        ));
    }
    let description = urdf::parse(&text).map_err(|message| Error::invalid(urdf, message))?;
    let tree = Tree::of(&description).map_err(|message| Error::invalid(urdf, message))?;
    let mut loader = Loader {
        urdf,
        resolver: Resolver::new(urdf, package_paths, std::env::var_os(ROS_PACKAGE_PATH)),
        materials: named_materials(&description),
        parts: HashMap::new(),
        summary: LoadSummary::default(),
    };
    let mut model = RobotModel {
        name: description.name.clone(),
        source: urdf.to_path_buf(),
        links: Vec::new(),
        joints: tree.joints,
        steps: tree.steps,
        followers: tree.followers,
        package_paths: package_paths.to_vec(),
        loaded: LoadSummary::default(),
    };
    for (&index, parent_joint) in tree.order.iter().zip(tree.parent_joints) {
        let link = loader.link(&description.links[index], parent_joint)?;
        model.links.push(link);
    }
    model.loaded = LoadSummary {
        meshes: loader.parts.keys().map(|(path, _)| path).collect::<BTreeSet<_>>().len(),
        links: model.links.len(),
        joints: model.joints.len(),
        ..loader.summary
    };
    Ok(model)
}

/// The joints of a description as one tree, links ordered with parents first.
struct Tree {
    /// Indices into the description's links.
    order: Vec<usize>,
    /// One for each entry of `order`.
    parent_joints: Vec<Option<ParentJoint>>,
    steps: Vec<Step>,
    joints: Vec<Joint>,
    followers: Vec<Follower>,
}

impl Tree {
    fn of(description: &urdf_rs::Robot) -> std::result::Result<Self, String> {
        let links = by_name("link", description.links.iter().map(|link| link.name.as_str()))?;
        by_name("joint", description.joints.iter().map(|joint| joint.name.as_str()))?;
        let mut joint_above: Vec<Option<usize>> = vec![None; links.len()];
        let mut joints_below: Vec<Vec<usize>> = vec![Vec::new(); links.len()];
        for (index, joint) in description.joints.iter().enumerate() {
            let find = |role: &str, name: &str| {
                links.get(name).copied().ok_or_else(|| {
                    format!(
                        "joint '{}': {role} link '{name}' does not exist; links: {}",
                        joint.name,
                        list(description.links.iter().map(|link| link.name.as_str()))
                    )
                })
            };
            let parent = find("parent", &joint.parent.link)?;
            let child = find("child", &joint.child.link)?;
            if let Some(other) = joint_above[child].replace(index) {
                return Err(format!(
                    "link '{}' has two parents, by joints '{}' and '{}'; a URDF is a tree",
                    joint.child.link, description.joints[other].name, joint.name
                ));
            }
            joints_below[parent].push(index);
        }
        let roots: Vec<usize> = (0..joint_above.len()).filter(|&link| joint_above[link].is_none()).collect();
        let name = |link: usize| description.links[link].name.as_str();
        let root = match roots[..] {
            [root] => root,
            [] if links.is_empty() => return Err("has no links".into()),
            [] => return Err("the joints form a circle: no link is the root".into()),
            _ => {
                return Err(format!(
                    "{} links have no parent joint: {}; exactly one, the root, may have none",
                    roots.len(),
                    list(roots.iter().map(|&link| name(link)))
                ));
            }
        };
        // Depth first, joints in the order of the file.
        let mut order = Vec::new();
        let mut stack = vec![root];
        while let Some(link) = stack.pop() {
            order.push(link);
            for &joint in joints_below[link].iter().rev() {
                if let Some(&child) = links.get(description.joints[joint].child.link.as_str()) {
                    stack.push(child);
                }
            }
        }
        if order.len() < links.len() {
            let lost = (0..links.len()).filter(|link| !order.contains(link));
            return Err(format!("the joints of these links form a circle: {}", list(lost.map(name))));
        }
        let mut position = vec![0; links.len()];
        for (place, &link) in order.iter().enumerate() {
            position[link] = place;
        }
        let mut tree = Tree {
            parent_joints: Vec::new(),
            steps: Vec::new(),
            joints: Vec::new(),
            followers: Vec::new(),
            order,
        };
        tree.add_joints(description, &joint_above, |link| links.get(link).map_or(0, |&link| position[link]))?;
        Ok(tree)
    }

    /// Steps and movable joints, in the order of the links.
    fn add_joints(
        &mut self,
        description: &urdf_rs::Robot,
        joint_above: &[Option<usize>],
        place: impl Fn(&str) -> usize,
    ) -> std::result::Result<(), String> {
        let mut followers: Vec<(usize, &urdf_rs::Mimic)> = Vec::new();
        for (child, &link) in self.order.iter().enumerate() {
            let Some(joint) = joint_above[link].map(|joint| &description.joints[joint]) else {
                self.parent_joints.push(None);
                self.steps.push(Step {
                    parent: 0,
                    origin: Isometry3::identity(),
                    axis: Vector3::z(),
                    motion: Motion::Fixed,
                });
                continue;
            };
            let about = |message: String| format!("joint '{}': {message}", joint.name);
            let parent = place(&joint.parent.link);
            let origin = pose(&joint.origin).map_err(about)?;
            let kind = match joint.joint_type {
                JointType::Fixed => None,
                JointType::Revolute => Some(JointKind::Revolute),
                JointType::Continuous => Some(JointKind::Continuous),
                JointType::Prismatic => Some(JointKind::Prismatic),
                JointType::Floating | JointType::Planar | JointType::Spherical => {
                    return Err(about(format!(
                        "type {:?} is not supported; use fixed, revolute, continuous or prismatic joints",
                        joint.joint_type
                    )));
                }
            };
            let mut step = Step { parent, origin, axis: Vector3::z(), motion: Motion::Fixed };
            let mut moved_by = None;
            if let Some(kind) = kind {
                let axis = Vector3::from(*joint.axis.xyz);
                let axis = Unit::try_new(axis, 1e-9)
                    .filter(|axis| axis.iter().all(|v| v.is_finite()))
                    .ok_or_else(|| about(format!("axis {:?} has no direction", axis.as_slice())))?;
                step.axis = axis.into_inner();
                let drive = Drive { joint: self.joints.len(), multiplier: 1.0, offset: 0.0 };
                step.motion = match kind {
                    JointKind::Prismatic => Motion::Slide(drive),
                    JointKind::Revolute | JointKind::Continuous => Motion::Turn(drive),
                };
                if let Some(mimic) = &joint.mimic {
                    followers.push((child, mimic));
                    let limits = limits(&joint.limit, kind).map_err(about)?;
                    self.followers.push(Follower { link: child, kind, limits });
                } else {
                    moved_by = Some(drive.joint);
                    self.joints.push(Joint {
                        name: joint.name.clone(),
                        kind,
                        axis,
                        parent,
                        child,
                        origin,
                        limits: limits(&joint.limit, kind).map_err(about)?,
                    });
                }
            }
            self.parent_joints.push(Some(ParentJoint { name: joint.name.clone(), parent, moved_by }));
            self.steps.push(step);
        }
        for (child, mimic) in followers {
            let Some(joint) = self.parent_joints[child].as_mut() else {
                continue;
            };
            let about = format!("joint '{}' mimics '{}'", joint.name, mimic.joint);
            let leader =
                self.joints.iter().position(|leader| leader.name == mimic.joint).ok_or_else(|| {
                    format!(
                        "joint '{}' mimics '{}', which is no movable joint of its own",
                        joint.name, mimic.joint
                    )
                })?;
            let drive = Drive {
                joint: leader,
                multiplier: finite("mimic multiplier", mimic.multiplier.unwrap_or(1.0))?,
                offset: finite("mimic offset", mimic.offset.unwrap_or(0.0))?,
            };
            joint.moved_by = Some(leader);
            self.keep_within(&drive, child, &about);
            let step = &mut self.steps[child];
            step.motion = match step.motion {
                Motion::Slide(_) => Motion::Slide(drive),
                _ => Motion::Turn(drive),
            };
        }
        Ok(())
    }

    /// Narrows the limits of the joint that `drive` names to those within which the follower that moves the link `child` keeps its own.
    fn keep_within(&mut self, drive: &Drive, child: usize, about: &str) {
        let own = self.followers.iter().find(|follower| follower.link == child).map(|own| own.limits);
        // A range of zero is one that was left out.
        let Some(own) = own.filter(|own| own.lower < own.upper && drive.multiplier != 0.0) else {
            return;
        };
        let ends = [own.lower, own.upper].map(|end| (end - drive.offset) / drive.multiplier);
        let leader = &mut self.joints[drive.joint].limits;
        let (lower, upper) = (ends[0].min(ends[1]).max(leader.lower), ends[0].max(ends[1]).min(leader.upper));
        // Hands in the wild have followers whose limits are those of a joint that turns the other way.
        if lower >= upper {
            log::warn!(
                "{about}: its limits {} to {} leave nothing of the other's {} to {}; they are not kept to",
                own.lower,
                own.upper,
                leader.lower,
                leader.upper
            );
            return;
        }
        (leader.lower, leader.upper) = (lower, upper);
    }
}

/// Index of each name; twice the same is an error.
fn by_name<'a>(
    what: &str,
    names: impl Iterator<Item = &'a str>,
) -> std::result::Result<HashMap<&'a str, usize>, String> {
    let mut indices = HashMap::new();
    for (index, name) in names.enumerate() {
        if name.is_empty() {
            return Err(format!("{what} number {} has no name", index + 1));
        }
        if indices.insert(name, index).is_some() {
            return Err(format!("two {what}s are called '{name}'"));
        }
    }
    Ok(indices)
}

fn limits(limit: &urdf_rs::JointLimit, kind: JointKind) -> std::result::Result<JointLimits, String> {
    let [lower, upper, velocity, effort] = [limit.lower, limit.upper, limit.velocity, limit.effort];
    let positive = |v: f64| v >= 0.0;
    if !(lower.is_finite() && upper.is_finite() && positive(velocity) && positive(effort)) {
        return Err(format!(
            "limit lower {lower}, upper {upper}, velocity {velocity}, effort {effort}: the first two must be finite, the last two not negative"
        ));
    }
    if kind == JointKind::Continuous {
        return Ok(JointLimits { lower: f64::NEG_INFINITY, upper: f64::INFINITY, velocity, effort });
    }
    if lower > upper {
        return Err(format!("limit lower {lower} is above upper {upper}"));
    }
    Ok(JointLimits { lower, upper, velocity, effort })
}

fn pose(origin: &urdf_rs::Pose) -> std::result::Result<Isometry3<f64>, String> {
    let ([x, y, z], [roll, pitch, yaw]) = (*origin.xyz, *origin.rpy);
    if ![x, y, z].iter().all(|v| v.abs() < FARTHEST) || ![roll, pitch, yaw].iter().all(|v| v.is_finite()) {
        return Err(format!(
            "origin xyz [{x}, {y}, {z}] rpy [{roll}, {pitch}, {yaw}] is not finite or farther than {FARTHEST} m"
        ));
    }
    Ok(Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_euler_angles(roll, pitch, yaw)))
}

fn finite(what: &str, value: f64) -> std::result::Result<f64, String> {
    if value.is_finite() { Ok(value) } else { Err(format!("{what} {value} is not finite")) }
}

/// Materials that the description defines once and visuals use by name.
fn named_materials(description: &urdf_rs::Robot) -> HashMap<String, Material> {
    let inline = description
        .links
        .iter()
        .flat_map(|link| link.visual.iter().filter_map(|visual| visual.material.as_ref()));
    inline
        .chain(&description.materials)
        .filter(|material| !material.name.is_empty())
        .filter_map(|material| Some((material.name.clone(), own_color(material)?)))
        .collect()
}

fn own_color(material: &urdf_rs::Material) -> Option<Material> {
    let [r, g, b, _] = *material.color.as_ref()?.rgba;
    Some(Material { base_color: [r, g, b].map(|c| c.clamp(0.0, 1.0) as f32), ..Material::default() })
}

type Parts = Vec<(Arc<Mesh>, Option<Material>)>;

/// Builds links; keeps the meshes it has read.
struct Loader<'a> {
    urdf: &'a Path,
    resolver: Resolver,
    materials: HashMap<String, Material>,
    /// By file and scale (as bits).
    parts: HashMap<(PathBuf, [u64; 3]), Parts>,
    summary: LoadSummary,
}

impl Loader<'_> {
    fn link(&mut self, link: &urdf_rs::Link, parent_joint: Option<ParentJoint>) -> Result<Link> {
        let about =
            |urdf: &Path, message: String| Error::invalid(urdf, format!("link '{}': {message}", link.name));
        let (mass, com, inertia) = inertial(&link.inertial).map_err(|message| about(self.urdf, message))?;
        let mut visuals = Vec::new();
        for visual in &link.visual {
            let built =
                self.visual(visual).map_err(|message| about(self.urdf, format!("visual: {message}")))?;
            visuals.extend(built);
            self.summary.visuals += 1;
        }
        let mut collisions = Vec::new();
        for collision in &link.collision {
            let built = self
                .collision(collision)
                .map_err(|message| about(self.urdf, format!("collision: {message}")))?;
            collisions.extend(built);
            self.summary.collisions += 1;
        }
        Ok(Link { name: link.name.clone(), mass, inertia, com, visuals, collisions, parent_joint })
    }

    fn visual(&mut self, visual: &urdf_rs::Visual) -> std::result::Result<Vec<LinkVisual>, String> {
        let pose = pose(&visual.origin)?;
        let material = visual
            .material
            .as_ref()
            .and_then(|material| own_color(material).or_else(|| self.materials.get(&material.name).cloned()));
        if let (Some(named), None) = (&visual.material, &material) {
            log::warn!(
                "{}: a visual has the material '{}', of which no colour is given; it is grey",
                self.urdf.display(),
                named.name
            );
        }
        let own = |mesh: Mesh| vec![(Arc::new(mesh), None)];
        let parts = match &visual.geometry {
            Geometry::Box { size } => own(primitives::cuboid_mesh(sizes(**size)?)),
            Geometry::Cylinder { radius, length } => {
                let [radius, length] = sizes([*radius, *length])?;
                own(primitives::cylinder_mesh(radius, length))
            }
            Geometry::Capsule { radius, length } => {
                let [radius, length] = sizes([*radius, *length])?;
                own(primitives::capsule_mesh(radius, length))
            }
            Geometry::Sphere { radius } => {
                let [radius] = sizes([*radius])?;
                own(primitives::sphere_mesh(radius))
            }
            Geometry::Mesh { filename, scale } => self.mesh(filename, scale.as_ref())?,
        };
        // As RViz does, a mesh's own material goes before the URDF's.
        Ok(parts
            .into_iter()
            .map(|(mesh, own)| LinkVisual {
                pose,
                visual: Arc::new(Visual {
                    mesh,
                    material: own.or_else(|| material.clone()).unwrap_or_default(),
                }),
            })
            .collect())
    }

    fn collision(
        &mut self,
        collision: &urdf_rs::Collision,
    ) -> std::result::Result<Vec<CollisionShape>, String> {
        let pose = pose(&collision.origin)?;
        let geometry = match &collision.geometry {
            Geometry::Box { size } => Convex::Cuboid { half: 0.5 * Vector3::from(sizes(**size)?) },
            Geometry::Cylinder { radius, length } => {
                let [radius, length] = sizes([*radius, *length])?;
                Convex::Cylinder { half_height: 0.5 * length, radius }
            }
            Geometry::Capsule { radius, length } => {
                let [radius, length] = sizes([*radius, *length])?;
                return Ok(primitives::capsule_shapes(&pose, radius, length));
            }
            Geometry::Sphere { radius } => {
                let [radius] = sizes([*radius])?;
                Convex::Sphere { radius }
            }
            Geometry::Mesh { filename, scale } => {
                let parts = self.mesh(filename, scale.as_ref())?;
                let points: Vec<Point3<f32>> =
                    parts.iter().flat_map(|(mesh, _)| mesh.positions.iter().copied()).collect();
                Convex::Hull {
                    points: hull::convex_hull(&points)
                        .map_err(|message| format!("mesh '{filename}' {message}"))?,
                }
            }
        };
        Ok(vec![CollisionShape { pose, geometry }])
    }

    fn mesh(&mut self, filename: &str, scale: Option<&urdf_rs::Vec3>) -> std::result::Result<Parts, String> {
        let scale = scale.map_or([1.0; 3], |scale| **scale);
        if !scale.iter().all(|s| s.abs() > 1e-9 && s.abs() < 1e9) {
            return Err(format!("mesh '{filename}': scale {scale:?} is zero or not finite"));
        }
        let path = self.resolver.resolve(filename).map_err(|message| format!("mesh {message}"))?;
        let key = (path, scale.map(f64::to_bits));
        if let Some(parts) = self.parts.get(&key) {
            return Ok(parts.clone());
        }
        let parts: Parts = mesh_files::load(&key.0, &Vector3::from(scale))
            .map_err(|message| format!("mesh '{filename}' ({}): {message}", key.0.display()))?
            .into_iter()
            .map(|part| (Arc::new(part.mesh), part.material))
            .collect();
        self.parts.insert(key, parts.clone());
        Ok(parts)
    }
}

/// Mass, centre of mass, inertia about it in link axes.
fn inertial(inertial: &urdf_rs::Inertial) -> std::result::Result<(f64, Point3<f64>, Matrix3<f64>), String> {
    let pose = pose(&inertial.origin).map_err(|message| format!("inertial: {message}"))?;
    let mass = finite("mass", inertial.mass.value)?;
    if mass < 0.0 {
        return Err(format!("mass {mass} is negative"));
    }
    let i = &inertial.inertia;
    let own = Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
    if !own.iter().all(|v| v.is_finite()) {
        return Err("inertia has a number that is not finite".into());
    }
    let turn = pose.rotation.to_rotation_matrix();
    Ok((mass, pose.translation.vector.into(), turn.matrix() * own * turn.matrix().transpose()))
}

/// Sizes as they are, when all are positive and of a robot.
fn sizes<const N: usize>(sizes: [f64; N]) -> std::result::Result<[f64; N], String> {
    if sizes.iter().all(|&s| s > 0.0 && s < FARTHEST) {
        Ok(sizes)
    } else {
        Err(format!("geometry sizes {sizes:?} must be positive and below {FARTHEST} m"))
    }
}
