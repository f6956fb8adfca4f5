//! Antipodal grasps of one object by a parallel gripper, in the object's frame; nothing of the scene is known here.
//!
//! A surface point and where a ray through the object from there comes out form a pair when both normals lie within
//! the friction cone about the line between them (Nguyen 1988). About each pair's line the gripper can approach from
//! all sides and more or less deep; each such pose is tried with pads of their true size: rays from the pads give the
//! points where flat pads first touch, and thus the real width, contact normals and share of the pad in contact.

use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Gripper, Object, Pose};
use grip_sim::robot::GripperConfig;
use nalgebra::{
    Isometry3, Matrix2, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3,
};
use rand::RngExt;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::surface::{Surface, SurfacePoint};

/// Friction of a pad; with the object's own the pair has their mean (the physics uses the average rule).
pub const PAD_FRICTION: f64 = 0.9;

/// Settings of [`antipodal_grasps`].
#[derive(Debug, Clone, PartialEq)]
pub struct AntipodalSettings {
    /// Surface points drawn. Default 1000.
    pub samples: usize,
    /// Most contact pairs kept, spread over the object. Default 160.
    pub pairs: usize,
    /// Approach directions about each closing axis. Default 16, so that 0, 90, 180 degrees are among them.
    pub approaches: usize,
    /// How far behind the contact the centres of the pads may be, metres: shallow grasps reach flat objects on a
    /// table. Default 0, 12 and 22 mm; the pads' half length is 30 mm.
    pub depths: Vec<f64>,
    /// Widest object, metres. Default 0.092: the opening of 0.10 less 4 mm on each side.
    pub max_width: f64,
    /// Share of the friction coefficient that the normals may use up. Default 0.6.
    pub friction_share: f64,
}

impl Default for AntipodalSettings {
    fn default() -> Self {
        Self {
            samples: 1000,
            pairs: 160,
            approaches: 16,
            depths: vec![0.0, 0.012, 0.022],
            max_width: 0.092,
            friction_share: 0.6,
        }
    }
}

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

/// Where two flat pads would touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PadContact {
    /// Distance of the pads, metres.
    pub width: f64,
    /// Middle between the pads along the closing axis, gripper frame, metres.
    pub center: f64,
    /// Lesser share of a pad in contact.
    pub share: f64,
    /// Largest angle between a mean contact normal and the closing axis, radians.
    pub cone_angle: f64,
    /// Middle of the contacts along the fingers, gripper frame, metres.
    pub depth: f64,
    /// How far the contacts spread in the direction in which they do least, one standard deviation, metres: 0 for a line,
    /// about which the object would turn. The lesser of both sides.
    pub spread: f64,
}

/// Depth of the contact patch: what a flat pad covers of a slightly curved surface.
const PATCH: f64 = 0.0015;

/// How closely [`pad_contact`] looks: rays along and across a pad. A coarse look is enough to refuse a grasp; only a fine one
/// (every 3 mm) sees the rim of a can.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// 5 by 3.
    Coarse,
    /// 21 by 9.
    Fine,
}

/// Closes flat pads from `opening` on the object at `object_from_gripper`; none when a pad meets nothing.
pub fn pad_contact(
    surface: &Surface,
    pad_half: &Vector3<f64>,
    object_from_gripper: &Isometry3<f64>,
    opening: f64,
    look: Look,
) -> Option<PadContact> {
    let closing = object_from_gripper * Vector3::y();
    let right = pad_side(surface, pad_half, object_from_gripper, opening, closing, look)?;
    let left = pad_side(surface, pad_half, object_from_gripper, opening, -closing, look)?;
    // Contacts that do not face each other make a couple that turns the object.
    let apart = (left.center - right.center).norm();
    let width = left.height + right.height;
    (apart < 0.015 && width > 0.001).then(|| PadContact {
        width,
        center: 0.5 * (right.height - left.height),
        share: left.share.min(right.share),
        cone_angle: left.angle.max(right.angle),
        depth: 0.5 * (left.center.x + right.center.x),
        spread: left.spread.min(right.spread),
    })
}

/// What one pad touches.
struct PadSide {
    /// Height of the surface towards the pad over the middle between the pads, metres.
    height: f64,
    /// Share of the pad in contact.
    share: f64,
    /// Between the mean normal and the closing axis, radians.
    angle: f64,
    /// Middle of the contacts on the pad, along and across, metres.
    center: Vector2<f64>,
    /// Standard deviation of the contacts in the direction in which they spread least, metres.
    spread: f64,
}

