//! `--estimator truth`: poses read from the simulator, to measure ceilings. Marked in every output.

use grip_perception::PosePosterior;
use grip_sim::frame::CameraFrame;
use grip_sim::physics::World;

/// Perfect posteriors of the objects `which`.
pub fn posteriors(world: &World, frame: &CameraFrame, which: &[usize]) -> Vec<PosePosterior> {
    let camera_from_world = frame.world_from_camera.inverse();
    which
        .iter()
        .map(|&i| {
            let best = camera_from_world * world.truth(i);
            PosePosterior::certain(&world.object(i).info.name, best)
        })
        .collect()
}
