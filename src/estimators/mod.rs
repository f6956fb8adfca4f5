//! Who estimates poses: GRIP, the filter as published, a program or a results file of anyone, or the simulator's own truth.
//!
//! An estimator is a [`Perception`]: it is handed what the camera saw ([`Look`]) and nothing else. The truth is none, and
//! the trial reads it where the world is; it measures ceilings and is marked in every output.

pub mod external;
mod grip;
mod recorded;
mod stage;

use std::convert::Infallible;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use anyhow::{Result, ensure};
use grip_perception::{BuiltInNetwork, PosePosterior, Providers, PyramidCnn, PyramidSettings};
use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Camera, Object, Pose, World};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

pub use self::external::{Answers, EstimatorFailed, External};
pub use self::grip::Grip;
pub use self::recorded::Recorded;
pub use self::stage::SecondStage;
use crate::external::{CommandLine, Given, named_command};
use crate::matching::{self, nearest_pairs};
use crate::setup::Setup;

/// What an estimator is told of one look of the robot.
pub struct Look<'a> {
    /// What the camera saw, and where it was by the joints' encoders.
    pub frame: &'a CameraFrame,
    /// Where the camera was at each look until now, this one last.
    pub cameras: &'a [Pose<World, Camera>],
    /// What was believed at the last look, as the camera saw it from there; nothing at the first.
    pub before: &'a Estimates,
    /// The trial's objects.
    pub models: &'a [Arc<ObjectModel>],
    /// Those whose poses are asked for, positions in `models`.
    pub asked: &'a [usize],
    /// Whether nothing was handled since the last look, so that all is where it was: a second view of the same scene.
    pub again: bool,
    /// The trial's seed.
    pub seed: u64,
}

impl Look<'_> {
    /// The number of the look, from 0 on.
    pub fn number(&self) -> usize {
        self.cameras.len() - 1
    }

    /// The models of the objects that are asked for.
    pub fn asked_models(&self) -> Vec<Arc<ObjectModel>> {
        self.asked.iter().map(|&i| self.models[i].clone()).collect()
    }
}

/// What is believed of some of a trial's objects: the position of each in [`Look::models`], and where it may be.
pub type Estimates = Vec<(usize, PosePosterior)>;

/// Of several objects of a kind nobody knows which is which: each estimate is taken for the one of them that was believed
/// nearest to it before. `confident` says which estimates mean something, `before` where each object was believed to be.
pub(crate) fn told_apart(
    estimates: Estimates,
    models: &[Arc<ObjectModel>],
    world_from_camera: &Pose<World, Camera>,
    confident: impl Fn(&PosePosterior) -> bool,
    before: impl Fn(usize) -> Option<Pose<World, Object>>,
) -> Estimates {
    let numbers: Vec<usize> = estimates.iter().map(|(i, _)| *i).collect();
    let places: Vec<Option<Pose<World, Object>>> = numbers.iter().map(|i| before(*i)).collect();
    let distance = |estimate: usize, place: usize| {
        let (own, posterior) = &estimates[estimate];
        if models[*own].info.name != models[numbers[place]].info.name {
            return None;
        }
        let known = places[place].filter(|_| confident(posterior));
        let unknown = matching::unknown(estimate == place);
        let now = *world_from_camera * posterior.best;
        Some(known.map_or(unknown, |then| (now.translation() - then.translation()).norm()))
    };
    let mut pairs = nearest_pairs(numbers.len(), numbers.len(), distance);
    pairs.sort_unstable_by_key(|&(_, place)| place);
    pairs.into_iter().map(|(estimate, place)| (numbers[place], estimates[estimate].1.clone())).collect()
}

