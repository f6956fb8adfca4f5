//! Estimating the poses of a data set, image by image, so that a run that was stopped goes on where it was.

use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use anyhow::{Context, Result};
use grip_perception::{Detections, Mode, PoseEstimator, PosePosterior};
use grip_sim::bop::results::{Estimate, HEADER, read_results};
use grip_sim::bop::{self, BopFrame, Dataset, Target};
use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Camera, Pose, World};
use grip_sim::rng;
use rand::RngExt;
use rand::seq::SliceRandom;
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::boxes::Boxes;
use super::objects;
use crate::estimators::{EstimatorFailed, External};
use crate::progress::Progress;
use crate::workers;

/// What is to be estimated, by whom.
pub struct Run<'a> {
    /// The images.
    pub dataset: &'a Dataset,
    /// Where to look.
    pub boxes: &'a Boxes,
    /// Who estimates.
    pub estimator: FrameEstimator<'a>,
    /// Whether the images of a scene, in the order of their numbers, are a sequence in which objects are followed, and after how
    /// many of them boxes are looked for again at the latest.
    pub track: Option<usize>,
    /// How many objects an image that are not in it are looked for, too.
    pub absent: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// All that the estimates depend on, in a line: runs that differ in it are not mixed.
    pub settings: String,
    /// Where the posteriors go, too: JSON, a line an estimate, in the order of the results ([`PosteriorLine`]).
    pub posteriors: Option<&'a Path>,
    /// Only these of the [`sequences`]: from a position on, so many; all where it is none.
    pub only: Option<Range<usize>>,
    /// Threads. Images (when tracking: scenes) are shared among them; each of them times its own, and does nothing else meanwhile.
    pub jobs: usize,
}

/// Who estimates the images of a data set.
#[derive(Clone, Copy)]
pub enum FrameEstimator<'a> {
    /// One of ours.
    Ours(&'a dyn PoseEstimator),
    /// A program of others, which was told of all objects that are asked for. An image in which it does wrong is one without poses.
    Program(&'a External),
}

/// What a run did.
#[derive(Debug, Clone, Copy, Default)]
pub struct Estimated {
    /// Images estimated now.
    pub images: usize,
    /// Images that an earlier run had done.
    pub kept: usize,
    /// Poses in the file.
    pub poses: usize,
    /// Seconds spent estimating, summed over the images estimated now.
    pub seconds: f64,
    /// Images, of those estimated now, in which the estimator did wrong.
    pub failed: usize,
}

/// Begins a [`whole_mark`].
const WHOLE: &str = "# whole";

/// The objects that are asked for in one image, with their numbers of instances.
type Wanted = BTreeMap<u32, u32>;
/// What is done, by scene and image.
type Done = BTreeMap<(u32, u32), Lines>;

/// The last image of a sequence.
#[derive(Default)]
struct Last {
    /// What was believed, by the object's number: of each instance.
    beliefs: BTreeMap<u32, VecDeque<PosePosterior>>,
    /// Where the camera was, where the data set says it.
    camera: Option<Pose<World, Camera>>,
    /// The boxes, and for how many images they have served.
    boxes: Option<(Detections, usize)>,
}

/// Of one image.
#[derive(Debug, Clone, Default)]
struct Lines {
    /// Of the results file.
    results: Vec<String>,
    /// Of the file of posteriors; none where it is not asked for.
    posteriors: Vec<String>,
}

/// One line of a file of posteriors.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PosteriorLine {
    /// Number of the scene.
    pub scene_id: u32,
    /// Number of the image in it.
    pub im_id: u32,
    /// The object's number.
    pub obj_id: u32,
    /// That the object is there and its best pose is right.
    pub confidence: f64,
    /// Where it may be, each place a distribution of its own; camera from object, metres.
    pub modes: Vec<Mode>,
}

