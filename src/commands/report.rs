//! `grip report`: a page and CSV files of experiments.

use anyhow::{Context, Result, ensure};
use grip_sim::bop;

use super::Done;
use super::output;
use crate::cli::ReportArgs;
use crate::experiment::report::{Sources, html, tables};

/// Reads, draws, writes.
pub fn run(args: &ReportArgs) -> Result<Done> {
    ensure!(!args.out.is_dir(), "{}: is a folder; give the page's file", args.out.display());
    let sources = Sources::read(&args.sources)?;
    if let Some(folder) = args.out.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).with_context(|| format!("{}: cannot be made", folder.display()))?;
    }
    let page = html(&sources)?;
    for (name, text) in tables(&sources)? {
        let path = args.out.with_extension(format!("{name}.csv"));
        bop::write_atomic(&path, text.as_bytes())?;
        output::message(format_args!("table: {}", path.display()));
    }
    bop::write_atomic(&args.out, page.as_bytes())?;
    output::message(format_args!("page: {}", args.out.display()));
    Ok(Done::Fully)
}
