//! One trial, top to bottom: [`Trial::look`], [`Trial::believe`], [`Trial::choose`], [`Trial::act`], [`Trial::settle`]; again
//! until nothing is left to pack, and then the score.
//!
//! | file | what it holds |
//! |---|---|
//! | `look` | looking: frames, estimates, a second view |
//! | `port` | the robot port over the physics world, and the score's window on it |
//! | `belief` | what the robot believes after a look |
//! | `grasps` | what grasp planners of others are asked, and which object their grasps are of |
//! | `choose` | what is to be done next: pick, put aside or push |
//! | `film` | pictures of a trial from outside |
//! | `report` | report.html |
//! | `bop` | what the camera saw, as a BOP data set |
//!
//! Scene -> World -> CameraFrame -> Detections -> PosePosterior -> Grasp -> Trajectory -> Outcome -> Score -> Report

mod belief;
pub mod bop;
mod choose;
pub mod film;
mod grasps;
mod look;
mod port;
pub mod report;
#[cfg(test)]
mod tests;

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use grip_manip::executor::{ExecutionReport, execute, execute_motion, execute_steps, release_in_place};
use grip_manip::{PickPlacePlan, PlanStep, Planner, Risk};
use grip_physics::World;
use grip_sim::images::RgbImage;
use grip_sim::pose::{Camera, Object, Pose, World as WorldFrame};
use grip_sim::render::Renderer;
use nalgebra::Point3;

use self::belief::Belief;
pub use self::choose::Choice;
use self::film::{BeforeAfter, Film, Strip};
pub use self::look::Seen;
use self::port::TrialObserver;
pub(crate) use self::port::{SharedWorld, WorldPort};
use self::report::LookPictures;
use crate::estimators::{Estimates, Estimator, EstimatorFailed};
use crate::graspers::{Grasper, GrasperFailed};
use crate::progress::{Interrupted, Progress};
use crate::record::{Action, Level, RecordOptions, Recorder, Recording};
use crate::scenario::Scenario;
use crate::score::outcome::{
    ItemResult, ItemTiming, Measures, Outcome, Stage, TRIAL_SCHEMA, Timing, TrialResult,
};
use crate::score::record::{ItemRecord, failure_of, finish};
use crate::score::{self, Bodies, GraspMonitor, JointLog, Location};
use crate::setup::Setup;

/// What to run, beside the [`Setup`].
#[derive(Debug, Clone, Default)]
pub struct TrialOptions {
    /// The estimator's name in outputs.
    pub estimator: String,
    /// Who plans grasps.
    pub grasper: Grasper,
    /// How many of the scene's objects are to be packed, the first of them; all where none is given. The rest is clutter.
    pub items: Option<usize>,
    /// The folder of grasp files that the planner was made with, if it was.
    pub grasps: Option<PathBuf>,
    /// Which pictures to make for people; nothing else depends on them.
    pub pictures: Pictures,
    /// What to keep of what is known; nothing else depends on it.
    pub record: RecordOptions,
}

/// Pictures of a trial.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Pictures {
    /// None.
    #[default]
    None,
    /// Every look, every attempt from outside, and the scene at the end.
    All {
        /// And an animated replay.
        record: bool,
    },
    /// Attempts from outside.
    Film,
    /// The same if not everything was packed.
    FilmOfFailures,
}

/// A finished trial.
pub struct TrialRecord {
    /// The score.
    pub result: TrialResult,
    /// The pictures of every look.
    pub looks: Vec<LookPictures>,
    /// What it depended on.
    pub scenario: Scenario,
    /// The scene after the last action, as the head camera sees it.
    pub after: Option<RgbImage>,
    /// The scene from outside at the start and at the end.
    pub before_after: Option<BeforeAfter>,
    /// Each attempt from outside.
    pub strips: Vec<Strip>,
    /// The animated replay, a PNG.
    pub replay: Option<Vec<u8>>,
    /// What was recorded, if it was to be kept.
    pub recording: Option<Recording>,
}

