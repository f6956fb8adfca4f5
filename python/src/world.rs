//! Scenes, and worlds that go on by steps.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Result, bail};
use grip::settings::Settings;
use grip::setup::{Setup, SetupOptions, load_condition};
use grip_physics::STEP_HZ;
use grip_sim::camera::Intrinsics;
use grip_sim::condition::ConditionSpec;
use grip_sim::render::{self, Renderer, RendererChoice};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::error::{exception, raised};
use crate::estimators::{Estimator, Model};
use crate::frame::Frame;
use crate::process::pooled;

/// A scene with everything that a run depends on: robot, table, bin, objects, light, camera, settings, seed.
#[pyclass(module = "grip", frozen, subclass, name = "Scene")]
pub struct Scene {
    /// With all objects that the scene draws from.
    opened: Arc<Setup>,
    condition: Arc<ConditionSpec>,
    /// With those of the seed.
    setup: Arc<Setup>,
}

impl Scene {
    /// What it is made of.
    pub fn setup(&self) -> Arc<Setup> {
        self.setup.clone()
    }
}

/// Who draws.
pub fn renderer_choice(word: &str) -> Result<RendererChoice> {
    Ok(match word {
        "auto" => RendererChoice::Auto,
        "wgpu" => RendererChoice::Wgpu,
        "cpu" => RendererChoice::Cpu,
        other => bail!("renderer: {other}: give auto, wgpu or cpu"),
    })
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (path, condition, seed, ycb, objects, intrinsics, robot, robot_config, package_path, settings))]
    #[allow(clippy::too_many_arguments, reason = "Python's side names them")]
    fn create(
        py: Python<'_>,
        path: PathBuf,
        condition: String,
        seed: u64,
        ycb: Option<PathBuf>,
        objects: Vec<PathBuf>,
        intrinsics: Option<String>,
        robot: Option<PathBuf>,
        robot_config: Option<PathBuf>,
        package_path: Vec<PathBuf>,
        settings: Option<PathBuf>,
    ) -> PyResult<Self> {
        py.detach(|| {
            let opened = pooled(|| {
                let settings = settings.as_deref().map(Settings::load).transpose()?.unwrap_or_default();
                let intrinsics = intrinsics
                    .map(|text| text.parse::<Intrinsics>())
                    .transpose()
                    .map_err(|why| anyhow::anyhow!("intrinsics: {why}"))?;
                let setup = Setup::open(&SetupOptions {
                    scene: path,
                    condition: condition.clone(),
                    seed,
                    ycb,
                    tables: objects,
                    intrinsics,
                    robot,
                    robot_config,
                    package_path,
                    settings: Arc::new(settings),
                })?;
                let condition = load_condition(&setup.cell.folder, &condition)?;
                let drawn = setup.with_seed(seed, &condition);
                Ok(Self { opened: Arc::new(setup), condition: Arc::new(condition), setup: Arc::new(drawn) })
            });
            opened.map_err(exception)
        })
    }

    /// A physics world in which its objects are at rest; who draws is auto, wgpu or cpu.
    #[pyo3(signature = (renderer = "auto"))]
    fn world(&self, py: Python<'_>, renderer: &str) -> PyResult<World> {
        World::create(py, self, renderer)
    }

    /// One of our own estimators for it: grip, paper or paper-guarded, behind a detector: pyramid, clusters or none.
    #[pyo3(signature = (kind = "grip", *, detector = "pyramid", detector_model = None))]
    fn estimator(
        slf: Py<Self>,
        py: Python<'_>,
        kind: &str,
        detector: &str,
        detector_model: Option<PathBuf>,
    ) -> PyResult<Estimator> {
        Estimator::create(py, slf, kind, detector, detector_model)
    }

    /// The same scene for another seed; no file is read again.
    fn with_seed(&self, py: Python<'_>, seed: u64) -> PyResult<Self> {
        let drawn = py.detach(|| pooled(|| Ok(self.opened.with_seed(seed, &self.condition))));
        let setup = Arc::new(drawn.map_err(exception)?);
        Ok(Self { opened: self.opened.clone(), condition: self.condition.clone(), setup })
    }

    /// The scene's name.
    #[getter]
    fn name(&self) -> &str {
        &self.setup.cell.scene.name
    }

    /// The seed of everything random.
    #[getter]
    fn seed(&self) -> u64 {
        self.setup.seed
    }

    /// The condition's name.
    #[getter]
    fn condition(&self) -> &str {
        &self.setup.condition.name
    }

    /// The names of its objects; of a further one of a kind with a number behind it.
    #[getter]
    fn objects(&self) -> Vec<String> {
        (0..self.setup.models.len()).map(|i| self.setup.name(i)).collect()
    }

    /// Their models, in the same order.
    #[getter]
    fn models(&self) -> Vec<Model> {
        self.setup.models.iter().map(|model| Model::new(model.clone())).collect()
    }

    /// How many of them a trial packs: the first ones.
    #[getter]
    fn packable(&self) -> usize {
        self.setup.packable()
    }

    /// Columns and rows of the camera's pictures.
    #[getter]
    fn resolution(&self) -> (usize, usize) {
        let k = &self.setup.camera.intrinsics;
        (k.width, k.height)
    }

    /// Lowest and highest corner of the space over the table in which objects are, metres.
    #[getter]
    fn workspace(&self) -> ([f64; 3], [f64; 3]) {
        let space = self.setup.cell.workspace();
        (space.min, space.max)
    }

    /// 4 x 4, from the bin's frame (origin in the middle of its floor) to the world's.
    #[getter]
    fn world_from_bin<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::pose(py, &self.setup.cell.scene.bin.world_from_bin())
    }

    /// Sides of the bin's inside, metres.
    #[getter]
    fn bin_inner(&self) -> [f64; 2] {
        self.setup.cell.scene.bin.inner
    }

    /// The names of the robot's joints.
    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.setup.cell.robot.joints().iter().map(|joint| joint.name.clone()).collect()
    }

    fn __repr__(&self) -> String {
        format!("<grip.Scene {}, {}, seed {}>", self.name(), self.condition(), self.seed())
    }
}

