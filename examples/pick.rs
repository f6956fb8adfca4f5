//! A pick and a place, planned for an object of known pose, without a world.

#![allow(clippy::print_stdout, reason = "an example")]

use grip::setup::{Setup, SetupOptions};
use grip_manip::{BelievedObject, Risk};
use grip_sim::pose::Pose;

pub(crate) fn main() -> anyhow::Result<()> {
    let setup = Setup::load(&SetupOptions::default())?;
    let can = setup.library.load("005_tomato_soup_can")?;
    let height = setup.cell.scene.table.height + can.size().z / 2.0;
    let mut belief = setup.cell.empty_belief();
    belief.objects.push(BelievedObject::new(can, Pose::from_xyz_rpy([0.6, 0.0, height], [0.0; 3])));
    let plan = setup.planner().plan_pick_place(&belief, 0, &setup.cell.start, Risk::Averse, 1)?;
    println!("{} steps, {:.1} s of motion", plan.steps.len(), plan.motion_seconds());
    Ok(())
}
