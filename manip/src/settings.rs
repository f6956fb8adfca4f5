//! Settings of the planner: one tree, whose parts stand beside what they rule.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use crate::collision::{Margins, UnmodelledSettings};
use crate::grasp::{GraspSettings, GripForceSettings};
use crate::motion::{MotionLimits, RrtSettings, SmoothPath, Trajectory, time_path};
use crate::order::OrderSettings;
use crate::pick::PushSettings;
use crate::place::PlaceSettings;
use crate::ranges::Ranges;

/// Settings of [`crate::Planner`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PlannerSettings {
    /// Grasps that are tried, best first, 1 to 100 000. Default 24.
    pub grasp_tries: usize,
    /// Places that are tried for each of them, of those that the hand fits in, 1 to 100 000. Default 16.
    pub place_tries: usize,
    /// Paths to places that are searched for each grasp, 1 to 1000. Default 3: what blocks three of them blocks more.
    pub carry_tries: usize,
    /// Seeds from the table for each inverse kinematics problem, 0 to 6000. Default 8.
    pub ik_seeds: usize,
    /// Solutions of the inverse kinematics that are tried for each grasp, 1 to 1000. Default 3.
    pub ik_solutions: usize,
    /// Objects whose lower side is within this of the table's height are believed to stand on it, metres, 0 to 0.1. Default
    /// 0.015: a table's height is known far better than an object's.
    pub table_snap: f64,
    /// Room between the object and the top of the bin's walls when it is carried in, metres, 0 to 0.5. Default 0.03.
    pub wall_clearance: f64,
    /// Straight way from above down to a place, metres, at least, 0.01 to 1. Default 0.08.
    pub least_lower: f64,
    /// How far what is held is moved from side to side above its place before it is lowered, along the world's x, y and z, metres, 0 to
    /// 0.3. Default 0: not at all. Its speed is `grasp_test.shake_speed`.
    pub shake: f64,
    /// Straight way back from a placed object, metres, 0.01 to 1. Default 0.10.
    pub retreat: f64,
    /// How much wider than the object the gripper opens to let go, metres, both sides together, 0.001 to 0.2. Default 0.030.
    pub release_opening: f64,
    /// Contact force that stops a guarded motion, newtons, 1 to 1000. Default 20.
    pub guard_force: f64,
    /// A guarded motion that stops with less than this left has arrived, metres, 0 to 0.2. Default 0.02.
    pub guard_near: f64,
    /// Where something is nearer than this, a search begins with a straight way out, metres, 0 to 0.5. Default 0.05: searches
    /// hardly find out of a shelf by themselves.
    pub way_out_near: f64,
    /// Length of that way at most, metres, 0.02 to 1. Default 0.3.
    pub way_out_length: f64,
    /// Margins of free motion. Default 10 mm to the world, so that checks 20 mm apart leave no gap; 5 mm between links; half of
    /// an object's spread.
    #[serde(deserialize_with = "given_free")]
    #[schemars(with = "GivenMargins")]
    pub free_margins: Margins,
    /// Margins of straight motion at objects. Default 2 mm to the world, 3 mm between links and nothing of the spread: the hand
    /// has to come near what it grasps.
    #[serde(deserialize_with = "given_near")]
    #[schemars(with = "GivenMargins")]
    pub near_margins: Margins,
    /// Straight lifts.
    pub lift: LiftSettings,
    /// Speeds and accelerations.
    pub speed: SpeedSettings,
    /// Search in joint space.
    pub rrt: RrtSettings,
    /// Choice of grasps.
    pub grasp: GraspSettings,
    /// How firmly to hold.
    pub grip_force: GripForceSettings,
    /// Choice of places.
    pub place: PlaceSettings,
    /// Pushing what is too crowded to be picked.
    pub push: PushSettings,
    /// Which object to pick first.
    pub order: OrderSettings,
    /// Obstacles of the depth image.
    pub unmodelled: UnmodelledSettings,
    /// Tests of single grasps, which packing does not use.
    pub grasp_test: GraspTestSettings,
}

const FREE: Margins = Margins { world: 0.010, own: 0.005, spread: 0.5 };
const NEAR: Margins = Margins { world: 0.002, own: 0.003, spread: 0.0 };

