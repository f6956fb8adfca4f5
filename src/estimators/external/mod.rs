//! An estimator of others: a program that is handed what the camera saw, a line at a time, and says where the objects are
//! ([docs/estimators.md](../../../docs/estimators.md)).
//!
//! Each thread that looks has a process of its own, which lives as long as the thread's trials go on. What a process does wrong, ends,
//! is silent or talks nonsense, is the fault of the trial that it happens in ([`EstimatorFailed`]): the next one gets a new process.

mod child;
mod npy;
pub mod protocol;
// Their estimators are shell scripts.
#[cfg(test)]
#[cfg(unix)]
mod tests;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::ThreadId;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use grip_perception::{Detections, PosePosterior, Workspace};
use grip_sim::bop;
use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Camera, Object, Pose, World};
use grip_sim::unfinished::Unfinished;
use nalgebra::Isometry3;
use serde_json::{Value, json};

use self::child::LineProcess;
use self::protocol::{Asked, Found, LookRequest, Model, Place, Proposal, Reply, Request, Space, Transform};
use super::{Estimates, Look, Perception};
use crate::benchmark::FileBox;
use crate::setup::Setup;

/// How much longer than for an answer is waited for the first one: a network has to be loaded.
const START: u32 = 5;
/// Boxes of an object that are told.
const MOST_BOXES: usize = 100;

/// A command line: a program and its arguments.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CommandLine {
    /// As it was given.
    pub text: String,
    words: Vec<String>,
}

impl FromStr for CommandLine {
    type Err = String;

    /// By the rules of a POSIX shell for words and quotes; nothing is expanded.
    fn from_str(text: &str) -> Result<Self, String> {
        let words = shlex::split(text).ok_or_else(|| format!("{text}: a quote is not closed"))?;
        if words.is_empty() {
            return Err("no program is named behind cmd:".into());
        }
        Ok(Self { text: text.to_owned(), words })
    }
}

impl CommandLine {
    /// For outputs: the stem of the first word that names a file, behind an interpreter if there is one.
    pub fn name(&self) -> String {
        let stem =
            |word: &String| Path::new(word).file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let script = self.words.iter().skip(1).find(|word| Path::new(word).extension().is_some());
        script.and_then(stem).or_else(|| stem(&self.words[0])).unwrap_or_default()
    }
}

/// What an estimator of others did wrong: the end of a trial, and no fault of ours.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EstimatorFailed(pub String);

impl std::fmt::Display for EstimatorFailed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for EstimatorFailed {}

/// A program of others that estimates poses.
pub struct External {
    command: CommandLine,
    timeout: Duration,
    /// The spaces over the table and in the bin; none for images of a data set.
    cell: Option<[Workspace; 2]>,
    /// All that may be asked for.
    models: Vec<Arc<ObjectModel>>,
    /// Made when the first process is started.
    folder: OnceLock<Folder>,
    /// Of the first greeting, for whoever looks first.
    spare: Mutex<Option<Session>>,
    processes: Mutex<HashMap<ThreadId, Session>>,
    ids: AtomicU64,
}

/// Where models and pictures are for the estimator to read; gone with it.
struct Folder {
    place: Unfinished,
    models: Vec<Model>,
}

/// A process that has said hello, and where it finds its pictures.
struct Session {
    process: LineProcess,
    rgb: PathBuf,
    depth: PathBuf,
}

/// What is asked.
struct Question<'a> {
    place: Place,
    seed: u64,
    look: usize,
    frame: &'a CameraFrame,
    world_from_camera: Option<Pose<World, Camera>>,
    space: Option<Workspace>,
    models: &'a [Arc<ObjectModel>],
    /// Positions in `models`.
    asked: &'a [usize],
    boxes: Vec<Proposal>,
}

impl External {
    /// For the cell of `setup`. A program is started: one that cannot greet is a wrong command, and no outcome of trials.
    ///
    /// # Errors
    /// When it cannot be started, or does not answer the greeting as the protocol has it.
    pub fn open(setup: &Setup, command: &CommandLine) -> Result<Self> {
        let cell = [setup.cell.workspace(), setup.cell.bin_space()];
        Self::greeted(command, setup.settings.trial.estimator_timeout_s, Some(cell), setup.models.clone())
    }

