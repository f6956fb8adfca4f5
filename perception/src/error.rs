//! The one error type of this crate. Every variant names the thing that is wrong and what to try.

/// What this crate's functions return.
pub type Result<T> = std::result::Result<T, Error>;

/// Why a frame could not be searched for objects.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The camera frame is not usable: sizes that disagree, intrinsics that are no camera's, no depth at all.
    #[error("camera frame: {0}")]
    Frame(String),
    /// An object's model cannot be rendered.
    #[error("object '{object}': {message}")]
    Object {
        /// The object's name.
        object: String,
        /// What is wrong with it and what to try.
        message: String,
    },
    /// A network that cannot be loaded or run, or does not know an object.
    #[error("detector: {0}")]
    Detector(
        /// Which file, what is wrong with it, and what to try.
        String,
    ),
    /// No graphics adapter, or it failed.
    #[error("hypotheses on the GPU: {0}")]
    Gpu(
        /// What failed and what to try.
        String,
    ),
    /// A setting out of its range.
    #[error("setting {name} = {value}: {message}")]
    Setting {
        /// Field of the settings struct.
        name: &'static str,
        /// The value as given.
        value: String,
        /// Allowed range and what to try.
        message: String,
    },
}
