//! What moves: transforms of all bodies, joints, and what the hand feels.

use std::collections::BTreeMap;

use anyhow::Result;
use nalgebra::Isometry3;

use super::schemas::{FrameTransform, FrameTransforms, Gripper, JointState, JointStates};
use super::source::{Body, Source};
use super::{CAMERA, Out, WORLD, link_frame, object_frame, pose, timestamp};

/// Says all of it.
///
/// # Errors
/// When a table lacks something.
pub fn tell(source: &Source, out: &mut Out) -> Result<()> {
    transforms(source, out);
    joints(source, out)?;
    forces(source, out)
}

/// Every message has all frames: whoever jumps to a time needs no other.
fn transforms(source: &Source, out: &mut Out) {
    let mut poses: BTreeMap<&Body, Isometry3<f64>> = BTreeMap::new();
    for moment in &source.moments {
        poses.extend(moment.moved.iter().map(|(body, pose)| (body, *pose)));
        let transform = |child: String, of: &Isometry3<f64>| {
            let of = pose(of);
            FrameTransform {
                timestamp: timestamp(moment.time_s),
                parent_frame_id: WORLD.to_owned(),
                child_frame_id: child,
                translation: of.position,
                rotation: of.orientation,
            }
        };
        let mut transforms: Vec<FrameTransform> = poses
            .iter()
            .map(|((kind, name, instance), pose)| match kind.as_str() {
                "link" => transform(link_frame(name), pose),
                _ => transform(object_frame(name, *instance), pose),
            })
            .collect();
        // Where the last look was from; before the first, where that will be.
        let last = source.looks.iter().rev().find(|look| look.time_s <= moment.time_s);
        let camera = last.or(source.looks.first()).map(|look| transform(CAMERA.to_owned(), &look.camera));
        transforms.extend(camera);
        out.say("/tf", moment.time_s, &FrameTransforms { transforms });
    }
}

fn joints(source: &Source, out: &mut Out) -> Result<()> {
    let names = &source.about.joints;
    let columns: Vec<&[f32]> =
        names.iter().map(|name| source.samples.single(&format!("q_{name}"))).collect::<Result<_>>()?;
    for (row, time_s) in source.samples.seconds("time_s")?.into_iter().enumerate() {
        let joints = names.iter().zip(&columns).map(|(name, column)| JointState {
            name: name.clone(),
            position: Some(f64::from(column[row])),
            ..Default::default()
        });
        let states = JointStates { timestamp: timestamp(time_s), joints: joints.collect() };
        out.say("/joint_states", time_s, &states);
    }
    Ok(())
}

fn forces(source: &Source, out: &mut Out) -> Result<()> {
    let table = &source.samples;
    let (steps, hand) = (table.text("step")?, table.vectors("hand_force_n")?);
    let column = |name: &str| table.single(name);
    let [width, grip, link] = [column("width_m")?, column("grip_force_n")?, column("link_force_n")?];
    let [right, left, support] = [column("right_finger_n")?, column("left_finger_n")?, column("support_n")?];
    let [slip_m, slip_deg] = [column("slip_m")?, column("slip_deg")?];
    for (row, time_s) in table.seconds("time_s")?.into_iter().enumerate() {
        let of = |column: &[f32]| f64::from(column[row]);
        let gripper = Gripper {
            timestamp: timestamp(time_s),
            step: steps[row].clone(),
            width_m: of(width),
            grip_force_n: of(grip),
            hand_force_n: super::vector(&hand[row].into()),
            link_force_n: of(link),
            right_finger_n: of(right),
            left_finger_n: of(left),
            support_n: of(support),
            slip_m: of(slip_m),
            slip_deg: of(slip_deg),
        };
        out.say("/gripper", time_s, &gripper);
    }
    Ok(())
}
