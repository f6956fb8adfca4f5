//! Objects of one's own: from a mesh to its row, and what every command makes of it.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::common::{self, code, edited_scene, grip, root, stderr, stdout};
use serde_json::Value;

/// The triangles of a prism over a counter-clockwise outline that is cut into `caps`, from 0 to `height`.
fn prism(outline: &[[f64; 2]], caps: &[[usize; 3]], height: f64) -> Vec<[[f64; 3]; 3]> {
    let at = |i: usize, z: f64| [outline[i][0], outline[i][1], z];
    let mut triangles = Vec::new();
    for i in 0..outline.len() {
        let j = (i + 1) % outline.len();
        triangles.push([at(i, 0.0), at(j, 0.0), at(j, height)]);
        triangles.push([at(i, 0.0), at(j, height), at(i, height)]);
    }
    for [a, b, c] in caps {
        triangles.push([at(*a, height), at(*b, height), at(*c, height)]);
        triangles.push([at(*c, 0.0), at(*b, 0.0), at(*a, 0.0)]);
    }
    triangles
}

fn cuboid([x, y, z]: [f64; 3]) -> Vec<[[f64; 3]; 3]> {
    prism(&[[0.0, 0.0], [x, 0.0], [x, y], [0.0, y]], &[[0, 1, 2], [0, 2, 3]], z)
}

/// An L of two arms of 60 mm, 20 mm thick and 30 mm wide: 60 cm3.
fn bracket() -> Vec<[[f64; 3]; 3]> {
    let outline = [[0.0, 0.0], [60.0, 0.0], [60.0, 20.0], [20.0, 20.0], [20.0, 60.0], [0.0, 60.0]];
    prism(&outline, &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]], 30.0)
}

/// An OBJ with a texture.
fn write_obj(path: &Path, triangles: &[[[f64; 3]; 3]]) {
    let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
    let mut text = format!("mtllib {stem}.mtl\nusemtl m\nvt 0 0\nvt 1 0\nvt 1 1\n");
    for (i, triangle) in triangles.iter().enumerate() {
        for [x, y, z] in triangle {
            writeln!(text, "v {x} {y} {z}").unwrap();
        }
        writeln!(text, "f {}/1 {}/2 {}/3", 3 * i + 1, 3 * i + 2, 3 * i + 3).unwrap();
    }
    std::fs::write(path, text).unwrap();
    std::fs::write(path.with_extension("mtl"), format!("newmtl m\nmap_Kd {stem}.png\n")).unwrap();
    let picture = image::RgbImage::from_fn(64, 64, |x, y| image::Rgb([4 * x as u8, 4 * y as u8, 90]));
    picture.save(path.with_extension("png")).unwrap();
}

fn write_stl(path: &Path, triangles: &[[[f64; 3]; 3]]) {
    let mut bytes = vec![0u8; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0u8; 12]);
        triangle.iter().flatten().for_each(|v| bytes.extend((*v as f32).to_le_bytes()));
        bytes.extend([0u8; 2]);
    }
    std::fs::write(path, bytes).unwrap();
}

/// A green GLB of triangles that are not indexed.
fn write_glb(path: &Path, triangles: &[[[f64; 3]; 3]]) {
    let mut blob: Vec<u8> = Vec::new();
    triangles.iter().flatten().flatten().for_each(|v| blob.extend((*v as f32).to_le_bytes()));
    let (count, length) = (3 * triangles.len(), blob.len());
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}}]}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorFactor":[0.1,0.6,0.1,1],"metallicFactor":0}}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{count},"type":"VEC3"}}],
        "bufferViews":[{{"buffer":0,"byteLength":{length}}}],"buffers":[{{"byteLength":{length}}}]}}"#
    )
    .into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((28 + json.len() as u32 + blob.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &blob)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    std::fs::write(path, bytes).unwrap();
}

/// Meshes of a carton, a bracket and a block, and their table.
struct Shop {
    folder: tempfile::TempDir,
}

