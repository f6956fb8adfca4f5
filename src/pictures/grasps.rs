//! Grasps on an object: outlines of the gripper where it closes, coloured by how much of the pads touches.

use anyhow::Result;
use grip_manip::grasp::GraspCandidate;
use grip_sim::images::RgbImage;
use grip_sim::objects::ObjectModel;
use grip_sim::render::{Instance, RenderScene, Renderer};
use grip_sim::robot::GripperConfig;
use nalgebra::{Isometry3, Point3, Vector3};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight};

use super::camera::{fitted, lens};
use super::draw::fill;
use super::sheet;
use super::solid::Drawing;
use super::text::{Tone, caption, captioned, draw_text, text_width};

const SIZE: [usize; 2] = [640, 560];
/// How wide the lens is, degrees.
const WIDE_DEG: f64 = 36.0;
/// From where the object is seen, in its own frame.
const VIEWS: [(&str, [f64; 3]); 2] = [("from beside", [1.0, -0.65, 0.45]), ("from above", [0.12, -0.3, 1.0])];
/// At most so many grasps are drawn: more cannot be told apart.
const MOST: usize = 12;
/// Two grasps are one apart that are so far from each other, metres, or whose directions are, radians.
const APART_M: f64 = 0.05;
const APART_RAD: f64 = 0.8;
/// No two are drawn that are less apart.
const LEAST_APART: f64 = 0.6;
/// A grasp without contact counts as so much of one with the most.
const WITHOUT: f64 = 0.3;
/// The stem behind the palm, metres.
const STEM_M: f64 = 0.04;
const THICK: f64 = 3.0;

/// A row of two views of `model` and of its grasps by `gripper`, with a bar that says what the colours mean.
///
/// # Errors
/// When the renderer fails.
pub fn grasps(
    model: &ObjectModel,
    gripper: &GripperConfig,
    grasps: &[GraspCandidate],
    renderer: &mut dyn Renderer,
) -> Result<RgbImage> {
    let drawn = spread(grasps);
    let outlines: Vec<(f64, Vec<[Point3<f64>; 2]>)> =
        drawn.iter().map(|grasp| (grasp.contact_share, outline(grasp, gripper))).collect();
    let mut shown: Vec<Point3<f64>> =
        outlines.iter().flat_map(|(_, lines)| lines.iter().flatten().copied()).collect();
    shown.extend(corners(model));
    let instance = Instance { visual: model.visual.clone(), pose: Isometry3::identity(), label: 1 };
    let scene = RenderScene { instances: vec![instance], bounce: None };
    let lens = lens(SIZE, WIDE_DEG);
    let [least, most] = range(grasps);
    let mut cells = Vec::new();
    for (from, direction) in VIEWS {
        let camera = fitted(&shown, Vector3::from(direction).normalize(), &lens);
        let mut drawing = Drawing::of(&scene, renderer, &lens, &camera)?;
        let mut order: Vec<&(f64, Vec<[Point3<f64>; 2]>)> = outlines.iter().collect();
        // What is near is drawn last.
        let distance =
            |lines: &[[Point3<f64>; 2]]| lines.first().map_or(0.0, |line| drawing.distance(&line[0]));
        order.sort_by(|a, b| distance(&b.1).total_cmp(&distance(&a.1)));
        for (share, lines) in order {
            let color = color(*share, [least, most]);
            for [a, b] in lines {
                drawing.edged_line(*a, *b, THICK, color);
            }
        }
        cells.push(captioned(&drawing.picture, from, Tone::Plain));
    }
    let row = sheet(&cells, VIEWS.len() as u32);
    let title = match (drawn.len(), grasps.len()) {
        (_, 0) => format!("{}: no grasp", model.info.name),
        (shown, all) => {
            format!("{}: {shown} of {all} grasps, far apart and with much contact", model.info.name)
        }
    };
    let title = caption(row.width(), &title, Tone::Title);
    Ok(sheet(&[title, row.clone(), bar(row.width(), [least, most])], 1))
}

/// Grasps far apart from each other and with much contact: first the one with the most, then always the one whose distance from those
/// before, times its contact, is largest.
fn spread(grasps: &[GraspCandidate]) -> Vec<&GraspCandidate> {
    let most = grasps.iter().map(|grasp| grasp.contact_share).fold(1e-9, f64::max);
    let weight = |grasp: &GraspCandidate| WITHOUT + (1.0 - WITHOUT) * grasp.contact_share / most;
    let mut nearest = vec![f64::INFINITY; grasps.len()];
    let mut kept: Vec<&GraspCandidate> = Vec::new();
    while kept.len() < MOST {
        let value = |k: usize| nearest[k].min(1e3) * weight(&grasps[k]);
        let free = (0..grasps.len()).filter(|&k| nearest[k] >= LEAST_APART);
        let Some(next) = free.max_by(|&a, &b| value(a).total_cmp(&value(b))) else { break };
        for (nearest, grasp) in nearest.iter_mut().zip(grasps) {
            *nearest = nearest.min(apart(grasp, &grasps[next]));
        }
        kept.push(&grasps[next]);
    }
    kept
}

