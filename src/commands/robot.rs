//! `grip robot`: what was loaded, joints and limits; whether it fits a scene; how it looks; a first file of its settings.

use std::path::Path;

use crate::robot::{RobotCheck, check, portrait};
use crate::setup::{GROCERY, Setup, SetupOptions};
use crate::{assets, pictures};
use anyhow::{Context, Result, anyhow, ensure};
use grip_sim::render::{self, RendererChoice};
use schemars::JsonSchema;
use serde::Serialize;

use super::Done;
use super::output;
use crate::cli::RobotArgs;

/// Version of what `--json` prints.
pub const SCHEMA: &str = "grip.robot/2";

/// What `--json` prints.
#[derive(Serialize, JsonSchema)]
pub struct RobotReport<'a> {
    schema: &'static str,
    name: &'a str,
    #[serde(serialize_with = "grip_sim::files::shown")]
    urdf: &'a Path,
    links: usize,
    meshes: usize,
    visuals: usize,
    collisions: usize,
    /// Why it cannot take the Fetch's place in trials; null when it can.
    unfit: Option<String>,
    /// Those that move.
    joints: Vec<JointReport<'a>>,
    /// What `--check` found; null without it.
    check: Option<RobotCheck>,
}

/// A joint; radians or metres.
#[derive(Serialize, JsonSchema)]
struct JointReport<'a> {
    name: &'a str,
    /// `revolute`, `continuous` or `prismatic`.
    kind: String,
    /// Null where it turns on and on.
    lower: Option<f64>,
    upper: Option<f64>,
    /// A second. Null where the URDF has no such limit.
    velocity: Option<f64>,
    /// Newtons or newton metres. Null where the URDF has no such limit.
    effort: Option<f64>,
}

/// Prints joints, limits and the count of what was read, and what was asked for beside.
pub fn run(args: &RobotArgs) -> Result<Done> {
    let (urdf, robot) = args.robot.model()?;
    if let Some(path) = &args.write_config {
        ensure!(!path.exists(), "{}: is there; choose another name, or remove it", path.display());
        let text = robot.guessed_config().map_err(|reason| anyhow!("{}: {reason}", urdf.display()))?;
        save(path, text.as_bytes())?;
        output::message(format_args!(
            "{}: check what is marked CHECK, then: grip robot --robot {} --robot-config {} --check --scene SCENE",
            path.display(),
            urdf.display(),
            path.display()
        ));
        return Ok(Done::Fully);
    }
    if args.find_allowed {
        let robot = match &args.robot.robot_config {
            Some(_) => args.robot.configured(&urdf, robot)?.0,
            None => robot,
        };
        output::data(format_args!("{}", robot.sampled_pairs_toml()))?;
        return Ok(Done::Fully);
    }
    let checked = in_scene(args)?;
    let done = match &checked {
        Some(check) if !check.problems.is_empty() => Done::Short,
        _ => Done::Fully,
    };
    let unfit = args.robot.configured(&urdf, robot.clone()).err().map(|error| format!("{error:#}"));
    let loaded = robot.loaded();
    if args.json {
        let finite = |v: f64| v.is_finite().then_some(v);
        let joints = robot.joints().iter().map(|joint| JointReport {
            name: &joint.name,
            kind: format!("{:?}", joint.kind).to_lowercase(),
            lower: finite(joint.limits.lower),
            upper: finite(joint.limits.upper),
            velocity: finite(joint.limits.velocity),
            effort: finite(joint.limits.effort),
        });
        output::json(&RobotReport {
            schema: SCHEMA,
            name: robot.name(),
            urdf: &urdf,
            links: loaded.links,
            meshes: loaded.meshes,
            visuals: loaded.visuals,
            collisions: loaded.collisions,
            unfit,
            joints: joints.collect(),
            check: checked,
        })?;
        return Ok(done);
    }
    output::data(format_args!(
        "{} from {}: {} links, {} movable joints, {} visuals, {} collision shapes, {} mesh files\n",
        robot.name(),
        urdf.display(),
        loaded.links,
        loaded.joints,
        loaded.visuals,
        loaded.collisions,
        loaded.meshes
    ))?;
    let shown = |v: f64, digits: usize| if v.is_finite() { format!("{v:.digits$}") } else { "-".to_string() };
    let rows = robot.joints().iter().map(|joint| {
        [
            joint.name.clone(),
            format!("{:?}", joint.kind).to_lowercase(),
            shown(joint.limits.lower, 4),
            shown(joint.limits.upper, 4),
            shown(joint.limits.velocity, 3),
            shown(joint.limits.effort, 2),
        ]
    });
    let header = ["joint", "kind", "lower", "upper", "velocity", "effort"];
    let table = output::table(header, &[2, 3, 4, 5], rows);
    output::data(format_args!("{table}"))?;
    if let Some(reason) = unfit {
        output::message(format_args!(
            "it can be looked at here, but not take the Fetch's place in trials: {reason}"
        ));
    }
    if let Some(check) = &checked {
        print(check)?;
    }
    Ok(done)
}

/// Writes a file whole, in a folder that is made where it is missing.
fn save(path: &Path, bytes: &[u8]) -> Result<()> {
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot be made; give another place", folder.display()))?;
    }
    Ok(grip_sim::bop::write_atomic(path, bytes)?)
}

/// Draws and checks the robot in a scene, as far as asked for.
fn in_scene(args: &RobotArgs) -> Result<Option<RobotCheck>> {
    if !args.check && args.draw.is_none() {
        ensure!(args.scene.is_none(), "--scene: is for --check and --draw");
        return Ok(None);
    }
    let setup = Setup::open(&SetupOptions {
        scene: args.scene.clone().unwrap_or_else(|| assets::find(GROCERY)),
        robot: args.robot.robot.clone(),
        robot_config: args.robot.robot_config.clone(),
        package_path: args.robot.package_path.clone(),
        ..SetupOptions::default()
    })?;
    if let Some(path) = &args.draw {
        let mut renderer = render::open(RendererChoice::Auto)?;
        let picture = portrait(&setup, renderer.as_mut())?;
        save(path, &pictures::rgb_png(&picture)?)?;
        output::message(format_args!("{}", path.display()));
    }
    args.check.then(|| check(&setup)).transpose()
}

/// Prints what a check found.
fn print(check: &RobotCheck) -> Result<()> {
    let rows = check.poses.iter().map(|pose| {
        let touching = if pose.touching.is_empty() { "free".to_owned() } else { pose.touching.join("; ") };
        [pose.name.clone(), touching]
    });
    output::data(format_args!("\n{}", output::table(["pose", "touching"], &[], rows)))?;
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let row = |what: &str, shares: [f64; 3]| {
        let [down, leaning, dead] = shares.map(percent);
        [what.to_owned(), down, leaning, dead]
    };
    let [table, bin] = check.out_of_reach;
    let rows = [
        row("grasps over the region", [check.grasps_straight_down, check.grasps, table]),
        row("places over the bin", [check.places_straight_down, check.places, bin]),
    ];
    let header = ["within reach", "straight down", "or leaning", "points without"];
    output::data(format_args!("{}", output::table(header, &[1, 2, 3], rows)))?;
    let rows = check.objects.iter().map(|object| [object.name.clone(), object.grasps.to_string()]);
    output::data(format_args!("{}", output::table(["object", "grasps"], &[1], rows)))?;
    match check.problems.as_slice() {
        [] => output::data(format_args!("it fits"))?,
        problems => {
            for problem in problems {
                output::data(format_args!("does not fit: {problem}"))?;
            }
        }
    }
    Ok(())
}
