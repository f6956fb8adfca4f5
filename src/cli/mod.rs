//! The command line, as data. What it does stands in `commands`.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context, Result};
use clap::{Args, Parser, Subcommand, ValueEnum};
use grip::benchmark::FrameEstimatorKind;
use grip::dataset::DatasetOptions;
use grip::estimators::{DetectorKind, EstimatorKind, NetworkOptions};
use grip::settings::Settings;
use grip::setup::SetupOptions;
use grip_perception::Providers;
use grip_sim::robot::{RobotConfig, RobotModel};

mod experiments;

pub use experiments::{MergeArgs, ReportArgs, SweepArgs, TrialsArgs};

/// Grocery packing in simulation: GRIP estimates poses, a Fetch packs, physics decides, every grasp is scored.
#[derive(Debug, Parser)]
#[command(name = "grip", version, about, max_term_width = 100)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// More messages on stderr (-v, -vv); graphics drivers and libraries stay silent without it.
    #[arg(short, long, action = clap::ArgAction::Count, global = true)]
    pub verbose: u8,
}

/// The verbs.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Pack the scene's objects into the bin and score every grasp.
    Pack(PackArgs),
    /// Run many trials: scenes, conditions and estimators with the same seeds; can be killed, resumed and split.
    Trials(TrialsArgs),
    /// Put the shards of an experiment together.
    Merge(MergeArgs),
    /// Try grasps under known pose errors: what error does a grasp forgive?
    Sweep(SweepArgs),
    /// Make a page, and CSV files, of experiments, sweeps and single runs.
    Report(ReportArgs),
    /// Solve motion planning problems of MotionBenchMaker (MoveIt's YAML) and check the solutions.
    Plan(PlanArgs),
    /// Draw what the head camera sees of a scene.
    Render(RenderArgs),
    /// Make a BOP data set of the scene: the paper's adversarial set, or training data.
    Scenes(ScenesArgs),
    /// Find objects by PyramidCNN, the first stage: boxes and heat maps of an image, or boxes of a data set and what they are
    /// worth.
    Detect(DetectArgs),
    /// Estimate the poses of a data set in BOP's format.
    Estimate(EstimateArgs),
    /// Measure the errors of a results file against the truth of its data set.
    Eval(EvalArgs),
    /// Draw a picture that explains the pose estimates of one image.
    Explain(ExplainArgs),
    /// Draw how searches converge: error of the best pose against iterations and time.
    Convergence(ConvergenceArgs),
    /// Find the grasps of objects and save them as files, for `pack --grasps` and for other programs.
    Grasps(GraspsArgs),
    /// List the objects and the set that is in use.
    Objects(ObjectsArgs),
    /// Show the robot: what was loaded, joints, limits.
    Robot(RobotArgs),
    /// Write the scenes, conditions, objects and robot that are built into the program to a folder, to be edited.
    Init(InitArgs),
    /// Print the tree of settings as TOML, to be edited and given to `--settings`.
    Settings(SettingsFile),
}

/// Which scene, and which parts it is made of.
#[derive(Debug, Args)]
pub struct SceneArgs {
    /// Scene file [default: scenes/grocery.toml].
    pub scene: Option<PathBuf>,
    /// Seed of everything random in the run.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Who draws: `auto` takes wgpu where a graphics adapter exists, else the CPU.
    #[arg(long, value_enum, default_value_t = Renderer::Auto)]
    pub renderer: Renderer,
    /// Folder of scanned objects (official YCB layout, or a BOP `models` folder) [env: GRIP_YCB_DIR].
    #[arg(long, value_name = "DIR")]
    pub ycb: Option<PathBuf>,
    /// Another URDF of the robot, such as the upstream Fetch's.
    #[arg(long, value_name = "URDF")]
    pub robot: Option<PathBuf>,
    /// Where `package://` meshes are looked up; may be given more than once.
    #[arg(long, value_name = "DIR")]
    pub package_path: Vec<PathBuf>,
    #[command(flatten)]
    pub settings: SettingsFile,
}

impl SceneArgs {
    /// What the library makes a setup of; `scene` is the file where none is named.
    pub fn options(&self, scene: &str, condition: &str) -> Result<SetupOptions> {
        Ok(SetupOptions {
            scene: self.scene.clone().unwrap_or_else(|| grip::assets::find(scene)),
            condition: condition.to_owned(),
            seed: self.seed,
            ycb: self.ycb.clone(),
            robot: self.robot.clone(),
            package_path: self.package_path.clone(),
            settings: Arc::new(self.settings.load()?),
        })
    }
}

