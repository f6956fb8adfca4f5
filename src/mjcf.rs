//! Scenes as MuJoCo reads them (MJCF): the same convex pieces, masses and frictions, so that another engine can be asked what holds.
//!
//! World frame and units are ours: metres, z up. What is not the same, because MuJoCo has no such thing: the coefficient of a contact
//! is the larger of the two sides' (ours: their mean), but between fingers and objects, where it is given for each pair; rolling
//! resistance; the protective stop. A pad's torsional friction is that of `physics.fingers.torsion_m`.

use std::f64::consts::TAU;
use std::fmt::Write;

use anyhow::{Result, ensure};
use grip_physics::PhysicsSettings;
use grip_sim::convert;
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Object, Pose, World};
use grip_sim::robot::{JointKind, RobotConfig, RobotModel};
use grip_sim::scene::Scene;
use grip_sim::shape::{CollisionShape, Convex};
use nalgebra::{Isometry3, Matrix3, Point3};

use crate::cell::Cell;

/// Bits of what a geom is (`contype`) and of what it meets (`conaffinity`), as the physics world groups them.
const FIXTURE: [u32; 2] = [1, 8];
const OBJECT: [u32; 2] = [2, 15];
const LINK: [u32; 2] = [4, 0];
const FINGER: [u32; 2] = [8, 8];

/// How much of the robot there is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Robot<'a> {
    /// All links, with a position drive on each joint, at this configuration.
    Whole(&'a [f64]),
    /// The gripper's link as a heavy free body that hangs in the air at this configuration, and the fingers on it.
    Hand(&'a [f64]),
}

/// What cylinders are written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cylinders {
    /// Themselves.
    Cylinders,
    /// Prisms of many sides: where an edge of a finger meets a cylinder MuJoCo 4.0 takes the finger's face for the contact's, and
    /// fingers slip over what they should pinch.
    Prisms,
}

/// Sides of a prism.
const SIDES: u32 = 48;

/// The file's text: table, bin, blocks, robot, and the objects where they are.
///
/// # Errors
/// When a collision piece has no volume, or the robot has a joint that follows another.
pub fn write(
    cell: &Cell,
    robot: Robot<'_>,
    objects: &[(&ObjectModel, Pose<World, Object>)],
    physics: &PhysicsSettings,
    cylinders: Cylinders,
) -> Result<String> {
    let mut file = File { prisms: cylinders == Cylinders::Prisms, ..File::default() };
    file.fixtures(&cell.scene, physics)?;
    let mut actuators = String::new();
    let fingers = file.robot(cell, robot, physics, &mut actuators)?;
    let places = cell.scene.objects.places(objects.iter().map(|(model, _)| model.info.name.as_str()));
    for (index, ((model, pose), place)) in objects.iter().zip(places).enumerate() {
        let frozen = place.is_some_and(|place| place.frozen);
        let pieces = file.object(index, model, pose, frozen)?;
        let friction = 0.5 * (physics.fingers.pad_friction + model.info.friction);
        let torsion = friction * physics.fingers.torsion_m;
        for finger in &fingers {
            for piece in &pieces {
                writeln!(
                    file.pairs,
                    "    <pair geom1=\"{finger}\" geom2=\"{piece}\" condim=\"4\" friction=\"{friction} {friction} {torsion} 0 0\"/>"
                )?;
            }
        }
    }
    let File { assets, bodies, pairs, q, ctrl, .. } = file;
    Ok(format!(
        "<mujoco model=\"{name}\">\n  <compiler angle=\"radian\" autolimits=\"true\"/>\n  \
         <option timestep=\"0.001\" integrator=\"implicitfast\" cone=\"elliptic\" noslip_iterations=\"3\"/>\n  \
         <default><geom condim=\"3\" solref=\"0.004 1\"/></default>\n  <asset>\n{assets}  </asset>\n  <worldbody>\n    \
         <light pos=\"0 0 3\"/>\n{bodies}  </worldbody>\n  <contact>\n{pairs}  </contact>\n  <actuator>\n{actuators}  </actuator>\n  \
         <keyframe>\n    <key name=\"start\" qpos=\"{qpos}\" ctrl=\"{ctrl}\"/>\n  </keyframe>\n</mujoco>\n",
        name = escaped(&cell.scene.name),
        qpos = numbers(&q),
        ctrl = numbers(&ctrl),
    ))
}

#[derive(Default)]
struct File {
    assets: String,
    bodies: String,
    pairs: String,
    meshes: usize,
    prisms: bool,
    /// Of all joints in the order of the file, and of the drives.
    q: Vec<f64>,
    ctrl: Vec<f64>,
}

