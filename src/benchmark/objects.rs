//! Models of a data set as the estimators want them.

use std::sync::Arc;

use anyhow::Result;
use grip_sim::bop::Dataset;
use grip_sim::objects::{Fragility, ObjectInfo, ObjectModel};

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
