//! Pose metrics against an implementation in Python that shares nothing with ours but definitions: errors of single pairs and the
//! recalls made of them, and what `grip eval` says of a data set.

use std::path::Path;

use crate::common::{self, code, grip, root, stderr, stdout};
use grip_perception::metrics::{
    AverageRecall, Hits, Measured, PairErrors, Surface, SymmetricShape, THRESHOLDS, vsd,
};
use grip_sim::bop::results::{Estimate, HEADER};
use grip_sim::bop::{Dataset, Symmetries, SymmetryAxis};
use grip_sim::camera::Intrinsics;
use grip_sim::images::DepthImage;
use grip_sim::mesh::Mesh;
use grip_sim::pose::{Camera, Object, Pose};
use grip_sim::render::object_depth;
use grip_sim::rng;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{Rng, RngExt};
use serde_json::{Value, json};

/// Fewer columns than 640, so that thresholds in pixels must be scaled; pixels are not square.
const K: Intrinsics = Intrinsics { width: 160, height: 120, fx: 150.0, fy: 140.0, cx: 81.2, cy: 57.9 };

type ObjectPose = Pose<Camera, Object>;

/// A prism of this many sides about the axis z through `middle`.
fn prism(sides: u32, radius: f32, height: f32, middle: [f32; 2]) -> Mesh {
    let rim = |z: f32| {
        (0..sides).map(move |i| {
            let (sin, cos) = (std::f32::consts::TAU * i as f32 / sides as f32).sin_cos();
            Point3::new(middle[0] + radius * cos, middle[1] + radius * sin, z)
        })
    };
    let positions: Vec<Point3<f32>> = rim(-0.5 * height).chain(rim(0.5 * height)).collect();
    let side = |i: u32| {
        let next = (i + 1) % sides;
        [[i, next, sides + i], [next, sides + next, sides + i]]
    };
    let cap = |i: u32| [[0, i, i + 1], [sides, sides + i, sides + i + 1]];
    let triangles = (0..sides).flat_map(side).chain((1..sides - 1).flat_map(cap)).collect();
    Mesh { normals: vec![Vector3::z(); positions.len()], positions, triangles, ..Mesh::default() }
}

struct Model {
    mesh: Mesh,
    symmetries: Symmetries,
    diameter: f64,
    surface: Surface,
    shape: SymmetricShape,
}

impl Model {
    fn new(mesh: Mesh, discrete: Vec<Isometry3<f64>>, continuous: Vec<SymmetryAxis>) -> Self {
        let points: Vec<Point3<f64>> = mesh.positions.iter().map(|p| p.cast()).collect();
        let far = |p: &Point3<f64>| points.iter().map(|q| nalgebra::distance(p, q)).fold(0.0, f64::max);
        let diameter = points.iter().map(far).fold(0.0, f64::max);
        let symmetries = Symmetries { discrete, continuous };
        let shape = SymmetricShape::new(points.clone(), &symmetries);
        Self { surface: Surface::new(points), shape, diameter, symmetries, mesh }
    }

    fn json(&self) -> Value {
        let matrix = |iso: &Isometry3<f64>| iso.to_homogeneous().transpose().as_slice().to_vec();
        let axis = |s: &SymmetryAxis| json!([s.axis.as_slice(), s.through.coords.as_slice()]);
        json!({
            "points": self.mesh.positions.iter().map(|p| p.cast::<f64>().coords.as_slice().to_vec()).collect::<Vec<_>>(),
            "diameter": self.diameter,
            "discrete": self.symmetries.discrete.iter().map(matrix).collect::<Vec<_>>(),
            "continuous": self.symmetries.continuous.iter().map(axis).collect::<Vec<_>>(),
        })
    }
}

/// One of each kind: without symmetry, with a discrete one, a continuous one that does not pass the origin, and both.
fn models() -> Vec<Model> {
    let half_turn = |axis: Vector3<f64>, through: Point3<f64>| {
        Isometry3::rotation_wrt_point(UnitQuaternion::from_scaled_axis(axis * std::f64::consts::PI), through)
    };
    let middle = Point3::new(0.02, -0.01, 0.0);
    let axis = SymmetryAxis { axis: Vector3::z_axis(), through: middle };
    vec![
        Model::new(prism(3, 0.06, 0.11, [0.01, 0.0]), vec![], vec![]),
        Model::new(prism(4, 0.05, 0.15, [0.0, 0.0]), vec![half_turn(Vector3::z(), Point3::origin())], vec![]),
        Model::new(prism(40, 0.04, 0.1, [0.02, -0.01]), vec![], vec![axis]),
        Model::new(prism(40, 0.05, 0.06, [0.02, -0.01]), vec![half_turn(Vector3::x(), middle)], vec![axis]),
    ]
}