impl Run<'_> {
    /// Estimates all images and writes `out`, sorted by scene, image and object. Images go first to a file beside it, which
    /// `resume` takes up.
    ///
    /// # Errors
    /// When an image or model cannot be read, or a file not written; what is done by then is kept for `resume`.
    pub fn write(&self, out: &Path, resume: bool, progress: &dyn Progress) -> Result<Estimated> {
        anyhow::ensure!(!out.is_dir(), "--out {}: is a folder; give a file", out.display());
        let mut wanted = wanted(self.dataset, self.absent, self.seed)?;
        if let Some(only) = &self.only {
            let images: HashSet<(u32, u32)> =
                grouped(wanted.keys(), self.track.is_some()).drain(only.clone()).flatten().collect();
            wanted.retain(|image, _| images.contains(image));
        }
        let models = models_of(self.dataset, &wanted)?;

        self.boxes.check(models.values(), &wanted.keys().copied().collect())?;

        let partial = partial_path(out)?;
        if let Some(folder) = out.parent() {
            std::fs::create_dir_all(folder).with_context(|| cannot_write(out))?;
        }
        let mut done = if resume { self.resumed(&partial, &wanted)? } else { Done::new() };
        let images = wanted.len() - done.len();
        let missing: Vec<((u32, u32), &Wanted)> =
            wanted.iter().filter(|(image, _)| !done.contains_key(*image)).map(|(i, w)| (*i, w)).collect();
        let together =
            |a: &((u32, u32), &Wanted), b: &((u32, u32), &Wanted)| self.track.is_some() && a.0.0 == b.0.0;
        let missing: Vec<&[((u32, u32), &Wanted)]> = missing.chunk_by(together).collect();
        progress.begin(wanted.len() as u64, done.len() as u64);
        let mut summary = Estimated { images, kept: done.len(), ..Estimated::default() };

        let mut files = vec![self.begin(&partial, &done, |lines| &lines.results)?];
        if let Some(posteriors) = self.posteriors {
            files.push(self.begin(&partial_path(posteriors)?, &done, |lines| &lines.posteriors)?);
        }
        let shared = Mutex::new((files, &mut done, &mut summary));
        let next = AtomicUsize::new(0);
        let threads = self.jobs.clamp(1, missing.len().max(1));
        workers::run(threads, progress, |stop| {
            // A pool of its own, or its threads would do parts of other images while the clock of this one runs.
            let pool = ThreadPoolBuilder::new().num_threads(self.jobs.div_ceil(threads)).build()?;
            while let Some(sequence) = missing.get(next.fetch_add(1, Ordering::Relaxed)) {
                let mut last = Last::default();
                for &(image, wanted) in *sequence {
                    if stop.is_asked_for() {
                        return Ok(());
                    }
                    let which = || format!("scene {}, image {}", image.0, image.1);
                    let estimated = match self.estimator {
                        // It is asked by this thread, which has a process of its own.
                        FrameEstimator::Program(_) => self.image(image, wanted, &models, &mut last),
                        FrameEstimator::Ours(_) => {
                            pool.install(|| self.image(image, wanted, &models, &mut last))
                        }
                    };
                    let (lines, seconds) = match estimated {
                        Ok(estimated) => estimated,
                        Err(error) if error.is::<EstimatorFailed>() => {
                            progress.warn(&format!("{}: no poses: {error}", which()));
                            shared.lock().unwrap_or_else(PoisonError::into_inner).2.failed += 1;
                            (Lines::default(), 0.0)
                        }
                        Err(error) => return Err(error.context(which())),
                    };
                    let mut shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
                    let (files, done, summary) = &mut *shared;
                    for (file, lines) in files.iter_mut().zip([&lines.results, &lines.posteriors]) {
                        let text = lines.concat() + &whole_mark(image);
                        file.write_all(text.as_bytes()).with_context(|| cannot_write(&partial))?;
                    }
                    summary.seconds += seconds;
                    done.insert(image, lines);
                    progress.advance(1);
                }
            }
            Ok(())
        })?;
        summary.poses = done.values().map(|lines| lines.results.len()).sum();
        let text = format!("{HEADER}\n") + &joined(&done, |lines| &lines.results);
        if let Some(posteriors) = self.posteriors {
            bop::write_atomic(posteriors, joined(&done, |lines| &lines.posteriors).as_bytes())?;
            let _ = std::fs::remove_file(partial_path(posteriors)?);
        }
        bop::write_atomic(out, text.as_bytes())?;
        // The results are there; what is left behind does no harm.
        let _ = std::fs::remove_file(&partial);
        Ok(summary)
    }

    fn image(
        &self,
        (scene_id, im_id): (u32, u32),
        wanted: &Wanted,
        models: &HashMap<u32, Arc<ObjectModel>>,
        last: &mut Last,
    ) -> Result<(Lines, f64)> {
        let bop = self.dataset.frame(scene_id, im_id)?;
        let frame = camera_frame(&bop);
        let objects: Vec<Arc<ObjectModel>> = wanted
            .iter()
            .flat_map(|(id, count)| std::iter::repeat_n(models[id].clone(), *count as usize))
            .collect();
        let seed = image_seed(self.seed, (scene_id, im_id));
        let began = Instant::now();
        // What stands still has moved before the camera as the camera has moved, where that is known.
        let now_from_last = bop.world_from_camera.zip(last.camera).map(|(now, then)| now.inverse() * then);
        let carried = |belief: PosePosterior| match &now_from_last {
            Some(motion) => belief.seen_from(motion),
            None => belief,
        };
        let before: Vec<Option<PosePosterior>> = objects
            .iter()
            .map(|object| last.beliefs.get_mut(&object.info.bop_id)?.pop_front().map(carried))
            .collect();
        // While most of what is asked for is there, boxes are about where they were: a detector takes longer than all the rest.
        let there = before.iter().flatten().filter(|before| before.there).count();
        let sure =
            self.boxes.are_detected() && 2 * there >= before.len() && before.iter().all(Option::is_some);
        let of_last = last.boxes.take().filter(|(_, served)| sure && Some(*served) < self.track);
        let (detections, served) = match of_last {
            Some(boxes) => boxes,
            None => (self.boxes.of(&bop, &frame, &objects, seed)?, 0),
        };
        let looked_for = self.boxes.looked_for(&detections, &objects);
        let (objects, before): (Vec<_>, Vec<_>) = objects
            .into_iter()
            .zip(before)
            .zip(looked_for)
            .filter_map(|(asked, looked_for)| looked_for.then_some(asked))
            .unzip();
        let beliefs: Vec<(usize, PosePosterior)> = match self.estimator {
            FrameEstimator::Ours(estimator) => {
                let all = estimator.follow(&before, &frame, &detections, &objects, seed)?;
                all.into_iter().enumerate().collect()
            }
            FrameEstimator::Program(program) => {
                program.image((scene_id, im_id), &frame, bop.world_from_camera, &detections, &objects)?
            }
        };
        last.boxes = Some((detections, served + 1));
        let seconds = began.elapsed().as_secs_f64();
        let mut lines = Lines::default();
        last.beliefs.clear();
        last.camera = bop.world_from_camera;
        for (object, belief) in beliefs.into_iter().map(|(i, belief)| (&objects[i], belief)) {
            if self.track.is_some() {
                last.beliefs.entry(object.info.bop_id).or_default().push_back(belief.clone());
            }
            let obj_id = object.info.bop_id;
            let estimate = Estimate {
                scene_id,
                im_id,
                obj_id,
                // A program of others says it in its own scale.
                score: match self.estimator {
                    FrameEstimator::Ours(_) => belief.confidence,
                    FrameEstimator::Program(_) => belief.score,
                },
                camera_from_object: belief.best,
                time_s: Some(seconds),
            };
            lines.results.push(estimate.line());
            if self.posteriors.is_some() {
                let (confidence, modes) = (belief.confidence, belief.modes);
                let line = PosteriorLine { scene_id, im_id, obj_id, confidence, modes };
                lines.posteriors.push(serde_json::to_string(&line)? + "\n");
            }
        }
        Ok((lines, seconds))
    }

    /// The images that an interrupted run finished.
    fn resumed(&self, partial: &Path, wanted: &BTreeMap<(u32, u32), Wanted>) -> Result<Done> {
        let Some(whole) = self.whole_lines(partial)? else { return Ok(Done::new()) };
        let mut done: Done = marked(&whole).map(|image| (image, Lines::default())).collect();
        let of_images = |text: &'_ str| -> Vec<String> {
            text.lines().filter(|line| !line.starts_with('#')).map(|line| format!("{line}\n")).collect()
        };
        // Lines are kept as they are: through numbers and back they would change in their last digits.
        for (estimate, line) in read_results(partial)?.iter().zip(of_images(&whole)) {
            if let Some(lines) = done.get_mut(&(estimate.scene_id, estimate.im_id)) {
                lines.results.push(line);
            }
        }
        if let Some(posteriors) = self.posteriors {
            let whole = self.whole_lines(&partial_path(posteriors)?)?.unwrap_or_default();
            for line in of_images(&whole) {
                let read: PosteriorLine = serde_json::from_str(&line)
                    .with_context(|| format!("{}: is damaged; remove it", posteriors.display()))?;
                if let Some(lines) = done.get_mut(&(read.scene_id, read.im_id)) {
                    lines.posteriors.push(line);
                }
            }
            let told: HashSet<(u32, u32)> = marked(&whole).collect();
            done.retain(|image, _| told.contains(image));
        }
        done.retain(|image, _| wanted.contains_key(image));
        // In the middle of a sequence what was believed is not at hand.
        if self.track.is_some() {
            let whole = |scene: u32| {
                let of_scene = || wanted.keys().filter(move |(of, _)| *of == scene);
                of_scene().all(|image| done.contains_key(image))
            };
            let scenes: HashSet<u32> =
                done.keys().map(|(scene, _)| *scene).filter(|scene| whole(*scene)).collect();
            done.retain(|(scene, _), _| scenes.contains(scene));
        }
        Ok(done)
    }

    /// What an interrupted run left in a file, but for a last line that was cut off; `None` where there is no such file.
    fn whole_lines(&self, partial: &Path) -> Result<Option<String>> {
        let Ok(text) = std::fs::read_to_string(partial) else { return Ok(None) };
        let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
        let settings = whole.lines().next().unwrap_or_default().trim_start_matches("# ");
        anyhow::ensure!(
            settings == self.settings,
            "{}: was begun with other settings ({settings}, now {}); finish it with those, or leave out --resume to begin anew",
            partial.display(),
            self.settings
        );
        std::fs::write(partial, whole).with_context(|| cannot_write(partial))?;
        Ok(Some(whole.to_owned()))
    }

    /// A file of finished images, with those that are done.
    fn begin(&self, partial: &Path, done: &Done, of: fn(&Lines) -> &Vec<String>) -> Result<File> {
        let marked = |(image, lines): (&(u32, u32), &Lines)| of(lines).concat() + &whole_mark(*image);
        let text = format!("# {}\n", self.settings) + &done.iter().map(marked).collect::<String>();
        std::fs::write(partial, text).with_context(|| cannot_write(partial))?;
        OpenOptions::new().append(true).open(partial).with_context(|| cannot_write(partial))
    }
}

