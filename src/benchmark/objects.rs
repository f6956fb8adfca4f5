//! Models of a data set as the estimators want them.

use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::Result;
use grip_sim::bop::Dataset;
use grip_sim::objects::{self, Fragility, ObjectInfo, ObjectModel};
use serde_json::Value;

use crate::assets;

/// YCB-Video as the BOP challenge calls it; our own table has its numbers.
const YCB_VIDEO: &str = "ycbv";

/// The names of objects by our table, for our own sets and for YCB-Video; others number their objects as they like, and nothing is known
/// of these.
pub fn names(dataset: &Dataset) -> BTreeMap<u32, String> {
    let plan = std::fs::read(dataset.root().join("dataset.json"));
    let ycb_video = || {
        let root = dataset.root().canonicalize().unwrap_or_else(|_| dataset.root().to_path_buf());
        root.file_name().is_some_and(|name| name.eq_ignore_ascii_case(YCB_VIDEO))
    };
    // What has numbers alone is better than nothing.
    if plan.is_err() && !ycb_video() {
        return BTreeMap::new();
    }
    let table = objects::table::load(&assets::find("scenes/objects.toml")).unwrap_or_default();
    let mut names: BTreeMap<u32, String> = table.into_iter().map(|row| (row.bop_id, row.name)).collect();
    let plan: Value = plan.ok().and_then(|plan| serde_json::from_slice(&plan).ok()).unwrap_or_default();
    for own in plan["own_objects"].as_array().into_iter().flatten() {
        if let (Some(id), Some(name)) = (own["info"]["bop_id"].as_u64(), own["info"]["name"].as_str()) {
            names.insert(id as u32, name.to_owned());
        }
    }
    names
}

/// What to call an object: its name, else its number.
pub fn title(names: &BTreeMap<u32, String>, id: u32) -> String {
    names.get(&id).cloned().unwrap_or_else(|| format!("object {id}"))
}

/// The model of object `id`, named as its file is. Nothing is known of mass and friction, and no estimator asks.
pub fn load(dataset: &Dataset, id: u32) -> Result<Arc<ObjectModel>> {
    let info = ObjectInfo {
        name: format!("obj_{id:06}"),
        bop_id: id,
        mass_kg: 0.0,
        friction: 0.0,
        symmetric: false,
        fragility: Fragility::Sturdy,
        upright: false,
        revolution: None,
        half_turns: Vec::new(),
    };
    Ok(Arc::new(ObjectModel::new(info, dataset.load_model(id)?, Vec::new())))
}
