//! `grip merge`: an experiment from its shards.

use anyhow::Result;

use super::{Done, trials};
use crate::cli::MergeArgs;
use crate::experiment::merge::merge;
use crate::experiment::plan::{expected, read_manifest};
use crate::output;

/// Merges, prints the figures of the whole.
pub fn run(args: &MergeArgs) -> Result<Done> {
    let merged = merge(&args.folders, &args.out)?;
    trials::print(&merged, args.json)?;
    let of = expected(&read_manifest(&args.out)?);
    if merged.len() < of {
        output::message(format_args!(
            "{} of {of} trials are there: a shard is missing, or not done; merge again when it is",
            merged.len()
        ));
    }
    output::message(format_args!("experiment: {}", args.out.display()));
    Ok(Done::Fully)
}
