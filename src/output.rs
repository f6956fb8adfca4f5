//! The only places that write to the terminal: data to stdout, everything else to stderr.

use std::fmt::Arguments;
use std::io::{self, Write};
use std::time::Duration;

use comfy_table::{CellAlignment, Table, presets::NOTHING};
use indicatif::{ProgressBar, ProgressStyle};

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

/// A bar over many pieces of work, on a terminal only: time, share, what is left, and a message.
pub fn progress(unit: &str) -> ProgressBar {
    let progress = ProgressBar::new(0);
    let template = format!("{{elapsed_precise}} {{wide_bar}} {{pos}}/{{len}} {unit}, {{eta}} left {{msg}}");
    if let Ok(style) = ProgressStyle::with_template(&template) {
        progress.set_style(style);
    }
    progress.enable_steady_tick(Duration::from_millis(500));
    progress
}

/// A table without lines; `right` names the columns that are aligned to the right.
pub fn table<const N: usize>(
    header: [&str; N],
    right: &[usize],
    rows: impl IntoIterator<Item = [String; N]>,
) -> String {
    let mut table = Table::new();
    table.load_style(NOTHING).set_header(header);
    for row in rows {
        table.add_row(row);
    }
    for &column in right {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table.trim_fmt()
}