impl File {
    fn fixtures(&mut self, scene: &Scene, physics: &PhysicsSettings) -> Result<()> {
        let friction = physics.objects.floor_friction;
        writeln!(
            self.bodies,
            "    <geom name=\"floor\" type=\"plane\" size=\"5 5 0.1\" friction=\"{friction} 0 0\" {}/>",
            bits(FIXTURE)
        )?;
        for (index, fixture) in scene.fixtures().iter().enumerate() {
            let extra =
                format!("friction=\"{} 0 0\" rgba=\"0.7 0.6 0.5 1\" {}", fixture.friction, bits(FIXTURE));
            self.geom(&format!("fixture_{index}"), &fixture.shape, &extra, 2)?;
        }
        Ok(())
    }

    /// The names of its geoms.
    fn object(
        &mut self,
        index: usize,
        model: &ObjectModel,
        pose: &Pose<World, Object>,
        frozen: bool,
    ) -> Result<Vec<String>> {
        let name = escaped(&format!("{}_{index}", model.info.name));
        let volumes: Vec<f64> = model
            .collision
            .iter()
            .map(|piece| {
                convert::solid(piece).map_or(0.0, |(_, solid)| f64::from(solid.mass_properties(1.0).mass()))
            })
            .collect();
        let all: f64 = volumes.iter().sum();
        ensure!(all > 0.0, "{}: a collision piece has no volume; check its mesh", model.info.name);
        writeln!(
            self.bodies,
            "    <body name=\"{name}\" {}>\n{}",
            place(pose.iso()),
            if frozen { String::new() } else { format!("      <freejoint name=\"{name}\"/>") }
        )?;
        if !frozen {
            self.q.extend(pose_numbers(pose.iso()));
        }
        let mut pieces = Vec::new();
        for (number, (piece, volume)) in model.collision.iter().zip(volumes).enumerate() {
            let geom = format!("{name}_{number}");
            let mass = model.info.mass_kg * volume / all;
            let extra = format!(
                "mass=\"{mass}\" friction=\"{} 0 0\" rgba=\"0.4 0.6 0.8 1\" {}",
                model.info.friction,
                bits(OBJECT)
            );
            self.geom(&geom, piece, &extra, 3)?;
            pieces.push(geom);
        }
        writeln!(self.bodies, "    </body>")?;
        Ok(pieces)
    }

    /// The names of the fingers' geoms.
    fn robot(
        &mut self,
        cell: &Cell,
        part: Robot<'_>,
        physics: &PhysicsSettings,
        actuators: &mut String,
    ) -> Result<Vec<String>> {
        let (model, config) = (&cell.robot, &cell.config);
        let mut fingers = Vec::new();
        match part {
            Robot::Whole(q) => {
                let base = *cell.scene.world_from_base().iso();
                let poses = model.fk(q);
                let mut tree = Tree { model, config, physics, q, poses, actuators, fingers: &mut fingers };
                self.link(&mut tree, 0, &base, 2)?;
            }
            Robot::Hand(q) => {
                let hand = config.gripper.link;
                let at = cell.scene.world_from_base().iso() * model.fk_link(q, hand);
                writeln!(
                    self.bodies,
                    "    <body name=\"hand\" {} gravcomp=\"1\">\n      <freejoint name=\"hand\"/>",
                    place(&at)
                )?;
                self.q.extend(pose_numbers(&at));
                // So heavy that nothing moves it.
                writeln!(
                    self.bodies,
                    "      <inertial pos=\"0 0 0\" mass=\"1e4\" diaginertia=\"1e3 1e3 1e3\"/>"
                )?;
                self.link_geoms(model, hand, LINK, physics.servo.link_friction, 3)?;
                let poses = model.fk(q);
                // Where the gripper's frame is one of its own, its body is that of the link that carries it.
                if let Some(joint) = model.links()[hand]
                    .parent_joint
                    .as_ref()
                    .filter(|joint| joint.moved_by.is_none() && model.links()[hand].collisions.is_empty())
                {
                    let palm = joint.parent;
                    let at = poses[hand].inverse() * poses[palm];
                    writeln!(
                        self.bodies,
                        "      <body name=\"{}\" {}>",
                        escaped(&model.links()[palm].name),
                        place(&at)
                    )?;
                    self.link_geoms(model, palm, LINK, physics.servo.link_friction, 4)?;
                    writeln!(self.bodies, "      </body>")?;
                }
                let mut tree = Tree { model, config, physics, q, poses, actuators, fingers: &mut fingers };
                for joint in config.gripper.fingers {
                    let joint = &model.joints()[joint];
                    let origin = tree.poses[hand].inverse() * tree.poses[joint.parent] * joint.origin;
                    self.link(&mut tree, joint.child, &origin, 3)?;
                }
                writeln!(self.bodies, "    </body>")?;
            }
        }
        Ok(fingers)
    }

