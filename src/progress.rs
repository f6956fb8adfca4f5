//! How long work says how far it is, and hears that it should end.

use std::fmt;

/// Told by long work how far it is; the command shows it as a bar, a notebook as it likes. All methods do nothing unless
/// they are implemented.
pub trait Progress: Sync {
    /// There are `pieces` of work, and `done` of them were there before.
    fn begin(&self, pieces: u64, done: u64) {
        let _ = (pieces, done);
    }

    /// So many more pieces are done.
    fn advance(&self, pieces: u64) {
        let _ = pieces;
    }

    /// What is being done, or how it stands.
    fn message(&self, text: &str) {
        let _ = text;
    }

    /// A warning, which must not be lost between the lines of a bar.
    fn warn(&self, text: &str) {
        log::warn!("{text}");
    }

    /// Whether the work is to end early, with [`Interrupted`]; asked often. What is whole by then is kept.
    fn cancelled(&self) -> bool {
        false
    }
}

/// The error of work that was asked to end early.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Interrupted;

impl fmt::Display for Interrupted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("interrupted")
    }
}

impl std::error::Error for Interrupted {}

/// Shows nothing, and ends when the other one does: for a piece of work that is itself a piece of something larger.
pub(crate) struct Part<'a>(pub &'a dyn Progress);

impl Progress for Part<'_> {
    fn warn(&self, text: &str) {
        self.0.warn(text);
    }

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// Shows nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Quiet;

impl Progress for Quiet {}
