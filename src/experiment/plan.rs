//! Which trials an experiment has: every scene with every condition, estimator and grasp planner, and the same seeds for all, so
//! that results come in pairs.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::OnceLock;

use anyhow::{Context, Result, bail, ensure};
use grip_manip::Planner;
use grip_sim::bop;
use grip_sim::condition::ConditionSpec;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use crate::estimators::{DetectorKind, DetectorOptions, Estimator, EstimatorKind, Recorded};
use crate::graspers::{GRIP, Grasper, GrasperKind};
use crate::record::RecordOptions;
use crate::scenario::{Program, Scenario, program};
use crate::score::outcome::{TrialResult, method};
use crate::setup::{self, Setup, SetupOptions};

/// Version of experiment.json.
pub const SCHEMA: &str = "grip.experiment/3";
/// What an experiment is, in its folder.
pub const MANIFEST: &str = "experiment.json";
/// Its results, a trial a line.
pub const TRIALS: &str = "trials.jsonl";
/// The field of a manifest that names the build.
pub const BUILD: &str = "build_sha256";
/// Its trials that have no result, with the reason.
pub const LEFT_OUT: &str = "left_out.jsonl";
/// How long they took.
pub const TIMINGS: &str = "timings.jsonl";
/// Attempts from outside: of the first seed and of each failure.
pub const FILMS: &str = "films";
/// Folder of the recordings.
pub const RECORDS: &str = "records";

/// A part of an experiment: every `of`-th seed, from the `index`-th on. Trials that are to be compared stay together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Shard {
    /// From 1 on.
    pub index: usize,
    /// How many there are.
    pub of: usize,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let shard = text.split_once('/').and_then(|(index, of)| {
            let shard = Self { index: index.parse().ok()?, of: of.parse().ok()? };
            (1..=shard.of).contains(&shard.index).then_some(shard)
        });
        shard.ok_or_else(|| format!("{text}: give I/N with I from 1 to N, such as 2/4"))
    }
}

/// What identifies a trial within an experiment, in the order in which trials are listed.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
pub struct Key {
    /// The seed.
    pub seed: u64,
    /// The scene's name.
    pub scene: String,
    /// The condition's name.
    pub condition: String,
    /// The estimator's name.
    pub estimator: String,
    /// The grasp planner's name; left out where it is our own.
    #[serde(default = "grip", skip_serializing_if = "is_grip")]
    pub grasper: String,
}

fn grip() -> String {
    GRIP.into()
}

fn is_grip(grasper: &String) -> bool {
    grasper == GRIP
}

impl Key {
    /// Of a result.
    pub fn of(result: &TrialResult) -> Self {
        Self {
            seed: result.seed,
            scene: result.scene.clone(),
            condition: result.condition.clone(),
            estimator: result.estimator.clone(),
            grasper: result.grasper.clone(),
        }
    }

    /// The path of its film in the experiment's folder.
    pub fn film(&self) -> PathBuf {
        Path::new(FILMS).join(format!("{}.jpg", self.words()))
    }

    /// The path of its recording in the experiment's folder.
    pub fn record(&self) -> PathBuf {
        Path::new(RECORDS).join(self.words())
    }

    fn words(&self) -> String {
        let Self { seed, scene, condition, estimator, grasper } = self;
        let by = if is_grip(grasper) { String::new() } else { format!("-{grasper}") };
        format!("{seed}-{scene}-{condition}-{estimator}{by}")
    }

    /// Who estimated, and who planned grasps where that is not our own planner.
    pub fn method(&self) -> String {
        method(&self.estimator, &self.grasper)
    }
}

/// What an experiment is to be. The default is ten trials of the grocery scene in base light with GRIP.
#[derive(Debug, Clone)]
pub struct TrialsOptions {
    /// Trials of each scene, condition, estimator and grasp planner: one a seed, from the setup's seed on.
    pub trials: u32,
    /// Scene files; the setup's where it is empty.
    pub scenes: Vec<PathBuf>,
    /// Conditions, by name or file.
    pub conditions: Vec<String>,
    /// Who estimates.
    pub estimators: Vec<EstimatorKind>,
    /// Who plans grasps.
    pub graspers: Vec<GrasperKind>,
    /// Who proposes boxes to GRIP.
    pub detector: DetectorKind,
    /// Which network the detector `pyramid` is.
    pub network: DetectorOptions,
    /// Folder of grasps to use instead of those that are found.
    pub grasps: Option<PathBuf>,
    /// Only every N-th seed.
    pub shard: Option<Shard>,
    /// What is kept of what is known of each trial.
    pub record: RecordOptions,
    /// Objects, robot, settings and the first seed.
    pub setup: SetupOptions,
}

