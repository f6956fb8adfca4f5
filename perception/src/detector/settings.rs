//! Settings of all detectors.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::clusters::ClusterSettings;
use super::pyramid::PyramidSettings;
use crate::checks::{Checked, part};

/// Settings of the detectors, each by its name.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DetectorSettings {
    /// Of the network's image pyramid.
    pub pyramid: PyramidSettings,
    /// Of depth clusters on the support plane.
    pub clusters: ClusterSettings,
}

impl DetectorSettings {
    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        part("pyramid", self.pyramid.validate())?;
        part("clusters", self.clusters.validate())
    }
}
