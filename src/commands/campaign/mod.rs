//! `grip campaign`: plan, run, status, merge.

mod merge;
mod plan;
mod run;
mod status;
mod work;

use anyhow::Result;

use super::Done;
use crate::cli::{CampaignArgs, CampaignCommand};

/// Does what is asked for.
pub fn run(args: &CampaignArgs) -> Result<Done> {
    match &args.command {
        CampaignCommand::Plan(args) => plan::run(args),
        CampaignCommand::Run(args) => run::run(args),
        CampaignCommand::Status(args) => status::run(args),
        CampaignCommand::Merge(args) => merge::run(args),
    }
}
