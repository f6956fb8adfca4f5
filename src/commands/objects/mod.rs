//! `grip objects`: the tables of objects and which set is in use.

mod add;

use anyhow::Result;
use grip_sim::objects::ObjectInfo;
use schemars::JsonSchema;
use serde::Serialize;

use super::Done;
use super::output;
use crate::cli::{ObjectsArgs, ObjectsCommand, ObjectsListArgs};
use crate::setup;

/// Version of what `--json` prints.
pub const SCHEMA: &str = "grip.objects/1";

/// What `--json` prints.
#[derive(Serialize, JsonSchema)]
pub struct ObjectList<'a> {
    schema: &'static str,
    object_set: &'a str,
    objects: Vec<&'a ObjectInfo>,
}

/// Prints the tables, or adds an object to one.
pub fn run(args: &ObjectsArgs) -> Result<Done> {
    match &args.command {
        None => list(&args.list),
        Some(ObjectsCommand::List(args)) => list(args),
        Some(ObjectsCommand::Add(args)) => add::run(args),
    }
}

fn list(args: &ObjectsListArgs) -> Result<Done> {
    let library = setup::library(args.ycb.clone(), &args.tables.tables)?;
    let infos: Vec<&ObjectInfo> = library.infos().collect();
    if args.json {
        output::json(&ObjectList { schema: SCHEMA, object_set: library.set().label(), objects: infos })?;
        return Ok(Done::Fully);
    }
    let mut rows = Vec::new();
    for info in infos {
        let size = library.load(&info.name)?.size() * 1e3;
        rows.push([
            info.name.clone(),
            info.bop_id.to_string(),
            format!("{:.0}", info.mass_kg * 1e3),
            format!("{:.0} x {:.0} x {:.0}", size.x, size.y, size.z),
            format!("{:.2}", info.friction),
            if info.symmetric { "ADD-S" } else { "ADD" }.to_string(),
            format!("{:?}", info.fragility).to_lowercase(),
            if info.upright { "yes" } else { "" }.to_string(),
        ]);
    }
    let header = ["object", "id", "mass g", "size mm", "friction", "metric", "fragility", "upright"];
    let table = output::table(header, &[1, 2, 4], rows);
    output::data(format_args!("{table}"))?;
    output::data(format_args!("\nobject set in use: {}", library.set().label()))?;
    Ok(Done::Fully)
}