/// A trial that goes on.
pub struct Trial<'a> {
    setup: &'a Setup,
    estimator: &'a Estimator,
    planner: &'a Planner,
    renderer: &'a mut dyn Renderer,
    progress: &'a dyn Progress,
    options: TrialOptions,
    scenario: Scenario,
    started: Instant,
    items: usize,
    world: World,
    /// One an object, in the order of the setup's models.
    records: Vec<ItemRecord>,
    /// Which body of the world each is.
    bodies: Bodies,
    /// Where the camera was at each look.
    cameras: Vec<Pose<WorldFrame, Camera>>,
    /// What was believed at the last one.
    before: Estimates,
    joints: JointLog,
    film: Film<'a>,
    recorder: Recorder,
    looks: Vec<LookPictures>,
    /// What was handled last, and where everything was when it had come to rest afterwards.
    handled: Option<(usize, Vec<Location>)>,
    /// How often something was pushed.
    pushes: u32,
}

/// An attempt at an object that has been made.
pub struct Attempt {
    /// The object, a position in the setup's list.
    pub object: usize,
    /// Where everything was before it.
    locations: Vec<Location>,
    poses: Vec<Pose<WorldFrame, Object>>,
}

/// Runs a trial to its end.
///
/// # Errors
/// When rendering, estimation or the world fails, or `progress` is cancelled; a failed grasp is a result, not an error.
pub fn run(
    setup: &Setup,
    estimator: &Estimator,
    planner: &Planner,
    renderer: &mut dyn Renderer,
    options: TrialOptions,
    progress: &dyn Progress,
) -> Result<TrialRecord> {
    let mut trial = Trial::begin(setup, estimator, planner, renderer, options, progress)?;
    let mut fruitless = 0;
    while trial.is_open() && fruitless < setup.settings.trial.max_fruitless_looks {
        ensure!(!progress.cancelled(), Interrupted);
        let seen = match trial.look() {
            Ok(seen) => seen,
            Err(error) => {
                let failure = error.downcast::<EstimatorFailed>()?;
                trial.give_up(Outcome::EstimatorFailed, Stage::Look, &failure);
                break;
            }
        };
        let mut belief = trial.believe(&seen);
        if let Err(error) = trial.ask_for_grasps(&seen, &mut belief) {
            let failure = error.downcast::<GrasperFailed>()?;
            trial.give_up(Outcome::GrasperFailed, Stage::Plan, &failure);
            break;
        }
        // Before a risk is taken, what is too crowded is pushed apart.
        let careful = trial.choose(&belief, &seen, Risk::Averse);
        let push = if careful.is_none() { trial.plan_push(&belief) } else { None };
        let choice = match &push {
            Some(_) => None,
            None => careful.or_else(|| trial.choose(&belief, &seen, Risk::Tolerant)),
        };
        let decision = match (&choice, &push) {
            (Some(choice), _) if choice.aside => format!("puts {} aside", trial.name(choice.object)),
            (Some(choice), _) => format!("picks {}", trial.name(choice.object)),
            (None, Some((object, _))) => format!("pushes {}", trial.name(*object)),
            (None, None) => "nothing can be picked".to_owned(),
        };
        let counts = [seen.asked.len(), belief.index.len(), belief.scene.unmodelled.len()];
        trial.recorder.decided(trial.world.time(), &seen.frame, counts, &decision);
        trial.picture(&seen, decision)?;
        let attempt = match (choice, push) {
            (Some(choice), _) => trial.act(&seen, belief, &choice),
            (None, Some((object, steps))) => trial.push(belief, object, &steps),
            (None, None) => {
                fruitless += 1;
                continue;
            }
        };
        fruitless = 0;
        trial.settle(&attempt);
    }
    trial.finish()
}