impl Default for PlannerSettings {
    fn default() -> Self {
        Self {
            grasp_tries: 24,
            place_tries: 16,
            carry_tries: 3,
            ik_seeds: 8,
            ik_solutions: 3,
            table_snap: 0.015,
            wall_clearance: 0.03,
            least_lower: 0.08,
            shake: 0.0,
            retreat: 0.10,
            release_opening: 0.030,
            guard_force: 20.0,
            guard_near: 0.02,
            way_out_near: 0.05,
            way_out_length: 0.3,
            free_margins: FREE,
            near_margins: NEAR,
            lift: LiftSettings::default(),
            speed: SpeedSettings::default(),
            rrt: RrtSettings::default(),
            grasp: GraspSettings::default(),
            grip_force: GripForceSettings::default(),
            place: PlaceSettings::default(),
            push: PushSettings::default(),
            order: OrderSettings::default(),
            unmodelled: UnmodelledSettings::default(),
            grasp_test: GraspTestSettings::default(),
        }
    }
}

impl PlannerSettings {
    /// The first field out of its range, with its value and its range, in words; none when all can be used.
    ///
    /// # Errors
    /// That.
    pub fn validate(&self) -> Result<(), String> {
        Ranges::default()
            .count("grasp_tries", self.grasp_tries, 1..=100_000)
            .count("place_tries", self.place_tries, 1..=100_000)
            .count("carry_tries", self.carry_tries, 1..=1000)
            .count("ik_seeds", self.ik_seeds, 0..=6000)
            .count("ik_solutions", self.ik_solutions, 1..=1000)
            .number("table_snap", self.table_snap, 0.0..=0.1, "metres")
            .number("wall_clearance", self.wall_clearance, 0.0..=0.5, "metres")
            .number("least_lower", self.least_lower, 0.01..=1.0, "metres")
            .number("shake", self.shake, 0.0..=0.3, "metres")
            .number("retreat", self.retreat, 0.01..=1.0, "metres")
            .number("release_opening", self.release_opening, 0.001..=0.2, "metres")
            .number("guard_force", self.guard_force, 1.0..=1000.0, "newtons")
            .number("guard_near", self.guard_near, 0.0..=0.2, "metres")
            .number("way_out_near", self.way_out_near, 0.0..=0.5, "metres")
            .number("way_out_length", self.way_out_length, 0.02..=1.0, "metres")
            .part("free_margins", self.free_margins.validate())
            .part("near_margins", self.near_margins.validate())
            .part("lift", self.lift.validate())
            .part("speed", self.speed.validate())
            .part("rrt", self.rrt.validate())
            .part("grasp", self.grasp.validate())
            .part("grip_force", self.grip_force.validate())
            .part("place", self.place.validate())
            .part("push", self.push.validate())
            .part("order", self.order.validate())
            .part("unmodelled", self.unmodelled.validate())
            .part("grasp_test", self.grasp_test.validate())
            .result()
    }
}

/// Margins of which some are given: the others are those of their place.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct GivenMargins {
    world: Option<f64>,
    own: Option<f64>,
    spread: Option<f64>,
}

impl GivenMargins {
    fn or(self, others: Margins) -> Margins {
        Margins {
            world: self.world.unwrap_or(others.world),
            own: self.own.unwrap_or(others.own),
            spread: self.spread.unwrap_or(others.spread),
        }
    }
}

fn given_free<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Margins, D::Error> {
    Ok(GivenMargins::deserialize(deserializer)?.or(FREE))
}

fn given_near<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Margins, D::Error> {
    Ok(GivenMargins::deserialize(deserializer)?.or(NEAR))
}

/// Straight lifts after a grasp.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LiftSettings {
    /// Heights tried, metres, best first, each 0.01 to 1. Default 0.20, 0.15, 0.25, 0.10.
    pub heights: Vec<f64>,
    /// How far a lift leans to one side where none straight up is free, radians, 0 to 1.4. Default 0.5.
    pub lean: f64,
    /// Directions tried for a lift that leans, 0 to 360. Default 8.
    pub lean_directions: usize,
    /// Height straight up that is tried last under a board, metres, 0.01 to 1. Default 0.04: the way on leads back out.
    pub low: f64,
    /// Height over which a lifted object may still touch what it touched when it lay, metres, 0 to 0.5. Default 0.03: estimates
    /// overlap.
    pub leaving: f64,
}

impl Default for LiftSettings {
    fn default() -> Self {
        Self {
            heights: vec![0.20, 0.15, 0.25, 0.10],
            lean: 0.5,
            lean_directions: 8,
            low: 0.04,
            leaving: 0.03,
        }
    }
}

