//! What happens at Ctrl-C, when the system asks to end (SIGTERM, SIGHUP), or when a disk is full: nothing half-written stays, and
//! what to do next is said.

use std::io;

use grip_sim::unfinished;

use crate::cli::{CampaignArgs, CampaignCommand, CampaignRunArgs, Command};
use crate::commands::{TRY_AGAIN, output};

/// As shells say that Ctrl-C ended a program.
const INTERRUPTED: i32 = 130;

/// Waits for it from now on.
pub fn install(command: &Command) {
    let next = kept(command).unwrap_or_else(|| "nothing half-written is left behind; run it again".into());
    // An engine that takes a unit's machine away is to give it another one.
    let code = match unit(command) {
        Some(_) => i32::from(TRY_AGAIN),
        None => INTERRUPTED,
    };
    let handler = move || {
        unfinished::remove_all();
        output::message(format_args!("interrupted: {next}"));
        std::process::exit(code);
    };
    // Where there are no signals the program ends as it always would.
    if let Err(error) = ctrlc::set_handler(handler) {
        log::debug!("cannot listen to signals: {error}");
    }
}

fn unit(command: &Command) -> Option<&CampaignRunArgs> {
    match command {
        Command::Campaign(CampaignArgs { command: CampaignCommand::Run(args) }) => Some(args),
        _ => None,
    }
}

/// What is kept of work that can be gone on with, and how.
pub fn kept(command: &Command) -> Option<String> {
    if let Some(CampaignRunArgs { folder, .. }) = unit(command) {
        return Some(format!("what is finished is kept; the same command goes on: {}", folder.display()));
    }
    let (what, out) = match command {
        Command::Trials(args) => ("trials", &args.out),
        Command::Sweep(args) => ("grasps", &args.out),
        Command::Scenes(args) => ("scenes", &args.out),
        Command::Estimate(args) => ("images", &args.out),
        Command::Reproduce(args) => {
            return Some(format!(
                "what is finished is kept; the same command goes on: {}",
                args.out.display()
            ));
        }
        _ => return None,
    };
    Some(format!("finished {what} are kept; the same command with --resume goes on: {}", out.display()))
}

/// Whether there was no room for what was to be written.
pub fn disk_was_full(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        let reason = match cause.downcast_ref::<grip_sim::Error>() {
            Some(grip_sim::Error::Io { reason, .. }) => Some(reason),
            _ => cause.downcast_ref::<io::Error>(),
        };
        reason.is_some_and(|r| matches!(r.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded))
    })
}
