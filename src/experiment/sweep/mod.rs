//! Grasps under known pose errors: what is the chance that a grasp holds when the pose is off by so much?
//!
//! One object stands alone on the table. A grasp is chosen at its true pose. Then the hand goes where that grasp would be if
//! the object were displaced by the error, given in the gripper's frame (x approach, y closing, z sideways): approach, close,
//! lift, shake, with the whole robot and real contacts. The same layouts and grasps are used for all errors, so that cells
//! differ in the error alone.

pub mod errors;
pub mod fits;
pub mod layout;
pub mod motion;

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use anyhow::{Context, Result, anyhow, bail, ensure};
use grip_manip::{Grasp, Planner};
use grip_sim::scene::Scene;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use self::errors::{Axis, ErrorCase, PoseError, along_axes, isotropic};
use self::layout::{GraspOutcome, Layout};
use self::motion::GraspMotion;
use super::journal::{self, Journal};
use super::plan;
use crate::progress::Progress;
use crate::scenario::{self, ObjectEntry, Program, RobotEntry};
use crate::settings::Settings;
use crate::setup::{Setup, SetupOptions};
use crate::workers::{self, Stop};

/// Version of sweep.json.
pub const SCHEMA: &str = "grip.sweep/2";
/// What a sweep is, in its folder.
pub const MANIFEST: &str = "sweep.json";
/// Its results, a grasp a line.
pub const GRASPS: &str = "grasps.jsonl";

/// Which grasp is tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Strategy {
    /// The one that the planner chooses for each layout.
    Planned,
    /// One for each object: what the planner chooses for its first layout.
    Fixed,
}

/// sweep.json: all that its grasps depend on.
#[derive(Serialize, JsonSchema)]
pub struct SweepFile<'a> {
    schema: &'static str,
    program: Program,
    /// SHA-256 of the program's file.
    build_sha256: Option<String>,
    objects: Vec<ObjectEntry<'a>>,
    object_set: String,
    first_seed: u64,
    seeds: u32,
    strategy: Strategy,
    /// Of the objects, where it is not their own.
    friction: Option<f64>,
    /// Of the fingers, where it is not the planner's, newtons.
    force_n: Option<f64>,
    /// Whether grasps have their motions.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    motions: bool,
    /// The errors; `case` of a grasp is a position in it.
    cases: &'a [ErrorCase],
    robot: RobotEntry<'a>,
    scene: &'a Scene,
    settings: &'a Settings,
}

/// Which errors are tried at each layout.
#[derive(Debug, Clone, PartialEq)]
pub enum ErrorPattern {
    /// Along one axis after the other, evenly from end to end.
    Axis(Vec<Axis>),
    /// At random in all six directions.
    Isotropic,
}

/// The published protocol's six, in the order of its table.
pub const OBJECTS: [&str; 6] = [
    "005_tomato_soup_can",
    "010_potted_meat_can",
    "003_cracker_box",
    "006_mustard_bottle",
    "011_banana",
    "040_large_marker",
];

/// What a sweep is to be. The default is the published protocol's objects, errors along all six axes.
#[derive(Debug, Clone)]
pub struct SweepOptions {
    /// Objects by name, each once.
    pub objects: Vec<String>,
    /// Which errors.
    pub pattern: ErrorPattern,
    /// Largest translation, metres, above 0 and at most 0.2.
    pub metres: f64,
    /// Largest rotation, radians, above 0 and at most pi.
    pub radians: f64,
    /// Errors along each axis (default 9), or random errors a layout (default 20).
    pub samples: Option<u32>,
    /// Layouts of each object, one a seed from the setup's on.
    pub seeds: u32,
    /// Which grasp is tried.
    pub strategy: Strategy,
    /// Coulomb friction between pads and objects, above 0 and at most 2: of both in place of their own.
    pub friction: Option<f64>,
    /// Force of each finger, newtons, in place of what the planner takes.
    pub force_n: Option<f64>,
    /// Whether to write motions and MJCF files for another simulator.
    pub motions: bool,
    /// Scene, objects, robot, settings and the first seed.
    pub setup: SetupOptions,
}

impl Default for SweepOptions {
    fn default() -> Self {
        Self {
            objects: OBJECTS.map(String::from).to_vec(),
            pattern: ErrorPattern::Axis(Axis::ALL.to_vec()),
            metres: 0.040,
            radians: 45_f64.to_radians(),
            samples: None,
            seeds: 50,
            strategy: Strategy::Planned,
            friction: None,
            force_n: None,
            motions: false,
            setup: SetupOptions::default(),
        }
    }
}

