//! Every number of the world that decides results and is no fact about a scene, a robot or an object.
//!
//! The control rate is no setting: [`STEP_HZ`](crate::STEP_HZ) is a constant, since plans are timed for it.

use grip_sim::range::within;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of a [`World`](crate::World), and of how objects are laid out in it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PhysicsSettings {
    /// How the engine solves contacts.
    pub solver: SolverSettings,
    /// What resists the motion of objects, and how hard they are struck.
    pub objects: ObjectSettings,
    /// The servos of the robot's joints.
    pub servo: ServoSettings,
    /// The two fingers and their drives.
    pub fingers: FingerSettings,
    /// When the arm stops by itself.
    pub stop: StopSettings,
    /// How objects are put on the table before a trial.
    pub placement: PlacementSettings,
    /// The coarser world in which data sets lay objects out.
    pub layout: LayoutSettings,
}

/// How rapier solves contacts.
///
/// Measured on eleven grasps (close, lift 0.3 m, hold 3 s, shake): with rapier's defaults 8 of 11 hold and foam is pressed
/// in by 31 mm; with these 11 of 11, creep at most 0.02 mm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SolverSettings {
    /// Steps of the engine in each control step of 1/240 s, 1 to 16. Default 1. More are finer and slower; of grasps under pose errors 2
    /// or 4 of them change two in a hundred (docs/results.md).
    pub steps: usize,
    /// Iterations of the constraint solver a step, 1 to 100. Default 8.
    pub iterations: usize,
    /// Natural frequency of contacts between bodies that move, Hz, 1 to 1000. Default 120.
    pub contact_hz: f64,
    /// Natural frequency of contacts with what is fixed, Hz, 1 to 1000. Default 25: guards, blows and servos were measured with it. The
    /// built-in objects, let fall upright ten times each, come to rest at 25, 60 and 240 Hz alike, and sink into the table by at most
    /// 0.55, 0.11 and 0.01 mm.
    pub static_contact_hz: f64,
    /// Damping ratio of both, 0.1 to 100. Default 5.
    pub contact_damping: f64,
    /// Distance within which contacts are foreseen, metres, 0 to 0.1. Default 0.005: fewer such contacts are the main saving
    /// with many hulls.
    pub prediction_m: f64,
    /// Drift up to which the points of a contact are kept, metres, 0 to 0.1. Default 0.001: more than that saves no measurable time.
    pub contact_recycle_m: f64,
}

impl Default for SolverSettings {
    fn default() -> Self {
        Self {
            steps: 1,
            iterations: 8,
            contact_hz: 120.0,
            static_contact_hz: 25.0,
            contact_damping: 5.0,
            prediction_m: 0.005,
            contact_recycle_m: 0.001,
        }
    }
}

/// What resists the motion of objects, and how hard they are struck.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectSettings {
    /// Coefficient of rolling resistance, 0 to 1: the lever arm of the resisting torque as a share of the object's size.
    /// Default 0.02: rigid cans on wood come to rest within about a second, as real ones do; rapier itself knows no rolling
    /// resistance.
    pub rolling_resistance: f64,
    /// Damping of the velocity, 1/s, 0 to 100. Default 0: free fall.
    pub linear_damping: f64,
    /// Damping of the angular velocity, 1/s, 0 to 100. Default 0.5.
    pub angular_damping: f64,
    /// Steps of 1/240 s over which the impulse of a blow is summed up, 1 to 240. Default 5 (21 ms): a stiff contact spreads
    /// it over some.
    pub blow_steps: usize,
    /// Coulomb friction of the floor, 0 to 2. Default 0.6.
    pub floor_friction: f64,
    /// Nothing moves as long as no point of any object is faster than this, m/s, above 0 to 1. Default 0.002.
    pub calm_speed: f64,
}

impl Default for ObjectSettings {
    fn default() -> Self {
        Self {
            rolling_resistance: 0.02,
            linear_damping: 0.0,
            angular_damping: 0.5,
            blow_steps: 5,
            floor_friction: 0.6,
            calm_speed: 2e-3,
        }
    }
}

/// The servos of the joints that are not fingers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ServoSettings {
    /// Bandwidth, 1/s, 1 to 240: how fast a position error decays when no limit is active. Default 60.
    pub bandwidth: f64,
    /// The servos may accelerate this much harder than plans are allowed to, 1 to 10. Default 2.5, so that they can follow a
    /// plan and still brake.
    pub acceleration: f64,
    /// Coulomb friction of the links against objects, 0 to 2. Default 0.5, painted plastic.
    pub link_friction: f64,
    /// How far they give way under what presses on the hand, times what the robot's file says (`[stiffness]`), 0 to 100. Default 1.
    pub give: f64,
    /// Time constant with which they give way, seconds, 0.02 to 10. Default 0.1: the arm's inertia, and slow enough beside contacts
    /// that do not give.
    pub give_s: f64,
}