    /// For the images of a data set in which there are `models`; an answer may take `timeout_s`.
    ///
    /// # Errors
    /// As [`External::open`].
    pub fn for_images(command: &CommandLine, timeout_s: f64, models: Vec<Arc<ObjectModel>>) -> Result<Self> {
        Self::greeted(command, timeout_s, None, models)
    }

    fn greeted(
        command: &CommandLine,
        timeout_s: f64,
        cell: Option<[Workspace; 2]>,
        models: Vec<Arc<ObjectModel>>,
    ) -> Result<Self> {
        let external = Self {
            command: command.clone(),
            timeout: Duration::from_secs_f64(timeout_s),
            cell,
            models,
            folder: OnceLock::new(),
            spare: Mutex::new(None),
            processes: Mutex::new(HashMap::new()),
            ids: AtomicU64::new(0),
        };
        let greeted = external.session(external.folder()?)?;
        *lock(&external.spare) = Some(greeted);
        Ok(external)
    }

    /// The models, written when first asked for.
    fn folder(&self) -> Result<&Folder> {
        if let Some(folder) = self.folder.get() {
            return Ok(folder);
        }
        let made = make_folder(&self.models)?;
        Ok(self.folder.get_or_init(|| made))
    }

    /// A process that has said hello.
    fn session(&self, folder: &Folder) -> Result<Session, EstimatorFailed> {
        let failed = |reason: String| EstimatorFailed(format!("{}: {reason}", self.command.text));
        let mut process = LineProcess::start(&self.command.words).map_err(failed)?;
        let program = concat!("grip ", env!("CARGO_PKG_VERSION"));
        let hello = Request::Hello { protocol: protocol::VERSION, program, models: &folder.models };
        let line = serde_json::to_string(&hello).map_err(|error| failed(error.to_string()))?;
        let answer = process.ask(&line, START * self.timeout).map_err(failed)?;
        match reply(&answer).map_err(failed)? {
            Reply::Hello { protocol: protocol::VERSION, name, version } => {
                log::info!("estimator {name} {version}");
            }
            Reply::Hello { protocol, .. } => {
                return Err(failed(format!(
                    "it speaks protocol {protocol}, and this program {}",
                    protocol::VERSION
                )));
            }
            Reply::Error { message } => return Err(failed(message)),
            Reply::Poses { .. } => return Err(failed("it said poses before hello".into())),
        }
        let number = self.ids.fetch_add(1, Ordering::Relaxed);
        let file = |kind: &str| folder.place.path().join(format!("{kind}-{number}.npy"));
        Ok(Session { process, rgb: file("rgb"), depth: file("depth") })
    }

