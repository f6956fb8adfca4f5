//! The poses of the objects in one frame, by GRIP, and how far they are off.

#![allow(clippy::print_stdout, reason = "an example")]

use grip::estimators::{DetectorKind, DetectorOptions, Grip, Perception, SecondStage};
use grip::score::pose_errors;
use grip::setup::{Setup, SetupOptions};
use grip_sim::render::{self, RendererChoice};

pub(crate) fn main() -> anyhow::Result<()> {
    let setup = Setup::load(&SetupOptions::default())?;
    let (world, _) = setup.drop_objects()?;
    let (frame, _) = setup.capture(&world, render::open(RendererChoice::Auto)?.as_mut(), 0)?;
    let grip = Grip::open(&setup, SecondStage::Grip, DetectorKind::Pyramid, &DetectorOptions::default())?;
    let asked = Vec::from_iter(0..setup.models.len());
    for (i, posterior) in grip.look_once(&frame, &setup.models, &asked, 1)? {
        let truth = frame.world_from_camera.inverse() * world.truth(i);
        let (_, adds_m) = pose_errors(&setup.models[i], &truth, &posterior.best);
        println!("{}: {:.1} mm, sure by {:.2}", posterior.object, 1e3 * adds_m, posterior.confidence);
    }
    Ok(())
}
