//! GRIP in a trial: a detector over the whole frame, and the second stage, ours or the paper's, over the table and over the inside of the bin.

use std::sync::Arc;

use anyhow::{Context, Result};
use grip_perception::{
    Clusters, Detection, Detections, Detector, PoseEstimator, PosePosterior, PyramidOrClusters, WholeImage,
    Workspace,
};
use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;
use grip_sim::rng;
use nalgebra::Point3;
use serde_json::{Value, json};

use super::{DetectorKind, DetectorOptions, Estimates, Look, Perception, SecondStage};
use crate::setup::Setup;

/// Both stages of GRIP.
pub struct Grip {
    /// The first stage.
    detector: Box<dyn Detector>,
    /// The network that the detector runs, with its fingerprint.
    network: Option<String>,
    /// The least confidence of a box that counts ([`DetectorOptions::min_confidence`]).
    min_confidence: f64,
    stage: SecondStage,
    /// Objects that the network does not know, for which clusters are proposed.
    unknown: Vec<String>,
    /// The second stage over the table,
    table: Box<dyn PoseEstimator>,
    /// and whether it follows objects from look to look.
    follow: bool,
    /// The same over the inside of the bin, and where that is.
    bin: Box<dyn PoseEstimator>,
    bin_space: Workspace,
}

impl Grip {
    /// For the cell of `setup`, with its settings.
    ///
    /// # Errors
    /// When the network's file is wrong, its options are given to another detector, or a setting is out of range.
    pub fn open(
        setup: &Setup,
        stage: SecondStage,
        detector: DetectorKind,
        network: &DetectorOptions,
    ) -> Result<Self> {
        network.check_used(detector == DetectorKind::Pyramid, "--detector pyramid")?;
        let table = setup.cell.workspace();
        let bin_space = setup.cell.bin_space();
        let over = |workspace: &Workspace| -> Result<Box<dyn PoseEstimator>> {
            Ok(stage.open(&setup.settings, setup.hypotheses.clone(), Some(*workspace), false)?.0)
        };
        let settings = &setup.settings.perception.detector;
        let (mut name, mut unknown) = (None, Vec::new());
        let clusters = || Ok::<_, anyhow::Error>(Clusters::new(settings.clusters.clone())?.within(table));
        let detector: Box<dyn Detector> = match detector {
            DetectorKind::Pyramid => {
                let pyramid = PyramidOrClusters::new(network.open(&settings.pyramid)?, clusters()?);
                name = Some(pyramid.to_string());
                unknown = pyramid.unknown(&setup.models)?;
                super::tell_unknown(&unknown);
                Box::new(pyramid)
            }
            DetectorKind::Clusters => Box::new(clusters()?),
            DetectorKind::None => Box::new(WholeImage),
        };
        let (table, bin, follow) = (over(&table)?, over(&bin_space)?, setup.settings.belief.follow);
        Ok(Self {
            detector,
            network: name,
            min_confidence: network.min_confidence,
            stage,
            unknown,
            table,
            follow,
            bin,
            bin_space,
        })
    }

    /// The part of the image that shows the inside of the bin, as the one box for each of `models`.
    fn bin_detections(&self, frame: &CameraFrame, models: &[Arc<ObjectModel>]) -> Result<Detections> {
        let Workspace { min: low, max: high } = self.bin_space;
        let camera_from_world = frame.world_from_camera.inverse();
        let mut bbox = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        for corner in 0..8 {
            let p = [0, 1, 2].map(|axis| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] });
            let in_camera = camera_from_world.transform_point(&Point3::from(p));
            if let Some(at) = frame.intrinsics.project(&in_camera) {
                bbox = [bbox[0].min(at.x), bbox[1].min(at.y), bbox[2].max(at.x), bbox[3].max(at.y)];
            }
        }
        let (width, height) = (frame.intrinsics.width as f64 - 1.0, frame.intrinsics.height as f64 - 1.0);
        let bbox = [
            bbox[0].clamp(0.0, width),
            bbox[1].clamp(0.0, height),
            bbox[2].clamp(0.0, width),
            bbox[3].clamp(0.0, height),
        ];
        let mut detections = Detections::new();
        if bbox[0] <= bbox[2] && bbox[1] <= bbox[3] {
            for model in models {
                detections.push(&model.info.name, Detection { bbox, confidence: 1.0 })?;
            }
        }
        Ok(detections)
    }
}

/// What was believed at the last look of each object that is asked for, as the camera sees it from where it is now.
fn known_before(look: &Look<'_>) -> Vec<Option<PosePosterior>> {
    let cameras = look.cameras;
    let Some(last) = cameras.len().checked_sub(2).map(|i| cameras[i]) else {
        return vec![None; look.asked.len()];
    };
    let now_from_last = look.frame.world_from_camera.inverse() * last;
    let of = |asked: &usize| look.before.iter().find(|(i, _)| i == asked);
    look.asked.iter().map(|asked| Some(of(asked)?.1.seen_from(&now_from_last))).collect()
}

impl Perception for Grip {
    fn look(&self, look: &Look<'_>) -> Result<Estimates> {
        let boxes = self.detector.detect(look.frame, &look.asked_models()).context("detector")?;
        let boxes = boxes.at_least(self.min_confidence);
        let counts =
            |i: &usize| self.min_confidence == 0.0 || !boxes.of(&look.models[*i].info.name).is_empty();
        let asked: Vec<usize> = look.asked.iter().copied().filter(counts).collect();
        let look = &Look { asked: &asked, ..*look };
        let seed = rng::seed(look.seed, &format!("filter/{}", look.number()));
        let before =
            if self.follow || look.again { known_before(look) } else { vec![None; look.asked.len()] };
        let posteriors = self
            .table
            .follow(&before, look.frame, &boxes, &look.asked_models(), seed)
            .context("estimator")?;
        Ok(asked.into_iter().zip(posteriors).collect())
    }

    fn look_into_bin(&self, look: &Look<'_>) -> Result<Estimates> {
        let models = look.asked_models();
        let boxes = self.bin_detections(look.frame, &models)?;
        let seed = rng::seed(look.seed, &format!("bin/{}", look.number()));
        let posteriors = self.bin.estimate(look.frame, &boxes, &models, seed).context("estimator")?;
        Ok(look.asked.iter().copied().zip(posteriors).collect())
    }

    fn description(&self) -> Value {
        let mut described =
            json!({ "name": self.stage.name(), "detector": self.detector.name(), "network": self.network });
        if self.min_confidence > 0.0 {
            described["min_confidence"] = json!(self.min_confidence);
        }
        if !self.unknown.is_empty() {
            described["clusters_for"] = json!(self.unknown);
        }
        described
    }

    fn detector(&self) -> &'static str {
        self.detector.name()
    }
}
