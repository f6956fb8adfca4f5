//! Who estimates poses in a trial: GRIP, a results file made by anyone, or the simulator's own truth.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result};
use grip_perception::{Detections, Detector, GripEstimator, PoseEstimator, PosePosterior};
use grip_sim::bop::results::{Estimate, read_results};
use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;
use grip_sim::physics::World;
use grip_sim::pose::{Camera, Pose, World as WorldFrame};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::cli;
use crate::scenario::hex;
use crate::setup::Setup;

/// Who estimates poses.
pub enum Perception {
    /// GRIP, both stages.
    Grip {
        /// The first stage, and for the content of the bin too.
        detector: Box<dyn Detector>,
        /// The network that the detector runs, with its fingerprint.
        network: Option<String>,
        /// The second stage over the table, and over the inside of the bin.
        table: Box<GripEstimator>,
        /// The same over the inside of the bin.
        bin: Box<GripEstimator>,
    },
    /// Poses read from the simulator, to measure ceilings. Marked in every output.
    Truth,
    /// Poses from a file.
    Recorded(Recorded),
}

/// Poses that anyone estimated, from a results file in BOP's format: `scene_id` is the trial's seed, `im_id` the number of
/// the look, from 0 on.
///
/// A look that the file says nothing of takes the estimates of the last one before it: a file for the first look alone makes
/// a robot that looks once. Trials repeat, so the frames of such a trial (`--bop`), estimated and added to the file, make one
/// that has looked again.
pub struct Recorded {
    path: PathBuf,
    sha256: String,
    by_look: BTreeMap<(u64, usize), Vec<Estimate>>,
}

impl Recorded {
    /// Reads a results file.
    ///
    /// # Errors
    /// When it cannot be read, or a line is wrong.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path)
            .with_context(|| format!("{}: cannot be read; --estimator csv:FILE", path.display()))?;
        let mut by_look: BTreeMap<_, Vec<Estimate>> = BTreeMap::new();
        for estimate in read_results(path)? {
            let look = (u64::from(estimate.scene_id), estimate.im_id as usize);
            by_look.entry(look).or_default().push(estimate);
        }
        Ok(Self { path: path.to_path_buf(), sha256: hex(&Sha256::digest(bytes)), by_look })
    }

    /// Whether the file has a row for a trial with this seed.
    pub fn knows(&self, seed: u64) -> bool {
        self.by_look.range((seed, 0)..=(seed, usize::MAX)).next().is_some()
    }

    /// The best scored pose of each of the objects `which` that the file has one of. A pose in the file is believed: scores
    /// rank, and no more.
    fn look(
        &self,
        seed: u64,
        look: usize,
        cameras: &[Pose<WorldFrame, Camera>],
        models: &[Arc<ObjectModel>],
        which: &[usize],
    ) -> (Vec<usize>, Vec<PosePosterior>) {
        let known = self.by_look.range((seed, 0)..=(seed, look)).next_back();
        let Some((&(_, of_look), rows)) = known else { return Default::default() };
        // The camera may stand elsewhere than when the file's image was taken.
        let now_from_then = cameras[look].iso().inverse() * cameras[of_look].iso();
        let best = |i: usize| {
            let of = rows.iter().filter(|row| row.obj_id == models[i].info.bop_id);
            of.max_by(|a, b| a.score.total_cmp(&b.score))
        };
        let found = which.iter().filter_map(|&i| {
            let row = best(i)?;
            let pose = Pose::new(now_from_then * row.camera_from_object.iso());
            let mut posterior = PosePosterior::certain(&models[i].info.name, pose);
            // A file's time is that of the whole image, and what is kept takes none.
            let share = 1.0 / rows.len() as f64;
            posterior.seconds = if of_look == look { share * row.time_s.unwrap_or(0.0) } else { 0.0 };
            Some((i, posterior))
        });
        found.unzip()
    }
}