/// Estimates poses from what the camera saw.
pub trait Perception: Send + Sync {
    /// Estimates the objects that are asked for; those that there is no estimate of are left out.
    ///
    /// # Errors
    /// When detector or estimator fail; [`EstimatorFailed`] ends the trial and no more.
    fn look(&self, look: &Look<'_>) -> Result<Estimates>;

    /// The same for objects that are believed to lie in the bin.
    ///
    /// # Errors
    /// When the estimator fails.
    fn look_into_bin(&self, look: &Look<'_>) -> Result<Estimates>;

    /// Estimates the objects `asked` of `models` in a frame by itself, as if it were the first look of a trial.
    ///
    /// # Errors
    /// As [`Perception::look`].
    fn look_once(
        &self,
        frame: &CameraFrame,
        models: &[Arc<ObjectModel>],
        asked: &[usize],
        seed: u64,
    ) -> Result<Estimates> {
        let (cameras, before) = ([frame.world_from_camera], Estimates::new());
        self.look(&Look { frame, cameras: &cameras, before: &before, models, asked, again: false, seed })
    }

    /// For scenario.json: what its estimates depend on beside the settings.
    fn description(&self) -> Value;

    /// The name of the detector that proposes boxes; `none` where nobody looks at boxes.
    fn detector(&self) -> &'static str {
        "none"
    }
}

/// Who says where the objects are.
pub enum Estimator {
    /// An estimator, who sees frames.
    Perception(Box<dyn Perception>),
    /// The simulator itself: a ceiling, not a result.
    Truth,
}

impl Estimator {
    /// Opens what `kind` names, for the cell and settings of `setup`.
    ///
    /// # Errors
    /// When a file is wrong, a program does not greet, or an option of the network is given that nobody uses.
    pub fn open(
        setup: &Setup,
        kind: &EstimatorKind,
        detector: DetectorKind,
        network: &DetectorOptions,
    ) -> Result<Self> {
        if let Some(stage) = kind.second_stage() {
            return Ok(Self::Perception(Box::new(Grip::open(setup, stage, detector, network)?)));
        }
        Ok(match kind {
            EstimatorKind::Grip
            | EstimatorKind::Paper
            | EstimatorKind::PaperGuarded
            | EstimatorKind::Truth => Self::Truth,
            EstimatorKind::Csv(path) => Self::Perception(Box::new(Recorded::read(path)?)),
            EstimatorKind::Command { command, .. } => {
                Self::Perception(Box::new(External::open(setup, command)?))
            }
            EstimatorKind::Given(given) => {
                Self::Perception(Box::new(External::given(setup, given.who.clone())))
            }
        })
    }

    /// For scenario.json: what the results depend on beside the settings.
    pub fn description(&self) -> Value {
        match self {
            Self::Perception(perception) => perception.description(),
            Self::Truth => json!({ "name": "truth" }),
        }
    }

    /// The name of the detector that proposes boxes.
    pub fn detector(&self) -> &'static str {
        match self {
            Self::Perception(perception) => perception.detector(),
            Self::Truth => "none",
        }
    }
}

/// Says of which objects the detector knows nothing.
pub(crate) fn tell_unknown(names: &[String]) {
    if !names.is_empty() {
        let mut names = names.to_vec();
        names.sort_unstable();
        log::warn!(
            "the detector's network has no class for {}: whatever stands on the table is proposed for it (the detector clusters)",
            names.join(", ")
        );
    }
}

/// Names an estimator: `grip`, `paper`, `paper-guarded`, `truth`, `csv:FILE`, or `cmd:PROGRAM ARGUMENTS`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum EstimatorKind {
    /// GRIP.
    #[default]
    Grip,
    /// The filter of the GRIP paper to the letter, in place of GRIP's second stage.
    Paper,
    /// The same with guards that the paper leaves out, without which it does not converge.
    PaperGuarded,
    /// The simulator's own poses: a ceiling, not a result.
    Truth,
    /// A results file in BOP's format.
    Csv(PathBuf),
    /// A program that is asked at each look.
    Command {
        /// As in outputs, where one is given.
        name: Option<String>,
        /// What is run.
        command: CommandLine,
    },
    /// Someone in this process; the command line has no word for it.
    Given(Given<dyn Answers>),
}

impl EstimatorKind {
    /// Which second stage of our own it is.
    pub fn second_stage(&self) -> Option<SecondStage> {
        match self {
            Self::Grip => Some(SecondStage::Grip),
            Self::Paper => Some(SecondStage::Paper),
            Self::PaperGuarded => Some(SecondStage::PaperGuarded),
            Self::Truth | Self::Csv(_) | Self::Command { .. } | Self::Given(_) => None,
        }
    }

    /// As in outputs: of a file its name without the ending, behind `csv-`; of a program the name given or that of its script.
    pub fn name(&self) -> String {
        match self {
            Self::Grip | Self::Paper | Self::PaperGuarded => {
                self.second_stage().map_or("", SecondStage::name).to_owned()
            }
            Self::Truth => "truth".into(),
            Self::Csv(path) => {
                format!("csv-{}", path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy())
            }
            Self::Command { name, command } => name.clone().unwrap_or_else(|| command.name()),
            Self::Given(given) => given.name.clone(),
        }
    }
}

impl FromStr for EstimatorKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some((name, command)) = named_command(text, &["grip", "paper", "paper-guarded", "truth"])? {
            return Ok(Self::Command { name, command });
        }
        match (text, text.strip_prefix("csv:")) {
            ("grip", _) => Ok(Self::Grip),
            ("paper", _) => Ok(Self::Paper),
            ("paper-guarded", _) => Ok(Self::PaperGuarded),
            ("truth", _) => Ok(Self::Truth),
            (_, Some(file)) if Path::new(file).file_stem().is_some() => Ok(Self::Csv(file.into())),
            _ => {
                let nearest = grip_sim::names::suggestion(["grip", "paper", "paper-guarded", "truth"], text);
                Err(format!(
                    "give grip, paper, paper-guarded, truth, csv: and a results file, or cmd: and a program with its arguments{nearest}"
                ))
            }
        }
    }
}