/// Where settings are that are not to be the defaults.
#[derive(Debug, Clone, Default, Args)]
pub struct SettingsFile {
    /// Settings that are not to be the defaults: any part of the tree that `grip settings` prints, TOML.
    #[arg(long, value_name = "FILE")]
    pub settings: Option<PathBuf>,
}

impl SettingsFile {
    /// The defaults with what the file says.
    pub fn load(&self) -> Result<Settings> {
        self.settings.as_deref().map_or_else(|| Ok(Settings::default()), Settings::load)
    }
}

/// `grip pack`.
#[derive(Debug, Args)]
pub struct PackArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Condition by name, from the folder `conditions` beside the scene file, or a path to a .toml file.
    #[arg(long, default_value = "base")]
    pub condition: String,
    /// Who estimates poses: `grip`; `csv:FILE`, a results file in BOP's format with the seed as scene_id and the look as im_id
    /// (see --bop), a look that is not in it keeping the estimates of the one before; or `truth`, which reads them from the simulator, for ceilings, and is marked in every output.
    #[arg(long, value_name = "grip|csv:FILE|truth", default_value = "grip")]
    pub estimator: EstimatorKind,
    /// Who proposes boxes.
    #[arg(long, value_enum, default_value_t = Detector::Pyramid)]
    pub detector: Detector,
    #[command(flatten)]
    pub network: DetectorArgs,
    /// Who renders pose hypotheses.
    #[arg(long, value_enum, default_value_t = Hypotheses::Cpu)]
    pub hypotheses: Hypotheses,
    /// Whether grasps are scored at the best pose alone or over the posterior [default: the settings', else posterior].
    #[arg(long, value_enum)]
    pub grasp_at: Option<GraspAt>,
    /// Folder of grasps to use instead of those that are found: a file OBJECT.json each, as `grip grasps --out` makes them.
    #[arg(long, value_name = "DIR")]
    pub grasps: Option<PathBuf>,
    /// Pack only the first K objects of the scene; the others stay as clutter.
    #[arg(long, value_name = "K")]
    pub items: Option<usize>,
    /// Run folder [default: runs/SCENE-CONDITION-ESTIMATOR-SEED, with other options where they are not the default]; an
    /// earlier run there is replaced when this one is done.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Save an animated replay of the trial (replay.gif), seen from outside, four times as fast.
    #[arg(long)]
    pub record: bool,
    /// Save what the camera saw at each look as a BOP data set in the run folder (bop/), without truth: the seed is the
    /// scene, the look the image.
    #[arg(long)]
    pub bop: bool,
    /// Print the clauses of success item by item, each with the value that it was judged by.
    #[arg(long, conflicts_with = "json")]
    pub strict: bool,
    /// Print the result as one JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

/// Poses at which grasps are scored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum GraspAt {
    /// The best pose.
    Best,
    /// Weighted poses of the posterior.
    Posterior,
}

impl From<GraspAt> for grip_manip::GraspAt {
    fn from(at: GraspAt) -> Self {
        match at {
            GraspAt::Best => Self::Best,
            GraspAt::Posterior => Self::Posterior,
        }
    }
}

/// Which robot, where no scene says it.
#[derive(Debug, Args)]
pub struct RobotFile {
    /// URDF [default: the scene's; robots/fetch/fetch.urdf where there is none].
    #[arg(long, value_name = "URDF")]
    pub robot: Option<PathBuf>,
    /// Where `package://` meshes are looked up; may be given more than once.
    #[arg(long, value_name = "DIR")]
    pub package_path: Vec<PathBuf>,
}

impl RobotFile {
    /// The URDF's path, the robot in it, and the project's settings of it.
    pub fn load(&self) -> Result<(PathBuf, RobotModel, RobotConfig)> {
        let urdf = self.robot.clone().unwrap_or_else(|| grip::assets::find("robots/fetch/fetch.urdf"));
        let robot = RobotModel::load(&urdf, &self.package_path)?;
        let config = RobotConfig::load(&grip::assets::find("robots/fetch/fetch.toml"), &robot)
            .with_context(|| format!("{}: does not fit the Fetch's settings", urdf.display()))?;
        Ok((urdf, robot, config))
    }
}

