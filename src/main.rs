//! `grip`: grocery packing in simulation, end to end, without a screen.

use std::process::ExitCode;

fn main() -> ExitCode {
    grip::commands::main(std::env::args_os())
}
