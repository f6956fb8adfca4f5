//! What counts as a success, in numbers, and what the score card counts.

use grip_physics::STEP_HZ;
use grip_sim::range::within;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The bounds by which a grasp and a packed item are judged. `pack --strict` prints them beside what was measured; the
/// clauses that they belong to are those of [`crate::score::outcome::Clauses`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SuccessCriteria {
    /// A finger presses from this force on, newtons; 0.1 to 50. Default 1: well above the solver's noise, well below the
    /// 5 N of the weakest grasp.
    pub finger_force_n: f64,
    /// Fingers oppose each other when the dot product of their unit forces is at most this; -1 to 0. Default -0.3: forces
    /// 107 degrees apart or more.
    pub opposing_dot: f64,
    /// Whether fingers must also oppose each other as friction demands (antipodal, Nguyen 1988): forces within its cone balance only where
    /// the normals are at most twice its angle off a line, with the true friction of pads and item. Default yes.
    pub friction_cone: bool,
    /// Whether an item is lifted clear and held only while no link of the robot touches it but the fingers. Default yes: what the palm
    /// carries is not held.
    pub fingers_alone: bool,
    /// How long they must press before the lift begins, seconds; 0 to 1. Default 0.025: six steps of physics.
    pub pinch_s: f64,
    /// How far the lowest point must rise while nothing but the hand touches the item, metres; 0 to 0.5. Default 0.03, as
    /// usual for grasps on a bench.
    pub lift_m: f64,
    /// How long the item must have been pinched and clear of everything when the carry ends, seconds; 0 to 5. Default 0.1.
    pub hold_s: f64,
    /// How far it may move in the hand, metres; 0 to 0.2. Default 0.02: one that moved more was dragged along.
    pub slip_m: f64,
    /// How far it may turn in the hand, degrees; 0 to 180. Default 20.
    pub slip_deg: f64,
    /// Slower than this it is at rest, m/s; 0 to 1. Default 0.01.
    pub at_rest_m_s: f64,
    /// It is at rest when no point of it moves farther than this in the trial's last second (`trial.drift_s`), metres; 0 to 1. Default
    /// 0.002: what solids of many pieces tremble in the solver's hands stays well below, what rolls or tips does not.
    pub rest_m: f64,
    /// How far it may fall when it is let go, metres; 0 to 1. Default 0.05: a person who packs sets down and does not drop.
    pub release_m: f64,
    /// How fast it may be when it has been let go, m/s; 0 to 10. Default 1: after a fall of 5 cm.
    pub landing_m_s: f64,
    /// Whether an item that took a larger blow than does it no harm (`scenes/objects.toml`, fragility) from the attempt that packed it on is
    /// not packed. Default yes. (What befell it on the table before, the score card counts.)
    pub unharmed: bool,
    /// An item that must stand may lean this far, degrees; 0 to 90. Default 30.
    pub tilt_deg: f64,
    /// An item is lost when its lowest point is so far below the table's top, metres; 0 to 1. Default 0.05.
    pub fallen_m: f64,
}

impl Default for SuccessCriteria {
    fn default() -> Self {
        Self {
            finger_force_n: 1.0,
            opposing_dot: -0.3,
            friction_cone: true,
            fingers_alone: true,
            pinch_s: 0.025,
            lift_m: 0.03,
            hold_s: 0.1,
            slip_m: 0.020,
            slip_deg: 20.0,
            at_rest_m_s: 0.01,
            rest_m: 0.002,
            release_m: 0.05,
            landing_m_s: 1.0,
            unharmed: true,
            tilt_deg: 30.0,
            fallen_m: 0.05,
        }
    }
}

impl SuccessCriteria {
    /// # Errors
    /// The first field that is out of its range, with its value and its range.
    pub fn validate(&self) -> std::result::Result<(), String> {
        within("finger_force_n", self.finger_force_n, 0.1, 50.0)?;
        within("opposing_dot", self.opposing_dot, -1.0, 0.0)?;
        within("pinch_s", self.pinch_s, 0.0, 1.0)?;
        within("lift_m", self.lift_m, 0.0, 0.5)?;
        within("hold_s", self.hold_s, 0.0, 5.0)?;
        within("slip_m", self.slip_m, 0.0, 0.2)?;
        within("slip_deg", self.slip_deg, 0.0, 180.0)?;
        within("at_rest_m_s", self.at_rest_m_s, 0.0, 1.0)?;
        within("rest_m", self.rest_m, 0.0, 1.0)?;
        within("release_m", self.release_m, 0.0, 1.0)?;
        within("landing_m_s", self.landing_m_s, 0.0, 10.0)?;
        within("tilt_deg", self.tilt_deg, 0.0, 90.0)?;
        within("fallen_m", self.fallen_m, 0.0, 1.0)
    }

    /// Physics steps of [`SuccessCriteria::pinch_s`].
    pub fn pinch_steps(&self) -> u32 {
        steps(self.pinch_s)
    }

    /// Physics steps of [`SuccessCriteria::hold_s`].
    pub fn hold_steps(&self) -> u32 {
        steps(self.hold_s)
    }
}

/// Bounds of the score card. None of them decides whether an item was packed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ScoreSettings {
    /// An item is disturbed when a point of it moved farther than this during an attempt at another, metres; 0 to 1.
    /// Default 0.01.
    pub disturbed_m: f64,
    /// Something rests on an item that it presses down with at least this, newtons; 0 to 50. Default 0.2: what leans on
    /// it or touches it from the side does not.
    pub resting_n: f64,
    /// Edge of a cell of the height map by which density is measured, metres; 0.001 to 0.05. Default 0.005.
    pub cell_m: f64,
}

impl Default for ScoreSettings {
    fn default() -> Self {
        Self { disturbed_m: 0.010, resting_n: 0.2, cell_m: 0.005 }
    }
}

impl ScoreSettings {
    /// # Errors
    /// The first field that is out of its range, with its value and its range.
    pub fn validate(&self) -> std::result::Result<(), String> {
        within("disturbed_m", self.disturbed_m, 0.0, 1.0)?;
        within("resting_n", self.resting_n, 0.0, 50.0)?;
        within("cell_m", self.cell_m, 0.001, 0.05)
    }
}

fn steps(seconds: f64) -> u32 {
    (seconds * f64::from(STEP_HZ)).round() as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_whole_steps_of_physics() {
        let criteria = SuccessCriteria::default();
        assert_eq!((criteria.pinch_steps(), criteria.hold_steps()), (6, 24));
    }

    #[test]
    fn what_is_out_of_range_is_named() {
        assert_eq!(SuccessCriteria::default().validate(), Ok(()));
        let odd = SuccessCriteria { slip_deg: f64::NAN, ..SuccessCriteria::default() };
        let problem = odd.validate().unwrap_err();
        assert!(problem.contains("slip_deg = NaN") && problem.contains("0 to 180"), "{problem}");
    }
}