impl Default for ServoSettings {
    fn default() -> Self {
        Self { bandwidth: 60.0, acceleration: 2.5, link_friction: 0.5, give: 1.0, give_s: 0.1 }
    }
}

/// The two fingers: dynamic bodies on force-limited drives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FingerSettings {
    /// Stiffness of a drive, N/m, 1 to 1e6. Default 20000.
    pub stiffness: f64,
    /// Damping of a drive, N s/m, 0 to 1e5. Default 200.
    pub damping: f64,
    /// Mass of a finger with its drive, kg, 0.001 to 10. Default 0.25.
    pub mass_kg: f64,
    /// Its moment of inertia about each axis, kg m^2, 1e-8 to 1. Default 0.0002 (a zero would make NaN).
    pub inertia: f64,
    /// Radius of the edges of the fingers, metres, 0 to 0.01. Default 0.001: it makes contacts of grasps a matter of
    /// distances, which are exact, and not of penetration depths. For boxes that touch by some micrometres parry 0.31 now and
    /// then takes another side for the nearest, which was a blow of 400 N on one grasp of a bottle in eight.
    pub edge_m: f64,
    /// Force with which an opening drive may push, newtons, 1 to 1000. Default 60.
    pub opening_force_n: f64,
    /// A drive may push this many times harder than it was told to, 1 to 100. Default 3: the spring between target and finger
    /// sets the force, this only bounds it.
    pub force_margin: f64,
    /// Coulomb friction of the pads as it is, whatever planning believes, 0 to 2. Default 0.9, rubber. With an object's own
    /// the pair has their mean.
    pub pad_friction: f64,
    /// Arm of the torsional friction of the patch in which a pad touches a point or an edge, metres, 0 to 0.05. Default
    /// 0.004: rubber of 2 MPa on a curve of 30 mm under 40 N touches it in a patch of radius 7 mm (Hertz), whose arm is 3 pi / 16
    /// of that.
    pub torsion_m: f64,
}

impl Default for FingerSettings {
    fn default() -> Self {
        Self {
            stiffness: 2.0e4,
            damping: 200.0,
            mass_kg: 0.25,
            inertia: 2.0e-4,
            edge_m: 0.001,
            opening_force_n: 60.0,
            force_margin: 3.0,
            pad_friction: 0.9,
            torsion_m: 0.004,
        }
    }
}

/// The protective stop of the arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StopSettings {
    /// Normal force on a link that is no finger that trips it, newtons, 1 to 1e4. Default 80, of the order of what joint
    /// torque supervision of a Fetch-sized arm notices.
    pub force_n: f64,
    /// Steps of 1/240 s in a row for which it must last, 1 to 240. Default 12: such supervision is filtered, and a guarded
    /// motion gets to react first.
    pub steps: u32,
    /// Steps after a stop was cleared during which force does not stop the arm again, so that it can back out, 0 to 2400.
    /// Default 180.
    pub grace_steps: u32,
    /// After a collision stop the arm may move on unless it goes deeper by this much, metres, 0 to 0.1. Default 0.003.
    pub deeper_m: f64,
}

impl Default for StopSettings {
    fn default() -> Self {
        Self { force_n: 80.0, steps: 12, grace_steps: 180, deeper_m: 0.003 }
    }
}

/// How objects are put on the table before a trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PlacementSettings {
    /// Layouts tried before the scene is called infeasible, 1 to 10000. Default 40.
    pub attempts: usize,
    /// Ways to spread the objects drawn in each of them, 1 to 10000. Default 20.
    pub draws: usize,
    /// Places tried for an object that is spread, 1 to 100000. Default 400.
    pub places: usize,
    /// Falls tried for an object of a cluttered layout before the layout is given up, 1 to 1000. Default 6.
    pub falls: usize,
    /// Places that each fall may begin from, 1 to 1000. Default 10.
    pub starts: usize,
    /// Height above what is below it from which an object is dropped, metres, 0.0001 to 0.5. Default 0.004: enough to be free
    /// of the table, too little to bounce.
    pub drop_m: f64,
    /// A dropped object must come to rest this far inside the table's edge, metres, 0 to 0.5. Default 0.03.
    pub edge_m: f64,
    /// Outlines keep this far from the bin, metres, 0 to 0.5. Default 0.06: an open hand fits between.
    pub bin_gap_m: f64,
    /// An object of a cluttered layout is dropped at least and at most this far from another one, as a share of the sum of their
    /// outlines' radii, each 0 to 2. Default 0.1 to 0.7.
    pub clutter_distance: [f64; 2],
    /// What moves less than this is at rest, metres, above 0 to 0.1. Default 0.001. (Not by speed: solids of many pieces
    /// tremble in the solver's hands.)
    pub drift_m: f64,
    /// What moves farther than this in `fallen_s` is about to roll away, metres, above 0 to 1. Default 0.015.
    pub rolling_m: f64,
    /// Time for what is put down to come to rest before the next one follows, seconds, above 0 to 60. Default 0.8.
    pub fall_s: f64,
    /// It must be at rest for as long as this, seconds, above 0 to 60. Default 0.2.
    pub fallen_s: f64,
    /// Time for the whole layout to come to rest, seconds, above 0 to 60. Default 4.
    pub settle_s: f64,
    /// It must be at rest for as long as this, seconds, above 0 to 60. Default 0.5.
    pub stands_s: f64,
}

