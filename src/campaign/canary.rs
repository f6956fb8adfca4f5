//! A small computation that takes the ways of the processor which results depend on: physics, renderer, sensor, network, second stage,
//! planner. Machines on which it ends in the same bits are taken to be of one kind; where it does not, results may differ in last bits,
//! and then in anything.

use anyhow::{Context, Result};
use grip_manip::{BelievedObject, Risk};
use grip_sim::camera::Intrinsics;
use grip_sim::pose::Pose;
use grip_sim::render::{self, RendererChoice};
use sha2::{Digest, Sha256};

use crate::estimators::{DetectorKind, DetectorOptions, Grip, Perception, SecondStage};
use crate::setup::{Setup, SetupOptions};

/// What is computed, so that canaries of other versions are not compared.
const VERSION: &str = "grip.canary/1";

/// SHA-256 of all that comes out of it: built-in scene, objects, robot and network, on the processor alone; a second or two.
///
/// # Errors
/// When a part of it fails, which it does on no sound machine.
pub fn hash() -> Result<String> {
    compute().context("the canary, a small computation that tells machines apart, fails on this one")
}

fn compute() -> Result<String> {
    let mut hasher = Sha256::new();
    let mut add = |bytes: &[u8]| hasher.update(bytes);
    add(VERSION.as_bytes());
    // A quarter of the Fetch's picture.
    let intrinsics = Intrinsics { width: 320, height: 240, fx: 277.0, fy: 277.0, cx: 160.0, cy: 120.0 };
    let mut setup =
        Setup::load(&SetupOptions { seed: 1, intrinsics: Some(intrinsics), ..SetupOptions::default() })?;
    setup.models.truncate(2);
    let (world, _) = setup.drop_objects()?;
    add(world.state_hash().as_bytes());
    let mut renderer = render::open(RendererChoice::Cpu)?;
    let (frame, _) = setup.capture(&world, renderer.as_mut(), 0)?;
    add(frame.rgb.as_raw());
    frame.depth.data().iter().for_each(|depth| add(&depth.to_bits().to_le_bytes()));
    let grip = Grip::open(&setup, SecondStage::Grip, DetectorKind::Pyramid, &DetectorOptions::default())?;
    let asked = Vec::from_iter(0..setup.models.len());
    for (_, posterior) in grip.look_once(&frame, &setup.models, &asked, 1)? {
        let (at, turn) = (posterior.best.translation(), posterior.best.rotation());
        at.iter()
            .chain(turn.coords.iter())
            .chain([&posterior.confidence])
            .for_each(|value| add(&value.to_bits().to_le_bytes()));
    }
    let can = setup.library.load("005_tomato_soup_can")?;
    let height = setup.cell.scene.table.height + can.size().z / 2.0;
    let mut belief = setup.cell.empty_belief();
    belief.objects.push(BelievedObject::new(can, Pose::from_xyz_rpy([0.6, 0.0, height], [0.0; 3])));
    let plan = setup.planner().plan_pick_place(&belief, 0, &setup.cell.start, Risk::Averse, 1)?;
    add(&plan.motion_seconds().to_bits().to_le_bytes());
    Ok(format!("{:x}", hasher.finalize()))
}

#[cfg(test)]
mod tests {
    #[test]
    fn it_ends_in_the_same_bits_on_any_number_of_threads() {
        let one =
            rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(super::hash).unwrap();
        assert_eq!(one, super::hash().unwrap());
        assert_eq!(one.len(), 64);
    }
}
