//! Pose estimation on data sets in BOP's format, ours and others': estimates as a CSV file, and their errors.

mod accuracy;
mod boxes;
mod convergence;
mod estimates;
mod evaluation;
mod objects;
mod paper;
mod presence;
mod published;

pub use accuracy::figure as accuracy_figure;
pub use boxes::Boxes;
pub use convergence::{Contender, Convergence, Searches};
pub use estimates::{Estimated, Run};
pub use evaluation::{Case, Evaluation, Figures, THRESHOLDS, evaluate};
pub use paper::{Area, PaperTable};
pub use presence::Presence;
pub use published::METHODS;
