//! Lays a scene out in physics and tells where the objects came to rest.

#![allow(clippy::print_stdout, reason = "an example")]

use grip::setup::{Setup, SetupOptions};

pub(crate) fn main() -> anyhow::Result<()> {
    let setup = Setup::load(&SetupOptions { seed: 7, ..SetupOptions::default() })?;
    let (world, dropped) = setup.drop_objects()?;
    println!("{} at rest after {:.1} s", setup.cell.scene.name, dropped.settle_s);
    for i in 0..world.object_count() {
        println!("{}: {:.3?} m", world.object(i).info.name, world.truth(i).translation().as_slice());
    }
    Ok(())
}