/// A physics world with the scene's objects at rest in it, and the camera that looks at them.
#[pyclass(module = "grip", name = "World")]
pub struct World {
    setup: Arc<Setup>,
    world: grip_physics::World,
    /// Of one thread at a time.
    renderer: Mutex<Box<dyn Renderer>>,
    looks: usize,
}

#[pymethods]
impl World {
    /// Lays the objects out from the seed, and lets them come to rest. `renderer`: auto, wgpu or cpu.
    #[new]
    #[pyo3(signature = (scene, renderer = "auto"))]
    fn create(py: Python<'_>, scene: &Scene, renderer: &str) -> PyResult<Self> {
        let setup = scene.setup();
        py.detach(|| {
            let world = pooled(|| {
                let renderer = Mutex::new(render::open(renderer_choice(renderer)?)?);
                let (world, _) = setup.drop_objects()?;
                Ok(Self { setup: setup.clone(), world, renderer, looks: 0 })
            });
            world.map_err(exception)
        })
    }

    /// What the camera sees as everything is now. Each look has noise of its own.
    fn look(&mut self, py: Python<'_>) -> PyResult<Frame> {
        let Self { setup, world, renderer, looks } = self;
        let (world, shot) = (&*world, *looks);
        let renderer = renderer.get_mut().unwrap_or_else(PoisonError::into_inner).as_mut();
        let (frame, _) = py.detach(|| pooled(|| setup.capture(world, renderer, shot))).map_err(exception)?;
        *looks += 1;
        Ok(Frame::new(py, frame))
    }

    /// Lets `seconds` go by, to the nearest step of 1/240 s, while the robot stays as it is.
    fn step(&mut self, seconds: f64) -> PyResult<()> {
        raised(|| {
            anyhow::ensure!(
                seconds.is_finite() && seconds >= 0.0,
                "seconds: {seconds}: must be finite and not negative"
            );
            let (target, grip) = self.world.hold();
            for _ in 0..(seconds * f64::from(STEP_HZ)).round() as u64 {
                self.world.step(&target, grip);
            }
            Ok(())
        })
    }

    /// Simulated seconds since the objects were at rest.
    #[getter]
    fn time(&self) -> f64 {
        self.world.time()
    }

    /// Where the robot's joints are, radians or metres.
    #[getter]
    fn joints<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.world.joints())
    }

    /// Where each object really is, 4 x 4, from its frame to the world's: for scores, and not for estimators.
    fn true_poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let poses = PyDict::new(py);
        for i in 0..self.world.object_count() {
            poses.set_item(self.setup.name(i), arrays::pose(py, self.world.truth(i).iso()))?;
        }
        Ok(poses)
    }

    /// A hash of everything that moves: equal for equal states.
    fn state_hash(&self) -> String {
        self.world.state_hash()
    }

    /// Who draws: wgpu or cpu.
    #[getter]
    fn renderer(&self) -> &'static str {
        self.renderer.lock().unwrap_or_else(PoisonError::into_inner).name()
    }

    fn __repr__(&self) -> String {
        format!(
            "<grip.World of {}, {} objects, {:.2} s>",
            self.setup.cell.scene.name,
            self.world.object_count(),
            self.time()
        )
    }
}
