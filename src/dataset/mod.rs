//! Data sets: many scenes, each seen in several frames, written as BOP (`grip scenes`).
//!
//! Every scene depends on the seed and its own number alone, so scenes are made in any order by any number of workers, and
//! made again by nobody: a scene's folder appears whole or not at all.

mod plan;
pub mod preview;
mod scene;

use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Instant;

use anyhow::{Context, Result};
use grip_sim::bop::{self, Dataset};
use grip_sim::render::{self, RendererChoice};

pub use self::plan::{CameraPlace, DatasetOptions, MANIFEST, PAPER_VIEWS, Plan, Profile, SCHEMA};
pub use self::scene::{SCENE_SCHEMA, SceneFile, Timings};
use crate::progress::Progress;
use crate::setup::Setup;
use crate::workers::{self, Stop};

/// What became of a run of `grip scenes`.
#[derive(Debug, Default)]
pub struct Made {
    /// Scenes made now.
    pub scenes: u32,
    /// Scenes found from an earlier run.
    pub kept: u32,
    /// Layouts thrown away, all scenes together.
    pub rejected: usize,
    /// Where the time went, all workers together.
    pub timings: Timings,
}

/// Makes the scenes that `out` lacks, on `jobs` threads, then the files of the whole set.
///
/// # Errors
/// When a scene cannot be made or written; scenes that are whole by then stay.
pub fn make(
    setup: &Setup,
    plan: &Plan,
    out: &Path,
    jobs: u32,
    renderer: RendererChoice,
    progress: &dyn Progress,
) -> Result<Made> {
    write_shared(setup, plan, out)?;
    let mut made = make_scenes(setup, plan, 1..=plan.scenes, out, jobs, renderer, progress)?;
    let began = Instant::now();
    write_index(&plan.split, out)?;
    made.timings.write += began.elapsed();
    Ok(made)
}

/// Writes what all scenes share, if it is not there: models and the camera.
///
/// # Errors
/// When it cannot be written.
pub fn write_shared(setup: &Setup, plan: &Plan, out: &Path) -> Result<()> {
    if !out.join("models").exists() {
        bop::export_models(&out.join("models"), setup.models.iter().map(|model| &**model))?;
    }
    if !out.join("models_eval").exists() {
        bop::export_evaluation_models(&out.join("models_eval"), setup.models.iter().map(|model| &**model))?;
    }
    Ok(bop::write_camera(out, &plan.camera_file())?)
}

/// Writes what is made of all scenes: targets and annotations.
///
/// # Errors
/// When a scene cannot be read, or a file not written.
pub fn write_index(split: &str, out: &Path) -> Result<()> {
    let dataset = Dataset::open(out, Some(split))?;
    bop::write_targets(out, &dataset.targets_of_truth()?)?;
    bop::write_coco_set(out, split)?;
    Ok(())
}

/// Makes those of the scenes `numbers` that `out` lacks, on `jobs` threads.
///
/// # Errors
/// When a scene cannot be made or written; scenes that are whole by then stay.
pub fn make_scenes(
    setup: &Setup,
    plan: &Plan,
    numbers: RangeInclusive<u32>,
    out: &Path,
    jobs: u32,
    renderer: RendererChoice,
    progress: &dyn Progress,
) -> Result<Made> {
    let split = out.join(&plan.split);
    std::fs::create_dir_all(&split).with_context(|| {
        format!("{}: cannot make the folder; check permissions or choose another --out", split.display())
    })?;
    for folder in [out, &split] {
        sweep(folder)
            .with_context(|| format!("{}: cannot remove what a killed run has left", folder.display()))?;
    }
    let all = numbers.clone().count() as u32;
    let missing: Vec<u32> = numbers.filter(|i| !split.join(format!("{i:06}")).exists()).collect();
    let kept = all - missing.len() as u32;
    let frames = |scenes: u32| u64::from(scenes) * plan.views.len() as u64;
    progress.begin(frames(all), frames(kept));

    let next = AtomicU32::new(0);
    let made = Mutex::new(Made { kept, ..Made::default() });
    let worker = |stop: &Stop<'_>| {
        let mut renderer = render::open(renderer)?;
        while !stop.is_asked_for() {
            let Some(&number) = missing.get(next.fetch_add(1, Ordering::Relaxed) as usize) else { break };
            let done = scene::make(setup, plan, &split, number, renderer.as_mut(), progress)
                .with_context(|| format!("scene {number}"))?;
            let mut made = made.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            made.scenes += 1;
            made.rejected += done.rejected;
            made.timings.add(&done.timings);
        }
        Ok(())
    };
    let threads = (jobs as usize).clamp(1, missing.len().max(1));
    workers::run(threads, progress, worker)?;
    Ok(made.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner))
}

/// Removes what killed runs have left unfinished in `folder`.
fn sweep(folder: &Path) -> Result<()> {
    for entry in std::fs::read_dir(folder)?.flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with('.') && name.ends_with(".tmp") && entry.path().is_dir() {
            std::fs::remove_dir_all(entry.path())?;
        }
    }
    Ok(())
}
