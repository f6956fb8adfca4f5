//! The options of data sets and of the estimators that are measured on them.

use std::path::PathBuf;

use crate::dataset::DatasetOptions;
use crate::estimators::{DetectorOptions, EstimatorKind, NetworkChoice, SecondStage};
use clap::{Args, ValueEnum};
use grip_perception::Providers;

use super::{Hypotheses, SceneArgs, SettingsFile, is_table};

/// `grip scenes`.
#[derive(Debug, Args)]
#[command(mut_arg("scene", |arg| arg.help("Scene file [default: scenes/adversarial.toml]")))]
#[command(mut_arg("tables", |arg| {
    arg.help(
        "Objects to draw from, by name, separated by commas [default: the scene's]; and tables of objects of your own \
         (docs/objects.md), beside the built-in ones; may be given more than once",
    )
    .value_name("LIST|TABLE.toml")
    .value_delimiter(',')
    .value_parser(clap::value_parser!(PathBuf))
}))]
pub struct ScenesArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Folder of the data set; one that is unfinished is gone on with by --resume.
    #[arg(long, value_name = "DIR", default_value = "runs/scenes")]
    pub out: PathBuf,
    /// How many scenes: each with its own objects, surroundings and light.
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=999_999))]
    pub scenes: u32,
    /// Frames of each scene: B, D, D1, D2, O1, O2, O3 of the paper (base, dark, light-left, light-right, clutter-1 to
    /// clutter-3), or NAME=CONDITION. Frames whose condition spreads the objects show the same poses.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "B,D,D1,D2,O1,O2,O3")]
    pub views: Vec<String>,
    /// Where the camera is: where the scene has it, the robot's head or a place of its own; there and at each of the scene's
    /// `[[cameras]]`, which take pictures of the same; or anywhere on the scene's `camera.sphere`, anew for each frame.
    #[arg(long, value_enum, default_value_t = CameraPlace::Head)]
    pub camera: CameraPlace,
    /// Who takes the pictures.
    #[arg(long, value_enum, default_value_t = Profile::Standard)]
    pub profile: Profile,
    /// Chance of each object, anew in each frame, to shine as metal does: depth lacks 20 to 80 % of it, in pieces.
    #[arg(long, value_name = "P", default_value_t = 0.0)]
    pub shiny: f64,
    /// Depth camera in place of the scene's: none, nguyen, handa, redwood, carmine-109, carmine-109-near, xtion, fetch-head,
    /// d435; with --profile hard in place of any of the last three and carmine-109.
    #[arg(long, value_name = "PRESET")]
    pub depth_noise: Option<String>,
    /// Lens distortion by OpenCV's coefficients k1,k2,p1,p2,k3; pictures, masks and depth are all distorted.
    #[arg(
        long,
        value_name = "K1,K2,P1,P2,K3",
        value_delimiter = ',',
        num_args = 1,
        allow_hyphen_values = true
    )]
    pub distortion: Vec<f64>,
    /// Name of the split's folder.
    #[arg(long, value_name = "NAME", default_value = "test")]
    pub split: String,
    /// Format of the data set.
    #[arg(long, value_enum, default_value_t = Format::Bop)]
    pub format: Format,
    /// Keep the scenes that are there already and make the rest.
    #[arg(long)]
    pub resume: bool,
    /// Scenes made at a time [default: one a core]; the files do not depend on it.
    #[arg(long, value_name = "J", value_parser = clap::value_parser!(u32).range(1..=256))]
    pub jobs: Option<u32>,
    /// Write preview.png, a contact sheet, too; for a BOP set that is whole already, ours or not, write only that.
    #[arg(long)]
    pub preview: bool,
    /// Print a summary as one JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

/// Where the camera of a data set is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum CameraPlace {
    /// The scene's camera, the robot's head unless the scene puts it elsewhere.
    Head,
    /// That one and the scene's `[[cameras]]`.
    All,
    /// On a sphere about the objects.
    Sphere,
}

/// How hard a data set is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Profile {
    /// One camera takes all pictures, well calibrated.
    Standard,
    /// Another camera takes each: exposure and white balance that err, another tone, blur, sharpening, noise, JPEG, colour that
    /// lies up to 4 pixels beside depth, depth that is off by millimetres and has holes.
    Hard,
}

