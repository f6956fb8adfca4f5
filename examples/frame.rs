//! What the robot's head camera sees in the dark: colour and noisy depth.

#![allow(clippy::print_stdout, reason = "an example")]

use grip::setup::{Setup, SetupOptions};
use grip_sim::render::{self, RendererChoice};

pub(crate) fn main() -> anyhow::Result<()> {
    let setup = Setup::load(&SetupOptions { condition: "dark".into(), ..SetupOptions::default() })?;
    let (world, _) = setup.drop_objects()?;
    let mut renderer = render::open(RendererChoice::Auto)?;
    let (frame, _) = setup.capture(&world, renderer.as_mut(), 0)?;
    std::fs::create_dir_all("runs")?;
    frame.rgb.save("runs/frame.png")?;
    let read = frame.depth.data().iter().filter(|depth| **depth > 0.0).count();
    println!("{} drew it: {read} of {} pixels have depth", renderer.name(), frame.depth.data().len());
    Ok(())
}
