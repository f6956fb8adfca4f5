//! Functions of Python that plan grasps.

use std::fmt;
use std::sync::Arc;

use anyhow::{Context, Result};
use grip::external::Given;
use grip::graspers::protocol::FoundGrasp;
use grip::graspers::{
    ForeignGrasp, GraspPlanner, GraspQuestion, GrasperFailed, GrasperKind, Target as Believed, Want, checked,
};
use grip_sim::images::LabelImage;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use serde_json::{Value, json};

use crate::arrays;
use crate::estimators::named;
use crate::frame::Frame;

/// A function of Python that says how to grip.
struct Function {
    name: String,
    function: Py<PyAny>,
}

impl fmt::Debug for Function {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Function").field(&self.name).finish()
    }
}

/// An object on the table.
#[pyclass(module = "grip", frozen, get_all)]
pub struct Target {
    /// Position in the trial's list of objects.
    index: usize,
    /// Its number in BOP's data sets.
    obj_id: u32,
    /// Whether it is to be picked.
    wanted: bool,
    /// 4 x 4, where it is believed to be; None where that is not known.
    camera_from_object: Option<Py<PyAny>>,
}

impl Target {
    fn new(py: Python<'_>, target: &Believed) -> Self {
        let Believed { index, obj_id, wanted, pose } = target;
        let camera_from_object = pose.map(|pose| arrays::pose(py, pose.iso()).into_any().unbind());
        Self { index: *index, obj_id: *obj_id, wanted: *wanted, camera_from_object }
    }
}

impl GraspPlanner for Function {
    fn wants(&self) -> &[Want] {
        &[Want::Poses, Want::Segmentation]
    }

    fn grasps(&self, question: &GraspQuestion<'_>) -> Result<Vec<ForeignGrasp>> {
        Python::attach(|py| {
            let scene = PyDict::new(py);
            let frame = Frame::copy(py, question.frame, Some(&question.frame.world_from_camera));
            scene.set_item("frame", frame.into_pyobject(py)?)?;
            let targets = question.targets.iter().map(|target| Target::new(py, target).into_pyobject(py));
            scene.set_item("objects", PyTuple::new(py, targets.collect::<PyResult<Vec<_>>>()?)?)?;
            let labels = question.segmentation.cloned().map(|labels: LabelImage| arrays::plane(py, labels));
            scene.set_item("segmentation", labels)?;
            scene.set_item("number", question.look)?;
            scene.set_item("seed", question.seed)?;
            let scene = py.import("grip")?.getattr("GraspScene")?.call((), Some(&scene))?;
            let said = match self.function.bind(py).call1((scene,)) {
                Ok(said) => said,
                Err(error) if !error.is_instance_of::<pyo3::exceptions::PyException>(py) => {
                    return Err(error.into());
                }
                Err(error) => {
                    let told = self.failed(error.to_string());
                    error.display(py);
                    return Err(told);
                }
            };
            read(&said, question.targets).map_err(|why| self.failed(format!("{why:#}")))
        })
    }

    fn description(&self) -> Value {
        json!({ "name": "python", "function": self.name })
    }
}

impl Function {
    fn failed(&self, why: String) -> anyhow::Error {
        GrasperFailed(format!("{}: {why}", self.name)).into()
    }
}

/// What a function has said: a list of `grip.Grasp`.
fn read(said: &Bound<'_, PyAny>, targets: &[Believed]) -> Result<Vec<ForeignGrasp>> {
    let wanted = "give a list of grip.Grasp";
    let items = said.try_iter().ok().with_context(|| format!("it returned {}: {wanted}", said.get_type()))?;
    items
        .enumerate()
        .map(|(k, item)| {
            let item = item?;
            let found = found(&item, &format!("[{k}]"), wanted)?;
            checked(&found, targets).map_err(|why| anyhow::anyhow!("[{k}]: {why}"))
        })
        .collect()
}

/// A grasp as Python has it.
pub fn found(item: &Bound<'_, PyAny>, at: &str, wanted: &str) -> Result<FoundGrasp> {
    let field = |name: &str| {
        item.getattr(name).ok().with_context(|| format!("{at} is {}: {wanted}", item.get_type()))
    };
    let wrong = |name: &str, error: PyErr| anyhow::anyhow!("{at}.{name}: {error}");
    let pose = field("camera_from_gripper")?;
    let (rotation, translation) = arrays::read_pose(&pose, &format!("{at}.camera_from_gripper"))?;
    Ok(FoundGrasp {
        rotation,
        translation,
        width: field("width")?.extract().map_err(|error| wrong("width", error))?,
        score: field("score")?.extract().map_err(|error| wrong("score", error))?,
        index: field("index")?.extract().map_err(|error| wrong("index", error))?,
    })
}

/// A grasp planner as Python names it: a word of the command line, or a pair of a name and a function.
pub fn kind(value: &Bound<'_, PyAny>) -> Result<GrasperKind> {
    if let Ok(word) = value.extract::<String>() {
        return word.parse().map_err(|why| anyhow::anyhow!("grasper {word}: {why}"));
    }
    let (name, function) = named(value, "grasper")?;
    Ok(GrasperKind::Given(Given { who: Arc::new(Function { name: name.clone(), function }), name }))
}
