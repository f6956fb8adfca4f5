//! How long work says how far it is.

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
}

/// Shows nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Quiet;

impl Progress for Quiet {}
