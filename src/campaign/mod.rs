//! Campaigns: work of one verb, cut into units that any machines run in any order, killed and run again, and put together to what
//! one undisturbed run would have written (docs/campaigns.md).
//!
//! | file | what it is |
//! |---|---|
//! | `file` | what people write |
//! | `manifest` | what is to be run: units, and hashes of all that they depend on |
//! | `select` | which units a task runs: options, and what engines say |
//! | `unit` | runs a unit, once, whoever else tries to |
//! | `node` | the machine, and whether it computes as others do |
//! | `canary` | the computation that tells |
//! | `status` | what is done, and what is missing |
//! | `merge` | all units become one result |
//!
//! A campaign's folder:
//!
//! ```text
//! campaign.json      the manifest
//! shared/            what all units have in common: experiment.json, sweep.json, ...
//! nodes/             the machines that have run a unit
//! units/000017/      a unit: its results; done.json when it is done, failed.json when it cannot be
//! ```

pub mod canary;
pub mod file;
pub mod manifest;
pub mod merge;
pub mod node;
pub mod select;
pub mod status;
#[cfg(test)]
mod tests;
pub mod unit;

pub use file::{CampaignFile, Verb};
pub use manifest::{Campaign, Manifest};