    /// A link and all that hangs on it.
    fn link(&mut self, tree: &mut Tree<'_>, index: usize, at: &Isometry3<f64>, depth: usize) -> Result<()> {
        let (model, config) = (tree.model, tree.config);
        let link = &model.links()[index];
        let indent = "  ".repeat(depth);
        let joint = link.parent_joint.as_ref().and_then(|parent| parent.moved_by);
        let finger = joint.is_some_and(|joint| config.gripper.fingers.contains(&joint));
        writeln!(
            self.bodies,
            "{indent}<body name=\"{}\" {} gravcomp=\"1\">",
            escaped(&link.name),
            place(at)
        )?;
        if let Some(number) = joint {
            let joint = &model.joints()[number];
            ensure!(
                joint.child == index,
                "joint of link {}: follows another joint, which is not written",
                link.name
            );
            self.joint(tree, number, finger, &indent)?;
        }
        let (mass, inertia) = if finger {
            let fingers = &tree.physics.fingers;
            (fingers.mass_kg, Matrix3::identity() * fingers.inertia)
        } else {
            (link.mass, link.inertia)
        };
        // A moving body must have a mass, which mere frames lack.
        let (mass, inertia) = if mass > 0.0 { (mass, inertia) } else { (1e-3, Matrix3::identity() * 1e-6) };
        writeln!(
            self.bodies,
            "{indent}  <inertial pos=\"{}\" mass=\"{mass}\" fullinertia=\"{}\"/>",
            numbers(link.com.coords.as_slice()),
            numbers(&[
                inertia[(0, 0)],
                inertia[(1, 1)],
                inertia[(2, 2)],
                inertia[(0, 1)],
                inertia[(0, 2)],
                inertia[(1, 2)]
            ])
        )?;
        let (bits, friction) = if finger {
            (FINGER, tree.physics.fingers.pad_friction)
        } else {
            (LINK, tree.physics.servo.link_friction)
        };
        let geoms = self.link_geoms(model, index, bits, friction, depth + 1)?;
        if finger {
            tree.fingers.extend(geoms);
        }
        for (child, other) in model.links().iter().enumerate() {
            if let Some(parent) = other.parent_joint.as_ref().filter(|joint| joint.parent == index) {
                // Where the joint is at zero.
                let origin = match parent.moved_by {
                    Some(joint) => model.joints()[joint].origin,
                    None => tree.poses[index].inverse() * tree.poses[child],
                };
                self.link(tree, child, &origin, depth + 1)?;
            }
        }
        writeln!(self.bodies, "{indent}</body>")?;
        Ok(())
    }

    fn joint(&mut self, tree: &mut Tree<'_>, number: usize, finger: bool, indent: &str) -> Result<()> {
        let joint = &tree.model.joints()[number];
        let kind = if joint.kind == JointKind::Prismatic { "slide" } else { "hinge" };
        let range = if joint.kind == JointKind::Continuous {
            String::new()
        } else {
            format!(" range=\"{} {}\"", joint.limits.lower, joint.limits.upper)
        };
        self.q.push(tree.q[number]);
        self.ctrl.push(tree.q[number]);
        writeln!(
            self.bodies,
            "{indent}  <joint name=\"{}\" type=\"{kind}\" axis=\"{}\"{range}/>",
            escaped(&joint.name),
            numbers(joint.axis.as_slice())
        )?;
        let (stiffness, damping) = if finger {
            (tree.physics.fingers.stiffness, tree.physics.fingers.damping)
        } else {
            (2000.0, 200.0)
        };
        let effort = joint.limits.effort;
        let force =
            if effort.is_finite() { format!(" forcerange=\"-{effort} {effort}\"") } else { String::new() };
        writeln!(
            tree.actuators,
            "    <position name=\"{0}\" joint=\"{0}\" kp=\"{stiffness}\" kv=\"{damping}\"{1}/>",
            escaped(&joint.name),
            force
        )?;
        Ok(())
    }

