//! `grip export`: a settled scene as another program reads it.

use crate::mjcf::{self, Cylinders, Robot};
use crate::setup::{GROCERY, Setup};
use anyhow::{Context, Result};

use super::Done;
use super::output;
use crate::cli::ExportArgs;

/// Lays the scene out and writes it.
pub fn run(args: &ExportArgs) -> Result<Done> {
    let setup = Setup::load(&args.scene.options(GROCERY, &args.condition)?)?;
    let (world, _) = setup.drop_objects()?;
    let placed = world.placed();
    let objects: Vec<_> = placed.iter().map(|(model, pose)| (&**model, *pose)).collect();
    let q = &setup.cell.start;
    let robot = if args.hand { Robot::Hand(q) } else { Robot::Whole(q) };
    let physics = &setup.settings.physics;
    let text = mjcf::write(&setup.cell, robot, &objects, physics, Cylinders::Cylinders)?;
    if let Some(folder) = args.mjcf.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot be made; give another --mjcf", folder.display()))?;
    }
    grip_sim::bop::write_atomic(&args.mjcf, text.as_bytes())?;
    output::message(format_args!("{} objects: {}", objects.len(), args.mjcf.display()));
    Ok(Done::Fully)
}