impl Default for TrialsOptions {
    fn default() -> Self {
        Self {
            trials: 10,
            scenes: Vec::new(),
            conditions: vec!["base".into()],
            estimators: vec![EstimatorKind::Grip],
            graspers: vec![GrasperKind::Grip],
            detector: DetectorKind::Pyramid,
            network: DetectorOptions::default(),
            grasps: None,
            shard: None,
            record: RecordOptions::default(),
            setup: SetupOptions::default(),
        }
    }
}

/// experiment.json: all that its trials depend on.
#[derive(Serialize, JsonSchema)]
pub struct ExperimentFile<'a> {
    schema: &'static str,
    program: Program,
    /// Of each scene, condition, estimator and grasp planner.
    trials: u32,
    first_seed: u64,
    /// As in scenario.json.
    estimators: Vec<Value>,
    /// As in scenario.json; left out where all grasps are our own planner's.
    #[serde(skip_serializing_if = "Option::is_none")]
    graspers: Option<Vec<Value>>,
    /// Of each scene, as in their files.
    conditions: Vec<&'a [ConditionSpec]>,
    /// scenario.json of each scene, but for what differs between its trials.
    scenarios: Vec<Value>,
    shard: Option<Shard>,
    /// SHA-256 of the program's file.
    build_sha256: Option<String>,
}

/// A scene of the experiment, ready to be run with any seed.
pub struct Stage {
    setup: Setup,
    conditions: Vec<ConditionSpec>,
    /// Its planner, which knows the grasps of objects after their first use.
    pub planner: Planner,
    /// The estimators.
    pub estimators: Vec<Estimator>,
    /// The grasp planners.
    pub graspers: Vec<Grasper>,
}

/// A trial to be run.
#[derive(Debug, Clone)]
pub struct Case {
    /// What identifies it.
    pub key: Key,
    /// Position among the scenes.
    pub scene: usize,
    condition: usize,
    /// Position among the estimators.
    pub estimator: usize,
    /// Position among the grasp planners.
    pub grasper: usize,
}

/// An experiment.
pub struct Plan {
    /// The scenes.
    pub stages: Vec<Stage>,
    /// The lowest seed.
    pub first_seed: u64,
    /// How many seeds there are, in all shards.
    pub seeds: u32,
    /// Whether to keep pictures of the first seed and of failures, most of what an experiment takes on a disk.
    pub films: bool,
    /// What is kept of what is known of each trial.
    pub record: RecordOptions,
    shard: Option<Shard>,
    estimator_names: Vec<String>,
    grasper_names: Vec<String>,
    /// The folder of grasp files, if the planners use one.
    pub grasps: Option<PathBuf>,
    /// Who draws: `wgpu` or `cpu`.
    pub renderer: &'static str,
    manifest: Value,
}

