//! The options of experiments.

use std::path::PathBuf;

use std::str::FromStr;
use std::sync::Arc;

use crate::estimators::EstimatorKind;
use crate::experiment::plan::{Shard, TrialsOptions};
use crate::experiment::sweep::errors::Axis;
use crate::experiment::sweep::{ErrorPattern, SweepOptions};
use crate::graspers::GrasperKind;
use crate::setup::{GROCERY, SetupOptions};
use anyhow::{Context, Result, bail, ensure};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use grip_sim::camera::Intrinsics;

use super::{Detector, DetectorArgs, ObjectTables, RecordRate, Recorded, Renderer, RobotFile, SettingsFile};

/// `grip trials`.
#[derive(Debug, Args)]
pub struct TrialsArgs {
    /// Trials of each scene, condition, estimator and grasp planner: one a seed, from --seed on.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub trials: u32,
    /// The first seed.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Scene files [default: scenes/grocery.toml].
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub scene: Vec<PathBuf>,
    /// Conditions, by name or file, separated by commas.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "base")]
    pub conditions: Vec<String>,
    /// Estimators, separated by commas or each behind an option of its own: grip, paper, paper-guarded,
    /// truth, csv:FILE, cmd:PROGRAM ARGUMENTS, NAME=cmd:PROGRAM ARGUMENTS.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "grip")]
    pub estimators: Vec<EstimatorKind>,
    /// Grasp planners, separated by commas or each behind an option of its own: grip, cmd:PROGRAM ARGUMENTS,
    /// NAME=cmd:PROGRAM ARGUMENTS (docs/graspers.md).
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "grip")]
    pub graspers: Vec<GrasperKind>,
    /// Who proposes boxes.
    #[arg(long, value_enum, default_value_t = Detector::Pyramid)]
    pub detector: Detector,
    #[command(flatten)]
    pub network: DetectorArgs,
    /// Folder of grasps to use instead of those that are found.
    #[arg(long, value_name = "DIR")]
    pub grasps: Option<PathBuf>,
    /// Who draws: `auto` takes wgpu where a graphics adapter exists, else the CPU.
    #[arg(long, value_enum, default_value_t = Renderer::Auto)]
    pub renderer: Renderer,
    /// Folder of scanned objects [env: GRIP_YCB_DIR].
    #[arg(long, value_name = "DIR")]
    pub ycb: Option<PathBuf>,
    #[command(flatten)]
    pub tables: ObjectTables,
    /// Another camera than the scenes': FX,FY,CX,CY,WIDTH,HEIGHT in pixels, a ROS calibration (.yaml), or BOP's camera.json.
    #[arg(long, value_name = "NUMBERS|FILE")]
    pub intrinsics: Option<Intrinsics>,
    #[command(flatten)]
    pub robot: RobotFile,
    #[command(flatten)]
    pub settings: SettingsFile,
    /// Folder of the experiment.
    #[arg(long, value_name = "DIR", default_value = "runs/trials")]
    pub out: PathBuf,
    /// Trials run at the same time [default: one a core]; results do not depend on it.
    #[arg(long, value_name = "J", value_parser = clap::value_parser!(u32).range(1..=256))]
    pub jobs: Option<u32>,
    /// Go on with the experiment in the folder.
    #[arg(long)]
    pub resume: bool,
    /// Run only every N-th seed, beginning with the I-th; `grip merge` puts the shards together.
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Shard>,
    /// What to keep of what is known of each trial, in a folder of its own in records/ (docs/recordings.md).
    #[arg(long, value_enum, value_name = "LEVEL", default_value_t = Recorded::Failures)]
    pub record: Recorded,
    #[command(flatten)]
    pub record_rate: RecordRate,
    /// Print the figures as one JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

/// `grip merge`.
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// Folders of an experiment's shards.
    #[arg(value_name = "DIR", required = true)]
    pub folders: Vec<PathBuf>,
    /// Folder of the whole experiment.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Print the figures as one JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

/// `grip report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Folders that trials, merge, sweep, campaign and pack have made, and figures (SVG) to show with them.
    #[arg(value_name = "DIR|SVG", required = true)]
    pub sources: Vec<PathBuf>,
    /// The page; CSV files get its name.
    #[arg(long, value_name = "FILE", default_value = "runs/report.html")]
    pub out: PathBuf,
}

