//! `grip objects`: the table of objects and which set is in use.

use anyhow::Result;
use grip_sim::objects::ObjectInfo;
use schemars::JsonSchema;
use serde::Serialize;

use super::Done;
use super::output;
use crate::cli::ObjectsArgs;
use grip::setup;

/// Version of what `--json` prints.
pub const SCHEMA: &str = "grip.objects/1";

/// What `--json` prints.
#[derive(Serialize, JsonSchema)]
pub struct ObjectList<'a> {
    schema: &'static str,
    object_set: &'a str,
    objects: Vec<&'a ObjectInfo>,
}

/// Prints the table.
pub fn run(args: &ObjectsArgs) -> Result<Done> {
    let library = setup::library(args.ycb.clone())?;
    let infos = library.names().map(|name| library.info(name)).collect::<Result<Vec<_>, _>>()?;
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
