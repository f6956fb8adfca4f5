//! Everything that a run depends on, read and checked: cell, objects, condition, camera, settings, seed.

mod camera;
mod miscalibration;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result};
use grip_manip::Planner;
use grip_manip::grasp::GraspSet;
use grip_perception::HypothesisRenderer;
use grip_physics::{Accept, Dropped, World, drop_objects};
use grip_sim::camera::Intrinsics;
use grip_sim::condition::{Condition, ConditionSpec};
use grip_sim::frame::CameraFrame;
use grip_sim::objects::{ObjectLibrary, ObjectModel, resolve_set};
use grip_sim::pose::{Camera, Pose, World as WorldFrame};
use grip_sim::render::{Lighting, Renderer, Rendering};
use grip_sim::rng;
use grip_sim::scene::IntrinsicsChoice;
use rayon::prelude::*;

pub use self::camera::HeadCamera;
pub use self::miscalibration::{CalibrationRecord, Miscalibration};
use crate::assets;
use crate::cell::Cell;
use crate::score::outcome::instance_name;
use crate::settings::Settings;

/// The scene of packing trials.
pub const GROCERY: &str = "scenes/grocery.toml";
/// The scene of the paper's adversarial data set.
pub const ADVERSARIAL: &str = "scenes/adversarial.toml";

/// What a [`Setup`] is made of. The default is the grocery scene in base light, with the built-in robot and objects.
#[derive(Debug, Clone)]
pub struct SetupOptions {
    /// Scene file; where there is none of that name the one that is built in, such as `scenes/shelf.toml`.
    pub scene: PathBuf,
    /// Condition by name, from the folder `conditions` beside the scene file, or a path to a .toml file.
    pub condition: String,
    /// Seed of everything random in the run.
    pub seed: u64,
    /// Folder of scanned objects; where none is given, `GRIP_YCB_DIR`; where that is not set, the built-in ones.
    pub ycb: Option<PathBuf>,
    /// Tables of objects beside those of the scene: [`grip_sim::objects::table`].
    pub tables: Vec<PathBuf>,
    /// Another camera than the scene's.
    pub intrinsics: Option<Intrinsics>,
    /// Another URDF of the robot than the scene's.
    pub robot: Option<PathBuf>,
    /// Other settings of the robot than the scene's.
    pub robot_config: Option<PathBuf>,
    /// Where `package://` meshes are looked up.
    pub package_path: Vec<PathBuf>,
    /// Settings of everything.
    pub settings: Arc<Settings>,
}

impl Default for SetupOptions {
    fn default() -> Self {
        Self {
            scene: assets::find(GROCERY),
            condition: "base".into(),
            seed: 1,
            ycb: None,
            tables: Vec::new(),
            intrinsics: None,
            robot: None,
            robot_config: None,
            package_path: Vec::new(),
            settings: Arc::default(),
        }
    }
}

/// A resolved run: nothing in it depends on the command line or the file system any more.
#[derive(Clone)]
pub struct Setup {
    /// Table, bin and robot.
    pub cell: Cell,
    /// The head camera.
    pub camera: HeadCamera,
    /// Light and how objects are placed, as drawn for this run.
    pub condition: Condition,
    /// Where the robot is not what it believes, as drawn for this run.
    pub miscalibration: Miscalibration,
    /// All objects there are.
    pub library: Arc<ObjectLibrary>,
    /// The scene's objects, in its order.
    pub models: Vec<Arc<ObjectModel>>,
    /// Of everything random.
    pub seed: u64,
    /// Of everything.
    pub settings: Arc<Settings>,
    /// Who renders pose hypotheses: the CPU, unless it is set to another.
    pub hypotheses: HypothesisRenderer,
}

impl Setup {
    /// Reads all files that `options` name, and draws the run's objects and light from the seed.
    ///
    /// # Errors
    /// When a file is missing or wrong; names file, field, value and what to try.
    pub fn load(options: &SetupOptions) -> Result<Self> {
        let mut setup = Self::open(options)?;
        setup.draw();
        Ok(setup)
    }

    /// The same with all objects of the scene, for many runs ([`Setup::with_seed`]).
    ///
    /// # Errors
    /// As [`Setup::load`].
    pub fn open(options: &SetupOptions) -> Result<Self> {
        Self::read(options, true)
    }

    /// The same without any of the scene's objects, for one who puts others there: to make their models takes a third of a second.
    ///
    /// # Errors
    /// As [`Setup::load`]; the scene's objects must be known.
    pub fn open_bare(options: &SetupOptions) -> Result<Self> {
        Self::read(options, false)
    }

