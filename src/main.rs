//! `grip`: grocery packing in simulation, end to end, without a screen.
//!
//! Exit codes: 0 done, 1 the trial did not pack everything or touched what it must not, 2 could not run, 130 interrupted.

mod cli;
mod commands;
mod interrupt;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let cli = match cli::Cli::try_parse() {
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
    match commands::run(cli) {
        Ok(done) => done.exit_code(),
        Err(error) => {
            commands::output::message(format_args!("error: {error:#}"));
            if let Some(kept) = kept.filter(|_| interrupt::disk_was_full(&error)) {
                commands::output::message(format_args!("{kept}"));
            }
            ExitCode::from(2)
        }
    }
}
