//! The work of a campaign, opened from the options of its verb.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use clap::Parser;
use grip_sim::render::{self, RendererChoice};
use serde_json::{Map, Value};
use sha2::{Digest, Sha256};

use crate::benchmark::sequences;
use crate::campaign::Verb;
use crate::campaign::file::Header;
use crate::campaign::manifest::{Arm, FileDigest, Images, Job, Unit, digest, digests_below};
use crate::campaign::merge::{POSTERIORS, RESULTS};
use crate::campaign::unit::{Ran, Work};
use crate::cli::{Cli, Command, EstimateArgs, ScenesArgs, SweepArgs, TrialsArgs, options};
use crate::commands::estimate;
use crate::dataset;
use crate::experiment::plan::{self, FILMS};
use crate::experiment::sweep;
use crate::experiment::trials;
use crate::progress::Progress;
use crate::record::RecordOptions;
use crate::setup::{ADVERSARIAL, Setup};

/// What is told of an `estimate` campaign: a file of ours, since a results file says nothing.
const ESTIMATE: &str = "estimate.json";

/// A verb, ready to run any of its items.
pub enum Opened {
    Trials { plan: plan::Plan, renderer: RendererChoice },
    Sweep(Box<sweep::Sweep>),
    Scenes { setup: Box<Setup>, plan: Box<dataset::Plan>, renderer: RendererChoice },
    Estimate { args: Box<EstimateArgs>, opened: estimate::Opened, sequences: Vec<Vec<(u32, u32)>> },
}

impl Opened {
    /// Opens all that the options name, seen from the current folder.
    pub fn open(verb: Verb, options: &Map<String, Value>, films: bool) -> Result<Self> {
        let mut options = options.clone();
        let posteriors = options.remove("posteriors") == Some(Value::Bool(true));
        let words = options::words(verb.name(), &options).with_context(|| format!("[{}]", verb.name()))?;
        let record = options.contains_key("record");
        match Cli::try_parse_from(words).with_context(|| format!("[{}]", verb.name()))?.command {
            Command::Trials(args) => Self::trials(&args, films, record),
            Command::Sweep(args) => Self::sweep(&args),
            Command::Scenes(args) => Self::scenes(&args),
            Command::Estimate(args) => Self::estimate(args, posteriors),
            _ => bail!("{}: is no verb of campaigns", verb.name()),
        }
    }

    fn trials(args: &TrialsArgs, films: bool, record: bool) -> Result<Self> {
        let renderer: RendererChoice = args.renderer.into();
        let mut plan = plan::Plan::new(&args.options()?, render::open(renderer)?.name())?;
        plan.films = films;
        // Of a million trials records are kept only where that is asked for.
        if !record {
            plan.record = RecordOptions::default();
        }
        Ok(Self::Trials { plan, renderer })
    }

    fn sweep(args: &SweepArgs) -> Result<Self> {
        Ok(Self::Sweep(Box::new(sweep::Sweep::open(&args.options()?)?)))
    }

    fn scenes(args: &ScenesArgs) -> Result<Self> {
        let mut setup = Box::new(Setup::open(&args.scene.options(ADVERSARIAL, "base")?)?);
        let renderer: RendererChoice = args.scene.renderer.into();
        let device = render::open(renderer)?.device();
        let plan = Box::new(dataset::Plan::new(&args.options(), &mut setup, device)?);
        Ok(Self::Scenes { setup, plan, renderer })
    }

    fn estimate(mut args: EstimateArgs, posteriors: bool) -> Result<Self> {
        args.posteriors = posteriors.then(|| PathBuf::from(POSTERIORS));
        let opened = estimate::open(&args)?;
        let sequences = sequences(&opened.dataset, args.track)?;
        Ok(Self::Estimate { args: Box::new(args), opened, sequences })
    }

    /// What is made of each item.
    pub fn job(&self) -> Job {
        match self {
            Self::Trials { plan, .. } => {
                let cases = plan.cases_of([plan.first_seed]).into_iter();
                let arms = cases.map(|case| Arm {
                    scene: case.key.scene,
                    condition: case.key.condition,
                    estimator: case.key.estimator,
                    grasper: case.key.grasper,
                });
                let mut arms: Vec<Arm> = arms.collect();
                arms.sort_unstable();
                Job::Trials { arms, films: plan.films }
            }
            Self::Sweep(sweep) => {
                let mut objects = sweep.objects.clone();
                objects.sort_unstable();
                Job::Sweep { objects, cases: sweep.cases.len() }
            }
            Self::Scenes { plan, .. } => Job::Scenes { split: plan.split.clone() },
            Self::Estimate { args, .. } => Job::Estimate { posteriors: args.posteriors.is_some() },
        }
    }

