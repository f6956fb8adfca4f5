//! The examples run.

#[path = "../../examples/estimate.rs"]
mod estimate;
#[path = "../../examples/frame.rs"]
mod frame;
#[path = "../../examples/pick.rs"]
mod pick;
#[path = "../../examples/scene.rs"]
mod scene;
#[allow(dead_code, reason = "its command line")]
#[path = "../../examples/score.rs"]
mod score;
#[path = "../../examples/sweep.rs"]
mod sweep;
#[path = "../../examples/trial.rs"]
mod trial;

use crate::common::{code, grip, stderr};

#[test]
fn a_scene_a_frame_its_poses_and_a_pick() {
    scene::main().unwrap();
    frame::main().unwrap();
    estimate::main().unwrap();
    pick::main().unwrap();
}

#[test]
fn a_trial_and_a_sweep() {
    trial::main().unwrap();
    sweep::main().unwrap();
}

#[test]
fn a_results_file_is_scored() {
    let folder = tempfile::tempdir().unwrap();
    let (set, results) = (folder.path().join("set"), folder.path().join("results.csv"));
    let paths = [&set, &results].map(|path| path.to_str().unwrap());
    let made = grip(&["scenes", "--scenes", "1", "--views", "B", "--renderer", "cpu", "--out", paths[0]]);
    assert_eq!(code(&made), 0, "{}", stderr(&made));
    let estimated = grip(&["estimate", paths[0], "--boxes", "clusters", "--out", paths[1]]);
    assert_eq!(code(&estimated), 0, "{}", stderr(&estimated));
    score::score(&set, &results).unwrap();
}
