//! The command line, as data. What it does stands in `commands`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::estimators::{DetectorKind, EstimatorKind};
use crate::graspers::GrasperKind;
use crate::record::{Level, RecordOptions};
use crate::settings::Settings;
use crate::setup::SetupOptions;
use anyhow::{Context, Result};
use clap::{Args, Parser, Subcommand, ValueEnum};
use grip_sim::camera::Intrinsics;
use grip_sim::robot::{RobotConfig, RobotModel};

mod campaigns;
mod data_sets;
mod experiments;
mod objects;
pub mod options;
#[cfg(test)]
mod python;

pub use campaigns::{
    CampaignArgs, CampaignCommand, CampaignMergeArgs, CampaignPlanArgs, CampaignRunArgs, CampaignStatusArgs,
};
pub use data_sets::{
    ConvergenceArgs, DetectArgs, DetectorArgs, EstimateArgs, EvalArgs, ExplainArgs, MethodChoice,
    ReproduceArgs, ScenesArgs, SearchChoice,
};
pub use experiments::{MergeArgs, ReportArgs, SweepArgs, TrialsArgs};
pub use objects::{AddArgs, ObjectTables, ObjectsArgs, ObjectsCommand, ObjectsListArgs, is_table};

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
    /// Run many trials: scenes, conditions, estimators and grasp planners with the same seeds; can be killed, resumed and split.
    Trials(TrialsArgs),
    /// Put the shards of an experiment together.
    Merge(MergeArgs),
    /// Run trials, sweep, scenes or estimate on many machines: cut into units, each resumed, checked, and put together.
    Campaign(CampaignArgs),
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
    /// Redo a table of the GRIP paper: scenes, every method, the table, in one command that can be stopped and run again.
    Reproduce(ReproduceArgs),
    /// Find the grasps of objects and save them as files, for `pack --grasps` and for other programs.
    Grasps(GraspsArgs),
    /// Write a settled scene for another program: MuJoCo's MJCF.
    Export(ExportArgs),
    /// Make one MCAP file of a recording, for Foxglove, Rerun and whatever else reads that.
    Convert(ConvertArgs),
    /// List the objects and the set that is in use, or add objects of your own.
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
    #[command(flatten)]
    pub tables: ObjectTables,
    /// Another camera than the scene's: FX,FY,CX,CY,WIDTH,HEIGHT in pixels, a ROS calibration (.yaml), or BOP's camera.json.
    #[arg(long, value_name = "NUMBERS|FILE")]
    pub intrinsics: Option<Intrinsics>,
    #[command(flatten)]
    pub robot: RobotFile,
    #[command(flatten)]
    pub settings: SettingsFile,
}

