//! Grasps that others have planned: which object each is of, and whether the hand is free there.

use grip_sim::pose::{Gripper, Pose, World};
use grip_sim::robot::GripperConfig;
use nalgebra::{Point3, Translation3, Vector3};

use super::contact::{RayGrid, pad_contact};
use super::object_grasps::ObjectGrasps;
use super::rank::{Grasp, HandCheck, alike};
use super::settings::GraspSettings;
use super::{hand_may_touch, narrow_opening};
use crate::belief::{BeliefScene, BelievedObject};
use crate::collision::{CollisionChecker, CollisionQuery, Margins};
use crate::place::PlaceWish;

/// Points of each object's surface by which it is told what is between the fingers.
const SAMPLES: usize = 1000;
/// What is farther than this from the middle between the pads is not gripped, metres: poses may be off by as much.
const NEAR: f64 = 0.03;

/// A grasp by someone else: nothing of it is measured again, and its score is theirs.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenGrasp {
    /// The gripper: origin between the pads, x out along the fingers, y along the closing direction.
    pub world_from_gripper: Pose<World, Gripper>,
    /// How far the fingers open for it, metres; as far as there is room where nothing is said.
    pub opening: Option<f64>,
    /// Larger is better.
    pub score: f64,
    /// Where the object is to be put; the planner's choice where nothing is said.
    pub place: Option<PlaceWish>,
}

/// The surface of a believed object as points, each for a share of its area.
pub(crate) struct BelievedSurface {
    points: Vec<Point3<f64>>,
    /// Square metres a point.
    area: f64,
}

impl BelievedSurface {
    /// Of an object and its surface; none of what has no surface.
    pub fn new(object: &BelievedObject, grasps: &ObjectGrasps) -> Option<Self> {
        let surface = grasps.surface.as_ref()?;
        let mut rng = grip_sim::rng::stream(0, &format!("surface of {}", object.model.info.name));
        let world_from_object = &object.world_from_object;
        let points = (0..SAMPLES)
            .map(|_| world_from_object.transform_point(&surface.sample(&mut rng).point))
            .collect();
        Some(Self { points, area: surface.area() / SAMPLES as f64 })
    }
}

/// Which of these surfaces a grasp is on: the one of which most is between the fingers, or else the one nearest to the middle between the
/// pads, where it is near.
pub(crate) fn gripped<'a>(
    grasp: &GivenGrasp,
    surfaces: impl Iterator<Item = (usize, &'a BelievedSurface)> + Clone,
    gripper: &GripperConfig,
) -> Option<usize> {
    let gripper_from_world = grasp.world_from_gripper.iso().inverse();
    let opening = grasp.opening.map_or(gripper.opening, |opening| opening.min(gripper.opening));
    let half = Vector3::new(gripper.pad_half_extents.x, 0.5 * opening, gripper.pad_half_extents.z);
    let inside = |p: &&Point3<f64>| (0..3).all(|axis| (gripper_from_world * **p)[axis].abs() <= half[axis]);
    let between = surfaces
        .clone()
        .map(|(i, surface)| (i, surface.area * surface.points.iter().filter(inside).count() as f64));
    // The first of equals.
    let most = between.fold(None, |best: Option<(usize, f64)>, (i, area)| match best {
        Some((_, other)) if other >= area => best,
        _ if area > 0.0 => Some((i, area)),
        _ => best,
    });
    if let Some((i, _)) = most {
        return Some(i);
    }
    let middle = Point3::from(grasp.world_from_gripper.translation());
    let distance = |surface: &BelievedSurface| {
        surface.points.iter().map(|p| (p - middle).norm()).fold(f64::INFINITY, f64::min)
    };
    surfaces
        .map(|(i, surface)| (i, distance(surface)))
        .filter(|(_, distance)| *distance < NEAR)
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(i, _)| i)
}

