//! The only places that write to the terminal: data to stdout, everything else to stderr.

use std::fmt::Arguments;
use std::io::{self, Write};
use std::time::Duration;

use comfy_table::{CellAlignment, Table, presets::NOTHING};
use grip::progress::Progress;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

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

/// JSON on stdout.
///
/// # Errors
/// As [`data`].
pub fn json(value: &impl Serialize) -> anyhow::Result<()> {
    data(format_args!("{}", serde_json::to_string_pretty(value)?))
}

/// A line for people on stderr; nobody is helped when that fails.
pub fn message(line: Arguments<'_>) {
    let _ = writeln!(io::stderr().lock(), "{line}");
}

/// Progress on a terminal; silent in pipes and logs.
pub struct Bar(ProgressBar);

impl Bar {
    /// Over many pieces of work: time, share, what is left, and a message.
    pub fn new(unit: &str) -> Self {
        let template =
            format!("{{elapsed_precise}} {{wide_bar}} {{pos}}/{{len}} {unit}, {{eta}} left {{msg}}");
        Self::with(ProgressBar::new(0), &template, 500)
    }

    /// Over work of unknown length.
    pub fn spinner() -> Self {
        Self::with(ProgressBar::new_spinner(), "{spinner} {elapsed} {msg}", 120)
    }

    fn with(bar: ProgressBar, template: &str, tick_ms: u64) -> Self {
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(tick_ms));
        Self(bar)
    }

    /// Takes it away.
    pub fn finish(&self) {
        self.0.finish_and_clear();
    }
}

impl Progress for Bar {
    fn begin(&self, pieces: u64, done: u64) {
        self.0.set_length(pieces);
        self.0.set_position(done);
        self.0.reset_eta();
    }

    fn advance(&self, pieces: u64) {
        self.0.inc(pieces);
    }

    fn message(&self, text: &str) {
        self.0.set_message(text.to_owned());
    }

    fn warn(&self, text: &str) {
        self.0.suspend(|| log::warn!("{text}"));
    }
}

/// A table without lines; `right` names the columns that are aligned to the right.
pub fn table<const N: usize>(
    header: [&str; N],
    right: &[usize],
    rows: impl IntoIterator<Item = [String; N]>,
) -> String {
    let rows = rows.into_iter().map(Vec::from).collect();
    table_of(header.map(str::to_owned).into(), right, rows)
}

/// The same of as many columns as there happen to be.
pub fn table_of(header: Vec<String>, right: &[usize], rows: Vec<Vec<String>>) -> String {
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
