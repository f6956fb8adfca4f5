//! Whether posteriors hold the truth as often as they say.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result};
use grip_perception::metrics::credible_level;
use grip_sim::bop::{Dataset, Symmetries};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::estimates::PosteriorLine;
use super::evaluation::views;

/// Credible levels that are counted.
pub const LEVELS: [f64; 2] = [0.5, 0.9];
/// Bins of the ranks' histogram.
const BINS: usize = 10;

/// Where the truth lies in the posteriors of some objects. Of a belief that is right its ranks are uniform.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Credibility {
    /// How many, all of objects that are there.
    pub cases: usize,
    /// Share of them whose truth is in the smallest regions that hold 50 % and 90 % of the belief.
    pub within: [f64; 2],
    /// Share of them by the truth's rank: the belief's mass at poses that are more probable, in tenths.
    pub ranks: [f64; BINS],
    /// Median standard deviation of position in the best mode, metres.
    pub median_position_std_m: f64,
    /// Mean mass of the best mode.
    pub best_mass: f64,
}

/// Of a file of posteriors, in all and by view.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Credibilities {
    /// All.
    pub all: Credibility,
    /// By view, where the scenes tell the views' names.
    pub conditions: BTreeMap<String, Credibility>,
}

/// Compares posteriors (`grip estimate --posteriors`) with the truth. Of several instances the one counts that is most probable;
/// objects that are not there do not count.
///
/// # Errors
/// When a file cannot be read, or none of the posteriors is of an object that is there.
pub fn credibility(dataset: &Dataset, posteriors: &Path) -> Result<Credibilities> {
    let file = posteriors.display();
    let text = grip_sim::files::read_to_string(posteriors)
        .context("posteriors, as grip estimate --posteriors FILE writes them")?;
    let lines: Vec<PosteriorLine> = (1..)
        .zip(text.lines())
        .map(|(number, line)| serde_json::from_str(line).with_context(|| format!("{file}, line {number}")))
        .collect::<Result<_>>()?;
    let symmetries: BTreeMap<u32, Symmetries> =
        dataset.models_info()?.into_iter().map(|(id, info)| (id, info.symmetries)).collect();
    let names = views(dataset)?;
    let level = |line: &PosteriorLine| -> Result<Option<f64>> {
        let none = Symmetries::default();
        let symmetries = symmetries.get(&line.obj_id).unwrap_or(&none);
        let truths = dataset.ground_truths(line.scene_id, line.im_id)?;
        let levels = truths
            .iter()
            .filter(|truth| truth.obj_id == line.obj_id && truth.is_target())
            .filter_map(|truth| credible_level(&line.modes, &truth.camera_from_object, symmetries));
        Ok(levels.min_by(f64::total_cmp))
    };
    let levels: Vec<Option<f64>> = lines.par_iter().map(level).collect::<Result<_>>()?;
    let mut all = Vec::new();
    let mut by_view: BTreeMap<String, Vec<(f64, &PosteriorLine)>> = BTreeMap::new();
    for (line, level) in lines.iter().zip(levels) {
        let Some(level) = level else { continue };
        all.push((level, line));
        if let Some(name) = names.get(&(line.scene_id, line.im_id)) {
            by_view.entry(name.clone()).or_default().push((level, line));
        }
    }
    let all = summary(&all).with_context(|| {
        format!("{file}: holds no posterior of an object that is in {}", dataset.root().display())
    })?;
    let conditions = by_view.into_iter().filter_map(|(name, cases)| Some((name, summary(&cases)?))).collect();
    Ok(Credibilities { all, conditions })
}

fn summary(cases: &[(f64, &PosteriorLine)]) -> Option<Credibility> {
    let count = cases.len() as f64;
    let share =
        |of: &dyn Fn(f64) -> bool| cases.iter().filter(|(level, _)| of(*level)).count() as f64 / count;
    let bin = |level: f64| ((level * BINS as f64) as usize).min(BINS - 1);
    let mut spreads: Vec<f64> =
        cases.iter().filter_map(|(_, line)| Some(line.modes.first()?.position_std_m)).collect();
    spreads.sort_by(f64::total_cmp);
    let best = cases.iter().filter_map(|(_, line)| Some(line.modes.first()?.mass)).sum::<f64>();
    Some(Credibility {
        cases: cases.len(),
        within: LEVELS.map(|wanted| share(&|level| level <= wanted)),
        ranks: std::array::from_fn(|i| share(&|level| bin(level) == i)),
        median_position_std_m: *spreads.get(spreads.len() / 2)?,
        best_mass: best / count,
    })
}
