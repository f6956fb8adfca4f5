//! [`World`]: building, stepping, truth and state hash.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use rapier3d::prelude::*;
use sha2::{Digest, Sha256};

use crate::blows::Blows;
use crate::contacts::{Body, Contacts, ObjectContacts};
use crate::error::{Error, Result};
use crate::faces::whole_faces;
use crate::pads::{self, EvenPads};
use crate::robot_body::{Grip, RobotBody, Stop, fixture_groups, object_groups};
use crate::settings::{PhysicsSettings, SolverSettings};
use grip_sim::convert;
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Object, Pose as FramePose, World as WorldFrame};
use grip_sim::robot::{RobotConfig, RobotModel};
use grip_sim::scene::{FixtureKind, Scene};

/// Physics steps a second, and control steps. No setting: plans are timed for it. Measured as the coarsest step at which grasps hold without creep.
pub const STEP_HZ: u32 = 240;

/// An object and where it is.
pub type Placed = (Arc<ObjectModel>, FramePose<WorldFrame, Object>);

/// How settling ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settled {
    /// Simulated seconds it took.
    pub seconds: f64,
    /// Whether everything came to rest within the time given.
    pub at_rest: bool,
}

/// An object in the world.
#[derive(Debug, Clone)]
pub(crate) struct ObjectBody {
    pub model: Arc<ObjectModel>,
    pub body: RigidBodyHandle,
    /// Largest normal force by any one body since the last reset, newtons.
    pub peak_force: f64,
    /// By everything but the fingers.
    pub blows: Blows,
    /// Half of the object's middle extent: the lever arm of rolling resistance scales with it.
    radius: f64,
}

/// Everything that physics moves, and the truth about it.
pub struct World {
    settings: PhysicsSettings,
    pub(crate) physics: PhysicsWorld,
    pub(crate) robot: RobotBody,
    pub(crate) robot_model: Arc<RobotModel>,
    pub(crate) objects: Vec<ObjectBody>,
    fixed: Vec<(Pose, SharedShape)>,
    /// Which fixtures are parts of the bin.
    bin_parts: Vec<usize>,
    contacts: Contacts,
    steps: u64,
    step_hz: u32,
    for_layout: bool,
}

impl World {
    /// Builds table, bin, floor and robot; no objects yet. `q` holds all movable joints of the robot.
    ///
    /// # Errors
    /// When a collision shape has no volume, `q` has the wrong length or a value that is not finite, or a setting is out of
    /// its range.
    pub fn new(
        scene: &Scene,
        robot: Arc<RobotModel>,
        config: &RobotConfig,
        q: Vec<f64>,
        settings: &PhysicsSettings,
    ) -> Result<Self> {
        settings.validate().map_err(|message| Error::World(format!("physics settings: {message}")))?;
        if q.len() != robot.joints().len() || q.iter().any(|v| !v.is_finite()) {
            return Err(Error::World(format!(
                "start configuration {q:?}: need {} finite values",
                robot.joints().len()
            )));
        }
        let mut physics = PhysicsWorld { gravity: Vector::new(0.0, 0.0, -9.81), ..PhysicsWorld::default() };
        tune(&mut physics.integration_parameters, &settings.solver);

        let fixtures = scene.fixtures();
        let mut fixed = Vec::new();
        for (index, fixture) in fixtures.iter().enumerate() {
            let (pose, solid) = convert::solid(&fixture.shape)
                .ok_or_else(|| Error::World(format!("fixture {:?} has no volume", fixture.kind)))?;
            insert_fixed(&mut physics, pose, solid.clone(), fixture.friction, index);
            fixed.push((pose, solid));
        }
        let floor = Pose::from_parts(Vector::new(0.0, 0.0, -0.5), Rotation::IDENTITY);
        let friction = settings.objects.floor_friction;
        insert_fixed(&mut physics, floor, SharedShape::cuboid(10.0, 10.0, 0.5), friction, fixtures.len());

        let bin_parts =
            (0..fixtures.len()).filter(|&i| matches!(fixtures[i].kind, FixtureKind::Bin(_))).collect();
        let base = *scene.world_from_base().iso();
        let robot_body = RobotBody::insert(&mut physics, robot.clone(), config, base, q, settings)?;
        Ok(Self {
            settings: settings.clone(),
            physics,
            robot: robot_body,
            robot_model: robot,
            objects: Vec::new(),
            fixed,
            bin_parts,
            contacts: Contacts::default(),
            steps: 0,
            step_hz: STEP_HZ,
            for_layout: false,
        })
    }