impl Perception {
    /// What the command line asks for.
    ///
    /// # Errors
    /// When a file is wrong, or an option is for another estimator.
    pub fn open(
        setup: &Setup,
        estimator: &cli::Estimator,
        detector: cli::Detector,
        args: &cli::DetectorArgs,
    ) -> Result<Self> {
        match estimator {
            cli::Estimator::Grip => {
                let (detector, network) = setup.detector(detector, args)?;
                let (table, bin) = (Box::new(setup.grip()?), Box::new(setup.grip_in_bin()?));
                Ok(Self::Grip { detector, network, table, bin })
            }
            cli::Estimator::Truth => Ok(Self::Truth),
            cli::Estimator::Csv(path) => Recorded::read(path).map(Self::Recorded),
        }
    }

    /// The results file, if it is one.
    pub fn recorded(&self) -> Option<&Recorded> {
        match self {
            Self::Recorded(file) => Some(file),
            _ => None,
        }
    }

    /// For scenario.json: what the results depend on.
    pub fn description(&self) -> Value {
        match self {
            Self::Grip { detector, network, .. } => json!({
                "name": "grip",
                "detector": detector.name(),
                "network": network,
            }),
            Self::Truth => json!({ "name": "truth" }),
            Self::Recorded(Recorded { path, sha256, .. }) => json!({
                "name": "csv",
                "path": path,
                "sha256": sha256,
            }),
        }
    }

    /// The detector's name; `none` where nobody looks at boxes.
    pub fn detector(&self) -> &'static str {
        match self {
            Self::Grip { detector, .. } => detector.name(),
            Self::Truth | Self::Recorded(_) => "none",
        }
    }

    /// Estimates the objects `which` in the frame of look number `look`, `cameras` being where the camera was at each look until
    /// now: the objects that there are estimates of, and those.
    ///
    /// # Errors
    /// When detector or estimator fail.
    pub fn look(
        &self,
        setup: &Setup,
        world: &World,
        frame: &CameraFrame,
        cameras: &[Pose<WorldFrame, Camera>],
        which: &[usize],
    ) -> Result<(Vec<usize>, Vec<PosePosterior>)> {
        let look = cameras.len() - 1;
        match self {
            Self::Grip { detector, table, .. } => {
                let models = models(setup, which);
                let boxes = detector.detect(frame, &models).context("detector")?;
                let posteriors =
                    estimate(table, frame, &boxes, &models, setup.stream(&format!("filter/{look}")))?;
                Ok((which.to_vec(), posteriors))
            }
            Self::Truth => Ok((which.to_vec(), truth(world, frame, which))),
            Self::Recorded(file) => Ok(file.look(setup.seed, look, cameras, &setup.models, which)),
        }
    }

    /// The same for objects that are believed to lie in the bin. A results file does not say where those are.
    ///
    /// # Errors
    /// When the estimator fails.
    pub fn look_into_bin(
        &self,
        setup: &Setup,
        world: &World,
        frame: &CameraFrame,
        which: &[usize],
        look: usize,
    ) -> Result<(Vec<usize>, Vec<PosePosterior>)> {
        match self {
            Self::Grip { bin, .. } => {
                let models = models(setup, which);
                let boxes = setup.bin_detections(frame, &models)?;
                let posteriors = estimate(bin, frame, &boxes, &models, setup.stream(&format!("bin/{look}")))?;
                Ok((which.to_vec(), posteriors))
            }
            Self::Truth => Ok((which.to_vec(), truth(world, frame, which))),
            Self::Recorded(_) => Ok(Default::default()),
        }
    }
}

fn models(setup: &Setup, which: &[usize]) -> Vec<Arc<ObjectModel>> {
    which.iter().map(|&i| setup.models[i].clone()).collect()
}

fn estimate(
    estimator: &GripEstimator,
    frame: &CameraFrame,
    boxes: &Detections,
    models: &[Arc<ObjectModel>],
    seed: u64,
) -> Result<Vec<PosePosterior>> {
    estimator.estimate(frame, boxes, models, seed).context("estimator")
}

/// Perfect posteriors of the objects `which`.
pub fn truth(world: &World, frame: &CameraFrame, which: &[usize]) -> Vec<PosePosterior> {
    let camera_from_world = frame.world_from_camera.inverse();
    which
        .iter()
        .map(|&i| PosePosterior::certain(&world.object(i).info.name, camera_from_world * world.truth(i)))
        .collect()
}
