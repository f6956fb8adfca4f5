//! Settings of the filter, with the reason for each default.
//!
//! What each departure from the paper is worth, by leaving it out: area under the accuracy-threshold curve up to 4 cm, per
//! cent, of ADD-S (all views, and those with clutter) and of ADD(-S), on 406 instances of `grip scenes --seed 510 --scenes 10`,
//! boxes jittered by 10 % among four false ones, one seed of the estimator. Differences under a point are within the noise.
//!
//! | left out | setting | ADD-S | clutter | ADD(-S) |
//! |---|---|---|---|---|
//! | nothing | | 97.6 | 96.3 | 93.4 |
//! | Gauss-Newton steps, four times the samples instead | `search.levels[].steps`, `polish.steps` = 0 | 87.5 | 83.4 | 68.9 |
//! | support plane | `observation.support.enabled` = false | 91.6 | 88.8 | 86.4 |
//! | looking at objects together | `joint.enabled` = false | 94.6 | 90.8 | 90.9 |
//! | silhouettes | `score.edge_weight` = 0 | 95.9 | 93.8 | 90.4 |
//! | restarts | `restarts.most` = 1 | 96.6 | 95.2 | 90.9 |
//! | turns in which it nearly lies on itself | `near_symmetry.enabled` = false | 97.2 | 95.8 | 82.9 |
//! | how much of the image these explain | `near_symmetry.explained_weight` = 0 | 97.3 | 95.7 | 92.9 |
//! | colour | `colour.enabled` = false | 97.6 | 96.2 | 93.5 |
//! | free space that is violated | `score.violation` = 0 | 97.7 | 96.6 | 93.0 |
//! | hidden pixels are not held against a pose | `score.occlusion_discount` = 0 | 97.0 | 95.7 | 92.1 |
//! | boxes in the score | `score.box_weight` = 0 | 97.2 | 95.4 | 92.8 |
//! | resting poses | `proposal.resting_share` = 0 | 97.7 | 96.8 | 91.8 |
//! | choosing proposals by their boxes | `proposal.oversampling` = 1 | 97.3 | 95.6 | 92.3 |
//! | a tenth of the proposals from anywhere | `proposal.anywhere` = 0 | 97.7 | 97.1 | 93.5 |
//! | a kernel for real depth | `observation.epsilon_m` = 0.005 | 97.0 | 95.3 | 92.3 |

mod belief;
mod colour;
mod joint;
mod near_symmetry;
mod proposal;
mod score;
mod search;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::belief::BeliefSettings;
pub use self::colour::ColourSettings;
pub use self::joint::JointSettings;
pub use self::near_symmetry::NearSymmetrySettings;
pub use self::proposal::ProposalSettings;
pub use self::score::ScoreSettings;
pub use self::search::{PolishSettings, RestartSettings, SearchLevel, SearchSettings};

use crate::checks::{Checked, part};
use crate::observation::ObservationSettings;

/// Settings of [`GripEstimator`](crate::GripEstimator), a part for each step, in the order of the steps. Figures in brackets
/// are the defaults, and the paper's where it has the quantity.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GripSettings {
    /// How a frame is prepared: tolerances, edges, the support plane.
    pub observation: ObservationSettings,
    /// How the first hypotheses are drawn.
    pub proposal: ProposalSettings,
    /// How they are moved, weighed and drawn again, coarse to fine.
    pub search: SearchSettings,
    /// How the last of them are polished.
    pub polish: PolishSettings,
    /// When the search is made anew.
    pub restarts: RestartSettings,
    /// How the result is compared with its near-symmetric poses.
    pub near_symmetry: NearSymmetrySettings,
    /// What counts in the score of a hypothesis.
    pub score: ScoreSettings,
    /// How objects are looked at together.
    pub joint: JointSettings,
    /// When colour decides.
    pub colour: ColourSettings,
    /// What scores are worth as probabilities.
    pub belief: BeliefSettings,
}

impl GripSettings {
    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        part("observation", self.observation.validate())?;
        part("proposal", self.proposal.validate())?;
        part("search", self.search.validate())?;
        part("polish", self.polish.validate())?;
        part("restarts", self.restarts.validate())?;
        part("near_symmetry", self.near_symmetry.validate())?;
        part("score", self.score.validate())?;
        part("joint", self.joint.validate())?;
        part("colour", self.colour.validate())?;
        part("belief", self.belief.validate())
    }
}