    /// The same world for laying things out, not for grasps: see [`LayoutSettings`](crate::LayoutSettings).
    #[must_use]
    pub fn for_layout(mut self) -> Self {
        self.step_hz = STEP_HZ / 3;
        let parameters = &mut self.physics.integration_parameters;
        parameters.dt = 1.0 / self.step_hz as f32;
        parameters.num_solver_iterations = self.settings.layout.iterations;
        parameters.normalized_contact_recycle_distance = self.settings.layout.contact_recycle_m as f32;
        // Nothing falls far enough to pass through the table within a step.
        parameters.max_ccd_substeps = 0;
        // The hand has nothing to do.
        for finger in &self.robot.fingers {
            if let Some(body) = self.physics.bodies.get_mut(finger.body) {
                body.set_body_type(RigidBodyType::Fixed, false);
            }
        }
        self.for_layout = true;
        self
    }

    /// Lets the air out again, and wakes everything: what only the oil held goes on moving.
    pub(crate) fn thin_air(&mut self) {
        if !self.for_layout {
            return;
        }
        for object in &self.objects {
            if let Some(body) = self.physics.bodies.get_mut(object.body) {
                body.set_linear_damping(self.settings.objects.linear_damping as f32);
                body.set_angular_damping(self.settings.objects.angular_damping as f32);
                // Nothing may fall asleep while it slowly tips.
                body.activation_mut().normalized_linear_threshold = -1.0;
                body.wake_up(true);
            }
        }
    }

    /// Adds an object at rest and returns its index.
    ///
    /// # Errors
    /// When the object has no solid, or the pose is not finite.
    pub fn add_object(
        &mut self,
        model: Arc<ObjectModel>,
        world_from_object: &FramePose<WorldFrame, Object>,
    ) -> Result<usize> {
        let name = &model.info.name;
        if !world_from_object.is_finite() {
            return Err(Error::World(format!("{name}: pose {world_from_object:?} is not finite")));
        }
        let solids: Option<Vec<_>> = model.collision.iter().map(convert::solid).collect();
        let solids = solids.filter(|s| !s.is_empty()).ok_or_else(|| {
            Error::World(format!("{name}: a collision piece has no volume; check its mesh"))
        })?;
        let masses: Vec<MassProperties> =
            solids.iter().map(|(_, solid)| solid.mass_properties(1.0)).collect();
        let volume: f32 = masses.iter().map(MassProperties::mass).sum();
        if volume.is_nan() || volume <= 1e-9 {
            return Err(Error::World(format!(
                "{name}: its solid has a volume of {volume} m^3; check its mesh"
            )));
        }
        let density = model.info.mass_kg as f32 / volume;
        let index = self.objects.len();
        let PhysicsSettings { objects, layout, .. } = &self.settings;
        let (linear, angular) = if self.for_layout {
            (layout.linear_damping, layout.angular_damping)
        } else {
            (objects.linear_damping, objects.angular_damping)
        };
        let mut body = RigidBodyBuilder::dynamic()
            .pose(convert::pose(world_from_object.iso()))
            .linear_damping(linear as f32)
            .angular_damping(angular as f32)
            .build();
        if self.for_layout {
            body.activation_mut().time_until_sleep = layout.sleep_s as f32;
        }
        let body = self.physics.insert_body(body);
        for ((at, solid), mut mass) in solids.into_iter().zip(masses) {
            mass.set_mass(mass.mass() * density, true);
            self.physics.insert_collider(
                ColliderBuilder::new(whole_faces(solid))
                    .position(at)
                    .mass_properties(mass)
                    .friction(model.info.friction as f32)
                    .collision_groups(object_groups())
                    .user_data(Body::Object(index).tag()),
                Some(body),
            );
        }
        let mut half: Vec<f64> = (model.size() / 2.0).iter().copied().collect();
        half.sort_by(f64::total_cmp);
        self.objects.push(ObjectBody {
            model,
            body,
            peak_force: 0.0,
            blows: Blows::new(objects.blow_steps),
            radius: half[1],
        });
        self.contacts.objects.push(ObjectContacts::default());
        Ok(index)
    }

