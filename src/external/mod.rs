//! Programs of others, which answer lines of JSON with lines of JSON: what estimators ([docs/estimators.md](../../../docs/estimators.md))
//! and grasp planners ([docs/graspers.md](../../../docs/graspers.md)) have in common.
//!
//! Each thread that asks has a process of its own, which lives as long as the thread's trials go on. What a process does wrong, ends,
//! is silent or talks nonsense, is the fault of the trial that it happens in: the next one gets a new process.

mod child;
mod command;
mod npy;
pub mod protocol;

use std::collections::HashMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::ThreadId;
use std::time::Duration;

use anyhow::{Context, Result};
use grip_sim::bop;
use grip_sim::frame::CameraFrame;
use grip_sim::images::LabelImage;
use grip_sim::objects::ObjectModel;
use grip_sim::unfinished::Unfinished;
use serde::de::DeserializeOwned;

use self::child::LineProcess;
pub use self::command::CommandLine;
pub(crate) use self::command::named_command;
use self::protocol::Model;

/// How much longer than for an answer is waited for the first one: a network has to be loaded.
const START: u32 = 5;

/// Who speaks, as in greetings.
pub(crate) const PROGRAM: &str = concat!("grip ", env!("CARGO_PKG_VERSION"));

/// Someone in this process who estimates or plans grasps.
pub struct Given<T: ?Sized> {
    /// As in outputs.
    pub name: String,
    /// Who.
    pub who: Arc<T>,
}

impl<T: ?Sized> fmt::Debug for Given<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Given").field(&self.name).finish()
    }
}

impl<T: ?Sized> Clone for Given<T> {
    fn clone(&self) -> Self {
        Self { name: self.name.clone(), who: Arc::clone(&self.who) }
    }
}

impl<T: ?Sized> PartialEq for Given<T> {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && Arc::ptr_eq(&self.who, &other.who)
    }
}

impl<T: ?Sized> Eq for Given<T> {}

/// What is spoken with a kind of program.
pub(crate) trait Dialogue {
    /// What a program says of itself.
    type Greeting;

    /// The first line; the models are on disk.
    fn hello(&self, models: &[Model]) -> serde_json::Result<String>;

    /// What the answer to it says, or what is wrong with it.
    fn greeted(&self, answer: &str) -> Result<Self::Greeting, String>;

    /// What a program of this kind did wrong, as the error that ends a trial and no more.
    fn failed(reason: String) -> anyhow::Error;
}

/// The processes of a command.
pub(crate) struct Programs<D: Dialogue> {
    dialogue: D,
    command: CommandLine,
    timeout: Duration,
    /// All that a trial may draw its objects from.
    models: Vec<Arc<ObjectModel>>,
    /// Made when the first process is started.
    folder: OnceLock<Folder>,
    /// Of the first greeting, for whoever asks first.
    spare: Mutex<Option<Session<D::Greeting>>>,
    processes: Mutex<HashMap<ThreadId, Session<D::Greeting>>>,
    ids: AtomicU64,
}

/// Where models and pictures are for the programs to read; gone with them.
struct Folder {
    place: Unfinished,
    models: Vec<Model>,
}

/// A process that has said hello.
pub(crate) struct Session<G> {
    process: LineProcess,
    timeout: Duration,
    /// What it said then.
    pub greeting: G,
    /// Where it finds its pictures.
    pub pictures: Pictures,
}

/// Files that a process finds its pictures in.
pub(crate) struct Pictures {
    pub rgb: PathBuf,
    pub depth: PathBuf,
    pub segmentation: PathBuf,
}

impl<D: Dialogue> Programs<D> {
    /// Of `command`, which gets `timeout` for an answer and is told of `models`. None is started yet.
    pub fn new(dialogue: D, command: &CommandLine, timeout: Duration, models: Vec<Arc<ObjectModel>>) -> Self {
        Self {
            dialogue,
            command: command.clone(),
            timeout,
            models,
            folder: OnceLock::new(),
            spare: Mutex::new(None),
            processes: Mutex::new(HashMap::new()),
            ids: AtomicU64::new(0),
        }
    }

