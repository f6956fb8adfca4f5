//! Recordings: everything that is known of a trial, saved.
//!
//! | file | what it holds |
//! |---|---|
//! | `rows` | the tables, a struct each |
//! | `recorder` | told by the trial what happens |
//! | `replay`, `glb` | the trial as an animated scene in glTF |
//! | `viewer` | that scene in a page, to be turned and scrubbed |
//! | `save` | the folder of a recording: events.jsonl, Parquet tables, pictures |
//! | `mcap` | such a folder as one file for Foxglove and Rerun |
//!
//! A recorder only reads: with it or without, a trial's result is the same to the bit.

mod glb;
pub mod mcap;
mod recorder;
mod replay;
pub mod rows;
mod save;
pub mod viewer;

use std::fmt;
use std::str::FromStr;

use anyhow::bail;

pub use self::recorder::{Action, Event, Recorder};
pub use self::save::{RecordFile, Recording, SCHEMA};

/// What is kept of a trial.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Nothing.
    #[default]
    None,
    /// The events of a trial in which not everything was packed.
    Failures,
    /// Looks, plans, attempts, their joints and forces over time.
    Events,
    /// And the poses of all bodies, all contacts, and what the camera saw.
    Full,
    /// And all of that as one file, MCAP.
    Mcap,
}

impl Level {
    /// All, in their order.
    pub const ALL: [Self; 5] = [Self::None, Self::Failures, Self::Events, Self::Full, Self::Mcap];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Failures => "failures",
            Self::Events => "events",
            Self::Full => "full",
            Self::Mcap => "mcap",
        }
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Level {
    type Err = anyhow::Error;

    fn from_str(name: &str) -> anyhow::Result<Self> {
        match Self::ALL.into_iter().find(|level| level.name() == name) {
            Some(level) => Ok(level),
            None => bail!("{name}: give one of {}", Self::ALL.map(Self::name).join(", ")),
        }
    }
}

/// What to keep, and how often to look at what moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordOptions {
    /// What to keep.
    pub level: Level,
    /// Samples a simulated second, at most the physics' rate.
    pub rate_hz: f64,
}

impl RecordOptions {
    /// Samples a second where nothing else is said.
    pub const RATE_HZ: f64 = 20.0;
}

impl Default for RecordOptions {
    fn default() -> Self {
        Self { level: Level::None, rate_hz: Self::RATE_HZ }
    }
}
