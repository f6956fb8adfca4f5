//! Antipodal grasps of one object by a parallel gripper, in the object's frame; nothing of the scene is known here.
//!
//! A surface point and where a ray through the object from there comes out form a pair when both normals lie within
//! the friction cone about the line between them (Nguyen 1988). About each pair's line the gripper can approach from
//! all sides and more or less deep; each such pose is tried with pads of their true size: rays from the pads give the
//! points where flat pads first touch, and thus the real width, contact normals and share of the pad in contact.

use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Gripper, Object, Pose};
use grip_sim::robot::GripperConfig;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::contact::{PadContact, RayGrid, pad_contact};
use super::settings::AntipodalSettings;
use crate::surface::Surface;

/// A grasp of an object in free space.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GraspCandidate {
    /// Where the gripper is; the pads touch at the same time when it closes here.
    pub object_from_gripper: Pose<Object, Gripper>,
    /// Distance of the pads in contact, metres.
    pub width: f64,
    /// Share of the pad in contact within 1.5 mm, the lesser of both sides.
    pub contact_share: f64,
    /// Largest angle between a contact normal and the closing axis, radians.
    pub cone_angle: f64,
    /// Middle of the contacts in the gripper's frame along the fingers, metres; 0 is the centre of the pads.
    pub contact_depth: f64,
    /// How far the contacts spread in the direction in which they do least, one standard deviation, metres.
    pub contact_spread: f64,
    /// The hand fits about the object with the gripper fully open, too.
    pub fits_wide: bool,
}

impl GraspCandidate {
    /// Of the gripper at `object_from_gripper`, centred, and what its pads touch there.
    pub(crate) fn new(object_from_gripper: Isometry3<f64>, contact: &PadContact, fits_wide: bool) -> Self {
        Self {
            object_from_gripper: Pose::new(object_from_gripper),
            width: contact.width,
            contact_share: contact.share,
            cone_angle: contact.cone_angle,
            contact_depth: contact.depth,
            contact_spread: contact.spread,
            fits_wide,
        }
    }
}

/// A line between two opposite surface points.
#[derive(Debug, Clone, Copy)]
struct ContactPair {
    center: Point3<f64>,
    axis: Vector3<f64>,
    width: f64,
}

/// The largest angle between a contact normal and the closing axis for a pad on this object, radians.
pub fn friction_cone(model: &ObjectModel, settings: &AntipodalSettings) -> f64 {
    (settings.friction_share * 0.5 * (settings.pad_friction + model.info.friction)).max(0.0).atan()
}

/// All grasps found, in a fixed order. `hand()` makes what says of an object_from_gripper and an opening whether the hand is
/// clear of the object itself, one for each thread. Deterministic: the samples come from a stream named after the object.
pub fn antipodal_grasps<H>(
    model: &ObjectModel,
    surface: &Surface,
    gripper: &GripperConfig,
    settings: &AntipodalSettings,
    hand: impl Fn() -> H + Send + Sync,
) -> Vec<GraspCandidate>
where
    H: Fn(&Isometry3<f64>, f64) -> bool,
{
    let settings = &fitted(settings, gripper);
    let cone = friction_cone(model, settings);
    let pairs = spread_out(&contact_pairs(model, surface, settings, cone), settings.pairs);
    pairs
        .par_iter()
        .map_init(hand, |fits, pair| held_about(pair, surface, gripper, settings, cone, fits))
        .flatten_iter()
        .collect()
}

/// Least air between the open pads and the widest object, both sides together, metres.
const LEAST_ROOM: f64 = 0.006;
/// Half of the length of the pads that the depths of grasps are meant for, metres.
const PAD_HALF_LENGTH: f64 = 0.030;

/// The settings for a gripper that opens less, or has shorter pads, than those that they are meant for.
fn fitted(settings: &AntipodalSettings, gripper: &GripperConfig) -> AntipodalSettings {
    let shorter = (gripper.pad_half_extents.x / PAD_HALF_LENGTH).min(1.0);
    AntipodalSettings {
        max_width: settings.max_width.min(gripper.opening - LEAST_ROOM),
        depths: settings.depths.iter().map(|depth| depth * shorter).collect(),
        ..settings.clone()
    }
}

/// Whether the hand fits at a pose and on the way in.
fn clear(fits: &impl Fn(&Isometry3<f64>, f64) -> bool, pose: &Isometry3<f64>, opening: f64) -> bool {
    [0.0, 0.02, 0.05].iter().all(|back| fits(&(pose * Translation3::new(-back, 0.0, 0.0)), opening))
}