impl Shop {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        write_obj(&folder.path().join("carton.obj"), &cuboid([50.0, 70.0, 110.0]));
        write_stl(&folder.path().join("bracket.stl"), &bracket());
        // y is up in a glTF.
        write_glb(&folder.path().join("block.glb"), &cuboid([0.04, 0.1, 0.06]));
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).to_str().unwrap().to_owned()
    }

    fn add(&self, mesh: &str, more: &[&str]) -> std::process::Output {
        let (mesh, table) = (self.text(mesh), self.text("own.toml"));
        grip(&[&["objects", "add", &mesh, "--table", &table, "--json"], more].concat())
    }

    /// With all three in the table; what was measured of each.
    fn stocked(&self) -> [Value; 3] {
        let add = |mesh: &str, more: &[&str]| -> Value {
            let output = self.add(mesh, more);
            assert_eq!(code(&output), 0, "{}", stderr(&output));
            serde_json::from_str(&stdout(&output)).unwrap()
        };
        [
            add("carton.obj", &["--unit", "mm", "--mass", "0.3", "--friction", "0.4"]),
            add("bracket.stl", &["--unit", "mm", "--density", "1100", "--fragility", "delicate"]),
            add("block.glb", &["--density", "700", "--name", "wooden-block"]),
        ]
    }

    /// The default scene with these objects.
    fn scene(&self, names: &[&str]) -> PathBuf {
        let names: Vec<String> = names.iter().map(|name| format!("\"{name}\"")).collect();
        edited_scene(self.folder.path(), |text| {
            let (before, rest) = text.split_once("names = [").unwrap();
            let (_, after) = rest.split_once(']').unwrap();
            format!("{before}names = [{}]{after}", names.join(", "))
        })
    }
}

fn near(value: &Value, wanted: f64, share: f64) {
    let value = value.as_f64().unwrap();
    assert!((value - wanted).abs() <= share * wanted.abs(), "{value} is not {wanted}");
}