    /// The work, cut.
    pub fn units(&self, header: &Header) -> Result<Vec<Unit>> {
        let (first, items) = match self {
            Self::Trials { plan, .. } => (plan.first_seed, u64::from(plan.seeds)),
            Self::Sweep(sweep) => (sweep.seeds.0, u64::from(sweep.seeds.1)),
            Self::Scenes { plan, .. } => (1, u64::from(plan.scenes)),
            Self::Estimate { sequences, .. } => (0, sequences.len() as u64),
        };
        ensure!(
            first.checked_add(items).is_some(),
            "seed = {first}: too large for {items} seeds; give a lower one"
        );
        let mut next = first;
        let mut listed = Listed::default();
        header
            .cut(items)?
            .into_iter()
            .map(|items| {
                let images = self.images(next, items, &mut listed)?;
                let unit = Unit { first: next, items, images };
                next += items;
                Ok(unit)
            })
            .collect()
    }

    /// The images of these items, where it is images.
    fn images(&self, first: u64, items: u64, listed: &mut Listed) -> Result<Option<Images>> {
        let Self::Estimate { opened, sequences, .. } = self else { return Ok(None) };
        let images = sequences.get(first as usize..(first + items) as usize).unwrap_or_default().concat();
        let (Some(&first), Some(&last)) = (images.first(), images.last()) else {
            bail!("the data set has fewer images than when the campaign was planned");
        };
        let mut hasher = Sha256::new();
        let split = opened.dataset.root().join(opened.dataset.split());
        let mut scene_before = None;
        for &(scene, image) in &images {
            let folder = split.join(format!("{scene:06}"));
            let mut files = listed.pictures(&folder, image);
            if scene_before.replace(scene) != Some(scene) {
                let of_scene = ["scene_camera.json", "scene_gt.json", "scene_gt_info.json"];
                files
                    .extend(of_scene.map(|name| folder.join(name)).into_iter().filter(|path| path.is_file()));
            }
            for path in files {
                let name = path.strip_prefix(&split).unwrap_or(&path).to_string_lossy();
                hasher.update(format!("{name} {}\n", digest(&path)?.sha256));
            }
        }
        let sha256 = format!("{:x}", hasher.finalize());
        Ok(Some(Images { count: images.len(), first: first.into(), last: last.into(), sha256 }))
    }

    /// Files that all units read, and that no option names: of a data set.
    pub fn inputs(&self) -> Result<Vec<FileDigest>> {
        let Self::Estimate { opened, .. } = self else { return Ok(Vec::new()) };
        let root = opened.dataset.root();
        let mut inputs = Vec::new();
        for folder in ["models", "models_eval", "models_cad", "models_fine"] {
            let folder = root.join(folder);
            if folder.is_dir() {
                let of = |file: FileDigest| FileDigest {
                    path: folder.join(file.path).to_string_lossy().into_owned(),
                    ..file
                };
                inputs.extend(digests_below(&folder)?.into_iter().map(of));
            }
        }
        for file in ["camera.json", "dataset.json", "test_targets_bop19.json", "test_targets_bop24.json"] {
            let path = root.join(file);
            if path.is_file() {
                inputs.push(digest(&path)?);
            }
        }
        Ok(inputs)
    }

    /// The file in which the verb says what it depends on, and what it says.
    pub fn manifest(&self) -> Result<(&'static str, Value)> {
        Ok(match self {
            Self::Trials { plan, .. } => (plan::MANIFEST, plan.manifest().clone()),
            Self::Sweep(sweep) => (sweep::MANIFEST, sweep.manifest()?),
            Self::Scenes { plan, .. } => (dataset::MANIFEST, serde_json::to_value(plan)?),
            Self::Estimate { opened, .. } => (ESTIMATE, opened.description().clone()),
        })
    }

