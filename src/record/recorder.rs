//! What a trial tells of itself while it goes on.

use std::time::Duration;

use grip_manip::executor::{ExecOutcome, ExecutionReport, StepReport};
use grip_manip::{Action as StepAction, PlanCounters};
use grip_manip::{PickPlacePlan, PlanFailure, PlanStep, Risk, StepName};
use grip_perception::PosePosterior;
use grip_physics::{Body, World};
use grip_sim::frame::CameraFrame;
use grip_sim::images::{DepthImage, RgbImage};
use grip_sim::scene::FixtureKind;
use nalgebra::{Isometry3, Vector3};
use schemars::JsonSchema;
use serde::Serialize;

use super::replay::Drawn;
use super::rows::{Attempt, Contact, Estimate, Look, Moved, Plan, Planned, Rest, Sample, Step, Time};
use super::{Level, RecordOptions};
use crate::cell::Cell;
use crate::score::{GraspMonitor, Location};
use crate::setup::Setup;

/// What the fingers are called.
const RIGHT: &str = "right finger";
const LEFT: &str = "left finger";

/// What happened, in the order in which it did: a line of events.jsonl.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// An object was estimated.
    Estimate(Estimate),
    /// A way was searched for.
    Plan(Box<Plan>),
    /// The robot has looked, and decided.
    Look(Look),
    /// A step is over.
    Step(Step),
    /// An attempt is over.
    Attempt(Attempt),
    /// Everything has come to rest after an attempt.
    Rest(Rest),
}

/// What is done with an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// It is put into the bin.
    Pack,
    /// It is put elsewhere on the table.
    Aside,
    /// It is pushed.
    Push,
}

impl Action {
    fn name(self) -> &'static str {
        match self {
            Self::Pack => "pack",
            Self::Aside => "aside",
            Self::Push => "push",
        }
    }
}

/// What the camera saw at a look.
#[derive(Debug, Clone)]
pub struct Picture {
    /// Colour.
    pub rgb: RgbImage,
    /// Depth, metres.
    pub depth: DepthImage,
}

/// The attempt that goes on.
#[derive(Debug)]
struct Now {
    action: Action,
    object: usize,
    begin_s: f64,
}

/// Takes down what a trial tells of itself. At [`Level::None`] it does nothing.
#[derive(Debug)]
pub struct Recorder {
    pub(super) options: RecordOptions,
    /// Name and number of each object of the world.
    pub(super) objects: Vec<(String, i64)>,
    /// Names of the movable joints, the links and the fixtures, the floor last.
    pub(super) joints: Vec<String>,
    pub(super) links: Vec<String>,
    /// What there is to draw, where that is kept.
    pub(super) drawn: Option<Drawn>,
    fixtures: Vec<String>,
    pub(super) events: Vec<Event>,
    pub(super) samples: (Vec<Sample>, Vec<Vec<f32>>),
    pub(super) planned: (Vec<Planned>, Vec<Vec<f32>>),
    pub(super) moved: Vec<Moved>,
    pub(super) contacts: Vec<Contact>,
    pub(super) times: Vec<Time>,
    pub(super) pictures: Vec<Picture>,
    /// Where each link, then each object was last.
    last: Vec<Option<Isometry3<f64>>>,
    next_s: f64,
    look: i64,
    attempt: i64,
    now: Option<Now>,
}

