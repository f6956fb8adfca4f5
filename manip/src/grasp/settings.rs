//! Settings of the search for grasps and of their choice.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ranges::Ranges;

/// Settings of [`super::antipodal_grasps`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AntipodalSettings {
    /// Surface points drawn, 1 to 1 000 000. Default 1000.
    pub samples: usize,
    /// Most contact pairs kept, spread over the object, 1 to 100 000. Default 160.
    pub pairs: usize,
    /// Approach directions about each closing axis, 1 to 360. Default 16, so that 0, 90, 180 degrees are among them.
    pub approaches: usize,
    /// How far behind the contact the centres of the pads may be, metres, 0 to 0.2: shallow grasps reach flat objects on a
    /// table. Default 0, 12 and 22 mm; the pads' half length is 30 mm.
    pub depths: Vec<f64>,
    /// Widest object, metres, 0.001 to 1. Default 0.092: the Fetch's opening of 0.10 less 4 mm on each side.
    pub max_width: f64,
    /// Coefficient of friction of the pads, 0 to 5; a pad and an object have the mean of theirs. Default 0.9: rubber, and what
    /// the simulated pads have. Physics and planner should agree on it.
    pub pad_friction: f64,
    /// Share of the friction coefficient that the normals may use up, 0.01 to 1. Default 0.6.
    pub friction_share: f64,
    /// Air between open fingers and the object in tight places, both sides together, metres, 0 to 0.2. Default 0.024.
    pub finger_room: f64,
    /// Distance of the open hand from the object that it is about to grasp, metres, 0 to 0.05. Default 0.001.
    pub hand_room: f64,
    /// How much farther along the fingers the hand must fit as well, metres, 0 to 0.1: pose error and servo lag may push it on.
    /// Default 0.005.
    pub overshoot: f64,
}

impl Default for AntipodalSettings {
    fn default() -> Self {
        Self {
            samples: 1000,
            pairs: 160,
            approaches: 16,
            depths: vec![0.0, 0.012, 0.022],
            max_width: 0.092,
            pad_friction: 0.9,
            friction_share: 0.6,
            finger_room: 0.024,
            hand_room: 0.001,
            overshoot: 0.005,
        }
    }
}

impl AntipodalSettings {
    /// What is wrong with a value, if anything: the first field out of its range, its value and the range.
    ///
    /// # Errors
    /// That.
    pub fn validate(&self) -> Result<(), String> {
        Ranges::default()
            .count("samples", self.samples, 1..=1_000_000)
            .count("pairs", self.pairs, 1..=100_000)
            .count("approaches", self.approaches, 1..=360)
            .numbers("depths", &self.depths, 0.0..=0.2, "metres")
            .number("max_width", self.max_width, 0.001..=1.0, "metres")
            .number("pad_friction", self.pad_friction, 0.0..=5.0, "a coefficient of friction")
            .number("friction_share", self.friction_share, 0.01..=1.0, "a share")
            .number("finger_room", self.finger_room, 0.0..=0.2, "metres")
            .number("hand_room", self.hand_room, 0.0..=0.05, "metres")
            .number("overshoot", self.overshoot, 0.0..=0.1, "metres")
            .result()
    }
}

/// Weights of a grasp's score, each 0 to 100. Each term is between 0 (bad) and 1 (good).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GraspWeights {
    /// Approach straight down, or level and away from the robot where the hand comes from the front. Default 1.0: the arm and the bin's
    /// walls favour the one, a board above the object the other.
    pub gravity: f64,
    /// Centre of mass between the pads ([`GraspSettings::lever_scale`]). Default 1.2: a lever lets the object turn.
    pub lever: f64,
    /// Room between pads and object against two standard deviations of the position. Default 1.0.
    pub room: f64,
    /// Contact patch ([`GraspSettings::contact_full`]). Default 1.0.
    pub contact: f64,
    /// Contacts that spread in both directions ([`GraspSettings::spread_full`]): about a line, such as a can's rim, an object
    /// turns in the hand. Default 2.0, which outweighs the lever of a can's corner.
    pub spread: f64,
    /// Contacts at the pads' centre rather than at their tips. Default 0.5.
    pub depth: f64,
    /// Normals along the closing axis. Default 0.4.
    pub cone: f64,
    /// Distance of the hand from other things ([`GraspSettings::clearance_full`]). Default 0.6.
    pub clearance: f64,
}

impl Default for GraspWeights {
    fn default() -> Self {
        Self {
            gravity: 1.0,
            lever: 1.2,
            room: 1.0,
            contact: 1.0,
            spread: 2.0,
            depth: 0.5,
            cone: 0.4,
            clearance: 0.6,
        }
    }
}

impl GraspWeights {
    /// What is wrong with a value, if anything: the first field out of its range, its value and the range.
    ///
    /// # Errors
    /// That.
    pub fn validate(&self) -> Result<(), String> {
        let weights = [
            ("gravity", self.gravity),
            ("lever", self.lever),
            ("room", self.room),
            ("contact", self.contact),
            ("spread", self.spread),
            ("depth", self.depth),
            ("cone", self.cone),
            ("clearance", self.clearance),
        ];
        weights
            .into_iter()
            .fold(Ranges::default(), |ranges, (field, weight)| {
                ranges.number(field, weight, 0.0..=100.0, "a weight")
            })
            .result()
    }
}

