//! What a trial's camera saw, as a BOP data set without truth: for estimators of others, whose results `--estimator csv:FILE`
//! takes. The scene is the trial's seed, the image the number of the look.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Result, ensure};
use grip_sim::bop::{self, CameraFile, FrameFiles, SceneWriter, Target};

use super::report::LookPictures;
use crate::setup::Setup;

/// Millimetres in a unit of the depth pictures.
const DEPTH_SCALE_MM: f64 = 0.1;
/// BOP numbers scenes with six digits.
const MOST_SCENES: u64 = 999_999;

/// Whether looks of a trial with this seed can be saved.
///
/// # Errors
/// When the seed has more digits than a scene's number.
pub fn check_seed(seed: u64) -> Result<()> {
    ensure!(
        seed <= MOST_SCENES,
        "--bop: the seed is the scene's number, which has six digits; --seed {seed} has more"
    );
    Ok(())
}

/// Writes the data set into the empty folder `root`.
///
/// # Errors
/// When a file cannot be written.
pub fn write(root: &Path, setup: &Setup, looks: &[LookPictures]) -> Result<()> {
    let scene_id = setup.seed as u32;
    let intrinsics = setup.camera.intrinsics;
    bop::write_camera(
        root,
        &CameraFile {
            width: intrinsics.width,
            height: intrinsics.height,
            fx: intrinsics.fx,
            fy: intrinsics.fy,
            cx: intrinsics.cx,
            cy: intrinsics.cy,
            depth_scale: Some(DEPTH_SCALE_MM),
        },
    )?;
    bop::export_models(&root.join("models"), setup.models.iter().map(|model| &**model))?;
    let split = root.join("test");
    std::fs::create_dir_all(&split)?;
    let writer = SceneWriter::begin(&split, scene_id)?;
    let mut targets = Vec::new();
    for (im_id, look) in (0..).zip(looks) {
        writer.add_frame(&FrameFiles {
            im_id,
            rgb: &look.rgb,
            depth: &look.depth,
            depth_scale_mm: DEPTH_SCALE_MM,
            intrinsics,
            world_from_camera: Some(look.world_from_camera),
            objects: &[],
        })?;
        let mut asked: BTreeMap<u32, u32> = BTreeMap::new();
        look.asked.iter().for_each(|&i| *asked.entry(setup.models[i].info.bop_id).or_default() += 1);
        targets.extend(asked.into_iter().map(|(obj_id, inst_count)| Target {
            scene_id,
            im_id,
            obj_id,
            inst_count,
        }));
    }
    writer.finish()?;
    Ok(bop::write_targets(root, &targets)?)
}