/// How the pads can touch about one pair, from all sides and at all depths, where the hand is clear of the object.
fn held_about(
    pair: &ContactPair,
    surface: &Surface,
    gripper: &GripperConfig,
    settings: &AntipodalSettings,
    cone: f64,
    hand_fits: &impl Fn(&Isometry3<f64>, f64) -> bool,
) -> Vec<GraspCandidate> {
    let mut found = Vec::new();
    for k in 0..settings.approaches {
        let angle = std::f64::consts::TAU * k as f64 / settings.approaches as f64;
        let rotation = orientation(&pair.axis, angle);
        let approach = rotation * Vector3::x();
        for &depth in &settings.depths {
            let pose =
                Isometry3::from_parts(Translation3::from(pair.center.coords - approach * depth), rotation);
            let opening = narrow_opening(pair.width, gripper, settings);
            found.extend(grasp_at(&pose, opening, surface, gripper, settings, cone, hand_fits));
        }
    }
    found
}

/// The grasp of a gripper that closes at `pose` (object from gripper) from `opening`, moved along the closing axis so that
/// both pads touch at the same time; none if it does not hold, or if the hand does not fit.
pub fn grasp_at(
    pose: &Isometry3<f64>,
    opening: f64,
    surface: &Surface,
    gripper: &GripperConfig,
    settings: &AntipodalSettings,
    cone: f64,
    hand_fits: &impl Fn(&Isometry3<f64>, f64) -> bool,
) -> Option<GraspCandidate> {
    let pad = &gripper.pad_half_extents;
    let holds = |c: &PadContact| c.cone_angle <= cone && c.width <= settings.max_width;
    let centred = |c: &PadContact| {
        let mut pose = *pose;
        pose.translation.vector += pose.rotation * Vector3::y() * c.center;
        pose
    };
    let fits = |c: &PadContact| clear(hand_fits, &centred(c), narrow_opening(c.width, gripper, settings));
    // The dear look comes last.
    let coarse = pad_contact(surface, pad, pose, opening, RayGrid::Coarse).filter(|c| holds(c) && fits(c))?;
    let opening = narrow_opening(coarse.width, gripper, settings).max(opening);
    let contact = pad_contact(surface, pad, pose, opening, RayGrid::Fine).filter(|c| holds(c) && fits(c))?;
    let pose = centred(&contact);
    Some(GraspCandidate::new(pose, &contact, clear(hand_fits, &pose, gripper.opening)))
}

/// The opening for tight places, metres: an object's width and the room of [`AntipodalSettings::finger_room`].
pub fn narrow_opening(width: f64, gripper: &GripperConfig, settings: &AntipodalSettings) -> f64 {
    (width + settings.finger_room).min(gripper.opening)
}

fn contact_pairs(
    model: &ObjectModel,
    surface: &Surface,
    settings: &AntipodalSettings,
    cone: f64,
) -> Vec<ContactPair> {
    let mut rng = grip_sim::rng::stream(0, &format!("grasps of {}", model.info.name));
    let mut pairs = Vec::new();
    let far = 2.0 * model.diameter;
    for _ in 0..settings.samples {
        let a = surface.sample(&mut rng);
        let wobble = Vector3::from_fn(|_, _| rng.random::<f64>() - 0.5) * cone;
        // Straight through along the normal, and once within the cone.
        for dir in [-a.normal, (-a.normal + wobble).normalize()] {
            let inside = a.point + dir * 1e-4;
            // The first exit clasps a wall (a rim), the last one the whole body.
            let first = surface.leave(&inside, &dir, far);
            let last = surface.enter(&(a.point + dir * far), &(-dir), far);
            for b in [first, last].into_iter().flatten() {
                let width = (b.point - a.point).norm();
                let within = width > 0.0015
                    && width <= settings.max_width
                    && a.normal.angle(&-dir) <= cone
                    && b.normal.angle(&dir) <= cone;
                if within {
                    pairs.push(ContactPair {
                        center: nalgebra::center(&a.point, &b.point),
                        axis: dir,
                        width,
                    });
                }
            }
        }
    }
    pairs
}

/// Up to `count` pairs, evenly over the object: each differs from those before it by a least difference, which shrinks until
/// there are enough. Farthest points would all be at edges, where few grasps hold.
fn spread_out(pairs: &[ContactPair], count: usize) -> Vec<ContactPair> {
    // A quarter turn of the closing axis counts like 8 cm.
    let difference = |a: &ContactPair, b: &ContactPair| {
        let cosine = a.axis.dot(&b.axis).abs().min(1.0);
        (a.center - b.center).norm() + 0.05 * cosine.acos() + 0.5 * (a.width - b.width).abs()
    };
    let mut chosen: Vec<ContactPair> = Vec::new();
    let mut least = 0.05;
    while chosen.len() < count && least > 0.004 {
        for pair in pairs {
            if chosen.len() < count && chosen.iter().all(|other| difference(pair, other) > least) {
                chosen.push(*pair);
            }
        }
        least *= 0.8;
    }
    chosen
}