/// Those of `given` at which the hand is free, best first, no two of them alike, at most [`GraspSettings::keep`]: as [`super::rank_grasps`]
/// does it for grasps of our own, but by their score. The hand must be clear of the object that it grasps, too.
pub(crate) fn free_given(
    given: &[GivenGrasp],
    known: &ObjectGrasps,
    belief: &BeliefScene,
    target: usize,
    checker: &CollisionChecker,
    gripper: &GripperConfig,
    settings: &GraspSettings,
) -> Vec<Grasp> {
    let object = &belief.objects[target];
    let base_from_world = belief.world_from_base.iso().inverse();
    let object_from_world = object.world_from_object.inverse();
    let center_of_mass = object.world_from_object.transform_point(&known.center_of_mass);
    let allowed = hand_may_touch(checker.robot(), target);
    let hand = HandCheck::new(checker, &allowed, settings);
    let touching = CollisionQuery { held: None, allowed: &[], margins: Margins::TOUCHING };
    let mut order: Vec<&GivenGrasp> = given.iter().collect();
    order.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut kept: Vec<Grasp> = Vec::new();
    for grasp in order.into_iter().take(settings.most_tried) {
        if kept.len() >= settings.keep {
            break;
        }
        let world_from_gripper = grasp.world_from_gripper;
        if kept.iter().any(|other| alike(&other.world_from_gripper, &world_from_gripper, settings)) {
            continue;
        }
        let object_from_gripper = object_from_world * world_from_gripper;
        let widest = grasp.opening.map_or(gripper.opening, |opening| opening.min(gripper.opening));
        let pad = &gripper.pad_half_extents;
        let contact = known
            .surface
            .as_ref()
            .and_then(|s| pad_contact(s, pad, object_from_gripper.iso(), widest, RayGrid::Fine));
        // Where the object is not believed to be between the pads nobody knows how wide it is there.
        let width = contact.map_or(0.5 * widest, |contact| contact.width);
        let base_from_gripper = base_from_world * world_from_gripper.iso();
        let clear_of_object = |opening: f64| {
            [0.0, 0.02, 0.05].iter().all(|back| {
                let at = base_from_gripper * Translation3::new(-back, 0.0, 0.0);
                checker.hand_collision(&at, opening, &touching).is_none()
            })
        };
        let fits = |opening: &f64| {
            hand.blocked(&base_from_gripper, *opening).is_none()
                && hand.blocked_closing(&base_from_gripper, *opening, width).is_none()
                && clear_of_object(*opening)
        };
        let openings = match grasp.opening {
            Some(_) => vec![widest],
            None => vec![widest, narrow_opening(width, gripper, &settings.antipodal)],
        };
        let Some(opening) = openings.into_iter().find(fits) else { continue };
        // The pad that touches first pushes the object to the middle.
        let pushed = contact.map_or(0.0, |contact| contact.center);
        let held = object_from_gripper.iso() * Translation3::new(0.0, pushed, 0.0);
        let center = world_from_gripper.transform_point(&Point3::new(
            contact.map_or(0.0, |contact| contact.depth),
            0.0,
            0.0,
        ));
        kept.push(Grasp {
            object_from_gripper: Pose::new(held),
            world_from_gripper,
            width,
            opening,
            clearance: hand.clearance(&base_from_gripper, opening),
            lever: (center_of_mass - center).xy().norm(),
            contact_share: contact.map_or(0.0, |contact| contact.share),
            score: grasp.score,
        });
    }
    kept
}

#[cfg(test)]
mod tests {
    use grip_sim::pose::Object;
    use nalgebra::{Isometry3, UnitQuaternion};

    use super::*;
    use crate::testing::{fetch, groceries};
    use crate::{Planner, PlannerSettings, Risk};

    fn planner() -> (Planner, Vec<f64>) {
        let (model, config) = fetch();
        let q = config.configuration(&model, "ready").unwrap();
        (Planner::new(model, config, PlannerSettings::default()), q)
    }

