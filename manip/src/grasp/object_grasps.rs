//! The grasps of each object, made once: searched for on its mesh, read from disk, or given by a file.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard};

use grip_sim::cache;
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Gripper, Object, Pose};
use grip_sim::robot::GripperConfig;
use nalgebra::{Isometry3, Point3, Translation3};
use sha2::{Digest, Sha256};

use super::antipodal::{GraspCandidate, antipodal_grasps, friction_cone, grasp_at};
use super::settings::AntipodalSettings;
use crate::belief::{BeliefScene, BelievedObject};
use crate::collision::{CollisionChecker, CollisionQuery, Margins, RobotSolids};
use crate::surface::Surface;

/// What an object's grasps need, made once an object.
#[derive(Debug)]
pub struct ObjectGrasps {
    /// All candidates in the object's frame.
    pub candidates: Vec<GraspCandidate>,
    /// Centre of mass, object frame.
    pub center_of_mass: Point3<f64>,
    /// The object's surface; none of a mesh without an area.
    pub surface: Option<Surface>,
    /// Largest angle of a contact normal that friction holds, radians.
    pub cone: f64,
}

/// The grasps of each object met so far, by name.
#[derive(Debug, Default)]
pub struct GraspCache {
    known: Mutex<BTreeMap<String, Arc<ObjectGrasps>>>,
}

impl GraspCache {
    /// The grasps of `model`, made on first use (some 0.2 s) or read from disk. Objects of one name must be the same object.
    pub fn get(
        &self,
        model: &Arc<ObjectModel>,
        robot: &Arc<RobotSolids>,
        gripper: &GripperConfig,
        settings: &AntipodalSettings,
    ) -> Arc<ObjectGrasps> {
        if let Some(found) = self.lock().get(&model.info.name) {
            return found.clone();
        }
        // Made without the lock: other threads may plan other objects meanwhile, and the result is the same for all.
        let made = Arc::new(object_grasps(model, robot, gripper, settings));
        self.lock().entry(model.info.name.clone()).or_insert(made).clone()
    }

    /// Uses these poses of the gripper instead, as far as they hold the object; returns how many do.
    pub fn set(
        &self,
        model: &Arc<ObjectModel>,
        robot: &Arc<RobotSolids>,
        gripper: &GripperConfig,
        settings: &AntipodalSettings,
        poses: &[Pose<Object, Gripper>],
    ) -> usize {
        let made = with_grasps(model, settings, |surface, cone| {
            let alone = alone(model);
            let fits = hand_fits(robot, &alone, settings);
            let at = |pose: &Pose<Object, Gripper>| {
                grasp_at(pose.iso(), gripper.opening, surface, gripper, settings, cone, &fits)
            };
            poses.iter().filter_map(at).collect()
        });
        let count = made.candidates.len();
        self.lock().insert(model.info.name.clone(), Arc::new(made));
        count
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<String, Arc<ObjectGrasps>>> {
        self.known.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

/// The folder of the disk cache, and what changes with the search for grasps, so that old files are not used.
const CACHE: &str = "grasps";
const VERSION: &str = "2";

fn object_grasps(
    model: &Arc<ObjectModel>,
    robot: &Arc<RobotSolids>,
    gripper: &GripperConfig,
    settings: &AntipodalSettings,
) -> ObjectGrasps {
    with_grasps(model, settings, |surface, _| {
        let find = || {
            let alone = alone(model);
            antipodal_grasps(model, surface, gripper, settings, || hand_fits(robot, &alone, settings))
        };
        let Some(folder) = cache::folder() else { return find() };
        let key = cache_key(model, robot, gripper, settings);
        let sound = |grasps: &Vec<GraspCandidate>| {
            grasps.iter().all(|g| g.width > 0.0 && g.width <= gripper.opening && g.contact_share.is_finite())
        };
        if let Some(grasps) = cache::read(&folder, CACHE, &key, sound) {
            return grasps;
        }
        let found = find();
        cache::write(&folder, CACHE, &key, &found);
        // What is read is normalised: the first run has to have the same bits as the next.
        serde_json::to_string(&found).and_then(|text| serde_json::from_str(&text)).unwrap_or(found)
    })
}

/// SHA-256 of all that the grasps of an object depend on.
fn cache_key(
    model: &ObjectModel,
    robot: &RobotSolids,
    gripper: &GripperConfig,
    settings: &AntipodalSettings,
) -> String {
    let mut hasher = Sha256::new();
    let mesh = &model.visual.mesh;
    hasher.update(VERSION);
    hasher.update(&model.info.name);
    hasher.update(model.info.friction.to_le_bytes());
    hasher.update(format!("{gripper:?} {settings:?} {:?}", model.collision));
    hasher.update(format!("{:?}", robot.hand_poses(0.05).collect::<Vec<_>>()));
    for &link in &robot.hand {
        hasher.update(format!("{:?}", robot.model.links()[link].collisions));
    }
    for p in mesh.positions.iter().chain(mesh.normals.iter().map(|n| (*n).into()).collect::<Vec<_>>().iter())
    {
        p.iter().for_each(|v| hasher.update(v.to_le_bytes()));
    }
    for t in &mesh.triangles {
        t.iter().for_each(|i| hasher.update(i.to_le_bytes()));
    }
    format!("{:x}", hasher.finalize())
}

/// An object's surface with the grasps that `find(surface, cone)` finds on it; none on a mesh without an area.
fn with_grasps(
    model: &ObjectModel,
    settings: &AntipodalSettings,
    find: impl FnOnce(&Surface, f64) -> Vec<GraspCandidate>,
) -> ObjectGrasps {
    let Some(surface) = Surface::new(&model.visual.mesh) else {
        return ObjectGrasps {
            candidates: Vec::new(),
            center_of_mass: Point3::origin(),
            surface: None,
            cone: 0.0,
        };
    };
    let cone = friction_cone(model, settings);
    ObjectGrasps {
        candidates: find(&surface, cone),
        center_of_mass: surface.center_of_mass,
        surface: Some(surface),
        cone,
    }
}

/// The object alone, in its own frame, as a scene.
fn alone(model: &Arc<ObjectModel>) -> BeliefScene {
    BeliefScene {
        objects: vec![BelievedObject::new(model.clone(), Pose::identity())],
        ..BeliefScene::without_bin(Vec::new())
    }
}

/// What says whether the hand, at a pose and an opening, is clear of the object that is `alone`.
fn hand_fits(
    robot: &Arc<RobotSolids>,
    alone: &BeliefScene,
    settings: &AntipodalSettings,
) -> impl Fn(&Isometry3<f64>, f64) -> bool + use<> {
    // What a hand that went too far would run into, it must not run into.
    let (room, overshoot) = (settings.hand_room, settings.overshoot);
    let query =
        CollisionQuery { held: None, allowed: &[], margins: Margins { world: room, ..Margins::TOUCHING } };
    let checker = CollisionChecker::new(robot.clone(), alone);
    move |pose: &Isometry3<f64>, opening: f64| {
        let too_far = pose * Translation3::new(overshoot, 0.0, 0.0);
        checker.hand_collision(pose, opening, &query).is_none()
            && checker.hand_collision(&too_far, opening, &query).is_none()
    }
}