fn between(random: &mut impl Rng, low: f64, high: f64) -> f64 {
    random.random_range(low..high)
}

fn turn(random: &mut impl Rng, most: f64) -> UnitQuaternion<f64> {
    let axis = Vector3::from_fn(|_, _| between(random, -1.0, 1.0)).normalize();
    UnitQuaternion::from_scaled_axis(axis * between(random, 0.0, most))
}

/// An estimate of this truth: from nearly right to useless, turned by one of the symmetries as often as not.
fn estimate(random: &mut impl Rng, truth: &ObjectPose, model: &Model) -> ObjectPose {
    let scale = between(random, 0.0, 1.0).powi(3);
    let shift = Vector3::from_fn(|_, _| between(random, -0.08, 0.08)) * scale;
    let moved = Isometry3::from_parts(Translation3::from(shift), turn(random, 2.0 * scale));
    let turns = model.symmetries.transforms(0.03);
    let iso = truth.iso() * turns[random.random_range(0..turns.len())] * moved;
    Pose::new(iso)
}

/// What the camera measures of this: a wall, noise, holes, and something in front of it all on one side.
fn measure(random: &mut impl Rng, of_truths: &[DepthImage]) -> DepthImage {
    let mut seen = DepthImage::filled(K.width, K.height, 0.9);
    let covered = random.random_range(0..K.width);
    for v in 0..K.height {
        for u in 0..K.width {
            let pixel = seen.at_mut(u, v);
            for depth in of_truths.iter().map(|image| *image.at(u, v)).filter(|depth| *depth > 0.0) {
                *pixel = pixel.min(depth);
            }
            if u > covered {
                *pixel = pixel.min(0.55);
            }
            *pixel += between(random, -0.012, 0.012) as f32;
            if random.random_range(0..12) == 0 {
                *pixel = 0.0;
            }
        }
    }
    seen
}

fn numbers(pose: &ObjectPose) -> Vec<f64> {
    let rotation = pose.rotation().to_rotation_matrix();
    rotation.matrix().transpose().iter().chain(pose.translation().iter()).copied().collect()
}

