//! What is said between `grip` and an estimator of others: a line of JSON each way ([docs/estimators.md](../../../docs/estimators.md)).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::external::protocol::{Model, View};

/// Version of the protocol. It grows by one with any change that an estimator could trip over.
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
        /// The objects that will be asked for.
        models: &'a [Model],
    },
    /// Asks where objects are.
    Look(Box<LookRequest<'a>>),
}

/// One look of the robot, or an image of a data set.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct LookRequest<'a> {
    /// The answer has the same.
    pub id: u64,
    /// The trial's seed; in a data set the number of the scene.
    pub seed: u64,
    /// The number of the look in it, from 0 on; in a data set the number of the image.
    pub look: usize,
    /// Where the objects are believed to be.
    pub place: Place,
    /// What the camera saw.
    #[serde(flatten)]
    pub view: View<'a>,
    /// What is looked for.
    pub objects: Vec<Asked>,
    /// Where a detector says that they are, each kind's surest first: of `grip estimate --boxes`, else empty.
    pub boxes: Vec<Proposal>,
}

/// Where a detector says that an object is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Proposal {
    /// The object's number.
    pub obj_id: u32,
    /// Left, top, width, height, pixels, as in COCO's files.
    pub bbox: [f64; 4],
    /// Its confidence.
    pub score: f64,
}

/// Where objects are believed to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// On the table.
    Table,
    /// In the bin, where they were put.
    Bin,
    /// Somewhere in an image of a data set.
    Image,
}

/// An object that is looked for; of several of a kind each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Asked {
    /// Of the object in the trial: a pose names it.
    pub index: usize,
    /// Its kind.
    pub obj_id: u32,
}

/// What the estimator says.
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
    },
    /// Where the objects are; those that it does not see are left out.
    Poses {
        /// Of the request.
        id: u64,
        /// At most one for each `index`.
        poses: Vec<Found>,
    },
    /// It cannot say. The trial ends with `estimator_failed`; an image of a data set is one without poses.
    Error {
        /// Why.
        message: String,
    },
}

/// Where an object is.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Found {
    /// Of the object asked for.
    pub index: usize,
    /// From the object's frame (that of its mesh, but in metres) to the camera's.
    #[serde(rename = "R")]
    pub rotation: [f64; 9],
    /// Metres.
    #[serde(rename = "t")]
    pub translation: [f64; 3],
    /// How well it explains the picture, for reports. Default 1.
    #[serde(default = "one")]
    pub score: f64,
    /// Probability that it is right, 0 to 1: the robot acts from `belief.least_confidence` on. Default 1.
    #[serde(default = "one")]
    pub confidence: f64,
    /// Other poses that it may have as well, itself included, if the estimator knows any.
    #[serde(default)]
    pub samples: Vec<Sample>,
}

/// A pose by some probability.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sample {
    /// As of [`Found`].
    #[serde(rename = "R")]
    pub rotation: [f64; 9],
    /// Metres.
    #[serde(rename = "t")]
    pub translation: [f64; 3],
    /// Not negative; their sum is taken for 1.
    pub weight: f64,
}

fn one() -> f64 {
    1.0
}