/// `grip plan`.
#[derive(Debug, Args)]
pub struct PlanArgs {
    /// Folder of requestNNNN.yaml and sceneNNNN.yaml, or of such folders.
    #[arg(value_name = "PROBLEMS")]
    pub problems: PathBuf,
    /// Seed of the search; each problem draws its own stream from it.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Problems solved at the same time; times are those of one core only with 1.
    #[arg(long, default_value_t = 1, value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=1024))]
    pub jobs: usize,
    #[command(flatten)]
    pub robot: RobotFile,
    #[command(flatten)]
    pub settings: SettingsFile,
    /// Print the results, problem by problem, as one JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

/// `grip render`.
#[derive(Debug, Args)]
pub struct RenderArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Condition by name, from the folder `conditions` beside the scene file, or a path to a .toml file.
    #[arg(long, default_value = "base")]
    pub condition: String,
    /// Folder for the pictures.
    #[arg(long, value_name = "DIR", default_value = "runs/render")]
    pub out: PathBuf,
}

/// `grip scenes`.
#[derive(Debug, Args)]
#[command(mut_arg("scene", |arg| arg.help("Scene file [default: scenes/adversarial.toml]")))]
pub struct ScenesArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Folder of the data set; one that is unfinished is gone on with by --resume.
    #[arg(long, value_name = "DIR", default_value = "runs/scenes")]
    pub out: PathBuf,
    /// How many scenes: each with its own objects, surroundings and light.
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=999_999))]
    pub scenes: u32,
    /// Objects to draw from, by name, separated by commas [default: the scene's].
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub objects: Vec<String>,
    /// Frames of each scene: B, D, D1, D2, O1, O2, O3 of the paper (base, dark, light-left, light-right, clutter-1 to
    /// clutter-3), or NAME=CONDITION. Frames whose condition spreads the objects show the same poses.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "B,D,D1,D2,O1,O2,O3")]
    pub views: Vec<String>,
    /// Where the camera is: the robot's head, or anywhere on the scene's `camera.sphere`, anew for each frame.
    #[arg(long, value_enum, default_value_t = CameraPlace::Head)]
    pub camera: CameraPlace,
    /// Depth noise preset in place of the scene's: none, nguyen, handa, redwood, carmine-109, carmine-109-near.
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
    /// The robot's head, looking at the scene's `look_at`.
    Head,
    /// On a sphere about the objects.
    Sphere,
}