/// The images that are asked for, by scene and number, in parts that can be estimated apart from each other: each by itself, or, where
/// objects are followed, those of a scene together.
///
/// # Errors
/// When the truth or the targets cannot be read.
pub fn sequences(dataset: &Dataset, track: bool) -> Result<Vec<Vec<(u32, u32)>>> {
    Ok(grouped(wanted(dataset, 0, 0)?.keys(), track))
}

fn grouped<'a>(images: impl Iterator<Item = &'a (u32, u32)>, track: bool) -> Vec<Vec<(u32, u32)>> {
    let images: Vec<(u32, u32)> = images.copied().collect();
    images.chunk_by(|a, b| track && a.0 == b.0).map(<[_]>::to_vec).collect()
}

/// How many images a run that was stopped has finished, by the file of its name beside `out`.
pub fn finished(out: &Path) -> usize {
    let text = partial_path(out).ok().and_then(|path| std::fs::read_to_string(path).ok());
    text.map_or(0, |text| marked(&text).count())
}

/// What is asked for, by image: the data set's targets, else all that is in the truth.
fn wanted(dataset: &Dataset, absent: usize, seed: u64) -> Result<BTreeMap<(u32, u32), Wanted>> {
    let mut wanted: BTreeMap<(u32, u32), Wanted> = BTreeMap::new();
    for Target { scene_id, im_id, obj_id, inst_count } in targets(dataset)? {
        wanted.entry((scene_id, im_id)).or_default().insert(obj_id, inst_count);
    }
    if absent > 0 {
        let known = dataset.model_ids()?;
        for (&(scene_id, im_id), objects) in &mut wanted {
            let truth = dataset.ground_truths(scene_id, im_id)?;
            let missing = known.iter().filter(|id| truth.iter().all(|t| t.obj_id != **id));
            let mut missing: Vec<u32> = missing.copied().collect();
            missing.shuffle(&mut rng::stream(seed, &format!("absent/{scene_id}/{im_id}")));
            objects.extend(missing.into_iter().take(absent).map(|id| (id, 1)));
        }
    }
    Ok(wanted)
}

