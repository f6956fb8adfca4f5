//! What an ONNX file of a detector does not say of itself.

use grip_sim::objects::ObjectModel;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Models of one object, built in and scanned, differ in diameter by less than this share.
const SAME_DIAMETER: f64 = 0.1;
/// What to do about an object that a detector does not know.
const INSTEAD: &str = "use --boxes clusters (--detector clusters), or --detector-model with a network for it";

/// The description of a detector, a JSON file beside its ONNX file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DetectorDescription {
    /// `grip.detector/1`.
    pub schema: String,
    /// Name of the network, such as `vgg16-w0.25`.
    pub name: String,
    /// Its classes, in the order of the output's channels, after the background.
    pub objects: Vec<KnownObject>,
    /// Width over height, in the order of the output's channels.
    pub aspect_ratios: Vec<f64>,
    /// Side of a cell, pixels of the network's input.
    pub stride_px: usize,
    /// Longer side of the boxes that it finds, pixels of the network's input.
    pub side_px: f64,
}

/// An object that a detector was trained on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KnownObject {
    /// Such as `005_tomato_soup_can`.
    pub name: String,
    /// Its number in BOP data sets.
    pub bop_id: u32,
    /// Largest distance of two of its points, metres.
    pub diameter_m: f64,
}

impl DetectorDescription {
    /// The `schema` that this program reads.
    pub const SCHEMA: &'static str = "grip.detector/1";

    /// Reads and checks it; `file` is for messages.
    pub(super) fn parse(text: &str, file: &str) -> Result<Self> {
        let bad = |message: String| Err(Error::Detector(format!("{file}: {message}")));
        let read: Self = serde_json::from_str(text).map_err(|e| {
            Error::Detector(format!("{file}: {e}; perception/models/pyramid-varied.json shows the format"))
        })?;
        if read.schema != Self::SCHEMA {
            return bad(format!("schema = {:?}: this program reads {:?}", read.schema, Self::SCHEMA));
        }
        if read.objects.is_empty() || read.objects.len() > 10_000 {
            return bad(format!("objects: has {}; 1 to 10000 are needed", read.objects.len()));
        }
        if let Some(object) = read.objects.iter().find(|o| !(1e-3..100.0).contains(&o.diameter_m)) {
            return bad(format!(
                "objects: {} has diameter_m = {}: metres, 0.001 to 100",
                object.name, object.diameter_m
            ));
        }
        for (i, object) in read.objects.iter().enumerate() {
            if read.objects[..i].iter().any(|o| o.name == object.name || o.bop_id == object.bop_id) {
                return bad(format!("objects: {} (bop_id {}) is there twice", object.name, object.bop_id));
            }
        }
        if read.aspect_ratios.is_empty() || read.aspect_ratios.len() > 1000 {
            return bad(format!("aspect_ratios: has {}; 1 to 1000 are needed", read.aspect_ratios.len()));
        }
        let increasing = read.aspect_ratios.is_sorted_by(|a, b| a < b);
        if let Some(ratio) = read.aspect_ratios.iter().find(|r| !(0.01..=100.0).contains(*r)) {
            return bad(format!("aspect_ratios: {ratio} is not within 0.01 to 100"));
        }
        if !increasing {
            return bad("aspect_ratios: must increase".into());
        }
        if !(1..=512).contains(&read.stride_px) {
            return bad(format!("stride_px = {}: must be 1 to 512", read.stride_px));
        }
        if !(16.0..=256.0).contains(&read.side_px) {
            return bad(format!("side_px = {}: must be 16 to 256", read.side_px));
        }
        Ok(read)
    }

    /// The channel of an object: that of its name, or, where a data set names objects by number, of its number if it is as large.
    /// None of an object that it does not know.
    ///
    /// # Errors
    /// When the object has the number of one that it knows and is another one.
    pub(super) fn knows(&self, object: &ObjectModel) -> Result<Option<usize>> {
        if let Some(i) = self.objects.iter().position(|known| known.name == object.info.name) {
            return Ok(Some(1 + i));
        }
        // An object of one's own has a name that means something.
        if object.source.is_some() {
            return Ok(None);
        }
        match self.objects.iter().position(|known| known.bop_id == object.info.bop_id) {
            Some(i) if (object.diameter / self.objects[i].diameter_m - 1.0).abs() < SAME_DIAMETER => {
                Ok(Some(1 + i))
            }
            Some(i) => Err(Error::Detector(format!(
                "object '{}' is number {} and {:.0} mm across, but that number of the detector {} is {}, {:.0} mm across: not the objects it knows; {INSTEAD}",
                object.info.name,
                object.info.bop_id,
                1e3 * object.diameter,
                self.name,
                self.objects[i].name,
                1e3 * self.objects[i].diameter_m,
            ))),
            None => Ok(None),
        }
    }

    /// The channel of an object that it knows.
    ///
    /// # Errors
    /// When it does not know it.
    pub(super) fn class_of(&self, object: &ObjectModel) -> Result<usize> {
        self.knows(object)?.ok_or_else(|| {
            Error::Detector(format!(
                "object '{}' is none of the {} that the detector {} knows; {INSTEAD}",
                object.info.name,
                self.objects.len(),
                self.name
            ))
        })
    }
}
