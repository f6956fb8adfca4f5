//! Poses from a results file in BOP's format.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use grip_perception::PosePosterior;
use grip_sim::bop::results::{Estimate, read_results};
use grip_sim::pose::Pose;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::{Estimates, Look, Perception};

/// Poses that anyone estimated, from a results file in BOP's format: `scene_id` is the trial's seed, `im_id` the number of
/// the look, from 0 on.
///
/// A look that the file says nothing of takes the estimates of the last one before it: a file for the first look alone makes
/// a robot that looks once. Trials repeat, so the frames of such a trial (`--bop`), estimated and added to the file, make one
/// that has looked again. A pose in the file is believed: scores rank, and no more.
pub struct Recorded {
    path: PathBuf,
    sha256: String,
    by_look: BTreeMap<(u64, usize), Vec<Estimate>>,
}

impl Recorded {
    /// Reads a results file.
    ///
    /// # Errors
    /// When it cannot be read, or a line is wrong.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path)
            .with_context(|| format!("{}: cannot be read; --estimator csv:FILE", path.display()))?;
        let mut by_look: BTreeMap<_, Vec<Estimate>> = BTreeMap::new();
        for estimate in read_results(path)? {
            let look = (u64::from(estimate.scene_id), estimate.im_id as usize);
            by_look.entry(look).or_default().push(estimate);
        }
        Ok(Self { path: path.to_path_buf(), sha256: format!("{:x}", Sha256::digest(bytes)), by_look })
    }

    /// Whether the file has a row for a trial with this seed.
    pub fn knows(&self, seed: u64) -> bool {
        self.by_look.range((seed, 0)..=(seed, usize::MAX)).next().is_some()
    }
}

impl Perception for Recorded {
    /// The best scored pose of each object that the file has one of; of several of a kind as many as there are.
    fn look(&self, look: &Look<'_>) -> Result<Estimates> {
        let known = self.by_look.range((look.seed, 0)..=(look.seed, look.number())).next_back();
        let Some((&(_, of_look), rows)) = known else { return Ok(Vec::new()) };
        // The camera may stand elsewhere than when the file's image was taken.
        let now_from_then = look.cameras[look.number()].iso().inverse() * look.cameras[of_look].iso();
        let best = |i: usize| {
            let id = look.models[i].info.bop_id;
            let mut of: Vec<&Estimate> = rows.iter().filter(|row| row.obj_id == id).collect();
            of.sort_by(|a, b| b.score.total_cmp(&a.score));
            // The first of a kind has the best row, the second the next; where there are rows for those alone that are asked
            // for, these are counted.
            let same = |&other: &usize| look.models[other].info.bop_id == id;
            let asked = look.asked.iter().filter(|other| same(other));
            let rank = if of.len() > asked.clone().count() {
                (0..i).filter(same).count()
            } else {
                asked.filter(|other| **other < i).count()
            };
            of.get(rank).copied()
        };
        let found = look.asked.iter().filter_map(|&i| {
            let row = best(i)?;
            let pose = Pose::new(now_from_then * row.camera_from_object.iso());
            let mut posterior = PosePosterior::certain(&look.models[i].info.name, pose);
            // A file's time is that of the whole image, and what is kept takes none.
            let share = 1.0 / rows.len() as f64;
            posterior.seconds =
                if of_look == look.number() { share * row.time_s.unwrap_or(0.0) } else { 0.0 };
            Some((i, posterior))
        });
        Ok(found.collect())
    }

    /// A results file does not say where those are.
    fn look_into_bin(&self, _: &Look<'_>) -> Result<Estimates> {
        Ok(Vec::new())
    }

    fn description(&self) -> Value {
        json!({ "name": "csv", "path": self.path.to_string_lossy(), "sha256": self.sha256 })
    }
}
