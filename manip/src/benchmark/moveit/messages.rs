//! The messages of MoveIt that problems are made of, as YAML: lists of numbers as Robowflex writes them, or fields as ROS prints them.
//!
//! A field is read, or on the list of those that do not change a problem ([`IgnoredAny`] here), or refused by its name: as unknown,
//! or, where it is empty in most files, when it is not ([`Refused`]).

use std::fmt;

use serde::de::{Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::Value;

/// `moveit_msgs/PlanningScene`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneFile {
    pub world: WorldPart,
    #[serde(default)]
    pub robot_state: StatePart,
    #[serde(default)]
    pub allowed_collision_matrix: AllowedPart,
    #[serde(default)]
    pub link_padding: Refused,
    #[serde(default)]
    pub link_scale: Refused,
    #[serde(default)]
    pub is_diff: Refused,
    #[serde(default, rename = "name")]
    _name: IgnoredAny,
    #[serde(default, rename = "robot_model_name")]
    _robot_model_name: IgnoredAny,
    /// Only the base frame is read.
    #[serde(default, rename = "fixed_frame_transforms")]
    _fixed_frame_transforms: IgnoredAny,
    #[serde(default, rename = "object_colors")]
    _object_colors: IgnoredAny,
}

/// `PlanningSceneWorld`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WorldPart {
    #[serde(default)]
    pub collision_objects: Vec<ObjectPart>,
    #[serde(default)]
    pub octomap: OctomapPart,
}

/// `OctomapWithPose`, which messages have also where there is none.
#[derive(Deserialize, Default)]
#[serde(default)]
pub(super) struct OctomapPart {
    pub octomap: Option<OctomapData>,
}

#[derive(Deserialize)]
pub(super) struct OctomapData {
    #[serde(default)]
    pub data: Refused,
}

/// `CollisionObject`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectPart {
    #[serde(default)]
    pub id: String,
    #[serde(default)]
    pub header: Header,
    /// Since 2020; shapes stand relative to it.
    #[serde(default)]
    pub pose: Option<PosePart>,
    #[serde(default)]
    pub primitives: Vec<Primitive>,
    /// One each; none when all are the object's.
    #[serde(default)]
    pub primitive_poses: Vec<PosePart>,
    #[serde(default)]
    pub meshes: Refused,
    #[serde(default)]
    pub mesh_poses: Refused,
    #[serde(default)]
    pub planes: Refused,
    #[serde(default)]
    pub plane_poses: Refused,
    /// Adding it, 0 or `add`, and nothing else.
    #[serde(default)]
    pub operation: Value,
    #[serde(default, rename = "type")]
    _type: IgnoredAny,
    /// Places on it that grasps may name.
    #[serde(default, rename = "subframe_names")]
    _subframe_names: IgnoredAny,
    #[serde(default, rename = "subframe_poses")]
    _subframe_poses: IgnoredAny,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct Header {
    #[serde(default)]
    pub frame_id: String,
    #[serde(default, rename = "seq")]
    _seq: IgnoredAny,
    #[serde(default, rename = "stamp")]
    _stamp: IgnoredAny,
}

/// `shape_msgs/SolidPrimitive`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Primitive {
    /// A name, or the number that stands for it.
    #[serde(rename = "type")]
    pub kind: Value,
    pub dimensions: Vec<f64>,
    /// Of prisms.
    #[serde(default)]
    pub polygon: PolygonPart,
}

#[derive(Deserialize, Default)]
pub(super) struct PolygonPart {
    #[serde(default)]
    pub points: Refused,
}

/// `geometry_msgs/Pose`; what is left out is none.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PosePart {
    /// x, y, z.
    #[serde(default)]
    pub position: Numbers<3>,
    /// x, y, z, w.
    #[serde(default = "no_turn")]
    pub orientation: Numbers<4>,
}

fn no_turn() -> Numbers<4> {
    Numbers([0.0, 0.0, 0.0, 1.0])
}

/// Numbers as a list, or as the fields x, y, z and w.
pub(super) struct Numbers<const N: usize>(pub [f64; N]);

impl<const N: usize> Default for Numbers<N> {
    fn default() -> Self {
        Self([0.0; N])
    }
}

impl<'de, const N: usize> Deserialize<'de> for Numbers<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        // Not as an untagged enum: untyped, YAML's `y` is a yes.
        struct Either<const N: usize>;
        impl<'de, const N: usize> Visitor<'de> for Either<N> {
            type Value = Numbers<N>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a list of {N} numbers or the fields {}", NAMES[..N].join(", "))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
                let mut numbers = [0.0; N];
                for (i, number) in numbers.iter_mut().enumerate() {
                    *number = list.next_element()?.ok_or_else(|| Error::invalid_length(i, &self))?;
                }
                match list.next_element::<f64>()? {
                    None => Ok(Numbers(numbers)),
                    Some(_) => Err(Error::invalid_length(N + 1, &self)),
                }
            }

            fn visit_map<A: MapAccess<'de>>(self, mut fields: A) -> Result<Self::Value, A::Error> {
                let mut numbers = [None; N];
                while let Some((name, number)) = fields.next_entry::<String, f64>()? {
                    match NAMES[..N].iter().position(|known| *known == name) {
                        Some(i) => numbers[i] = Some(number),
                        None => return Err(Error::unknown_field(&name, &NAMES)),
                    }
                }
                match numbers.iter().position(Option::is_none) {
                    None => Ok(Numbers(numbers.map(Option::unwrap_or_default))),
                    Some(i) => Err(Error::missing_field(NAMES[i])),
                }
            }
        }
        deserializer.deserialize_any(Either)
    }
}