    /// Makes object `index` a fixed thing where it is.
    pub(crate) fn freeze(&mut self, index: usize) {
        if let Some(body) = self.physics.bodies.get_mut(self.objects[index].body) {
            body.set_body_type(RigidBodyType::Fixed, true);
        }
    }

    /// Whether object `index` is fixed where it is.
    pub fn is_frozen(&self, index: usize) -> bool {
        self.physics.bodies.get(self.objects[index].body).is_some_and(RigidBody::is_fixed)
    }

    /// Puts object `index` elsewhere, at rest: for laying a scene out, before anything is done in it.
    pub(crate) fn put(&mut self, index: usize, world_from_object: &FramePose<WorldFrame, Object>) {
        if let Some(body) = self.physics.bodies.get_mut(self.objects[index].body) {
            body.set_position(convert::pose(world_from_object.iso()), true);
            body.set_linvel(Vector::ZERO, true);
            body.set_angvel(Vector::ZERO, true);
        }
    }

    /// Advances one step (of 1/[`STEP_HZ`] s unless [`World::for_layout`]) with the robot's joints driven towards `target` (all movable joints).
    pub fn step(&mut self, target: &[f64], grip: Grip) {
        for object in &mut self.objects {
            object.blows.begin_step();
        }
        match if self.for_layout { 1 } else { self.settings.solver.steps } {
            1 => self.engine_step(target, grip, 1.0),
            steps => {
                let before = self.robot.target().to_vec();
                for k in 1..=steps {
                    let share = k as f64 / steps as f64;
                    let mix = |(from, to): (&f64, &f64)| from + share * (to - from);
                    let target: Vec<f64> = before.iter().zip(target).map(mix).collect();
                    self.engine_step(&target, grip, 1.0 / steps as f64);
                }
            }
        }
        self.steps += 1;
    }

    /// A share of a step.
    fn engine_step(&mut self, target: &[f64], grip: Grip, share: f64) {
        let dt = share / f64::from(self.step_hz);
        self.robot.give_way(&self.contacts.on_hand, dt);
        self.robot.drive(&mut self.physics, target, grip, dt);
        self.resist_rolling(dt);
        let patches = self.press_pads();
        self.physics.step_with_events(&patches, &());
        self.contacts = Contacts::read(&self.physics, self.objects.len());
        self.robot.sense(&self.physics, &self.contacts, &self.fixed, share);
        for (object, contacts) in self.objects.iter_mut().zip(&self.contacts.objects) {
            object.peak_force = object.peak_force.max(contacts.largest_force);
            object.blows.add(contacts.blow_force * share / f64::from(self.step_hz));
        }
    }

    /// Rolling resistance: a torque against the rotation, proportional to the force that presses the object on what it
    /// lies on, and never more than stops it. Finger contacts do not count, so that it cannot help a grasp.
    fn resist_rolling(&mut self, dt: f64) {
        for (object, contacts) in self.objects.iter().zip(&self.contacts.objects) {
            if contacts.support_force <= 0.0 || contacts.touched_by_robot() {
                continue;
            }
            let Some(body) = self.physics.bodies.get_mut(object.body) else { continue };
            let spin = body.angvel();
            let speed = f64::from(spin.length());
            if body.is_sleeping() || speed < 1e-6 {
                continue;
            }
            let local = &body.mass_properties().local_mprops;
            let principal = local.principal_inertia();
            // About the axis of the spin.
            let frame = body.position().rotation * local.principal_inertia_local_frame;
            let axis = frame.inverse() * (spin / spin.length());
            let inertia = f64::from(principal.dot(axis * axis));
            let torque = self.settings.objects.rolling_resistance * object.radius * contacts.support_force;
            let kept = (1.0 - torque * dt / (inertia * speed)).max(0.0);
            body.set_angvel(spin * kept as f32, false);
        }
    }

