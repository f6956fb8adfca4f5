//! `grip campaign merge`.

use anyhow::Result;

use crate::campaign::{Campaign, Verb, merge};
use crate::cli::CampaignMergeArgs;
use crate::commands::Done;
use crate::commands::output::{self, Bar};

/// Puts all units together.
pub fn run(args: &CampaignMergeArgs) -> Result<Done> {
    let campaign = Campaign::open(&args.folder)?;
    let progress = Bar::new("units");
    let merged = merge::merge(&campaign, &args.out, &progress);
    progress.finish();
    let merged = merged?;
    if args.json {
        output::json(&merged)?;
    } else {
        let out = args.out.display();
        let next = match campaign.manifest.work.verb() {
            Verb::Trials | Verb::Sweep => format!("grip report {out}"),
            Verb::Scenes => format!("grip estimate {out}"),
            Verb::Estimate => format!("grip eval DATASET {out}/{}", merge::RESULTS),
        };
        output::data(format_args!(
            "{out}: {} results of {} units, {} left out\nnext: {next}",
            merged.results, merged.units, merged.left_out
        ))?;
    }
    if merged.canaries.len() > 1 {
        output::message(format_args!(
            "warning: the units were done by machines that do not compute alike (canaries differ; grip campaign status {})",
            args.folder.display()
        ));
    }
    Ok(Done::Fully)
}