impl Default for PlacementSettings {
    fn default() -> Self {
        Self {
            attempts: 40,
            draws: 20,
            places: 400,
            falls: 6,
            starts: 10,
            drop_m: 0.004,
            edge_m: 0.03,
            bin_gap_m: 0.06,
            clutter_distance: [0.1, 0.7],
            drift_m: 0.001,
            rolling_m: 0.015,
            fall_s: 0.8,
            fallen_s: 0.2,
            settle_s: 4.0,
            stands_s: 0.5,
        }
    }
}

/// The coarser world of [`World::for_layout`](crate::World::for_layout): a third of the steps a second, a fraction of the
/// work in each, and air as thick as oil, in which what rolls and tips comes to rest where it would anyway, but soon.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LayoutSettings {
    /// Iterations of the constraint solver a step, 1 to 100. Default 2.
    pub iterations: usize,
    /// As [`SolverSettings::contact_recycle_m`], metres, 0 to 0.1. Default 0.005.
    pub contact_recycle_m: f64,
    /// Damping of the velocity, 1/s, 0 to 100. Default 2.
    pub linear_damping: f64,
    /// Damping of the angular velocity, 1/s, 0 to 100. Default 8.
    pub angular_damping: f64,
    /// What has been at rest for so long sleeps, seconds, 0 to 10. Default 0.15: it costs nothing from then on.
    pub sleep_s: f64,
}

impl Default for LayoutSettings {
    fn default() -> Self {
        Self {
            iterations: 2,
            contact_recycle_m: 0.005,
            linear_damping: 2.0,
            angular_damping: 8.0,
            sleep_s: 0.15,
        }
    }
}

/// The smallest number that counts as above zero.
const ABOVE_0: f64 = 1e-6;

impl PhysicsSettings {
    /// Whether every number is within its range.
    ///
    /// # Errors
    /// The first that is not, by its name in the tree, its value and its range.
    pub fn validate(&self) -> Result<(), String> {
        let Self { solver, objects, servo, fingers, stop, placement, layout } = self;
        within("solver.steps", solver.steps as f64, 1.0, 16.0)?;
        within("solver.iterations", solver.iterations as f64, 1.0, 100.0)?;
        within("solver.contact_hz", solver.contact_hz, 1.0, 1000.0)?;
        within("solver.static_contact_hz", solver.static_contact_hz, 1.0, 1000.0)?;
        within("solver.contact_damping", solver.contact_damping, 0.1, 100.0)?;
        within("solver.prediction_m", solver.prediction_m, 0.0, 0.1)?;
        within("solver.contact_recycle_m", solver.contact_recycle_m, 0.0, 0.1)?;
        within("objects.rolling_resistance", objects.rolling_resistance, 0.0, 1.0)?;
        within("objects.linear_damping", objects.linear_damping, 0.0, 100.0)?;
        within("objects.angular_damping", objects.angular_damping, 0.0, 100.0)?;
        within("objects.blow_steps", objects.blow_steps as f64, 1.0, 240.0)?;
        within("objects.floor_friction", objects.floor_friction, 0.0, 2.0)?;
        within("objects.calm_speed", objects.calm_speed, ABOVE_0, 1.0)?;
        within("servo.bandwidth", servo.bandwidth, 1.0, 240.0)?;
        within("servo.acceleration", servo.acceleration, 1.0, 10.0)?;
        within("servo.link_friction", servo.link_friction, 0.0, 2.0)?;
        within("servo.give", servo.give, 0.0, 100.0)?;
        within("servo.give_s", servo.give_s, 0.02, 10.0)?;
        within("fingers.stiffness", fingers.stiffness, 1.0, 1e6)?;
        within("fingers.damping", fingers.damping, 0.0, 1e5)?;
        within("fingers.mass_kg", fingers.mass_kg, 1e-3, 10.0)?;
        within("fingers.inertia", fingers.inertia, 1e-8, 1.0)?;
        within("fingers.edge_m", fingers.edge_m, 0.0, 0.01)?;
        within("fingers.opening_force_n", fingers.opening_force_n, 1.0, 1000.0)?;
        within("fingers.force_margin", fingers.force_margin, 1.0, 100.0)?;
        within("fingers.pad_friction", fingers.pad_friction, 0.0, 2.0)?;
        within("fingers.torsion_m", fingers.torsion_m, 0.0, 0.05)?;
        within("stop.force_n", stop.force_n, 1.0, 1e4)?;
        within("stop.steps", f64::from(stop.steps), 1.0, 240.0)?;
        within("stop.grace_steps", f64::from(stop.grace_steps), 0.0, 2400.0)?;
        within("stop.deeper_m", stop.deeper_m, 0.0, 0.1)?;
        placement.validate().map_err(|message| format!("placement.{message}"))?;
        within("layout.iterations", layout.iterations as f64, 1.0, 100.0)?;
        within("layout.contact_recycle_m", layout.contact_recycle_m, 0.0, 0.1)?;
        within("layout.linear_damping", layout.linear_damping, 0.0, 100.0)?;
        within("layout.angular_damping", layout.angular_damping, 0.0, 100.0)?;
        within("layout.sleep_s", layout.sleep_s, 0.0, 10.0)
    }
}

