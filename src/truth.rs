//! `--estimator truth`: poses read from the simulator, to measure ceilings. Marked in every output.

use grip_perception::{Mode, PosePosterior};
use grip_sim::frame::CameraFrame;
use grip_sim::physics::World;

/// Perfect posteriors of the objects `which`.
pub fn posteriors(world: &World, frame: &CameraFrame, which: &[usize]) -> Vec<PosePosterior> {
    let camera_from_world = frame.world_from_camera.inverse();
    which
        .iter()
        .map(|&i| {
            let best = camera_from_world * world.truth(i);
            PosePosterior {
                object: world.object(i).info.name.clone(),
                best,
                particles: vec![(best, 1.0)],
                modes: vec![Mode {
                    pose: best,
                    mean: best,
                    mass: 1.0,
                    score: 1.0,
                    position_std_m: 0.0,
                    rotation_std_rad: 0.0,
                }],
                entropy: 0.0,
                score: 1.0,
                confidence: 1.0,
                there: true,
                terms: Default::default(),
                position_std_m: 0.0,
                rotation_std_rad: 0.0,
                restarts: 0,
                hypotheses: 0,
                seconds: 0.0,
                colour: None,
                trace: Vec::new(),
            }
        })
        .collect()
}