impl Plan {
    /// Reads all files that `options` name, and lists the trials of its shard. `renderer` is who will draw.
    ///
    /// # Errors
    /// When a file is wrong, or two scenes have one name.
    pub fn new(options: &TrialsOptions, renderer: &'static str) -> Result<Self> {
        let first_seed = options.setup.seed;
        let estimators: Vec<String> = options.estimators.iter().map(EstimatorKind::name).collect();
        no_name_twice(&estimators, "--estimators")?;
        let graspers: Vec<String> = options.graspers.iter().map(GrasperKind::name).collect();
        no_name_twice(&graspers, "--graspers")?;
        ensure!(
            options.grasps.is_none() || options.graspers.contains(&GrasperKind::Grip),
            "--grasps is for grasper grip; leave it out"
        );
        let some_stage = options.estimators.iter().any(|kind| kind.second_stage().is_some());
        options.network.check_used(
            some_stage && options.detector == DetectorKind::Pyramid,
            "--detector pyramid and estimator grip or paper",
        )?;
        ensure!(
            some_stage || options.network.min_confidence == 0.0,
            "--min-confidence is for estimator grip or paper; leave it out"
        );
        let mut stages: Vec<Stage> = Vec::new();
        let scenes = match options.scenes.as_slice() {
            [] => std::slice::from_ref(&options.setup.scene),
            given => given,
        };
        for scene in scenes {
            let stage = Stage::open(options, scene)?;
            let name = &stage.setup.cell.scene.name;
            ensure!(
                stages.iter().all(|other| &other.setup.cell.scene.name != name),
                "--scene {}: another scene has the same name, {name}; give each its own",
                scene.display()
            );
            stages.push(stage);
        }
        for stage in &stages {
            let names: Vec<String> =
                stage.conditions.iter().map(|condition| condition.name.clone()).collect();
            no_name_twice(&names, "--conditions")?;
            if let Some(odd) = names.iter().find(|name| name.contains(['/', '\\'])) {
                bail!("--conditions: the name {odd} becomes a part of a file's name; leave out the slash");
            }
        }
        if let Some(EstimatorKind::Csv(file)) =
            options.estimators.iter().find(|kind| matches!(kind, EstimatorKind::Csv(_)))
        {
            let recorded = Recorded::read(file)?;
            ensure!(
                stages.len() * stages[0].conditions.len() == 1,
                "--estimators csv: a results file is of one scene in one condition; run each by itself and give grip report all \
                 folders"
            );
            let unknown = (first_seed..).take(options.trials as usize).find(|seed| !recorded.knows(*seed));
            if let Some(seed) = unknown {
                bail!(
                    "--estimators csv: the file has no row for scene_id {seed}; give --seed and --trials that it knows"
                );
            }
        }
        ensure!(
            first_seed.checked_add(u64::from(options.trials).saturating_sub(1)).is_some(),
            "--seed {first_seed}: too large for {} trials; give a lower one",
            options.trials
        );
        let scenarios = stages
            .iter()
            .map(|stage| {
                let (setup, any) = (&stage.setup, &stage.estimators[0]);
                let items = setup.models.len();
                let grasps = (&Grasper::Grip, options.grasps.as_deref());
                let scenario = Scenario::new(setup, any, grasps, items, renderer)?;
                let mut scenario = scenario.json().clone();
                for varies in ["seed", "estimator", "grasper", "condition", "items", "program"] {
                    scenario.as_object_mut().map(|fields| fields.remove(varies));
                }
                Ok(scenario)
            })
            .collect::<Result<Vec<Value>>>()?;
        let conditions: Vec<&[ConditionSpec]> = stages.iter().map(|s| s.conditions.as_slice()).collect();
        let manifest = serde_json::to_value(ExperimentFile {
            schema: SCHEMA,
            program: program(),
            trials: options.trials,
            first_seed,
            estimators: stages[0].estimators.iter().map(Estimator::description).collect(),
            graspers: (options.graspers != [GrasperKind::Grip])
                .then(|| stages[0].graspers.iter().map(Grasper::description).collect()),
            conditions,
            scenarios,
            shard: options.shard,
            build_sha256: build(),
        })?;
        let grasps = options.grasps.clone();
        Ok(Self {
            stages,
            first_seed,
            seeds: options.trials,
            films: true,
            record: options.record,
            shard: options.shard,
            estimator_names: estimators,
            grasper_names: graspers,
            grasps,
            renderer,
            manifest,
        })
    }

    /// The trials of the shard, by seed first: those that are to be compared come one after the other.
    pub fn cases(&self) -> Vec<Case> {
        let Shard { index, of } = self.shard.unwrap_or(Shard { index: 1, of: 1 });
        let all = (0..u64::from(self.seeds)).map(|i| self.first_seed + i);
        self.cases_of(all.skip(index - 1).step_by(of))
    }

    /// The trials of these seeds.
    pub fn cases_of(&self, seeds: impl IntoIterator<Item = u64>) -> Vec<Case> {
        let mut cases = Vec::new();
        for seed in seeds {
            for (scene, stage) in self.stages.iter().enumerate() {
                for (condition, spec) in stage.conditions.iter().enumerate() {
                    for (estimator, name) in self.estimator_names.iter().enumerate() {
                        for (grasper, planner) in self.grasper_names.iter().enumerate() {
                            let key = Key {
                                seed,
                                scene: stage.setup.cell.scene.name.clone(),
                                condition: spec.name.clone(),
                                estimator: name.clone(),
                                grasper: planner.clone(),
                            };
                            cases.push(Case { key, scene, condition, estimator, grasper });
                        }
                    }
                }
            }
        }
        cases
    }

    /// experiment.json.
    pub fn manifest(&self) -> &Value {
        &self.manifest
    }

    /// Makes the experiment's folder, or makes sure that it is the same experiment that goes on.
    ///
    /// # Errors
    /// When it is there although nothing is to be resumed, is another experiment, or cannot be written.
    pub fn begin(&self, out: &Path, resume: bool) -> Result<()> {
        begin(out, MANIFEST, SCHEMA, &self.manifest, resume)?;
        let films = out.join(FILMS);
        std::fs::create_dir_all(&films).with_context(|| format!("{}: cannot be made", films.display()))
    }