    /// What the pads' patches hold in the next step, by what they bore in the last one.
    fn press_pads(&mut self) -> EvenPads {
        let arm = self.settings.fingers.torsion_m;
        let mut left = Vec::with_capacity(self.objects.len());
        for (index, (object, contacts)) in self.objects.iter().zip(&self.contacts.objects).enumerate() {
            let friction = self.pad_friction(index);
            left.push(contacts.fingers.map(|contact| pads::left_for_torsion(friction, &contact) as f32));
            for (side, contact) in contacts.fingers.iter().enumerate() {
                let limit = pads::torsion(friction, arm, contact);
                self.robot.fingers[side].brake(&mut self.physics, object.body, limit);
            }
        }
        EvenPads::new(left)
    }

    /// Steps with the robot at rest until no object moves, or `limit_s` is over.
    pub fn settle(&mut self, limit_s: f64) -> Settled {
        self.settle_watched(limit_s, |_| {})
    }

    /// The same, with `watch` called after each step.
    pub fn settle_watched(&mut self, limit_s: f64, mut watch: impl FnMut(&Self)) -> Settled {
        let (target, grip) = self.hold();
        let limit = (limit_s * f64::from(self.step_hz)) as u64;
        let calm_steps = u64::from(self.step_hz) / 4;
        let mut calm = 0;
        for step in 1..=limit {
            self.step(&target, grip);
            watch(self);
            calm = if self.fastest() < self.settings.objects.calm_speed { calm + 1 } else { 0 };
            if calm >= calm_steps {
                return Settled { seconds: step as f64 / f64::from(self.step_hz), at_rest: true };
            }
        }
        Settled { seconds: limit_s, at_rest: false }
    }

    /// Steps for `seconds` with the robot at rest and returns how far the point that moved most is from where it was,
    /// metres: what only trembles in the solver's hands stays, what rolls does not.
    pub fn drift(&mut self, seconds: f64) -> f64 {
        let before = self.poses();
        let (target, grip) = self.hold();
        for _ in 0..(seconds * f64::from(self.step_hz)) as u64 {
            self.step(&target, grip);
        }
        self.moved_since(&before).into_iter().fold(0.0, f64::max)
    }

    /// Where all objects are.
    pub fn poses(&self) -> Vec<FramePose<WorldFrame, Object>> {
        (0..self.objects.len()).map(|i| self.truth(i)).collect()
    }

    /// How far the farthest moved point of each object is at most from where it was at the poses `before`, metres.
    pub fn moved_since(&self, before: &[FramePose<WorldFrame, Object>]) -> Vec<f64> {
        let moved = before.iter().zip(&self.objects).enumerate().map(|(i, (before, object))| {
            let now = self.truth(i);
            let turned = now.rotation().angle_to(&before.rotation()) * object.model.diameter / 2.0;
            (now.translation() - before.translation()).norm() + turned
        });
        moved.collect()
    }

    /// A target that keeps the robot where it is.
    pub fn hold(&self) -> (Vec<f64>, Grip) {
        let [right, left] = self.robot.finger_positions();
        (self.robot.q.clone(), Grip::Open { width: right + left })
    }

    /// Speed of the fastest point of any object, m/s.
    fn fastest(&self) -> f64 {
        (0..self.objects.len()).map(|i| self.speed(i)).fold(0.0, f64::max)
    }

    /// Upper bound of the speed of any point of object `index`, m/s.
    pub fn speed(&self, index: usize) -> f64 {
        let object = &self.objects[index];
        self.physics.bodies.get(object.body).map_or(0.0, |body| {
            let turning = f64::from(body.angvel().length()) * object.model.diameter / 2.0;
            f64::from(body.linvel().length()) + turning
        })
    }

