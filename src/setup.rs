//! Everything that a command line names, read and checked: scene, robot, objects, condition, renderer.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result};
use grip_manip::grasp_set::file_name;
use grip_manip::{BeliefScene, BinGeometry, GraspAt, Planner, PlannerSettings};
use grip_perception::{
    ClusterSettings, Clusters, Detection, Detections, Detector, GripEstimator, GripSettings,
    HypothesisRenderer, Providers, PyramidCnn, WholeImage, Workspace,
};
use grip_sim::camera::Intrinsics;
use grip_sim::condition::{Condition, ConditionSpec};
use grip_sim::frame::CameraFrame;
use grip_sim::images::LabelImage;
use grip_sim::objects::{ObjectLibrary, ObjectModel, resolve_set};
use grip_sim::physics::{Accept, Dropped, World, drop_objects};
use grip_sim::pose::{Camera, Object, Pose, World as WorldFrame};
use grip_sim::render::{self, Bounce, Furniture, Instance, RenderScene, Renderer, Rendering};
use grip_sim::robot::{RobotConfig, RobotModel};
use grip_sim::scene::Scene;
use grip_sim::sensor::{self, depth::DepthNoise};
use nalgebra::Point3;
use rand::RngExt;
use rayon::prelude::*;

use crate::assets;
use crate::cli::{self, DetectorArgs, RobotFile, SceneArgs};

/// A resolved scene: nothing in it depends on the command line or the file system any more.
#[derive(Clone)]
pub struct Setup {
    pub scene: Scene,
    pub condition: Condition,
    pub robot: Arc<RobotModel>,
    pub config: Arc<RobotConfig>,
    pub library: Arc<ObjectLibrary>,
    /// The scene's objects, in its order.
    pub models: Vec<Arc<ObjectModel>>,
    pub intrinsics: Intrinsics,
    pub depth_noise: DepthNoise,
    /// Start configuration: the scene's pose and torso, the head looking at the scene's point.
    pub start: Vec<f64>,
    pub seed: u64,
    /// Who renders pose hypotheses: the CPU, unless it is set to another.
    pub hypotheses: HypothesisRenderer,
    /// The folder of the scene file.
    pub folder: PathBuf,
    furniture: Furniture,
}

impl RobotFile {
    /// The URDF's path and the robot in it.
    pub fn load(&self) -> Result<(PathBuf, RobotModel)> {
        let urdf = match &self.robot {
            Some(path) => path.clone(),
            None => assets::find("robots/fetch/fetch.urdf")?,
        };
        let robot = RobotModel::load(&urdf, &self.package_path)?;
        Ok((urdf, robot))
    }
}

impl Setup {
    /// Reads all files that `args` names, and draws the run's objects and light from the seed.
    pub fn load(args: &SceneArgs, condition: &str) -> Result<Self> {
        let mut setup = Self::open(args, "scenes/grocery.toml", condition)?;
        setup.draw_objects();
        Ok(setup)
    }

    /// What [`Setup::load`] gives for another seed and condition, from a setup that [`Setup::open`] has read.
    pub fn with_seed(&self, seed: u64, condition: &ConditionSpec) -> Self {
        let mut setup = Self {
            condition: condition.clone().draw(&mut grip_sim::rng::stream(seed, "condition")),
            seed,
            furniture: render::furniture(&self.scene.fixtures(), self.scene.surroundings, seed),
            ..self.clone()
        };
        setup.draw_objects();
        setup
    }

    /// Chooses the run's objects from the scene's.
    fn draw_objects(&mut self) {
        let drawn = self.scene.objects.draw(self.seed);
        self.models = drawn.iter().map(|&i| self.models[i].clone()).collect();
        self.scene.objects.names = drawn.iter().map(|&i| self.scene.objects.names[i].clone()).collect();
        self.scene.objects.count = None;
    }

