//! An object's grasps as they lie in the scene: from above or from the front, clear of the table, scored.

use std::borrow::Cow;

use grip_sim::pose::{Gripper, Object, Pose, World};
use grip_sim::robot::GripperConfig;
use nalgebra::{Point3, Translation3, Vector3};

use super::antipodal::{GraspCandidate, narrow_opening};
use super::contact::{RayGrid, pad_contact};
use super::object_grasps::ObjectGrasps;
use super::settings::GraspSettings;
use crate::belief::BeliefScene;
use crate::surface::Surface;

/// Where a hand comes from to what it grasps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HandFrom {
    /// From above, as [`GraspSettings::least_down`] says.
    Above,
    /// From the robot's side, as [`GraspSettings::front_least_away`] and [`GraspSettings::front_least_down`] say: under a board there is
    /// no room for an arm above the object.
    Front,
}

/// A grasp with its score by its pose alone.
pub(super) struct Scored<'a> {
    pub score: f64,
    /// Horizontal distance of the centre of mass from the grasp's centre, metres.
    pub lever: f64,
    pub candidate: Cow<'a, GraspCandidate>,
    pub world_from_gripper: Pose<World, Gripper>,
}

/// The grasps of object `target` whose hand comes `from` there and stays clear of what the object stands on, best first.
pub(super) fn oriented<'a>(
    grasps: &'a ObjectGrasps,
    belief: &BeliefScene,
    target: usize,
    from: HandFrom,
    gripper: &GripperConfig,
    settings: &GraspSettings,
) -> Vec<Scored<'a>> {
    let object = &belief.objects[target];
    let world_from_object = object.world_from_object;
    let com = world_from_object.transform_point(&grasps.center_of_mass);
    let w = &settings.weights;
    let pad = gripper.pad_half_extents;
    let base = belief.world_from_base.iso();
    let away = (com - Point3::from(base.translation.vector)).xy();
    let away = away.try_normalize(1e-6).map_or(base * Vector3::x(), |away| away.push(0.0));
    // How much of the approach, in the world, goes the wanted way, and whether that is enough.
    let along = |approach: &Vector3<f64>| match from {
        HandFrom::Above => -approach.z,
        HandFrom::Front => approach.dot(&away),
    };
    let comes = |approach: &Vector3<f64>| match from {
        HandFrom::Above => along(approach) >= settings.least_down,
        HandFrom::Front => {
            along(approach) >= settings.front_least_away && -approach.z >= settings.front_least_down
        }
    };

    // How far the open fingers of a grasp reach below where they may, metres; none for a grasp from elsewhere.
    let too_low = |candidate: &GraspCandidate| {
        let world_from_gripper = world_from_object * candidate.object_from_gripper;
        let axis = |v: Vector3<f64>| world_from_gripper.transform_vector(&v);
        let (approach, closing, side) = (axis(Vector3::x()), axis(Vector3::y()), axis(Vector3::z()));
        let outer = 0.5 * candidate.width + 0.5 * settings.antipodal.finger_room + 2.0 * pad.y;
        let low = world_from_gripper.translation().z
            - approach.z.abs() * pad.x
            - closing.z.abs() * outer
            - side.z.abs() * pad.z;
        // The object may reach over the edge of what it lies on.
        let ground = belief.ground(&Point3::from(world_from_gripper.translation()));
        comes(&approach).then_some(ground + settings.margin - low)
    };
    let score = |candidate: &GraspCandidate| {
        let world_from_gripper = world_from_object * candidate.object_from_gripper;
        let along = along(&world_from_gripper.transform_vector(&Vector3::x()));
        let center = world_from_gripper.transform_point(&Point3::new(candidate.contact_depth, 0.0, 0.0));
        let lever = (com - center).xy().norm();
        let sigma = 2.0 * object.position_std_m.max(0.001);
        let room = 0.5 * (gripper.opening - candidate.width);
        let score = w.gravity * along
            + w.lever * (1.0 - lever / settings.lever_scale).clamp(-1.0, 1.0)
            + w.room * (room / (3.0 * sigma)).min(1.0)
            + w.contact * (candidate.contact_share / settings.contact_full).min(1.0)
            + w.spread * (candidate.contact_spread / settings.spread_full).min(1.0)
            + w.depth * (1.0 - candidate.contact_depth.abs() / pad.x)
            + w.cone * candidate.cone_angle.cos();
        (score, lever, world_from_gripper)
    };
    let scored_as = |candidate: Cow<'a, GraspCandidate>| {
        let (score, lever, world_from_gripper) = score(&candidate);
        Scored { score, lever, candidate, world_from_gripper }
    };
    let mut scored = Vec::new();
    let mut low: Vec<(f64, &GraspCandidate)> = Vec::new();
    for candidate in &grasps.candidates {
        match too_low(candidate) {
            Some(by) if by > 0.0 => low.push((by, candidate)),
            Some(_) => scored.push(scored_as(Cow::Borrowed(candidate))),
            None => {}
        }
    }
    // What lies flat is grasped by the fingertips: with few other grasps, those that reach too low are drawn back.
    if let Some(surface) = grasps.surface.as_ref().filter(|_| scored.len() < settings.keep) {
        low.sort_by(|a, b| a.0.total_cmp(&b.0));
        let raised = low.iter().take(RAISED).filter_map(|(by, candidate)| {
            let raised =
                drawn_back(candidate, *by, &world_from_object, (surface, grasps.cone), gripper, settings)?;
            too_low(&raised).is_some_and(|by| by <= 0.0).then_some(raised)
        });
        scored.extend(raised.map(|candidate| scored_as(Cow::Owned(candidate))));
    }
    scored.sort_by(|a, b| b.score.total_cmp(&a.score));
    scored
}

/// Grasps that are drawn back at most: a bound on the work.
const RAISED: usize = 200;

/// The same grasp with the hand `by` higher, along its approach; none when it does not hold the object there.
fn drawn_back(
    candidate: &GraspCandidate,
    by: f64,
    world_from_object: &Pose<World, Object>,
    (surface, cone): (&Surface, f64),
    gripper: &GripperConfig,
    settings: &GraspSettings,
) -> Option<GraspCandidate> {
    // A hair more, for the grasp is centred again.
    const SPARE: f64 = 2e-4;
    let pad = &gripper.pad_half_extents;
    let down = -(*world_from_object * candidate.object_from_gripper).transform_vector(&Vector3::x()).z;
    // A level hand does not rise when it is drawn back.
    if down <= 0.0 {
        return None;
    }
    let back = (by + SPARE) / down;
    if candidate.contact_depth + back > pad.x - settings.fingertips {
        return None;
    }
    let mut pose = candidate.object_from_gripper.iso() * Translation3::new(-back, 0.0, 0.0);
    let opening = narrow_opening(candidate.width, gripper, &settings.antipodal);
    let contact =
        pad_contact(surface, pad, &pose, opening, RayGrid::Fine).filter(|c| c.cone_angle <= cone)?;
    pose.translation.vector += pose.rotation * Vector3::y() * contact.center;
    // The hand was clear nearer to the object.
    Some(GraspCandidate::new(pose, &contact, candidate.fits_wide))
}
