//! A grasp planner of others: a program that is handed what the camera saw, a line at a time, and says how to grip
//! ([docs/graspers.md](../../../docs/graspers.md)).

use std::fmt;
use std::time::{Duration, Instant};

use anyhow::Result;
use grip_perception::Workspace;
use grip_sim::bop;
use grip_sim::pose::Pose;
use serde_json::{Value, json};

use super::protocol::{FoundGrasp, Gripper, Item, LookRequest, Reply, Request, VERSION, Want};
use super::{ForeignGrasp, GraspPlanner, GraspQuestion, GrasperFailed, Target};
use crate::external::protocol::{Model, View, finite, same_version};
use crate::external::{CommandLine, Dialogue, PROGRAM, Programs, reply};
use crate::setup::Setup;

/// A program of others that plans grasps.
pub struct External {
    programs: Programs<Grasping>,
    wants: Vec<Want>,
    space: Workspace,
    /// Height of the table's surface, metres.
    table: f64,
}

impl fmt::Debug for External {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("External").field("command", self.programs.command()).finish_non_exhaustive()
    }
}

/// What is spoken with a grasp planner.
pub(super) struct Grasping {
    pub gripper: Gripper,
}

impl Dialogue for Grasping {
    type Greeting = Vec<Want>;

    fn hello(&self, models: &[Model]) -> serde_json::Result<String> {
        let gripper = self.gripper;
        serde_json::to_string(&Request::Hello { protocol: VERSION, program: PROGRAM, gripper, models })
    }

    fn greeted(&self, answer: &str) -> Result<Vec<Want>, String> {
        match reply(answer)? {
            Reply::Hello { protocol, name, version, wants } => {
                same_version(protocol, VERSION)?;
                log::info!("grasp planner {name} {version}");
                Ok(wants)
            }
            Reply::Error { message } => Err(message),
            Reply::Grasps { .. } => Err("it said grasps before hello".into()),
        }
    }

    fn failed(reason: String) -> anyhow::Error {
        GrasperFailed(reason).into()
    }
}

impl External {
    /// For the cell of `setup`. A program is started: one that cannot greet is a wrong command, and no outcome of trials.
    ///
    /// # Errors
    /// When it cannot be started, or does not answer the greeting as the protocol has it.
    pub fn open(setup: &Setup, command: &CommandLine) -> Result<Self> {
        let timeout = Duration::from_secs_f64(setup.settings.trial.grasper_timeout_s);
        let grasping = Grasping { gripper: (&setup.cell.config.gripper).into() };
        let programs = Programs::new(grasping, command, timeout, setup.models.clone());
        Self::of(programs, setup.cell.workspace(), setup.cell.scene.table.height)
    }

    /// With objects in `space`, on a table of this height, metres.
    pub(super) fn of(programs: Programs<Grasping>, space: Workspace, table: f64) -> Result<Self> {
        let wants = programs.start(Vec::clone)?;
        Ok(Self { programs, wants, space, table })
    }

    fn item(&self, target: &Target) -> Item {
        let Target { index, obj_id, wanted, pose } = target;
        let pose = pose.filter(|_| self.wants.contains(&Want::Poses)).map(|pose| pose.iso().into());
        Item { index: *index, obj_id: *obj_id, wanted: *wanted, pose }
    }
}

impl GraspPlanner for External {
    fn wants(&self) -> &[Want] {
        &self.wants
    }

    fn grasps(&self, question: &GraspQuestion<'_>) -> Result<Vec<ForeignGrasp>> {
        let programs = &self.programs;
        let mut session = programs.session()?;
        if session.greeting != self.wants {
            return Err(programs.failed("its greeting wants something else than its first one did"));
        }
        let began = Instant::now();
        session.pictures.write(question.frame)?;
        if let Some(labels) = question.segmentation {
            session.pictures.write_labels(labels)?;
        }
        let id = programs.id();
        let line = serde_json::to_string(&Request::Look(Box::new(LookRequest {
            id,
            seed: question.seed,
            look: question.look,
            view: View::new(
                question.frame,
                Some(&question.frame.world_from_camera),
                Some(self.space),
                &session.pictures,
            ),
            table: self.table,
            segmentation: question.segmentation.map(|_| &*session.pictures.segmentation),
            objects: question.targets.iter().map(|target| self.item(target)).collect(),
        })))?;
        let found = match session.ask(&line).map_err(|e| programs.failed(e))? {
            Reply::Grasps { id: of, grasps } if of == id => grasps,
            Reply::Grasps { id: of, .. } => {
                return Err(programs.failed(format!("it answers question {of}, and was asked {id}")));
            }
            Reply::Error { message } => return Err(programs.failed(message)),
            Reply::Hello { .. } => return Err(programs.failed("it said hello again")),
        };
        let grasps = found
            .iter()
            .enumerate()
            .map(|(k, grasp)| {
                checked(grasp, question.targets).map_err(|e| programs.failed(format!("grasps[{k}]: {e}")))
            })
            .collect::<Result<Vec<_>>>()?;
        log::info!(
            "{}: seed {}, look {}: {} grasps in {:.0} ms",
            programs.command().name(),
            question.seed,
            question.look,
            grasps.len(),
            1e3 * began.elapsed().as_secs_f64()
        );
        programs.keep(session);
        Ok(grasps)
    }

    fn description(&self) -> Value {
        json!({ "name": "cmd", "command": self.programs.command().text, "protocol": VERSION })
    }
}

/// A grasp that means something.
///
/// # Errors
/// In words, when a number does not, or its object is none of `targets`.
pub fn checked(grasp: &FoundGrasp, targets: &[Target]) -> Result<ForeignGrasp, String> {
    let FoundGrasp { rotation, translation, width, score, index } = grasp;
    if !score.is_finite() {
        return Err(format!("score {score}: must be finite"));
    }
    if let Some(width) = width.filter(|width| !(*width > 0.0 && width.is_finite())) {
        return Err(format!("width {width}: must be more than 0, metres"));
    }
    if let Some(index) = index.filter(|index| targets.iter().all(|target| target.index != *index)) {
        return Err(format!("index {index}: give that of one of the objects, or none"));
    }
    finite(translation)?;
    let camera_from_gripper = Pose::new(bop::rigid(rotation, translation)?);
    Ok(ForeignGrasp { camera_from_gripper, width: *width, score: *score, index: *index, place: None })
}