impl PlacementSettings {
    /// Whether every number is within its range.
    ///
    /// # Errors
    /// The first that is not, by its name, its value and its range.
    pub fn validate(&self) -> Result<(), String> {
        within("attempts", self.attempts as f64, 1.0, 1e4)?;
        within("draws", self.draws as f64, 1.0, 1e4)?;
        within("places", self.places as f64, 1.0, 1e5)?;
        within("falls", self.falls as f64, 1.0, 1000.0)?;
        within("starts", self.starts as f64, 1.0, 1000.0)?;
        within("drop_m", self.drop_m, 1e-4, 0.5)?;
        within("edge_m", self.edge_m, 0.0, 0.5)?;
        within("bin_gap_m", self.bin_gap_m, 0.0, 0.5)?;
        let [least, most] = self.clutter_distance;
        within("clutter_distance", least, 0.0, 2.0)?;
        within("clutter_distance", most, 0.0, 2.0)?;
        if least >= most {
            return Err(format!(
                "clutter_distance = [{least}, {most}]: the first must be smaller than the second"
            ));
        }
        within("drift_m", self.drift_m, ABOVE_0, 0.1)?;
        within("rolling_m", self.rolling_m, ABOVE_0, 1.0)?;
        within("fall_s", self.fall_s, ABOVE_0, 60.0)?;
        within("fallen_s", self.fallen_s, ABOVE_0, 60.0)?;
        within("settle_s", self.settle_s, ABOVE_0, 60.0)?;
        within("stands_s", self.stands_s, ABOVE_0, 60.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_survive_being_saved_and_any_part_may_be_given() {
        let mut settings = PhysicsSettings::default();
        assert_eq!(settings.validate(), Ok(()));
        settings.fingers.pad_friction = 0.6;
        settings.placement.clutter_distance = [0.2, 0.5];
        let text = toml::to_string(&settings).unwrap();
        assert_eq!(toml::from_str::<PhysicsSettings>(&text).unwrap(), settings);
        let part: PhysicsSettings = toml::from_str("[placement]\ndrop_m = 0.01").unwrap();
        let placement = PlacementSettings { drop_m: 0.01, ..PlacementSettings::default() };
        assert_eq!(part, PhysicsSettings { placement, ..PhysicsSettings::default() });
    }

    #[test]
    fn what_is_unknown_or_out_of_range_is_named_with_its_value() {
        let read = |text: &str| toml::from_str::<PhysicsSettings>(text);
        assert!(read("[placement]\ndrop = 0.01").unwrap_err().to_string().contains("drop"));
        for (text, wanted) in [
            ("[solver]\niterations = 0", "solver.iterations = 0"),
            ("[solver]\ncontact_hz = nan", "solver.contact_hz = NaN"),
            ("[fingers]\npad_friction = 3.0", "fingers.pad_friction = 3"),
            ("[stop]\nforce_n = -1.0", "stop.force_n = -1"),
            ("[placement]\nfallen_s = 0.0", "placement.fallen_s = 0"),
            ("[placement]\nclutter_distance = [0.7, 0.1]", "placement.clutter_distance = [0.7, 0.1]"),
            ("[layout]\nsleep_s = inf", "layout.sleep_s = inf"),
        ] {
            let message = read(text).unwrap().validate().unwrap_err();
            assert!(message.contains(wanted), "{text}: {message}");
        }
    }
}
