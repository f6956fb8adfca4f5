//! From scores to weights and confidence.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::checks::{Checked, positive, within};

/// What scores are worth as probabilities. Figures in brackets are the defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BeliefSettings {
    /// Temperature of the places' masses, over 0 (0.012): with it the best place has as much mass as it is right.
    pub temperature: f64,
    /// Score at which an object is as likely present as absent, -10 to 10 (0.5).
    pub presence_score: f64,
    /// Scale of the logistic function about it, over 0 (0.04).
    pub presence_scale: f64,
}

impl Default for BeliefSettings {
    fn default() -> Self {
        Self { temperature: 0.012, presence_score: 0.5, presence_scale: 0.04 }
    }
}

impl BeliefSettings {
    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        positive("temperature", self.temperature)?;
        within("presence_score", self.presence_score, -10.0..=10.0, "")?;
        positive("presence_scale", self.presence_scale)
    }
}
