//! What poses of an object are measured with, and the BOP challenge's errors of all estimates in an image against all instances.

use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::{Context, Result};
use grip_perception::metrics::{
    AverageRecall, ErrorKinds, Hits, Measured, PairErrors, Surface, SymmetricShape, THRESHOLDS, vsd,
};
use grip_sim::bop::results::Estimate;
use grip_sim::bop::{BopView, Dataset, GroundTruth, ModelInfo};
use grip_sim::mesh::Mesh;
use grip_sim::pose::{Camera, Object, Pose};
use grip_sim::render::{ObjectDepth, object_depth};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::case::{InImage, bootstrap};

/// The evaluation model of an object.
pub(super) struct Model {
    pub surface: Surface,
    /// Metres.
    pub diameter: f64,
    /// Whether it has symmetries, so that ADD(-S) is ADD-S.
    pub symmetric: bool,
    pub kinds: ErrorKinds,
    shape: SymmetricShape,
    mesh: Arc<Mesh>,
}

impl Model {
    /// Those of these objects.
    ///
    /// # Errors
    /// When a model cannot be read, or nothing is known of its size.
    pub fn load_all(dataset: &Dataset, ids: Vec<u32>) -> Result<BTreeMap<u32, Self>> {
        let infos = dataset.models_info()?;
        let load = |id: u32| {
            let info = infos.get(&id).with_context(|| {
                format!("{}: models_info.json has no object {id}", dataset.root().display())
            })?;
            Ok((id, Self::new(dataset.load_evaluation_model(id)?.mesh, info)))
        };
        ids.into_par_iter().map(load).collect()
    }

    fn new(mesh: Arc<Mesh>, info: &ModelInfo) -> Self {
        let points: Vec<_> = mesh.positions.iter().map(|p| p.cast()).collect();
        Self {
            surface: Surface::new(points.clone()),
            diameter: info.diameter,
            kinds: ErrorKinds::new(&points, &info.symmetries, info.diameter),
            symmetric: !(info.symmetries.discrete.is_empty() && info.symmetries.continuous.is_empty()),
            shape: SymmetricShape::new(points, &info.symmetries),
            mesh,
        }
    }

    /// What can be measured in an image.
    pub fn measured(&self, view: &BopView) -> Measured {
        Measured {
            diameter_m: self.diameter,
            width: view.intrinsics.map(|camera| camera.width),
            depth: view.depth.is_some(),
        }
    }

    /// Errors of each estimate against each instance; no numbers where the image lacks what they need. Everything is rendered
    /// once.
    pub fn errors(
        &self,
        view: &BopView,
        truths: &[GroundTruth],
        estimates: &[&Estimate],
    ) -> Vec<Vec<PairErrors>> {
        let tolerances = THRESHOLDS.map(|share| share * self.diameter);
        let seen = view.intrinsics.zip(view.depth.as_ref());
        let draw =
            |pose: &Pose<Camera, Object>| seen.map(|(camera, _)| object_depth(&self.mesh, pose, &camera));
        let of_truths: Vec<Option<ObjectDepth>> = if estimates.is_empty() {
            Vec::new()
        } else {
            truths.iter().map(|t| draw(&t.camera_from_object)).collect()
        };
        estimates
            .iter()
            .map(|estimate| {
                let pose = &estimate.camera_from_object;
                let of_estimate = draw(pose);
                let pair = |(truth, of_truth): (&GroundTruth, &Option<ObjectDepth>)| {
                    let truth = &truth.camera_from_object;
                    let mspd = view.intrinsics.map(|camera| self.shape.mspd(truth, pose, &camera));
                    let vsd = seen.zip(of_truth.as_ref()).zip(of_estimate.as_ref()).map(
                        |(((camera, depth), of_truth), of_estimate)| {
                            vsd(depth, of_truth, of_estimate, &camera, &tolerances)
                        },
                    );
                    PairErrors {
                        mssd_m: self.shape.mssd(truth, pose),
                        mspd_px: mspd.unwrap_or(f64::NAN),
                        vsd: vsd.unwrap_or([f64::NAN; 10]),
                    }
                };
                truths.iter().zip(&of_truths).map(pair).collect()
            })
            .collect()
    }
}

/// An object that was asked for in an image, and how many of its instances were found.
#[derive(Debug, Clone, Copy)]
pub(super) struct Asked {
    pub image: (u32, u32),
    pub obj_id: u32,
    pub hits: Hits,
}

impl InImage for Asked {
    fn image(&self) -> (u32, u32) {
        self.image
    }
}

/// The challenge's figures.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Recall {
    /// The figures themselves.
    #[serde(flatten)]
    pub average: AverageRecall,
    /// Bootstrap interval of the average recall, 95 %, scenes drawn (images, of fewer than five); null as that is, and of a
    /// single image.
    pub ar_interval: Option<[f64; 2]>,
}

impl Recall {
    /// Of all that was asked for.
    pub(super) fn new(asked: &[Asked]) -> Self {
        let average = AverageRecall::new(asked.iter().map(|asked| &asked.hits));
        let ar_interval = average.ar.and_then(|_| {
            let value = |asked: &Asked| [asked.hits.credit().unwrap_or(0.0), asked.hits.instances as f64];
            bootstrap(asked, value, |drawn| {
                let [credit, instances] =
                    drawn.iter().fold([0.0; 2], |sum, value| [sum[0] + value[0], sum[1] + value[1]]);
                credit / instances.max(1.0)
            })
        });
        Self { average, ar_interval }
    }
}

/// What images lack that errors are measured with.
#[derive(Debug, Clone, Copy, Default, Serialize, JsonSchema)]
pub struct Lacking {
    /// Images in which something is asked for,
    pub images: usize,
    /// of these without a depth picture, so that there is no VSD,
    pub depth: usize,
    /// and those of unknown width, so that there is neither VSD nor MSPD.
    pub width: usize,
}

impl Lacking {
    pub(super) fn of(view: &BopView) -> Self {
        Self {
            images: 1,
            depth: usize::from(view.depth.is_none()),
            width: usize::from(view.intrinsics.is_none()),
        }
    }

    pub(super) fn and(self, other: Self) -> Self {
        Self {
            images: self.images + other.images,
            depth: self.depth + other.depth,
            width: self.width + other.width,
        }
    }
}
