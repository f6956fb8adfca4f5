//! Pose estimation on data sets in BOP's format, ours and others': estimates as a CSV file, and their errors.

mod accuracy;
mod boxes;
mod case;
mod challenge;
mod convergence;
mod credibility;
mod detection;
mod estimates;
mod evaluation;
mod objects;
mod paper;
mod presence;
mod published;
mod support;
mod table1;

pub use accuracy::figure as accuracy_figure;
pub use boxes::{Boxes, FileBox};
pub use case::Case;
pub use challenge::{Lacking, Recall};
pub use convergence::{Contender, Convergence, Search, SearchSummary, Searches, quantile};
pub use credibility::{Credibilities, Credibility, LEVELS, credibility};
pub use detection::{DetectionFigures, MOST_BOXES, ObjectImage, measure, truth_boxes};
pub(crate) use estimates::camera_frame;
pub use estimates::{
    Estimated, FrameEstimator, PosteriorLine, Run, asked_models, finished as finished_images, sequences,
};
pub use evaluation::{Evaluation, Figures, Kind, THRESHOLDS, evaluate, views};
pub use objects::{load as load_object, names as object_names, title as object_title};
pub use paper::{Area, PaperTable};
pub use presence::Presence;
pub use published::METHODS;
pub use support::for_dataset;
pub use table1::{Method, Table, curves};
