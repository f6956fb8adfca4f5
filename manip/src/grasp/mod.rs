//! Ranks an object's antipodal grasps in the believed scene.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard};

use grip_sim::cache;
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Gripper, Object, Pose, World};
use grip_sim::robot::GripperConfig;
use nalgebra::{Isometry3, Point3, Translation3, Vector3};
use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::antipodal::{AntipodalSettings, GraspCandidate, antipodal_grasps, grasp_at, narrow_opening};
use crate::belief::{BeliefScene, BelievedObject};
use crate::collision::{Body, CollisionChecker, CollisionPair, Margins, Query, RobotSolids};
use crate::expected::expected_success;
use crate::surface::Surface;

mod oriented;

use oriented::{Scored, oriented};

/// A grasp of a believed object in the scene.
#[derive(Debug, Clone, Serialize)]
pub struct Grasp {
    /// The gripper in the object's frame.
    pub object_from_gripper: Pose<Object, Gripper>,
    /// The gripper in the world.
    pub world_from_gripper: Pose<World, Gripper>,
    /// Expected distance of the pads when closed, metres.
    pub width: f64,
    /// Opening to approach with, metres.
    pub opening: f64,
    /// Distance of the hand from everything but the object, metres, at most 0.03.
    pub clearance: f64,
    /// Horizontal distance of the object's centre of mass from the grasp's centre, metres.
    pub lever: f64,
    /// Share of the pads in contact, 0 to 1.
    pub contact_share: f64,
    /// Share of the poses that the object may have for which the grasp holds it; 1 when only the best one was asked.
    pub expected: f64,
    /// Sum of the weighted terms of [`GraspWeights`]; larger is better.
    pub score: f64,
}

/// Which poses of the object a grasp is scored at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GraspAt {
    /// The best one alone.
    Best,
    /// The weighted poses of the belief: see [`crate::expected`].
    #[default]
    Posterior,
}

/// Weights of a grasp's score. Each term is between 0 (bad) and 1 (good).
#[derive(Debug, Clone, PartialEq)]
pub struct GraspWeights {
    /// Approach straight down. Default 1.0: the arm and the bin's walls favour it.
    pub gravity: f64,
    /// Centre of mass between the pads, falling to 0 at 6 cm. Default 1.2: a lever lets the object turn.
    pub lever: f64,
    /// Room between pads and object against two standard deviations of the position. Default 1.0.
    pub room: f64,
    /// Contact patch. Default 1.0.
    pub contact: f64,
    /// Contacts that spread in both directions, full at 3 mm (one standard deviation): about a line, such as a can's rim, an
    /// object turns in the hand. Default 2.0, which outweighs the lever of a can's corner.
    pub spread: f64,
    /// Contacts at the pads' centre rather than at their tips. Default 0.5.
    pub depth: f64,
    /// Normals along the closing axis. Default 0.4.
    pub cone: f64,
    /// Share of the posterior's poses at which the grasp holds ([`GraspAt::Posterior`]). Default 3.0: more than any other.
    pub expected: f64,
    /// Distance of the hand from other things up to 3 cm. Default 0.6.
    pub clearance: f64,
}

impl Default for GraspWeights {
    fn default() -> Self {
        Self {
            gravity: 1.0,
            lever: 1.2,
            room: 1.0,
            contact: 1.0,
            spread: 2.0,
            depth: 0.5,
            cone: 0.4,
            expected: 3.0,
            clearance: 0.6,
        }
    }
}

/// Settings of [`rank_grasps`].
#[derive(Debug, Clone, PartialEq)]
pub struct GraspSettings {
    /// Candidates in the object's frame.
    pub antipodal: AntipodalSettings,
    /// Which poses of the object count.
    pub at: GraspAt,
    /// Weights of the score.
    pub weights: GraspWeights,
    /// Least downward part of the approach direction. Default 0.17: up to 80 degrees from straight down.
    pub least_down: f64,
    /// Least distance of the hand from the table and other things at the grasp, metres. Default 0.004.
    pub margin: f64,
    /// Share of the other objects' spread added to that. Default 0.5.
    pub spread: f64,
    /// Distance of the pre-grasp pose along the approach, metres. Default 0.09.
    pub standoff: f64,
    /// Grasps returned at most. Default 40.
    pub keep: usize,
    /// A grasp of this score is worth taking before others are picked away. Default 7.5, of 10.7 that weights give at most: of
    /// 60 grasps in clutter three of four that slipped were below it and two of 56 that held.
    pub firm: f64,
}

impl Default for GraspSettings {
    fn default() -> Self {
        Self {
            antipodal: AntipodalSettings::default(),
            at: GraspAt::default(),
            weights: GraspWeights::default(),
            least_down: 0.17,
            margin: 0.004,
            spread: 0.5,
            standoff: 0.09,
            keep: 40,
            firm: 7.5,
        }
    }
}

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
            let fits = hand_fits(robot, &alone);
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
            antipodal_grasps(model, surface, gripper, settings, || hand_fits(robot, &alone))
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
    hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
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
    let cone = crate::antipodal::cone(model, settings);
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
        fixtures: Vec::new(),
        table_height: 0.0,
        bin: crate::belief::BinGeometry {
            world_from_bin: Pose::identity(),
            inner: [1.0, 1.0],
            wall_height: 0.0,
        },
        objects: vec![BelievedObject {
            name: model.info.name.clone(),
            model: model.clone(),
            world_from_object: Pose::identity(),
            poses: Vec::new(),
            position_std_m: 0.0,
            confidence: 1.0,
            packed: false,
        }],
        seen: Vec::new(),
        world_from_base: Pose::identity(),
    }
}