    /// The setup of a trial.
    pub fn setup(&self, case: &Case) -> Setup {
        let stage = &self.stages[case.scene];
        stage.setup.with_seed(case.key.seed, &stage.conditions[case.condition])
    }
}

impl Stage {
    fn open(options: &TrialsOptions, scene: &Path) -> Result<Self> {
        let first = options.conditions.first().map_or("base", String::as_str);
        let setup = Setup::open(&SetupOptions {
            scene: scene.to_path_buf(),
            condition: first.to_owned(),
            ..options.setup.clone()
        })?;
        let conditions = options
            .conditions
            .iter()
            .map(|name| setup::load_condition(&setup.cell.folder, name))
            .collect::<Result<_>>()?;
        let planner = setup.planner_with_grasps(options.grasps.as_deref())?;
        let estimators = options
            .estimators
            .iter()
            .map(|kind| {
                // Options of the network are for those that use it.
                let none = DetectorOptions::default();
                let network = if kind.second_stage().is_some() { &options.network } else { &none };
                Estimator::open(&setup, kind, options.detector, network)
            })
            .collect::<Result<_>>()?;
        let graspers =
            options.graspers.iter().map(|kind| Grasper::open(&setup, kind)).collect::<Result<_>>()?;
        Ok(Self { setup, conditions, planner, estimators, graspers })
    }
}

/// Makes a folder whose file `name` says what is in it, or makes sure that it is the same that goes on.
///
/// # Errors
/// When it is there although nothing is to be resumed, something else is in it, or it cannot be written.
pub fn begin(out: &Path, name: &str, schema: &str, manifest: &Value, resume: bool) -> Result<()> {
    let path = out.join(name);
    if path.exists() {
        ensure!(
            resume,
            "{}: was begun before; --resume goes on with what is there, or choose another --out",
            out.display()
        );
        let before = read_schema(&path, schema)?;
        if let Some(field) = differs(&before, manifest) {
            bail!(
                "{}: {field} is not what it was in the beginning; give the same options and files, or choose another --out",
                path.display()
            );
        }
        if before[BUILD] != manifest[BUILD] {
            log::warn!("{}: was begun by another build; results may differ in last bits", path.display());
        }
        return Ok(());
    }
    // What a kill may have left before there was anything to keep.
    let leftover = |name: &str| name.starts_with('.') && name.ends_with(".tmp");
    let strange = out.exists()
        && std::fs::read_dir(out)
            .with_context(|| format!("{}: is no folder; choose another --out", out.display()))?
            .flatten()
            .any(|entry| !leftover(&entry.file_name().to_string_lossy()));
    ensure!(!strange, "{}: exists and is not ours: it has no {name}; choose another --out", out.display());
    std::fs::create_dir_all(out).with_context(|| {
        format!("{}: cannot be made; check permissions or choose another --out", out.display())
    })?;
    Ok(bop::write_atomic(&path, serde_json::to_string_pretty(manifest)?.as_bytes())?)
}

static THIS_BUILD: OnceLock<Option<String>> = OnceLock::new();

/// The program's file, where it is not that of the process.
static PROGRAM: OnceLock<PathBuf> = OnceLock::new();

/// The file that the program is in: that of the process, or of a module that the process has loaded ([`program_is`]).
pub fn program_file() -> Option<PathBuf> {
    PROGRAM.get().cloned().or_else(|| std::env::current_exe().ok())
}

/// Says which file the program is in, where the process is another's, such as Python's.
pub fn program_is(file: PathBuf) {
    let _ = PROGRAM.set(file);
}

/// SHA-256 of this program's file: results of different builds may differ in last bits. None where it cannot be read.
pub fn build() -> Option<String> {
    let read = || {
        let bytes = std::fs::read(program_file()?).ok()?;
        Some(format!("{:x}", Sha256::digest(bytes)))
    };
    THIS_BUILD.get_or_init(read).clone()
}

/// Says what [`build`] is to say, where somebody knows it already: to read a program again takes half a second.
pub fn know_build(sha256: String) {
    let _ = THIS_BUILD.set(Some(sha256));
}

fn no_name_twice(names: &[String], option: &str) -> Result<()> {
    match names.iter().enumerate().find(|(i, name)| names[..*i].contains(name)) {
        Some((_, twice)) => {
            bail!("{option}: two are called {twice}; give each once, or rename one of the files")
        }
        None => Ok(()),
    }
}

