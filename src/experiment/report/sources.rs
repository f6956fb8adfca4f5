//! What a page is made of, read from folders.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use super::origin::{Kind, Origin};
use super::replay;
use crate::campaign::manifest::{self, Campaign, Job};
use crate::campaign::unit;
use crate::experiment::journal;
use crate::experiment::plan::{self, Key, LEFT_OUT, TIMINGS, TRIALS};
use crate::experiment::sweep::{self, GraspLine};
use crate::experiment::trials::{LeftOut, TimingLine};
use crate::score::outcome::{Outcome, Timing, TrialResult, method};

/// Everything a page is made of.
#[derive(Default)]
pub struct Sources {
    /// All trials. Those of more than one experiment have its folder's name in their estimator's.
    pub trials: Vec<TrialResult>,
    /// How long they took, as far as it is known, with the names of estimator and grasp planner.
    pub timings: Vec<(String, Timing)>,
    /// Films: the trial, and a JPEG.
    pub films: BTreeMap<Key, PathBuf>,
    /// Sweeps.
    pub sweeps: Vec<SweepSource>,
    /// Figures made before, with their names.
    pub figures: Vec<(String, String)>,
    /// What a reader should know of the sources.
    pub notes: Vec<String>,
    /// What was read, in the order of the call.
    pub origins: Vec<Origin>,
    /// How a trial that did not pack everything is run again.
    pub replays: BTreeMap<Key, String>,
}

/// A sweep.
pub struct SweepSource {
    /// The folder's name.
    pub name: String,
    /// sweep.json.
    pub manifest: Value,
    /// Its grasps.
    pub lines: Vec<GraspLine>,
}

impl Sources {
    /// Reads run folders and SVG files.
    ///
    /// # Errors
    /// When one of them is none of ours, or damaged.
    pub fn read(paths: &[PathBuf]) -> Result<Self> {
        let mut sources = Self::default();
        let mut known = BTreeSet::new();
        let is = |path: &Path, name: &str| path.join(name).exists();
        let several = paths.iter().filter(|p| is(p, plan::MANIFEST) || is(p, manifest::FILE)).count() > 1;
        for path in paths {
            let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
            let label = several.then_some(name.as_str());
            if is(path, manifest::FILE) {
                sources.add_campaign(path, name.clone(), label)?;
            } else if is(path, plan::MANIFEST) {
                let about = plan::read_manifest(path)?;
                let trials = sources.add_trials(path, &about, label)?;
                let left_out = sources.add_left_out(path, journal::read(&path.join(LEFT_OUT))?, &about);
                let of = plan::expected(&about);
                if trials + left_out < of {
                    sources.notes.push(format!(
                        "{}: {trials} of {of} trials are there; the others can be run with --resume, or in their shards.",
                        path.display()
                    ));
                }
                let of = of.saturating_sub(left_out);
                let shard = serde_json::from_value(about["shard"].clone()).unwrap_or_default();
                sources.origins.push(Origin::new(path, Kind::Trials { trials, of, shard }, &about));
            } else if is(path, sweep::MANIFEST) {
                let about = sweep::read_manifest(path)?;
                let lines: Vec<GraspLine> = journal::read(&path.join(sweep::GRASPS))?;
                sources.origins.push(Origin::new(path, Kind::Sweep { grasps: lines.len() }, &about));
                sources.sweeps.push(SweepSource { name, manifest: about, lines });
            } else if path.join("result.json").exists() {
                sources.add_run(path)?;
            } else if path.extension().is_some_and(|e| e == "svg") {
                let text = std::fs::read_to_string(path)
                    .with_context(|| format!("{}: cannot be read", path.display()))?;
                let begin = text.find("<svg");
                let begin = begin.with_context(|| format!("{}: is no SVG file", path.display()))?;
                sources.figures.push((name, text[begin..].to_owned()));
            } else {
                bail!(
                    "{}: has neither {}, {}, {} nor result.json; give folders that grip trials, sweep, campaign or pack have \
                     made, or SVG files",
                    path.display(),
                    plan::MANIFEST,
                    sweep::MANIFEST,
                    manifest::FILE
                );
            }
        }
        let mut made: BTreeMap<[&str; 4], BTreeSet<[&str; 4]>> = BTreeMap::new();
        for trial in &sources.trials {
            let cell = [&*trial.scene, &trial.condition, &trial.estimator, &trial.grasper];
            let how = [&*trial.detector, &trial.object_set, &trial.renderer, &trial.hypotheses];
            made.entry(cell).or_default().insert(how);
        }
        for ([scene, condition, estimator, grasper], ways) in made.iter().filter(|(_, ways)| ways.len() > 1) {
            let method = method(estimator, grasper);
            let ways: Vec<String> = ways.iter().map(|way| way.join(" ")).collect();
            sources.notes.push(format!(
                "{scene} {condition} {method}: trials of several kinds are counted together: {}.",
                ways.join("; ")
            ));
        }
        for trial in &sources.trials {
            let key = Key::of(trial);
            ensure!(
                !known.contains(&key),
                "scene {}, condition {}, {}, seed {}: more than one of the folders has this trial; give each folder once, and \
                 each a name of its own",
                key.scene,
                key.condition,
                key.method(),
                key.seed
            );
            known.insert(key);
        }
        ensure!(
            !sources.trials.is_empty() || sources.sweeps.iter().any(|s| !s.lines.is_empty()),
            "there are no results yet in what was given"
        );
        Ok(sources)
    }