    /// Velocity of the centre of mass of object `index`, m/s.
    pub fn velocity(&self, index: usize) -> Vector3<f64> {
        let body = self.physics.bodies.get(self.objects[index].body);
        body.map_or_else(Vector3::zeros, |body| convert::from_vector(body.linvel()))
    }

    /// Coefficient of friction between the pads and object `index`: the mean of both.
    pub fn pad_friction(&self, index: usize) -> f64 {
        0.5 * (self.settings.fingers.pad_friction + self.objects[index].model.info.friction)
    }

    /// Where object `index` really is. Score and tests only: perception and planning cannot name this type.
    pub fn truth(&self, index: usize) -> FramePose<WorldFrame, Object> {
        let iso = self
            .physics
            .bodies
            .get(self.objects[index].body)
            .map_or_else(Isometry3::identity, |body| convert::from_pose(body.position()));
        FramePose::new(iso)
    }

    /// All objects, with where they really are.
    pub fn placed(&self) -> Vec<Placed> {
        self.objects.iter().enumerate().map(|(i, object)| (object.model.clone(), self.truth(i))).collect()
    }

    /// How many objects there are.
    pub fn object_count(&self) -> usize {
        self.objects.len()
    }

    /// The model of object `index`.
    pub fn object(&self, index: usize) -> &Arc<ObjectModel> {
        &self.objects[index].model
    }

    /// Lowest point of object `index` (of its collision solid) above the floor, metres.
    pub fn lowest_point(&self, index: usize) -> f64 {
        self.boxes(index).map(|(low, _)| low[2]).fold(f64::INFINITY, f64::min)
    }

