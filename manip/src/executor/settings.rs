//! Settings of the executor.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ranges::Ranges;

/// Settings of [`super::execute`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ExecutorSettings {
    /// Contact force that stops a free motion, newtons beside what was felt at its start, 1 to 1000. Default 60.
    pub free_force: f64,
    /// Control periods in a row for which a force must last to stop a motion, 1 to 1000. Default 2.
    pub force_periods: u32,
    /// A motion may begin this far from where the arm is, radians or metres, 0 to 3. Default 0.25: what a guarded motion leaves
    /// when it stops early.
    pub farthest_start: f64,
    /// Longest wait for the joints to arrive after a motion, seconds, 0 to 60. Default 0.6.
    pub settle_time: f64,
    /// Joints this near to their target have arrived, radians or metres, 0.0001 to 1. Default 0.005.
    pub arrival_tolerance: f64,
    /// Joints farther than this from their target after the wait have failed, radians or metres, 0.0001 to 3. Default 0.05.
    pub tracking_tolerance: f64,
    /// Longest wait for the fingers, seconds, 0.1 to 60. Default 3.0.
    pub grip_timeout: f64,
    /// The fingers stand still when they move less than this in 0.1 s, metres, 1e-6 to 0.1. Default 0.0002.
    pub still_motion: f64,
    /// Share of the commanded force with which the drives must press before a grasp is closed, 0 to 1. Default 0.8: their force
    /// builds up after the fingers stand still.
    pub pressed_share: f64,
    /// Fingers this near to the opening that they were told are open, metres, 1e-6 to 0.1. Default 0.001.
    pub opening_tolerance: f64,
    /// Fingers closer together than this share of the expected width have missed, 0 to 1. Default 0.3.
    pub miss_share: f64,
    /// ... or than this, metres, 0 to 0.1. Default 0.001.
    pub miss_width: f64,
    /// Change of the width while carrying that counts as lost, metres, 0.0001 to 0.2. Default 0.010.
    pub slip_limit: f64,
    /// A lowering motion that meets something with less than this left lets go there, metres, 0 to 1. Default 0.05: on what
    /// stands in its way in the bin, rather than to carry it about. The hand then draws back the way it came.
    pub early_release: f64,
    /// Share of the planned speed when backing off, 0.01 to 1. Default 0.5.
    pub back_off_speed: f64,
    /// How much of a free motion is taken back after a contact, seconds of the plan, 0 to 60. Default 0.5.
    pub back_off_time: f64,
    /// Most of a guarded motion that is taken back to relieve a contact, seconds of the plan, 0 to 60. Default 0.3.
    pub relief_time: f64,
    /// Share of the force that stopped a guarded motion at which the contact is relieved, 0 to 1. Default 0.25.
    pub relief_share: f64,
    /// How much farther the fingers open for a release in place, metres, both together, 0 to 0.2. Default 0.03: no wider than it
    /// takes, for there may be a wall beside the hand.
    pub release_opening: f64,
    /// How long a release in place takes, seconds, 0 to 60. Default 0.8.
    pub release_time: f64,
}

impl Default for ExecutorSettings {
    fn default() -> Self {
        Self {
            free_force: 60.0,
            force_periods: 2,
            farthest_start: 0.25,
            settle_time: 0.6,
            arrival_tolerance: 0.005,
            tracking_tolerance: 0.05,
            grip_timeout: 3.0,
            still_motion: 0.0002,
            pressed_share: 0.8,
            opening_tolerance: 0.001,
            miss_share: 0.3,
            miss_width: 0.001,
            slip_limit: 0.010,
            early_release: 0.05,
            back_off_speed: 0.5,
            back_off_time: 0.5,
            relief_time: 0.3,
            relief_share: 0.25,
            release_opening: 0.03,
            release_time: 0.8,
        }
    }
}

impl ExecutorSettings {
    /// The first field out of its range, with its value and its range, in words; none when all can be used.
    ///
    /// # Errors
    /// That.
    pub fn validate(&self) -> Result<(), String> {
        Ranges::default()
            .number("free_force", self.free_force, 1.0..=1000.0, "newtons")
            .count("force_periods", self.force_periods as usize, 1..=1000)
            .number("farthest_start", self.farthest_start, 0.0..=3.0, "radians or metres")
            .number("settle_time", self.settle_time, 0.0..=60.0, "seconds")
            .number("arrival_tolerance", self.arrival_tolerance, 0.0001..=1.0, "radians or metres")
            .number("tracking_tolerance", self.tracking_tolerance, 0.0001..=3.0, "radians or metres")
            .number("grip_timeout", self.grip_timeout, 0.1..=60.0, "seconds")
            .number("still_motion", self.still_motion, 1e-6..=0.1, "metres")
            .number("pressed_share", self.pressed_share, 0.0..=1.0, "a share")
            .number("opening_tolerance", self.opening_tolerance, 1e-6..=0.1, "metres")
            .number("miss_share", self.miss_share, 0.0..=1.0, "a share")
            .number("miss_width", self.miss_width, 0.0..=0.1, "metres")
            .number("slip_limit", self.slip_limit, 0.0001..=0.2, "metres")
            .number("early_release", self.early_release, 0.0..=1.0, "metres")
            .number("back_off_speed", self.back_off_speed, 0.01..=1.0, "a share")
            .number("back_off_time", self.back_off_time, 0.0..=60.0, "seconds")
            .number("relief_time", self.relief_time, 0.0..=60.0, "seconds")
            .number("relief_share", self.relief_share, 0.0..=1.0, "a share")
            .number("release_opening", self.release_opening, 0.0..=0.2, "metres")
            .number("release_time", self.release_time, 0.0..=60.0, "seconds")
            .result()
    }
}