    /// Reads all files that `args` names, with all objects of the scene, which is `default` where none is named.
    pub fn open(args: &SceneArgs, default: &str, condition: &str) -> Result<Self> {
        let path = match &args.scene {
            Some(path) => path.clone(),
            None => assets::find(default)?,
        };
        let scene = Scene::load(&path)?;
        let folder = path.parent().unwrap_or(Path::new("."));
        let condition =
            load_condition(folder, condition)?.draw(&mut grip_sim::rng::stream(args.seed, "condition"));
        let urdf = args.robot.clone().unwrap_or_else(|| folder.join(&scene.robot.urdf));
        let robot = Arc::new(RobotModel::load(&urdf, &args.package_path)?);
        let config = Arc::new(RobotConfig::load(&folder.join(&scene.robot.config), &robot)?);
        let library = open_library(args.ycb.clone(), folder)?;
        let models = scene
            .objects
            .names
            .par_iter()
            .map(|name| library.load(name).with_context(|| format!("{}: objects.names", path.display())))
            .collect::<Result<Vec<_>>>()?;
        let depth_noise = DepthNoise::from_name(&scene.camera.depth_noise)
            .with_context(|| format!("{}: camera.depth_noise", path.display()))?;
        let start = start_configuration(&scene, &robot, &config)
            .with_context(|| format!("{}: [robot]", path.display()))?;
        let furniture = render::furniture(&scene.fixtures(), scene.surroundings, args.seed);
        Ok(Self {
            intrinsics: scene.camera.intrinsics.intrinsics(),
            scene,
            condition,
            robot,
            config,
            library: Arc::new(library),
            models,
            depth_noise,
            start,
            seed: args.seed,
            hypotheses: HypothesisRenderer::Cpu,
            folder: folder.to_path_buf(),
            furniture,
        })
    }

    /// Lays the objects out from the seed and settles them.
    pub fn drop_objects(&self) -> Result<(World, Dropped)> {
        let fresh = || World::new(&self.scene, self.robot.clone(), &self.config, self.start.clone());
        Ok(drop_objects(&self.scene, &self.models, self.condition.placement, self.seed, Accept::ALL, fresh)?)
    }

    /// Takes a picture with the head camera as the robot stands. `shot` numbers the pictures of a run, so that each has
    /// noise of its own.
    pub fn capture(
        &self,
        world: &World,
        renderer: &mut dyn Renderer,
        shot: usize,
    ) -> Result<(CameraFrame, Rendering)> {
        let view = self.view(world);
        let mut random = grip_sim::rng::stream(self.seed, &format!("sensor/{shot}"));
        Ok(sensor::capture(
            renderer,
            &view,
            &self.condition,
            &self.intrinsics,
            &self.world_from_camera(world),
            &self.depth_noise,
            &mut random,
        )?)
    }

    /// Everything there is to see, as it stands now.
    pub fn view(&self, world: &World) -> RenderScene {
        let mut view = world.render_scene(&self.furniture.drawn);
        view.bounce = Some(Bounce::of(&self.scene.table, self.furniture.table_albedo));
        view
    }

    /// Labels of objects drawn alone at believed poses, as the camera of `frame` would see them.
    pub fn render_believed(
        &self,
        renderer: &mut dyn Renderer,
        frame: &CameraFrame,
        believed: impl Iterator<Item = (usize, Pose<WorldFrame, Object>)>,
    ) -> Result<LabelImage> {
        let instances = believed
            .map(|(i, pose)| Instance {
                visual: self.models[i].visual.clone(),
                pose: *pose.iso(),
                label: i as u16 + 1,
            })
            .collect();
        let scene = RenderScene { instances, bounce: None };
        let rendering =
            renderer.render(&scene, &self.condition.lighting, &frame.intrinsics, &frame.world_from_camera)?;
        Ok(rendering.labels)
    }

    /// The seed of the consumer `name` in this run.
    pub fn stream(&self, name: &str) -> u64 {
        grip_sim::rng::stream(self.seed, name).random()
    }

