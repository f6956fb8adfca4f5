//! `grip robot`: what was loaded, joints and limits.

use std::path::Path;

use anyhow::Result;
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

/// Prints joints, limits and the count of what was read.
pub fn run(args: &RobotArgs) -> Result<Done> {
    let (urdf, robot) = args.robot.model()?;
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
        })?;
        return Ok(Done::Fully);
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
    Ok(Done::Fully)
}
