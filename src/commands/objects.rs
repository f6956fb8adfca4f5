//! `grip objects`: the table of objects and which set is in use.

use anyhow::Result;

use super::Done;
use super::output;
use crate::cli::ObjectsArgs;
use grip::setup;

/// Prints the table.
pub fn run(args: &ObjectsArgs) -> Result<Done> {
    let library = setup::library(args.ycb.clone())?;
    let infos = library.names().map(|name| library.info(name)).collect::<Result<Vec<_>, _>>()?;
    if args.json {
        let json = serde_json::json!({
            "schema": "grip.objects/1",
            "object_set": library.set().label(),
            "objects": infos,
        });
        output::data(format_args!("{}", serde_json::to_string_pretty(&json)?))?;
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
