//! `grip campaign status`.

use std::time::Duration;

use anyhow::Result;
use indicatif::HumanDuration;

use crate::campaign::Campaign;
use crate::campaign::status::Status;
use crate::cli::CampaignStatusArgs;
use crate::commands::{Done, output};

/// So many of a list are shown.
const SHOWN: usize = 10;

/// Tells how it stands.
pub fn run(args: &CampaignStatusArgs) -> Result<Done> {
    let status = Status::of(&Campaign::open(&args.folder)?)?;
    if args.json {
        output::json(&status)?;
    } else if args.missing {
        output::data(format_args!("{}", status.missing))?;
    } else {
        print(&status)?;
    }
    if status.mixed {
        output::message(format_args!(
            "warning: the machines do not compute alike (canaries differ): results may differ in last bits from those of one machine, and then in anything"
        ));
    }
    Ok(if status.complete() { Done::Fully } else { Done::Short })
}

fn print(status: &Status) -> Result<()> {
    let Status {
        name, units, done, missing, begun, failed, results, have, left_out, left_s, machines, ..
    } = status;
    output::data(format_args!(
        "{name}: {done} of {units} units done; {have} of {results} results, {left_out} of them left out"
    ))?;
    if !missing.is_empty() {
        let time = left_s.map_or(String::new(), |seconds| {
            format!(", {} one unit after the other", HumanDuration(Duration::from_secs_f64(seconds)))
        });
        output::data(format_args!("missing: {missing}{time}"))?;
    }
    for begun in begun.iter().take(SHOWN) {
        let now = if begun.running { ", running" } else { "" };
        output::data(format_args!("unit {}: {} of {}{now}", begun.unit, begun.have, begun.of))?;
    }
    more(begun.len())?;
    for failed in failed.iter().take(SHOWN) {
        output::data(format_args!("unit {}: cannot be done: {}", failed.unit, failed.reason))?;
    }
    more(failed.len())?;
    for machine in machines {
        output::data(format_args!(
            "{} units by {}, canary {}, build {}",
            machine.units,
            machine.cpu,
            short(&machine.canary),
            machine.build_sha256.as_deref().map_or("unknown", short)
        ))?;
    }
    Ok(())
}

fn more(all: usize) -> Result<()> {
    if all > SHOWN {
        output::data(format_args!("and {} more", all - SHOWN))?;
    }
    Ok(())
}

fn short(sha256: &str) -> &str {
    sha256.get(..12).unwrap_or(sha256)
}
