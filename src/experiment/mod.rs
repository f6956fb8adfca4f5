//! Experiments: many trials, grasps under known pose errors, and what they tell.
//!
//! | file | what it is |
//! |---|---|
//! | `journal` | results, a line each, that outlive any kill |
//! | `plan` | which trials an experiment has |
//! | `trials` | runs them |
//! | `merge` | shards become one experiment |
//! | `items` | the items of all trials as a Parquet table |
//! | `report` | a page of everything |
//! | `summary` | shares and pairs of an experiment |
//! | `sweep` | grasps under known pose errors |
//! | `stats` | intervals, tests and fits |

pub mod items;
pub mod journal;
pub mod merge;
pub mod plan;
pub mod report;
pub mod stats;
pub mod summary;
pub mod sweep;
pub mod trials;