    /// Starts one: a program that cannot greet is a wrong command, and no outcome of trials. Returns what `of` makes of its greeting.
    ///
    /// # Errors
    /// When it cannot be started, or does not answer the greeting as the protocol has it.
    pub fn start<T>(&self, of: impl FnOnce(&D::Greeting) -> T) -> Result<T> {
        let greeted = self.greet()?;
        let said = of(&greeted.greeting);
        *lock(&self.spare) = Some(greeted);
        Ok(said)
    }

    /// As in the command line.
    pub fn command(&self) -> &CommandLine {
        &self.command
    }

    /// The error of what a process did wrong.
    pub fn failed(&self, reason: impl std::fmt::Display) -> anyhow::Error {
        D::failed(format!("{}: {reason}", self.command.text))
    }

    /// A number that no question has had.
    pub fn id(&self) -> u64 {
        self.ids.fetch_add(1, Ordering::Relaxed)
    }

    /// This thread's process, or a new one. It is out of everyone's reach until it is given back ([`Programs::keep`]), so that threads do
    /// not wait for each other, and so that one that fails is not met again.
    pub fn session(&self) -> Result<Session<D::Greeting>> {
        let thread = std::thread::current().id();
        let known = lock(&self.processes).remove(&thread).or_else(|| lock(&self.spare).take());
        known.map_or_else(|| self.greet(), Ok)
    }

    /// For this thread's next question.
    pub fn keep(&self, session: Session<D::Greeting>) {
        lock(&self.processes).insert(std::thread::current().id(), session);
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
    fn greet(&self) -> Result<Session<D::Greeting>> {
        let folder = self.folder()?;
        let mut process = LineProcess::start(&self.command.words).map_err(|e| self.failed(e))?;
        let line = self.dialogue.hello(&folder.models)?;
        let answer = process.ask(&line, START * self.timeout).map_err(|e| self.failed(e))?;
        let greeting = self.dialogue.greeted(&answer).map_err(|e| self.failed(e))?;
        let number = self.id();
        let file = |kind: &str| folder.place.path().join(format!("{kind}-{number}.npy"));
        let pictures =
            Pictures { rgb: file("rgb"), depth: file("depth"), segmentation: file("segmentation") };
        Ok(Session { process, timeout: self.timeout, greeting, pictures })
    }

    #[cfg(test)]
    pub fn waiting(&self) -> (usize, PathBuf) {
        let folder = self.folder.get().map(|folder| folder.place.path().to_owned());
        (lock(&self.processes).len(), folder.unwrap_or_default())
    }
}

impl<G> Session<G> {
    /// Sends a question, and waits for the answer.
    ///
    /// # Errors
    /// When there is none in time, or it is not what the protocol says, in words.
    pub fn ask<R: DeserializeOwned>(&mut self, question: &str) -> Result<R, String> {
        reply(&self.process.ask(question, self.timeout)?)
    }
}

impl Pictures {
    /// Writes what the camera saw.
    pub fn write(&self, frame: &CameraFrame) -> Result<()> {
        write(&self.rgb, &npy::rgb(&frame.rgb))?;
        write(&self.depth, &npy::depth(&frame.depth))
    }

    /// Writes which object is seen where: its label, 0 where there is none.
    pub fn write_labels(&self, labels: &LabelImage) -> Result<()> {
        write(&self.segmentation, &npy::labels(labels))
    }
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).with_context(|| format!("{}: cannot be written", path.display()))
}

/// What a line says.
pub(crate) fn reply<R: DeserializeOwned>(line: &str) -> Result<R, String> {
    serde_json::from_str(line).map_err(|error| {
        let begin: String = line.chars().take(200).collect();
        format!("its answer is not what the protocol says: {error}: {begin}")
    })
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn make_folder(models: &[Arc<ObjectModel>]) -> Result<Folder> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let name = format!("grip-program-{}", COUNT.fetch_add(1, Ordering::Relaxed));
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
