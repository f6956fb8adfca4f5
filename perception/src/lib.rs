//! From one RGB-D frame to the poses of known objects, in two stages as in GRIP (Chen et al., "GRIP: Generative Robust
//! Inference and Perception for Semantic Robot Manipulation in Adversarial Environments", IROS 2019).
//!
//! 1. A [`Detector`] says where in the image an object may be: [`Detections`] is the whole distribution over boxes,
//!    nothing is thresholded. [`PyramidCnn`] is the paper's; [`Clusters`] needs no training; [`WholeImage`] says nothing.
//! 2. A [`PoseEstimator`] generates pose hypotheses there, renders each as a depth image, weighs it against the
//!    observed one and keeps what explains it: [`GripEstimator`] returns a [`PosePosterior`] for each object.
//!    [`PaperEstimator`] is the published method to the letter, for comparison.
//!
//! [`metrics`] compares poses. This crate sees camera frames and object models only: `grip-sim` is built without its
//! `physics` feature here, so the truth is out of reach.

#[cfg(test)]
mod allocations;
mod clusters;
mod detector;
mod error;
mod estimator;
mod footprint;
mod grip;
pub mod hypotheses;
pub mod metrics;
mod plane;
mod posterior;
mod pyramid;
#[cfg(feature = "bench")]
pub mod workbench;

pub use clusters::{ClusterSettings, Clusters};
pub use detector::{Detection, Detections, Detector, WholeImage, Workspace};
pub use error::{Error, Result};
pub use estimator::PoseEstimator;
pub use footprint::Footprint;
pub use grip::{
    Centre, ColourSettings, ColourVerdict, GripEstimator, GripSettings, Holes, JointSettings, PaperEstimator,
    PaperSettings, Ranking, SearchLevel,
};
pub use hypotheses::{HypothesisRenderer, HypothesisRendererChoice};
pub use plane::{Plane, PlaneSettings, Support, fit_support_plane};
pub use posterior::{Mode, PosePosterior, TracePoint};
pub use pyramid::{DetectorDescription, HeatMap, HeatMaps, KnownObject, Providers, PyramidCnn};