#[test]
fn what_is_measured_of_a_mesh_is_what_geometry_says() {
    let shop = Shop::new();
    let [carton, bracket, block] = shop.stocked();
    for (report, id) in [(&carton, 22), (&bracket, 23), (&block, 24)] {
        assert_eq!((&report["schema"], &report["bop_id"]), (&"grip.object-report/1".into(), &id.into()));
        assert_eq!(report["watertight"], true, "{report}");
        assert_eq!(report["warnings"], Value::Array(vec![]), "{report}");
        assert!(report["grasps"]["count"].as_u64().unwrap() > 0, "{report}");
        let shares = report["resting_poses"].as_array().unwrap().iter();
        let sum: f64 = shares.map(|pose| pose["share"].as_f64().unwrap()).sum();
        assert!((sum - 1.0).abs() < 1e-3, "{sum}");
    }
    // A box: m / 12 (b2 + c2).
    near(&carton["volume_m3"], 0.05 * 0.07 * 0.11, 1e-4);
    near(&carton["density_kg_m3"], 0.3 / 3.85e-4, 1e-4);
    near(&carton["inertia_kg_m2"][0][0], 0.3 / 12.0 * (0.07f64.powi(2) + 0.11f64.powi(2)), 1e-4);
    near(&carton["inertia_kg_m2"][2][2], 0.3 / 12.0 * (0.05f64.powi(2) + 0.07f64.powi(2)), 1e-4);
    near(&carton["grasps"]["widths_m"][0], 0.05, 0.02);
    assert_eq!(carton["half_turns"], serde_json::json!(["x", "y", "z"]));
    assert_eq!(carton["resting_poses"].as_array().unwrap().len(), 6);
    assert_eq!(carton["origin_in_file_m"][2].as_f64().map(|z| (1e6 * z).round()), Some(55_000.0));
    // An L: two boxes, by parallel axes. The origin is 30 mm from each outer side, the middle of mass 3 and 2 parts of the way.
    near(&bracket["volume_m3"], 6e-5, 1e-4);
    near(&bracket["mass_kg"], 0.066, 1e-4);
    let middle = (0.06 * 0.02 * 0.03 + 0.04 * 0.02 * 0.01) / (0.06 * 0.02 + 0.04 * 0.02);
    near(&bracket["center_of_mass_m"][0], middle - 0.03, 1e-3);
    let about_z = |[a, b, x, y]: [f64; 4]| {
        a * b * ((a * a + b * b) / 12.0 + (x - middle).powi(2) + (y - middle).powi(2)) / 2e-3
    };
    let inertia = about_z([0.06, 0.02, 0.03, 0.01]) + about_z([0.02, 0.04, 0.01, 0.04]);
    near(&bracket["inertia_kg_m2"][2][2], 0.066 * inertia, 1e-3);
    assert_eq!(bracket["half_turns"], serde_json::json!([]));
    // Along its y the glTF was 0.1 m high.
    near(&block["size_m"][2], 0.1, 1e-5);
    near(&block["mass_kg"], 0.04 * 0.06 * 0.1 * 700.0, 1e-4);

    let table = std::fs::read_to_string(shop.path("own.toml")).unwrap();
    assert!(
        table.starts_with("# Objects of our own") && table.matches("[[objects]]").count() == 3,
        "{table}"
    );
    assert!(table.contains("mesh = \"bracket.stl\"\nunit = \"mm\"\ndensity_kg_m3 = 1100.0"), "{table}");

    // Another program measures the same.
    let mut files = vec![shop.path("own.toml")];
    for report in [&carton, &bracket, &block] {
        files.push(shop.path(&format!("{}.json", report["name"].as_str().unwrap())));
        std::fs::write(files.last().unwrap(), report.to_string()).unwrap();
    }
    let files: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    common::python("check_objects.py", "trimesh, tomllib", &files);

    // Nothing is written of what is wrong, and the error says what to try.
    let lidless = cuboid([0.05, 0.05, 0.08]);
    write_stl(&shop.path("lidless.stl"), &lidless[..lidless.len() - 2]);
    for (mesh, more, wanted) in [
        (
            "carton.obj",
            vec!["--mass", "0.3", "--name", "huge"],
            "unit = \"mm\" makes it 50.0 x 70.0 x 110.0 mm",
        ),
        (
            "carton.obj",
            vec!["--mass", "0.3", "--unit", "mm"],
            "carton: there is an object of this name already",
        ),
        (
            "carton.obj",
            vec!["--mass", "0.3", "--unit", "mm", "--name", "b", "--bop-id", "23"],
            "25 and above",
        ),
        ("carton.obj", vec!["--mass", "90", "--unit", "mm", "--name", "b"], "mass_kg = 90"),
        ("bracket.stl", vec!["--mass", "0.3", "--unit", "mm", "--name", "b", "--texture", "x.png"], "x.png"),
        ("gone.stl", vec!["--mass", "0.3"], "gone.stl"),
    ] {
        let output = shop.add(mesh, &more);
        assert_eq!(code(&output), 2, "{more:?}");
        assert!(stderr(&output).contains(wanted), "{more:?}: {}", stderr(&output));
    }
    let open = shop.add("lidless.stl", &["--mass", "30", "--dry-run"]);
    assert_eq!(code(&open), 0, "{}", stderr(&open));
    let open: Value = serde_json::from_str(&stdout(&open)).unwrap();
    assert_eq!(open["watertight"], false);
    near(&open["volume_m3"], 2e-4, 1e-3);
    let warnings = open["warnings"].to_string();
    assert!(warnings.contains("not watertight") && warnings.contains("kg/m3"), "{warnings}");
    assert_eq!(std::fs::read_to_string(shop.path("own.toml")).unwrap(), table);
}