#[test]
fn errors_and_recalls_are_what_another_implementation_finds() {
    let folder = tempfile::tempdir().unwrap();
    let models = models();
    let mut random = rng::stream(5, "metrics");
    let mut images: Vec<DepthImage> = Vec::new();
    let mut targets = Vec::new();
    let mut hits = Vec::new();
    let mut pairs = 0;
    for round in 0..100 {
        let number = round % models.len();
        let model = &models[number];
        let count = 1 + round % 3;
        let truths: Vec<ObjectPose> = (0..count)
            .map(|_| {
                let at = Translation3::new(
                    between(&mut random, -0.25, 0.25),
                    between(&mut random, -0.2, 0.2),
                    between(&mut random, 0.4, 0.8),
                );
                Pose::new(Isometry3::from_parts(at, turn(&mut random, 3.0)))
            })
            .collect();
        // Now and then one is missing.
        let given = if round % 7 == 0 { count - 1 } else { count };
        let estimates: Vec<ObjectPose> = (0..given)
            .map(|_| {
                let of = random.random_range(0..count);
                estimate(&mut random, &truths[of], model)
            })
            .collect();
        let draw = |pose: &ObjectPose| object_depth(&model.mesh, pose, &K);
        let whole = |pose: &ObjectPose| {
            let drawn = draw(pose);
            let pixels = (0..K.width * K.height).map(|i| drawn.at(i % K.width, i / K.width));
            DepthImage::from_vec(K.width, K.height, pixels.collect()).unwrap()
        };
        let of_truths: Vec<DepthImage> = truths.iter().map(whole).collect();
        let measured = measure(&mut random, &of_truths);
        let tolerances = THRESHOLDS.map(|share| share * model.diameter);
        let mut rows: Vec<Vec<PairErrors>> = Vec::new();
        let mut found = Vec::new();
        for guess in &estimates {
            let row: Vec<PairErrors> = truths
                .iter()
                .map(|truth| PairErrors {
                    mssd_m: model.shape.mssd(truth, guess),
                    mspd_px: model.shape.mspd(truth, guess, &K),
                    vsd: vsd(&measured, &draw(truth), &draw(guess), &K, &tolerances),
                })
                .collect();
            let entry = |(truth, pair): (&ObjectPose, &PairErrors)| {
                json!({
                    "add": model.surface.add(truth, guess), "adds": model.surface.adds(truth, guess),
                    "mssd": pair.mssd_m, "mspd": pair.mspd_px, "vsd": pair.vsd,
                })
            };
            found.push(truths.iter().zip(&row).map(entry).collect::<Vec<_>>());
            pairs += row.len();
            rows.push(row);
        }
        let scale = Measured { diameter_m: model.diameter, width: Some(K.width), depth: true };
        hits.push(Hits::new(&rows, count, &scale));
        let mut place = |poses: &[ObjectPose]| -> Vec<Value> {
            let one = |pose: &ObjectPose| {
                images.push(whole(pose));
                json!({"pose": numbers(pose), "depth": images.len() - 1})
            };
            poses.iter().map(one).collect()
        };
        let (truths, estimates) = (place(&truths), place(&estimates));
        images.push(measured);
        targets.push(json!({
            "model": number, "truths": truths, "estimates": estimates, "measured": images.len() - 1, "errors": found,
        }));
    }
    println!("{pairs} pairs");
    let recall = AverageRecall::new(&hits);
    println!("{recall:?}");
    // Neither all right nor all wrong, or the recalls would say nothing.
    assert!((0.1..0.8).contains(&recall.ar.unwrap()));
    let table = json!({
        "size": [K.width, K.height], "camera": [K.fx, K.fy, K.cx, K.cy],
        "models": models.iter().map(Model::json).collect::<Vec<_>>(), "targets": targets, "recall": recall,
    });
    std::fs::write(folder.path().join("table.json"), table.to_string()).unwrap();
    let bytes: Vec<u8> = images.iter().flat_map(|i| i.data()).flat_map(|depth| depth.to_le_bytes()).collect();
    std::fs::write(folder.path().join("depth.raw"), bytes).unwrap();
    common::python("pose_metrics.py", "numpy", &[folder.path()]);
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A results file with an estimate of each instance that the data set asks for, but for one.
fn results(set: &Dataset, path: &Path) {
    let mut random = rng::stream(6, "metrics");
    let mut lines = vec![format!("{HEADER}\n")];
    let targets = set.targets().unwrap().unwrap();
    for target in &targets[1..] {
        let truths = set.ground_truths(target.scene_id, target.im_id).unwrap();
        let truth = truths.iter().find(|truth| truth.obj_id == target.obj_id).unwrap();
        let scale = between(&mut random, 0.0, 1.0).powi(2);
        let shift = Vector3::from_fn(|_, _| between(&mut random, -0.05, 0.05)) * scale;
        let moved = Isometry3::from_parts(Translation3::from(shift), turn(&mut random, scale));
        let estimate = Estimate {
            scene_id: target.scene_id,
            im_id: target.im_id,
            obj_id: target.obj_id,
            score: 0.5,
            camera_from_object: Pose::new(truth.camera_from_object.iso() * moved),
            time_s: None,
        };
        lines.push(estimate.line());
    }
    std::fs::write(path, lines.concat()).unwrap();
}

#[test]
fn eval_says_of_a_data_set_what_another_implementation_says_and_what_it_lacks() {
    let folder = tempfile::tempdir().unwrap();
    let [set, given, errors, figures] =
        ["set", "given.csv", "errors.csv", "eval.json"].map(|name| folder.path().join(name));
    let scene = root().join("scenes/adversarial.toml");
    let output = grip(&[
        "scenes",
        text(&scene),
        "--scenes",
        "1",
        "--views",
        "B,O1",
        "--seed",
        "13",
        "--out",
        text(&set),
    ]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    results(&Dataset::open(&set, None).unwrap(), &given);
    let eval = |more: &[&str]| {
        let output = grip(&[&["eval", text(&set), text(&given)], more].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        (stdout(&output), stderr(&output))
    };
    let (json, said) = eval(&["--json", "--errors", text(&errors)]);
    assert_eq!(said, "");
    std::fs::write(&figures, &json).unwrap();
    common::python("check_errors.py", "numpy, PIL", &[&set, &given, &errors, &figures]);
    let json: Value = serde_json::from_str(&json).unwrap();
    let bop = &json["all"]["bop"];
    let figure = |name: &str| bop[name].as_f64().unwrap();
    assert!((0.2..0.9).contains(&figure("ar")), "{bop}");
    assert!((figure("ar") - (figure("ar_vsd") + figure("ar_mssd") + figure("ar_mspd")) / 3.0).abs() < 1e-12);
    assert!(
        json["conditions"]["O1"]["bop"]["ar"].is_number()
            && bop["recall_vsd"].as_array().unwrap().len() == 10
    );
    let [low, high] = [0, 1].map(|i| bop["ar_interval"][i].as_f64().unwrap());
    assert!(low <= figure("ar") && figure("ar") <= high && high - low < 0.5, "{bop}");
    let kinds = json["all"]["kinds"].as_object().unwrap();
    let counted: u64 = kinds.values().map(|kind| kind["instances"].as_u64().unwrap()).sum();
    assert_eq!(json["all"]["instances"], counted, "{kinds:?}");
    let (table, _) = eval(&[]);
    for kind in kinds.keys() {
        assert!(table.contains(&kind.replace('_', " ")), "{table}");
    }
    let percent = |name: &str| format!("{:.1}", 100.0 * figure(name));
    let all = table.lines().find(|line| line.trim_start().starts_with("all")).unwrap();
    assert!(all.trim_end().ends_with(&percent("ar")), "{table}");
    assert!(
        table.contains(&format!("mean of VSD {}, MSSD {}", percent("ar_vsd"), percent("ar_mssd"))),
        "{table}"
    );

    // Without one of the two depth pictures there is no VSD of its view, nor of all.
    let scene = set.join("test/000001");
    std::fs::remove_file(scene.join("depth/000001.png")).unwrap();
    let (json, said) = eval(&["--json", "--errors", text(&errors)]);
    assert!(said.contains("1 of 2 images have no depth picture"), "{said}");
    let json: Value = serde_json::from_str(&json).unwrap();
    let bop = |of: &Value, name: &str| of["bop"][name].clone();
    for name in ["ar", "ar_interval", "ar_vsd", "recall_vsd"] {
        assert_eq!(bop(&json["all"], name), Value::Null, "{name}");
        assert_eq!(bop(&json["conditions"]["O1"], name), Value::Null, "{name}");
        // One image has figures, but no interval.
        assert_eq!(bop(&json["conditions"]["B"], name).is_null(), name == "ar_interval", "{name}");
    }
    assert_eq!(bop(&json["all"], "ar_mspd").as_f64().unwrap(), figure("ar_mspd"));
    let lines = std::fs::read_to_string(&errors).unwrap();
    let of_image =
        |image: &str| lines.lines().filter(move |line| line.starts_with(image)).collect::<Vec<_>>();
    let no_vsd = |line: &&str| line.split(',').nth(8).is_some_and(str::is_empty);
    assert!(of_image("1,1,").iter().all(no_vsd), "{lines}");
    assert!(!of_image("1,0,")[1..].iter().any(no_vsd), "{lines}");
    let (table, _) = eval(&[]);
    assert!(table.contains("average recall AR -, mean of VSD -, MSSD"), "{table}");

    // Without any picture camera.json tells the width, without that nothing does.
    for folder in ["depth", "rgb"] {
        std::fs::remove_dir_all(scene.join(folder)).unwrap();
    }
    let (json, said) = eval(&["--json"]);
    assert!(said.contains("2 of 2 images have no depth picture") && !said.contains("width"), "{said}");
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(bop(&json["all"], "ar_mspd").as_f64().unwrap(), figure("ar_mspd"));
    std::fs::remove_file(set.join("camera.json")).unwrap();
    let (json, said) = eval(&["--json"]);
    assert!(said.contains("no camera.json to tell their width: no MSPD"), "{said}");
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(bop(&json["all"], "ar_mspd"), Value::Null);
    assert_eq!(bop(&json["all"], "ar_mssd").as_f64().unwrap(), figure("ar_mssd"));

    // A depth picture that is there must be one.
    std::fs::create_dir_all(scene.join("depth")).unwrap();
    std::fs::write(scene.join("depth/000000.png"), b"no picture").unwrap();
    let output = grip(&["eval", text(&set), text(&given)]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("000000.png: is no picture"), "{}", stderr(&output));
}
