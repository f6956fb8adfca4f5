//! Grasps for another simulator: what the hand is told to do, and files of hand, table and object.

use std::path::Path;

use anyhow::{Context, Result};
use grip_manip::{Action, GraspTest, GripperCommand, StepName};
use grip_sim::bop::write_atomic;
use grip_sim::pose::{Object, Pose, World};
use nalgebra::Isometry3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Sweep;
use crate::mjcf::{self, Cylinders, Robot};
use crate::setup::Setup;

/// Poses of the hand a second.
const HZ: f64 = 60.0;

/// What the hand is told to do in a grasp. Poses are x, y, z in metres and a quaternion w, x, y, z, in the world.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GraspMotion {
    /// Where the object is before.
    pub object: [f64; 7],
    /// Distance of the pads before, metres.
    pub opening_m: f64,
    /// Force of each finger from the closing on, newtons.
    pub force_n: f64,
    /// The approach stops above this force, newtons, and counts as arrived with less than this to go, metres.
    pub guard_n: f64,
    /// See `guard_n`.
    pub guard_near_m: f64,
    /// Poses of the hand a second.
    pub hz: f64,
    /// Poses of the gripper's link: the way to the object, at the end of which the fingers close.
    pub approach: Vec<[f64; 7]>,
    /// Straight up.
    pub lift: Vec<[f64; 7]>,
    /// From side to side.
    pub shake: Vec<[f64; 7]>,
}

impl GraspMotion {
    /// Of a test, and where its object stands.
    pub fn of(test: &GraspTest, object: &Pose<World, Object>, setup: &Setup) -> Self {
        let (cell, hand) = (&setup.cell, setup.cell.config.gripper.link);
        let world_from_base = cell.scene.world_from_base();
        let mut motion = Self {
            object: numbers(object.iso()),
            opening_m: 0.0,
            force_n: 0.0,
            guard_n: 0.0,
            guard_near_m: 0.0,
            hz: HZ,
            approach: Vec::new(),
            lift: Vec::new(),
            shake: Vec::new(),
        };
        let mut q = test.start.clone();
        for step in &test.steps {
            match &step.action {
                Action::Gripper { command: GripperCommand::Open { width }, .. } => motion.opening_m = *width,
                Action::Gripper { command: GripperCommand::Close { force_n }, .. } => {
                    motion.force_n = *force_n
                }
                Action::Gripper { .. } => {}
                Action::Move { trajectory, guard, .. } => {
                    if let Some(guard) = guard {
                        (motion.guard_n, motion.guard_near_m) = (guard.force_n, guard.near);
                    }
                    let poses = match step.name {
                        StepName::Approach => &mut motion.approach,
                        StepName::Lift => &mut motion.lift,
                        _ => &mut motion.shake,
                    };
                    for k in 0..=(trajectory.duration * HZ).ceil() as usize {
                        let (at, _) = trajectory.sample(k as f64 / HZ);
                        trajectory.joints.iter().zip(at).for_each(|(&joint, value)| q[joint] = value);
                        poses.push(numbers(&(world_from_base.iso() * cell.robot.fk_link(&q, hand))));
                    }
                }
            }
        }
        motion
    }
}

/// To a tenth of a micrometre.
fn numbers(pose: &Isometry3<f64>) -> [f64; 7] {
    let (t, q) = (pose.translation.vector, pose.rotation);
    [t.x, t.y, t.z, q.w, q.i, q.j, q.k].map(|value| (value * 1e7).round() / 1e7)
}

/// Writes `OBJECT.xml` of each object of a sweep: hand, table and object, as MuJoCo reads them.
///
/// # Errors
/// When the folder cannot be written.
pub fn write_models(sweep: &Sweep, folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder)
        .with_context(|| format!("{}: cannot be made; check permissions and free space", folder.display()))?;
    let mut setup = sweep.setup.clone();
    setup.cell.scene.objects.names.clear();
    for name in &sweep.objects {
        let mut model = (*setup.library.load(name)?).clone();
        model.info.friction = sweep.friction.unwrap_or(model.info.friction);
        let table = setup.cell.scene.table.height;
        let standing = Pose::from_xyz_rpy([0.6, 0.0, table - model.min.z], [0.0; 3]);
        let hand = Robot::Hand(&setup.cell.start);
        let physics = &setup.settings.physics;
        let text = mjcf::write(&setup.cell, hand, &[(&model, standing)], physics, Cylinders::Prisms)?;
        write_atomic(&folder.join(format!("{name}.xml")), text.as_bytes())?;
    }
    Ok(())
}