impl<'a> Trial<'a> {
    /// Lays the scene out.
    ///
    /// # Errors
    /// When the objects find no room, or more items are asked for than there are.
    pub fn begin(
        setup: &'a Setup,
        estimator: &'a Estimator,
        planner: &'a Planner,
        renderer: &'a mut dyn Renderer,
        options: TrialOptions,
        progress: &'a dyn Progress,
    ) -> Result<Self> {
        let started = Instant::now();
        let (all, most) = (setup.models.len(), setup.packable());
        let items = options.items.unwrap_or(most);
        ensure!(
            (1..=most).contains(&items),
            "{items} items: the scene has {most} objects that can be packed; give 1 to {most}"
        );
        let settings = &setup.settings.trial;
        if settings.second_look_mass > 0.0 {
            let view = setup.cell.looking_at(&Point3::origin(), settings.second_look_torso_m);
            view.context("settings: trial.second_look_torso_m")?;
        }
        progress.message("settling the scene");
        let (world, dropped) = setup.drop_objects()?;
        log::info!("scene settled in {:.1} s, {} layouts rejected", dropped.settle_s, dropped.rejected.len());
        let grasps = (&options.grasper, options.grasps.as_deref());
        let scenario = Scenario::new(setup, estimator, grasps, items, renderer.name())?;
        let recorder = Recorder::new(setup, options.record);
        Ok(Self {
            film: Film::new(setup, &world, options.pictures),
            setup,
            estimator,
            planner,
            renderer,
            progress,
            options,
            scenario,
            started,
            items,
            world,
            records: vec![ItemRecord::default(); all],
            bodies: Bodies::new(all),
            cameras: Vec::new(),
            before: Estimates::new(),
            joints: JointLog::default(),
            recorder,
            looks: Vec::new(),
            handled: None,
            pushes: 0,
        })
    }

    /// Whether there is an item that is neither packed nor given up.
    pub fn is_open(&self) -> bool {
        !self.open_items().is_empty()
    }

    fn open_items(&self) -> Vec<usize> {
        let max_attempts = self.setup.settings.trial.max_attempts;
        (0..self.items).filter(|&i| self.records[i].is_open(max_attempts)).collect()
    }

    /// Where the robot believes its joints to be.
    fn joints(&self) -> Vec<f64> {
        self.setup.measured_joints(&self.world)
    }

    /// The number of the present look, from 0 on.
    fn number(&self) -> usize {
        self.cameras.len() - 1
    }

    /// The belief after a look: what was estimated with some confidence, what was put into the bin where it was put, and
    /// readings that none of these explain.
    pub fn believe(&mut self, seen: &Seen) -> Belief {
        let clock = Instant::now();
        let mut belief = Belief::new(self.setup, &seen.frame, &seen.estimates, &self.records);
        let joints = &self.joints();
        belief.scene.unmodelled = self.planner.unmodelled_obstacles(&belief.scene, &seen.frame, joints);
        let points = belief.scene.unmodelled.len();
        log::debug!("look {}: {points} points of unmodelled obstacles", self.number());
        self.recorder.took("obstacles", None, clock.elapsed());
        belief
    }

    /// Carries the plan out with the score watching, and goes back to where the camera sees the table.
    pub fn act(&mut self, seen: &Seen, belief: Belief, choice: &Choice) -> Attempt {
        let i = choice.object;
        let name = self.name(i);
        if choice.aside {
            self.progress.message(&format!("look {}: putting {name} aside", self.number() + 1));
            self.records[i].put_aside += 1;
            return self.handle(belief, i, Action::Aside, &choice.plan.steps);
        }
        self.progress.message(&format!("look {}: packing {name}", self.number() + 1));
        let attempt = Attempt { object: i, locations: self.locations(), poses: self.world.poses() };
        self.world.reset_peaks();
        let (report, monitor) = self.execute(i, &choice.plan);
        let body = self.bodies.of(i);
        let peak_force_n = self.world.peak_force(body);
        let record = &mut self.records[i];
        record.attempts += 1;
        record.record_errors(seen.errors[i]);
        if let Some(monitor) = monitor {
            record.clauses = monitor.clauses;
            record.measures = Measures { knocked_out: record.measures.knocked_out, ..monitor.measures };
            record.wrong_object = monitor.wrong_object.is_some();
            record.wrong_objects += u32::from(record.wrong_object);
            record.slip_m = monitor.slip_m;
            // The twin of the one that was meant is in the hand now.
            if let Some(other) = monitor.wrong_object.filter(|other| self.same_kind(i, *other)) {
                let twin = self.bodies.item(other);
                if self.records[twin].believed_packed.is_none() {
                    self.bodies.swap(i, twin);
                }
            }
        }
        let record = &mut self.records[i];
        record.close_attempt();
        record.peak_force_n = record.peak_force_n.max(peak_force_n);
        record.failure = None;
        match failure_of(&report) {
            Some((outcome, stage, reason)) => {
                self.film.failed(&self.world, outcome, &reason);
                record.fail_attempt(outcome, stage, reason);
            }
            None => record.believed_packed = Some(choice.plan.world_from_object_placed()),
        }
        let (failed, released) = (record.failure.is_some(), record.believed_packed);
        if failed {
            self.release();
        }
        self.go_home(belief.after_handling(i, released));
        attempt
    }

