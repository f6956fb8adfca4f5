//! What is said between `grip` and a grasp planner of others: a line of JSON each way ([docs/graspers.md](../../../docs/graspers.md)).

use std::path::Path;

use grip_sim::robot::GripperConfig;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::external::protocol::{Model, Transform, View};

/// Version of the protocol. It grows by one with any change that a grasp planner could trip over.
pub const VERSION: u32 = 1;

/// What `grip` says.
#[derive(Debug, Clone, Serialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Request<'a> {
    /// The first line.
    Hello {
        /// Version of the protocol.
        protocol: u32,
        /// The program's name and version.
        program: &'a str,
        /// What grips.
        gripper: Gripper,
        /// The objects that there may be.
        models: &'a [Model],
    },
    /// Asks for grasps.
    Look(Box<LookRequest<'a>>),
}

/// A gripper of two parallel fingers. Its frame, in which grasps are poses, has its origin in the middle between the pads, x out along the
/// fingers, y along the closing direction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Gripper {
    /// In its frame: the way the hand comes to what it grasps.
    pub approach: [f64; 3],
    /// In its frame: along this line the pads close.
    pub closing: [f64; 3],
    /// Widest opening between the pads, metres.
    pub opening: f64,
    /// From the palm to the fingertips, metres: nothing reaches deeper into the hand.
    pub finger_depth: f64,
    /// Length of a pad along the fingers, metres: fingertips are half of it ahead of the origin.
    pub pad_length: f64,
    /// Width of a pad, along z, metres.
    pub pad_width: f64,
    /// Thickness of a finger outside of the opening, metres.
    pub finger_thickness: f64,
}

impl From<&GripperConfig> for Gripper {
    fn from(config: &GripperConfig) -> Self {
        let pad = 2.0 * config.pad_half_extents;
        Self {
            approach: [1.0, 0.0, 0.0],
            closing: [0.0, 1.0, 0.0],
            opening: config.opening,
            finger_depth: config.finger_depth,
            pad_length: pad.x,
            pad_width: pad.z,
            finger_thickness: pad.y,
        }
    }
}

/// One look of the robot.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct LookRequest<'a> {
    /// The answer has the same.
    pub id: u64,
    /// The trial's seed.
    pub seed: u64,
    /// The number of the look in it, from 0 on.
    pub look: usize,
    /// What the camera saw.
    #[serde(flatten)]
    pub view: View<'a>,
    /// Height of the table's surface in the world, metres.
    pub table: f64,
    /// NPY, height x width, uint16, for a planner that wants it: 1 + `index` where an object should be seen by its estimated pose, else 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segmentation: Option<&'a Path>,
    /// What is believed to be on the table.
    pub objects: Vec<Item>,
}

/// An object on the table.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Item {
    /// Of the object in the trial.
    pub index: usize,
    /// Its kind.
    pub obj_id: u32,
    /// Whether it is to be picked; grasps of others are not tried.
    pub wanted: bool,
    /// For a planner that wants poses: from the object's frame (that of its mesh, but in metres) to the camera's, as estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose: Option<Transform>,
}

/// What a grasp planner may want to know beside the frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Want {
    /// The estimated poses of the objects.
    Poses,
    /// Where these say that each object is seen.
    Segmentation,
}

/// What the grasp planner says.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Reply {
    /// To the first line.
    Hello {
        /// Version of the protocol that it speaks.
        protocol: u32,
        /// Its name, for reports.
        name: String,
        /// Its version.
        #[serde(default)]
        version: String,
        /// What it wants to know beside the frame. Default: nothing.
        #[serde(default)]
        wants: Vec<Want>,
    },
    /// How to grip what.
    Grasps {
        /// Of the request.
        id: u64,
        /// In any order.
        grasps: Vec<FoundGrasp>,
    },
    /// It cannot say. The trial ends with `grasper_failed`.
    Error {
        /// Why.
        message: String,
    },
}

/// A grasp.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FoundGrasp {
    /// From the gripper's frame to the camera's: its columns are the approach, the closing direction, and their cross product.
    #[serde(rename = "R")]
    pub rotation: [f64; 9],
    /// The middle between the pads, metres.
    #[serde(rename = "t")]
    pub translation: [f64; 3],
    /// How far the fingers open for it, metres. Default: as far as there is room.
    #[serde(default)]
    pub width: Option<f64>,
    /// Grasps of an object are tried in this order, the largest first. Default 1.
    #[serde(default = "one")]
    pub score: f64,
    /// The object that it is meant for. Default: the one whose estimated pose is between the fingers.
    #[serde(default)]
    pub index: Option<usize>,
}

fn one() -> f64 {
    1.0
}
