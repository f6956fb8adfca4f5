//! `grip merge`: an experiment from its shards.

use anyhow::Result;

use super::output;
use super::{Done, trials};
use crate::cli::MergeArgs;
use crate::experiment::merge::{Merged, merge};
use crate::experiment::plan::{expected, read_manifest};

/// Merges, prints the figures of the whole.
pub fn run(args: &MergeArgs) -> Result<Done> {
    let Merged { results, left_out } = merge(&args.folders, &args.out)?;
    trials::print(&results, args.json)?;
    let of = expected(&read_manifest(&args.out)?);
    if left_out > 0 {
        output::message(format_args!("{left_out} of {of} trials have no result: they could not be laid out"));
    }
    if results.len() + left_out < of {
        output::message(format_args!(
            "{} of {of} trials are there: a shard is missing, or not done; merge again when it is",
            results.len() + left_out
        ));
    }
    output::message(format_args!("experiment: {}", args.out.display()));
    Ok(Done::Fully)
}
