//! Objects, prepared once for all frames.

mod body;
mod cache;
#[cfg(test)]
pub(crate) mod fixtures;
mod prepared;
mod print;
mod resting;

pub(crate) use self::cache::ModelCache;
pub(crate) use self::prepared::{Model, stream};
pub(crate) use self::print::{Print, PrintedPoint, look};
pub use self::resting::{RestingPose, resting_poses};