    fn read(options: &SetupOptions, with_models: bool) -> Result<Self> {
        let SetupOptions { scene, seed, settings, .. } = options;
        let path = &assets::named(scene);
        let [urdf, config] = [&options.robot, &options.robot_config].map(Option::as_deref);
        let cell = Cell::load(path, urdf, config, &options.package_path)?;
        let settings = Arc::new(Settings::clone(settings).for_robot(&cell.config));
        let condition = load_condition(&cell.folder, &options.condition)?;
        let of_scene = cell.scene.objects.tables.iter().map(|table| cell.folder.join(table));
        let tables: Vec<PathBuf> = of_scene.chain(options.tables.iter().cloned()).collect();
        let library = open_library(options.ycb.clone(), &cell.folder, &tables)?;
        let models = cell
            .scene
            .objects
            .names
            .par_iter()
            .map(|name| {
                let model =
                    if with_models { library.load(name).map(Some) } else { library.info(name).map(|_| None) };
                model.with_context(|| format!("{}: objects.names", path.display()))
            })
            .filter_map(Result::transpose)
            .collect::<Result<Vec<_>>>()?;
        let intrinsics = match (options.intrinsics, &cell.scene.camera.intrinsics) {
            (Some(given), _) => Ok(given),
            (None, Some(IntrinsicsChoice::Numbers(given))) => Ok(*given),
            (None, Some(IntrinsicsChoice::Named(file))) if Intrinsics::is_file(file) => {
                Intrinsics::load(&cell.folder.join(file))
            }
            (None, Some(IntrinsicsChoice::Named(name))) => cell.config.intrinsics(&cell.robot, Some(name)),
            (None, None) => cell.config.intrinsics(&cell.robot, None),
        };
        let intrinsics = intrinsics.with_context(|| format!("{}: camera.intrinsics", path.display()))?;
        let camera = HeadCamera::new(&cell.scene, intrinsics, &settings.sensor, *seed)
            .with_context(|| format!("{}: camera.depth_noise", path.display()))?;
        Ok(Self {
            cell,
            camera,
            condition: condition.draw(&mut rng::stream(*seed, "condition")),
            miscalibration: Miscalibration::default(),
            library: Arc::new(library),
            models,
            seed: *seed,
            settings,
            hypotheses: HypothesisRenderer::Cpu,
        })
    }

    /// What [`Setup::load`] gives for another seed and condition, from a setup that [`Setup::open`] has read.
    pub fn with_seed(&self, seed: u64, condition: &ConditionSpec) -> Self {
        let mut setup = Self {
            condition: condition.clone().draw(&mut rng::stream(seed, "condition")),
            seed,
            camera: self.camera.with_seed(&self.cell.scene, seed),
            ..self.clone()
        };
        setup.draw();
        setup
    }

    /// Chooses the run's objects from the scene's, and where the robot stands.
    fn draw(&mut self) {
        self.cell.draw(self.seed);
        self.miscalibration = Miscalibration::draw(&self.cell, &self.condition, self.seed);
        let objects = &mut self.cell.scene.objects;
        let drawn = objects.draw(self.seed);
        self.models = drawn.iter().map(|&i| self.models[i].clone()).collect();
        objects.names = drawn.iter().map(|&i| objects.names[i].clone()).collect();
        objects.count = None;
    }

    /// How many objects a trial may pack, the first ones: all but those that are frozen.
    pub fn packable(&self) -> usize {
        let frozen = self.cell.scene.objects.placed.iter().filter(|placed| placed.frozen);
        self.models.len() - frozen.count().min(self.models.len())
    }

    /// The physics world without objects, the robot's joints at `q`.
    ///
    /// # Errors
    /// When the world cannot be built.
    pub fn empty_world(&self, q: Vec<f64>) -> grip_physics::Result<World> {
        let Cell { scene, robot, config, .. } = &self.cell;
        World::new(scene, robot.clone(), config, q, &self.settings.physics)
    }

    /// Lays the objects out from the seed and settles them.
    ///
    /// # Errors
    /// When they find no room, or the world cannot be built.
    pub fn drop_objects(&self) -> Result<(World, Dropped)> {
        // Where its encoders say that it is at the start.
        let fresh = || self.empty_world(self.miscalibration.actual(&self.cell.start));
        Ok(drop_objects(
            &self.cell.scene,
            &self.true_models(),
            self.condition.placement,
            &self.settings.physics.placement,
            self.seed,
            Accept::ALL,
            fresh,
        )?)
    }

    /// The scene's objects as they are, whatever the table of objects says and the robot believes.
    fn true_models(&self) -> Vec<Arc<ObjectModel>> {
        let Some(objects) = self.condition.objects else { return self.models.clone() };
        let mut random = rng::stream(self.seed, "objects");
        let other = |model: &Arc<ObjectModel>| {
            let [mass, friction] = objects.draw(&mut random);
            let mut model = (**model).clone();
            model.info.mass_kg *= mass;
            model.info.friction *= friction;
            Arc::new(model)
        };
        self.models.iter().map(other).collect()
    }