fn apart(a: &GraspCandidate, b: &GraspCandidate) -> f64 {
    let (a, b) = (a.object_from_gripper, b.object_from_gripper);
    let angle = |axis: Vector3<f64>| a.transform_vector(&axis).angle(&b.transform_vector(&axis));
    // A gripper turned by half about its approach is drawn the same.
    let (approach, closing) = (angle(Vector3::x()), angle(Vector3::y()));
    let closing = closing.min(std::f64::consts::PI - closing);
    let metres = (a.translation() - b.translation()).norm();
    Vector3::new(metres / APART_M, approach / APART_RAD, closing / APART_RAD).norm()
}

/// Fingers, palm and stem, the fingers where they touch.
fn outline(grasp: &GraspCandidate, gripper: &GripperConfig) -> Vec<[Point3<f64>; 2]> {
    let tip = gripper.pad_half_extents.x;
    let palm = tip - gripper.finger_depth;
    let half = grasp.width / 2.0;
    let at = |x: f64, y: f64| grasp.object_from_gripper.transform_point(&Point3::new(x, y, 0.0));
    vec![
        [at(palm, half), at(tip, half)],
        [at(palm, -half), at(tip, -half)],
        [at(palm, -half), at(palm, half)],
        [at(palm - STEM_M, 0.0), at(palm, 0.0)],
    ]
}

fn corners(model: &ObjectModel) -> impl Iterator<Item = Point3<f64>> {
    let (low, high) = (model.min, model.max);
    (0..8).map(move |k| Point3::from([0, 1, 2].map(|a| if k >> a & 1 == 1 { high[a] } else { low[a] })))
}

/// Least and largest share of contact.
fn range(grasps: &[GraspCandidate]) -> [f64; 2] {
    let shares = grasps.iter().map(|grasp| grasp.contact_share);
    let [least, most] = shares.fold([1.0, 0.0], |[a, b]: [f64; 2], share| [a.min(share), b.max(share)]);
    if most > least { [least, most] } else { [0.0, 1.0] }
}

fn color(share: f64, [least, most]: [f64; 2]) -> [u8; 3] {
    let c = colorous::PLASMA.eval_continuous(((share - least) / (most - least)).clamp(0.0, 1.0));
    [c.r, c.g, c.b]
}

/// What the colours mean.
fn bar(width: u32, [least, most]: [f64; 2]) -> RgbImage {
    const SIZE: RasterHeight = RasterHeight::Size16;
    const BAR: u32 = 240;
    let mut strip = RgbImage::from_pixel(width, SIZE.val() as u32 + 8, image::Rgb([255; 3]));
    let [from, to] = [least, most].map(|share| format!("{:.0} %", 100.0 * share));
    let mut left = 6;
    for text in [format!("share of the pad in contact: {from}"), String::new(), to] {
        if text.is_empty() {
            for x in 0..BAR {
                let share = least + (most - least) * f64::from(x) / f64::from(BAR - 1);
                fill(&mut strip, [left + x, 5], [1, 14], color(share, [least, most]));
            }
            left += BAR + 8;
        } else {
            draw_text(&mut strip, [left, 4], &text, SIZE, FontWeight::Regular, [27, 31, 36]);
            left += text_width(&text, SIZE) + 8;
        }
    }
    strip
}

#[cfg(test)]
mod tests {
    use super::*;
    use grip_sim::pose::Pose;

    fn grasp(x: f64, yaw: f64, contact_share: f64) -> GraspCandidate {
        GraspCandidate {
            object_from_gripper: Pose::from_xyz_rpy([x, 0.0, 0.0], [0.0, 0.0, yaw]),
            width: 0.04,
            contact_share,
            cone_angle: 0.0,
            contact_depth: 0.0,
            contact_spread: 0.0,
            fits_wide: true,
        }
    }

    #[test]
    fn of_grasps_beside_each_other_the_best_is_drawn() {
        let all = [grasp(0.0, 0.0, 0.5), grasp(0.004, 0.1, 0.9), grasp(0.06, 0.0, 0.6), grasp(0.0, 1.2, 0.3)];
        let mut shares: Vec<f64> = spread(&all).iter().map(|grasp| grasp.contact_share).collect();
        assert_eq!(shares[0], 0.9);
        shares.sort_by(f64::total_cmp);
        assert_eq!(shares, [0.3, 0.6, 0.9]);
        let many: Vec<GraspCandidate> = (0..500).map(|k| grasp(0.01 * f64::from(k), 0.0, 0.5)).collect();
        let drawn = spread(&many);
        assert_eq!(drawn.len(), MOST);
        assert!(drawn.iter().any(|grasp| grasp.object_from_gripper.translation().x > 4.0), "from end to end");
    }
}