impl Recorder {
    /// Of a trial of `setup`.
    pub fn new(setup: &Setup, options: RecordOptions) -> Self {
        let robot = &setup.cell.robot;
        let mut objects: Vec<(String, i64)> = Vec::new();
        for model in &setup.models {
            let name = &model.info.name;
            let before = objects.iter().filter(|(other, _)| other == name).count();
            objects.push((name.clone(), 1 + before as i64));
        }
        let links: Vec<String> = robot.links().iter().map(|link| link.name.clone()).collect();
        let fixtures = setup.cell.scene.fixtures();
        let fixtures = fixtures.iter().map(|fixture| match fixture.kind {
            FixtureKind::TableTop => "table".to_owned(),
            FixtureKind::TableLeg => "table leg".to_owned(),
            FixtureKind::Bin(_) => "bin".to_owned(),
            FixtureKind::Stand => "stand".to_owned(),
            FixtureKind::Block => "block".to_owned(),
        });
        Self {
            options,
            last: vec![None; links.len() + objects.len()],
            objects,
            joints: robot.joints().iter().map(|joint| joint.name.clone()).collect(),
            links,
            drawn: (options.level >= Level::Full).then(|| Drawn::of(setup)),
            fixtures: fixtures.chain(["floor".to_owned()]).collect(),
            events: Vec::new(),
            samples: Default::default(),
            planned: Default::default(),
            moved: Vec::new(),
            contacts: Vec::new(),
            times: Vec::new(),
            pictures: Vec::new(),
            next_s: 0.0,
            look: -1,
            attempt: -1,
            now: None,
        }
    }

    /// Whether anything is kept.
    pub fn is_on(&self) -> bool {
        self.options.level != Level::None
    }

    fn is_off(&self) -> bool {
        !self.is_on()
    }

    /// Whether pictures, poses and contacts are kept, too.
    pub fn is_full(&self) -> bool {
        self.options.level >= Level::Full
    }

    /// When it looked, seconds.
    pub(super) fn look_times(&self) -> impl Iterator<Item = f32> {
        self.events.iter().filter_map(|event| match event {
            Event::Look(row) => Some(row.time_s as f32),
            _ => None,
        })
    }

    /// Whether this name is of a part of the robot.
    pub(super) fn is_robot(&self, name: &str) -> bool {
        [RIGHT, LEFT].contains(&name) || self.links.iter().any(|link| link == name)
    }

    fn name(&self, body: usize) -> (String, i64) {
        self.objects[body].clone()
    }

    /// Something took so long; `object` is a body of the world, if it was for one.
    pub fn took(&mut self, what: &str, object: Option<usize>, time: Duration) {
        if self.is_off() {
            return;
        }
        let object = object.map(|body| self.name(body).0).unwrap_or_default();
        self.times.push(Time { look: self.look, what: what.to_owned(), object, seconds: time.as_secs_f64() });
    }

    /// A look begins; `frame` is what the camera saw.
    pub fn looks(&mut self, frame: &CameraFrame, world: &World) {
        self.look += 1;
        if self.is_full() {
            self.pictures.push(Picture { rgb: frame.rgb.clone(), depth: frame.depth.clone() });
        }
        self.places(world);
    }

    /// Body `body` was estimated; `errors` are ADD and ADD-S.
    pub fn estimated(
        &mut self,
        (body, world): (usize, &World),
        (frame, posterior): (&CameraFrame, &PosePosterior),
        errors: (f64, f64),
        (in_bin, believed): (bool, bool),
    ) {
        if self.is_off() {
            return;
        }
        let (object, instance) = self.name(body);
        let (estimate, truth) = (frame.world_from_camera * posterior.best, world.truth(body));
        self.events.push(Event::Estimate(Estimate {
            look: self.look,
            time_s: world.time(),
            object,
            instance,
            in_bin,
            confidence: posterior.confidence,
            believed,
            position_error_m: (estimate.translation() - truth.translation()).norm(),
            rotation_error_deg: estimate.angle_to(&truth).to_degrees(),
            estimate: Some((&estimate).into()),
            truth: Some((&truth).into()),
            add_m: errors.0,
            adds_m: errors.1,
            position_std_m: Some(posterior.position_std_m).filter(|std| std.is_finite()),
            modes: posterior.modes.len() as i64,
        }));
    }