impl LiftSettings {
    /// What is wrong with a value, if anything: the first field out of its range, its value and the range.
    ///
    /// # Errors
    /// That.
    pub fn validate(&self) -> Result<(), String> {
        Ranges::default()
            .numbers("heights", &self.heights, 0.01..=1.0, "metres")
            .number("lean", self.lean, 0.0..=1.4, "radians")
            .count("lean_directions", self.lean_directions, 0..=360)
            .number("low", self.low, 0.01..=1.0, "metres")
            .number("leaving", self.leaving, 0.0..=0.5, "metres")
            .result()
    }
}

/// How fast the arm moves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SpeedSettings {
    /// Share of the joints' velocity limits that is used, 0.01 to 1. Default 0.9.
    pub velocity_share: f64,
    /// Share of the joints' acceleration limits that is used, 0.01 to 1. Default 0.8.
    pub acceleration_share: f64,
    /// Share of those while an object is held, 0.01 to 1. Default 0.8.
    pub holding_share: f64,
    /// Speed of the gripper when it may touch something, m/s, 0.001 to 2. Default 0.08.
    pub guarded: f64,
    /// Speed of the gripper in other straight motions, m/s, 0.001 to 2. Default 0.25.
    pub straight: f64,
    /// Largest distance of a rounded corner from the path, norm of joint values, 0 to 2. Default 0.15.
    pub corner: f64,
    /// Time between trajectory points, seconds, 0.0001 to 0.1. Default 1/240, the control period.
    pub dt: f64,
    /// Accelerations build up over this time, seconds, 0 to 0.5. Default 0.05: the jerk of a joint is at most twice its acceleration by
    /// that, as for a controller that is not shaken; motions last as much longer.
    pub ramp_s: f64,
}

impl SpeedSettings {
    /// Times `path` from rest to rest, see [`time_path`] and [`Trajectory::ramped`].
    pub(crate) fn time(
        &self,
        joints: &[usize],
        start: &[f64],
        path: &SmoothPath,
        limits: &MotionLimits,
    ) -> Trajectory {
        time_path(joints, start, path, limits, self.dt).ramped(self.ramp_s)
    }
}

impl Default for SpeedSettings {
    fn default() -> Self {
        Self {
            velocity_share: 0.9,
            acceleration_share: 0.8,
            holding_share: 0.8,
            guarded: 0.08,
            straight: 0.25,
            corner: 0.15,
            dt: 1.0 / 240.0,
            ramp_s: 0.05,
        }
    }
}

impl SpeedSettings {
    /// What is wrong with a value, if anything: the first field out of its range, its value and the range.
    ///
    /// # Errors
    /// That.
    pub fn validate(&self) -> Result<(), String> {
        Ranges::default()
            .number("velocity_share", self.velocity_share, 0.01..=1.0, "a share")
            .number("acceleration_share", self.acceleration_share, 0.01..=1.0, "a share")
            .number("holding_share", self.holding_share, 0.01..=1.0, "a share")
            .number("guarded", self.guarded, 0.001..=2.0, "m/s")
            .number("straight", self.straight, 0.001..=2.0, "m/s")
            .number("corner", self.corner, 0.0..=2.0, "norm of joint values")
            .number("dt", self.dt, 0.0001..=0.1, "seconds")
            .number("ramp_s", self.ramp_s, 0.0..=0.5, "seconds")
            .result()
    }
}

/// The test of a single grasp: close, lift, shake.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GraspTestSettings {
    /// Height of the lift, metres, 0.01 to 1. Default 0.12.
    pub lift: f64,
    /// How far the hand is moved from side to side, along the world's x, y and z, metres, 0.001 to 0.3. Default 0.03.
    pub shake: f64,
    /// How fast at most, m/s, 0.001 to 5. Default 0.5; the joints' limits for carrying bound the acceleration, as on the way to
    /// the bin.
    pub shake_speed: f64,
}

impl Default for GraspTestSettings {
    fn default() -> Self {
        Self { lift: 0.12, shake: 0.03, shake_speed: 0.5 }
    }
}

impl GraspTestSettings {
    /// What is wrong with a value, if anything: the first field out of its range, its value and the range.
    ///
    /// # Errors
    /// That.
    pub fn validate(&self) -> Result<(), String> {
        Ranges::default()
            .number("lift", self.lift, 0.01..=1.0, "metres")
            .number("shake", self.shake, 0.001..=0.3, "metres")
            .number("shake_speed", self.shake_speed, 0.001..=5.0, "m/s")
            .result()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::executor::ExecutorSettings;
    use toml::{Table, Value};

    /// What a settings file can say of this crate.
    #[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    struct Tree {
        planner: PlannerSettings,
        executor: ExecutorSettings,
    }

