//! The robot in the physics world: kinematic links behind a servo model, two dynamic fingers on force-limited drives.
//!
//! Why kinematic links: an articulated arm of dynamic bodies tracks well but grasps badly in an impulse solver (held
//! objects creep by millimetres); with kinematic links and separate dynamic fingers they hold to hundredths. The price
//! is that such an arm has infinite force, so limits and the protective stop are modelled here.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use parry3d::bounding_volume::BoundingVolume;
use rapier3d::prelude::*;

use crate::contacts::{Body, Contacts};
use crate::error::{Error, Result};
use crate::settings::{FingerSettings, PhysicsSettings, ServoSettings, StopSettings};
use grip_sim::convert;
use grip_sim::robot::{RobotConfig, RobotModel};

const FIXTURE_GROUP: Group = Group::GROUP_1;
const OBJECT_GROUP: Group = Group::GROUP_2;
const LINK_GROUP: Group = Group::GROUP_3;
const FINGER_GROUP: Group = Group::GROUP_4;

/// Groups of fixed bodies.
pub(crate) fn fixture_groups() -> InteractionGroups {
    InteractionGroups::new(FIXTURE_GROUP, OBJECT_GROUP | FINGER_GROUP, InteractionTestMode::And)
}

/// Groups of objects: they meet everything.
pub(crate) fn object_groups() -> InteractionGroups {
    let all = FIXTURE_GROUP | OBJECT_GROUP | LINK_GROUP | FINGER_GROUP;
    InteractionGroups::new(OBJECT_GROUP, all, InteractionTestMode::And)
}

fn link_groups() -> InteractionGroups {
    InteractionGroups::new(LINK_GROUP, OBJECT_GROUP, InteractionTestMode::And)
}

fn finger_groups() -> InteractionGroups {
    InteractionGroups::new(
        FINGER_GROUP,
        FIXTURE_GROUP | OBJECT_GROUP | FINGER_GROUP,
        InteractionTestMode::And,
    )
}

/// What the gripper is told to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Grip {
    /// Open to this distance between the pads, metres.
    Open {
        /// Distance between the pads, metres.
        width: f64,
    },
    /// Close until each finger presses with this force.
    Close {
        /// Force a finger, newtons.
        force_n: f64,
    },
}

/// Why the arm stopped by itself.
#[derive(Debug, Clone, PartialEq)]
pub enum Stop {
    /// A link pressed on an object too hard.
    Force {
        /// The link's name.
        link: String,
        /// Newtons.
        newtons: f64,
    },
    /// A link ran into something fixed.
    Collision {
        /// The link's name.
        link: String,
    },
    /// A joint was told to go where no joint can be.
    Target {
        /// The joint's name.
        joint: String,
        /// Not finite.
        target: f64,
    },
}

impl std::fmt::Display for Stop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Force { link, newtons } => write!(f, "{link} pressed with {newtons:.0} N"),
            Self::Target { joint, target } => write!(f, "{joint} was told to go to {target}"),
            Self::Collision { link } => write!(f, "{link} ran into table, bin or stand"),
        }
    }
}

/// A link's shape inside a fixed solid, by their indices.
#[derive(Debug, Clone, Copy)]
struct Penetration {
    link: usize,
    shape: usize,
    fixed: usize,
    /// Metres.
    depth: f32,
}

/// A finger: a dynamic body on a prismatic drive.
#[derive(Debug, Clone)]
pub(crate) struct Finger {
    pub body: RigidBodyHandle,
    drive: ImpulseJointHandle,
    /// Index of the link in the robot model.
    pub link: usize,
    /// Index of the joint in the configuration.
    joint: usize,
    /// Gripper frame from finger frame with the joint at zero.
    origin: Isometry3<f64>,
    /// Direction of opening in the gripper frame.
    axis: Vector3<f64>,
    /// The same in the finger's frame.
    pressing: Vector3<f64>,
    /// Highest speed of the drive, m/s.
    speed: f64,
    upper: f64,
    /// Against twisting of objects that the pad touches.
    brakes: Vec<(RigidBodyHandle, ImpulseJointHandle)>,
}

/// So stiff that it holds to the limit of its torque, N m s/rad.
const BRAKE_DAMPING: f32 = 1e3;

