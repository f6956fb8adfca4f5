//! A trial that someone else acts in, a grasp and a place at a time: what `grip.gym` is made of.
//!
//! The trial goes on in a thread of its own, from one action to the next.

use std::fmt;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use grip::estimators::{DetectorKind, DetectorOptions, Estimator, EstimatorKind};
use grip::graspers::{ForeignGrasp, GraspPlanner, GraspQuestion, Grasper, Want};
use grip::progress::Quiet;
use grip::score::outcome::{ItemResult, TrialResult};
use grip::setup::Setup;
use grip::trial::{Trial, TrialOptions};
use grip_manip::Risk;
use grip_manip::place::PlaceWish;
use grip_sim::frame::CameraFrame;
use grip_sim::pose::{Gripper, Object, Pose, World};
use grip_sim::render::{self, RendererChoice};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Value, json};

use crate::arrays;
use crate::error::{exception, raised};
use crate::frame::Frame;
use crate::process::pooled;
use crate::world::{Scene, renderer_choice};

/// How often Ctrl-C is looked for.
const LISTEN_EVERY: Duration = Duration::from_millis(20);

/// What is to be done.
struct Action {
    world_from_gripper: Pose<World, Gripper>,
    width: Option<f64>,
    place: Option<PlaceWish>,
    object: Option<usize>,
}

/// What there is to be known.
enum News {
    /// The robot has looked, and waits.
    Look(Box<Seen>),
    /// The trial has ended.
    End(Box<TrialResult>),
}

struct Seen {
    frame: CameraFrame,
    /// Where objects on the table are believed to be.
    believed: Vec<(usize, Pose<World, Object>, f64)>,
    standing: Vec<ItemResult>,
    /// The object of the last action, if it led to a plan.
    handled: Option<usize>,
}

/// Hands the action to the trial as the grasp of a planner.
#[derive(Default)]
struct Hand(Mutex<Option<Action>>);

impl fmt::Debug for Hand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Hand")
    }
}

impl GraspPlanner for Hand {
    fn wants(&self) -> &[Want] {
        &[]
    }

    fn grasps(&self, question: &GraspQuestion<'_>) -> Result<Vec<ForeignGrasp>> {
        let action = self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
        Ok(action
            .into_iter()
            .map(|Action { world_from_gripper, width, place, object }| ForeignGrasp {
                camera_from_gripper: question.frame.world_from_camera.inverse() * world_from_gripper,
                width,
                score: 1.0,
                index: object,
                place,
            })
            .collect())
    }

    fn description(&self) -> Value {
        json!({ "name": "python", "function": "episode" })
    }
}

/// One trial, from look to look.
#[pyclass(module = "grip", name = "Episode")]
pub struct Episode {
    setup: Arc<Setup>,
    /// None when it has ended, or was left.
    actions: Option<Sender<Option<Action>>>,
    news: Mutex<Receiver<Result<News>>>,
}

struct Plan {
    setup: Arc<Setup>,
    estimator: EstimatorKind,
    renderer: RendererChoice,
    items: Option<usize>,
    steps: usize,
}

/// The trial, from its thread.
fn run(
    plan: &Plan,
    actions: Receiver<Option<Action>>,
    news: &Sender<Result<News>>,
) -> Result<Option<TrialResult>> {
    let setup = &*plan.setup;
    let network = DetectorOptions::default();
    let estimator = Estimator::open(setup, &plan.estimator, DetectorKind::Pyramid, &network)?;
    let (planner, mut renderer) = (setup.planner(), render::open(plan.renderer)?);
    let hand = Arc::new(Hand::default());
    let options = TrialOptions {
        estimator: plan.estimator.name(),
        grasper: Grasper::Other { name: "episode".into(), planner: hand.clone() },
        items: plan.items,
        ..TrialOptions::default()
    };
    let mut trial = Trial::begin(setup, &estimator, &planner, renderer.as_mut(), options, &Quiet)?;
    let mut handled = None;
    for _ in 0..plan.steps {
        if !trial.is_open() {
            break;
        }
        let seen = trial.look()?;
        let world = seen.frame.world_from_camera;
        let believed = seen.estimates.iter().map(|(i, p)| (*i, world * p.best, p.confidence)).collect();
        let look = Seen { frame: seen.frame.clone(), believed, standing: trial.standing(), handled };
        if news.send(Ok(News::Look(Box::new(look)))).is_err() {
            return Ok(None);
        }
        // Nobody is there any more when the environment was reset or closed.
        let Ok(order) = actions.recv() else { return Ok(None) };
        let Some(action) = order else { break };
        let aimed = action.object;
        hand.0.lock().unwrap_or_else(PoisonError::into_inner).replace(action);
        let mut belief = trial.believe(&seen);
        trial.ask_for_grasps(&seen, &mut belief)?;
        handled = match trial.choose(&belief, &seen, Risk::Tolerant) {
            Some(choice) if !choice.aside && aimed.is_none_or(|object| object == choice.object) => {
                let attempt = trial.act(&seen, belief, &choice);
                trial.settle(&attempt);
                Some(choice.object)
            }
            _ => None,
        };
    }
    Ok(Some(trial.finish()?.result))
}