    /// A campaign, as far as its units are done or begun.
    fn add_campaign(&mut self, path: &Path, name: String, label: Option<&str>) -> Result<()> {
        let campaign = Campaign::open(path)?;
        let units = campaign.manifest.units.len();
        let folders = |file: &'static str| {
            let all = (0..units).map(|unit| campaign.unit_folder(unit));
            all.filter(move |folder| folder.join(file).exists())
        };
        let mut nodes: BTreeSet<String> = BTreeSet::new();
        let mut done = 0;
        for number in 0..units {
            if let Some(unit) = unit::done(&campaign, number)? {
                done += 1;
                nodes.insert(unit.node.cpu);
            }
        }
        let (about, results) = match &campaign.manifest.work {
            Job::Trials { .. } => {
                let about = plan::read_manifest(&campaign.shared())?;
                let (mut trials, mut left_out) = (0, Vec::new());
                for folder in folders(TRIALS) {
                    trials += self.add_trials(&folder, &about, label)?;
                    left_out.extend(journal::read::<LeftOut>(&folder.join(LEFT_OUT)).unwrap_or_default());
                }
                self.add_left_out(path, left_out, &about);
                (about, format!("{trials} trials"))
            }
            Job::Sweep { .. } => {
                let about = sweep::read_manifest(&campaign.shared())?;
                let mut lines: Vec<GraspLine> = Vec::new();
                for folder in folders(sweep::GRASPS) {
                    lines.extend(journal::read(&folder.join(sweep::GRASPS))?);
                }
                let results = format!("{} grasps", lines.len());
                self.sweeps.push(SweepSource { name, manifest: about.clone(), lines });
                (about, results)
            }
            Job::Scenes { .. } | Job::Estimate { .. } => bail!(
                "{}: is a campaign of {}, of which there is no page; merge it (grip campaign merge) and measure poses with grip \
                 eval",
                path.display(),
                campaign.manifest.work.verb().name()
            ),
        };
        if done < units {
            let path = path.display();
            self.notes.push(format!(
                "{path}: {done} of {units} units are done; grip campaign run goes on with the others."
            ));
        }
        let cpus = nodes.into_iter().collect();
        let name = campaign.manifest.name.clone();
        self.origins.push(Origin::new(path, Kind::Campaign { name, done, units, results, cpus }, &about));
        Ok(())
    }

    /// Says how many trials have no result; returns how many.
    fn add_left_out(&mut self, path: &Path, left_out: Vec<LeftOut>, about: &Value) -> usize {
        if !left_out.is_empty() {
            self.notes.push(format!(
                "{}: {} of {} trials have no result, because their objects could not be laid out.",
                path.display(),
                left_out.len(),
                plan::expected(about)
            ));
        }
        left_out.len()
    }

    /// The trials in a folder of the experiment that `about` tells of; returns how many.
    fn add_trials(&mut self, folder: &Path, about: &Value, label: Option<&str>) -> Result<usize> {
        let mut trials: Vec<TrialResult> = journal::read(&folder.join(TRIALS))?;
        let mut timings: BTreeMap<Key, Timing> = BTreeMap::new();
        let file = folder.join(TIMINGS);
        if file.exists() {
            timings
                .extend(journal::read::<TimingLine>(&file)?.into_iter().map(|line| (line.key, line.timing)));
        }
        for trial in &mut trials {
            let mut key = Key::of(trial);
            let film = folder.join(key.film());
            let timing = timings.remove(&key);
            let again = failed(trial).then(|| replay::command(trial, about));
            if let Some(label) = label {
                trial.estimator = format!("{} ({label})", trial.estimator);
                key = Key::of(trial);
            }
            self.timings.extend(timing.map(|timing| (trial.method(), timing)));
            self.replays.extend(again.map(|command| (key.clone(), command)));
            if film.exists() {
                self.films.insert(key, film);
            }
        }
        let count = trials.len();
        self.trials.extend(trials);
        Ok(count)
    }

    /// A single trial by `grip pack`.
    fn add_run(&mut self, folder: &Path) -> Result<()> {
        let path = folder.join("result.json");
        let text =
            std::fs::read_to_string(&path).with_context(|| format!("{}: cannot be read", path.display()))?;
        let mut trial: TrialResult = serde_json::from_str(&text)
            .with_context(|| format!("{}: is no result of this version; run it again", path.display()))?;
        let timing = trial.timing.take();
        self.timings.extend(timing.map(|timing| (trial.method(), timing)));
        let film = folder.join("film.jpg");
        if film.exists() {
            self.films.insert(Key::of(&trial), film);
        }
        let about = std::fs::read(folder.join("scenario.json"));
        let about = about.ok().and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default();
        if failed(&trial) {
            self.replays.insert(Key::of(&trial), replay::command(&trial, &about));
        }
        self.origins.push(Origin::new(folder, Kind::Trial, &about));
        self.trials.push(trial);
        Ok(())
    }
}

/// Whether something was not packed.
fn failed(trial: &TrialResult) -> bool {
    trial.items.iter().any(|item| item.outcome != Outcome::Packed)
}