/// `grip sweep`.
#[derive(Debug, Args)]
pub struct SweepArgs {
    /// Objects by name [default: soup can, meat can, cracker box, mustard, banana, marker].
    #[arg(value_name = "OBJECT")]
    pub objects: Vec<String>,
    /// Directions of the gripper's frame: x approach, y closing, z sideways, and turns about them.
    #[arg(
        long,
        value_parser = PossibleValuesParser::new(Axis::ALL.map(Axis::name)).try_map(|name| Axis::from_str(&name)),
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "x,y,z,roll,pitch,yaw"
    )]
    pub axes: Vec<Axis>,
    /// Largest error in each direction: millimetres and degrees.
    #[arg(long, value_name = "MM,DEG", value_delimiter = ',', num_args = 1, default_value = "40,45")]
    pub range: Vec<f64>,
    /// Errors: along one axis after the other, evenly from end to end, or at random in all six.
    #[arg(long, value_enum, default_value_t = Mode::Axis)]
    pub mode: Mode,
    /// Errors along each axis, or random errors a layout [default: 9, or 20].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=10_000))]
    pub samples: Option<u32>,
    /// Layouts of each object, one a seed: where it stands or lies, and so which grasp is chosen.
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub seeds: u32,
    /// The first seed.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Which grasp is tried.
    #[arg(long, value_enum, default_value_t = Strategy::Planned)]
    pub grasp: Strategy,
    /// Coulomb friction between pads and objects: both get this coefficient in place of their own, the objects against the
    /// table, too. The force that is taken by default follows it.
    #[arg(long, value_name = "MU")]
    pub friction: Option<f64>,
    /// Force of each finger, newtons, in place of what weight and friction need.
    #[arg(long, value_name = "N")]
    pub force: Option<f64>,
    /// Also write what another simulator needs to try the same grasps: MJCF files of hand, table and object (mjcf/OBJECT.xml),
    /// and with each grasp the hand's motion.
    #[arg(long)]
    pub motions: bool,
    /// Scene whose table, region and robot are used [default: scenes/grocery.toml].
    #[arg(long, value_name = "FILE")]
    pub scene: Option<PathBuf>,
    /// Folder of scanned objects [env: GRIP_YCB_DIR].
    #[arg(long, value_name = "DIR")]
    pub ycb: Option<PathBuf>,
    #[command(flatten)]
    pub tables: ObjectTables,
    #[command(flatten)]
    pub robot: RobotFile,
    #[command(flatten)]
    pub settings: SettingsFile,
    /// Folder of the sweep.
    #[arg(long, value_name = "DIR", default_value = "runs/sweep")]
    pub out: PathBuf,
    /// Grasps tried at the same time [default: one a core]; results do not depend on it.
    #[arg(long, value_name = "J", value_parser = clap::value_parser!(u32).range(1..=256))]
    pub jobs: Option<u32>,
    /// Go on with the sweep in the folder.
    #[arg(long)]
    pub resume: bool,
    /// Print the figures as one JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

/// Which grasp is tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Strategy {
    /// The planner's choice at each layout.
    Planned,
    /// One for each object: the planner's choice at its first layout.
    Fixed,
}

impl TrialsArgs {
    /// What the library makes an experiment of.
    pub fn options(&self) -> Result<TrialsOptions> {
        let settings = self.settings.load()?;
        Ok(TrialsOptions {
            trials: self.trials,
            scenes: self.scene.clone(),
            conditions: self.conditions.clone(),
            estimators: self.estimators.clone(),
            graspers: self.graspers.clone(),
            detector: self.detector.into(),
            network: self.network.options(),
            grasps: self.grasps.clone(),
            shard: self.shard,
            record: self.record.options(&self.record_rate),
            setup: SetupOptions {
                seed: self.seed,
                ycb: self.ycb.clone(),
                tables: self.tables.tables.clone(),
                intrinsics: self.intrinsics,
                robot: self.robot.robot.clone(),
                robot_config: self.robot.robot_config.clone(),
                package_path: self.robot.package_path.clone(),
                settings: Arc::new(settings),
                ..SetupOptions::default()
            },
        })
    }
}

impl SweepArgs {
    /// What the library makes a sweep of.
    pub fn options(&self) -> Result<SweepOptions> {
        let [millimetres, degrees] = self.range[..] else {
            bail!("--range: give two numbers, millimetres and degrees, such as 40,45");
        };
        let default = SweepOptions::default();
        let pattern = match self.mode {
            Mode::Axis => ErrorPattern::Axis(self.axes.clone()),
            Mode::Isotropic => {
                ensure!(
                    self.axes == Axis::ALL,
                    "--axes: is for --mode axis; isotropic errors are in all directions"
                );
                ErrorPattern::Isotropic
            }
        };
        Ok(SweepOptions {
            objects: if self.objects.is_empty() { default.objects } else { self.objects.clone() },
            pattern,
            metres: 1e-3 * millimetres,
            radians: degrees.to_radians(),
            samples: self.samples,
            seeds: self.seeds,
            strategy: match self.grasp {
                Strategy::Planned => crate::experiment::sweep::Strategy::Planned,
                Strategy::Fixed => crate::experiment::sweep::Strategy::Fixed,
            },
            friction: self.friction,
            force_n: self.force,
            motions: self.motions,
            setup: SetupOptions {
                scene: self.scene.clone().unwrap_or_else(|| crate::assets::find(GROCERY)),
                seed: self.seed,
                ycb: self.ycb.clone(),
                tables: self.tables.tables.clone(),
                robot: self.robot.robot.clone(),
                robot_config: self.robot.robot_config.clone(),
                package_path: self.robot.package_path.clone(),
                settings: Arc::new(self.settings.load().context("settings of the sweep")?),
                ..SetupOptions::default()
            },
        })
    }
}

/// How errors are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Mode {
    /// One axis after the other.
    Axis,
    /// At random.
    Isotropic,
}