impl Finger {
    /// Lets the pad resist twisting of an object about the direction in which it presses, with a torque of up to `limit`, N m:
    /// a brake between the two, solved with the contacts.
    pub fn brake(&mut self, physics: &mut PhysicsWorld, object: RigidBodyHandle, limit: f64) {
        let known = self.brakes.iter().position(|(body, _)| *body == object);
        match known {
            None if limit <= 0.0 => {}
            None => {
                let mut brake = GenericJointBuilder::new(JointAxesMask::empty())
                    .local_axis1(convert::vector(&self.pressing))
                    .motor_model(JointAxis::AngX, MotorModel::ForceBased)
                    .motor_velocity(JointAxis::AngX, 0.0, BRAKE_DAMPING)
                    .build();
                brake.set_motor_max_force(JointAxis::AngX, limit as f32);
                self.brakes.push((object, physics.insert_impulse_joint(self.body, object, brake)));
            }
            Some(at) if limit <= 0.0 => {
                physics.remove_impulse_joint(self.brakes.swap_remove(at).1);
            }
            Some(at) => {
                if let Some(joint) = physics.impulse_joints.get_mut(self.brakes[at].1, true) {
                    joint.data.set_motor_max_force(JointAxis::AngX, limit as f32);
                }
            }
        }
    }
}

/// A kinematic link with collision shapes.
#[derive(Debug, Clone)]
struct LinkBody {
    body: RigidBodyHandle,
    link: usize,
    /// Whether any joint can move it.
    moves: bool,
    shapes: Vec<(Pose, SharedShape)>,
}

/// The robot's bodies and the state of its servos.
#[derive(Debug, Clone)]
pub(crate) struct RobotBody {
    servo: ServoSettings,
    stopping: StopSettings,
    driving: FingerSettings,
    model: Arc<RobotModel>,
    world_from_base: Isometry3<f64>,
    /// Gripper link index.
    pub gripper: usize,
    links: Vec<LinkBody>,
    pub fingers: [Finger; 2],
    /// Measured joint positions, all movable joints.
    pub q: Vec<f64>,
    qd: Vec<f64>,
    /// The previous step's target, for feed-forward of its velocity.
    target: Vec<f64>,
    acceleration: Vec<f64>,
    /// rad/(N m) or m/N.
    compliance: Vec<f64>,
    /// How far each servo has given way, radians or metres.
    given: Vec<f64>,
    finger_target: f64,
    pub stop: Option<Stop>,
    /// Control steps in a row with too much force on a link.
    overload: f64,
    /// Control steps for which force may not stop the arm, after a stop was cleared.
    grace: f64,
    /// What the arm was inside of when a stop was cleared: it may back out of that.
    backing_out: Vec<Penetration>,
    /// World poses of all links at `q`, fingers as physics has them.
    pub link_poses: Vec<Isometry3<f64>>,
}

impl RobotBody {
    /// Lets the arm move again after a protective stop. What it has run into no longer stops it, unless it goes deeper.
    pub fn clear_stop(&mut self, fixed: &[(Pose, SharedShape)]) {
        if self.stop.take().is_none() {
            return;
        }
        self.overload = 0.0;
        self.grace = f64::from(self.stopping.grace_steps);
        self.backing_out = self.penetrations(fixed);
    }

    pub fn insert(
        physics: &mut PhysicsWorld,
        model: Arc<RobotModel>,
        config: &RobotConfig,
        world_from_base: Isometry3<f64>,
        q: Vec<f64>,
        settings: &PhysicsSettings,
    ) -> Result<Self> {
        let gripper = config.gripper.link;
        let finger_joints = config.gripper.fingers;
        let finger_links = finger_joints.map(|joint| model.joints()[joint].child);
        let link_poses: Vec<_> =
            model.fk(&q).iter().map(|base_from_link| world_from_base * base_from_link).collect();

        let mut links = Vec::new();
        let mut gripper_body = None;
        for (index, link) in model.links().iter().enumerate() {
            if finger_links.contains(&index) || (link.collisions.is_empty() && index != gripper) {
                continue;
            }
            let pose = convert::pose(&link_poses[index]);
            let body = physics.insert_body(RigidBodyBuilder::kinematic_position_based().pose(pose));
            let mut shapes = Vec::new();
            for shape in &link.collisions {
                let (at, solid) = convert::solid(shape).ok_or_else(|| flat_shape(&model, &link.name))?;
                physics.insert_collider(
                    ColliderBuilder::new(solid.clone())
                        .position(at)
                        .friction(settings.servo.link_friction as f32)
                        .collision_groups(link_groups())
                        .user_data(Body::Link(index).tag()),
                    Some(body),
                );
                shapes.push((at, solid));
            }
            if index == gripper {
                gripper_body = Some(body);
            }
            links.push(LinkBody { body, link: index, moves: is_moved(&model, index), shapes });
        }
        let gripper_body = gripper_body.ok_or_else(|| flat_shape(&model, "the gripper link"))?;
        let fingers = [0, 1].map(|side| {
            insert_finger(physics, &model, config, gripper_body, &link_poses, side, &settings.fingers)
        });
        let [right, left] = fingers;
        let acceleration =
            config.limits.iter().map(|l| l.acceleration * settings.servo.acceleration).collect::<Vec<_>>();
        let compliance = config.compliance.iter().map(|of| of * settings.servo.give).collect();
        let finger_target = q[finger_joints[0]];
        Ok(Self {
            servo: settings.servo.clone(),
            stopping: settings.stop.clone(),
            driving: settings.fingers.clone(),
            gripper,
            links,
            fingers: [right?, left?],
            qd: vec![0.0; q.len()],
            compliance,
            given: vec![0.0; q.len()],
            target: q.clone(),
            q,
            acceleration,
            finger_target,
            stop: None,
            overload: 0.0,
            grace: 0.0,
            backing_out: Vec::new(),
            link_poses,
            world_from_base,
            model,
        })
    }

