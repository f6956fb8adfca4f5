//! Settings of the choice of a place in the bin.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ranges::Ranges;

/// Settings of [`super::place_poses`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PlaceSettings {
    /// Edge of a cell of the height map, metres, 0.001 to 0.05. Default 0.005.
    pub cell: f64,
    /// Headings tried over a full turn, 1 to 360. Default 24.
    pub headings: usize,
    /// Room about the object's outline to walls and neighbours, metres, 0 to 0.1. Default 0.008; the spread of the object's
    /// position is added.
    pub margin: f64,
    /// Height above the support at which the object is let go, metres, 0 to 0.2. Default 0.008.
    pub release_height: f64,
    /// Places returned at most, 1 to 100 000. Default 400: the hand fits only at some of them.
    pub keep: usize,
    /// A gap below the object that is smaller than this counts as support, metres, 0 to 0.05. Default 0.006: about a cell.
    pub support_gap: f64,
    /// Where an object stands, what bears it reaches so far beyond its centre of mass to every side, metres, 0 to 0.1, or half as far as
    /// the object does. Default 0.015: less than that and it falls off a bottle's cap.
    pub stand_margin: f64,
    /// Cost of a metre of the object's top above the bin's floor, litres, 0 to 1000. Default 2: it breaks ties, low ones first.
    pub height_cost: f64,
    /// Cost of the middle of the bin against its walls, litres, 0 to 1000. Default 0.1: the middle stays open for the hand.
    pub middle_cost: f64,
    /// Cost of a place where the object tips over, litres, 0 to 1e6. Default 100: more than of any where it stands.
    pub tip_cost: f64,
    /// How deep what is below an object may be where it tips over, metres, 0 to 1. Default 0.04: it would fall as far.
    pub tip_fall: f64,
    /// Places nearer to each other than this are one, metres, 0 to 1, ... Default 0.025.
    pub distinct_distance: f64,
    /// ... and with headings that differ by less than this, radians, 0 to pi. Default 0.5.
    pub distinct_angle: f64,
}

impl Default for PlaceSettings {
    fn default() -> Self {
        Self {
            cell: 0.005,
            headings: 24,
            margin: 0.008,
            release_height: 0.008,
            keep: 400,
            support_gap: 0.006,
            stand_margin: 0.015,
            height_cost: 2.0,
            middle_cost: 0.1,
            tip_cost: 100.0,
            tip_fall: 0.04,
            distinct_distance: 0.025,
            distinct_angle: 0.5,
        }
    }
}

impl PlaceSettings {
    /// What is wrong with a value, if anything: the first field out of its range, its value and the range.
    ///
    /// # Errors
    /// That.
    pub fn validate(&self) -> Result<(), String> {
        Ranges::default()
            .number("cell", self.cell, 0.001..=0.05, "metres")
            .count("headings", self.headings, 1..=360)
            .number("margin", self.margin, 0.0..=0.1, "metres")
            .number("release_height", self.release_height, 0.0..=0.2, "metres")
            .count("keep", self.keep, 1..=100_000)
            .number("support_gap", self.support_gap, 0.0..=0.05, "metres")
            .number("stand_margin", self.stand_margin, 0.0..=0.1, "metres")
            .number("height_cost", self.height_cost, 0.0..=1000.0, "litres a metre")
            .number("middle_cost", self.middle_cost, 0.0..=1000.0, "litres")
            .number("tip_cost", self.tip_cost, 0.0..=1e6, "litres")
            .number("tip_fall", self.tip_fall, 0.0..=1.0, "metres")
            .number("distinct_distance", self.distinct_distance, 0.0..=1.0, "metres")
            .number("distinct_angle", self.distinct_angle, 0.0..=std::f64::consts::PI, "radians")
            .result()
    }
}