/// The objects that a run with so many absent ones an image and this seed asks for, in the order of their numbers.
///
/// # Errors
/// When the truth or a model cannot be read.
pub fn asked_models(dataset: &Dataset, absent: usize, seed: u64) -> Result<Vec<Arc<ObjectModel>>> {
    let models = models_of(dataset, &wanted(dataset, absent, seed)?)?;
    let mut models: Vec<Arc<ObjectModel>> = models.into_values().collect();
    models.sort_by_key(|model| model.info.bop_id);
    Ok(models)
}

fn models_of(
    dataset: &Dataset,
    wanted: &BTreeMap<(u32, u32), Wanted>,
) -> Result<HashMap<u32, Arc<ObjectModel>>> {
    let ids: HashSet<u32> = wanted.values().flat_map(|objects| objects.keys().copied()).collect();
    ids.into_par_iter().map(|id| Ok((id, objects::load(dataset, id)?))).collect()
}

/// The line behind those of an image in the file of a run that goes on: all of them are there, if there are any.
fn whole_mark((scene_id, im_id): (u32, u32)) -> String {
    format!("{WHOLE} {scene_id} {im_id}\n")
}

/// The images that [`whole_mark`] stands behind.
fn marked(text: &str) -> impl Iterator<Item = (u32, u32)> {
    text.lines().filter_map(|line| {
        let mut numbers = line.strip_prefix(WHOLE)?.split_whitespace().map(str::parse);
        Some((numbers.next()?.ok()?, numbers.next()?.ok()?))
    })
}