impl ScenesArgs {
    /// What the library makes a data set of.
    pub fn options(&self) -> DatasetOptions {
        DatasetOptions {
            scenes: self.scenes,
            objects: self
                .scene
                .tables
                .tables
                .iter()
                .filter(|path| !is_table(path))
                .map(|name| name.to_string_lossy().into_owned())
                .collect(),
            views: self.views.clone(),
            camera: match self.camera {
                CameraPlace::Head => crate::dataset::CameraPlace::Head,
                CameraPlace::All => crate::dataset::CameraPlace::All,
                CameraPlace::Sphere => crate::dataset::CameraPlace::Sphere,
            },
            profile: match self.profile {
                Profile::Standard => crate::dataset::Profile::Standard,
                Profile::Hard => crate::dataset::Profile::Hard,
            },
            shiny: self.shiny,
            depth_noise: self.depth_noise.clone(),
            distortion: self.distortion.clone(),
            split: self.split.clone(),
        }
    }
}

/// Formats of data sets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// BOP, with COCO annotations.
    Bop,
}

/// Which network the detector `pyramid` is, and which boxes count.
#[derive(Debug, Args)]
pub struct DetectorArgs {
    /// The detector's network: `varied`, trained on every light, heaps and other cameras; `base`, on what the paper trains on;
    /// or an ONNX file with a description of the same name beside it (.json) [default: varied].
    #[arg(long, value_name = "varied|base|ONNX")]
    pub detector_model: Option<NetworkChoice>,
    /// Execution providers of the native ONNX Runtime that ORT_DYLIB_PATH names, in order: cpu, cuda, tensorrt, rocm,
    /// openvino, directml, coreml, xnnpack. Without ORT_DYLIB_PATH networks run in tract, which is built in.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub providers: Vec<String>,
    /// Throw away boxes of a lower confidence, whoever proposes them, and do not look for an object of which none is left:
    /// hard detections, as the filter SUM has them. GRIP keeps all.
    #[arg(long, value_name = "C", default_value_t = 0.0, value_parser = confidence)]
    pub min_confidence: f64,
}

impl DetectorArgs {
    /// As the library takes them.
    pub fn options(&self) -> DetectorOptions {
        DetectorOptions {
            model: self.detector_model.clone(),
            providers: Providers(self.providers.clone()),
            min_confidence: self.min_confidence,
        }
    }
}

fn confidence(text: &str) -> Result<f64, String> {
    let confidence = text.parse().ok().filter(|value| (0.0..=1.0).contains(value));
    confidence.ok_or_else(|| "must be 0 to 1".to_owned())
}

/// `grip detect`.
#[derive(Debug, Args)]
pub struct DetectArgs {
    /// A picture (PNG or JPEG), or the folder of a data set in BOP's format.
    #[arg(value_name = "IMAGE|DATASET")]
    pub input: PathBuf,
    #[command(flatten)]
    pub network: DetectorArgs,
    #[command(flatten)]
    pub settings: SettingsFile,
    /// Split of the data set, such as test or train_pbr [default: test, else the first there is].
    #[arg(long)]
    pub split: Option<String>,
    /// Boxes that are shown of a picture, the most confident of all objects.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(0..=10_000))]
    pub top: u32,
    /// Draw heat maps, PNG: of a picture into this file, of a data set into this folder.
    #[arg(long, value_name = "FILE|DIR")]
    pub heatmaps: Option<PathBuf>,
    /// Write the boxes of a data set to this file, the 100 most confident of each object and image, in COCO's format: for
    /// `grip estimate --boxes FILE` and others' tools.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Threads [default: all cores].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub jobs: Option<u32>,
    /// Print the figures as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `grip estimate`.
#[derive(Debug, Args)]
pub struct EstimateArgs {
    /// Folder of the data set, in BOP's format.
    pub dataset: PathBuf,
    /// Split, such as test or train_pbr [default: test, else the first there is].
    #[arg(long)]
    pub split: Option<String>,
    /// Where to look for objects: `pyramid` (PyramidCNN's boxes), `clusters` (what stands on the support), `none`, `gt` (boxes
    /// of the truth), `jittered` (those moved by 10 % of their sides, among four false ones each), or a .json file of
    /// detections in COCO's format [default: pyramid; for cmd: none].
    #[arg(long, value_name = "pyramid|clusters|none|gt|jittered|FILE")]
    pub boxes: Option<String>,
    #[command(flatten)]
    pub network: DetectorArgs,
    /// Who estimates: `grip`; `paper`, the filter of the GRIP paper to the letter, 400 iterations of which take about five
    /// seconds of one core a pose; `paper-guarded`, the same with guards that the paper leaves out, without which it does
    /// not converge; or `cmd:PROGRAM ARGUMENTS`, a program that is asked of each image (docs/estimators.md).
    #[arg(long, value_name = "grip|paper|paper-guarded|cmd:PROGRAM", default_value = "grip")]
    pub estimator: EstimatorKind,
    /// Follow objects through each scene, whose images are a sequence in the order of their numbers: what is believed in one is
    /// where to look in the next. (--resume goes on with whole scenes.)
    #[arg(long)]
    pub track: bool,
    /// Look for so many objects an image that are not in it, too, in boxes of others: `grip eval` then tells how well
    /// confidence tells present from absent ones.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=100))]
    pub absent: u32,
    /// Who renders pose hypotheses.
    #[arg(long, value_enum, default_value_t = Hypotheses::Cpu)]
    pub hypotheses: Hypotheses,
    #[command(flatten)]
    pub settings: SettingsFile,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Where the results go: a CSV file as the BOP challenge has it; an older one is replaced.
    #[arg(long, value_name = "FILE", default_value = "runs/results.csv")]
    pub out: PathBuf,
    /// Also write where each object may be and how far off, as JSON, a line an estimate; for grip eval --posteriors.
    #[arg(long, value_name = "FILE")]
    pub posteriors: Option<PathBuf>,
    /// Go on with a run that was stopped.
    #[arg(long)]
    pub resume: bool,
    /// Threads [default: all cores].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub jobs: Option<u32>,
    /// Print a summary as JSON.
    #[arg(long)]
    pub json: bool,
}

/// The second stages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum EstimatorChoice {
    /// Ours.
    Grip,
    /// The filter of the GRIP paper to the letter; 400 iterations take about five seconds of one core a pose.
    Paper,
    /// The same with guards that the paper leaves out, without which it does not converge.
    PaperGuarded,
}

