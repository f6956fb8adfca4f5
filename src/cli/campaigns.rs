//! The options of campaigns.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use crate::campaign::select::Numbers;
use crate::experiment::plan::Shard;

/// `grip campaign`.
#[derive(Debug, Args)]
pub struct CampaignArgs {
    /// What to do with it.
    #[command(subcommand)]
    pub command: CampaignCommand,
}

/// What to do with a campaign.
#[derive(Debug, Subcommand)]
pub enum CampaignCommand {
    /// Write what is to be run, cut into units, with hashes of all that it depends on.
    Plan(CampaignPlanArgs),
    /// Run units: those that are named, or the one of the engine's task (SLURM_ARRAY_TASK_ID, JOB_COMPLETION_INDEX). Ends with 0 when
    /// they are done, 75 when it is worth while to try again, 1 when a unit cannot be done, 2 when none can.
    Run(CampaignRunArgs),
    /// Tell what is done and what is missing; ends with 1 while something is.
    Status(CampaignStatusArgs),
    /// Put all units together to what one undisturbed run would have written.
    Merge(CampaignMergeArgs),
}

/// `grip campaign plan`.
#[derive(Debug, Args)]
pub struct CampaignPlanArgs {
    /// What is to be run: TOML (docs/campaigns.md).
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Folder of the campaign: a new one, which all machines see.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Print the manifest as one JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

/// `grip campaign run`.
#[derive(Debug, Args)]
pub struct CampaignRunArgs {
    /// Folder of the campaign.
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Numbers and ranges of units, from 0 on: 0-3,7.
    #[arg(long, value_name = "LIST", conflicts_with = "shard")]
    pub unit: Option<Numbers>,
    /// Every N-th unit, beginning with the I-th, one after the other.
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Shard>,
    /// Trials, grasps, scenes or images of a unit run at the same time [default: one a core]; results do not depend on it.
    #[arg(long, value_name = "J", value_parser = clap::value_parser!(u32).range(1..=256))]
    pub jobs: Option<u32>,
    /// Try units again that could not be done.
    #[arg(long)]
    pub again: bool,
}

/// `grip campaign status`.
#[derive(Debug, Args)]
pub struct CampaignStatusArgs {
    /// Folder of the campaign.
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Print the numbers of the missing units alone, for `sbatch --array` and `grip campaign run --unit`.
    #[arg(long, conflicts_with = "json")]
    pub missing: bool,
    /// Print one JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

/// `grip campaign merge`.
#[derive(Debug, Args)]
pub struct CampaignMergeArgs {
    /// Folder of the campaign.
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Folder of the whole: a new one.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Print a summary as one JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}