    /// What the robot knows of its cell before it looks: table, bin and where it stands. No objects.
    pub fn empty_belief(&self) -> BeliefScene {
        let bin = &self.scene.bin;
        BeliefScene {
            fixtures: self.scene.fixtures().into_iter().map(|f| f.shape).collect(),
            table_height: self.scene.table.height,
            bin: BinGeometry {
                world_from_bin: Pose::new(bin.world_from_bin()),
                inner: bin.inner,
                wall_height: bin.wall_height,
            },
            objects: Vec::new(),
            seen: Vec::new(),
            world_from_base: self.scene.world_from_base(),
        }
    }

    /// Where objects may lie, from the map of the cell: the largest rectangle of the table beside the bin, from just
    /// below the table's top to 0.4 m above it.
    pub fn workspace(&self) -> Workspace {
        /// Depth smears the bin's edges by about this much, metres.
        const SMEAR_M: f64 = 0.01;
        let table = &self.scene.table;
        let bin = self.scene.bin.outline();
        let (low, high) = (table.low(), table.high());
        let mut best = (low, high);
        if (0..2).all(|a| bin.0[a] < high[a] && bin.1[a] > low[a]) {
            let beside = (0..2).flat_map(|a| {
                let (mut below, mut above) = ((low, high), (low, high));
                below.1[a] = bin.0[a] - SMEAR_M;
                above.0[a] = bin.1[a] + SMEAR_M;
                [below, above]
            });
            let area = |(l, h): &([f64; 2], [f64; 2])| (h[0] - l[0]).max(0.0) * (h[1] - l[1]).max(0.0);
            best = beside.max_by(|a, b| area(a).total_cmp(&area(b))).unwrap_or(best);
        }
        let ([x0, y0], [x1, y1]) = best;
        Workspace { min: [x0, y0, table.height - 0.02], max: [x1, y1, table.height + 0.4] }
    }

    /// The cluster detector over the workspace.
    pub fn clusters(&self) -> Clusters {
        Clusters::new(ClusterSettings { workspace: Some(self.workspace()), ..ClusterSettings::default() })
    }

    /// GRIP's second stage over the workspace.
    pub fn grip(&self) -> Result<GripEstimator> {
        self.grip_over(self.workspace())
    }

    /// GRIP's second stage over the inside of the bin.
    pub fn grip_in_bin(&self) -> Result<GripEstimator> {
        let (low, high) = self.bin_space();
        self.grip_over(Workspace { min: low, max: high })
    }

    fn grip_over(&self, workspace: Workspace) -> Result<GripEstimator> {
        let settings = GripSettings { workspace: Some(workspace), ..GripSettings::default() };
        Ok(GripEstimator::new(settings)?.with_renderer(self.hypotheses.clone()))
    }

