//! Estimators: ours, asked for a frame at a time, and functions of Python, asked by a trial.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context, Result, bail, ensure};
use grip::estimators::external::Question;
use grip::estimators::external::protocol::{Found, Place, Sample};
use grip::estimators::{Answers, DetectorKind, DetectorOptions, EstimatorFailed, EstimatorKind};
use grip::external::Given;
use grip_perception::PosePosterior;
use grip_sim::objects::ObjectModel;
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use serde_json::{Value, json};

use crate::arrays;
use crate::error::{exception, raised};
use crate::frame::Frame;
use crate::process::pooled;
use crate::world::Scene;

/// What is believed of an object.
#[pyclass(module = "grip", frozen, get_all, name = "Posterior")]
pub struct Posterior {
    /// Position in the scene's list of objects.
    index: usize,
    /// The object's name.
    object: String,
    /// 4 x 4, the pose that explains the frame best: from the object's frame (of its mesh, in metres) to the camera's.
    camera_from_object: Py<PyArray2<f64>>,
    /// How well it does: 1 is perfect, about 0.5 is what an absent object finds by chance.
    score: f64,
    /// Probability-like, 0 to 1: that the object is in view and that this is its pose.
    confidence: f64,
    /// N x 4 x 4, poses that stand for the belief, the best first.
    samples: Py<PyArray3<f64>>,
    /// N, their weights; they sum to 1.
    weights: Py<PyArray1<f64>>,
    /// Wall time, seconds.
    seconds: f64,
}

impl Posterior {
    fn new(py: Python<'_>, index: usize, belief: &PosePosterior) -> Self {
        let weights = belief.particles.iter().map(|(_, weight)| *weight).collect();
        Self {
            index,
            object: belief.object.clone(),
            camera_from_object: arrays::pose(py, belief.best.iso()).unbind(),
            score: belief.score,
            confidence: belief.confidence,
            samples: arrays::poses(py, belief.particles.iter().map(|(pose, _)| pose.iso())).unbind(),
            weights: PyArray1::from_vec(py, weights).unbind(),
            seconds: belief.seconds,
        }
    }
}

#[pymethods]
impl Posterior {
    fn __repr__(&self) -> String {
        format!("<grip.Posterior {}: {}, confidence {:.2}>", self.index, self.object, self.confidence)
    }
}

/// One of our own estimators, for the cell and the objects of a scene.
#[pyclass(module = "grip", frozen, name = "Estimator")]
pub struct Estimator {
    scene: Py<Scene>,
    estimator: grip::estimators::Estimator,
}

#[pymethods]
impl Estimator {
    /// `kind`: grip, paper or paper-guarded. `detector`: pyramid, clusters or none.
    #[new]
    #[pyo3(signature = (scene, kind = "grip", *, detector = "pyramid", detector_model = None))]
    pub fn create(
        py: Python<'_>,
        scene: Py<Scene>,
        kind: &str,
        detector: &str,
        detector_model: Option<PathBuf>,
    ) -> PyResult<Self> {
        let setup = scene.get().setup();
        let estimator = py.detach(|| {
            pooled(|| {
                let kind: EstimatorKind = kind.parse().map_err(|why| anyhow::anyhow!("{kind}: {why}"))?;
                ensure!(
                    kind.second_stage().is_some(),
                    "kind: {}: does not look at single frames; give grip, paper or paper-guarded",
                    kind.name()
                );
                let detector = match detector {
                    "pyramid" => DetectorKind::Pyramid,
                    "clusters" => DetectorKind::Clusters,
                    "none" => DetectorKind::None,
                    other => bail!("detector: {other}: give pyramid, clusters or none"),
                };
                let model =
                    detector_model.map(|path| path.to_string_lossy().parse()).transpose().unwrap_or_default();
                let network = DetectorOptions { model, ..DetectorOptions::default() };
                grip::estimators::Estimator::open(&setup, &kind, detector, &network)
            })
        });
        let estimator = estimator.map_err(exception)?;
        Ok(Self { scene, estimator })
    }

