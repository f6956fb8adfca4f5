//! `grip sweep`: grasps under known pose errors, and what to print of them.

use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};

use super::Done;
use crate::cli::{GraspAt, Mode, Renderer, SceneArgs, SweepArgs};
use crate::experiment::sweep::errors::{Axis, along_axes, isotropic};
use crate::experiment::sweep::fits::{Fall, ObjectResult, results};
use crate::experiment::sweep::{GraspLine, Sweep};
use crate::setup::Setup;
use crate::{output, workers};

/// The published protocol's six, in the order of its table.
const OBJECTS: [&str; 6] = [
    "005_tomato_soup_can",
    "010_potted_meat_can",
    "003_cracker_box",
    "006_mustard_bottle",
    "011_banana",
    "040_large_marker",
];

/// Tries what is missing, prints the figures of all.
pub fn run(args: &SweepArgs) -> Result<Done> {
    let began = Instant::now();
    let sweep = open(args)?;
    sweep.begin(&args.out, args.resume)?;
    let progress = output::progress("grasps");
    let jobs = args.jobs.map_or_else(workers::cores, |jobs| jobs as usize);
    let done = sweep.run(&args.out, jobs, &progress);
    progress.finish_and_clear();
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

fn open(args: &SweepArgs) -> Result<Sweep> {
    let [millimetres, degrees] = args.range[..] else {
        anyhow::bail!("--range: give two numbers, millimetres and degrees, such as 40,45");
    };
    for (value, most, what) in [(millimetres, 200.0, "millimetres"), (degrees, 180.0, "degrees")] {
        ensure!(
            value.is_finite() && (0.0..=most).contains(&value) && value > 0.0,
            "--range: {value} {what}: must be above 0 and at most {most}"
        );
    }
    let setup = setup(args)?;
    let strongest = setup.config.gripper.max_force;
    for (value, most, option) in [(args.friction, 2.0, "--friction"), (args.force, strongest, "--force")] {
        if let Some(value) = value {
            ensure!(
                value.is_finite() && value > 0.0 && value <= most,
                "{option} {value}: must be above 0 and at most {most}"
            );
        }
    }
    if let Some((_, twice)) = args.axes.iter().enumerate().find(|(i, axis)| args.axes[..*i].contains(axis)) {
        bail!("--axes: {} is given twice; once is enough", twice.name());
    }
    let (metres, radians) = (1e-3 * millimetres, degrees.to_radians());
    let cases = match args.mode {
        Mode::Axis => along_axes(&args.axes, metres, radians, args.samples.unwrap_or(9)),
        Mode::Isotropic => {
            ensure!(
                args.axes == Axis::ALL,
                "--axes: is for --mode axis; isotropic errors are in all directions"
            );
            isotropic(metres, radians, args.samples.unwrap_or(20))
        }
    };
    let objects: Vec<String> = match args.objects.as_slice() {
        [] => OBJECTS.map(String::from).to_vec(),
        given => given.to_vec(),
    };
    for (i, object) in objects.iter().enumerate() {
        ensure!(!objects[..i].contains(object), "{object} is given twice; once is enough");
        setup.library.load(object).with_context(|| "objects to try".to_string())?;
    }
    let last = args.seed.checked_add(u64::from(args.seeds));
    ensure!(last.is_some(), "--seed {}: too large; give a lower one", args.seed);
    Ok(Sweep {
        planner: setup.planner(GraspAt::Best.into()),
        setup,
        objects,
        seeds: (args.seed, args.seeds),
        cases,
        strategy: args.grasp,
        friction: args.friction,
        force_n: args.force,
    })
}

/// The scene that the objects are laid out in.
fn setup(args: &SweepArgs) -> Result<Setup> {
    let scene_args = SceneArgs {
        scene: args.scene.clone(),
        seed: args.seed,
        // Nothing is drawn.
        renderer: Renderer::Cpu,
        ycb: args.ycb.clone(),
        robot: args.robot.robot.clone(),
        package_path: args.robot.package_path.clone(),
    };
    Setup::open(&scene_args, "scenes/grocery.toml", "base")
}

/// The figures of a sweep: a table, or JSON.
pub fn print(lines: &[GraspLine], json: bool) -> Result<()> {
    let objects = results(lines);
    if json {
        let summary = serde_json::json!({
            "schema": "grip.sweep.summary/1",
            "grasps": lines.len(),
            "objects": objects,
        });
        return output::data(format_args!("{}", serde_json::to_string_pretty(&summary)?));
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
