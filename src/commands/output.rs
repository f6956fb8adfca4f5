//! The only places that write to the terminal: data to stdout, everything else to stderr. A program that has called a verb gets all of
//! it instead ([`Caller`]).

use std::cell::RefCell;
use std::fmt::{self, Arguments};
use std::io::{self, IsTerminal, Write};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use crate::progress::Progress;
use comfy_table::{CellAlignment, Table, presets::NOTHING};
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use serde::Serialize;

/// A program that calls a verb, in place of a terminal.
pub trait Caller: Send + Sync {
    /// A line of data.
    fn data(&self, line: &str);

    /// A line for people.
    fn message(&self, line: &str);

    /// A file that was made where the verb chose the place.
    fn made(&self, path: &Path);

    /// Work begins whose pieces are `unit`; empty where its length is not known.
    fn progress(&self, unit: &str) -> Box<dyn Progress + Send>;
}

thread_local! {
    /// Who has called a verb on this thread.
    static CALLER: RefCell<Option<Arc<dyn Caller>>> = const { RefCell::new(None) };
}

fn caller() -> Option<Arc<dyn Caller>> {
    CALLER.with_borrow(Clone::clone)
}

/// Does `work`, whose output goes to `caller`.
pub fn called_by<T>(caller: Arc<dyn Caller>, work: impl FnOnce() -> T) -> T {
    /// Also when the work panics.
    struct End(Option<Arc<dyn Caller>>);
    impl Drop for End {
        fn drop(&mut self) {
            CALLER.set(self.0.take());
        }
    }
    let _end = End(CALLER.replace(Some(caller)));
    work()
}

/// A line of data on stdout.
///
/// # Errors
/// When stdout cannot be written to; a closed pipe (`grip ... | head`) is no error.
pub fn data(line: Arguments<'_>) -> anyhow::Result<()> {
    if let Some(caller) = caller() {
        caller.data(&line.to_string());
        return Ok(());
    }
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
    if let Some(caller) = caller() {
        return caller.message(&line.to_string());
    }
    let _ = writeln!(io::stderr().lock(), "{line}");
}

/// Says where a file is that was made.
pub fn made(what: &str, path: &Path) {
    match caller() {
        Some(caller) => caller.made(path),
        None => message(format_args!("{what}: {}", path.display())),
    }
}

/// Progress: a bar on a terminal, elsewhere a line now and then.
pub struct Bar {
    bar: ProgressBar,
    unit: String,
    /// Pieces that were done before this run.
    kept: Arc<AtomicU64>,
    /// Ends the lines when it is dropped.
    lines: Mutex<Option<Sender<()>>>,
    /// Who is told in place of all that.
    instead: Option<Box<dyn Progress + Send>>,
}

/// Between two lines where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

impl Bar {
    /// Over many pieces of work: time, share, what is left, and a message.
    pub fn new(unit: &str) -> Self {
        let template = format!("{{elapsed_precise}} {{wide_bar}} {{pos}}/{{len}} {unit}{{left}} {{msg}}");
        Self::with(ProgressBar::new(0), &template, unit, 500)
    }

    /// Over work of unknown length.
    pub fn spinner() -> Self {
        Self::with(ProgressBar::new_spinner(), "{spinner} {elapsed} {msg}", "", 120)
    }

    fn with(bar: ProgressBar, template: &str, unit: &str, tick_ms: u64) -> Self {
        let kept = Arc::new(AtomicU64::new(0));
        if let Ok(style) = ProgressStyle::with_template(template) {
            let kept = Arc::clone(&kept);
            bar.set_style(style.with_key("left", move |state: &ProgressState, f: &mut dyn fmt::Write| {
                let done = state.pos().saturating_sub(kept.load(Ordering::Relaxed));
                let _ = f.write_str(&left(
                    state.elapsed(),
                    done,
                    state.len().unwrap_or(0).saturating_sub(state.pos()),
                ));
            }));
        }
        let instead = caller().map(|caller| caller.progress(unit));
        let this = Self { bar, unit: unit.to_owned(), kept, lines: Mutex::default(), instead };
        if this.instead.is_some() {
            this.bar.set_draw_target(ProgressDrawTarget::hidden());
        } else if io::stderr().is_terminal() {
            this.bar.enable_steady_tick(Duration::from_millis(tick_ms));
        } else {
            this.speak();
        }
        this
    }

    /// Starts the lines.
    fn speak(&self) {
        let (sender, ended) = mpsc::channel();
        let (bar, unit, kept) = (self.bar.clone(), self.unit.clone(), Arc::clone(&self.kept));
        // Where no thread can be started there are no lines.
        let started = std::thread::Builder::new().spawn(move || {
            while ended.recv_timeout(LINE_EVERY) == Err(mpsc::RecvTimeoutError::Timeout) {
                let (done, all) = (bar.position(), bar.length().unwrap_or(0));
                let kept = kept.load(Ordering::Relaxed);
                let took = bar.elapsed();
                let pieces = if unit.is_empty() {
                    String::new()
                } else {
                    let left = left(took, done.saturating_sub(kept), all.saturating_sub(done));
                    format!(", {done} of {all} {unit}{left}")
                };
                let text = bar.message();
                let text = if text.is_empty() { String::new() } else { format!(", {text}") };
                message(format_args!("{}{pieces}{text}", HumanDuration(took)));
            }
        });
        if started.is_ok() {
            self.lines.lock().unwrap_or_else(PoisonError::into_inner).replace(sender);
        }
    }

    /// Takes it away.
    pub fn finish(&self) {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner).take();
        self.bar.finish_and_clear();
    }
}

/// `, 5 minutes left`, by the pieces that took so long so far; nothing before the first.
fn left(took: Duration, done: u64, rest: u64) -> String {
    if done == 0 || rest == 0 {
        return String::new();
    }
    format!(", {} left", HumanDuration(took.mul_f64(rest as f64 / done as f64)))
}

impl Progress for Bar {
    fn begin(&self, pieces: u64, done: u64) {
        if let Some(caller) = &self.instead {
            return caller.begin(pieces, done);
        }
        self.kept.store(done, Ordering::Relaxed);
        self.bar.set_length(pieces);
        self.bar.set_position(done);
        self.bar.reset_elapsed();
    }

    fn advance(&self, pieces: u64) {
        if let Some(caller) = &self.instead {
            return caller.advance(pieces);
        }
        self.bar.inc(pieces);
    }

    fn message(&self, text: &str) {
        if let Some(caller) = &self.instead {
            return caller.message(text);
        }
        self.bar.set_message(text.to_owned());
    }

    fn warn(&self, text: &str) {
        if let Some(caller) = &self.instead {
            return caller.warn(text);
        }
        self.bar.suspend(|| log::warn!("{text}"));
    }

    fn cancelled(&self) -> bool {
        self.instead.as_ref().is_some_and(|caller| caller.cancelled())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_is_told_by_what_was_done_and_not_before() {
        let left = |done, rest| left(Duration::from_secs(10), done, rest);
        assert_eq!(left(0, 12), "", "nothing is known before the first piece");
        assert_eq!(left(2, 6), ", 30 seconds left");
        assert_eq!(left(12, 0), "");
    }
}