const NAMES: [&str; 4] = ["x", "y", "z", "w"];

/// `AllowedCollisionMatrix`: which links may touch says the robot's own configuration, but objects are no links.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct AllowedPart {
    #[serde(default)]
    pub entry_names: Vec<String>,
    #[serde(default)]
    pub default_entry_names: Vec<String>,
    #[serde(default, rename = "entry_values")]
    _entry_values: IgnoredAny,
    #[serde(default, rename = "default_entry_values")]
    _default_entry_values: IgnoredAny,
}

/// `MotionPlanRequest`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RequestFile {
    #[serde(default)]
    pub group_name: String,
    pub start_state: StatePart,
    pub goal_constraints: Vec<Constraints>,
    #[serde(default)]
    pub path_constraints: Constraints,
    #[serde(default)]
    pub trajectory_constraints: TrajectoryPart,
    #[serde(default)]
    pub reference_trajectories: Refused,
    #[serde(default)]
    pub max_cartesian_speed: Refused,
    /// Of a base that drives.
    #[serde(default, rename = "workspace_parameters")]
    _workspace_parameters: IgnoredAny,
    #[serde(default, rename = "planner_id")]
    _planner_id: IgnoredAny,
    #[serde(default, rename = "pipeline_id")]
    _pipeline_id: IgnoredAny,
    #[serde(default, rename = "num_planning_attempts")]
    _num_planning_attempts: IgnoredAny,
    #[serde(default, rename = "allowed_planning_time")]
    _allowed_planning_time: IgnoredAny,
    /// How fast the path is driven, which is no part of the problem: it is timed by the robot's own limits.
    #[serde(default, rename = "max_velocity_scaling_factor")]
    _max_velocity_scaling_factor: IgnoredAny,
    #[serde(default, rename = "max_acceleration_scaling_factor")]
    _max_acceleration_scaling_factor: IgnoredAny,
    #[serde(default, rename = "cartesian_speed_end_effector_link")]
    _cartesian_speed_end_effector_link: IgnoredAny,
    #[serde(default, rename = "cartesian_speed_limited_link")]
    _cartesian_speed_limited_link: IgnoredAny,
}

/// `RobotState`.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct StatePart {
    #[serde(default)]
    pub joint_state: JointState,
    #[serde(default)]
    pub attached_collision_objects: Refused,
    /// Where the base stands, which obstacles are relative to.
    #[serde(default, rename = "multi_dof_joint_state")]
    _multi_dof_joint_state: IgnoredAny,
    #[serde(default, rename = "is_diff")]
    _is_diff: IgnoredAny,
}

/// `sensor_msgs/JointState`.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct JointState {
    #[serde(default)]
    pub name: Vec<String>,
    #[serde(default)]
    pub position: Vec<f64>,
    #[serde(default, rename = "header")]
    _header: IgnoredAny,
    #[serde(default, rename = "velocity")]
    _velocity: IgnoredAny,
    #[serde(default, rename = "effort")]
    _effort: IgnoredAny,
}

/// `Constraints`.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct Constraints {
    #[serde(default)]
    pub joint_constraints: Vec<JointConstraint>,
    #[serde(default)]
    pub position_constraints: Refused,
    #[serde(default)]
    pub orientation_constraints: Refused,
    #[serde(default)]
    pub visibility_constraints: Refused,
    #[serde(default, rename = "name")]
    _name: IgnoredAny,
}

/// `JointConstraint`; its position is the goal, however much either side would do.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct JointConstraint {
    pub joint_name: String,
    pub position: f64,
    #[serde(default, rename = "tolerance_above")]
    _tolerance_above: IgnoredAny,
    #[serde(default, rename = "tolerance_below")]
    _tolerance_below: IgnoredAny,
    #[serde(default, rename = "weight")]
    _weight: IgnoredAny,
}

/// `TrajectoryConstraints`.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct TrajectoryPart {
    #[serde(default)]
    pub constraints: Refused,
}

/// What is not supported, and is in most files only to say nothing.
#[derive(Deserialize, Default)]
#[serde(transparent)]
pub(super) struct Refused(Value);

impl Refused {
    /// Whether there is nothing in it: nothing, false, zero, no text, no entries.
    pub fn is_empty(&self) -> bool {
        match &self.0 {
            Value::Null => true,
            Value::Bool(value) => !value,
            Value::Number(value) => value.as_f64() == Some(0.0),
            Value::String(value) => value.is_empty(),
            Value::Array(value) => value.is_empty(),
            Value::Object(value) => value.is_empty(),
        }
    }
}
