//! PyramidCNN for the objects that it knows, clusters for the others.

use std::fmt;
use std::sync::Arc;

use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;

use super::clusters::Clusters;
use super::detections::{Detections, Detector};
use super::pyramid::PyramidCnn;
use crate::error::Result;

/// The detector `pyramid` where there may be objects that its network has no class for: for those it proposes a box for each
/// cluster of depth, as the detector `clusters` does.
#[derive(Debug)]
pub struct PyramidOrClusters {
    pyramid: PyramidCnn,
    clusters: Clusters,
}

impl PyramidOrClusters {
    /// Of both.
    pub fn new(pyramid: PyramidCnn, clusters: Clusters) -> Self {
        Self { pyramid, clusters }
    }

    /// The names of those objects for which clusters are proposed, each once.
    ///
    /// # Errors
    /// When an object has the number of another one that the network knows.
    pub fn unknown(&self, objects: &[Arc<ObjectModel>]) -> Result<Vec<String>> {
        let mut names: Vec<String> = Vec::new();
        for object in objects {
            if self.pyramid.knows(object)?.is_none() && !names.contains(&object.info.name) {
                names.push(object.info.name.clone());
            }
        }
        Ok(names)
    }
}

impl fmt::Display for PyramidOrClusters {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.pyramid.fmt(f)
    }
}

impl Detector for PyramidOrClusters {
    fn name(&self) -> &'static str {
        self.pyramid.name()
    }

    fn detect(&self, frame: &CameraFrame, objects: &[Arc<ObjectModel>]) -> Result<Detections> {
        let unknown = self.unknown(objects)?;
        let is_unknown = |object: &&Arc<ObjectModel>| unknown.contains(&object.info.name);
        let others: Vec<_> = objects.iter().filter(is_unknown).cloned().collect();
        if others.is_empty() {
            return self.pyramid.detect(frame, objects);
        }
        let known: Vec<_> = objects.iter().filter(|object| !is_unknown(object)).cloned().collect();
        let mut detections =
            if known.is_empty() { Detections::new() } else { self.pyramid.detect(frame, &known)? };
        for (name, boxes) in self.clusters.detect(frame, &others)?.iter() {
            boxes.iter().try_for_each(|detection| detections.push(name, *detection))?;
        }
        Ok(detections)
    }
}