    /// Gives way to a force on the hand, newtons, world frame: controllers without an integral part keep an error of load by stiffness,
    /// and compensate the arm's own weight alone.
    pub fn give_way(&mut self, hand_force: &Vector3<f64>, dt: f64) {
        let share = dt / (self.servo.give_s + dt);
        self.given.iter_mut().for_each(|given| *given -= share * *given);
        if *hand_force != Vector3::zeros() {
            let joints: Vec<usize> = (0..self.q.len()).filter(|&i| self.compliance[i] > 0.0).collect();
            let force = self.world_from_base.inverse() * hand_force;
            let jacobian = self.model.jacobian(&self.q, self.gripper, &joints);
            for (column, &joint) in joints.iter().enumerate() {
                let load = jacobian.fixed_view::<3, 1>(0, column).dot(&force);
                self.given[joint] += share * load * self.compliance[joint];
            }
        }
    }

    /// One servo step towards `target` (all movable joints; fingers are driven by `grip` instead).
    ///
    /// Moves joints within position, velocity and acceleration limits and hands the new link poses to rapier.
    pub fn drive(&mut self, physics: &mut PhysicsWorld, target: &[f64], grip: Grip, dt: f64) {
        let mut moved = false;
        for (i, joint) in self.model.joints().iter().enumerate() {
            if self.fingers.iter().any(|f| f.joint == i) {
                continue;
            }
            if self.stop.is_none() && !target[i].is_finite() {
                self.stop = Some(Stop::Target { joint: joint.name.clone(), target: target[i] });
            }
            let goal = if self.stop.is_some() { self.q[i] } else { joint.limits.clamp(target[i]) };
            let feed_forward = if self.stop.is_some() { 0.0 } else { (goal - self.target[i]) / dt };
            let limit = joint.limits.velocity;
            // One that was stopped stays where it is.
            let given = if self.stop.is_some() { 0.0 } else { self.given[i] };
            let error = self.target[i] + given - self.q[i];
            let wanted = (feed_forward + self.servo.bandwidth * error).clamp(-limit, limit);
            let step = self.acceleration[i] * dt;
            self.qd[i] += (wanted - self.qd[i]).clamp(-step, step);
            let next = joint.limits.clamp(self.q[i] + self.qd[i] * dt);
            moved |= (next - self.q[i]).abs() > 1e-12;
            self.q[i] = next;
            self.target[i] = goal;
        }
        if moved {
            let poses = self.model.fk(&self.q);
            for link in self.links.iter().filter(|l| l.moves) {
                let world_from_link = self.world_from_base * poses[link.link];
                self.link_poses[link.link] = world_from_link;
                if let Some(body) = physics.bodies.get_mut(link.body) {
                    body.set_next_kinematic_position(convert::pose(&world_from_link));
                }
            }
            for (index, pose) in poses.iter().enumerate() {
                if !self.fingers.iter().any(|f| f.link == index) {
                    self.link_poses[index] = self.world_from_base * pose;
                }
            }
        }
        self.drive_fingers(physics, grip, dt);
    }

