//! Scenes and grasps in MuJoCo: files that it reads, and a second opinion on what holds.

use crate::common::{self, code, grip, stderr};

#[test]
fn a_scene_that_is_exported_is_at_rest_in_mujoco() {
    let folder = tempfile::tempdir().unwrap();
    for (name, more) in [("whole.xml", None), ("hand.xml", Some("--hand"))] {
        let file = folder.path().join(name);
        let mut args = vec!["export", "--seed", "3", "--mjcf", file.to_str().unwrap()];
        args.extend(more);
        let made = grip(&args);
        assert_eq!(code(&made), 0, "{}", stderr(&made));
        common::python("check_mjcf.py", "mujoco", &[&file]);
    }
}

/// A small sweep: what the whole one gives stands in docs/results.md.
#[test]
fn mujoco_agrees_on_most_grasps() {
    let folder = tempfile::tempdir().unwrap();
    let sweep = folder.path().join("sweep");
    let made = grip(&[
        "sweep",
        "005_tomato_soup_can",
        "011_banana",
        "--seeds",
        "1",
        "--samples",
        "3",
        "--axes",
        "x,y,yaw",
        "--motions",
        "--out",
        sweep.to_str().unwrap(),
    ]);
    assert_eq!(code(&made), 0, "{}", stderr(&made));
    let least = std::path::Path::new("--least=0.85");
    common::python("crosscheck.py", "mujoco", &[&sweep, least]);
}