    /// Carries out a push.
    pub fn push(&mut self, belief: Belief, object: usize, steps: &[PlanStep]) -> Attempt {
        let name = self.name(object);
        self.progress.message(&format!("look {}: pushing {name}", self.number() + 1));
        self.pushes += 1;
        self.handle(belief, object, Action::Push, steps)
    }

    /// Carries out steps that do not pack object `i`, and goes back to where the camera sees the table.
    fn handle(&mut self, belief: Belief, i: usize, action: Action, steps: &[PlanStep]) -> Attempt {
        let attempt = Attempt { object: i, locations: self.locations(), poses: self.world.poses() };
        let name = self.name(i);
        self.world.reset_peaks();
        self.film.begin(&self.world, self.bodies.of(i), &name, false);
        self.recorder.begins(action, self.bodies.of(i), (self.setup, &self.world), steps);
        let shared = SharedWorld::new(&mut self.world);
        let mut observer = TrialObserver {
            world: &shared,
            monitor: None,
            joints: &mut self.joints,
            film: &mut self.film,
            recorder: &mut self.recorder,
        };
        let executor = &self.setup.settings.executor;
        let report = execute_steps(
            &mut WorldPort::new(&shared, &self.setup.miscalibration),
            steps,
            executor,
            &mut observer,
        );
        log::debug!("{name} elsewhere: {:?}", report.outcome);
        self.recorder.ends(&self.world, &report, None);
        if report.failure().is_some() {
            self.release();
        }
        self.go_home(belief.after_handling(i, None));
        attempt
    }

    /// Carries out a plan for object `i`.
    fn execute(&mut self, i: usize, plan: &PickPlacePlan) -> (ExecutionReport, Option<GraspMonitor>) {
        let settings = &self.setup.settings;
        let hand = self.setup.cell.config.gripper.link;
        let monitor = Some(GraspMonitor::begin(&self.world, self.bodies.of(i), hand, &settings.success));
        self.film.begin(&self.world, self.bodies.of(i), &self.name(i), true);
        self.recorder.begins(Action::Pack, self.bodies.of(i), (self.setup, &self.world), &plan.steps);
        let shared = SharedWorld::new(&mut self.world);
        let mut observer = TrialObserver {
            world: &shared,
            monitor,
            joints: &mut self.joints,
            film: &mut self.film,
            recorder: &mut self.recorder,
        };
        let report = execute(
            &mut WorldPort::new(&shared, &self.setup.miscalibration),
            plan,
            &settings.executor,
            &mut observer,
        );
        log::debug!("{}: {:?}, {:?}", plan.object, plan.grasp, plan.place);
        for step in &report.steps {
            log::debug!(
                "{:?}: {:.2} s to {:.2} s, {:.0} N",
                step.name,
                step.begin_s,
                step.end_s,
                step.peak_contact_n
            );
        }
        let monitor = observer.monitor;
        self.recorder.ends(&self.world, &report, monitor.as_ref());
        (report, monitor)
    }

    /// The name of an item for people, who know which of several it is.
    fn name(&self, item: usize) -> String {
        self.setup.name(self.bodies.of(item))
    }

    fn same_kind(&self, item: usize, body: usize) -> bool {
        self.world.object(body).info.name == self.setup.models[item].info.name
    }

    /// Opens the gripper where it stands, so that nothing is carried about after a failure.
    fn release(&mut self) {
        let shared = SharedWorld::new(&mut self.world);
        let mut observer = TrialObserver {
            world: &shared,
            monitor: None,
            joints: &mut self.joints,
            film: &mut self.film,
            recorder: &mut self.recorder,
        };
        let settings = &self.setup.settings.executor;
        let report = release_in_place(
            &mut WorldPort::new(&shared, &self.setup.miscalibration),
            settings,
            &mut observer,
        );
        if let Some((.., reason)) = report.failure() {
            log::info!("letting go: {reason}");
        }
    }