/// The lines of one file, in order.
fn joined(done: &Done, of: fn(&Lines) -> &Vec<String>) -> String {
    done.values().flat_map(of).map(String::as_str).collect()
}

/// What an estimator gets to see of an image.
pub(crate) fn camera_frame(bop: &BopFrame) -> CameraFrame {
    CameraFrame {
        rgb: bop.rgb.clone(),
        depth: bop.depth.clone(),
        intrinsics: bop.intrinsics,
        world_from_camera: bop.world_from_camera.unwrap_or_else(Pose::identity),
    }
}

/// The seed of an image in a run with `seed`.
pub(super) fn image_seed(seed: u64, (scene_id, im_id): (u32, u32)) -> u64 {
    rng::stream(seed, &format!("estimate/{scene_id}/{im_id}")).random()
}

/// More instances of one object in one image than in any data set there is.
const MOST_INSTANCES: u32 = 1000;

/// What an evaluation asks for: the data set's targets in its split; else all that is in the truth and seen, of the images that
/// the targets of 2024 name, or of all.
pub(super) fn targets(dataset: &Dataset) -> Result<Vec<Target>> {
    let scenes: HashSet<u32> = dataset.scenes()?.into_iter().collect();
    if let Some(targets) = dataset.targets()? {
        let all = targets.len();
        let of_split: Vec<Target> = targets.into_iter().filter(|t| scenes.contains(&t.scene_id)).collect();
        if of_split.len() < all {
            log::warn!(
                "{}: {} of the {all} targets of test_targets_bop19.json are of scenes that are not in {}{}",
                dataset.root().display(),
                all - of_split.len(),
                dataset.split(),
                if of_split.is_empty() { ": all that is in the truth is asked for" } else { "" }
            );
        }
        if let Some(t) = of_split.iter().find(|t| t.inst_count == 0 || t.inst_count > MOST_INSTANCES) {
            anyhow::bail!(
                "{}/test_targets_bop19.json: scene {}, image {}, object {}: inst_count = {}: must be 1 to {MOST_INSTANCES}",
                dataset.root().display(),
                t.scene_id,
                t.im_id,
                t.obj_id,
                t.inst_count
            );
        }
        if !of_split.is_empty() {
            return Ok(of_split);
        }
    }
    let mut targets = dataset.targets_of_truth()?;
    if let Some(images) = dataset.target_images()? {
        let asked: HashSet<(u32, u32)> = images.iter().map(|image| (image.scene_id, image.im_id)).collect();
        if asked.iter().any(|(scene_id, _)| scenes.contains(scene_id)) {
            targets.retain(|target| asked.contains(&(target.scene_id, target.im_id)));
        } else {
            log::warn!(
                "{}: test_targets_bop24.json names no image of {}: all that is in the truth is asked for",
                dataset.root().display(),
                dataset.split()
            );
        }
    }
    anyhow::ensure!(
        !targets.is_empty(),
        "{}: nothing is asked for: in the truth of {} no object is seen by a tenth or more (visib_fract in scene_gt_info.json)",
        dataset.root().display(),
        dataset.split()
    );
    Ok(targets)
}

fn partial_path(out: &Path) -> Result<PathBuf> {
    let name = out.file_name().with_context(|| {
        format!("--out {}: is not a file name; give a place such as results.csv", out.display())
    })?;
    let mut name = name.to_owned();
    name.push(".partial");
    Ok(out.with_file_name(name))
}

fn cannot_write(path: &Path) -> String {
    format!("{}: cannot be written; check that the folder exists, permissions and free space", path.display())
}
