//! `grip scenes`: what it writes is the same on any number of threads and after any kill, is what its conditions say, and
//! stands up to a checker that shares no code with it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::common::{self, code, grip, root, stderr, stdout};
use grip_sim::bop::{self, Dataset};

/// Runs `grip scenes` on the adversarial scene.
fn scenes(out: &Path, more: &[&str]) -> std::process::Output {
    let scene = root().join("scenes/adversarial.toml");
    let mut args = vec!["scenes", scene.to_str().unwrap(), "--seed", "5", "--out", out.to_str().unwrap()];
    args.extend(more);
    grip(&args)
}

/// Every file below `folder` with its content.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                all.insert(path.strip_prefix(folder).unwrap().to_path_buf(), std::fs::read(&path).unwrap());
            }
        }
    }
    all
}

fn assert_same(a: &Path, b: &Path) {
    let (a, b) = (files(a), files(b));
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (name, content) in &a {
        assert!(content == &b[name], "{} differs", name.display());
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_jobs_and_after_a_kill() {
    let folder = tempfile::tempdir().unwrap();
    let (one, two) = (folder.path().join("one"), folder.path().join("two"));
    let settings = ["--scenes", "2", "--views", "B,D,O2"];
    let output = scenes(&one, &[&settings[..], &["--jobs", "1", "--json"]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let summary: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!((&summary["schema"], &summary["frames"]), (&"grip.scenes/1".into(), &6.into()));
    let output = scenes(&two, &[&settings[..], &["--jobs", "2"]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_same(&one, &two);
    let coco: serde_json::Value =
        serde_json::from_slice(&std::fs::read(one.join("coco.json")).unwrap()).unwrap();
    let soup = coco["categories"].as_array().unwrap().iter().find(|category| category["id"] == 4).unwrap();
    assert_eq!(soup["name"], "005_tomato_soup_can", "{coco}");

    // As a kill leaves it: a scene is missing, and so are the files of the whole set; a hidden folder is half full.
    std::fs::remove_dir_all(two.join("test/000001")).unwrap();
    std::fs::create_dir_all(two.join("test/.000001.77.tmp/rgb")).unwrap();
    for name in ["coco.json", "test_targets_bop19.json"] {
        std::fs::remove_file(two.join(name)).unwrap();
    }
    let refused = scenes(&two, &settings);
    assert_eq!(code(&refused), 2);
    assert!(stderr(&refused).contains("--resume"), "{}", stderr(&refused));
    let other = scenes(&two, &["--scenes", "3", "--views", "B,D,O2", "--resume"]);
    assert_eq!(code(&other), 2);
    assert!(stderr(&other).contains("\"scenes\": 2"), "{}", stderr(&other));
    let output = scenes(&two, &[&settings[..], &["--resume"]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_same(&one, &two);
}

#[test]
fn objects_that_find_no_room_are_drawn_anew() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (root().join("scenes/adversarial.toml"), folder.path().join("set"));
    let args = ["scenes", scene.to_str().unwrap(), "--seed", "901", "--scenes", "3", "--views", "B", "--out"];
    let output = grip(&[&args[..], &[out.to_str().unwrap()]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let rejected: Vec<String> = (1..=3)
        .flat_map(|scene| {
            let path = out.join(format!("test/{scene:06}/scene_info.json"));
            let info: serde_json::Value =
                serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
            info["rejected"]
                .as_array()
                .unwrap()
                .iter()
                .map(|r| r.as_str().unwrap().to_owned())
                .collect::<Vec<_>>()
        })
        .collect();
    // With this seed the first objects of the third scene are too many large ones.
    let anew = rejected.iter().find(|reason| reason.starts_with("draw 0: ")).expect("all objects found room");
    assert!(
        anew.contains("no layout of 7 objects in 40 attempts (") && anew.contains(" times such as: only "),
        "{anew}"
    );
    assert!(anew.len() < 1000, "{anew}");
}

#[test]
fn an_independent_checker_finds_nothing_wrong_and_conditions_are_what_they_say() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("set");
    let output =
        scenes(&out, &["--scenes", "1", "--views", "B,D,D1,O1", "--depth-noise", "none", "--preview"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));

    // The dark is dark, and depth does not know.
    let scene = out.join("test/000001");
    let mean = |im: u32| {
        let picture = image::open(scene.join(format!("rgb/{im:06}.png"))).unwrap().into_rgb8();
        picture.iter().map(|&v| f64::from(v)).sum::<f64>() / picture.len() as f64
    };
    let (base, dark, left) = (mean(0), mean(1), mean(2));
    println!("mean RGB: base {base:.1}, dark {dark:.1}, light-left {left:.1}");
    assert!(base > 70.0 && dark < 0.08 * base && dark > 0.5, "base {base}, dark {dark}");
    assert!(left > dark && left < base);
    let depth = |im: u32| std::fs::read(scene.join(format!("depth/{im:06}.png"))).unwrap();
    assert!(depth(0) == depth(1) && depth(0) == depth(2), "the same poses have the same perfect depth");
    assert!(depth(0) != depth(3), "clutter is another layout");
    assert!(image::open(out.join("preview.png")).unwrap().width() > 900);

    common::python("check_bop.py", "numpy, PIL", &[&out, Path::new("--models-depth")]);

    // What is seen of an object is measured about the same without the files that tell it.
    let set = Dataset::open(&out, None).unwrap();
    let mut compared = 0;
    for im_id in 0..4 {
        let frame = set.frame(1, im_id).unwrap();
        for truth in frame.truth().unwrap() {
            let mesh = set.load_model(truth.obj_id).unwrap().mesh;
            let pose = &truth.camera_from_object;
            let found = bop::estimated_gt_info(&mesh, pose, &frame.depth, &frame.intrinsics).unwrap();
            let told = truth.info.unwrap();
            let off = |a: [i32; 4], b: [i32; 4]| (0..4).map(|i| (a[i] - b[i]).abs()).max().unwrap();
            assert!(off(found.bbox_obj, told.bbox_obj) <= 1, "{found:?} {told:?}");
            // Objects that touch are nearer to each other than depths are told apart.
            assert!((found.visib_fract - told.visib_fract).abs() < 0.06, "{found:?} {told:?}");
            compared += 1;
        }
    }
    assert!(compared >= 20);
}

#[test]
fn a_lens_and_a_sphere_of_cameras_are_options() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("set");
    let output = scenes(
        &out,
        &["--scenes", "1", "--views", "B,X=light-right", "--camera", "sphere", "--split", "train"],
    );
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let cameras: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("train/000001/scene_camera.json")).unwrap()).unwrap();
    assert_ne!(cameras["0"]["cam_R_w2c"], cameras["1"]["cam_R_w2c"], "each frame has a camera of its own");
    let bent = folder.path().join("bent");
    let output = scenes(&bent, &["--scenes", "1", "--views", "B", "--distortion", "-0.25,0.06,0.001,0,0"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let plan: serde_json::Value =
        serde_json::from_slice(&std::fs::read(bent.join("dataset.json")).unwrap()).unwrap();
    assert_eq!(plan["distortion"]["k1"], -0.25);
}

#[test]
fn several_cameras_take_pictures_of_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let left = "place = { eye = [0.6, 0.9, 1.3], target = [0.6, 0.0, 0.7] }";
    let wrist =
        "place = { link = \"head_tilt_link\", xyz = [0.1, 0.05, 0.06], rpy = [-1.5708, 0.0, -1.5708] }";
    let cameras =
        format!("\n[[cameras]]\nname = \"left\"\n{left}\n[[cameras]]\nname = \"stereo\"\n{wrist}\n");
    let scene = common::edited_scene(folder.path(), |text| text + &cameras);
    let out = folder.path().join("set");
    let args = ["--scenes", "1", "--views", "B,O1", "--camera", "all", "--seed", "5"];
    let files = [scene.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let output = grip(&[&["scenes"], &args[..], &files].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let info = std::fs::read_to_string(out.join("test/000001/scene_info.json")).unwrap();
    for name in ["exp001_B", "exp001_B_left", "exp001_B_stereo", "exp001_O1", "exp001_O1_left"] {
        assert!(info.contains(&format!("\"{name}\"")), "{name}");
    }
    let dataset = Dataset::open(&out, None).unwrap();
    // World from object, and where the camera is.
    let seen = |image: u32| {
        let camera = dataset.frame(1, image).unwrap().world_from_camera.unwrap();
        let truths = dataset.ground_truths(1, image).unwrap();
        let places: Vec<_> = truths.iter().map(|t| (camera * t.camera_from_object).translation()).collect();
        (camera, places)
    };
    let all: Vec<_> = (0..6).map(seen).collect();
    for (image, as_in) in [(1, 0), (2, 0), (4, 3), (5, 3)] {
        assert!((all[image].0.translation() - all[as_in].0.translation()).norm() > 0.02, "another camera");
        for (a, b) in all[image].1.iter().zip(&all[as_in].1) {
            assert!((a - b).norm() < 1e-5, "{a} {b}");
        }
    }
    assert!((all[1].0.translation() - nalgebra::Vector3::new(0.6, 0.9, 1.3)).norm() < 1e-6);
    assert!(all[0].1.iter().zip(&all[3].1).any(|(a, b)| (a - b).norm() > 0.01), "heaped anew");
    let none = grip(&["scenes", "--camera", "all", "--out", folder.path().join("none").to_str().unwrap()]);
    assert!(code(&none) == 2 && stderr(&none).contains("[[cameras]]"), "{}", stderr(&none));
}

#[test]
fn a_hard_set_has_the_same_objects_among_other_things_and_other_cameras() {
    let folder = tempfile::tempdir().unwrap();
    let [standard, hard, again] = ["standard", "hard", "again"].map(|name| folder.path().join(name));
    let make = |out: &Path, more: &[&str]| {
        let output = scenes(out, &[&["--scenes", "2", "--views", "B,D"], more].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
    };
    make(&standard, &[]);
    make(&hard, &["--profile", "hard", "--jobs", "1"]);
    make(&again, &["--profile", "hard", "--jobs", "2"]);
    assert_same(&hard, &again);
    let (standard, files) = (files(&standard), files(&hard));
    assert!(standard.keys().eq(files.keys()), "the same files: what is unknown is in none");
    let json = |files: &BTreeMap<PathBuf, Vec<u8>>, name: &str| -> serde_json::Value {
        serde_json::from_slice(&files[Path::new(name)]).unwrap()
    };
    for (name, content) in &standard {
        let same = name.starts_with("models") || name.starts_with("models_eval");
        assert!(!same || *content == files[name], "{}", name.display());
        let picture = name.to_str().unwrap().contains("/rgb/");
        assert!(!picture || *content != files[name], "{}", name.display());
    }
    for scene in ["test/000001", "test/000002"] {
        let info = |files: &BTreeMap<PathBuf, Vec<u8>>| {
            json(files, &format!("{scene}/scene_info.json"))["objects"].clone()
        };
        assert_eq!(info(&standard), info(&files));
        let truth = json(&files, &format!("{scene}/scene_gt.json"));
        for image in ["0", "1"] {
            let truths = truth[image].as_array().unwrap();
            assert_eq!(truths.len(), info(&files).as_array().unwrap().len());
            assert!(truths.iter().all(|truth| truth["obj_id"].as_u64() > Some(0)), "{truth}");
        }
    }
    let plan = json(&files, "dataset.json");
    assert_eq!(plan["depth_noise_name"], "any");
    assert_eq!(plan["profile"], "hard");
    common::python("check_bop.py", "numpy, PIL", &[&hard]);
}

#[test]
fn what_cannot_be_made_is_refused_with_a_reason_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("set");
    for (args, wanted) in [
        (&["--views", "B,Q7"][..], "no frame 'Q7'"),
        (&["--views", "B=foggy"], "foggy"),
        (&["--views", "B,B"], "stands twice"),
        (&["--views", "a/b=base"], "a frame's name"),
        (&["--objects", "003_cracker_box,004_sugr_box"], "004_sugar_box"),
        (&["--depth-noise", "kinect"], "kinect"),
        (&["--distortion", "0.1,0.2"], "five"),
        (&["--distortion", "nan,0,0,0,0"], "--distortion"),
        (&["--distortion", "-3,0,0,0,0"], "--distortion"),
        (&["--split", "../test"], "--split"),
        (&["--shiny", "1.5"], "--shiny 1.5"),
        (&["--shiny", "nan"], "--shiny NaN"),
        (&["--scenes", "0"], "--scenes"),
    ] {
        let output = scenes(&out, args);
        assert_eq!(code(&output), 2, "{args:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(wanted), "{args:?}: {}", stderr(&output));
        assert!(!out.exists(), "{args:?} left something behind");
    }
    // A folder of someone else's is not touched.
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("thesis.txt"), "precious").unwrap();
    let output = scenes(&out, &["--scenes", "1"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("is no data set of this program"), "{}", stderr(&output));
    assert_eq!(files(&out).len(), 1);
}
