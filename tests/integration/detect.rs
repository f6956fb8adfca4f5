//! `grip detect`: what the shipped network is worth on scenes that it never saw, figures as COCO's own tools have them, files that
//! other commands read, and what is wrong said by name.

use std::path::{Path, PathBuf};

use crate::common::{self, code, grip, grip_on_threads, root, stderr, stdout};
use serde_json::Value;

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A data set of these views.
fn data_set(folder: &Path, scenes: &str, views: &str) -> PathBuf {
    let out = folder.join("set");
    let args = ["scenes", "--scenes", scenes, "--views", views, "--seed", "31", "--out", text(&out)];
    let output = grip(&args);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    out
}

fn json(args: &[&str]) -> Value {
    let output = grip(args);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    serde_json::from_str(&stdout(&output)).unwrap()
}

#[test]
fn objects_are_found_in_scenes_that_training_never_saw() {
    let folder = tempfile::tempdir().unwrap();
    let set = data_set(folder.path(), "4", "B,D1");
    let boxes = folder.path().join("boxes.json");
    let said = json(&["detect", text(&set), "--out", text(&boxes), "--json"]);
    assert_eq!((&said["schema"], &said["images"]), (&"grip.detect/2".into(), &8.into()));
    let figure = |view: &str, name: &str| said["views"][view][name].as_f64().unwrap();
    // The floors of the detector in base light, as the model card measures them on forty scenes.
    assert!(figure("B", "ap50") > 0.6 && figure("B", "recall50") > 0.95, "{}", said["views"]);

    // The figures are COCO's.
    let figures = folder.path().join("figures.json");
    std::fs::write(&figures, said.to_string()).unwrap();
    common::python("check_detections.py", "numpy, pycocotools", &[&set, &boxes, &figures]);

    // A folder of heat maps may be there already.
    let maps = folder.path().join("maps");
    for _ in 0..2 {
        json(&["detect", text(&set), "--heatmaps", text(&maps), "--json"]);
    }
    assert_eq!(std::fs::read_dir(&maps).unwrap().count(), 8);

    // Nothing is thresholded: every object of the network has boxes in every image, and they are good for estimates.
    let found: Vec<Value> = serde_json::from_str(&std::fs::read_to_string(&boxes).unwrap()).unwrap();
    for object in 1..=21 {
        for image in 1..=4 {
            let of = |b: &&Value| b["category_id"] == object && b["scene_id"] == image;
            let asked = set.join(format!("models/obj_{object:06}.ply")).exists();
            assert_eq!(found.iter().any(|b| of(&b)), asked, "object {object}, scene {image}");
        }
    }
    let strict = json(&["detect", text(&set), "--min-confidence", "0.5", "--json"]);
    assert!(
        strict["views"]["D1"]["recall50"].as_f64().unwrap() < figure("D1", "recall50"),
        "{}",
        strict["views"]
    );
}

#[test]
fn estimates_from_its_boxes_and_from_its_file_are_good() {
    let folder = tempfile::tempdir().unwrap();
    let set = data_set(folder.path(), "1", "B");
    let boxes = folder.path().join("boxes.json");
    json(&["detect", text(&set), "--out", text(&boxes), "--json"]);
    let poses = |boxes: &str, name: &str| {
        let out = folder.path().join(name);
        let output = grip(&["estimate", text(&set), "--boxes", boxes, "--out", text(&out)]);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let said = json(&["eval", text(&set), text(&out), "--json"]);
        said["all"]["auc_adds"][0].as_f64().unwrap()
    };
    // Boxes in files are rounded, so the searches are not the same bit for bit.
    let (network, file) = (poses("pyramid", "a.csv"), poses(text(&boxes), "b.csv"));
    assert!(network > 0.8 && file > 0.8, "{network} {file}");
}

