//! What lies on the table.

use std::path::PathBuf;

use rand::RngExt;
use rand::seq::index;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pose::{Object, Pose, World};

/// What lies on the table and how it got there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObjectPlacement {
    /// Tables of objects beside the built-in one, relative to the scene file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tables: Vec<PathBuf>,
    /// Objects by name; of one that stands here several times there are so many.
    pub names: Vec<String>,
    /// How many of them a run draws from its seed; all of them, in this order, unless given.
    #[serde(default)]
    pub count: Option<Count>,
    /// Centre of the region on the table where objects are dropped, metres.
    pub center: [f64; 2],
    /// Extents of that region along x and y, metres.
    pub size: [f64; 2],
    /// Free space between the outlines of objects that are spread out, metres.
    pub gap: f64,
    /// Share of the objects that may lie that are dropped lying on a side, 0 to 1.
    #[serde(default)]
    pub lying_fraction: f64,
    /// Objects at places of their own, by name; they are not dropped at random. Of several of a name the first is at the first
    /// place of that name, and so on.
    #[serde(default)]
    pub placed: Vec<PlacedObject>,
}

/// A number of objects, drawn evenly from `min` to `max`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Count {
    /// At least so many.
    pub min: usize,
    /// At most so many.
    pub max: usize,
}

impl ObjectPlacement {
    /// The positions in `names` of the objects of a run with `seed`, in the order in which they are put down.
    pub fn draw(&self, seed: u64) -> Vec<usize> {
        let all = self.names.len();
        let Some(Count { min, max }) = self.count else { return (0..all).collect() };
        let mut random = crate::rng::stream(seed, "objects");
        let count = random.random_range(min..=max);
        index::sample(&mut random, all, count).into_vec()
    }

    /// The place of its own of each of the objects `names`, if it has one.
    pub fn places<'a>(&self, names: impl Iterator<Item = &'a str>) -> Vec<Option<&PlacedObject>> {
        let mut places: Vec<&PlacedObject> = self.placed.iter().collect();
        let mut place = |name: &str| {
            let first = places.iter().position(|placed| placed.name == name)?;
            Some(places.remove(first))
        };
        names.map(&mut place).collect()
    }
}

/// An object at a place of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlacedObject {
    /// Name; must be among the scene's names.
    pub name: String,
    /// World from object.
    pub pose: Pose<World, Object>,
    /// Whether it stays exactly there, in the air or within something else as it may be: it is a fixed thing that is seen and stood
    /// upon, and is not packed. Otherwise it settles, as all do.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub frozen: bool,
}
