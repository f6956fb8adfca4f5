//! `grip convert`: a recording as one MCAP file.

use std::io::Read;
use std::path::Path;

use anyhow::{Context, Result, ensure};

use super::Done;
use super::output;
use crate::cli::ConvertArgs;
use crate::record::mcap;

/// Reads the recording and writes the file.
pub fn run(args: &ConvertArgs) -> Result<Done> {
    let file = &args.out;
    check_replaceable(file)?;
    let bytes = mcap::bytes(&args.recording)?;
    if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot be made; give another --out", folder.display()))?;
    }
    grip_sim::bop::write_atomic(file, &bytes)?;
    output::made("MCAP", file);
    Ok(Done::Fully)
}

/// Only an earlier file of the kind may be replaced.
fn check_replaceable(file: &Path) -> Result<()> {
    if !file.exists() {
        return Ok(());
    }
    let mut begin = Vec::new();
    let opened = std::fs::File::open(file).and_then(|file| file.take(8).read_to_end(&mut begin));
    ensure!(
        opened.is_ok() && begin == mcap::MAGIC,
        "{}: exists and is no MCAP file; give another --out",
        file.display()
    );
    Ok(())
}
