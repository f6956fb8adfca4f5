//! Settings of the filter, with the reason for each default.
//! What each departure from the paper is worth, by leaving it out, stands in `docs/method.md`.

mod belief;
mod colour;
mod joint;
mod near_symmetry;
mod proposal;
mod score;
mod search;
mod track;
mod uncertainty;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::belief::BeliefSettings;
pub use self::colour::ColourSettings;
pub use self::joint::JointSettings;
pub use self::near_symmetry::NearSymmetrySettings;
pub use self::proposal::ProposalSettings;
pub use self::score::ScoreSettings;
pub use self::search::{PolishSettings, RestartSettings, SearchLevel, SearchSettings};
pub use self::track::TrackSettings;
pub use self::uncertainty::UncertaintySettings;

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
    /// How far off poses may be.
    pub uncertainty: UncertaintySettings,
    /// What scores are worth as probabilities.
    pub belief: BeliefSettings,
    /// How objects are followed from frame to frame.
    pub track: TrackSettings,
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
        part("uncertainty", self.uncertainty.validate())?;
        part("belief", self.belief.validate())?;
        part("track", self.track.validate())
    }
}
