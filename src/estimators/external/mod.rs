//! An estimator of others: a program that is handed what the camera saw, a line at a time, and says where the objects are
//! ([docs/estimators.md](../../../docs/estimators.md)); or a function in this process that answers the same questions.

pub mod protocol;
// Their estimators are shell scripts.
#[cfg(test)]
#[cfg(unix)]
mod tests;

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Result;
use grip_perception::{Detections, PosePosterior, Workspace};
use grip_sim::bop;
use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Camera, Object, Pose, World};
use serde_json::{Value, json};

use self::protocol::{Asked, Found, LookRequest, Place, Proposal, Reply, Request};
use super::{Estimates, Look, Perception};
use crate::benchmark::FileBox;
use crate::external::protocol::{Model, View, finite, same_version};
use crate::external::{CommandLine, Dialogue, PROGRAM, Programs, reply};
use crate::setup::Setup;

/// Boxes of an object that are told.
const MOST_BOXES: usize = 100;

/// What an estimator of others did wrong: the end of a trial, and no fault of ours.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EstimatorFailed(pub String);

impl std::fmt::Display for EstimatorFailed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for EstimatorFailed {}

/// An estimator of others. What it says is checked, and then believed.
pub struct External {
    answers: Arc<dyn Answers>,
    /// The spaces over the table and in the bin; none for images of a data set.
    cell: Option<[Workspace; 2]>,
}

/// Someone who says where objects are: a program, or a function in this process.
pub trait Answers: Send + Sync {
    /// Where they are, at most one pose for each that is asked for.
    ///
    /// # Errors
    /// [`EstimatorFailed`] ends the trial and no more; any other error ends everything.
    fn answer(&self, question: &Question<'_>) -> Result<Vec<Found>>;

    /// Who it is, in what is said of its failures.
    fn name(&self) -> String;

    /// For scenario.json: what its estimates depend on.
    fn description(&self) -> Value;
}

/// What is asked.
pub struct Question<'a> {
    /// Where the objects are believed to be.
    pub place: Place,
    /// The trial's seed; in a data set the number of the scene.
    pub seed: u64,
    /// The number of the look in it, from 0 on; in a data set the number of the image.
    pub look: usize,
    /// What the camera saw.
    pub frame: &'a CameraFrame,
    /// Where it was, by the robot's joints; none in a data set that does not say it.
    pub world_from_camera: Option<Pose<World, Camera>>,
    /// The part of the world in which the objects are; none in a data set.
    pub space: Option<Workspace>,
    /// The trial's objects.
    pub models: &'a [Arc<ObjectModel>],
    /// Those that are asked for, positions in `models`.
    pub asked: &'a [usize],
    /// Where a detector says that they are, if there is one.
    pub boxes: Vec<Proposal>,
}

/// What is spoken with an estimator.
struct Estimating;

impl Dialogue for Estimating {
    type Greeting = ();

    fn hello(&self, models: &[Model]) -> serde_json::Result<String> {
        serde_json::to_string(&Request::Hello { protocol: protocol::VERSION, program: PROGRAM, models })
    }

    fn greeted(&self, answer: &str) -> Result<(), String> {
        match reply(answer)? {
            Reply::Hello { protocol, name, version } => {
                same_version(protocol, protocol::VERSION)?;
                log::info!("estimator {name} {version}");
                Ok(())
            }
            Reply::Error { message } => Err(message),
            Reply::Poses { .. } => Err("it said poses before hello".into()),
        }
    }

    fn failed(reason: String) -> anyhow::Error {
        EstimatorFailed(reason).into()
    }
}

impl External {
    /// For the cell of `setup`. A program is started: one that cannot greet is a wrong command, and no outcome of trials.
    ///
    /// # Errors
    /// When it cannot be started, or does not answer the greeting as the protocol has it.
    pub fn open(setup: &Setup, command: &CommandLine) -> Result<Self> {
        let timeout_s = setup.settings.trial.estimator_timeout_s;
        Ok(Self::given(setup, program(command, timeout_s, setup.models.clone())?))
    }

    /// Someone in this process, for the cell of `setup`.
    pub fn given(setup: &Setup, answers: Arc<dyn Answers>) -> Self {
        Self { answers, cell: Some([setup.cell.workspace(), setup.cell.bin_space()]) }
    }

    /// For the images of a data set in which there are `models`; an answer may take `timeout_s`.
    ///
    /// # Errors
    /// As [`External::open`].
    pub fn for_images(command: &CommandLine, timeout_s: f64, models: Vec<Arc<ObjectModel>>) -> Result<Self> {
        Ok(Self::given_for_images(program(command, timeout_s, models)?))
    }

    /// Someone in this process, for the images of a data set.
    pub fn given_for_images(answers: Arc<dyn Answers>) -> Self {
        Self { answers, cell: None }
    }

    /// Where `objects` are in an image of a data set, positions in it, by its number of the scene and its own; `boxes` are where a
    /// detector says that they are.
    ///
    /// # Errors
    /// [`EstimatorFailed`] when the estimator does wrong; others when it cannot be asked.
    pub fn image(
        &self,
        (scene_id, im_id): (u32, u32),
        frame: &CameraFrame,
        world_from_camera: Option<Pose<World, Camera>>,
        boxes: &Detections,
        objects: &[Arc<ObjectModel>],
    ) -> Result<Estimates> {
        let asked: Vec<usize> = (0..objects.len()).collect();
        self.ask(&Question {
            place: Place::Image,
            seed: scene_id.into(),
            look: im_id as usize,
            frame,
            world_from_camera,
            space: None,
            models: objects,
            asked: &asked,
            boxes: proposals(boxes, objects),
        })
    }

