//! `grip report`: one page, and CSV files, of any experiments, sweeps and single runs.

mod calibration;
mod figures;
mod page;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

pub use self::page::{html, p_value};
use super::plan::{self, Key, LEFT_OUT, TIMINGS, TRIALS};
use super::sweep::{self, GraspLine};
use super::trials::{LeftOut, TimingLine};
use super::{journal, summary};
use crate::score::outcome::{Timing, TrialResult, method};

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
        let experiments = paths.iter().filter(|p| p.join(plan::MANIFEST).exists()).count();
        for path in paths {
            let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
            if path.join(plan::MANIFEST).exists() {
                let of = plan::expected(&plan::read_manifest(path)?);
                let label = (experiments > 1).then_some(name.as_str());
                let trials = sources.add_experiment(path, label)?;
                let left_out = journal::read::<LeftOut>(&path.join(LEFT_OUT))?.len();
                if left_out > 0 {
                    sources.notes.push(format!(
                        "{}: {left_out} of {of} trials have no result, because their objects could not be laid out.",
                        path.display()
                    ));
                }
                if trials + left_out < of {
                    sources.notes.push(format!(
                        "{}: {trials} of {of} trials are there; the others can be run with --resume, or in their shards.",
                        path.display()
                    ));
                }
            } else if path.join(sweep::MANIFEST).exists() {
                sources.sweeps.push(SweepSource {
                    name,
                    manifest: sweep::read_manifest(path)?,
                    lines: journal::read(&path.join(sweep::GRASPS))?,
                });
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
                    "{}: has neither {}, {} nor result.json; give folders that grip trials, sweep or pack have made, or SVG \
                     files",
                    path.display(),
                    plan::MANIFEST,
                    sweep::MANIFEST
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

    /// An experiment; returns how many trials it has.
    fn add_experiment(&mut self, folder: &Path, label: Option<&str>) -> Result<usize> {
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
            if let Some(label) = label {
                trial.estimator = format!("{} ({label})", trial.estimator);
                key = Key::of(trial);
            }
            self.timings.extend(timing.map(|timing| (trial.method(), timing)));
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
        self.trials.push(trial);
        Ok(())
    }
}

/// The figures of the page as CSV files: each with its name and content.
///
/// # Errors
/// When a value cannot be written as text.
pub fn tables(sources: &Sources) -> Result<Vec<(&'static str, String)>> {
    let mut files = Vec::new();
    if !sources.trials.is_empty() {
        let mut text =
            String::from("scene,condition,estimator,grasper,trials,full,items,packed,share,low,high\n");
        for c in summary::cells(&sources.trials) {
            let names = [&c.scene, &c.condition, &c.estimator, &c.grasper].map(|name| quoted(name));
            text += &format!(
                "{},{},{},{},{},{},{},{}\n",
                names.join(","),
                c.trials,
                c.full,
                c.items,
                c.packed,
                c.share,
                c.interval[0],
                c.interval[1]
            );
        }
        files.push(("trials", text));
        let mut text = String::from(
            "seed,scene,condition,estimator,grasper,object,instance,outcome,attempts,add_m,adds_m,slip_m,camera_shift_m,camera_turn_rad\n",
        );
        for (trial, item) in sources.trials.iter().flat_map(|t| t.items.iter().map(move |i| (t, i))) {
            let number = |v: Option<f64>| v.map_or(String::new(), |v| v.to_string());
            text += &format!(
                "{},{},{},{},{},{},{},{},{},{},{},{},{},{}\n",
                trial.seed,
                quoted(&trial.scene),
                quoted(&trial.condition),
                quoted(&trial.estimator),
                quoted(&trial.grasper),
                quoted(&item.object),
                item.instance,
                quoted(item.outcome.words()),
                item.attempts,
                number(item.add_m),
                number(item.adds_m),
                number(item.slip_m),
                number(trial.calibration.map(|record| record.camera_shift_m)),
                number(trial.calibration.map(|record| record.camera_turn_rad)),
            );
        }
        files.push(("items", text));
    }
    if !sources.sweeps.is_empty() {
        let mut text = String::from("sweep,object,axis,value,tried,held,share,low,high\n");
        for sweep in &sources.sweeps {
            for object in sweep::fits::results(&sweep.lines) {
                for axis in &object.axes {
                    for s in &axis.shares {
                        text += &format!(
                            "{},{},{},{},{},{},{},{},{}\n",
                            quoted(&sweep.name),
                            quoted(&object.object),
                            axis.axis.name(),
                            s.value,
                            s.tried,
                            s.held,
                            s.share,
                            s.interval[0],
                            s.interval[1]
                        );
                    }
                }
            }
        }
        files.push(("sweep", text));
    }
    Ok(files)
}

/// A text as a field of a CSV file.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
