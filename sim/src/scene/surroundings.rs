//! How the surroundings look.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the surroundings look. What is solid, and where, is the same in both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Surroundings {
    /// A beech table, a cardboard bin, grey linoleum, white plaster. The seed varies the wood's grain only.
    #[default]
    Laboratory,
    /// Every part of any material, colour, scale and gloss, and other things behind and beside the table, all drawn from
    /// the seed: so that what is learnt from pictures is not the background.
    Varied,
}