impl EstimatorChoice {
    /// As on the command line.
    pub fn name(self) -> &'static str {
        SecondStage::from(self).name()
    }
}

impl From<EstimatorChoice> for SecondStage {
    fn from(choice: EstimatorChoice) -> Self {
        match choice {
            EstimatorChoice::Grip => Self::Grip,
            EstimatorChoice::Paper => Self::Paper,
            EstimatorChoice::PaperGuarded => Self::PaperGuarded,
        }
    }
}

/// `grip eval`.
#[derive(Debug, Args)]
pub struct EvalArgs {
    /// Folder of the data set, in BOP's format.
    pub dataset: PathBuf,
    /// Pose estimates, CSV files as the BOP challenge has them.
    #[arg(required = true)]
    pub results: Vec<PathBuf>,
    /// Split, such as test or train_pbr [default: test, else the first there is].
    #[arg(long)]
    pub split: Option<String>,
    /// Also write the errors of every instance to this CSV file; for one results file.
    #[arg(long, value_name = "FILE")]
    pub errors: Option<PathBuf>,
    /// Also tell whether these posteriors (of grip estimate --posteriors) hold the truth as often as they say; for one results
    /// file.
    #[arg(long, value_name = "FILE")]
    pub posteriors: Option<PathBuf>,
    /// Also draw the share of instances under a threshold against the threshold, 0 to 4 cm, a curve a results file; SVG.
    #[arg(long, value_name = "FILE")]
    pub figure: Option<PathBuf>,
    /// Print the table of the GRIP paper instead: its objects, views and metrics, beside its own figures.
    #[arg(long)]
    pub paper: bool,
    /// Print the figures as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `grip explain`.
#[derive(Debug, Args)]
pub struct ExplainArgs {
    /// Folder of the data set, in BOP's format.
    pub dataset: PathBuf,
    /// Pose estimates, a CSV file as the BOP challenge has it.
    pub results: PathBuf,
    /// Split, such as test or train_pbr [default: test, else the first there is].
    #[arg(long)]
    pub split: Option<String>,
    /// Number of the scene.
    #[arg(long, value_name = "S")]
    pub scene: u32,
    /// Number of the image.
    #[arg(long, value_name = "I")]
    pub image: u32,
    /// Draw estimates with a confidence below 0.05, too; without it they are listed only.
    #[arg(long)]
    pub all: bool,
    /// Draw the outlines of the truth, too, thin and dashed.
    #[arg(long)]
    pub truth: bool,
    /// The picture, PNG; an older one is replaced.
    #[arg(long, value_name = "FILE", default_value = "runs/explain.png")]
    pub out: PathBuf,
    /// Print the figures of every estimate as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `grip convergence`.
#[derive(Debug, Args)]
pub struct ConvergenceArgs {
    /// Folder of the data set, in BOP's format.
    pub dataset: PathBuf,
    /// Split, such as test or train_pbr [default: test, else the first there is].
    #[arg(long)]
    pub split: Option<String>,
    /// Number of the scene.
    #[arg(long, value_name = "S")]
    pub scene: u32,
    /// Number of the image.
    #[arg(long, value_name = "I")]
    pub image: u32,
    /// Numbers of objects, separated by commas [default: all in the image].
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub object: Vec<u32>,
    /// Who searches: grip, paper or paper-guarded, with a TOML file of settings that are not to be the defaults where there
    /// is one (paper=fewer.toml); may be given more than once.
    #[arg(long, value_name = "NAME[=FILE]", default_values = ["grip", "paper-guarded", "paper"])]
    pub estimator: Vec<SearchChoice>,
    /// Searches of each object, with the seeds 1 to N.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub seeds: u64,
    /// Where to look for objects, as for `grip estimate`.
    #[arg(long, default_value = "jittered", value_name = "pyramid|clusters|none|gt|jittered|FILE")]
    pub boxes: String,
    #[command(flatten)]
    pub network: DetectorArgs,
    /// The figure, SVG; an older one is replaced.
    #[arg(long, value_name = "FILE", default_value = "runs/convergence.svg")]
    pub out: PathBuf,
    /// Print every search as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `grip reproduce`.
#[derive(Debug, Args)]
pub struct ReproduceArgs {
    /// What: `table1`, the areas under the accuracy curve of 15 objects in three settings.
    #[arg(value_enum)]
    pub what: Reproduction,
    /// Folder of the data set, the poses and the table; what the same command made there before is kept.
    #[arg(long, value_name = "DIR", default_value = "runs/table1")]
    pub out: PathBuf,
    /// Methods, separated by commas or each behind an option of its own: grip; paper-guarded, the filter of the paper with its guards;
    /// sum, that over hard detections; paper, the filter to the letter; or a program of your own, NAME=cmd:PROGRAM ARGUMENTS.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_values = ["grip", "paper-guarded", "sum"])]
    pub methods: Vec<MethodChoice>,
    /// Scenes, seven frames each.
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=999_999))]
    pub scenes: u32,
    /// Seed of the scenes.
    #[arg(long, default_value_t = 901)]
    pub seed: u64,
    /// A data set of real frames that the same methods estimate, too.
    #[arg(long, value_name = "DATASET")]
    pub real: Option<PathBuf>,
    /// Print the figures as JSON.
    #[arg(long)]
    pub json: bool,
}