    impl Tree {
        fn validate(&self) -> Result<(), String> {
            Ranges::default()
                .part("planner", self.planner.validate())
                .part("executor", self.executor.validate())
                .result()
        }
    }

    #[test]
    fn the_tree_reads_back_from_toml_as_it_was_and_the_defaults_are_in_range() {
        let tree = Tree::default();
        assert_eq!(tree.validate(), Ok(()));
        let text = toml::to_string(&tree).unwrap();
        assert_eq!(toml::from_str::<Tree>(&text).unwrap(), tree);
        assert_eq!(toml::from_str::<Tree>("").unwrap(), tree);
    }

    #[test]
    fn any_part_can_be_given_alone_and_the_rest_stays_as_it_is() {
        let text = "[planner.free_margins]\nworld = 0.02\n[planner.near_margins]\nown = 0.001\n[planner.rrt]\nstep = 0.5\n\
                    [planner.grasp]\nkeep = 20\n[executor]\nslip_limit = 0.02\n";
        let mut expected = Tree::default();
        expected.planner.free_margins.world = 0.02;
        expected.planner.near_margins.own = 0.001;
        expected.planner.rrt.step = 0.5;
        expected.planner.grasp.keep = 20;
        expected.executor.slip_limit = 0.02;
        assert_eq!(toml::from_str::<Tree>(text).unwrap(), expected);
        for unknown in ["[planner.free_margins]\nwords = 0.02", "[planner.grasp.weights]\nluck = 1.0"] {
            let error = toml::from_str::<Tree>(unknown).unwrap_err().to_string();
            assert!(error.contains("unknown field"), "{error}");
        }
    }

    /// Every number of a table by its path.
    fn numbers(value: &Value, path: &str, found: &mut Vec<String>) {
        let at = |key: &str| if path.is_empty() { key.into() } else { format!("{path}.{key}") };
        match value {
            Value::Table(table) => table.iter().for_each(|(key, value)| numbers(value, &at(key), found)),
            Value::Array(array) => {
                array
                    .iter()
                    .enumerate()
                    .for_each(|(i, value)| numbers(value, &format!("{path}[{i}]"), found));
            }
            Value::Float(_) | Value::Integer(_) => found.push(path.into()),
            _ => {}
        }
    }

    fn with(mut tree: Value, path: &str, bad: &Value) -> Value {
        let mut at = &mut tree;
        for part in path.split(['.', '[']) {
            at = match part.strip_suffix(']') {
                Some(index) => &mut at[index.parse::<usize>().unwrap()],
                None => &mut at[part],
            };
        }
        *at = bad.clone();
        tree
    }

    #[test]
    fn every_number_has_a_range_and_what_is_outside_is_named() {
        let tree = Value::Table(Table::try_from(Tree::default()).unwrap());
        let mut paths = Vec::new();
        numbers(&tree, "", &mut paths);
        assert!(paths.len() > 90, "{}", paths.len());
        for path in paths {
            let whole = matches!(with_path(&tree, &path), Value::Integer(_));
            let bad: &[Value] = if whole {
                &[Value::Integer(-1), Value::Integer(4_000_000_000)]
            } else {
                &[Value::Float(f64::NAN), Value::Float(f64::INFINITY), Value::Float(-10.0), Value::Float(1e9)]
            };
            for bad in bad {
                let said = match with(tree.clone(), &path, bad).try_into::<Tree>() {
                    Ok(tree) => tree.validate().expect_err(&format!("{path} = {bad} is taken")),
                    // What is no value of the type at all.
                    Err(_) => continue,
                };
                assert!(said.starts_with(&format!("{path} is ")) && said.contains("range"), "{path}: {said}");
            }
        }
    }

    fn with_path<'a>(tree: &'a Value, path: &str) -> &'a Value {
        path.split(['.', '[']).fold(tree, |at, part| match part.strip_suffix(']') {
            Some(index) => &at[index.parse::<usize>().unwrap()],
            None => &at[part],
        })
    }

    #[test]
    fn an_empty_list_is_refused() {
        let lift = LiftSettings { heights: Vec::new(), ..LiftSettings::default() };
        let settings = PlannerSettings { lift, ..PlannerSettings::default() };
        assert_eq!(
            settings.validate().unwrap_err(),
            "lift.heights is empty; it needs at least one value (metres)"
        );
    }
}