    /// Both drives follow one target, so that the fingers stay centred as the real controller keeps them. When closing
    /// the target runs ahead of the fingers until the spring between them presses with the wanted force.
    fn drive_fingers(&mut self, physics: &mut PhysicsWorld, grip: Grip, dt: f64) {
        let stiffness = self.driving.stiffness;
        let mean = (self.q[self.fingers[0].joint] + self.q[self.fingers[1].joint]) / 2.0;
        let step = self.fingers[0].speed * dt;
        let (goal, force) = match grip {
            Grip::Open { width } => {
                ((width / 2.0).clamp(0.0, self.fingers[0].upper), self.driving.opening_force_n)
            }
            Grip::Close { force_n } => (mean - force_n / stiffness, force_n),
        };
        self.finger_target += (goal - self.finger_target).clamp(-step, step);
        for finger in &self.fingers {
            if let Some(joint) = physics.impulse_joints.get_mut(finger.drive, true) {
                let data = &mut joint.data;
                data.set_motor(
                    JointAxis::LinX,
                    self.finger_target as f32,
                    0.0,
                    stiffness as f32,
                    self.driving.damping as f32,
                );
                data.set_motor_max_force(JointAxis::LinX, self.driving.force_margin as f32 * force as f32);
            }
        }
    }

    /// Reads back where the fingers are and decides on the protective stop. Call after each physics step, `share` of a control step.
    pub fn sense(
        &mut self,
        physics: &PhysicsWorld,
        contacts: &Contacts,
        fixed: &[(Pose, SharedShape)],
        share: f64,
    ) {
        let world_from_gripper = self.link_poses[self.gripper];
        for finger in &self.fingers {
            if let Some(body) = physics.bodies.get(finger.body) {
                let world_from_finger = convert::from_pose(body.position());
                let gripper_from_finger = world_from_gripper.inverse() * world_from_finger;
                let slide = gripper_from_finger.translation.vector - finger.origin.translation.vector;
                self.q[finger.joint] = slide.dot(&finger.axis);
                self.link_poses[finger.link] = world_from_finger;
            }
        }
        let overloaded = contacts.link_force.is_some_and(|(newtons, _)| newtons > self.stopping.force_n);
        self.grace = (self.grace - share).max(0.0);
        self.overload = if overloaded && self.grace == 0.0 { self.overload + share } else { 0.0 };
        if self.stop.is_none() {
            self.stop = self.reason_to_stop(contacts, fixed);
        }
    }

    /// Kinematic bodies make no contacts with fixed ones, so arm against table and bin is asked of parry here.
    fn reason_to_stop(&self, contacts: &Contacts, fixed: &[(Pose, SharedShape)]) -> Option<Stop> {
        if let Some((newtons, link)) =
            contacts.link_force.filter(|_| self.overload >= f64::from(self.stopping.steps))
        {
            return Some(Stop::Force { link: self.model.links()[link].name.clone(), newtons });
        }
        if self.qd.iter().all(|v| v.abs() < 1e-6) {
            return None;
        }
        let deeper = |hit: &Penetration| {
            let known = self
                .backing_out
                .iter()
                .find(|b| (b.link, b.shape, b.fixed) == (hit.link, hit.shape, hit.fixed));
            known.is_none_or(|before| hit.depth > before.depth + self.stopping.deeper_m as f32)
        };
        let hit = self.penetrations(fixed).into_iter().find(deeper)?;
        Some(Stop::Collision { link: self.model.links()[self.links[hit.link].link].name.clone() })
    }

    /// Every shape of a moving link that is inside a fixed solid.
    fn penetrations(&self, fixed: &[(Pose, SharedShape)]) -> Vec<Penetration> {
        let mut found = Vec::new();
        for (index, link) in self.links.iter().enumerate().filter(|(_, l)| l.moves) {
            let world_from_link = convert::pose(&self.link_poses[link.link]);
            for (shape, (at, solid)) in link.shapes.iter().enumerate() {
                let pose = world_from_link * *at;
                let bounds = solid.compute_aabb(&pose);
                for (other, (fixed_pose, fixed_solid)) in fixed.iter().enumerate() {
                    if !bounds.intersects(&fixed_solid.compute_aabb(fixed_pose)) {
                        continue;
                    }
                    let contact = parry3d::query::contact(&pose, &**solid, fixed_pose, &**fixed_solid, 0.0);
                    if let Ok(Some(contact)) = contact {
                        found.push(Penetration { link: index, shape, fixed: other, depth: -contact.dist });
                    }
                }
            }
        }
        found
    }