/// What says whether the hand, at a pose and an opening, is clear of the object that is `alone`.
fn hand_fits(robot: &Arc<RobotSolids>, alone: &BeliefScene) -> impl Fn(&Isometry3<f64>, f64) -> bool + use<> {
    // Open fingers keep this far from the object, metres; the palm also keeps as far as pose error and servo lag may push
    // the hand on: what a hand that went too far would run into, it must not run into.
    const ROOM: f64 = 0.001;
    const OVERSHOOT: f64 = 0.005;
    let query = Query { held: None, allowed: &[], margins: Margins { world: ROOM, own: 0.0, spread: 0.0 } };
    let checker = CollisionChecker::new(robot.clone(), alone);
    move |pose: &Isometry3<f64>, opening: f64| {
        let too_far = pose * Translation3::new(OVERSHOOT, 0.0, 0.0);
        checker.hand_collision(pose, opening, &query).is_none()
            && checker.hand_collision(&too_far, opening, &query).is_none()
    }
}

/// Pairs of every hand link with one object.
pub fn hand_may_touch(robot: &RobotSolids, object: usize) -> Vec<CollisionPair> {
    robot.hand.iter().map(|&link| CollisionPair { a: Body::Link(link), b: Body::Object(object) }).collect()
}

/// What [`rank_grasps`] looked at.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct GraspCounters {
    /// Antipodal candidates of the object.
    pub candidates: usize,
    /// Of those, approached from above and clear of the table by their pose alone.
    pub oriented: usize,
    /// Of those, tried with the hand's solids.
    pub tried: usize,
    /// Of those, free.
    pub free: usize,
}

/// Distance of the pads between two checks while the hand closes, metres: a finger, which goes half as far, is thicker.
const CLOSING_STEP: f64 = 0.01;

/// The best free grasps of object `target`, best first, no two of them alike.
pub fn rank_grasps(
    grasps: &ObjectGrasps,
    belief: &BeliefScene,
    target: usize,
    checker: &CollisionChecker,
    gripper: &GripperConfig,
    settings: &GraspSettings,
) -> (Vec<Grasp>, GraspCounters) {
    let object = &belief.objects[target];
    let base_from_world = belief.world_from_base.iso().inverse();
    let w = &settings.weights;
    let pad = gripper.pad_half_extents;
    let scored = oriented(grasps, belief, target, gripper, settings);
    let mut counters =
        GraspCounters { candidates: grasps.candidates.len(), oriented: scored.len(), ..Default::default() };

    let allowed = hand_may_touch(checker.robot(), target);
    let query = Query {
        held: None,
        allowed: &allowed,
        margins: Margins { world: settings.margin, own: 0.0, spread: settings.spread },
    };
    let sweep = Query { margins: Margins { world: 0.0, ..query.margins }, ..query };
    let mut kept: Vec<Grasp> = Vec::new();
    for Scored { score, lever, candidate, world_from_gripper } in scored {
        // A bound on the work in hopeless clutter.
        if kept.len() >= settings.keep || counters.tried >= 1500 {
            break;
        }
        if kept.iter().any(|g| alike(&g.world_from_gripper, &world_from_gripper)) {
            continue;
        }
        counters.tried += 1;
        let base_from_gripper = base_from_world * world_from_gripper.iso();
        let approach = base_from_gripper * Vector3::x();
        let free = |opening: f64| {
            [0.0, 0.03, 0.06, settings.standoff].iter().all(|back| {
                let mut at = base_from_gripper;
                at.translation.vector -= approach * *back;
                checker.hand_collision(&at, opening, &query).is_none()
            })
        };
        // A finger must not stand beyond a wall or a neighbour that is between it and the object.
        let closes = |opening: f64| {
            let steps = ((opening - candidate.width) / CLOSING_STEP).ceil().max(1.0);
            (1..=steps as usize).all(|k| {
                let at = opening + (candidate.width - opening) * k as f64 / steps;
                checker.hand_collision(&base_from_gripper, at, &sweep).is_none()
            })
        };
        let narrow = narrow_opening(candidate.width, gripper);
        let opening = if candidate.fits_wide && free(gripper.opening) && closes(gripper.opening) {
            gripper.opening
        } else if free(narrow) && closes(narrow) {
            narrow
        } else {
            continue;
        };
        counters.free += 1;
        let clearance = checker.hand_clearance(&base_from_gripper, opening, &query, 0.03);
        let expected = match (&grasps.surface, settings.at) {
            (Some(surface), GraspAt::Posterior) => {
                expected_success(surface, &pad, &world_from_gripper, opening, grasps.cone, &object.poses)
            }
            _ => 1.0,
        };
        kept.push(Grasp {
            expected,
            object_from_gripper: candidate.object_from_gripper,
            world_from_gripper,
            width: candidate.width,
            opening,
            clearance,
            lever,
            contact_share: candidate.contact_share,
            score: score + w.clearance * clearance / 0.03 + w.expected * expected,
        });
    }
    kept.sort_by(|a, b| b.score.total_cmp(&a.score));
    (kept, counters)
}

/// Closer than 8 mm and 12 degrees: if one is out of reach, so is the other.
fn alike(a: &Pose<World, Gripper>, b: &Pose<World, Gripper>) -> bool {
    (a.translation() - b.translation()).norm() < 0.008 && a.angle_to(b) < 0.21
}