    /// The part of the image that shows the inside of the bin, as the one box for each of `models`.
    pub fn bin_detections(&self, frame: &CameraFrame, models: &[Arc<ObjectModel>]) -> Result<Detections> {
        let (low, high) = self.bin_space();
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

    /// The inside of the bin and what may stick out of it, as corners of a box in the world, metres.
    fn bin_space(&self) -> ([f64; 3], [f64; 3]) {
        let bin = &self.scene.bin;
        let (low, high) = bin.outline();
        let walls = bin.wall_thickness;
        (
            [low[0] + walls, low[1] + walls, bin.base_height],
            [high[0] - walls, high[1] - walls, bin.base_height + 0.35],
        )
    }

    /// The detector `kind`, and the network it runs with its fingerprint, if it does.
    pub fn detector(
        &self,
        kind: cli::Detector,
        args: &DetectorArgs,
    ) -> Result<(Box<dyn Detector>, Option<String>)> {
        check_network_is_used(args, kind == cli::Detector::Pyramid, "--detector pyramid")?;
        Ok(match kind {
            cli::Detector::Pyramid => {
                let pyramid = network(args)?;
                let name = pyramid.to_string();
                (Box::new(pyramid), Some(name))
            }
            cli::Detector::Clusters => (Box::new(self.clusters()), None),
            cli::Detector::None => (Box::new(WholeImage), None),
        })
    }

    /// The planner for this robot.
    pub fn planner(&self, grasp_at: GraspAt) -> Planner {
        let mut settings = PlannerSettings::default();
        settings.grasp.at = grasp_at;
        Planner::new(self.robot.clone(), self.config.clone(), settings)
    }

    /// The same, with the grasps of each object in the scene from the files in `folder`.
    pub fn planner_with_grasps(&self, grasp_at: GraspAt, folder: Option<&Path>) -> Result<Planner> {
        let planner = self.planner(grasp_at);
        let Some(folder) = folder else { return Ok(planner) };
        for model in &self.models {
            let file = folder.join(file_name(&model.info.name));
            let [held, all] = planner.use_grasps(model, &file)?;
            log::info!("{}: {held} of {all} grasps hold the object", file.display());
        }
        Ok(planner)
    }

    /// The head camera's pose in the start configuration.
    pub fn head_camera(&self) -> Pose<WorldFrame, Camera> {
        let base_from_camera = self.robot.fk_link(&self.start, self.config.camera.optical_link);
        Pose::new(self.scene.world_from_base().iso() * base_from_camera)
    }

    /// The camera's pose by forward kinematics of the measured joints.
    pub fn world_from_camera(&self, world: &World) -> Pose<WorldFrame, Camera> {
        let base_from_camera = self.robot.fk_link(world.joints(), self.config.camera.optical_link);
        Pose::new(self.scene.world_from_base().iso() * base_from_camera)
    }
}

/// `scenes/objects.toml` beside the scene file, else the project's own.
fn open_library(ycb: Option<PathBuf>, folder: &Path) -> Result<ObjectLibrary> {
    let beside = folder.join("objects.toml");
    let table = if beside.exists() { beside } else { assets::find("scenes/objects.toml")? };
    Ok(ObjectLibrary::open(&table, resolve_set(ycb))?)
}

/// The object library without a scene.
pub fn library(ycb: Option<PathBuf>) -> Result<ObjectLibrary> {
    Ok(ObjectLibrary::open(&assets::find("scenes/objects.toml")?, resolve_set(ycb))?)
}

/// The network of the detector `pyramid`.
pub fn network(args: &DetectorArgs) -> Result<PyramidCnn> {
    let providers = Providers(args.providers.clone());
    Ok(match &args.detector_model {
        Some(path) => PyramidCnn::open(path, &providers)?,
        None => PyramidCnn::built_in(&providers)?,
    })
}

/// Refuses options of the network where another detector is asked for.
pub fn check_network_is_used(args: &DetectorArgs, used: bool, by: &str) -> Result<()> {
    let given = args.detector_model.is_some() || !args.providers.is_empty();
    anyhow::ensure!(used || !given, "--detector-model and --providers are for {by}; leave them out");
    Ok(())
}

/// A path to a file, or a name in the folder `conditions` beside the scene, else in the project's own.
pub fn load_condition(folder: &Path, name: &str) -> Result<ConditionSpec> {
    if name.ends_with(".toml") {
        return Ok(ConditionSpec::load(Path::new(name))?);
    }
    let beside = folder.join("conditions");
    let conditions = if beside.is_dir() { beside } else { assets::find("scenes/conditions")? };
    Ok(ConditionSpec::load_named(&conditions, name)?)
}

fn start_configuration(scene: &Scene, robot: &RobotModel, config: &RobotConfig) -> Result<Vec<f64>> {
    let mut q = config.configuration(robot, &scene.robot.start_pose)?;
    if let Some(torso) = config.arm_with_torso.iter().find(|joint| !config.arm.contains(joint)) {
        let limits = robot.joints()[*torso].limits;
        let height = scene.robot.torso;
        anyhow::ensure!(
            limits.contains(height),
            "torso = {height}: outside the limits of {} ({} to {} m)",
            robot.joints()[*torso].name,
            limits.lower,
            limits.upper
        );
        q[*torso] = height;
    }
    for finger in config.gripper.fingers {
        q[finger] = config.gripper.opening / 2.0;
    }
    let [x, y, z] = scene.robot.look_at;
    let target = scene.world_from_base().inverse().transform_point(&Point3::new(x, y, z));
    Ok(config.look_at(robot, &q, &target))
}