/// What can be reproduced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Reproduction {
    /// Table I of Chen et al. 2019.
    Table1,
}

/// A column of the table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MethodChoice {
    /// An estimator of ours behind PyramidCNN.
    Grip,
    /// The paper's filter with guards,
    PaperGuarded,
    /// the same over hard detections,
    Sum,
    /// and to the letter.
    Paper,
    /// A program, by its name and as `--estimator` has it.
    Program(String, String),
}

impl MethodChoice {
    /// The name of the column, and of its files.
    pub fn title(&self) -> String {
        match self {
            Self::Grip => "grip",
            Self::PaperGuarded => "paper-guarded",
            Self::Sum => "sum",
            Self::Paper => "paper",
            Self::Program(name, _) => name,
        }
        .to_owned()
    }

    /// The options of `grip estimate`.
    pub fn options(&self) -> Vec<String> {
        let words: &[&str] = match self {
            Self::Grip => &["--estimator", "grip"],
            Self::PaperGuarded => &["--estimator", "paper-guarded"],
            Self::Sum => &["--estimator", "paper-guarded", "--min-confidence", "0.5"],
            Self::Paper => &["--estimator", "paper"],
            Self::Program(_, program) => &["--estimator", program, "--boxes", "pyramid"],
        };
        words.iter().map(|word| (*word).to_owned()).collect()
    }
}

impl std::str::FromStr for MethodChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Ok(match text {
            "grip" => Self::Grip,
            "paper-guarded" => Self::PaperGuarded,
            "sum" => Self::Sum,
            "paper" => Self::Paper,
            _ => match text.split_once('=') {
                Some((name, program)) if program.starts_with("cmd:") && is_name(name) => {
                    Self::Program(name.to_owned(), program.to_owned())
                }
                _ => return Err("must be grip, paper-guarded, sum, paper, or NAME=cmd:PROGRAM".to_owned()),
            },
        })
    }
}

/// Whether files can be called so.
fn is_name(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_alphanumeric() || "-_+".contains(c))
}

/// An estimator, and the file of its settings.
#[derive(Debug, Clone)]
pub struct SearchChoice {
    /// Who.
    pub estimator: EstimatorChoice,
    /// Changes of its settings.
    pub settings: SettingsFile,
}

impl std::str::FromStr for SearchChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, file) = text.split_once('=').map_or((text, None), |(name, file)| (name, Some(file)));
        let estimator = EstimatorChoice::from_str(name, false)
            .map_err(|_| "must be grip, paper or paper-guarded, or one of these with =FILE".to_owned())?;
        Ok(Self { estimator, settings: SettingsFile { settings: file.map(PathBuf::from) } })
    }
}