    /// Highest point of the collision solids of the first `count` objects within `radius` of (x, y), above the floor,
    /// metres; by the bounding boxes of their pieces. Minus infinity where there is none.
    pub(crate) fn highest_point_near(&self, x: f64, y: f64, radius: f64, count: usize) -> f64 {
        (0..count)
            .flat_map(|index| self.boxes(index))
            .filter(|(low, high)| {
                let away = |at: f64, axis: usize| (low[axis] - at).max(at - high[axis]).max(0.0);
                away(x, 0).hypot(away(y, 1)) < radius
            })
            .map(|(_, high)| high[2])
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// Bounding boxes of an object's pieces in the world, as lower and upper corners, metres.
    fn boxes(&self, index: usize) -> impl Iterator<Item = ([f64; 3], [f64; 3])> {
        let body = self.physics.bodies.get(self.objects[index].body);
        body.into_iter().flat_map(|body| body.colliders()).filter_map(|handle| {
            let aabb = self.physics.colliders.get(*handle)?.compute_aabb();
            Some((
                [aabb.mins.x, aabb.mins.y, aabb.mins.z].map(f64::from),
                [aabb.maxs.x, aabb.maxs.y, aabb.maxs.z].map(f64::from),
            ))
        })
    }

    /// Whether object `index` touched a part of the bin in the last step.
    pub fn touches_bin(&self, index: usize) -> bool {
        let touched = &self.contacts.objects[index].fixtures;
        touched.iter().any(|&fixture| self.bin_parts.contains(&fixture))
    }

    /// Whether object `index` touched something fixed that is no part of the bin in the last step.
    pub fn touches_beside_bin(&self, index: usize) -> bool {
        let touched = &self.contacts.objects[index].fixtures;
        touched.iter().any(|fixture| !self.bin_parts.contains(fixture))
    }

    /// Contacts of object `index` in the last step.
    pub fn contacts(&self, index: usize) -> &ObjectContacts {
        &self.contacts.objects[index]
    }

    /// Largest normal force on object `index` by any one body since [`World::reset_peaks`], newtons.
    pub fn peak_force(&self, index: usize) -> f64 {
        self.objects[index].peak_force
    }

    /// Largest blow on object `index` since [`World::reset_peaks`], newton seconds: normal impulse by everything but the fingers within
    /// [`ObjectSettings::blow_steps`](crate::ObjectSettings::blow_steps), 21 ms, beyond that of as many steps before and of as many
    /// after. So it is the momentum that a fall or a knock loses; what the object bears at rest, or is pressed with by and by, is
    /// none.
    pub fn peak_impulse(&self, index: usize) -> f64 {
        self.objects[index].blows.largest()
    }

    /// Starts new peaks.
    pub fn reset_peaks(&mut self) {
        for object in &mut self.objects {
            object.peak_force = 0.0;
            object.blows.forget_largest();
        }
    }

    /// Measured joint positions, all movable joints, fingers as physics has them.
    pub fn joints(&self) -> &[f64] {
        &self.robot.q
    }

    /// Joint velocities as the servos know them.
    pub fn joint_velocities(&self) -> &[f64] {
        self.robot.velocities()
    }

    /// World pose of a robot link as it is now, by its index in the robot model.
    pub fn link_pose(&self, link: usize) -> Isometry3<f64> {
        self.robot.link_poses[link]
    }

    /// Positions of the right and left finger, metres from closed.
    pub fn finger_positions(&self) -> [f64; 2] {
        self.robot.finger_positions()
    }

    /// Force with which the finger drives press, newtons a finger.
    pub fn grip_force(&self) -> f64 {
        self.robot.grip_force()
    }

    /// Net external force on the hand in the last step, newtons, world frame: a squeeze cancels, the weight of what is held
    /// does not.
    pub fn hand_force(&self) -> Vector3<f64> {
        self.contacts.on_hand
    }

    /// Largest normal force on a link that is not a finger in the last step, newtons.
    pub fn link_force(&self) -> f64 {
        self.contacts.link_force.map_or(0.0, |(newtons, _)| newtons)
    }

    /// Why the arm stopped by itself, if it did.
    pub fn stop(&self) -> Option<&Stop> {
        self.robot.stop.as_ref()
    }

    /// Lets the arm move again after a protective stop.
    pub fn clear_stop(&mut self) {
        self.robot.clear_stop(&self.fixed);
    }

    /// Simulated seconds since the world was built.
    pub fn time(&self) -> f64 {
        self.steps as f64 / f64::from(self.step_hz)
    }

    /// SHA-256 of the bits of every body's pose and velocity and of every joint, in hexadecimal. Two runs are the same
    /// if and only if (but for a collision of the hash) their state hashes are.
    pub fn state_hash(&self) -> String {
        let mut hasher = Sha256::new();
        hasher.update(self.steps.to_le_bytes());
        for (_, body) in self.physics.bodies.iter() {
            let (p, v, w) = (body.position(), body.linvel(), body.angvel());
            let q = p.rotation;
            for value in [
                p.translation.x,
                p.translation.y,
                p.translation.z,
                q.x,
                q.y,
                q.z,
                q.w,
                v.x,
                v.y,
                v.z,
                w.x,
                w.y,
                w.z,
            ] {
                hasher.update(value.to_bits().to_le_bytes());
            }
        }
        for value in &self.robot.q {
            hasher.update(value.to_bits().to_le_bytes());
        }
        format!("{:x}", hasher.finalize())
    }
}

fn insert_fixed(physics: &mut PhysicsWorld, pose: Pose, solid: SharedShape, friction: f64, index: usize) {
    physics.insert(
        RigidBodyBuilder::fixed().pose(pose),
        ColliderBuilder::new(solid)
            .friction(friction as f32)
            .collision_groups(fixture_groups())
            .user_data(Body::Fixture(index).tag()),
    );
}

fn tune(parameters: &mut IntegrationParameters, solver: &SolverSettings) {
    let damping = solver.contact_damping as f32;
    parameters.dt = 1.0 / (STEP_HZ as usize * solver.steps) as f32;
    parameters.num_solver_iterations = solver.iterations;
    parameters.contact_softness = SpringCoefficients::new(solver.contact_hz as f32, damping);
    parameters.static_contact_softness = SpringCoefficients::new(solver.static_contact_hz as f32, damping);
    parameters.normalized_prediction_distance = solver.prediction_m as f32;
    parameters.normalized_contact_recycle_distance = solver.contact_recycle_m as f32;
}
