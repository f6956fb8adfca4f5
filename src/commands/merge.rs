//! `grip merge`: an experiment from its shards.

use anyhow::Result;

use super::{Done, trials};
use crate::cli::MergeArgs;
use crate::experiment::merge::merge;
use crate::output;

/// Merges, prints the figures of the whole.
pub fn run(args: &MergeArgs) -> Result<Done> {
    let merged = merge(&args.folders, &args.out)?;
    trials::print(&merged, args.json)?;
    output::message(format_args!("experiment: {}", args.out.display()));
    Ok(Done::Fully)
}
