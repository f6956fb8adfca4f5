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
    #[error("setting {0}")]
    Setting(
        /// The field with the parts that hold it, its value and the allowed range.
        String,
    ),
    /// A detection that is none.
    #[error("detection of '{object}': {problem}")]
    Detection {
        /// The object's name.
        object: String,
        /// Which number, and what is allowed.
        problem: String,
    },
}
