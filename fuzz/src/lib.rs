//! What reads files of others, as functions of their bytes. Whatever the bytes are: no panic, and an error that names the file.
//!
//! `fuzz/run` tries inputs guided by coverage (libFuzzer); the test of this crate tries mutations of `corpus/`, without.

#![allow(clippy::unwrap_used, reason = "a fuzzer ends at what is wrong")]

use std::fmt::Display;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use grip::benchmark::{Boxes, for_dataset};
use grip::estimators::DetectorOptions;
use grip::settings::Settings;
use grip_manip::benchmark::load_problem;
use grip_manip::grasp::read_poses;
use grip_perception::{Providers, PyramidCnn};
use grip_sim::bop::Dataset;
use grip_sim::bop::results::read_results;
use grip_sim::camera::Intrinsics;
use grip_sim::condition::ConditionSpec;
use grip_sim::files;
use grip_sim::objects::{any_mesh, mesh_io, table};
use grip_sim::pictures;
use grip_sim::robot::{RobotConfig, RobotModel};
use grip_sim::scene::Scene;

/// A kind of file, and what reads it.
pub struct Target {
    /// Also of its corpus.
    pub name: &'static str,
    /// The file's name; where there are several, the first byte of an input says which.
    files: &'static [&'static str],
    /// Files that the reader needs beside it.
    beside: fn(&Path),
    /// Reads it: the folder and the file.
    read: fn(&Path, &Path) -> Outcome,
}

/// What reading gave: nothing, or the text of the error.
type Outcome = Result<(), String>;

/// A folder in which a target's files are.
pub struct Workplace(tempfile::TempDir);

impl Workplace {
    /// With what the target needs beside its file; in memory where there is such a place.
    pub fn new(target: &Target) -> Self {
        let memory = Path::new("/dev/shm");
        let folder =
            if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() }.unwrap();
        (target.beside)(folder.path());
        Self(folder)
    }

    /// Has the target read these bytes.
    ///
    /// # Panics
    /// When an error does not name a file.
    pub fn run(&self, target: &Target, bytes: &[u8]) {
        let (which, content) = match (target.files, bytes) {
            ([only], _) => (*only, bytes),
            (_, []) => return,
            (several, [first, rest @ ..]) => (several[usize::from(*first) % several.len()], rest),
        };
        let file = self.0.path().join(which);
        let before = fs::read(&file).ok();
        fs::write(&file, content).unwrap();
        let outcome = (target.read)(self.0.path(), &file);
        if let (Some(before), true) = (before, target.files.len() > 1) {
            fs::write(&file, before).unwrap();
        }
        if let Err(message) = outcome {
            let folder = self.0.path().to_string_lossy();
            assert!(message.contains(&*folder), "no file is named: {message}");
        }
    }
}

fn nothing(_: &Path) {}

fn outcome<T, E: Display>(result: Result<T, E>) -> Outcome {
    // With the causes, as the command prints them.
    result.map(drop).map_err(|error| format!("{error:#}"))
}

/// A robot of one link with a mesh, and what such meshes have beside them.
fn with_robot(folder: &Path, mesh: &str) {
    let urdf = format!(
        "<robot name=\"r\"><link name=\"a\"><visual><geometry><mesh filename=\"{mesh}\"/></geometry></visual>\
         <collision><geometry><mesh filename=\"{mesh}\"/></geometry></collision></link></robot>"
    );
    fs::write(folder.join("r.urdf"), urdf).unwrap();
    fs::write(folder.join("m.mtl"), "newmtl m\nKd 1 0 0\nmap_Kd t.png\n").unwrap();
    fs::write(folder.join("t.png"), PICTURE).unwrap();
}

fn robot(folder: &Path, _: &Path) -> Outcome {
    outcome(RobotModel::load(&folder.join("r.urdf"), &[]))
}

/// Both readers of Wavefront files.
fn wavefront(folder: &Path, _: &Path) -> Outcome {
    let object = outcome(mesh_io::load_obj(&folder.join("m.obj")));
    robot(folder, folder).and(object)
}

fn picture(_: &Path, file: &Path) -> Outcome {
    outcome(pictures::stored(file)).and(outcome(pictures::upright(file)))
}

