//! `grip campaign run`: some units, by whoever is asked to.

use anyhow::Result;

use super::Within;
use super::work::Opened;
use crate::campaign::unit::{self, Outcome, Work};
use crate::campaign::{Campaign, node, select};
use crate::cli::CampaignRunArgs;
use crate::commands::Done;
use crate::commands::output::{self, Bar};
use crate::workers;

/// Runs what of the units is not done. An error that would pass makes it worth while to try again; all others speak of the campaign, and
/// no task of it can run.
pub fn run(args: &CampaignRunArgs) -> Result<Done> {
    match run_units(args) {
        Err(error) if unit::passes(&error) => {
            output::message(format_args!("error: {error:#}\ntry again"));
            Ok(Done::Again)
        }
        other => other,
    }
}

fn run_units(args: &CampaignRunArgs) -> Result<Done> {
    let campaign = Campaign::open(&args.folder)?;
    let manifest = &campaign.manifest;
    let variable = |name: &str| std::env::var(name).ok();
    let units = select::units(manifest.units.len(), args.unit.as_ref(), args.shard, variable)?;
    let mut tally = Tally::default();
    let mut missing = Vec::new();
    for number in units {
        if unit::done(&campaign, number)?.is_some() {
            tally.was_done += 1;
        } else if let Some(failed) = unit::failed(&campaign, number).filter(|_| !args.again) {
            tally.failed(number, &failed.reason);
        } else {
            missing.push(number);
        }
    }
    if missing.is_empty() {
        return Ok(tally.end());
    }

    let node = node::this(&campaign)?;
    if node.build_sha256 != manifest.build_sha256 {
        log::warn!(
            "{}: was planned by another build; results may differ in last bits",
            campaign.folder.display()
        );
    }
    campaign.check_inputs()?;
    let _within = Within::folder(&campaign.base())?;
    let films = matches!(manifest.work, crate::campaign::manifest::Job::Trials { films: true, .. });
    let work = Opened::open(manifest.work.verb(), &manifest.options, films)?;
    let (name, now) = work.manifest()?;
    campaign.check_same(name, &now)?;

    let jobs = args.jobs.map_or_else(workers::cores, |jobs| jobs as usize);
    for number in missing {
        let progress = Bar::new(&format!("results of unit {number}"));
        let ran = unit::run(&campaign, number, &work as &dyn Work, &node, jobs, &progress);
        progress.finish();
        match ran {
            Ok(Outcome::Done(_)) => tally.done += 1,
            Ok(Outcome::WasDone) => tally.was_done += 1,
            Ok(Outcome::Failed(reason)) => tally.failed(number, &reason),
            // Others may run the next ones.
            Err(error) if error.is::<unit::Busy>() => {
                output::message(format_args!("unit {number}: {error:#}"));
                tally.busy += 1;
            }
            Err(error) => return Err(error.context(format!("unit {number}"))),
        }
    }
    Ok(tally.end())
}

/// What became of the units.
#[derive(Debug, Default)]
struct Tally {
    done: usize,
    was_done: usize,
    failed: usize,
    busy: usize,
}

impl Tally {
    fn failed(&mut self, unit: usize, reason: &str) {
        output::message(format_args!("unit {unit}: cannot be done: {reason}"));
        self.failed += 1;
    }

    /// To try again is said before that something cannot be done: what is left is run then, and what cannot be done is not tried again.
    fn end(&self) -> Done {
        let Self { done, was_done, failed, busy } = self;
        output::message(format_args!(
            "{done} units done, {was_done} before, {failed} cannot be done, {busy} run by others"
        ));
        match (busy, failed) {
            (1.., _) => Done::Again,
            (0, 1..) => Done::Short,
            (0, 0) => Done::Fully,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exit_code_says_what_an_engine_should_do() {
        let end = |failed, busy| Tally { failed, busy, ..Tally::default() }.end();
        assert_eq!(end(0, 0), Done::Fully);
        assert_eq!(end(1, 0), Done::Short);
        assert_eq!((end(0, 1), end(1, 1)), (Done::Again, Done::Again));
    }
}
