//! The one error type of this crate. Every variant names the file or thing, what is wrong, and what to try.

use std::path::PathBuf;

/// What this crate's functions return.
pub type Result<T> = std::result::Result<T, Error>;

/// Why something could not be read, built or drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder could not be opened, read or written.
    #[error("{}: {reason}; {}", path.display(), advice(reason))]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said; part of the message, and so no source of its own.
        reason: std::io::Error,
    },
    /// A file was read but its content is not what it should be.
    #[error("{}: {message}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Field, value, reason, and what to try.
        message: String,
    },
    /// An object name that the table does not have.
    #[error("unknown object '{name}'; known: {known} (see `grip objects`)")]
    UnknownObject {
        /// The name as given.
        name: String,
        /// The names in the table, comma separated.
        known: String,
    },
    /// Something about the robot: a joint, link, group or limit.
    #[error("robot {robot}: {message}")]
    Robot {
        /// The robot's name or URDF path.
        robot: String,
        /// Joint or link, limit broken, what to try.
        message: String,
    },
    /// No graphics adapter, or it failed.
    #[error("renderer {renderer}: {message}")]
    Renderer {
        /// `wgpu` or `cpu`.
        renderer: &'static str,
        /// What failed and what to try.
        message: String,
    },
}

/// What to try.
fn advice(reason: &std::io::Error) -> &'static str {
    use std::io::ErrorKind as Kind;
    match reason.kind() {
        Kind::NotFound => "check that the path exists",
        Kind::PermissionDenied | Kind::ReadOnlyFilesystem => "check permissions, or choose another place",
        Kind::StorageFull | Kind::QuotaExceeded | Kind::FileTooLarge => {
            "free some space, or choose another place"
        }
        Kind::IsADirectory => "give a file",
        Kind::NotADirectory => "a file is where a folder should be",
        _ => "check that the path exists and may be accessed",
    }
}

impl Error {
    /// An [`Error::Io`] for `path`.
    pub fn io(path: impl Into<PathBuf>, reason: std::io::Error) -> Self {
        Self::Io { path: path.into(), reason }
    }

    /// An [`Error::Invalid`] for `path`.
    pub fn invalid(path: impl Into<PathBuf>, message: impl Into<String>) -> Self {
        Self::Invalid { path: path.into(), message: message.into() }
    }

    /// What is wrong with a file, for a caller that names it itself.
    pub fn without_file(self) -> String {
        match self {
            Self::Io { reason, .. } => reason.to_string(),
            Self::Invalid { message, .. } => message,
            other => other.to_string(),
        }
    }
}