    /// Moves the arm back to where the camera sees the table. When no path is found, or the way is blocked, the robot stays
    /// and the next look has to do with what it sees.
    fn go_home(&mut self, belief: Belief) {
        let setup = self.setup;
        self.moves(&belief, &setup.cell.start, "home");
    }

    /// Moves to a configuration; whether it came there.
    fn moves(&mut self, belief: &Belief, goal: &[f64], where_to: &str) -> bool {
        let settings = &self.setup.settings;
        let seed = self.setup.stream(&format!("{where_to}/{}", self.number()));
        let trajectory = match self.planner.plan_home(&belief.scene, &self.joints(), goal, seed) {
            Ok(trajectory) => trajectory,
            Err(failure) => {
                log::info!("{where_to}: no way: {failure}");
                return false;
            }
        };
        let head = self.planner.plan_head(&self.joints(), goal);
        let shared = SharedWorld::new(&mut self.world);
        let mut port = WorldPort::new(&shared, &self.setup.miscalibration);
        let mut observer = TrialObserver {
            world: &shared,
            monitor: None,
            joints: &mut self.joints,
            film: &mut self.film,
            recorder: &mut self.recorder,
        };
        for trajectory in std::iter::once(trajectory).chain(head) {
            let report = execute_motion(&mut port, &trajectory, &settings.executor, &mut observer);
            if let Some((.., reason)) = report.failure() {
                log::info!("on the way, {where_to}: {reason}");
                return false;
            }
        }
        true
    }

    /// What still rolls comes to rest; then what the attempt did to the other items is noted.
    pub fn settle(&mut self, attempt: &Attempt) {
        let handled = attempt.object;
        let recorder = &mut self.recorder;
        self.world.settle_watched(self.setup.settings.trial.calm_s, |world| recorder.watch(world));
        let after = self.note_losses(&attempt.locations, handled);
        self.note_blows();
        let disturbed_m = self.setup.settings.score.disturbed_m;
        let moved = self.world.moved_since(&attempt.poses);
        self.recorder.rests(&self.world, &after, &moved);
        let body = self.bodies.of(handled);
        let record = &mut self.records[handled];
        for (other, moved) in moved.into_iter().enumerate().filter(|(i, _)| *i != body) {
            record.others_moved_m = record.others_moved_m.max(moved);
            if moved > disturbed_m {
                record.disturbed[usize::from(attempt.locations[other] == Location::Bin)] += 1;
            }
        }
        self.handled = Some((handled, after));
    }

    /// Marks what left the table or the bin since `before`, and the item `handled` meanwhile; returns where all are now, so
    /// that nothing is counted twice.
    fn note_losses(&mut self, before: &[Location], handled: usize) -> Vec<Location> {
        let after = self.locations();
        for other in score::knocked_out(before, &after, self.bodies.of(handled)) {
            self.records[self.bodies.item(other)].knocked_out = true;
            self.records[handled].knocked_others = true;
            self.records[handled].measures.knocked_out += 1;
        }
        after
    }

    /// The largest blow that each item has taken.
    fn note_blows(&mut self) {
        for (i, record) in self.records.iter_mut().enumerate() {
            let impulse = self.world.peak_impulse(self.bodies.of(i));
            record.peak_impulse_n_s = record.peak_impulse_n_s.max(impulse);
            if record.believed_packed.is_some() {
                record.measures.packed_impulse_n_s = record.measures.packed_impulse_n_s.max(impulse);
            }
        }
    }

    fn locations(&self) -> Vec<Location> {
        score::locations(&self.world, &self.setup.cell.scene, &self.setup.settings.success)
    }

    /// Ends what is left to pack: nobody says where it is, or how to grip it.
    fn give_up(&mut self, outcome: Outcome, stage: Stage, failure: &dyn std::error::Error) {
        log::warn!("seed {}: {}: {failure}", self.setup.seed, outcome.words());
        for i in self.open_items() {
            self.records[i].fail(outcome, stage, failure.to_string());
        }
    }