/// Who proposes boxes to GRIP.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum DetectorKind {
    /// PyramidCNN: boxes of each object from the colour image.
    #[default]
    Pyramid,
    /// A class-agnostic box for each cluster of depth above the table.
    Clusters,
    /// No proposals: a uniform prior.
    None,
}

impl DetectorKind {
    /// As on the command line and in outputs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pyramid => "pyramid",
            Self::Clusters => "clusters",
            Self::None => "none",
        }
    }
}

/// A network for the detector `pyramid`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum NetworkChoice {
    /// `base` or `varied`.
    BuiltIn(BuiltInNetwork),
    /// An ONNX file with a description of the same name beside it (.json).
    File(PathBuf),
}

impl NetworkChoice {
    /// Of which folders and reports are named.
    pub fn label(&self) -> String {
        match self {
            Self::BuiltIn(which) => which.name().to_owned(),
            Self::File(path) => path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        }
    }
}

impl FromStr for NetworkChoice {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        let built_in = BuiltInNetwork::ALL.into_iter().find(|which| which.name() == text);
        Ok(built_in.map_or_else(|| Self::File(text.into()), Self::BuiltIn))
    }
}

/// Which network the detector `pyramid` is and what it runs on, and which boxes of any detector count.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DetectorOptions {
    /// The built-in default where none is given.
    pub model: Option<NetworkChoice>,
    /// Execution providers of a native ONNX Runtime.
    pub providers: Providers,
    /// Boxes of a lower confidence are thrown away, and an object of which none is left is not looked for, as in SUM (Sui et al.
    /// 2017). 0: all count, as in GRIP.
    pub min_confidence: f64,
}

impl DetectorOptions {
    /// The network.
    ///
    /// # Errors
    /// When a file is wrong, a provider is not there, or a setting out of range.
    pub fn open(&self, settings: &PyramidSettings) -> Result<PyramidCnn> {
        let network = match &self.model {
            Some(NetworkChoice::File(path)) => {
                let shown = path.display();
                ensure!(
                    path.exists(),
                    "--detector-model {shown}: no such file; give varied, base or an ONNX file"
                );
                PyramidCnn::open(path, &self.providers)?
            }
            Some(NetworkChoice::BuiltIn(which)) => PyramidCnn::built_in(*which, &self.providers)?,
            None => PyramidCnn::built_in(BuiltInNetwork::default(), &self.providers)?,
        };
        Ok(network.with_settings(settings.clone())?)
    }

    /// Refuses options that nobody uses.
    ///
    /// # Errors
    /// When an option is given although the network is not `used`; `by` says what uses it.
    pub fn check_used(&self, used: bool, by: &str) -> Result<()> {
        let given = self.model.is_some() || !self.providers.0.is_empty();
        ensure!(used || !given, "--detector-model and --providers are for {by}; leave them out");
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setup::library;

    #[test]
    fn of_two_of_a_kind_each_stays_the_one_that_was_there() {
        let library = library(None, &[]).unwrap();
        let models =
            ["005_tomato_soup_can", "011_banana", "005_tomato_soup_can"].map(|n| library.load(n).unwrap());
        let at = |x: f64| Pose::from_xyz_rpy([x, 0.0, 0.0], [0.0; 3]);
        let estimate = |i: usize, x: f64, confidence: f64| {
            let certain = PosePosterior::certain("", Pose::from_xyz_rpy([x, 0.0, 0.0], [0.0; 3]));
            (i, PosePosterior { confidence, ..certain })
        };
        let before = [Some(at(0.1)), Some(at(0.3)), Some(at(0.5))];
        let told = |estimates: Estimates| -> Vec<(usize, f64)> {
            let sure = |posterior: &PosePosterior| posterior.confidence > 0.5;
            let told = told_apart(estimates, &models, &Pose::identity(), sure, |i| before[i]);
            told.into_iter().map(|(i, posterior)| (i, posterior.best.translation().x)).collect()
        };
        // The estimator has numbered the cans the other way round; a banana is a banana wherever it is.
        let swapped = vec![estimate(0, 0.49, 1.0), estimate(1, 0.1, 1.0), estimate(2, 0.12, 1.0)];
        assert_eq!(told(swapped), [(0, 0.12), (1, 0.1), (2, 0.49)]);
        // A guess is nobody's place.
        let unsure = vec![estimate(0, 0.5, 1.0), estimate(1, 0.3, 1.0), estimate(2, 0.1, 0.1)];
        assert_eq!(told(unsure), [(0, 0.1), (1, 0.3), (2, 0.5)]);
        // One can is left.
        assert_eq!(told(vec![estimate(2, 0.1, 1.0)]), [(2, 0.1)]);
    }
}
