//! Pose estimation on data sets in BOP's format, ours and others': estimates as a CSV file, and their errors.

mod boxes;
mod estimates;
mod evaluation;
mod objects;
mod presence;

pub use boxes::Boxes;
pub use estimates::{Estimated, Run};
pub use evaluation::{Case, Figures, THRESHOLDS, evaluate};
pub use presence::Presence;