    fn estimate(&self, look: &Look<'_>, place: Place) -> Result<Estimates> {
        self.ask(&Question {
            place,
            seed: look.seed,
            look: look.number(),
            frame: look.frame,
            world_from_camera: Some(look.frame.world_from_camera),
            space: self.cell.map(|[table, bin]| if place == Place::Bin { bin } else { table }),
            models: look.models,
            asked: look.asked,
            boxes: Vec::new(),
        })
    }

    fn ask(&self, question: &Question<'_>) -> Result<Estimates> {
        let began = Instant::now();
        let said = self.answers.answer(question)?;
        // Not all of its time is on one object.
        let seconds = began.elapsed().as_secs_f64() / question.asked.len().max(1) as f64;
        let failed = |reason: String| EstimatorFailed(format!("{}: {reason}", self.answers.name()));
        let mut estimates = Estimates::new();
        for found in &said {
            let index = found.index;
            if !question.asked.contains(&index) || estimates.iter().any(|(other, _)| *other == index) {
                let reason = format!("poses: index {index}: give each of the objects asked for at most once");
                return Err(failed(reason).into());
            }
            let posterior = posterior(found, &question.models[index], seconds)
                .map_err(|reason| failed(format!("poses, index {index}: {reason}")))?;
            estimates.push((index, posterior));
        }
        estimates.sort_unstable_by_key(|(index, _)| *index);
        Ok(estimates)
    }
}

/// A program that has greeted.
fn program(command: &CommandLine, timeout_s: f64, models: Vec<Arc<ObjectModel>>) -> Result<Arc<dyn Answers>> {
    let programs = Programs::new(Estimating, command, Duration::from_secs_f64(timeout_s), models);
    programs.start(|()| ())?;
    Ok(Arc::new(programs))
}

impl Answers for Programs<Estimating> {
    fn answer(&self, look: &Question<'_>) -> Result<Vec<Found>> {
        let mut session = self.session()?;
        session.pictures.write(look.frame)?;
        let id = self.id();
        let request = Request::Look(Box::new(LookRequest {
            id,
            seed: look.seed,
            look: look.look,
            place: look.place,
            view: View::new(look.frame, look.world_from_camera.as_ref(), look.space, &session.pictures),
            objects: look
                .asked
                .iter()
                .map(|&index| Asked { index, obj_id: look.models[index].info.bop_id })
                .collect(),
            boxes: look.boxes.clone(),
        }));
        let line = serde_json::to_string(&request)?;
        let found = match session.ask(&line).map_err(|e| self.failed(e))? {
            Reply::Poses { id: of, poses } if of == id => poses,
            Reply::Poses { id: of, .. } => {
                return Err(self.failed(format!("it answers question {of}, and was asked {id}")));
            }
            Reply::Error { message } => return Err(self.failed(message)),
            Reply::Hello { .. } => return Err(self.failed("it said hello again")),
        };
        self.keep(session);
        Ok(found)
    }

    fn name(&self) -> String {
        self.command().text.clone()
    }

    fn description(&self) -> Value {
        json!({ "name": "cmd", "command": self.command().text, "protocol": protocol::VERSION })
    }
}

impl Perception for External {
    fn look(&self, look: &Look<'_>) -> Result<Estimates> {
        self.estimate(look, Place::Table)
    }

    fn look_into_bin(&self, look: &Look<'_>) -> Result<Estimates> {
        self.estimate(look, Place::Bin)
    }

    fn description(&self) -> Value {
        self.answers.description()
    }
}

/// The surest boxes of each kind of object.
fn proposals(boxes: &Detections, objects: &[Arc<ObjectModel>]) -> Vec<Proposal> {
    let mut kinds: Vec<&ObjectModel> = objects.iter().map(|model| &**model).collect();
    kinds.dedup_by_key(|model| model.info.bop_id);
    let of = |model: &ObjectModel| {
        let mut boxes = boxes.of(&model.info.name).to_vec();
        boxes.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
        boxes.truncate(MOST_BOXES);
        let obj_id = model.info.bop_id;
        boxes.into_iter().map(move |detection| {
            let FileBox { bbox, score, .. } = FileBox::new((0, 0), obj_id, &detection);
            Proposal { obj_id, bbox, score }
        })
    };
    kinds.into_iter().flat_map(of).collect()
}

/// What is believed of an object by what the estimator says of it.
fn posterior(found: &Found, model: &ObjectModel, seconds: f64) -> Result<PosePosterior, String> {
    for (field, value) in [("score", found.score), ("confidence", found.confidence)] {
        if !value.is_finite() {
            return Err(format!("{field} {value}: must be finite"));
        }
    }
    if !(0.0..=1.0).contains(&found.confidence) {
        return Err(format!("confidence {}: must be 0 to 1", found.confidence));
    }
    let pose = |rotation: &[f64; 9], translation: &[f64; 3]| -> Result<Pose<Camera, Object>, String> {
        finite(translation)?;
        Ok(Pose::new(bop::rigid(rotation, translation)?))
    };
    let best = pose(&found.rotation, &found.translation)?;
    let mut samples = Vec::with_capacity(found.samples.len());
    for (k, sample) in found.samples.iter().enumerate() {
        let at = |reason| format!("samples[{k}]: {reason}");
        if !(sample.weight >= 0.0 && sample.weight.is_finite()) {
            return Err(at(format!("weight {}: must be 0 or more", sample.weight)));
        }
        samples.push((pose(&sample.rotation, &sample.translation).map_err(at)?, sample.weight));
    }
    let posterior =
        PosePosterior::of_samples(model, best, found.score, &samples).map_err(|e| e.to_string())?;
    let there = found.confidence >= 0.5;
    Ok(PosePosterior { confidence: found.confidence, there, seconds, ..posterior })
}