    /// A way was searched for; `body` is the one that the item is.
    pub fn planned(
        &mut self,
        (body, time_s): (usize, f64),
        action: Action,
        risk: Risk,
        plan: Result<&PickPlacePlan, &PlanFailure>,
    ) {
        if self.is_off() {
            return;
        }
        let counters = plan.map_or_else(|failure| *failure.counters, |plan| plan.counters);
        let (object, instance) = self.name(body);
        let risk = match risk {
            Risk::Averse => "averse",
            Risk::Tolerant => "tolerant",
        };
        let row = Plan {
            look: self.look,
            time_s,
            object,
            instance,
            action: action.name().to_owned(),
            risk: risk.to_owned(),
            ..plan_row(&counters, plan)
        };
        self.events.push(Event::Plan(Box::new(row)));
    }

    /// The robot has decided; `believed` objects of `asked`, and so many readings that nothing explains.
    pub fn decided(
        &mut self,
        time_s: f64,
        frame: &CameraFrame,
        [asked, believed, unmodelled]: [usize; 3],
        decision: &str,
    ) {
        if self.is_off() {
            return;
        }
        self.events.push(Event::Look(Look {
            look: self.look,
            time_s,
            camera: Some((&frame.world_from_camera).into()),
            asked: asked as i64,
            believed: believed as i64,
            unmodelled: unmodelled as i64,
            decision: decision.to_owned(),
        }));
    }

    /// An attempt at body `body` begins.
    pub fn begins(
        &mut self,
        action: Action,
        body: usize,
        (setup, world): (&Setup, &World),
        steps: &[PlanStep],
    ) {
        self.attempt += 1;
        self.now = Some(Now { action, object: body, begin_s: world.time() });
        if self.is_off() {
            return;
        }
        let period = 1.0 / self.options.rate_hz;
        let Cell { robot, config, scene, .. } = &setup.cell;
        let world_from_base = scene.world_from_base();
        let mut whole = world.joints().to_vec();
        for (part, step) in steps.iter().enumerate() {
            let StepAction::Move { trajectory, .. } = &step.action else { continue };
            let last = (trajectory.duration / period).floor() as usize;
            let times = (0..=last).map(|k| k as f64 * period);
            for time_s in times.chain([trajectory.duration]) {
                let (q, _) = trajectory.sample(time_s);
                trajectory.joints.iter().zip(&q).for_each(|(&joint, q)| whole[joint] = *q);
                let hand = world_from_base.iso() * robot.fk_link(&whole, config.gripper.link);
                let row = Planned {
                    attempt: self.attempt,
                    part: part as i64,
                    step: word(step.name),
                    time_s,
                    hand: single(&hand.translation.vector),
                };
                let mut all = vec![f32::NAN; self.joints.len()];
                trajectory.joints.iter().zip(q).for_each(|(&joint, q)| all[joint] = q as f32);
                self.planned.0.push(row);
                self.planned.1.push(all);
            }
        }
    }

    /// A control period is over in which the robot stands still.
    pub fn watch(&mut self, world: &World) {
        if self.is_full() && self.is_due(world.time()) {
            self.places(world);
        }
    }

    fn is_due(&mut self, time_s: f64) -> bool {
        let due = time_s >= self.next_s;
        if due {
            self.next_s = time_s + 1.0 / self.options.rate_hz - 1e-9;
        }
        due
    }

    /// A control period is over.
    pub fn tick(&mut self, world: &World, step: StepName, monitor: Option<&GraspMonitor>) {
        if self.is_off() || !self.is_due(world.time()) {
            return;
        }
        let object = self.now.as_ref().map(|now| now.object);
        let newtons =
            |side: usize| object.map_or(0.0, |body| world.contacts(body).fingers[side].force.norm()) as f32;
        let slip = monitor.and_then(|monitor| monitor.slip_now(world)).unwrap_or((0.0, 0.0));
        self.samples.0.push(Sample {
            time_s: world.time(),
            attempt: self.attempt,
            step: word(step),
            width_m: world.finger_positions().iter().sum::<f64>() as f32,
            grip_force_n: world.grip_force() as f32,
            hand_force_n: single(&world.hand_force()),
            link_force_n: world.link_force() as f32,
            right_finger_n: newtons(0),
            left_finger_n: newtons(1),
            support_n: object.map_or(0.0, |body| world.contacts(body).support_force) as f32,
            slip_m: slip.0 as f32,
            slip_deg: slip.1.to_degrees() as f32,
        });
        self.samples.1.push(world.joints().iter().map(|q| *q as f32).collect());
        self.places(world);
    }