    /// How the items would be scored if the trial ended now; of what comes to rest only later nothing is known yet. In the order of the
    /// result's items.
    pub fn standing(&self) -> Vec<ItemResult> {
        let order = self.bodies.order(self.items);
        let mut records: Vec<ItemRecord> = order.iter().map(|&i| self.records[i].clone()).collect();
        let (bodies, still) = (self.bodies.reordered(&order), vec![0.0; self.world.object_count()]);
        let criteria = &self.setup.settings.success;
        let (scene, world) = (&self.setup.cell.scene, &self.world);
        finish(scene, (world, &still), criteria, (&mut records, &bodies), self.items)
    }

    /// Waits until everything is at rest, and scores.
    ///
    /// # Errors
    /// When a picture cannot be drawn.
    pub fn finish(mut self) -> Result<TrialRecord> {
        let settings = &self.setup.settings.trial;
        self.progress.message("settling the bin");
        let recorder = &mut self.recorder;
        self.world.settle_watched(settings.final_settle_s, |world| recorder.watch(world));
        if let Some((handled, locations)) = self.handled.take() {
            self.note_losses(&locations, handled);
        }
        self.note_blows();
        let before = self.world.poses();
        let drift_m = self.world.drift(settings.drift_s);
        let moved = self.world.moved_since(&before);
        let Self { setup, records, bodies, world, renderer, progress, film, recorder, .. } = self;
        // The robot numbers several of a kind as it likes; results are of bodies, so that runs can be compared.
        let order = bodies.order(self.items);
        let (mut records, bodies): (Vec<ItemRecord>, Bodies) =
            (order.iter().map(|&i| records[i].clone()).collect(), bodies.reordered(&order));
        let criteria = &setup.settings.success;
        let items =
            finish(&setup.cell.scene, (&world, &moved), criteria, (&mut records, &bodies), self.items);
        let packed = items.iter().filter(|item| item.outcome == Outcome::Packed).count();
        let after = match self.options.pictures {
            Pictures::All { .. } => Some(setup.capture(&world, renderer, self.cameras.len())?.0.rgb),
            _ => None,
        };
        let strips = match self.options.pictures {
            Pictures::None => Vec::new(),
            Pictures::FilmOfFailures if packed == self.items => Vec::new(),
            _ => film.strips(&world, &items, renderer, progress)?,
        };
        let before_after = match self.options.pictures {
            Pictures::All { .. } => film.before_after(&world, renderer)?,
            _ => None,
        };
        let replay = film.replay(renderer, progress)?;
        let timing =
            |record: &ItemRecord| ItemTiming { estimate_s: record.estimate_s, plan_s: record.plan_s };
        let result = TrialResult {
            schema: TRIAL_SCHEMA.into(),
            scenario: self.scenario.hash(),
            seed: setup.seed,
            scene: setup.cell.scene.name.clone(),
            condition: setup.condition.name.clone(),
            estimator: self.options.estimator,
            grasper: self.options.grasper.name().to_owned(),
            detector: self.estimator.detector().into(),
            object_set: setup.object_set(),
            renderer: renderer.name().into(),
            hypotheses: setup.hypotheses.name().into(),
            requested: self.items,
            score: score::fill(
                &setup.cell,
                &setup.settings.score,
                &world,
                (&records, &bodies),
                &items,
                (self.pushes, drift_m),
            ),
            packed,
            calibration: setup.miscalibration.record(),
            motion_check: self.joints.check(self.planner, &setup.cell.empty_belief()),
            sim_s: world.time(),
            items,
            state_hash: world.state_hash(),
            timing: Some(Timing {
                wall_s: self.started.elapsed().as_secs_f64(),
                items: records.iter().take(self.items).map(timing).collect(),
            }),
        };
        let keeps = match self.options.record.level {
            Level::None => false,
            Level::Failures => packed < self.items,
            Level::Events | Level::Full | Level::Mcap => true,
        };
        let recording =
            keeps.then(|| Recording::new(recorder, &result, setup.camera.intrinsics)).transpose()?;
        Ok(TrialRecord {
            result,
            scenario: self.scenario,
            looks: self.looks,
            after,
            before_after,
            strips,
            replay,
            recording,
        })
    }
}