    fn link_geoms(
        &mut self,
        model: &RobotModel,
        link: usize,
        group: [u32; 2],
        friction: f64,
        depth: usize,
    ) -> Result<Vec<String>> {
        let link = &model.links()[link];
        let mut names = Vec::new();
        for (number, shape) in link.collisions.iter().enumerate() {
            let name = escaped(&format!("{}_{number}", link.name));
            let extra =
                format!("mass=\"0\" friction=\"{friction} 0 0\" rgba=\"0.5 0.5 0.55 1\" {}", bits(group));
            self.geom(&name, shape, &extra, depth)?;
            names.push(name);
        }
        Ok(names)
    }

    fn geom(&mut self, name: &str, shape: &CollisionShape, extra: &str, depth: usize) -> Result<()> {
        let solid = match &shape.geometry {
            Convex::Cuboid { half } => format!("type=\"box\" size=\"{}\"", numbers(half.as_slice())),
            Convex::Cylinder { half_height, radius } if self.prisms => {
                let rim = (0..SIDES).map(|k| (f64::from(k) / f64::from(SIDES) * TAU).sin_cos());
                let corner = |(sin, cos): (f64, f64)| {
                    [-half_height, *half_height].map(|z| Point3::new(radius * cos, radius * sin, z))
                };
                self.hull(&rim.flat_map(corner).collect::<Vec<_>>())?
            }
            Convex::Cylinder { half_height, radius } => {
                format!("type=\"cylinder\" size=\"{radius} {half_height}\"")
            }
            Convex::Sphere { radius } => format!("type=\"sphere\" size=\"{radius}\""),
            Convex::Hull { points } => self.hull(points)?,
        };
        let indent = "  ".repeat(depth);
        writeln!(self.bodies, "{indent}<geom name=\"{name}\" {solid} {} {extra}/>", place(&shape.pose))?;
        Ok(())
    }
}

impl File {
    /// A mesh of these corners; what a geom says of it.
    fn hull(&mut self, points: &[Point3<f64>]) -> Result<String> {
        let mesh = format!("hull_{}", self.meshes);
        self.meshes += 1;
        let all: Vec<f64> = points.iter().flat_map(|point| point.coords.iter().copied()).collect();
        writeln!(self.assets, "    <mesh name=\"{mesh}\" inertia=\"convex\" vertex=\"{}\"/>", numbers(&all))?;
        Ok(format!("type=\"mesh\" mesh=\"{mesh}\""))
    }
}

/// What is the same for all links.
struct Tree<'a> {
    model: &'a RobotModel,
    config: &'a RobotConfig,
    physics: &'a PhysicsSettings,
    q: &'a [f64],
    /// Of all links, in the robot's base.
    poses: Vec<Isometry3<f64>>,
    actuators: &'a mut String,
    fingers: &'a mut Vec<String>,
}

/// A name of others as the value of an attribute.
fn escaped(name: &str) -> String {
    name.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

fn bits([is, meets]: [u32; 2]) -> String {
    format!("contype=\"{is}\" conaffinity=\"{meets}\"")
}

/// `pos="..." quat="..."`, the quaternion's real part first.
fn place(pose: &Isometry3<f64>) -> String {
    let [at @ .., w, x, y, z] = pose_numbers(pose);
    format!("pos=\"{}\" quat=\"{}\"", numbers(&at), numbers(&[w, x, y, z]))
}

fn pose_numbers(pose: &Isometry3<f64>) -> [f64; 7] {
    let (t, q) = (pose.translation.vector, pose.rotation);
    [t.x, t.y, t.z, q.w, q.i, q.j, q.k]
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setup::{Setup, SetupOptions};

    #[test]
    fn names_of_others_leave_the_file_whole() {
        let mut setup = Setup::load(&SetupOptions::default()).unwrap();
        let name = "a \"b\" & <c>";
        setup.cell.scene.name = name.to_owned();
        let mut model = (*setup.models[0]).clone();
        model.info.name = name.to_owned();
        for robot in [Robot::Whole(&setup.cell.start), Robot::Hand(&setup.cell.start)] {
            let at = Pose::from_xyz_rpy([0.6, 0.0, 0.7], [0.0; 3]);
            let physics = &setup.settings.physics;
            let text = write(&setup.cell, robot, &[(&model, at)], physics, Cylinders::Cylinders).unwrap();
            let file = roxmltree::Document::parse(&text).unwrap();
            assert_eq!(file.root_element().attribute("model"), Some(name));
            let bodies = file.descendants().filter(|node| node.has_tag_name("body"));
            let named =
                bodies.filter_map(|body| body.attribute("name")).filter(|of| *of == format!("{name}_0"));
            assert_eq!(named.count(), 1);
        }
    }
}
