//! GRIP's second stage: iterated likelihood weighting over rendered pose hypotheses.
//!
//! Read in this order: [`settings`](GripSettings), `proposal` (the first hypotheses), [`crate::hypotheses`] (renders, compares and
//! moves them), `score`, `search` (one object), `near_symmetry` (its result against itself, turned), `joint` (all objects),
//! `colour` (what depth cannot tell), `places` and `uncertainty` (where else it may be, and how far off), `belief` (what that is
//! worth), `track` (from frame to frame), `estimator` (all of it).
//!
//! DIFFERENCE to the paper: hypotheses are pulled towards the data by Gauss-Newton steps before they are weighed, weights
//! are tempered, resolution goes from coarse to fine, and independent restarts replace hundreds of iterations. The
//! principle, generate and weigh by rendering, is the same. [`crate::PaperEstimator`] is the method without these differences.

mod belief;
mod colour;
mod estimator;
mod joint;
mod near_symmetry;
mod places;
mod proposal;
mod score;
mod search;
mod settings;
mod track;
mod uncertainty;

pub use self::colour::ColourEvidence;
pub use self::estimator::GripEstimator;
pub use self::settings::{
    BeliefSettings, ColourSettings, GripSettings, JointSettings, NearSymmetrySettings, PolishSettings,
    ProposalSettings, RestartSettings, ScoreSettings, SearchLevel, SearchSettings, TrackSettings,
    UncertaintySettings,
};

#[cfg(test)]
pub(crate) use self::score::parts;