impl SceneArgs {
    /// What the library makes a setup of; `scene` is the file where none is named.
    pub fn options(&self, scene: &str, condition: &str) -> Result<SetupOptions> {
        Ok(SetupOptions {
            scene: self.scene.clone().unwrap_or_else(|| crate::assets::find(scene)),
            condition: condition.to_owned(),
            seed: self.seed,
            ycb: self.ycb.clone(),
            // `grip scenes` has names of objects here, too.
            tables: self.tables.tables.iter().filter(|path| is_table(path)).cloned().collect(),
            intrinsics: self.intrinsics,
            robot: self.robot.robot.clone(),
            robot_config: self.robot.robot_config.clone(),
            package_path: self.robot.package_path.clone(),
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
    /// Who estimates poses: `grip`; `paper` or `paper-guarded`, the filter of the GRIP paper in place of ours, to the letter or
    /// with guards (five seconds of one core a pose); `cmd:PROGRAM ARGUMENTS`, a program that is asked at each look (docs/estimators.md), or
    /// `NAME=cmd:...`; `csv:FILE`, a results file in BOP's format with the seed as scene_id and the look as im_id
    /// (see --bop), a look that is not in it keeping the estimates of the one before; or `truth`, which reads them from the simulator, for ceilings, and is marked in every output.
    #[arg(long, value_name = "grip|paper|cmd:PROGRAM|csv:FILE|truth", default_value = "grip")]
    pub estimator: EstimatorKind,
    /// Who proposes boxes.
    #[arg(long, value_enum, default_value_t = Detector::Pyramid)]
    pub detector: Detector,
    #[command(flatten)]
    pub network: DetectorArgs,
    /// Who renders pose hypotheses.
    #[arg(long, value_enum, default_value_t = Hypotheses::Cpu)]
    pub hypotheses: Hypotheses,
    /// Who plans grasps: `grip`, from the shape of the objects; or `cmd:PROGRAM ARGUMENTS`, a program that is asked after each look
    /// (docs/graspers.md), or `NAME=cmd:...`.
    #[arg(long, value_name = "grip|cmd:PROGRAM", default_value = "grip")]
    pub grasper: GrasperKind,
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
    /// What to keep of what is known of the trial, in the folder record/ (docs/recordings.md).
    #[arg(long, value_enum, value_name = "LEVEL", default_value_t = Recorded::Full)]
    pub record: Recorded,
    #[command(flatten)]
    pub record_rate: RecordRate,
    /// Save an animated picture of the trial (replay.png), seen from outside, four times as fast.
    #[arg(long)]
    pub animation: bool,
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

/// Which robot, where no scene says it.
#[derive(Debug, Args)]
pub struct RobotFile {
    /// URDF [default: the scene's; robots/fetch/fetch.urdf where there is none].
    #[arg(long, value_name = "URDF")]
    pub robot: Option<PathBuf>,
    /// What the URDF does not say: groups, poses, limits, gripper (robots/README.md) [default: the scene's;
    /// robots/fetch/fetch.toml where there is none].
    #[arg(long, value_name = "FILE")]
    pub robot_config: Option<PathBuf>,
    /// Where `package://` meshes are looked up; may be given more than once.
    #[arg(long, value_name = "DIR")]
    pub package_path: Vec<PathBuf>,
}

impl RobotFile {
    /// The URDF's path, the robot in it, and its settings.
    pub fn load(&self) -> Result<(PathBuf, RobotModel, RobotConfig)> {
        let (urdf, robot) = self.model()?;
        let (robot, config) = self.configured(&urdf, robot)?;
        Ok((urdf, robot, config))
    }

    /// The URDF's path, and the robot in it, whichever it is.
    pub fn model(&self) -> Result<(PathBuf, RobotModel)> {
        let urdf = self.robot.clone().unwrap_or_else(|| crate::assets::find("robots/fetch/fetch.urdf"));
        let robot = RobotModel::load(&urdf, &self.package_path)?;
        Ok((urdf, robot))
    }

    /// A robot with its settings, which are the Fetch's where none are named.
    pub fn configured(&self, urdf: &Path, robot: RobotModel) -> Result<(RobotModel, RobotConfig)> {
        let Some(config) = &self.robot_config else {
            return RobotConfig::load(&crate::assets::find("robots/fetch/fetch.toml"), robot).with_context(|| {
                format!(
                    "{}: does not fit the Fetch's settings; give its own by --robot-config (robots/README.md)",
                    urdf.display()
                )
            });
        };
        Ok(RobotConfig::load(config, robot)?)
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
    /// Folder for the trajectories [default: none is written]: of each solved problem NAME.json, NAME.yaml (ROS 2's
    /// trajectory_msgs/msg/JointTrajectory) and NAME.png (start, goal and the path of the hand), and plan.json, what --json prints. An
    /// earlier one there is replaced.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
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

/// `grip export`.
#[derive(Debug, Args)]
pub struct ExportArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Condition by name, from the folder `conditions` beside the scene file, or a path to a .toml file.
    #[arg(long, default_value = "base")]
    pub condition: String,
    /// MJCF file: the scene with its objects at rest, in convex pieces, and the robot with a drive on each joint.
    #[arg(long, value_name = "FILE", default_value = "runs/scene.xml")]
    pub mjcf: PathBuf,
    /// The hand alone, as a heavy free body, in place of the whole robot.
    #[arg(long)]
    pub hand: bool,
}

/// `grip convert`.
#[derive(Debug, Args)]
pub struct ConvertArgs {
    /// A recording at level full: the folder record/ of a run, the run's folder, or a folder in records/ of an experiment.
    #[arg(value_name = "RECORDING")]
    pub recording: PathBuf,
    /// The MCAP file (docs/mcap.md); an earlier one is replaced.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
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
    /// Picture for people: each object from two sides with outlines of the gripper, coloured by the share of the pads that touches.
    #[arg(long, value_name = "FILE.png")]
    pub preview: Option<PathBuf>,
    /// Folder of scanned objects (official YCB layout, or a BOP `models` folder) [env: GRIP_YCB_DIR].
    #[arg(long, value_name = "DIR")]
    pub ycb: Option<PathBuf>,
    #[command(flatten)]
    pub tables: ObjectTables,
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
    /// Check the robot in a scene: named poses for collisions, and the share of grasps and places that it reaches; ends with 1 where
    /// something does not fit.
    #[arg(long)]
    pub check: bool,
    /// Draw its named poses, from the front and from the side, in a scene: PNG.
    #[arg(long, value_name = "FILE")]
    pub draw: Option<PathBuf>,
    /// The scene for `--check` and `--draw` [default: scenes/grocery.toml].
    #[arg(long, value_name = "SCENE")]
    pub scene: Option<PathBuf>,
    /// Print `[self_collision]` with the pairs of links that may touch, found by sampling, and nothing else.
    #[arg(long, conflicts_with_all = ["check", "draw", "json"])]
    pub find_allowed: bool,
    /// Write a first file for `--robot-config`, guessed from the URDF, to be checked by a person; none may be there.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["check", "draw", "json", "find_allowed", "robot_config"])]
    pub write_config: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// What is kept of what is known of a trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Recorded {
    /// Nothing.
    None,
    /// The events of trials in which not everything was packed.
    Failures,
    /// Looks, plans, attempts, joints and forces over time.
    Events,
    /// And the poses of all bodies, all contacts, what the camera saw, and all of it as an animated scene (glTF).
    Full,
    /// And all of it as one file for Foxglove and Rerun (docs/mcap.md).
    Mcap,
}

impl Recorded {
    /// With so many samples a second.
    pub fn options(self, rate: &RecordRate) -> RecordOptions {
        let level = match self {
            Self::None => Level::None,
            Self::Failures => Level::Failures,
            Self::Events => Level::Events,
            Self::Full => Level::Full,
            Self::Mcap => Level::Mcap,
        };
        RecordOptions { level, rate_hz: f64::from(rate.record_rate) }
    }
}

/// How often a recording looks at what moves.
#[derive(Debug, Clone, Copy, Args)]
pub struct RecordRate {
    /// Samples of a recording a simulated second: joints, forces, poses.
    #[arg(long, value_name = "HZ", default_value_t = RecordOptions::RATE_HZ as u32, value_parser = clap::value_parser!(u32).range(1..=240))]
    pub record_rate: u32,
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
        fn section(page: &mut String, mark: &str, before: &str, verb: &mut clap::Command) {
            let name = format!("{before} {}", verb.get_name());
            let help = verb.render_long_help().to_string();
            let lines: Vec<&str> = help.trim_end().lines().map(str::trim_end).collect();
            *page += &format!("\n{mark} {name}\n\n```text\n{}\n```\n", lines.join("\n"));
            for inner in verb.get_subcommands_mut().filter(|inner| inner.get_name() != "help") {
                section(page, &format!("{mark}#"), &name, inner);
            }
        }
        for verb in command.get_subcommands_mut().filter(|verb| verb.get_name() != "help") {
            section(&mut page, "##", "grip", verb);
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
