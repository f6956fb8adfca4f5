//! How the image pyramid is built and its heat maps are read.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::checks::{Checked, within};

/// Settings of [`super::PyramidCnn`]. Figures in brackets are the defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PyramidSettings {
    /// Longer side of the boxes of the pyramid's finest level, pixels of the image, 8 to 1000 (56.6): few objects are smaller,
    /// and one more level would cost as much as all others together.
    pub finest_side_px: f64,
    /// Levels end where a box would be longer than this share of the image's longer side, 0.01 to 1 (0.75).
    pub coarsest_share: f64,
    /// From one level to the next, octaves of scale, 0.1 to 4 (0.5).
    pub octaves: f64,
    /// Boxes of one object that overlap by more are one and the same, of which the most confident stays: intersection over
    /// union, 0 to 1 (0.5).
    pub same_box_iou: f64,
    /// Cells to each side over which a position is averaged, 0 to 16 (2): an object's centre is in the middle of the cells
    /// that respond.
    pub reach_cells: usize,
}

impl Default for PyramidSettings {
    fn default() -> Self {
        Self { finest_side_px: 56.6, coarsest_share: 0.75, octaves: 0.5, same_box_iou: 0.5, reach_cells: 2 }
    }
}

impl PyramidSettings {
    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        within("finest_side_px", self.finest_side_px, 8.0..=1000.0, "pixels")?;
        within("coarsest_share", self.coarsest_share, 0.01..=1.0, "")?;
        within("octaves", self.octaves, 0.1..=4.0, "")?;
        within("same_box_iou", self.same_box_iou, 0.0..=1.0, "")?;
        within("reach_cells", self.reach_cells, 0..=16, "cells")
    }

    /// Longer side of the boxes of a level, pixels of the image; level 0 is the finest.
    pub fn side_px(&self, level: usize) -> f64 {
        self.finest_side_px * (self.octaves * level as f64).exp2()
    }
}
