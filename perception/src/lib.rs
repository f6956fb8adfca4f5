//! From one RGB-D frame to the poses of known objects, in two stages as in GRIP (Chen et al., "GRIP: Generative Robust
//! Inference and Perception for Semantic Robot Manipulation in Adversarial Environments", IROS 2019).
//!
//! 1. A [`Detector`] says where in the image an object may be: [`Detections`] is the whole distribution over boxes,
//!    nothing is thresholded. [`PyramidCnn`] is the paper's; [`Clusters`] needs no training; [`WholeImage`] says nothing.
//! 2. A [`PoseEstimator`] generates pose hypotheses there, renders each as a depth image, weighs it against the
//!    observed one and keeps what explains it: [`GripEstimator`] returns a [`PosePosterior`] for each object.
//!    [`PaperEstimator`] is the published method to the letter, for comparison.
//!
//! [`metrics`] compares poses. This crate sees camera frames and object models only: it does not depend on
//! `grip-physics`, so the truth is out of reach.

#[cfg(test)]
mod allocations;
mod checks;
mod detector;
mod error;
mod estimator;
mod frame;
mod grip;
mod hull;
pub mod hypotheses;
pub mod metrics;
mod model;
pub mod observation;
mod paper;
mod particles;
mod posterior;
mod sampling;
mod settings;
mod support;
mod symmetry;
#[cfg(feature = "bench")]
pub mod workbench;
mod workspace;

pub use detector::{
    BuiltInNetwork, ClusterSettings, Clusters, Detection, Detections, Detector, DetectorDescription,
    DetectorSettings, HeatMap, HeatMaps, KnownObject, Providers, PyramidCnn, PyramidOrClusters,
    PyramidSettings, WholeImage,
};
pub use error::{Error, Result};
pub use estimator::PoseEstimator;
pub use grip::{
    BeliefSettings, ColourEvidence, ColourSettings, GripEstimator, GripSettings, JointSettings,
    NearSymmetrySettings, PolishSettings, ProposalSettings, RestartSettings, ScoreSettings, SearchLevel,
    SearchSettings, TrackSettings, UncertaintySettings,
};
pub use hypotheses::{HypothesisRenderer, HypothesisRendererChoice};
pub use model::{RestingPose, resting_poses};
pub use observation::ObservationSettings;
pub use paper::{
    Centre, Decay, Diffusion, FeatureMatch, Holes, PaperEstimator, PaperSettings, Ranking, Start,
};
pub use posterior::{ColourVerdict, Mode, PosePosterior, TracePoint};
pub use settings::PerceptionSettings;
pub use support::{Footprint, Plane, Support, SupportSettings, Supports};
pub use workspace::Workspace;