/// The gripper's axes with y along `closing` and x at `angle` about it, counted from an axis of the object.
fn orientation(closing: &Vector3<f64>, angle: f64) -> UnitQuaternion<f64> {
    // The object axis most across the closing direction, so that boxes get approaches along their faces.
    let across = [Vector3::z(), Vector3::x(), Vector3::y()]
        .into_iter()
        .min_by(|a, b| a.dot(closing).abs().total_cmp(&b.dot(closing).abs()))
        .unwrap_or(Vector3::z());
    let y = closing.normalize();
    let x0 = (across - y * across.dot(&y)).normalize();
    let z0 = x0.cross(&y);
    let frame = Matrix3::from_columns(&[x0, y, z0]);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(frame))
        * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{box_model, cylinder_model, fetch};

    fn grasps(model: &ObjectModel) -> Vec<GraspCandidate> {
        let (_, config) = fetch();
        let surface = Surface::new(&model.visual.mesh).unwrap();
        let settings = AntipodalSettings::default();
        antipodal_grasps(model, &surface, &config.gripper, &settings, || |_: &Isometry3<f64>, _: f64| true)
    }

    #[test]
    fn both_normals_lie_in_the_friction_cone_and_the_width_is_the_objects() {
        let model = cylinder_model("can", 0.033, 0.1);
        let surface = Surface::new(&model.visual.mesh).unwrap();
        let limit = friction_cone(&model, &AntipodalSettings::default());
        let found = grasps(&model);
        assert!(found.len() > 100, "{}", found.len());
        for g in &found {
            let pose = g.object_from_gripper.iso();
            let (y, c) = (pose * Vector3::y(), Point3::from(pose.translation.vector));
            assert!(g.cone_angle <= limit && g.width < 0.092);
            // Again by a ray from far off, through the middle of the contact.
            let middle = c + pose * Vector3::x() * g.contact_depth;
            for sign in [1.0, -1.0] {
                let from = middle + y * (sign * 0.2);
                if let Some(hit) = surface.enter(&from, &(-y * sign), 0.4) {
                    let pad = 0.5 * g.width - (hit.point - middle).dot(&(y * sign));
                    assert!(pad > -1.5e-3, "the pad would be inside by {pad}");
                }
            }
            let axial = y.z.abs();
            if axial < 0.05 {
                assert!((g.width - 0.066).abs() < 0.002, "across the can: {}", g.width);
            }
        }
    }

    #[test]
    fn a_wide_side_of_a_box_is_not_grasped() {
        let model = box_model("cereal", [0.16, 0.06, 0.21]);
        let found = grasps(&model);
        assert!(!found.is_empty());
        for g in &found {
            let closing = g.object_from_gripper.transform_vector(&Vector3::y());
            assert!(closing.y.abs() > 0.9, "closes along the thin side only: {closing}");
            assert!((g.width - 0.06).abs() < 0.02);
        }
    }

    #[test]
    fn a_rim_of_a_millimetre_is_felt_and_a_line_of_contact_does_not_spread() {
        let objects = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/objects.toml");
        let library =
            grip_sim::objects::ObjectLibrary::open(&objects, grip_sim::objects::ObjectSet::BuiltIn).unwrap();
        let can = library.load("010_potted_meat_can").unwrap();
        let surface = Surface::new(&can.visual.mesh).unwrap();
        let (_, config) = fetch();
        let pad = config.gripper.pad_half_extents;
        // Lid to bottom, from the side, over the middle of a straight edge: the rims stand 83.5 mm apart.
        let down = Matrix3::from_columns(&[-Vector3::y(), -Vector3::z(), Vector3::x()]);
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(down));
        let at = |x: f64| Isometry3::from_parts(Translation3::new(x, 0.025, 0.0), rotation);
        let edge = pad_contact(&surface, &pad, &at(0.0), 0.1, RayGrid::Fine).unwrap();
        assert!((edge.width - 0.0835).abs() < 2e-4, "{edge:?}");
        assert!(edge.spread < 0.001, "{edge:?}");
        // Over a corner the rim bends: two directions.
        let corner = pad_contact(&surface, &pad, &at(0.042), 0.1, RayGrid::Fine).unwrap();
        assert!((corner.width - 0.0835).abs() < 2e-4 && corner.spread > 0.002, "{corner:?}");
    }

    #[test]
    fn too_large_for_the_gripper_means_no_grasp_and_the_search_repeats() {
        assert!(grasps(&box_model("crate", [0.2, 0.2, 0.2])).is_empty());
        let model = box_model("b", [0.04, 0.06, 0.1]);
        assert_eq!(grasps(&model), grasps(&model));
    }
}
