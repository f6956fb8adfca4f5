//! `grip robot`: what was loaded, joints and limits.

use std::path::Path;

use anyhow::Result;
use schemars::JsonSchema;
use serde::Serialize;

use super::Done;
use super::output;
use crate::cli::RobotArgs;

/// Version of what `--json` prints.
pub const SCHEMA: &str = "grip.robot/1";

/// What `--json` prints.
#[derive(Serialize, JsonSchema)]
pub struct RobotReport<'a> {
    schema: &'static str,
    name: &'a str,
    urdf: &'a Path,
    links: usize,
    meshes: usize,
    visuals: usize,
    collisions: usize,
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
    /// A second.
    velocity: f64,
    /// Newtons or newton metres.
    effort: f64,
}

/// Prints joints, limits and the count of what was read.
pub fn run(args: &RobotArgs) -> Result<Done> {
    let (urdf, robot, _) = args.robot.load()?;
    let loaded = robot.loaded();
    if args.json {
        let finite = |v: f64| v.is_finite().then_some(v);
        let joints = robot.joints().iter().map(|joint| JointReport {
            name: &joint.name,
            kind: format!("{:?}", joint.kind).to_lowercase(),
            lower: finite(joint.limits.lower),
            upper: finite(joint.limits.upper),
            velocity: joint.limits.velocity,
            effort: joint.limits.effort,
        });
        output::json(&RobotReport {
            schema: SCHEMA,
            name: robot.name(),
            urdf: &urdf,
            links: loaded.links,
            meshes: loaded.meshes,
            visuals: loaded.visuals,
            collisions: loaded.collisions,
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
    let bound = |v: f64| if v.is_finite() { format!("{v:.4}") } else { "-".to_string() };
    let rows = robot.joints().iter().map(|joint| {
        [
            joint.name.clone(),
            format!("{:?}", joint.kind).to_lowercase(),
            bound(joint.limits.lower),
            bound(joint.limits.upper),
            format!("{:.3}", joint.limits.velocity),
            format!("{:.2}", joint.limits.effort),
        ]
    });
    let header = ["joint", "kind", "lower", "upper", "velocity", "effort"];
    let table = output::table(header, &[2, 3, 4, 5], rows);
    output::data(format_args!("{table}"))?;
    Ok(Done::Fully)
}
