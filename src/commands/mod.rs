//! The command `grip`: its verbs, a file each.
//!
//! Exit codes: 0 done, 1 the trial did not pack everything or touched what it must not, 2 could not run, 130 interrupted. Those of
//! `grip campaign run` are on the page of campaigns: an interrupted unit is to be tried again, 75.

mod campaign;
mod convergence;
mod convert;
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
mod reproduce;
mod robot;
mod scenes;
pub(crate) mod schemas;
mod settings;
mod sweep;
mod trials;

use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::Arc;

use anyhow::Context;
use clap::Parser;
use serde_json::{Map, Value};

pub use self::output::Caller;
use crate::cli::{Cli, Command, EstimateArgs, PackArgs, options};
use crate::estimators::EstimatorKind;
use crate::graspers::GrasperKind;
use crate::provenance;

/// Runs a command line, the program's name first, as the command does: it prints, and ends the process at Ctrl-C.
pub fn main(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    code(args).into()
}

/// The same; the exit code as a number.
pub fn code(args: impl IntoIterator<Item = OsString>) -> u8 {
    let args: Vec<OsString> = args.into_iter().collect();
    let words = args.iter().map(|word| word.to_string_lossy().into_owned()).collect();
    let cli = match Cli::try_parse_from(args) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version are no errors; everything else is a command line that could not run.
            let code = u8::from(error.use_stderr()) * 2;
            let _ = error.print();
            return code;
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
    match provenance::asked_by(words, || run(cli)) {
        Ok(done) => done.code(),
        Err(error) => {
            output::message(format_args!("error: {error:#}"));
            if let Some(kept) = kept.filter(|_| interrupt::disk_was_full(&error)) {
                output::message(format_args!("{kept}"));
            }
            2
        }
    }
}

/// What a call says that no word can say.
#[derive(Debug, Default)]
pub struct Given {
    /// Estimators, in place of those that are named in the options.
    pub estimators: Option<Vec<EstimatorKind>>,
    /// Grasp planners, in the same way.
    pub graspers: Option<Vec<GrasperKind>>,
}

/// Runs a verb for a program: `options` are those of the command line, `_` for `-`, by the names that `--help` says; a verb of a verb is
/// named by both (`campaign run`). Returns the exit code of the command, which is not 2: those are errors.
///
/// # Errors
/// With the text that the command would print; [`crate::progress::Interrupted`] when the caller's progress was cancelled.
pub fn call(
    verb: &str,
    options: &Map<String, Value>,
    given: Given,
    caller: Arc<dyn Caller>,
) -> anyhow::Result<u8> {
    let words = options::words(verb, options)?;
    let mut cli = Cli::try_parse_from(&words).map_err(|error| {
        // Of what clap prints the first lines say what is wrong; the rest is how a shell would say it.
        let text = error.to_string();
        let ends = ["\n\nUsage:", "\n\nFor more"].iter().filter_map(|end| text.find(end));
        let told = text[..ends.min().unwrap_or(text.len())].trim_end();
        anyhow::anyhow!("{}", told.trim_start_matches("error: ").to_owned())
    })?;
    give(&mut cli.command, given)?;
    Ok(provenance::asked_by(words, || output::called_by(caller, || run(cli)))?.code())
}

/// Puts what is given into the options.
fn give(command: &mut Command, given: Given) -> anyhow::Result<()> {
    fn one<T>(kinds: Vec<T>, what: &str) -> anyhow::Result<T> {
        let count = kinds.len();
        let kind = kinds.into_iter().next().filter(|_| count == 1);
        kind.with_context(|| format!("{what}: give one, not {count}"))
    }
    match command {
        Command::Trials(args) => {
            args.estimators = given.estimators.unwrap_or_else(|| std::mem::take(&mut args.estimators));
            args.graspers = given.graspers.unwrap_or_else(|| std::mem::take(&mut args.graspers));
        }
        Command::Pack(PackArgs { estimator, grasper, .. }) => {
            *estimator =
                given.estimators.map_or_else(|| Ok(estimator.clone()), |kinds| one(kinds, "estimator"))?;
            *grasper = given.graspers.map_or_else(|| Ok(grasper.clone()), |kinds| one(kinds, "grasper"))?;
        }
        Command::Estimate(EstimateArgs { estimator, .. }) => {
            *estimator =
                given.estimators.map_or_else(|| Ok(estimator.clone()), |kinds| one(kinds, "estimator"))?;
        }
        _ => {}
    }
    Ok(())
}

/// EX_TEMPFAIL of sysexits.h: what engines are to take for "try again".
pub(crate) const TRY_AGAIN: u8 = 75;

/// How a command ended when it could run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Done {
    /// All that was asked for.
    Fully,
    /// The trial ran, but not everything was packed; a unit cannot be done; units are missing.
    Short,
    /// A unit of a campaign is to be tried again.
    Again,
}

impl Done {
    /// 0, 1, or 75; errors (2) never get here.
    fn code(self) -> u8 {
        match self {
            Self::Fully => 0,
            Self::Short => 1,
            Self::Again => TRY_AGAIN,
        }
    }
}

/// Runs what the command line says.
fn run(cli: Cli) -> anyhow::Result<Done> {
    match cli.command {
        Command::Pack(args) => pack::run(&args),
        Command::Trials(args) => trials::run(&args),
        Command::Merge(args) => merge::run(&args),
        Command::Campaign(args) => campaign::run(&args),
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
        Command::Reproduce(args) => reproduce::run(&args),
        Command::Grasps(args) => grasps::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Convert(args) => convert::run(&args),
        Command::Objects(args) => objects::run(&args),
        Command::Robot(args) => robot::run(&args),
        Command::Init(args) => init::run(&args),
        Command::Settings(args) => settings::run(&args),
    }
}