/// What an experiment's folder says that it is.
///
/// # Errors
/// When there is no such file, or it is not one of ours.
pub fn read_manifest(folder: &Path) -> Result<Value> {
    read_schema(&folder.join(MANIFEST), SCHEMA)
}

/// How many trials a manifest speaks of: all, or those of its shard.
pub fn expected(manifest: &Value) -> usize {
    let count = |of: &Value| of.as_array().map_or(0, Vec::len);
    let seeds = manifest["trials"].as_u64().unwrap_or(0) as usize;
    let of_shard = match serde_json::from_value::<Option<Shard>>(manifest["shard"].clone()) {
        Ok(Some(Shard { index, of })) => (seeds + of).saturating_sub(index) / of.max(1),
        _ => seeds,
    };
    let conditions: usize = manifest["conditions"].as_array().map_or(0, |all| all.iter().map(count).sum());
    // Where none is named all grasps are our own planner's.
    of_shard * conditions * count(&manifest["estimators"]) * count(&manifest["graspers"]).max(1)
}

/// A JSON file whose `schema` must be this one.
///
/// # Errors
/// When there is no such file, or it has another schema.
pub fn read_schema(path: &Path, schema: &str) -> Result<Value> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("{}: cannot be read; is it the right folder?", path.display()))?;
    let value: Value =
        serde_json::from_str(&text).with_context(|| format!("{}: is damaged", path.display()))?;
    ensure!(
        value["schema"] == schema,
        "{}: schema = {}: this program reads {schema}",
        path.display(),
        value["schema"]
    );
    Ok(value)
}

/// The first field, by its path, in which two values differ.
pub fn differs(a: &Value, b: &Value) -> Option<String> {
    fn walk(a: &Value, b: &Value, path: &str) -> Option<String> {
        match (a, b) {
            (Value::Object(x), Value::Object(y)) => {
                let keys: std::collections::BTreeSet<&String> = x.keys().chain(y.keys()).collect();
                keys.into_iter().find_map(|key| {
                    // Where files lie does not matter; their content does. Other builds may go on, with a warning.
                    if key == "path" || key == "program" || key == BUILD {
                        return None;
                    }
                    let null = &Value::Null;
                    let dot = if path.is_empty() { "" } else { "." };
                    walk(x.get(key).unwrap_or(null), y.get(key).unwrap_or(null), &format!("{path}{dot}{key}"))
                })
            }
            (Value::Array(x), Value::Array(y)) if x.len() == y.len() => {
                x.iter().zip(y).enumerate().find_map(|(i, (x, y))| walk(x, y, &format!("{path}[{i}]")))
            }
            (x, y) if x == y => None,
            _ => Some(path.to_owned()),
        }
    }
    walk(a, b, "")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn shards_are_given_as_one_of_many() {
        assert_eq!("2/4".parse(), Ok(Shard { index: 2, of: 4 }));
        for wrong in ["0/4", "5/4", "1", "a/b", "1/0", "-1/2", ""] {
            assert!(wrong.parse::<Shard>().unwrap_err().contains("I/N"), "{wrong}");
        }
    }

    #[test]
    fn the_manifest_tells_how_many_trials_there_are_to_be() {
        let of = |shard: Value| {
            let manifest = json!({
                "trials": 10, "estimators": ["a", "b"], "conditions": [["x", "y", "z"], ["x", "y", "z"]], "shard": shard,
            });
            expected(&manifest)
        };
        assert_eq!(of(Value::Null), 10 * 2 * 6);
        let shards: usize = (1..=4).map(|i| of(json!({ "index": i, "of": 4 }))).sum();
        assert_eq!(shards, 10 * 2 * 6);
        let graspers =
            json!({ "trials": 2, "estimators": ["a"], "conditions": [["x"]], "graspers": ["g", "h", "i"] });
        assert_eq!(expected(&graspers), 2 * 3);
    }

    #[test]
    fn the_field_that_differs_is_named() {
        let a =
            json!({"scenarios": [{"scene": {"table": {"height": 0.7}}, "robot": {"path": "/a"}}], "n": 1});
        let mut b = a.clone();
        b["scenarios"][0]["robot"]["path"] = json!("/b");
        assert_eq!(differs(&a, &b), None);
        b["scenarios"][0]["scene"]["table"]["height"] = json!(0.71);
        assert_eq!(differs(&a, &b).as_deref(), Some("scenarios[0].scene.table.height"));
        assert_eq!(differs(&a, &json!({"scenarios": [], "n": 1})).as_deref(), Some("scenarios"));
        assert_eq!(differs(&a, &a), None);
    }
}
