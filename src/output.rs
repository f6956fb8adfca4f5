//! The only places that write to the terminal: data to stdout, everything else to stderr.

use std::fmt::Arguments;
use std::io::{self, Write};

/// A line of data on stdout.
///
/// # Errors
/// When stdout cannot be written to; a closed pipe (`grip ... | head`) is no error.
pub fn data(line: Arguments<'_>) -> anyhow::Result<()> {
    match writeln!(io::stdout().lock(), "{line}") {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(|e| anyhow::anyhow!("cannot write to stdout: {e}")),
    }
}

/// A line for people on stderr; nobody is helped when that fails.
pub fn message(line: Arguments<'_>) {
    let _ = writeln!(io::stderr().lock(), "{line}");
}