    /// A step is over.
    pub fn step_done(&mut self, report: &StepReport) {
        if self.is_off() {
            return;
        }
        self.events.push(Event::Step(Step {
            attempt: self.attempt,
            step: word(report.name),
            begin_s: report.begin_s,
            end_s: report.end_s,
            peak_contact_n: report.peak_contact_n,
            stopped_early: report.stopped_early,
        }));
    }

    /// The attempt is over.
    pub fn ends(&mut self, world: &World, report: &ExecutionReport, monitor: Option<&GraspMonitor>) {
        let Some(now) = self.now.as_ref().filter(|_| !self.is_off()) else { return };
        let (object, instance) = self.name(now.object);
        let slip = monitor.filter(|monitor| monitor.slip_m.is_some()).map(|monitor| &monitor.measures);
        let clauses = monitor.map_or_else(Default::default, |monitor| monitor.clauses);
        let failed = report.steps.last().filter(|_| report.outcome != ExecOutcome::Done);
        let attempt = Attempt {
            attempt: self.attempt,
            look: self.look,
            object,
            instance,
            action: now.action.name().to_owned(),
            begin_s: now.begin_s,
            end_s: world.time(),
            done: report.outcome == ExecOutcome::Done,
            failed_step: failed.map(|step| word(step.name)).unwrap_or_default(),
            reason: report.failure().map(|(.., reason)| reason.to_owned()).unwrap_or_default(),
            grasp_width_m: report.grasp_width_m,
            peak_contact_n: report.peak_contact_n,
            peak_grip_n: report.peak_grip_n,
            peak_force_n: world.peak_force(now.object),
            slip_m: slip.map(|measures| measures.slip_m),
            slip_deg: slip.map(|measures| measures.slip_deg),
            wrong_object: monitor.is_some_and(|monitor| monitor.wrong_object.is_some()),
            opposing_contacts: clauses.opposing_contacts,
            lifted_clear: clauses.lifted_clear,
            held_after_carry: clauses.held_after_carry,
            slip_within: clauses.slip_within,
        };
        self.events.push(Event::Attempt(attempt));
    }

    /// Everything is at rest after an attempt: where it is, and how far it moved.
    pub fn rests(&mut self, world: &World, locations: &[Location], moved: &[f64]) {
        if self.is_off() {
            return;
        }
        for (body, (location, moved)) in locations.iter().zip(moved).enumerate() {
            let (object, instance) = self.name(body);
            self.events.push(Event::Rest(Rest {
                attempt: self.attempt,
                object,
                instance,
                location: format!("{location:?}").to_lowercase(),
                truth: Some((&world.truth(body)).into()),
                moved_m: *moved,
            }));
        }
        self.places(world);
    }