    #[test]
    fn a_grasp_is_of_what_is_between_the_fingers_or_nearest_to_them() {
        let (planner, _) = planner();
        let belief = groceries();
        let down = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
        for (i, object) in belief.objects.iter().enumerate().filter(|(_, object)| !object.packed) {
            let top = object.world_from_object.translation() + Vector3::z() * 0.5 * object.model.size().z;
            let at = |above: f64| GivenGrasp {
                world_from_gripper: Pose::new(Isometry3::from_parts(
                    Translation3::from(top + Vector3::z() * above),
                    down,
                )),
                opening: None,
                score: 1.0,
                place: None,
            };
            let of = |above: f64| planner.gripped_objects(&belief, &[at(above)])[0];
            assert_eq!(of(0.0), Some(i), "{}", object.name);
            assert_eq!(of(0.5), None, "{}", object.name);
        }
    }

    #[test]
    fn given_grasps_are_tried_by_their_score_and_the_object_is_pushed_to_the_middle() {
        let (planner, q) = planner();
        let belief = groceries();
        // One of our own, moved by 8 mm towards a finger, and one through the table.
        let (ours, _) = planner.choose_grasp(&belief, 0, &q, None).unwrap();
        let aside = ours.world_from_gripper.iso() * Translation3::new(0.0, 0.008, 0.0);
        let under = Translation3::new(0.0, 0.0, -0.3) * aside;
        let given = |iso: Isometry3<f64>, score: f64| GivenGrasp {
            world_from_gripper: Pose::new(iso),
            opening: None,
            score,
            place: None,
        };
        let grasps = [given(*ours.world_from_gripper.iso(), 1.0), given(aside, 2.0), given(under, 3.0)];
        let plan = planner.plan_pick_place_with(&belief, 0, &grasps, &q, Risk::Tolerant, 1).unwrap();
        assert_eq!(plan.grasp.score, 2.0);
        assert!(
            (plan.grasp.world_from_gripper.iso().translation.vector - aside.translation.vector).norm()
                < 1e-12
        );
        // In the hand it is as in the grasp that was centred.
        let believed = &belief.objects[0].world_from_object;
        let centred: Pose<Object, Gripper> = believed.inverse() * ours.world_from_gripper;
        let off = plan.grasp.object_from_gripper.translation() - centred.translation();
        assert!(off.norm() < 2e-3, "{off}");
        let none = planner.plan_pick_place_with(&belief, 0, &grasps[2..], &q, Risk::Tolerant, 1);
        assert!(none.unwrap_err().reason.contains("given"), "under the table");
    }

    #[test]
    fn an_object_goes_where_it_is_wanted_or_nowhere() {
        let (planner, q) = planner();
        let belief = groceries();
        let (ours, _) = planner.choose_grasp(&belief, 0, &q, None).unwrap();
        let at = |bin_xy: [f64; 2], heading: f64| {
            let place = Some(PlaceWish { bin_xy, heading: Some(heading) });
            let world_from_gripper = ours.world_from_gripper;
            let grasp = GivenGrasp { world_from_gripper, opening: None, score: 1.0, place };
            planner.plan_pick_place_with(&belief, 0, &[grasp], &q, Risk::Tolerant, 1)
        };
        let settings = &planner.settings.place;
        let places = crate::place::place_poses(&belief, 0, settings);
        let reached: Vec<_> =
            places.iter().filter_map(|p| Some((p, at(p.bin_xy, p.heading).ok()?))).collect();
        assert!(!reached.is_empty(), "none of the best {}", places.len().min(4));
        for (place, plan) in reached {
            let off = plan.place.world_from_object.translation() - place.world_from_object.translation();
            assert!(off.xy().norm() < 0.016, "{off}");
        }
        // Outside of the bin.
        let stage = at([2.0, 0.0], 0.0).unwrap_err().stage;
        assert_eq!(stage, crate::PlanStage::NoPlacePose);
    }
}
