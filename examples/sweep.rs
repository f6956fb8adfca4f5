//! What a pose error along the closing direction costs: a small sweep.

#![allow(clippy::print_stdout, reason = "an example")]

use grip::experiment::sweep::errors::Axis;
use grip::experiment::sweep::fits::results;
use grip::experiment::sweep::{ErrorPattern, Sweep, SweepOptions};
use grip::progress::Quiet;

pub(crate) fn main() -> anyhow::Result<()> {
    let sweep = Sweep::open(&SweepOptions {
        objects: vec!["005_tomato_soup_can".into()],
        pattern: ErrorPattern::Axis(vec![Axis::Y]),
        samples: Some(3),
        seeds: 2,
        ..SweepOptions::default()
    })?;
    let out = std::env::temp_dir().join(format!("grip-sweep-{}", std::process::id()));
    sweep.begin(&out, false)?;
    let (grasps, _) = sweep.run(&out, grip::workers::cores(), &Quiet)?;
    for object in results(&grasps) {
        println!(
            "{}: {} grasps, without an error {:?} hold",
            object.object, object.tried, object.without_error
        );
    }
    Ok(std::fs::remove_dir_all(out)?)
}
