//! `grip sweep`: grasps under known pose errors, and what to print of them.

use std::time::Instant;

use anyhow::Result;
use schemars::JsonSchema;
use serde::Serialize;

use super::Done;
use super::output::{self, Bar};
use crate::cli::SweepArgs;
use crate::experiment::sweep::errors::Axis;
use crate::experiment::sweep::fits::{Fall, ObjectResult, results};
use crate::experiment::sweep::{GraspLine, Sweep};
use crate::workers;

/// Version of what `--json` prints.
pub const SUMMARY_SCHEMA: &str = "grip.sweep.summary/1";

/// What `--json` prints.
#[derive(Serialize, JsonSchema)]
pub struct SweepSummary<'a> {
    schema: &'static str,
    /// How many were tried.
    grasps: usize,
    objects: &'a [ObjectResult],
}

/// Tries what is missing, prints the figures of all.
pub fn run(args: &SweepArgs) -> Result<Done> {
    let began = Instant::now();
    let sweep = Sweep::open(&args.options()?)?;
    sweep.begin(&args.out, args.resume)?;
    let progress = Bar::new("grasps");
    let jobs = args.jobs.map_or_else(workers::cores, |jobs| jobs as usize);
    let done = sweep.run(&args.out, jobs, &progress);
    progress.finish();
    let (lines, kept) = done?;
    print(&lines, args.json)?;
    let (run, seconds) = (lines.len() - kept, began.elapsed().as_secs_f64());
    output::message(format_args!(
        "{run} grasps in {seconds:.0} s, {:.0} an hour, {kept} kept from before: {}",
        3600.0 * run as f64 / seconds.max(1e-9),
        args.out.display()
    ));
    let left_out = sweep.grasps() - lines.len();
    if left_out > 0 {
        output::message(format_args!("{left_out} grasps were not tried: no layout of their seeds has one"));
        return Ok(Done::Short);
    }
    Ok(Done::Fully)
}

/// The figures of a sweep: a table, or JSON.
pub fn print(lines: &[GraspLine], json: bool) -> Result<()> {
    let objects = results(lines);
    if json {
        let grasps = lines.len();
        return output::json(&SweepSummary { schema: SUMMARY_SCHEMA, grasps, objects: &objects });
    }
    let rows = objects.iter().map(|o| {
        let without = o.without_error.as_ref();
        let axis = |axis: Axis| {
            let result = o.axes.iter().find(|result| result.axis == axis);
            result.map_or("-".to_owned(), |result| {
                let unit = if axis.turns() { 1f64.to_degrees() } else { 1e3 };
                let shown = |fall: &Option<Fall>, sign: &str| {
                    let d50 = fall.as_ref().and_then(|fall| fall.d50);
                    d50.map_or(format!("{sign}..."), |d| format!("{sign}{:.0}", d * unit))
                };
                format!("{} {}", shown(&result.falls[0], "-"), shown(&result.falls[1], "+"))
            })
        };
        let [x, y, z, roll, pitch, yaw] = Axis::ALL.map(axis);
        let size = |fall: &Option<Fall>| {
            let mm = |d: Option<f64>| d.map_or("...".to_owned(), |d| format!("{:.1}", 1e3 * d));
            fall.as_ref().map_or("-".to_owned(), |f| format!("{} {}", mm(f.d50), mm(f.d90)))
        };
        [
            o.object.clone(),
            o.tried.to_string(),
            o.unreachable.to_string(),
            without.map_or("-".to_owned(), |s| format!("{:.0}", 100.0 * s.share)),
            x,
            y,
            z,
            roll,
            pitch,
            yaw,
            size(&o.adds),
            size(&o.add),
        ]
    });
    let header = [
        "object",
        "tried",
        "no reach",
        "held %, no error",
        "D50 x mm",
        "y mm",
        "z mm",
        "roll deg",
        "pitch deg",
        "yaw deg",
        "ADD-S D50 D90 mm",
        "ADD D50 D90 mm",
    ];
    output::data(format_args!("{}", output::table(header, &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11], rows)))?;
    for object in &objects {
        let ObjectResult { object, isotropic: Some(fit), .. } = object else { continue };
        let [b0, metres, radians] = fit.coefficients[..] else { continue };
        output::data(format_args!(
            "{object}: P(held) = 1 / (1 + exp(-({b0:.2} {:+.3} mm {:+.3} deg)))",
            1e-3 * metres,
            radians.to_radians()
        ))?;
    }
    output::data(format_args!(
        "x approach, y closing, z sideways; D50, D90: error at which a half and nine tenths of grasps still hold; ...: beyond \
         the errors tried, or lower without any"
    ))
}