    /// Where the scene's objects are in a frame, those at the positions `objects` or all. `seed` is of everything random in it.
    #[pyo3(signature = (frame, objects = None, *, seed = 1))]
    fn estimate(
        &self,
        py: Python<'_>,
        frame: &Frame,
        objects: Option<Vec<usize>>,
        seed: u64,
    ) -> PyResult<Vec<Posterior>> {
        let frame = raised(|| frame.read(py))?;
        let setup = self.scene.get().setup();
        let asked = objects.unwrap_or_else(|| (0..setup.models.len()).collect());
        let estimates = py.detach(|| {
            pooled(|| {
                if let Some(odd) = asked.iter().find(|i| **i >= setup.models.len()) {
                    bail!("objects: {odd}: the scene has {} objects, numbered from 0", setup.models.len());
                }
                let grip::estimators::Estimator::Perception(perception) = &self.estimator else {
                    bail!("the estimator does not look at frames")
                };
                perception.look_once(&frame, &setup.models, &asked, seed)
            })
        });
        let estimates = estimates.map_err(exception)?;
        Ok(estimates.iter().map(|(index, belief)| Posterior::new(py, *index, belief)).collect())
    }
}

/// An object that is looked for.
#[pyclass(module = "grip", frozen, get_all, name = "Asked")]
pub struct Asked {
    /// Of the object in the trial: an answer names it.
    index: usize,
    /// Its name; several may have the same.
    object: String,
    /// Its number in BOP's data sets.
    obj_id: u32,
    /// Its model.
    model: Py<PyAny>,
}

/// The shape of an object.
#[pyclass(module = "grip", frozen, name = "Model")]
pub struct Model(Arc<ObjectModel>);

impl Model {
    /// As Python sees it.
    pub fn new(model: Arc<ObjectModel>) -> Self {
        Self(model)
    }
}

#[pymethods]
impl Model {
    /// The object's name.
    #[getter]
    fn name(&self) -> &str {
        &self.0.info.name
    }

    /// Its number in BOP's data sets.
    #[getter]
    fn obj_id(&self) -> u32 {
        self.0.info.bop_id
    }

    /// N x 3, float32, metres in the object's frame.
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let numbers: Vec<f32> = self.0.visual.mesh.positions.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
        PyArray1::from_vec(py, numbers).call_method1("reshape", (-1, 3))
    }

    /// N x 3, uint32: the corners of each triangle.
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let numbers: Vec<u32> = self.0.visual.mesh.triangles.iter().flatten().copied().collect();
        PyArray1::from_vec(py, numbers).call_method1("reshape", (-1, 3))
    }

    /// Largest distance of two of its points, metres.
    #[getter]
    fn diameter(&self) -> f64 {
        self.0.diameter
    }
}

/// A function of Python that says where objects are.
struct Function {
    name: String,
    function: Py<PyAny>,
}

impl Answers for Function {
    fn answer(&self, question: &Question<'_>) -> Result<Vec<Found>> {
        Python::attach(|py| {
            let asked = asked(py, question)?;
            let look = PyDict::new(py);
            look.set_item(
                "frame",
                Frame::copy(py, question.frame, question.world_from_camera.as_ref()).into_pyobject(py)?,
            )?;
            look.set_item("objects", asked)?;
            look.set_item("number", question.look)?;
            look.set_item("seed", question.seed)?;
            look.set_item(
                "place",
                match question.place {
                    Place::Table => "table",
                    Place::Bin => "bin",
                    Place::Image => "image",
                },
            )?;
            let space = question.space.map(|space| (space.min, space.max));
            look.set_item("space", space)?;
            let boxes: Vec<(u32, [f64; 4], f64)> =
                question.boxes.iter().map(|b| (b.obj_id, b.bbox, b.score)).collect();
            look.set_item("boxes", boxes)?;
            // The class of a look stands on Python's side, where its documentation is.
            let look = py.import("grip")?.getattr("Look")?.call((), Some(&look))?;
            match self.function.bind(py).call1((look,)) {
                Ok(said) => found(&said).map_err(|why| self.failed(format!("{why:#}"))),
                Err(error) => Err(self.raised(py, error)),
            }
        })
    }

    fn name(&self) -> String {
        self.name.clone()
    }

    fn description(&self) -> Value {
        json!({ "name": "python", "function": self.name })
    }
}

impl Function {
    fn failed(&self, why: String) -> anyhow::Error {
        EstimatorFailed(format!("{}: {why}", self.name)).into()
    }

    /// What a function raises ends its trial, and is told; Ctrl-C ends everything.
    fn raised(&self, py: Python<'_>, error: PyErr) -> anyhow::Error {
        if !error.is_instance_of::<pyo3::exceptions::PyException>(py) {
            return error.into();
        }
        let told = self.failed(error.to_string());
        error.display(py);
        told
    }
}