    /// Where `objects` are in an image of a data set, positions in it, by its number of the scene and its own; `boxes` are where a
    /// detector says that they are.
    ///
    /// # Errors
    /// [`EstimatorFailed`] when the program does wrong; others when it cannot be asked.
    pub fn image(
        &self,
        (scene_id, im_id): (u32, u32),
        frame: &CameraFrame,
        world_from_camera: Option<Pose<World, Camera>>,
        boxes: &Detections,
        objects: &[Arc<ObjectModel>],
    ) -> Result<Estimates> {
        let asked: Vec<usize> = (0..objects.len()).collect();
        self.ask(Question {
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
        self.ask(Question {
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

    fn ask(&self, look: Question<'_>) -> Result<Estimates> {
        let folder = self.folder()?;
        let thread = std::thread::current().id();
        // Out of the map while it works, so that threads do not wait for each other, and so that one that fails is not met again.
        let known = lock(&self.processes).remove(&thread).or_else(|| lock(&self.spare).take());
        let mut session = match known {
            Some(session) => session,
            None => self.session(folder)?,
        };
        // Its start is not on any object.
        let began = Instant::now();
        let frame = look.frame;
        let write = |path: &Path, bytes: Vec<u8>| {
            std::fs::write(path, bytes).with_context(|| format!("{}: cannot be written", path.display()))
        };
        write(&session.rgb, npy::rgb(&frame.rgb))?;
        write(&session.depth, npy::depth(&frame.depth))?;
        let k = &frame.intrinsics;
        let id = self.ids.fetch_add(1, Ordering::Relaxed);
        let request = Request::Look(Box::new(LookRequest {
            id,
            seed: look.seed,
            look: look.look,
            place: look.place,
            width: k.width,
            height: k.height,
            intrinsics: [k.fx, 0.0, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0],
            world_from_camera: look.world_from_camera.map(|pose| transform(pose.iso())),
            space: look.space.map(|Workspace { min, max }| Space { min, max }),
            rgb: &session.rgb,
            depth: &session.depth,
            objects: look
                .asked
                .iter()
                .map(|&index| Asked { index, obj_id: look.models[index].info.bop_id })
                .collect(),
            boxes: look.boxes,
        }));
        let failed = |reason: String| EstimatorFailed(format!("{}: {reason}", self.command.text));
        let answer = session.process.ask(&serde_json::to_string(&request)?, self.timeout).map_err(failed)?;
        let found = match reply(&answer).map_err(failed)? {
            Reply::Poses { id: of, poses } if of == id => poses,
            Reply::Poses { id: of, .. } => {
                return Err(failed(format!("it answers question {of}, and was asked {id}")).into());
            }
            Reply::Error { message } => return Err(failed(message).into()),
            Reply::Hello { .. } => return Err(failed("it said hello again".into()).into()),
        };
        // Not all of its time is on one object.
        let seconds = began.elapsed().as_secs_f64() / look.asked.len().max(1) as f64;
        let mut estimates = Estimates::new();
        for found in &found {
            let index = found.index;
            if !look.asked.contains(&index) || estimates.iter().any(|(other, _)| *other == index) {
                let reason = format!("poses: index {index}: give each of the objects asked for at most once");
                return Err(failed(reason).into());
            }
            let posterior = posterior(found, &look.models[index], seconds)
                .map_err(|reason| failed(format!("poses, index {index}: {reason}")))?;
            estimates.push((index, posterior));
        }
        estimates.sort_unstable_by_key(|(index, _)| *index);
        lock(&self.processes).insert(thread, session);
        Ok(estimates)
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
        json!({ "name": "cmd", "command": self.command.text, "protocol": protocol::VERSION })
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Writes the models where the estimator finds them.
fn make_folder(models: &[Arc<ObjectModel>]) -> Result<Folder> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let name = format!("grip-estimator-{}", COUNT.fetch_add(1, Ordering::Relaxed));
    let temporary = std::env::temp_dir();
    let cannot = || format!("{}: no folder can be made there", temporary.display());
    let place = Unfinished::beside(&temporary.join(name)).with_context(cannot)?;
    std::fs::create_dir(place.path()).with_context(cannot)?;
    let mut kinds: Vec<&ObjectModel> = models.iter().map(|model| &**model).collect();
    kinds.sort_by_key(|model| model.info.bop_id);
    kinds.dedup_by_key(|model| model.info.bop_id);
    let folder = place.path().join("models");
    bop::export_models(&folder, kinds.iter().copied())?;
    let models = kinds
        .into_iter()
        .map(|model| Model {
            obj_id: model.info.bop_id,
            name: model.info.name.clone(),
            mesh: folder.join(format!("obj_{:06}.ply", model.info.bop_id)),
            diameter: model.diameter,
        })
        .collect();
    Ok(Folder { place, models })
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

/// What a line says.
fn reply(line: &str) -> Result<Reply, String> {
    serde_json::from_str(line).map_err(|error| {
        let begin: String = line.chars().take(200).collect();
        format!("its answer is not what the protocol says: {error}: {begin}")
    })
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
        if translation.iter().any(|t| !t.is_finite()) {
            return Err(format!("t {translation:?}: must be finite, metres"));
        }
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

/// As the protocol has it.
fn transform(iso: &Isometry3<f64>) -> Transform {
    let m = iso.rotation.to_rotation_matrix();
    Transform {
        rotation: std::array::from_fn(|i| m[(i / 3, i % 3)]),
        translation: iso.translation.vector.into(),
    }
}