    /// Where the joints were told to go last.
    pub fn target(&self) -> &[f64] {
        &self.target
    }

    /// Joint velocities, all movable joints.
    pub fn velocities(&self) -> &[f64] {
        &self.qd
    }

    /// Finger positions, right and left, metres from closed.
    pub fn finger_positions(&self) -> [f64; 2] {
        [self.q[self.fingers[0].joint], self.q[self.fingers[1].joint]]
    }

    /// Force with which the drives press, newtons a finger; negative when they pull open.
    pub fn grip_force(&self) -> f64 {
        let [right, left] = self.finger_positions();
        self.driving.stiffness * ((right + left) / 2.0 - self.finger_target)
    }
}

fn flat_shape(model: &RobotModel, link: &str) -> Error {
    Error::Robot {
        robot: model.name().to_string(),
        message: format!(
            "{link}: a collision shape has no volume; give it a box, cylinder, sphere or a closed mesh"
        ),
    }
}

/// Whether some joint between the root and `link` moves.
fn is_moved(model: &RobotModel, link: usize) -> bool {
    let mut at = link;
    while let Some(joint) = &model.links()[at].parent_joint {
        if joint.moved_by.is_some() {
            return true;
        }
        at = joint.parent;
    }
    false
}

/// The same box with edges of radius `edge`, metres; any other solid as it is.
fn rounded(solid: SharedShape, edge: f32) -> SharedShape {
    match solid.as_cuboid().map(|cuboid| cuboid.half_extents) {
        Some(half) if edge > 0.0 && half.min_element() > 2.0 * edge => {
            let flat = half - Vector::splat(edge);
            SharedShape::round_cuboid(flat.x, flat.y, flat.z, edge)
        }
        _ => solid,
    }
}

fn insert_finger(
    physics: &mut PhysicsWorld,
    model: &RobotModel,
    config: &RobotConfig,
    gripper_body: RigidBodyHandle,
    link_poses: &[Isometry3<f64>],
    side: usize,
    settings: &FingerSettings,
) -> Result<Finger> {
    let joint = config.gripper.fingers[side];
    let data = &model.joints()[joint];
    let link = data.child;
    let pose = convert::pose(&link_poses[link]);
    let body = physics.insert_body(
        RigidBodyBuilder::dynamic()
            .pose(pose)
            .gravity_scale(0.0)
            .can_sleep(false)
            .additional_mass_properties(MassProperties::new(
                Vector::ZERO,
                settings.mass_kg as f32,
                Vector::splat(settings.inertia as f32),
            )),
    );
    for shape in &model.links()[link].collisions {
        let (at, solid) =
            convert::solid(shape).ok_or_else(|| flat_shape(model, &model.links()[link].name))?;
        physics.insert_collider(
            ColliderBuilder::new(rounded(solid, settings.edge_m as f32))
                .position(at)
                .density(0.0)
                .friction(settings.pad_friction as f32)
                .collision_groups(finger_groups())
                // For `EvenPads`. Also, contact recycling makes held objects creep, and a pair with hooks is never recycled.
                .active_hooks(ActiveHooks::MODIFY_SOLVER_CONTACTS)
                .user_data(Body::Finger(side).tag()),
            Some(body),
        );
    }
    let axis = data.origin.rotation * data.axis.into_inner();
    let local_axis2 = data.axis.into_inner();
    let mut drive = GenericJointBuilder::new(JointAxesMask::LOCKED_PRISMATIC_AXES)
        .local_axis1(convert::vector(&axis))
        .local_axis2(convert::vector(&local_axis2))
        .local_anchor1(convert::vector(&data.origin.translation.vector))
        .local_anchor2(Vector::ZERO)
        .limits(JointAxis::LinX, [data.limits.lower as f32, data.limits.upper as f32])
        .motor_model(JointAxis::LinX, MotorModel::ForceBased)
        .contacts_enabled(false)
        .build();
    // The axis alone says not how a finger is turned about it.
    if data.origin.rotation.angle() > 0.0 {
        let turned = convert::pose(&data.origin).rotation;
        drive.local_frame2.rotation = turned.inverse() * drive.local_frame1.rotation;
    }
    let drive = physics.insert_impulse_joint(gripper_body, body, drive);
    Ok(Finger {
        body,
        drive,
        link,
        joint,
        origin: data.origin,
        axis,
        pressing: data.axis.into_inner(),
        speed: config.limits[joint].velocity,
        upper: data.limits.upper,
        brakes: Vec::new(),
    })
}