/// A grasp that was tried.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GraspLine {
    /// The object's name.
    pub object: String,
    /// The layout's seed.
    pub seed: u64,
    /// Number of the error in the sweep.
    pub case: usize,
    /// The error.
    #[serde(flatten)]
    pub error: PoseError,
    /// Mean distance of corresponding model points that the error makes, metres.
    pub add_m: f64,
    /// The same to the nearest point, metres.
    pub adds_m: f64,
    /// What became of the grasp.
    pub outcome: GraspOutcome,
    /// Both fingers pressed with opposing normals when the lift began.
    pub opposing_contacts: bool,
    /// The object left the table by 3 cm, touching nothing but the hand.
    pub lifted_clear: bool,
    /// Still held after the shake.
    pub held_after_shake: bool,
    /// Moved by at most 20 mm and turned by at most 20 degrees in the hand.
    pub slip_within: bool,
    /// How far it moved in the hand, metres; none unless it was held to the end.
    pub slip_m: Option<f64>,
    /// How far it turned in the hand, degrees; none unless it was held to the end.
    pub slip_deg: Option<f64>,
    /// What the hand was told to do, where the sweep was asked for it; none where the arm does not reach.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<Box<GraspMotion>>,
}

impl GraspLine {
    /// Whether the grasp held; none where the arm could not reach, which says nothing about the grasp.
    pub fn held(&self) -> Option<bool> {
        (self.outcome != GraspOutcome::Unreachable).then_some(self.outcome == GraspOutcome::Held)
    }

    /// What identifies it within a sweep, in the order in which grasps are listed.
    pub fn key(&self) -> (String, u64, usize) {
        (self.object.clone(), self.seed, self.case)
    }
}

/// A sweep.
pub struct Sweep {
    /// The scene, without its objects.
    pub setup: Setup,
    /// The planner.
    pub planner: Planner,
    /// Objects by name.
    pub objects: Vec<String>,
    /// Seeds of the layouts: from the first, so many.
    pub seeds: (u64, u32),
    /// The errors tried at each layout.
    pub cases: Vec<ErrorCase>,
    /// Which grasp is tried.
    pub strategy: Strategy,
    /// Coulomb friction between pads and objects in place of their own.
    pub friction: Option<f64>,
    /// Force of each finger, newtons, in place of what the planner takes.
    pub force_n: Option<f64>,
    /// Whether grasps have their motions.
    pub motions: bool,
}

impl Sweep {
    /// Reads all files that `options` name.
    ///
    /// # Errors
    /// When a file is wrong, an object is unknown, or a number out of its range.
    pub fn open(options: &SweepOptions) -> Result<Self> {
        let (metres, radians) = (options.metres, options.radians);
        for (value, most, what) in
            [(1e3 * metres, 200.0, "millimetres"), (radians.to_degrees(), 180.0, "degrees")]
        {
            ensure!(
                value > 0.0 && value <= most,
                "--range: {value} {what}: must be above 0 and at most {most}"
            );
        }
        let mut setup = Setup::open_bare(&options.setup)?;
        let strongest = setup.cell.config.gripper.max_force;
        for (value, most, option) in
            [(options.friction, 2.0, "--friction"), (options.force_n, strongest, "--force")]
        {
            if let Some(value) = value {
                ensure!(value > 0.0 && value <= most, "{option} {value}: must be above 0 and at most {most}");
            }
        }
        // A contact has the mean of both sides' coefficients: with pads of the same it is the one that was asked for.
        if let Some(friction) = options.friction {
            let settings = Arc::make_mut(&mut setup.settings);
            settings.physics.fingers.pad_friction = friction;
            settings.planner.grasp.antipodal.pad_friction = friction;
        }
        let cases = match &options.pattern {
            ErrorPattern::Axis(axes) => {
                if let Some((_, twice)) = axes.iter().enumerate().find(|(i, axis)| axes[..*i].contains(axis))
                {
                    bail!("--axes: {} is given twice; once is enough", twice.name());
                }
                along_axes(axes, metres, radians, options.samples.unwrap_or(9))
            }
            ErrorPattern::Isotropic => isotropic(metres, radians, options.samples.unwrap_or(20)),
        };
        let objects = options.objects.clone();
        for (i, object) in objects.iter().enumerate() {
            ensure!(!objects[..i].contains(object), "{object} is given twice; once is enough");
            setup.library.load(object).context("objects to try")?;
        }
        let first = options.setup.seed;
        ensure!(
            first.checked_add(u64::from(options.seeds)).is_some(),
            "--seed {first}: too large; give a lower one"
        );
        let settings = setup.settings.planner.clone();
        let planner = Planner::new(setup.cell.robot.clone(), setup.cell.config.clone(), settings);
        Ok(Self {
            planner,
            setup,
            objects,
            seeds: (first, options.seeds),
            cases,
            strategy: options.strategy,
            friction: options.friction,
            force_n: options.force_n,
            motions: options.motions,
        })
    }

    /// sweep.json.
    ///
    /// # Errors
    /// When a file of an object cannot be read.
    pub fn manifest(&self) -> Result<Value> {
        let models = self
            .objects
            .iter()
            .map(|name| self.setup.library.load(name))
            .collect::<std::result::Result<Vec<_>, _>>()?;
        Ok(serde_json::to_value(SweepFile {
            schema: SCHEMA,
            program: scenario::program(),
            build_sha256: plan::build(),
            objects: models.iter().map(|model| scenario::object(model)).collect(),
            object_set: self.setup.library.label(&models),
            first_seed: self.seeds.0,
            seeds: self.seeds.1,
            strategy: self.strategy,
            friction: self.friction,
            force_n: self.force_n,
            motions: self.motions,
            cases: &self.cases,
            robot: scenario::robot(&self.setup),
            scene: &self.setup.cell.scene,
            settings: &self.setup.settings,
        })?)
    }

