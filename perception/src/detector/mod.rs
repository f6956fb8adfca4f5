//! The first stage: where in the image may an object be?

mod clusters;
mod detections;
mod fallback;
mod pyramid;
mod settings;
mod whole_image;

pub use self::clusters::{ClusterSettings, Clusters};
pub use self::detections::{Detection, Detections, Detector};
pub use self::fallback::PyramidOrClusters;
pub use self::pyramid::{
    BuiltInNetwork, DetectorDescription, HeatMap, HeatMaps, KnownObject, Providers, PyramidCnn,
    PyramidSettings,
};
pub use self::settings::DetectorSettings;
pub use self::whole_image::WholeImage;

pub(crate) use self::detections::iou;