/// What the pad on the side `out` of the object's middle meets first.
fn pad_side(
    surface: &Surface,
    pad_half: &Vector3<f64>,
    object_from_gripper: &Isometry3<f64>,
    opening: f64,
    out: Vector3<f64>,
    look: Look,
) -> Option<PadSide> {
    let counts: [usize; 2] = match look {
        Look::Coarse => [5, 3],
        Look::Fine => [21, 9],
    };
    let place = |i: usize, n: usize| (2.0 * i as f64 + 1.0) / n as f64 - 1.0;
    let mut hits: Vec<(f64, SurfacePoint, Vector2<f64>)> = Vec::with_capacity(counts[0] * counts[1]);
    for i in 0..counts[0] {
        for j in 0..counts[1] {
            let at = Vector2::new(place(i, counts[0]) * pad_half.x, place(j, counts[1]) * pad_half.z);
            let from = object_from_gripper * Point3::new(at.x, 0.0, at.y) + out * (0.5 * opening);
            if let Some(hit) = surface.enter(&from, &-out, opening) {
                hits.push((0.5 * opening - (hit.point - from).norm(), hit, at));
            }
        }
    }
    let found = hits.len();
    if look == Look::Fine {
        // What is narrower than the grid, such as a rim, has edges.
        let axes = object_from_gripper.rotation.to_rotation_matrix();
        let [x, z] = [0, 2].map(|axis| axes.matrix().column(axis).into_owned());
        let origin = object_from_gripper.translation.vector;
        for vertex in surface.edges() {
            let p = vertex.point.coords - origin;
            let height = p.dot(&out);
            if height <= 0.0 || height > 0.5 * opening {
                continue;
            }
            let at = Vector2::new(p.dot(&x), p.dot(&z));
            if at.x.abs() <= pad_half.x && at.y.abs() <= pad_half.z {
                hits.push((height, *vertex, at));
            }
        }
    }
    let height = hits.iter().map(|h| h.0).fold(f64::NEG_INFINITY, f64::max);
    if !height.is_finite() {
        return None;
    }
    let rays = counts[0] * counts[1];
    let share = hits.iter().take(found).filter(|h| h.0 >= height - PATCH).count() as f64 / rays as f64;
    hits.retain(|h| h.0 >= height - PATCH);
    let count = hits.len() as f64;
    let normal: Vector3<f64> = hits.iter().map(|h| h.1.normal).sum();
    let center = hits.iter().map(|h| h.2).sum::<Vector2<f64>>() / count;
    let scatter: Matrix2<f64> =
        hits.iter().map(|h| (h.2 - center) * (h.2 - center).transpose()).sum::<Matrix2<f64>>() / count;
    Some(PadSide {
        height,
        share,
        angle: normal.angle(&out),
        center,
        spread: scatter.symmetric_eigenvalues().min().max(0.0).sqrt(),
    })
}

/// A line between two opposite surface points.
#[derive(Debug, Clone, Copy)]
struct Pair {
    center: Point3<f64>,
    axis: Vector3<f64>,
    width: f64,
}

/// The largest angle between a contact normal and the closing axis for a pad on this object, radians.
pub fn cone(model: &ObjectModel, settings: &AntipodalSettings) -> f64 {
    (settings.friction_share * 0.5 * (PAD_FRICTION + model.info.friction)).max(0.0).atan()
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
    let cone = cone(model, settings);
    let pairs = spread(&contact_pairs(model, surface, settings, cone), settings.pairs);
    pairs
        .par_iter()
        .map_init(hand, |fits, pair| held_about(pair, surface, gripper, settings, cone, fits))
        .flatten_iter()
        .collect()
}

/// Whether the hand fits at a pose and on the way in.
fn clear(fits: &impl Fn(&Isometry3<f64>, f64) -> bool, pose: &Isometry3<f64>, opening: f64) -> bool {
    [0.0, 0.02, 0.05].iter().all(|back| fits(&(pose * Translation3::new(-back, 0.0, 0.0)), opening))
}

/// How the pads can touch about one pair, from all sides and at all depths, where the hand is clear of the object.
fn held_about(
    pair: &Pair,
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
            let opening = narrow_opening(pair.width, gripper);
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
    let fits = |c: &PadContact| clear(hand_fits, &centred(c), narrow_opening(c.width, gripper));
    // The dear look comes last.
    let coarse = pad_contact(surface, pad, pose, opening, Look::Coarse).filter(|c| holds(c) && fits(c))?;
    let opening = narrow_opening(coarse.width, gripper).max(opening);
    let contact = pad_contact(surface, pad, pose, opening, Look::Fine).filter(|c| holds(c) && fits(c))?;
    let pose = centred(&contact);
    Some(GraspCandidate::new(pose, &contact, clear(hand_fits, &pose, gripper.opening)))
}

/// The opening for tight places: 12 mm of air on each side of the object.
pub fn narrow_opening(width: f64, gripper: &GripperConfig) -> f64 {
    (width + 0.024).min(gripper.opening)
}

fn contact_pairs(
    model: &ObjectModel,
    surface: &Surface,
    settings: &AntipodalSettings,
    cone: f64,
) -> Vec<Pair> {
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
                    pairs.push(Pair { center: nalgebra::center(&a.point, &b.point), axis: dir, width });
                }
            }
        }
    }
    pairs
}

/// Up to `count` pairs, evenly over the object: each differs from those before it by a least difference, which shrinks until
/// there are enough. Farthest points would all be at edges, where few grasps hold.
fn spread(pairs: &[Pair], count: usize) -> Vec<Pair> {
    // A quarter turn of the closing axis counts like 8 cm.
    let difference = |a: &Pair, b: &Pair| {
        let cosine = a.axis.dot(&b.axis).abs().min(1.0);
        (a.center - b.center).norm() + 0.05 * cosine.acos() + 0.5 * (a.width - b.width).abs()
    };
    let mut chosen: Vec<Pair> = Vec::new();
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
        let limit = cone(&model, &AntipodalSettings::default());
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
                    assert!(pad > -PATCH, "the pad would be inside by {pad}");
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
        let edge = pad_contact(&surface, &pad, &at(0.0), 0.1, Look::Fine).unwrap();
        assert!((edge.width - 0.0835).abs() < 2e-4, "{edge:?}");
        assert!(edge.spread < 0.001, "{edge:?}");
        // Over a corner the rim bends: two directions.
        let corner = pad_contact(&surface, &pad, &at(0.042), 0.1, Look::Fine).unwrap();
        assert!((corner.width - 0.0835).abs() < 2e-4 && corner.spread > 0.002, "{corner:?}");
    }

    #[test]
    fn too_large_for_the_gripper_means_no_grasp_and_the_search_repeats() {
        assert!(grasps(&box_model("crate", [0.2, 0.2, 0.2])).is_empty());
        let model = box_model("b", [0.04, 0.06, 0.1]);
        assert_eq!(grasps(&model), grasps(&model));
    }
}