/// One picture of two by two pixels.
const PICTURE: &[u8] = include_bytes!("../corpus/png/two-by-two.png");
const DEPTH: &[u8] = include_bytes!("../corpus/png/depth.png");

/// A data set of one image.
fn data_set(folder: &Path) {
    let scene = folder.join("test/000001");
    for inside in ["rgb", "depth"] {
        fs::create_dir_all(scene.join(inside)).unwrap();
    }
    fs::create_dir_all(folder.join("models")).unwrap();
    fs::write(scene.join("rgb/000000.png"), PICTURE).unwrap();
    fs::write(scene.join("depth/000000.png"), DEPTH).unwrap();
    for (name, text) in [
        (BOP[0], r#"{"0": {"cam_K": [500, 0, 1, 0, 500, 1, 0, 0, 1], "depth_scale": 1.0}}"#),
        (
            BOP[1],
            r#"{"0": [{"cam_R_m2c": [1, 0, 0, 0, 1, 0, 0, 0, 1], "cam_t_m2c": [0, 0, 500], "obj_id": 1}]}"#,
        ),
        (
            BOP[2],
            r#"{"0": [{"bbox_obj": [0, 0, 1, 1], "bbox_visib": [0, 0, 1, 1], "px_count_all": 1, "px_count_valid": 1, "px_count_visib": 1, "visib_fract": 1.0}]}"#,
        ),
        (
            BOP[3],
            r#"{"1": {"diameter": 10, "min_x": -1, "min_y": -1, "min_z": -1, "size_x": 2, "size_y": 2, "size_z": 2}}"#,
        ),
        (BOP[4], r#"[{"scene_id": 1, "im_id": 0, "obj_id": 1, "inst_count": 1}]"#),
        (BOP[5], r#"{"width": 2, "height": 2, "fx": 500, "fy": 500, "cx": 1, "cy": 1, "depth_scale": 1.0}"#),
        (BOP[6], r#"{"0": {"view": "a"}}"#),
    ] {
        fs::write(folder.join(name), text).unwrap();
    }
}

/// Files of a data set.
const BOP: [&str; 7] = [
    "test/000001/scene_camera.json",
    "test/000001/scene_gt.json",
    "test/000001/scene_gt_info.json",
    "models/models_info.json",
    "test_targets_bop19.json",
    "camera.json",
    "test/000001/scene_info.json",
];

fn bop(folder: &Path, _: &Path) -> Outcome {
    let set = Dataset::open(folder, None).map_err(|error| error.to_string())?;
    let mut found = outcome(set.targets()).and(outcome(set.target_images())).and(outcome(set.models_info()));
    for scene in set.scenes().unwrap_or_default() {
        let images = set.images(scene);
        for image in images.as_ref().map_or(&[][..], Vec::as_slice) {
            let each = [
                outcome(set.frame(scene, *image)),
                outcome(set.view(scene, *image)),
                outcome(set.ground_truths(scene, *image)),
                outcome(set.mask(scene, *image, 0)),
            ];
            found = each.into_iter().fold(found, Result::and);
        }
        found = found.and(outcome(images));
    }
    found
}

static FETCH: LazyLock<(RobotModel, RobotConfig)> = LazyLock::new(|| {
    let robot = RobotModel::load(&files::builtin_path("robots/fetch/fetch.urdf"), &[]).unwrap();
    RobotConfig::load(&files::builtin_path("robots/fetch/fetch.toml"), robot).unwrap()
});

/// A problem, both of whose files can be read.
fn problem(folder: &Path) {
    fs::write(folder.join("scene0001.yaml"), include_bytes!("../corpus/moveit-scene/scene.yaml")).unwrap();
    fs::write(folder.join("request0001.yaml"), include_bytes!("../corpus/moveit-request/request.yaml"))
        .unwrap();
}

fn moveit(folder: &Path, file: &Path) -> Outcome {
    let scene = if file.extension().is_some_and(|ending| ending == "scene") {
        "scene0001.scene"
    } else {
        "scene0001.yaml"
    };
    let (robot, config) = &*FETCH;
    outcome(load_problem(&folder.join("request0001.yaml"), &folder.join(scene), robot, config))
}

/// Files of our own in TOML, which people write.
const TOML: [&str; 5] = ["scene.toml", "condition.toml", "robot.toml", "objects.toml", "settings.toml"];

fn toml(_: &Path, file: &Path) -> Outcome {
    match file.file_stem().and_then(|stem| stem.to_str()) {
        Some("scene") => outcome(Scene::load(file)),
        Some("condition") => outcome(ConditionSpec::load(file)),
        Some("robot") => outcome(RobotConfig::load(file, FETCH.0.clone())),
        Some("objects") => outcome(table::load(file)),
        _ => outcome(Settings::load(file)),
    }
}

/// Files of estimates, in CSV and JSON.
const ESTIMATES: [&str; 3] = ["results.csv", "boxes.json", "003_cracker_box.json"];

fn estimates(_: &Path, file: &Path) -> Outcome {
    match file.file_name().and_then(|name| name.to_str()) {
        Some("results.csv") => outcome(read_results(file)),
        Some("boxes.json") => {
            let detector = for_dataset(Settings::default(), Path::new("")).perception.detector;
            outcome(Boxes::open(&file.to_string_lossy(), &detector, &DetectorOptions::default()))
        }
        _ => outcome(read_poses(file, "003_cracker_box")),
    }
}

/// The network and its description.
const NETWORK: [&str; 2] = ["n.onnx", "n.json"];

fn network(folder: &Path) {
    fs::write(folder.join("n.onnx"), &include_bytes!("../corpus/onnx/whole.onnx")[1..]).unwrap();
    fs::write(folder.join("n.json"), &include_bytes!("../corpus/onnx/description.json")[1..]).unwrap();
    fs::write(folder.join("n.onnx.data"), [0; 4096]).unwrap();
}

/// All of them.
pub const TARGETS: [Target; 18] = [
    Target { name: "urdf", files: &["r.urdf"], beside: nothing, read: robot },
    Target { name: "stl", files: &["m.stl"], beside: |folder| with_robot(folder, "m.stl"), read: robot },
    Target { name: "dae", files: &["m.dae"], beside: |folder| with_robot(folder, "m.dae"), read: robot },
    Target { name: "obj", files: &["m.obj"], beside: |folder| with_robot(folder, "m.obj"), read: wavefront },
    Target {
        name: "mtl",
        files: &["m.mtl"],
        beside: |folder| {
            with_robot(folder, "m.obj");
            fs::write(folder.join("m.obj"), include_bytes!("../corpus/obj/square.obj")).unwrap();
        },
        read: wavefront,
    },
    Target {
        name: "ply",
        files: &["m.ply"],
        beside: |folder| with_robot(folder, "m.ply"),
        read: |_, file| outcome(mesh_io::load_ply(file, 1e-3)),
    },
    Target {
        name: "gltf",
        files: &["m.gltf", "m.glb"],
        beside: |folder| fs::write(folder.join("t.png"), PICTURE).unwrap(),
        read: |_, file| outcome(any_mesh::load(file, 1.0)),
    },
    Target { name: "png", files: &["p.png"], beside: nothing, read: picture },
    Target { name: "jpeg", files: &["p.jpg"], beside: nothing, read: picture },
    Target { name: "tiff", files: &["p.tif"], beside: nothing, read: picture },
    Target { name: "bop", files: &BOP, beside: data_set, read: bop },
    Target { name: "estimates", files: &ESTIMATES, beside: nothing, read: estimates },
    Target { name: "moveit-scene", files: &["scene0001.yaml"], beside: problem, read: moveit },
    Target { name: "moveit-request", files: &["request0001.yaml"], beside: problem, read: moveit },
    Target { name: "moveit-text", files: &["scene0001.scene"], beside: problem, read: moveit },
    Target { name: "toml", files: &TOML, beside: nothing, read: toml },
    Target {
        name: "camera-info",
        files: &["c.yaml"],
        beside: nothing,
        read: |_, file| outcome(Intrinsics::load_ros(file)),
    },
    Target {
        name: "onnx",
        files: &NETWORK,
        beside: network,
        read: |folder, _| outcome(PyramidCnn::open(&folder.join("n.onnx"), &Providers::default())),
    },
];

/// The files from which inputs are made.
pub fn corpus(target: &Target) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target.name);
    let mut files: Vec<(PathBuf, Vec<u8>)> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| (path.clone(), fs::read(&path).unwrap()))
        .collect();
    files.sort();
    files
}