/// Settings of [`super::rank_grasps`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GraspSettings {
    /// Least downward part of the approach direction, -1 to 1. Default 0.17: up to 80 degrees from straight down.
    pub least_down: f64,
    /// Where no grasp from above leads to a plan and a board is above the object, the hand comes from the front: least part of the
    /// approach direction that leads level away from the robot's base, -1 to 1. Default 0: from the front or from beside, not from
    /// behind.
    pub front_least_away: f64,
    /// Least downward part of the approach direction of such a hand, -1 to 1. Default -0.1: level, by an estimate that is turned a little.
    pub front_least_down: f64,
    /// Least distance of the hand from the table and other things at the grasp, metres, 0 to 0.1. Default 0.004.
    pub margin: f64,
    /// Share of the other objects' position spread that is added to that, 0 to 10. Default 0.5.
    pub spread_share: f64,
    /// Distance of the pre-grasp pose along the approach, metres, 0.01 to 0.5. Default 0.09.
    pub standoff: f64,
    /// Grasps returned at most, 1 to 100 000. Default 40.
    pub keep: usize,
    /// Grasps that are tried with the hand's solids at most, 1 to 1 000 000: a bound on the work in hopeless clutter. Default
    /// 1500.
    pub most_tried: usize,
    /// Grasps nearer to each other than this are one, metres, 0 to 0.1, ... Default 0.008: if one is out of reach, so is the
    /// other.
    pub distinct_distance: f64,
    /// ... and turned by less than this, radians, 0 to pi. Default 0.21, 12 degrees.
    pub distinct_angle: f64,
    /// A grasp of this score is worth taking before others are picked away, 0 to 1000. Default 4.5, of 7.7 that weights give
    /// at most: of 60 grasps in clutter three of four that slipped were below it and two of 56 that held.
    pub firm: f64,
    /// What of the pads must stay on the object when a grasp that reaches too low is drawn back, metres, 0 to 0.1. Default
    /// 0.003.
    pub fingertips: f64,
    /// Horizontal distance of the centre of mass from the pads at which its term is zero, metres, 0.001 to 1. Default 0.06.
    pub lever_scale: f64,
    /// Share of the pads in contact at which its term is full, 0.01 to 1. Default 0.34: a third of the pad is what a can gives.
    pub contact_full: f64,
    /// Spread of the contacts (one standard deviation) at which its term is full, metres, 0.0001 to 0.1. Default 0.003.
    pub spread_full: f64,
    /// Distance of the hand from other things at which its term is full, metres, 0.001 to 1. Default 0.03.
    pub clearance_full: f64,
    /// Candidates in the object's frame.
    pub antipodal: AntipodalSettings,
    /// Weights of the score.
    pub weights: GraspWeights,
}

impl Default for GraspSettings {
    fn default() -> Self {
        Self {
            least_down: 0.17,
            front_least_away: 0.0,
            front_least_down: -0.1,
            margin: 0.004,
            spread_share: 0.5,
            standoff: 0.09,
            keep: 40,
            most_tried: 1500,
            distinct_distance: 0.008,
            distinct_angle: 0.21,
            firm: 4.5,
            fingertips: 0.003,
            lever_scale: 0.06,
            contact_full: 0.34,
            spread_full: 0.003,
            clearance_full: 0.03,
            antipodal: AntipodalSettings::default(),
            weights: GraspWeights::default(),
        }
    }
}

impl GraspSettings {
    /// What is wrong with a value, if anything: the first field out of its range, its value and the range.
    ///
    /// # Errors
    /// That.
    pub fn validate(&self) -> Result<(), String> {
        Ranges::default()
            .number("least_down", self.least_down, -1.0..=1.0, "a cosine")
            .number("front_least_away", self.front_least_away, -1.0..=1.0, "a cosine")
            .number("front_least_down", self.front_least_down, -1.0..=1.0, "a cosine")
            .number("margin", self.margin, 0.0..=0.1, "metres")
            .number("spread_share", self.spread_share, 0.0..=10.0, "a share")
            .number("standoff", self.standoff, 0.01..=0.5, "metres")
            .count("keep", self.keep, 1..=100_000)
            .count("most_tried", self.most_tried, 1..=1_000_000)
            .number("distinct_distance", self.distinct_distance, 0.0..=0.1, "metres")
            .number("distinct_angle", self.distinct_angle, 0.0..=std::f64::consts::PI, "radians")
            .number("firm", self.firm, 0.0..=1000.0, "a score")
            .number("fingertips", self.fingertips, 0.0..=0.1, "metres")
            .number("lever_scale", self.lever_scale, 0.001..=1.0, "metres")
            .number("contact_full", self.contact_full, 0.01..=1.0, "a share")
            .number("spread_full", self.spread_full, 0.0001..=0.1, "metres")
            .number("clearance_full", self.clearance_full, 0.001..=1.0, "metres")
            .part("antipodal", self.antipodal.validate())
            .part("weights", self.weights.validate())
            .result()
    }
}