fn asked<'py>(py: Python<'py>, question: &Question<'_>) -> PyResult<Bound<'py, PyTuple>> {
    let of = |&index: &usize| {
        let model = &question.models[index];
        let info = &model.info;
        let asked = Asked {
            index,
            object: info.name.clone(),
            obj_id: info.bop_id,
            model: Model(model.clone()).into_pyobject(py)?.into_any().unbind(),
        };
        asked.into_pyobject(py)
    };
    PyTuple::new(py, question.asked.iter().map(of).collect::<PyResult<Vec<_>>>()?)
}

/// What a function has said: a dictionary from an object's index to its pose, or a list of `grip.Pose`.
fn found(said: &Bound<'_, PyAny>) -> Result<Vec<Found>> {
    if let Ok(by_index) = said.cast::<PyDict>() {
        return by_index
            .iter()
            .map(|(index, pose)| {
                let index: usize =
                    index.extract().with_context(|| format!("{index}: keys are indices of objects"))?;
                let (rotation, translation) = arrays::read_pose(&pose, &format!("pose of object {index}"))?;
                Ok(Found { index, rotation, translation, score: 1.0, confidence: 1.0, samples: Vec::new() })
            })
            .collect();
    }
    let wanted = "give a dictionary from indices to 4 x 4 matrices, or a list of grip.Pose";
    let items = said.try_iter().ok().with_context(|| format!("it returned {}: {wanted}", said.get_type()))?;
    items.enumerate().map(|(k, item)| one(&item?, k, wanted)).collect()
}

fn one(item: &Bound<'_, PyAny>, k: usize, wanted: &str) -> Result<Found> {
    let field = |name: &str| {
        item.getattr(name).ok().with_context(|| format!("[{k}] is {}: {wanted}", item.get_type()))
    };
    let number = |name: &str| -> Result<f64> {
        field(name)?.extract().map_err(|error: PyErr| anyhow::anyhow!("[{k}].{name}: {error}"))
    };
    let index = field("index")?.extract().map_err(|error: PyErr| anyhow::anyhow!("[{k}].index: {error}"))?;
    let (rotation, translation) =
        arrays::read_pose(&field("camera_from_object")?, &format!("[{k}].camera_from_object"))?;
    let samples = field("samples")?;
    let mut all = Vec::new();
    if !samples.is_none() {
        let weights = field("weights")?;
        let weights: Option<Vec<f64>> =
            weights.extract().map_err(|error: PyErr| anyhow::anyhow!("[{k}].weights: {error}"))?;
        for (s, pose) in samples.try_iter()?.enumerate() {
            let (rotation, translation) = arrays::read_pose(&pose?, &format!("[{k}].samples[{s}]"))?;
            let weight = match &weights {
                Some(weights) => {
                    *weights.get(s).with_context(|| format!("[{k}].weights: has no number for sample {s}"))?
                }
                None => 1.0,
            };
            all.push(Sample { rotation, translation, weight });
        }
        if let Some(weights) = weights.filter(|weights| weights.len() != all.len()) {
            bail!("[{k}].weights: has {} numbers for {} samples", weights.len(), all.len());
        }
    }
    Ok(Found {
        index,
        rotation,
        translation,
        score: number("score")?,
        confidence: number("confidence")?,
        samples: all,
    })
}

/// An estimator as Python names it: a word of the command line, or a pair of a name and a function.
pub fn kind(value: &Bound<'_, PyAny>) -> Result<EstimatorKind> {
    if let Ok(word) = value.extract::<String>() {
        return word.parse().map_err(|why| anyhow::anyhow!("estimator {word}: {why}"));
    }
    let (name, function) = named(value, "estimator")?;
    Ok(EstimatorKind::Given(Given { who: Arc::new(Function { name: name.clone(), function }), name }))
}

/// A pair of a name and a function.
pub fn named(value: &Bound<'_, PyAny>, what: &str) -> Result<(String, Py<PyAny>)> {
    let (name, function): (String, Bound<'_, PyAny>) = value
        .extract()
        .map_err(|_| anyhow::anyhow!("{what}: {}: give a text or a function", value.get_type()))?;
    ensure!(function.is_callable(), "{what} {name}: {} cannot be called", function.get_type());
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    ensure!(
        !name.is_empty() && name.chars().all(plain),
        "{what} {name}: a name has letters, digits, - _ and .; give the function another, or a pair (name, function)"
    );
    Ok((name, function.unbind()))
}