    /// Takes down where everything is that has moved, and all contacts.
    fn places(&mut self, world: &World) {
        if !self.is_full() {
            return;
        }
        let time_s = world.time();
        for k in 0..self.last.len() {
            let (kind, name, instance, pose) = match k.checked_sub(self.links.len()) {
                None => ("link", self.links[k].clone(), 1, world.link_pose(k)),
                Some(body) => {
                    let (name, instance) = self.name(body);
                    ("object", name, instance, *world.truth(body).iso())
                }
            };
            if self.last[k].is_some_and(|last| same(&last, &pose)) {
                continue;
            }
            self.last[k] = Some(pose);
            let q = pose.rotation;
            let rotation = [q.i, q.j, q.k, q.w].map(|part| part as f32);
            let position = single(&pose.translation.vector);
            self.moved.push(Moved { time_s, kind: kind.to_owned(), name, instance, position, rotation });
        }
        for body in 0..self.objects.len() {
            for (by, contact) in world.contacts(body).by_body() {
                let Some(point) = contact.middle() else { continue };
                let by = match *by {
                    Body::Fixture(i) => self.fixtures[i.min(self.fixtures.len() - 1)].clone(),
                    Body::Object(other) => self.objects[other].0.clone(),
                    Body::Link(link) => self.links[link].clone(),
                    Body::Finger(0) => RIGHT.to_owned(),
                    Body::Finger(_) => LEFT.to_owned(),
                };
                let (object, instance) = self.name(body);
                self.contacts.push(Contact {
                    time_s,
                    object,
                    instance,
                    by,
                    point: single(&point.coords),
                    force_n: single(&contact.force),
                    friction_n: single(&contact.friction),
                });
            }
        }
    }
}

/// A pose that has not moved, as far as a table shows it.
fn same(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    (a.translation.vector - b.translation.vector).norm() < 1e-6 && a.rotation.angle_to(&b.rotation) < 1e-5
}

fn single(v: &Vector3<f64>) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

/// The name of a step or stage as files have it.
fn word(value: impl Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(word)) => word,
        _ => String::new(),
    }
}

/// What a plan's own figures say.
fn plan_row(counters: &PlanCounters, plan: Result<&PickPlacePlan, &PlanFailure>) -> Plan {
    let (found, failure) = (plan.ok(), plan.err());
    let grasp = found.map(|plan| &plan.grasp);
    let whole = |n: usize| n as i64;
    let PlanCounters { grasps, arms_blocked, .. } = counters;
    Plan {
        look: 0,
        time_s: 0.0,
        object: String::new(),
        instance: 0,
        action: String::new(),
        risk: String::new(),
        found: found.is_some(),
        stage: failure.map(|failure| word(failure.stage)).unwrap_or_default(),
        reason: failure.map(|failure| failure.reason.clone()).unwrap_or_default(),
        candidates: whole(grasps.candidates),
        oriented: whole(grasps.oriented),
        tried: whole(grasps.tried),
        blocked_fixtures: whole(grasps.blocked.fixtures),
        blocked_objects: whole(grasps.blocked.objects),
        blocked_unmodelled: whole(grasps.blocked.unmodelled),
        closing_fixtures: whole(grasps.closing.fixtures),
        closing_objects: whole(grasps.closing.objects),
        closing_unmodelled: whole(grasps.closing.unmodelled),
        free: whole(grasps.free),
        grasps_tried: whole(counters.grasps_tried),
        arm_fixtures: whole(arms_blocked.fixtures),
        arm_objects: whole(arms_blocked.objects),
        arm_unmodelled: whole(arms_blocked.unmodelled),
        arm_robot: whole(arms_blocked.robot),
        reached: whole(counters.grasps_reached),
        approached: whole(counters.grasps_approached),
        lifted: whole(counters.grasps_lifted),
        places: whole(counters.places),
        places_tried: whole(counters.places_tried),
        places_reached: whole(counters.places_reached),
        searches: whole(counters.searches),
        iterations: whole(counters.iterations),
        checks: whole(counters.checks),
        grasp: grasp.map(|grasp| (&grasp.object_from_gripper).into()),
        width_m: grasp.map(|grasp| grasp.width),
        opening_m: grasp.map(|grasp| grasp.opening),
        clearance_m: grasp.map(|grasp| grasp.clearance),
        lever_m: grasp.map(|grasp| grasp.lever),
        contact_share: grasp.map(|grasp| grasp.contact_share),
        score: grasp.map(|grasp| grasp.score),
        place: found.map(|plan| (&plan.world_from_object_placed()).into()),
        motion_s: found.map(PickPlacePlan::motion_seconds),
    }
}