#[test]
fn a_picture_has_boxes_and_heat_maps() {
    let folder = tempfile::tempdir().unwrap();
    let set = data_set(folder.path(), "1", "B");
    let picture = set.join("test/000001/rgb/000000.png");
    let sheet = folder.path().join("sheet.png");
    let args = ["detect", text(&picture), "--heatmaps", text(&sheet), "--top", "7", "--json"];
    let said = json(&args);
    let boxes = said["boxes"].as_array().unwrap();
    assert_eq!(boxes.len(), 7);
    let confidences: Vec<f64> = boxes.iter().map(|b| b["confidence"].as_f64().unwrap()).collect();
    assert!(confidences.is_sorted_by(|a, b| a >= b) && confidences[0] > 0.5, "{confidences:?}");
    for b in boxes {
        let side = |i: usize| b["bbox"][i].as_f64().unwrap();
        assert!(
            side(0) >= 0.0 && side(1) >= 0.0 && side(0) + side(2) <= 640.0 && side(1) + side(3) <= 480.0,
            "{b}"
        );
    }
    // One picture with boxes and one an object, four in a row.
    let drawn = image::open(&sheet).unwrap();
    assert_eq!((drawn.width(), drawn.height()), (4 * 326 - 6, 6 * 246 - 6));
    // Two networks are built in.
    let by = |model: &str| -> Value {
        let output = grip(&[&args[..], &["--detector-model", model]].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        serde_json::from_str(&stdout(&output)).unwrap()
    };
    let (varied, base) = (by("varied"), by("base"));
    assert!(base["network"].as_str().unwrap().contains("base"), "{}", base["network"]);
    assert_eq!(varied["boxes"], said["boxes"]);
    assert_ne!(base["boxes"], said["boxes"]);
    // The same on any number of threads.
    let again = grip_on_threads(&args, Some(1));
    let again: Value = serde_json::from_str(&stdout(&again)).unwrap();
    assert_eq!(again["boxes"], said["boxes"]);
}

#[test]
fn what_is_wrong_is_said_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| text(&folder.path().join(name)).to_owned();
    std::fs::write(at("text.png"), "no picture").unwrap();
    std::fs::write(at("model.onnx"), "no network").unwrap();
    std::fs::copy(root().join("perception/models/pyramid-varied.json"), at("model.json")).unwrap();
    image::RgbImage::new(4, 4).save(at("tiny.png")).unwrap();
    image::RgbImage::new(128, 128).save(at("black.png")).unwrap();
    let cases: [(&[&str], &[&str]); 10] = [
        (&["missing.png"], &["missing.png"]),
        (&["text.png"], &["text.png"]),
        (&["tiny.png"], &["4x4"]),
        (&["black.png", "--detector-model", "model.onnx"], &["model.onnx"]),
        (&["black.png", "--detector-model", "none.onnx"], &["none.onnx"]),
        (&["black.png", "--detector-model", "paper"], &["paper", "varied, base or"]),
        (&["black.png", "--providers", "cuda"], &["cuda", "ORT_DYLIB_PATH"]),
        (&["black.png", "--min-confidence", "2"], &["--min-confidence", "2", "must be 0 to 1"]),
        (&["black.png", "--heatmaps", "text.png/a.png"], &["text.png/a.png", "another place"]),
        (&["black.png", "--out", "boxes.json"], &["--out", "black.png"]),
    ];
    for (args, parts) in cases {
        let absolute = |arg: &&str| if arg.contains('.') { at(arg) } else { (*arg).to_owned() };
        let args: Vec<String> = args.iter().map(absolute).collect();
        let args: Vec<&str> = [vec!["detect"], args.iter().map(String::as_str).collect()].concat();
        let output = grip(&args);
        assert_eq!(code(&output), 2, "{args:?}: {}", stderr(&output));
        for part in parts {
            assert!(stderr(&output).contains(part), "{args:?}: {}", stderr(&output));
        }
    }
    // Black pictures are pictures.
    assert_eq!(code(&grip(&["detect", &at("black.png")])), 0);
}

#[test]
fn a_native_runtime_that_is_none_is_refused() {
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_grip"))
        .args(["detect", "docs/scenes.png"])
        .current_dir(root())
        .env("ORT_DYLIB_PATH", "/no/such/libonnxruntime.so")
        .output()
        .unwrap();
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("ORT_DYLIB_PATH=/no/such/libonnxruntime.so"), "{}", stderr(&output));
}