    /// Makes the sweep's folder, or makes sure that it is the same sweep that goes on.
    ///
    /// # Errors
    /// When it is there although nothing is to be resumed, is another sweep, or cannot be written.
    pub fn begin(&self, out: &Path, resume: bool) -> Result<()> {
        plan::begin(out, MANIFEST, SCHEMA, &self.manifest()?, resume)?;
        self.write_models(out)
    }

    /// Writes what another simulator needs, where that is asked for, into the sweep's folder.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write_models(&self, out: &Path) -> Result<()> {
        if self.motions {
            motion::write_models(self, &out.join("mjcf"))?;
        }
        Ok(())
    }

    /// How many grasps there are to try.
    pub fn grasps(&self) -> usize {
        self.cases.len() * self.objects.len() * self.seeds.1 as usize
    }

    /// Tries what `out` lacks, on `jobs` threads; returns all grasps in their order, and how many were there before. A seed
    /// without a layout that has a grasp is left out with a warning.
    ///
    /// # Errors
    /// When none of an object's seeds has such a layout, or a result cannot be written; what is written by then stays.
    pub fn run(&self, out: &Path, jobs: usize, progress: &dyn Progress) -> Result<(Vec<GraspLine>, usize)> {
        let (done, kept) = self.run_seeds(self.seeds, out, jobs, progress)?;
        for object in &self.objects {
            ensure!(
                done.iter().any(|line| &line.object == object),
                "{object}: no seed has a layout with a grasp to try; give other --seeds, another --scene or another object"
            );
        }
        Ok((done, kept))
    }

    /// The same of some of the sweep's seeds: from the first, so many. An object without a grasp is no error.
    ///
    /// # Errors
    /// When a result cannot be written; what is written by then stays.
    pub fn run_seeds(
        &self,
        seeds: (u64, u32),
        out: &Path,
        jobs: usize,
        progress: &dyn Progress,
    ) -> Result<(Vec<GraspLine>, usize)> {
        let (journal, done) = Journal::open::<GraspLine>(&out.join(GRASPS))?;
        let kept = done.len();
        let known: BTreeSet<_> = done.iter().map(GraspLine::key).collect();
        let missing = |object: &str, seed: u64| -> Vec<usize> {
            (0..self.cases.len()).filter(|&case| !known.contains(&(object.to_owned(), seed, case))).collect()
        };
        let (first, count) = seeds;
        let groups: Vec<(&String, u64, Vec<usize>)> = (first..first + u64::from(count))
            .flat_map(|seed| self.objects.iter().map(move |object| (object, seed)))
            .map(|(object, seed)| (object, seed, missing(object, seed)))
            .filter(|(_, _, cases)| !cases.is_empty())
            .collect();
        progress.begin((self.cases.len() * self.objects.len() * count as usize) as u64, kept as u64);

        let mut fixed: Vec<(&String, Grasp)> = Vec::new();
        if self.strategy == Strategy::Fixed {
            for object in &self.objects {
                let layout = Layout::find(self, object, self.seeds.0, None)?.map_err(|why| anyhow!(why))?;
                fixed.push((object, layout.grasp));
            }
        }
        let next = AtomicUsize::new(0);
        let shared = Mutex::new((journal, done));
        let worker = |stop: &Stop<'_>| {
            while let Some((object, seed, cases)) = groups.get(next.fetch_add(1, Ordering::Relaxed)) {
                let only = fixed.iter().find(|(name, _)| name == object).map(|(_, grasp)| grasp);
                let layout = match Layout::find(self, object, *seed, only)? {
                    Ok(layout) => layout,
                    Err(why) => {
                        progress.warn(&format!("seed {seed}: left out: {why}"));
                        progress.advance(cases.len() as u64);
                        continue;
                    }
                };
                for &case in cases {
                    if stop.is_asked_for() {
                        return Ok(());
                    }
                    let line = layout.try_grasp(self, case)?;
                    let mut shared = shared.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                    let (journal, done) = &mut *shared;
                    journal.append(&line)?;
                    done.push(line);
                    progress.advance(1);
                }
            }
            Ok(())
        };
        workers::run(jobs.clamp(1, groups.len().max(1)), progress, worker)?;
        let (journal, mut done) = shared.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        done.sort_by_key(GraspLine::key);
        journal::write_whole(&out.join(GRASPS), &done)?;
        drop(journal);
        Ok((done, kept))
    }
}

/// What a sweep's folder says that it is.
///
/// # Errors
/// When there is no such file, or it is not one of ours.
pub fn read_manifest(folder: &Path) -> Result<Value> {
    plan::read_schema(&folder.join(MANIFEST), SCHEMA)
}