    /// Writes what all units share to a new folder: what the verb writes before it begins.
    pub fn share(&self, folder: &Path) -> Result<()> {
        match self {
            Self::Trials { plan, .. } => {
                plan::begin(folder, plan::MANIFEST, plan::SCHEMA, plan.manifest(), false)
            }
            Self::Sweep(sweep) => sweep.begin(folder, false),
            Self::Scenes { setup, plan, .. } => {
                plan.claim(folder, false)?;
                dataset::write_shared(setup, plan, folder)
            }
            Self::Estimate { opened, .. } => {
                std::fs::create_dir_all(folder)?;
                let text = serde_json::to_string_pretty(opened.description())? + "\n";
                Ok(std::fs::write(folder.join(ESTIMATE), text)?)
            }
        }
    }
}

impl Work for Opened {
    fn check(&self, unit: &Unit) -> Result<()> {
        let Self::Estimate { args, .. } = self else { return Ok(()) };
        ensure!(
            self.images(unit.first, unit.items, &mut Listed::default())? == unit.images,
            "{}: pictures or truth of the unit's images are not what they were when the campaign was planned; put them back, or plan anew \
             into another folder",
            args.dataset.display()
        );
        Ok(())
    }

    fn run(&self, unit: &Unit, folder: &Path, jobs: usize, progress: &dyn Progress) -> Result<Ran> {
        let seeds = unit.first..unit.first + unit.items;
        let all = self.job().results(unit);
        match self {
            Self::Trials { plan, renderer } => {
                if plan.films {
                    std::fs::create_dir_all(folder.join(FILMS))?;
                }
                let cases = plan.cases_of(seeds);
                let ran = trials::run_cases(plan, &cases, folder, jobs, *renderer, progress)?;
                let (results, left_out) = (ran.results.len() as u64, ran.left_out.len() as u64);
                Ok(Ran { results, left_out, kept: ran.kept as u64 })
            }
            Self::Sweep(sweep) => {
                let (lines, kept) =
                    sweep.run_seeds((unit.first, unit.items as u32), folder, jobs, progress)?;
                let results = lines.len() as u64;
                Ok(Ran { results, left_out: all.saturating_sub(results), kept: kept as u64 })
            }
            Self::Scenes { setup, plan, renderer } => {
                let numbers = seeds.start as u32..=(seeds.end - 1) as u32;
                let made =
                    dataset::make_scenes(setup, plan, numbers, folder, jobs as u32, *renderer, progress)?;
                let results = u64::from(made.scenes + made.kept);
                Ok(Ran { results, left_out: 0, kept: u64::from(made.kept) })
            }
            Self::Estimate { args, opened, .. } => {
                let posteriors = folder.join(POSTERIORS);
                let mut run = opened.run(args);
                run.posteriors = args.posteriors.as_ref().map(|_| posteriors.as_path());
                run.only = Some(unit.first as usize..(unit.first + unit.items) as usize);
                run.jobs = jobs;
                let done = run.write(&folder.join(RESULTS), true, progress)?;
                Ok(Ran { results: (done.images + done.kept) as u64, left_out: 0, kept: done.kept as u64 })
            }
        }
    }
}

/// Files of a data set's images, a folder listed once.
#[derive(Default)]
struct Listed(BTreeMap<PathBuf, BTreeMap<String, Vec<String>>>);

impl Listed {
    /// The pictures of an image of the scene in `folder`.
    fn pictures(&mut self, folder: &Path, image: u32) -> Vec<PathBuf> {
        let mut files = Vec::new();
        for kind in ["rgb", "gray", "depth"] {
            let pictures = folder.join(kind);
            if !self.0.contains_key(&pictures) {
                let mut names: BTreeMap<String, Vec<String>> = BTreeMap::new();
                for entry in std::fs::read_dir(&pictures).into_iter().flatten().flatten() {
                    let name = entry.file_name().to_string_lossy().into_owned();
                    let stem = name.split('.').next().unwrap_or_default().to_owned();
                    names.entry(stem).or_default().push(name);
                }
                self.0.insert(pictures.clone(), names);
            }
            let mut names = self.0[&pictures].get(&format!("{image:06}")).cloned().unwrap_or_default();
            names.sort_unstable();
            files.extend(names.into_iter().map(|name| pictures.join(name)));
        }
        files
    }
}
