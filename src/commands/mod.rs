//! The command `grip`: its verbs, a file each.
//!
//! Exit codes: 0 done, 1 the trial did not pack everything or touched what it must not, 2 could not run, 130 interrupted.

mod convergence;
mod detect;
mod estimate;
mod eval;
mod explain;
mod export;
mod grasps;
mod init;
mod interrupt;
mod merge;
mod objects;
mod output;
mod pack;
mod plan;
mod render;
mod report;
mod robot;
mod scenes;
mod schemas;
mod settings;
mod sweep;
mod trials;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::Parser;

use crate::cli::{Cli, Command};

/// Runs a command line, the program's name first, as the command does: it prints, and ends the process at Ctrl-C.
pub fn main(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let cli = match Cli::try_parse_from(args) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version are no errors; everything else is a command line that could not run.
            let code = u8::from(error.use_stderr()) * 2;
            let _ = error.print();
            return ExitCode::from(code);
        }
    };
    // Graphics drivers and libraries log freely: silent unless asked.
    let level = match cli.verbose {
        0 => "off,grip=warn,grip_sim=warn,grip_perception=warn,grip_manip=warn",
        1 => "warn,grip=info,grip_sim=info,grip_perception=info,grip_manip=info",
        2 => "info,grip=debug,grip_sim=debug,grip_perception=debug,grip_manip=debug",
        _ => "debug",
    };
    env_logger::Builder::new().parse_filters(level).format_timestamp(None).format_target(false).init();
    interrupt::install(&cli.command);
    let kept = interrupt::kept(&cli.command);
    match run(cli) {
        Ok(done) => done.exit_code(),
        Err(error) => {
            output::message(format_args!("error: {error:#}"));
            if let Some(kept) = kept.filter(|_| interrupt::disk_was_full(&error)) {
                output::message(format_args!("{kept}"));
            }
            ExitCode::from(2)
        }
    }
}

/// How a command ended when it could run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Done {
    /// All that was asked for.
    Fully,
    /// The trial ran, but not everything was packed.
    Short,
}

impl Done {
    /// 0 or 1; errors (2) never get here.
    fn exit_code(self) -> ExitCode {
        match self {
            Self::Fully => ExitCode::SUCCESS,
            Self::Short => ExitCode::from(1),
        }
    }
}

/// Runs what the command line says.
fn run(cli: Cli) -> anyhow::Result<Done> {
    match cli.command {
        Command::Pack(args) => pack::run(&args),
        Command::Trials(args) => trials::run(&args),
        Command::Merge(args) => merge::run(&args),
        Command::Sweep(args) => sweep::run(&args),
        Command::Report(args) => report::run(&args),
        Command::Plan(args) => plan::run(&args),
        Command::Render(args) => render::run(&args),
        Command::Scenes(args) => scenes::run(&args),
        Command::Detect(args) => detect::run(&args),
        Command::Estimate(args) => estimate::run(&args),
        Command::Eval(args) => eval::run(&args),
        Command::Explain(args) => explain::run(&args),
        Command::Convergence(args) => convergence::run(&args),
        Command::Grasps(args) => grasps::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Objects(args) => objects::run(&args),
        Command::Robot(args) => robot::run(&args),
        Command::Init(args) => init::run(&args),
        Command::Settings(args) => settings::run(&args),
    }
}
