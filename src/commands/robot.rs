//! `grip robot`: what was loaded, joints and limits.

use anyhow::Result;

use super::Done;
use super::output;
use crate::cli::RobotArgs;

/// Prints joints, limits and the count of what was read.
pub fn run(args: &RobotArgs) -> Result<Done> {
    let (urdf, robot, _) = args.robot.load()?;
    let loaded = robot.loaded();
    if args.json {
        let joints: Vec<_> = robot
            .joints()
            .iter()
            .map(|joint| {
                let finite = |v: f64| v.is_finite().then_some(v);
                serde_json::json!({
                    "name": joint.name,
                    "kind": format!("{:?}", joint.kind).to_lowercase(),
                    "lower": finite(joint.limits.lower),
                    "upper": finite(joint.limits.upper),
                    "velocity": joint.limits.velocity,
                    "effort": joint.limits.effort,
                })
            })
            .collect();
        let json = serde_json::json!({
            "schema": "grip.robot/1",
            "name": robot.name(),
            "urdf": urdf,
            "links": loaded.links,
            "meshes": loaded.meshes,
            "visuals": loaded.visuals,
            "collisions": loaded.collisions,
            "joints": joints,
        });
        output::data(format_args!("{}", serde_json::to_string_pretty(&json)?))?;
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
