//! The verbs, a file each.

mod convergence;
mod detect;
mod estimate;
mod eval;
mod explain;
mod export;
mod grasps;
mod init;
mod merge;
mod objects;
pub mod output;
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

use std::process::ExitCode;

use crate::cli::{Cli, Command};

/// How a command ended when it could run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Done {
    /// All that was asked for.
    Fully,
    /// The trial ran, but not everything was packed.
    Short,
}

impl Done {
    /// 0 or 1; errors (2) never get here.
    pub fn exit_code(self) -> ExitCode {
        match self {
            Self::Fully => ExitCode::SUCCESS,
            Self::Short => ExitCode::from(1),
        }
    }
}

/// Runs what the command line says.
pub fn run(cli: Cli) -> anyhow::Result<Done> {
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