impl ScenesArgs {
    /// What the library makes a data set of.
    pub fn options(&self) -> DatasetOptions {
        DatasetOptions {
            scenes: self.scenes,
            objects: self.objects.clone(),
            views: self.views.clone(),
            camera: match self.camera {
                CameraPlace::Head => grip::dataset::CameraPlace::Head,
                CameraPlace::Sphere => grip::dataset::CameraPlace::Sphere,
            },
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

/// Which network the detector `pyramid` is.
#[derive(Debug, Args)]
pub struct DetectorArgs {
    /// Another network for the detector: an ONNX file with a description of the same name beside it (.json).
    #[arg(long, value_name = "ONNX")]
    pub detector_model: Option<PathBuf>,
    /// Execution providers of the native ONNX Runtime that ORT_DYLIB_PATH names, in order: cpu, cuda, tensorrt, rocm,
    /// openvino, directml, coreml, xnnpack. Without ORT_DYLIB_PATH networks run in tract, which is built in.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub providers: Vec<String>,
}

impl DetectorArgs {
    /// As the library takes them.
    pub fn options(&self) -> NetworkOptions {
        NetworkOptions { model: self.detector_model.clone(), providers: Providers(self.providers.clone()) }
    }
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
    /// Leave out boxes with a lower confidence: what GRIP does not do, to see what a threshold costs.
    #[arg(long, value_name = "C", default_value_t = 0.0)]
    pub least_confidence: f64,
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
    /// detections in COCO's format.
    #[arg(long, default_value = "pyramid", value_name = "pyramid|clusters|none|gt|jittered|FILE")]
    pub boxes: String,
    #[command(flatten)]
    pub network: DetectorArgs,
    /// Who estimates.
    #[arg(long, value_enum, default_value_t = EstimatorChoice::Grip)]
    pub estimator: EstimatorChoice,
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
    #[arg(long, value_name = "FILE", default_value = "results.csv")]
    pub out: PathBuf,
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
        FrameEstimatorKind::from(self).name()
    }
}

impl From<EstimatorChoice> for FrameEstimatorKind {
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
    #[arg(long, value_name = "FILE", default_value = "explain.png")]
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
    #[arg(long, value_name = "FILE", default_value = "convergence.svg")]
    pub out: PathBuf,
    /// Print every search as JSON.
    #[arg(long)]
    pub json: bool,
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

/// `grip objects`.
#[derive(Debug, Args)]
pub struct ObjectsArgs {
    /// Folder of scanned objects (official YCB layout, or a BOP `models` folder) [env: GRIP_YCB_DIR].
    #[arg(long, value_name = "DIR")]
    pub ycb: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// `grip grasps`.
#[derive(Debug, Args)]
pub struct GraspsArgs {
    /// Objects, by name [default: all of the table].
    #[arg(value_name = "OBJECT")]
    pub objects: Vec<String>,
    /// Folder for one file an object [default: none is written]; an earlier one there is replaced.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Folder of scanned objects (official YCB layout, or a BOP `models` folder) [env: GRIP_YCB_DIR].
    #[arg(long, value_name = "DIR")]
    pub ycb: Option<PathBuf>,
    #[command(flatten)]
    pub robot: RobotFile,
    #[command(flatten)]
    pub settings: SettingsFile,
    /// Print the sets as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `grip init`.
#[derive(Debug, Args)]
pub struct InitArgs {
    /// The folder: a new or an empty one.
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
}

/// `grip robot`.
#[derive(Debug, Args)]
pub struct RobotArgs {
    #[command(flatten)]
    pub robot: RobotFile,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// Who draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Renderer {
    /// wgpu where an adapter exists, else the CPU.
    Auto,
    /// wgpu or an error.
    Wgpu,
    /// The CPU ray caster.
    Cpu,
}

impl From<Renderer> for grip_sim::render::RendererChoice {
    fn from(choice: Renderer) -> Self {
        match choice {
            Renderer::Auto => Self::Auto,
            Renderer::Wgpu => Self::Wgpu,
            Renderer::Cpu => Self::Cpu,
        }
    }
}

/// Who renders pose hypotheses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Hypotheses {
    /// The CPU: the same poses on every x86-64 machine.
    Cpu,
    /// The best graphics adapter there is, a software driver too, or an error.
    Gpu,
    /// A graphics adapter if there is one that is no software, else the CPU.
    Auto,
}

impl From<Hypotheses> for grip_perception::HypothesisRendererChoice {
    fn from(choice: Hypotheses) -> Self {
        match choice {
            Hypotheses::Cpu => Self::Cpu,
            Hypotheses::Gpu => Self::Gpu,
            Hypotheses::Auto => Self::Auto,
        }
    }
}

/// Who proposes boxes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Detector {
    /// PyramidCNN: boxes of each object from the colour image.
    Pyramid,
    /// A class-agnostic box for each cluster of depth above the table.
    Clusters,
    /// No proposals: a uniform prior.
    None,
}

impl From<Detector> for DetectorKind {
    fn from(detector: Detector) -> Self {
        match detector {
            Detector::Pyramid => Self::Pyramid,
            Detector::Clusters => Self::Clusters,
            Detector::None => Self::None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    /// docs/command-line.md, made of what `--help` says; `GRIP_UPDATE_DOCS=1` writes it anew.
    #[test]
    fn the_page_of_the_command_line_is_current() {
        let mut page = String::from(
            "# Command line\n\nMade of what `--help` says, by `GRIP_UPDATE_DOCS=1 cargo test --release command_line`.\n",
        );
        let mut command = Cli::command().term_width(100);
        command.build();
        for verb in command.get_subcommands_mut().filter(|verb| verb.get_name() != "help") {
            let help = verb.render_long_help().to_string();
            let lines: Vec<&str> = help.trim_end().lines().map(str::trim_end).collect();
            page += &format!("\n## grip {}\n\n```text\n{}\n```\n", verb.get_name(), lines.join("\n"));
        }
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/command-line.md");
        if std::env::var_os("GRIP_UPDATE_DOCS").is_some() {
            std::fs::write(&file, &page).unwrap();
        }
        let written = std::fs::read_to_string(&file).unwrap_or_default();
        assert!(
            written == page,
            "docs/command-line.md is not what --help says; GRIP_UPDATE_DOCS=1 writes it anew"
        );
    }
}
