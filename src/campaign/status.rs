//! What of a campaign is done, and what is missing.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Result;
use schemars::JsonSchema;
use serde::Serialize;

use super::manifest::{Campaign, Job};
use super::select::ranges;
use super::unit;
use crate::benchmark::finished_images;
use crate::experiment::{plan, sweep};

/// Version of what `--json` prints.
pub const SCHEMA: &str = "grip.campaign.status/1";

/// How a campaign stands.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Status {
    schema: &'static str,
    /// Its name.
    pub name: String,
    /// All units.
    pub units: usize,
    /// Units that are done.
    pub done: usize,
    /// Numbers of the units that are to be run, for `sbatch --array` and `grip campaign run --unit`: not those that cannot be done.
    pub missing: String,
    /// Those of them that have been begun.
    pub begun: Vec<Begun>,
    /// Units that cannot be done.
    pub failed: Vec<Failed>,
    /// All results, with those that may be left out.
    pub results: u64,
    /// Results that there are, with those left out.
    pub have: u64,
    /// Results that cannot be had: no layout, no grasp.
    pub left_out: u64,
    /// What is missing would take so long, one unit after the other as they were run until now; none before there is one.
    pub left_s: Option<f64>,
    /// The machines by what they are and compute, each with the number of units that it has done.
    pub machines: Vec<Machines>,
    /// Whether canaries differ: results of the units may then differ in last bits from those of one machine.
    pub mixed: bool,
}

/// A unit that is not done but has been begun.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Begun {
    /// Its number.
    pub unit: usize,
    /// Results that it has, with those left out.
    pub have: u64,
    /// How many it is to have.
    pub of: u64,
    /// Whether somebody runs it now.
    pub running: bool,
}

/// A unit that cannot be done.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Failed {
    /// Its number.
    pub unit: usize,
    /// What was said.
    pub reason: String,
}

/// Machines that are of one kind, as far as it is known.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Machines {
    /// Model of the processor.
    pub cpu: String,
    /// What the canary comes to.
    pub canary: String,
    /// SHA-256 of the program's file.
    pub build_sha256: Option<String>,
    /// Units that they have done.
    pub units: usize,
}

impl Status {
    /// Looks at every unit.
    ///
    /// # Errors
    /// When a unit's done.json is damaged or of another campaign.
    pub fn of(campaign: &Campaign) -> Result<Self> {
        let work = &campaign.manifest.work;
        let mut machines: BTreeMap<(String, String, Option<String>), usize> = BTreeMap::new();
        let (mut missing, mut begun, mut failed) = (Vec::new(), Vec::new(), Vec::new());
        let (mut results, mut have, mut left_out, mut done) = (0, 0, 0, 0);
        let (mut seconds, mut made) = (0.0, 0);
        for (number, unit) in campaign.manifest.units.iter().enumerate() {
            let of = work.results(unit);
            results += of;
            if let Some(file) = unit::done(campaign, number)? {
                done += 1;
                have += file.results + file.left_out;
                left_out += file.left_out;
                seconds += file.wall_s;
                made += file.made;
                let node = file.node;
                *machines.entry((node.cpu, node.canary, node.build_sha256)).or_default() += 1;
                continue;
            }
            let folder = campaign.unit_folder(number);
            if folder.is_dir() {
                let there = partly(work, &folder);
                have += there;
                if let Some(file) = unit::failed(campaign, number) {
                    failed.push(Failed { unit: number, reason: file.reason });
                    continue;
                }
                let running = unit::is_running(campaign, number);
                begun.push(Begun { unit: number, have: there, of, running });
            }
            missing.push(number);
        }
        let canaries: std::collections::BTreeSet<&String> =
            machines.keys().map(|(_, canary, _)| canary).collect();
        let mixed = canaries.len() > 1;
        Ok(Self {
            schema: SCHEMA,
            name: campaign.manifest.name.clone(),
            units: campaign.manifest.units.len(),
            done,
            missing: ranges(missing),
            begun,
            failed,
            results,
            have,
            left_out,
            left_s: (made > 0).then(|| seconds / made as f64 * (results - have.min(results)) as f64),
            machines: machines
                .into_iter()
                .map(|((cpu, canary, build_sha256), units)| Machines { cpu, canary, build_sha256, units })
                .collect(),
            mixed,
        })
    }

    /// Whether all units are done.
    pub fn complete(&self) -> bool {
        self.done == self.units
    }
}

/// How many results a unit has that is not done.
fn partly(work: &Job, folder: &Path) -> u64 {
    let lines = |name: &str| {
        let bytes = std::fs::read(folder.join(name)).unwrap_or_default();
        bytes.iter().filter(|&&byte| byte == b'\n').count() as u64
    };
    match work {
        Job::Trials { .. } => lines(plan::TRIALS) + lines(plan::LEFT_OUT),
        Job::Sweep { .. } => lines(sweep::GRASPS),
        Job::Scenes { split } => {
            let entries = std::fs::read_dir(folder.join(split)).into_iter().flatten().flatten();
            entries.filter(|entry| !entry.file_name().to_string_lossy().starts_with('.')).count() as u64
        }
        Job::Estimate { .. } => finished_images(&folder.join(super::merge::RESULTS)) as u64,
    }
}
