//! The one error type of this crate: what cannot be built or laid out, and what to try.

/// What this crate's functions return.
pub type Result<T> = std::result::Result<T, Error>;

/// Why a world could not be built, or its objects not be laid out.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A solid, a pose or a start configuration that no world can be built of.
    #[error("world: {0}")]
    World(String),
    /// A scene's objects could not be laid out from a seed.
    #[error("world: {0}")]
    NoLayout(String),
    /// A link of the robot that no body can be made of.
    #[error("robot {robot}: {message}")]
    Robot {
        /// The robot's name.
        robot: String,
        /// The link, and what to try.
        message: String,
    },
}