#[pymethods]
impl Episode {
    /// Lays the scene out. `steps`: looks until it ends at the latest.
    #[new]
    #[pyo3(signature = (scene, estimator = "truth", renderer = "auto", items = None, steps = 20))]
    fn create(
        scene: &Scene,
        estimator: &str,
        renderer: &str,
        items: Option<usize>,
        steps: usize,
    ) -> PyResult<Self> {
        raised(|| {
            let mut setup = (*scene.setup()).clone();
            let mut settings = (*setup.settings).clone();
            // Whoever acts does so alone, and as often as the steps allow.
            settings.trial.max_attempts = u32::MAX;
            settings.trial.max_pushes = 0;
            settings.trial.max_put_aside = 0;
            settings.trial.second_look_mass = 0.0;
            setup.settings = Arc::new(settings);
            let estimator =
                estimator.parse().map_err(|why| anyhow::anyhow!("estimator {estimator}: {why}"))?;
            let setup = Arc::new(setup);
            let renderer = renderer_choice(renderer)?;
            let plan = Plan { setup: setup.clone(), estimator, renderer, items, steps };
            let (actions, to_do) = mpsc::channel();
            let (told, news) = mpsc::channel();
            std::thread::Builder::new()
                .name("episode".into())
                .spawn(move || {
                    let end = pooled(|| run(&plan, to_do, &told));
                    let last = end.map(|end| end.map(|result| News::End(Box::new(result)))).transpose();
                    // Nobody may be there to hear it.
                    let _ = last.map(|last| told.send(last));
                })
                .context("no thread can be started")?;
            Ok(Self { setup, actions: Some(actions), news: Mutex::new(news) })
        })
    }

    /// Acts, unless it is the beginning, and looks: `frame` and `believed` (name, index, 4 x 4 from the object to the world,
    /// confidence), `items` so far, `handled` if the action led to a plan; or `result` at the end.
    #[pyo3(signature = (action = None))]
    fn next<'py>(
        &mut self,
        py: Python<'py>,
        action: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        if let Some(action) = action {
            self.order(Some(raised(|| read(action))?))?;
        }
        self.hear(py)
    }

    /// Ends it as it is: everything comes to rest, and is scored.
    fn finish<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.order(None)?;
        self.hear(py)
    }
}

impl Episode {
    fn order(&self, action: Option<Action>) -> PyResult<()> {
        let sent = self.actions.as_ref().map(|actions| actions.send(action));
        match sent {
            Some(Ok(())) => Ok(()),
            _ => raised(|| bail!("the episode has ended; reset the environment")),
        }
    }

    fn hear<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let news = &self.news;
        let heard = loop {
            let wait = || news.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LISTEN_EVERY);
            match py.detach(wait) {
                Ok(heard) => break heard,
                Err(RecvTimeoutError::Timeout) => py.check_signals()?,
                Err(RecvTimeoutError::Disconnected) => {
                    return raised(|| bail!("the episode has ended; reset the environment"));
                }
            }
        };
        let told = PyDict::new(py);
        match heard.map_err(exception)? {
            News::Look(seen) => {
                let Seen { frame, believed, standing, handled } = *seen;
                told.set_item("frame", Frame::new(py, frame).into_pyobject(py)?)?;
                let believed: Vec<_> = believed
                    .into_iter()
                    .map(|(i, pose, sure)| (self.setup.name(i), i, arrays::pose(py, pose.iso()), sure))
                    .collect();
                told.set_item("believed", believed)?;
                told.set_item("items", raised(|| Ok(serde_json::to_string(&standing)?))?)?;
                told.set_item("handled", handled)?;
            }
            News::End(result) => {
                self.actions = None;
                told.set_item("result", raised(|| Ok(serde_json::to_string(&*result)?))?)?;
            }
        }
        Ok(told)
    }
}

/// An action: `grasp`, 4 x 4 from the gripper to the world; `width`, `place` (x, y, heading) and `object` or None.
fn read(action: &Bound<'_, PyDict>) -> Result<Action> {
    let item = |name: &str| action.get_item(name).ok().flatten().filter(|value| !value.is_none());
    let grasp =
        item("grasp").context("grasp: is missing; give a 4 x 4 matrix from the gripper to the world")?;
    let wrong = |name: &str, error: PyErr| anyhow::anyhow!("{name}: {error}");
    let place: Option<[f64; 3]> =
        item("place").map(|place| place.extract().map_err(|e| wrong("place", e))).transpose()?;
    let width: Option<f64> = item("width").map(|w| w.extract().map_err(|e| wrong("width", e))).transpose()?;
    if let Some(width) = width.filter(|width| !(*width > 0.0 && width.is_finite())) {
        bail!("width {width}: must be more than 0, metres");
    }
    if place.is_some_and(|place| place.iter().any(|x| !x.is_finite())) {
        bail!("place: must be finite: x and y in the bin's frame, metres, and a turn, radians");
    }
    Ok(Action {
        world_from_gripper: Pose::new(arrays::read_isometry(&grasp, "grasp")?),
        width,
        place: place.map(|[x, y, heading]| PlaceWish { bin_xy: [x, y], heading: Some(heading) }),
        object: item("object").map(|o| o.extract().map_err(|e| wrong("object", e))).transpose()?,
    })
}