    /// Where the robot believes its joints to be.
    pub fn measured_joints(&self, world: &World) -> Vec<f64> {
        self.miscalibration.measured(world.joints())
    }

    /// Where the camera is; not for perception.
    pub fn true_camera(&self, world: &World) -> Pose<WorldFrame, Camera> {
        self.cell.world_from_camera(world.joints()) * self.miscalibration.camera
    }

    /// Takes a picture with the head camera as the robot stands. `shot` numbers the pictures of a run, so that each has
    /// noise of its own.
    ///
    /// # Errors
    /// When the renderer fails.
    pub fn capture(
        &self,
        world: &World,
        renderer: &mut dyn Renderer,
        shot: usize,
    ) -> Result<(CameraFrame, Rendering)> {
        self.capture_in(&self.condition, world, renderer, shot)
    }

    /// The same, by one who looks at depth alone: its picture is black, since light costs most of the work, but where the depth camera
    /// needs it.
    pub(crate) fn capture_depth(
        &self,
        world: &World,
        renderer: &mut dyn Renderer,
        shot: usize,
    ) -> Result<CameraFrame> {
        let mut condition = self.condition.clone();
        if !self.camera.sensors.depth.needs_light() {
            condition.lighting = Lighting::default();
        }
        Ok(self.capture_in(&condition, world, renderer, shot)?.0)
    }

    fn capture_in(
        &self,
        condition: &Condition,
        world: &World,
        renderer: &mut dyn Renderer,
        shot: usize,
    ) -> Result<(CameraFrame, Rendering)> {
        let (mut frame, rendering) =
            self.camera.capture(world, &self.true_camera(world), condition, renderer, shot)?;
        let scale = self.miscalibration.depth_scale;
        if scale != 1.0 {
            frame.depth.data_mut().iter_mut().for_each(|z| *z *= scale as f32);
        }
        // What the robot knows of it is by its joints' encoders.
        frame.world_from_camera = self.cell.world_from_camera(&self.measured_joints(world));
        Ok((frame, rendering))
    }

    /// What to call the models of the scene's objects in outputs, such as `built-in`.
    pub fn object_set(&self) -> String {
        self.library.label(&self.models)
    }

    /// The name of object `i`; of a further one of its kind with a number behind it.
    pub fn name(&self, i: usize) -> String {
        let name = &self.models[i].info.name;
        let before = self.models[..i].iter().filter(|other| other.info.name == *name).count();
        instance_name(name, 1 + before as u32)
    }

    /// The seed of the consumer `name` in this run.
    pub fn stream(&self, name: &str) -> u64 {
        rng::seed(self.seed, name)
    }

    /// The planner for this robot.
    pub fn planner(&self) -> Planner {
        let Cell { robot, config, .. } = &self.cell;
        Planner::new(robot.clone(), config.clone(), self.settings.planner.clone())
    }

    /// The same, with the grasps of each object in the scene from the files in `folder`.
    ///
    /// # Errors
    /// When a file is missing or wrong.
    pub fn planner_with_grasps(&self, folder: Option<&Path>) -> Result<Planner> {
        let planner = self.planner();
        let Some(folder) = folder else { return Ok(planner) };
        for model in &self.models {
            let file = folder.join(GraspSet::file_name(&model.info.name));
            let [held, all] = planner.use_grasps(model, &file)?;
            log::info!("{}: {held} of {all} grasps hold the object", file.display());
        }
        Ok(planner)
    }
}

/// `objects.toml` in `folder`, else the project's own, and further tables.
fn open_library(ycb: Option<PathBuf>, folder: &Path, tables: &[PathBuf]) -> Result<ObjectLibrary> {
    let beside = folder.join("objects.toml");
    let table = if grip_sim::files::exists(&beside) { beside } else { assets::find("scenes/objects.toml") };
    Ok(ObjectLibrary::with_tables(&table, tables, resolve_set(ycb))?)
}

/// The object library without a scene: the project's table and further ones.
///
/// # Errors
/// When a table of objects, or the folder of scanned ones, is wrong.
pub fn library(ycb: Option<PathBuf>, tables: &[PathBuf]) -> Result<ObjectLibrary> {
    Ok(ObjectLibrary::with_tables(&assets::find("scenes/objects.toml"), tables, resolve_set(ycb))?)
}

/// A path to a file, or a name in the folder `conditions` beside the scene, else in the project's own.
///
/// # Errors
/// When there is no such condition, or its file is wrong.
pub fn load_condition(folder: &Path, name: &str) -> Result<ConditionSpec> {
    if name.ends_with(".toml") {
        return Ok(ConditionSpec::load(Path::new(name))?);
    }
    let beside = folder.join("conditions");
    let conditions =
        if grip_sim::files::exists(&beside) { beside } else { assets::find("scenes/conditions") };
    Ok(ConditionSpec::load_named(&conditions, name)?)
}