#[test]
fn every_command_takes_objects_of_ones_own() {
    let shop = Shop::new();
    shop.stocked();
    let table = shop.text("own.toml");
    let scene = shop.scene(&["carton", "bracket", "wooden-block", "005_tomato_soup_can"]);
    let scene = scene.to_str().unwrap();
    let run = |args: &[&str]| -> String {
        let output = grip(args);
        assert_eq!(code(&output), 0, "{args:?}: {}", stderr(&output));
        stdout(&output)
    };
    let list: Value =
        serde_json::from_str(&run(&["objects", "list", "--objects", &table, "--json"])).unwrap();
    let list = list["objects"].as_array().unwrap();
    assert!(list.len() == 24 && list[22]["name"] == "bracket");
    near(&list[22]["mass_kg"], 0.066, 1e-4);

    // Everything in a line of a sweep: an object, its friction, the chance that its grasps hold.
    let sweep = shop.text("sweep");
    let few = ["--mode", "isotropic", "--samples", "2", "--seeds", "2", "--range", "1,1", "--json"];
    let held = run(&[&["sweep", "carton", "--objects", &table, "--out", &sweep], &few[..]].concat());
    let held: Value = serde_json::from_str(&held).unwrap();
    assert_eq!((&held["grasps"], &held["objects"][0]["object"]), (&4.into(), &"carton".into()));
    let manifest: Value =
        serde_json::from_slice(&std::fs::read(shop.path("sweep/sweep.json")).unwrap()).unwrap();
    assert_eq!(manifest["object_set"], "own");
    assert!(manifest["objects"][0]["source"]["mesh"].as_str().unwrap().ends_with("carton.obj"));

    // What hangs between two pads slips when 2 mu F < m g: here below a friction of 0.29.
    for (friction, share) in [("0.26", 0.0), ("0.4", 1.0)] {
        let out = shop.text(&format!("friction-{friction}"));
        let more = ["--friction", friction, "--force", "5", "--objects", &table, "--out", &out];
        let held = run(&[&["sweep", "carton"], &more[..], &few[..]].concat());
        let held: Value = serde_json::from_str(&held).unwrap();
        let lines = std::fs::read_to_string(Path::new(&out).join("grasps.jsonl")).unwrap();
        let outcomes: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        let count = outcomes.iter().filter(|line| line["outcome"] == "held").count();
        assert_eq!(count as f64, share * outcomes.len() as f64, "friction {friction}: {held} {lines}");
    }

    let grasps = run(&["grasps", "bracket", "--objects", &table]);
    assert!(grasps.contains("bracket") && grasps.contains("object set: own"), "{grasps}");
    run(&["render", scene, "--objects", &table, "--renderer", "cpu", "--out", &shop.text("shot")]);
    let mjcf = shop.text("scene.xml");
    run(&["export", scene, "--objects", &table, "--mjcf", &mjcf]);
    assert!(std::fs::read_to_string(&mjcf).unwrap().contains("wooden-block"));

    // Names and tables behind one option.
    let set = shop.text("set");
    let views = ["--scenes", "1", "--views", "B=base", "--renderer", "cpu", "--out", &set];
    let own = ["--objects", &table, "--objects", "carton,wooden-block"];
    run(&[&["scenes", scene], &own[..], &views[..]].concat());
    for id in [22, 24] {
        assert!(shop.path("set").join(format!("models/obj_{id:06}.ply")).is_file(), "{id}");
    }
    // The network knows none of them: clusters are proposed, and poses are found.
    let results = shop.text("grip_set-test.csv");
    let output = grip(&["estimate", &set, "--out", &results]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(stderr(&output).contains("no class for obj_000022, obj_000024"), "{}", stderr(&output));
    assert_eq!(std::fs::read_to_string(&results).unwrap().lines().count(), 3);
    // A mesh that has changed is another data set.
    write_obj(&shop.path("carton.obj"), &cuboid([50.0, 70.0, 112.0]));
    let again = grip(&[&["scenes", scene], &own[..], &views[..], &["--resume"]].concat());
    assert_eq!(code(&again), 2);
    assert!(stderr(&again).contains("dataset.json"), "{}", stderr(&again));
}

#[test]
fn objects_of_ones_own_are_packed_and_a_changed_mesh_is_another_scenario() {
    let shop = Shop::new();
    shop.stocked();
    let scene = shop.scene(&["carton", "wooden-block", "bracket"]);
    // The scene names the table itself.
    let text = std::fs::read_to_string(&scene).unwrap();
    std::fs::write(&scene, text.replace("[objects]", "[objects]\ntables = [\"own.toml\"]")).unwrap();
    let scene = scene.to_str().unwrap();
    let pack = |estimator: &str, out: &str| -> (Value, String) {
        let out_folder = shop.text(out);
        let more = ["--renderer", "cpu", "--out", &out_folder, "--json"];
        let output = grip(&[&["pack", scene, "--estimator", estimator], &more[..]].concat());
        assert!(code(&output) < 2, "{}", stderr(&output));
        (serde_json::from_str(&stdout(&output)).unwrap(), stderr(&output))
    };
    let (truth, said) = pack("truth", "truth");
    assert!(truth["packed"].as_u64().unwrap() >= 2, "{truth}");
    assert!(truth["object_set"] == "own" && !said.contains("no class"), "{said}");
    let scenario: Value =
        serde_json::from_slice(&std::fs::read(shop.path("truth/scenario.json")).unwrap()).unwrap();
    assert_eq!(scenario["objects"][0]["source"]["sha256"].as_str().unwrap().len(), 64);

    let (seen, said) = pack("grip", "grip");
    assert!(said.contains("no class for bracket, carton, wooden-block"), "{said}");
    assert!(seen["packed"].as_u64().unwrap() >= 1, "{seen}");

    write_stl(&shop.path("bracket.stl"), &prism_30_5());
    let (changed, _) = pack("truth", "changed");
    assert_ne!(truth["scenario"], changed["scenario"]);
}

/// The bracket, half a millimetre wider.
fn prism_30_5() -> Vec<[[f64; 3]; 3]> {
    let mut triangles = bracket();
    triangles.iter_mut().flatten().for_each(|p| p[2] *= 30.5 / 30.0);
    triangles
}

#[test]
fn names_and_numbers_are_used_once_and_the_nearest_name_is_told() {
    let shop = Shop::new();
    let row = "mesh = \"bracket.stl\"\nunit = \"mm\"\nmass_kg = 0.1\nfriction = 0.5\nsymmetric = false\n\
               fragility = \"sturdy\"\nupright = false\n";
    let table = |name: &str, object: &str, id: u32| {
        let text = format!(
            "schema = \"grip.object-table/1\"\n[[objects]]\nname = \"{object}\"\nbop_id = {id}\n{row}"
        );
        std::fs::write(shop.path(name), text).unwrap();
        shop.text(name)
    };
    let (a, b) = (table("a.toml", "angle", 40), table("b.toml", "iron", 40));
    let c = table("c.toml", "angle", 41);
    let d = table("d.toml", "025_mug", 42);
    for (tables, wanted) in [
        (vec![&a, &b], vec!["b.toml", "bop_id = 40", "'angle'", "a.toml", "41 and above"]),
        (vec![&a, &c], vec!["c.toml", "'angle'", "a.toml"]),
        (vec![&d], vec!["d.toml", "025_mug", "scenes/objects.toml"]),
    ] {
        let mut args = vec!["objects"];
        tables.iter().for_each(|table| args.extend(["--objects", table.as_str()]));
        let output = grip(&args);
        assert_eq!(code(&output), 2);
        wanted.iter().for_each(|text| assert!(stderr(&output).contains(text), "{text}: {}", stderr(&output)));
    }
    // One that is named twice is read once.
    assert_eq!(code(&grip(&["objects", "--objects", &a, "--objects", &a])), 0);
    let scene = root().join("scenes/grocery.toml");
    let scene = scene.to_str().unwrap();
    let settings = shop.text("settings.toml");
    std::fs::write(&settings, "[success]\nslip_mm = 0.01\n").unwrap();
    for (args, wanted) in [
        (vec!["grasps", "angel", "--objects", &a], "did you mean 'angle'?"),
        (vec!["render", scene, "--condition", "drak"], "did you mean 'dark'?"),
        (vec!["pack", scene, "--estimator", "turth"], "did you mean 'truth'?"),
        (vec!["pack", scene, "--settings", &settings], "did you mean 'slip_m'?"),
        (vec!["render", scene, "--objects", "angle"], "a .toml file"),
    ] {
        let output = grip(&args);
        assert_eq!(code(&output), 2, "{args:?}");
        assert!(stderr(&output).contains(wanted), "{args:?}: {}", stderr(&output));
    }
}
