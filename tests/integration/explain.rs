//! `grip explain`: shares of verdicts that are known beforehand, a picture of the right size, and what is wrong said by
//! name.

use std::path::{Path, PathBuf};

use crate::common::{code, grip, root, stderr, stdout};
use serde_json::Value;

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A data set of one image without noise.
fn data_set(folder: &Path) -> PathBuf {
    let out = folder.join("set");
    let scene = root().join("scenes/adversarial.toml");
    let args =
        ["scenes", text(&scene), "--scenes", "1", "--views", "B", "--seed", "11", "--depth-noise", "none"];
    let output = grip(&[&args[..], &["--out", text(&out)]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    out
}

/// A results file that says the truth, pushed away from the camera, with this confidence.
fn truth(set: &Path, away_mm: f64, score: f64) -> String {
    let file = std::fs::read_to_string(set.join("test/000001/scene_gt.json")).unwrap();
    let images: Value = serde_json::from_str(&file).unwrap();
    let mut lines = String::new();
    for truth in images["0"].as_array().unwrap() {
        let numbers = |key: &str| {
            truth[key].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect::<Vec<_>>()
        };
        let join = |n: &[f64]| n.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
        let mut t = numbers("cam_t_m2c");
        let distance = t.iter().map(|x| x * x).sum::<f64>().sqrt();
        t.iter_mut().for_each(|x| *x *= 1.0 + away_mm / distance);
        lines +=
            &format!("1,0,{},{score},{},{},-1\n", truth["obj_id"], join(&numbers("cam_R_m2c")), join(&t));
    }
    lines
}

#[test]
fn what_a_pose_explains_is_what_it_should() {
    let folder = tempfile::tempdir().unwrap();
    let set = data_set(folder.path());
    let (results, picture) = (folder.path().join("r.csv"), folder.path().join("p.png"));
    let explain = |more: &[&str]| {
        let args = ["explain", text(&set), text(&results), "--scene", "1", "--out", text(&picture), "--json"];
        grip(&[&args[..], more].concat())
    };
    let explained = |more: &[&str]| -> Value {
        let output = explain(&[&["--image", "0"], more].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        serde_json::from_str(&stdout(&output)).unwrap()
    };
    for (away_mm, verdict, least) in
        [(0.0, "inlier", 0.97), (-30.0, "violated", 0.9), (30.0, "occluded", 0.9)]
    {
        std::fs::write(&results, truth(&set, away_mm, 0.5)).unwrap();
        let json = explained(&["--truth"]);
        assert_eq!((&json["schema"], &json["truth_drawn"]), (&"grip.explain/1".into(), &true.into()));
        let estimates = json["estimates"].as_array().unwrap();
        assert!(estimates.len() > 3);
        for e in estimates {
            assert!(e["shares"][verdict].as_f64().unwrap() > least, "{away_mm}: {e}");
            assert!(
                (e["median_residual_mm"].as_f64().unwrap() + away_mm).abs() < 0.4 * away_mm.abs() + 1.0,
                "{e}"
            );
            assert!(e["covered_px"].as_u64().unwrap() > 100 && e["score"] == 0.5, "{e}");
        }
        assert!(json["shares"][verdict].as_f64().unwrap() > least, "{}", json["shares"]);
        let agreements: Vec<f64> = estimates.iter().filter_map(|e| e["agreement"].as_f64()).collect();
        if away_mm == 0.0 {
            assert!(agreements.iter().any(|a| *a > 0.5), "{agreements:?}");
        }
    }
    // Two by two panels of the image's size, with margins.
    let drawn = image::open(&picture).unwrap();
    assert_eq!(drawn.width(), 2 * 640 + 3 * 12);
    assert!((2 * 480..1500).contains(&drawn.height()), "{}", drawn.height());

    // Those of no confidence are listed.
    std::fs::write(&results, truth(&set, 0.0, 0.5) + &truth(&set, 30.0, 0.01)).unwrap();
    let json = explained(&[]);
    let estimates = json["estimates"].as_array().unwrap();
    let (first, last) = (&estimates[0], estimates.last().unwrap());
    assert_eq!((&first["drawn"], &last["drawn"]), (&true.into(), &false.into()));
    assert_eq!((&last["covered_px"], &last["shares"]), (&0.into(), &Value::Null));
    assert!(explained(&["--all"])["estimates"].as_array().unwrap().iter().all(|e| e["drawn"] == true));

    // What is wrong is said by name, and nothing is written.
    std::fs::remove_file(&picture).unwrap();
    let refused = |output: std::process::Output, expected: &str| {
        assert_eq!(code(&output), 2, "{}", stdout(&output));
        assert!(stderr(&output).contains(expected), "{expected}: {}", stderr(&output));
        assert!(!picture.exists());
    };
    refused(explain(&["--image", "7"]), "scene_camera.json: has no image 7");
    let nowhere = results.join("p.png");
    let (image, own) = (["--scene", "1", "--image", "0"], [text(&set), text(&results)]);
    let to = |own: &[&str], image: &[&str], out: &Path| {
        grip(&[&["explain"], own, image, &["--out", text(out)]].concat())
    };
    refused(to(&own, &["--scene", "3", "--image", "0"], &picture), "has no scene 3; it has");
    refused(to(&own, &image, &nowhere), "p.png: cannot be written");
    refused(to(&own, &image, folder.path()), "is a folder");
    refused(to(&[text(&set), "none.csv"], &image, &picture), "none.csv");
    std::fs::write(&results, truth(&set, 0.0, 0.5).replace("1,0,", "1,4,")).unwrap();
    refused(explain(&["--image", "0"]), "r.csv: has no estimate of scene 1, image 0; it has");
    std::fs::write(&results, "1,0,99,0.5,1 0 0 0 1 0 0 0 1,0 0 900,-1\n").unwrap();
    refused(explain(&["--image", "0"]), "obj_000099.ply");
    std::fs::write(&results, truth(&set, 0.0, 0.5)).unwrap();
    std::fs::remove_file(set.join("test/000001/scene_gt.json")).unwrap();
    std::fs::remove_file(set.join("test/000001/scene_gt_info.json")).unwrap();
    refused(explain(&["--image", "0", "--truth"]), "--truth: the data set has no truth of scene 1, image 0");
}
