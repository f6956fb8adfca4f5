//! `grip eval --paper`, `grip eval --figure` and `grip convergence`: numbers that were worked out by hand, pictures that hold
//! what they should, and what is wrong said by name.

use std::path::{Path, PathBuf};

use crate::common::{code, grip, root, stderr, stdout};
use serde_json::{Value, json};

/// The identity and a quarter turn about z, under which a cube looks the same.
const AS_IS: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
const TURNED: [f64; 9] = [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
const VIEWS: [&str; 7] = ["B", "D", "D1", "D2", "O1", "O2", "O3"];

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn run(args: &[&str]) -> String {
    let output = grip(args);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    stdout(&output)
}

fn refused(args: &[&str], expected: &str) {
    let output = grip(args);
    assert_eq!(code(&output), 2, "{args:?}: {}", stdout(&output));
    assert!(stderr(&output).contains(expected), "{args:?}: {}", stderr(&output));
}

/// A BOP set without pictures: cubes of 100 mm a metre before the camera, an image a view, with these objects in each.
fn cubes(folder: &Path, views: &[&str], objects: impl Fn(&str) -> Vec<u32>) -> PathBuf {
    let set = folder.join(format!("cubes-{}", views.len()));
    let scene = set.join("test/000001");
    for folder in [&scene, &set.join("models")] {
        std::fs::create_dir_all(folder).unwrap();
    }
    let mut ply =
        "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n\
                   element face 3\nproperty list uchar int vertex_indices\nend_header\n"
            .to_owned();
    for i in 0..8 {
        let side = |bit: i32| 100 * (i >> bit & 1) - 50;
        ply += &format!("{} {} {}\n", side(0), side(1), side(2));
    }
    // A corner that no face has would be left out.
    ply += "3 0 1 2\n3 3 4 5\n3 6 7 0\n";
    let (mut infos, mut cameras, mut truths) = (json!({}), json!({}), json!({}));
    let mut frames = Vec::new();
    for (i, view) in views.iter().enumerate() {
        let image = i.to_string();
        cameras[&image] = json!({"cam_K": [500, 0, 320, 0, 500, 240, 0, 0, 1], "depth_scale": 1.0});
        frames.push(json!({"im_id": i, "name": format!("exp001_{view}")}));
        let mut entries = Vec::new();
        for id in objects(view) {
            entries.push(json!({"obj_id": id, "cam_R_m2c": AS_IS, "cam_t_m2c": [0, 0, 1000]}));
            infos[id.to_string()] = json!({
                "diameter": 173.2, "min_x": -50, "min_y": -50, "min_z": -50,
                "size_x": 100, "size_y": 100, "size_z": 100,
            });
            std::fs::write(set.join(format!("models/obj_{id:06}.ply")), &ply).unwrap();
        }
        truths[&image] = json!(entries);
    }
    for (name, content) in [
        ("test/000001/scene_camera.json", cameras),
        ("test/000001/scene_gt.json", truths),
        ("test/000001/scene_info.json", json!({"frames": frames})),
        ("models/models_info.json", infos),
    ] {
        std::fs::write(set.join(name), content.to_string()).unwrap();
    }
    set
}

/// A line of a results file: the truth, turned and moved by this much along x, millimetres.
fn line(image: usize, object: u32, rotation: [f64; 9], shift_mm: f64) -> String {
    let numbers = rotation.map(|x| x.to_string()).join(" ");
    format!("1,{image},{object},0.5,{numbers},{shift_mm} 0 1000,-1\n")
}

/// 003_cracker_box (2, by ADD-S) in all views; 019_pitcher_base (11, by ADD) in all but O1 to O3.
fn made_up(folder: &Path) -> (PathBuf, PathBuf) {
    let set = cubes(folder, &VIEWS, |view| if view.starts_with('O') { vec![2] } else { vec![2, 11] });
    let results = folder.join("made-up.csv");
    let lines = [
        "scene_id,im_id,obj_id,score,R,t,time\n".to_owned(),
        line(0, 2, TURNED, 0.0),
        line(0, 11, AS_IS, 10.0),
        line(1, 2, AS_IS, 0.0),
        line(2, 2, AS_IS, 20.0),
        line(1, 11, TURNED, 0.0),
        line(2, 11, AS_IS, 0.0),
        line(3, 11, AS_IS, 0.0),
        line(4, 2, AS_IS, -30.0),
        line(5, 2, AS_IS, 10.0),
        line(6, 2, TURNED, 0.0),
    ];
    std::fs::write(&results, lines.concat()).unwrap();
    (set, results)
}

fn near(value: &Value, expected: f64) {
    let value = value.as_f64().unwrap_or_else(|| panic!("{value} is no number"));
    assert!((value - expected).abs() < 1e-9, "{value}, not {expected}");
}

#[test]
fn the_papers_table_by_hand() {
    let folder = tempfile::tempdir().unwrap();
    let (set, results) = made_up(folder.path());
    let args = ["eval", text(&set), text(&results), "--paper"];
    let json: Value = serde_json::from_str(&run(&[&args[..], &["--json"]].concat())).unwrap();
    near(&json["paper"]["threshold_m"], 0.04);
    let groups = json["paper"]["groups"].as_array().unwrap();
    assert_eq!(
        groups.iter().map(|g| g["name"].as_str().unwrap()).collect::<Vec<_>>(),
        ["base", "varied lighting", "occlusions"]
    );
    let row = |group: usize, id: u32| {
        let rows = groups[group]["objects"].as_array().unwrap();
        assert_eq!(rows.len(), 15);
        rows.iter().find(|row| row["obj_id"] == id).unwrap()
    };
    // A cube's quarter turn is nothing to ADD-S and everything to ADD.
    near(&row(0, 2)["auc"], 1.0);
    near(&row(0, 11)["auc"], 0.75);
    near(&groups[0]["overall"]["auc"], 0.875);
    // Exact, half the threshold, missed; turned, exact, exact.
    near(&row(1, 2)["auc"], 0.5);
    near(&row(1, 11)["auc"], 2.0 / 3.0);
    near(&groups[1]["overall"]["auc"], (0.5 + 2.0 / 3.0) / 2.0);
    near(&row(2, 2)["auc"], 2.0 / 3.0);
    assert_eq!((&row(2, 2)["metric"], &row(1, 11)["metric"]), (&"ADD-S".into(), &"ADD".into()));
    assert_eq!((&row(2, 2)["instances"], &row(1, 11)["instances"]), (&3.into(), &3.into()));
    // What has no instances has no figures, and the mean is over the others: the paper's too.
    assert_eq!((&row(2, 11)["auc"], &row(2, 11)["interval"]), (&Value::Null, &Value::Null));
    let overall = &groups[2]["overall"];
    assert_eq!(overall["objects"], 1);
    near(&overall["auc"], 2.0 / 3.0);
    near(&overall["published"][2], 0.7442);
    near(&groups[1]["overall"]["published"][2], (0.7923 + 0.1659) / 2.0);
    near(&groups[1]["overall"]["published"][1], (0.6225 + 0.2490) / 2.0);
    assert_eq!(groups[1]["overall"]["published"][0], Value::Null);
    // Of three images with 0.25, 0.75 and 1 the bootstrap reaches both ends; one image says nothing of others.
    near(&row(2, 2)["interval"][0], 0.25);
    near(&row(2, 2)["interval"][1], 1.0);
    assert_eq!((&row(0, 11)["interval"], &groups[0]["overall"]["interval"]), (&Value::Null, &Value::Null));

    let table = run(&args);
    let words = |start: &str, nth: usize| -> Vec<String> {
        let line = table.lines().filter(|line| line.trim_start().starts_with(start)).nth(nth).unwrap();
        line.split_whitespace().map(str::to_owned).collect()
    };
    let expected = ["003_cracker_box", "ADD-S", "1", "100.0", "-", "78.8", "59.2", "63.8"];
    assert_eq!(words("003", 0), expected);
    assert_eq!(words("019", 2), ["019_pitcher_base", "ADD", "0", "-", "-", "18.7", "33.4", "-"]);
    assert_eq!(words("overall", 2)[..7], ["overall:", "1", "of", "15", "objects", "3", "66.7"]);
}

#[test]
fn the_papers_table_names_what_a_set_lacks() {
    let folder = tempfile::tempdir().unwrap();
    let results = folder.path().join("none.csv");
    std::fs::write(&results, "scene_id,im_id,obj_id,score,R,t,time\n").unwrap();
    let set = cubes(folder.path(), &["B", "O1"], |_| vec![2]);
    let paper = |set: &Path, expected: &str| {
        refused(&["eval", text(set), text(&results), "--paper"], expected);
    };
    paper(&set, "missing: D, D1, D2, O2, O3");
    std::fs::remove_file(set.join("test/000001/scene_info.json")).unwrap();
    paper(&set, "missing: B, D, D1, D2, O1, O2, O3");
    let others = cubes(folder.path(), &VIEWS, |_| vec![1, 3]);
    paper(&others, "none of the paper's objects");
    paper(&others, "it has 1, 3");
}

/// Lines in the colours of curves, as numbers of points, and all texts.
fn read_svg(path: &Path) -> (Vec<usize>, Vec<String>) {
    let content = std::fs::read_to_string(path).unwrap();
    let svg = roxmltree::Document::parse(&content).unwrap();
    let named = |name: &'static str| svg.descendants().filter(move |n| n.tag_name().name() == name);
    let curves = named("polyline")
        .filter(|line| line.attribute("stroke-width") == Some("4"))
        .map(|line| line.attribute("points").unwrap().split_whitespace().count())
        .collect();
    (curves, named("text").map(|node| node.text().unwrap().trim().to_owned()).collect())
}

#[test]
fn accuracy_curves_are_as_many_as_files_and_their_areas_are_the_tables() {
    let folder = tempfile::tempdir().unwrap();
    let (set, one) = made_up(folder.path());
    let two = folder.path().join("a & <b>.csv");
    std::fs::write(&two, line(0, 2, AS_IS, 4.0)).unwrap();
    let out = folder.path().join("figure.svg");
    let args = ["eval", text(&set), text(&one), text(&two), "--figure", text(&out), "--json"];
    let json: Value = serde_json::from_str(&run(&args)).unwrap();
    let (curves, texts) = read_svg(&out);
    // Two panels; the lines of the legend have two points.
    assert_eq!(curves.iter().filter(|points| **points > 2).count(), 4);
    assert_eq!(curves.iter().filter(|points| **points == 2).count(), 4);
    for (file, name) in json.as_array().unwrap().iter().zip(["made-up", "a & <b>"]) {
        for metric in ["auc_adds", "auc_add_or_adds"] {
            let area = 100.0 * file["all"][metric][0].as_f64().unwrap();
            let label = format!("{name}: AUC {area:.1} %, 11 instances");
            assert!(texts.contains(&label), "{label}: {texts:?}");
        }
    }
    assert!(texts.iter().any(|text| text == "threshold, mm"), "{texts:?}");
    // The tables of both, under their names.
    let table = run(&["eval", text(&set), text(&one), text(&two)]);
    assert!(
        table.contains(text(&one)) && table.contains(text(&two)) && table.matches("view D1").count() == 2
    );

    let nowhere = one.join("folder.svg");
    refused(&["eval", text(&set), text(&one), "--figure", text(&nowhere)], "another place");
    refused(&["eval", text(&set), text(&one), "--figure", text(folder.path())], "is a folder");
    refused(&["eval", text(&set), text(&one), text(&two), "--errors", "e.csv"], "for one results file");
    let many = [&["eval", text(&set)][..], &[text(&one); 8], &["--figure", text(&out)]].concat();
    refused(&many, "colours for 7 results files, not for 8");
    refused(&["eval", text(&set)], "<RESULTS>");
}

#[test]
fn convergence_ends_where_an_estimate_does() {
    let folder = tempfile::tempdir().unwrap();
    let set = folder.path().join("set");
    let scene = root().join("scenes/adversarial.toml");
    let objects = "005_tomato_soup_can,061_foam_brick";
    let made = ["scenes", text(&scene), "--scenes", "1", "--views", "B", "--seed", "3", "--objects", objects];
    run(&[&made[..], &["--out", text(&set)]].concat());
    let few = folder.path().join("few.toml");
    std::fs::write(&few, "[perception.paper_guarded]\nsamples = 40\niterations = 5").unwrap();
    let out = folder.path().join("convergence.svg");
    let paper = format!("paper-guarded={}", text(&few));
    let base = ["convergence", text(&set), "--out", text(&out), "--estimator", "grip"];
    let args = [&base[..], &["--scene", "1", "--image", "0"]].concat();
    let json = run(&[&args[..], &["--estimator", &paper, "--seeds", "2", "--json"]].concat());
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["estimators"][1]["name"], "paper-guarded (few)");
    let trials = json["trials"].as_array().unwrap();
    assert_eq!(trials.len(), 8);
    for trial in trials {
        let points = trial["points"].as_array().unwrap();
        let numbers = |key: &str| points.iter().map(|p| p[key].as_f64().unwrap()).collect::<Vec<_>>();
        assert!(numbers("seconds").is_sorted() && numbers("hypotheses").is_sorted());
        assert!(numbers("adds_m").iter().zip(numbers("add_m")).all(|(adds, add)| *adds <= add + 1e-12));
        if trial["estimator"] == 1 {
            assert_eq!(numbers("hypotheses"), [40.0, 80.0, 120.0, 160.0, 200.0]);
        }
    }
    // The same boxes, stream and search as grip estimate has.
    let (results, errors) = (folder.path().join("results.csv"), folder.path().join("errors.csv"));
    run(&["estimate", text(&set), "--boxes", "jittered", "--out", text(&results)]);
    run(&["eval", text(&set), text(&results), "--errors", text(&errors)]);
    let mut compared = 0;
    for line in std::fs::read_to_string(&errors).unwrap().lines().skip(1) {
        // All but the kind of the error.
        let fields: Vec<f64> = line.split(',').take(9).map(|field| field.parse().unwrap()).collect();
        let same = |t: &&Value| t["estimator"] == 0 && t["seed"] == 1 && t["obj_id"] == fields[2] as u32;
        let end = trials.iter().find(same).unwrap()["points"].as_array().unwrap().last().unwrap();
        assert!((1e3 * end["add_m"].as_f64().unwrap() - fields[4]).abs() < 1e-5, "{line} {end}");
        assert!((1e3 * end["adds_m"].as_f64().unwrap() - fields[5]).abs() < 1e-5, "{line} {end}");
        compared += 1;
    }
    assert_eq!(compared, 2);
    // Two contenders in four panels.
    let (curves, texts) = read_svg(&out);
    assert_eq!(curves.iter().filter(|points| **points > 2).count(), 8);
    for expected in ["iteration", "time, ms", "ADD-S by iteration", "ADD by time"] {
        assert!(texts.iter().any(|text| text == expected), "{expected}: {texts:?}");
    }
    let end = json["estimators"][0]["summary"]["adds_m"].as_f64().unwrap() * 1e3;
    let label = format!("grip: {end:.1} mm after ");
    assert!(texts.iter().filter(|text| text.starts_with(&label)).count() >= 2, "{label} {texts:?}");

    let with = |more: &[&str], expected: &str| refused(&[&base[..], more].concat(), expected);
    with(&["--scene", "9", "--image", "0"], "has no scene 9 in test; it has 1");
    with(&["--scene", "1", "--image", "7"], "scene 1 has no image 7; it has 0");
    with(&["--scene", "1", "--image", "0", "--object", "2"], "has no object 2; it has 4, 21");
    with(&["--scene", "1", "--image", "0", "--estimator", "guess"], "must be grip, paper or paper-guarded");
    with(
        &["--scene", "1", "--image", "0", "--estimator", "paper=no.json"],
        "--settings: no.json: No such file",
    );
    let nowhere = set.join("test/000001/scene_gt.json/folder.svg");
    let args = ["convergence", text(&set), "--scene", "1", "--image", "0", "--out", text(&nowhere)];
    refused(&args, "another place");
}

#[test]
fn table_one_is_redone_from_nothing_and_kept() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("table");
    let args = [
        "reproduce",
        "table1",
        "--scenes",
        "1",
        "--seed",
        "4",
        "--methods",
        "grip",
        "--out",
        text(&out),
        "--json",
    ];
    let first: Value = serde_json::from_str(&run(&args)).unwrap();
    let written = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    assert_eq!(first, serde_json::from_str::<Value>(&written("table1.json")).unwrap());
    // The figures are those of the commands that it names.
    let set = out.join("set");
    let eval = run(&["eval", text(&set), text(&out.join("grip.csv")), "--paper", "--json"]);
    let eval: Value = serde_json::from_str(&eval).unwrap();
    assert_eq!(first["methods"][0]["table"], eval["paper"]);
    assert!(
        first["scenes"].as_str().unwrap().starts_with("grip scenes --seed 4 --scenes 1 --out "),
        "{first}"
    );
    let overall = eval["paper"]["groups"][0]["overall"]["auc"].as_f64().unwrap();
    for (name, expected) in [
        ("table1.md", format!("| Overall | **{overall:.3}** |")),
        ("table1.tex", format!("Overall & \\textbf{{{overall:.3}}} &")),
        ("table1.html", format!("<tr><td>Overall<td class=n><b>{overall:.3}</b>")),
        ("accuracy.svg", "006_mustard_bottle, occlusions".to_owned()),
        ("convergence.svg", "ADD-S by iteration".to_owned()),
    ] {
        assert!(written(name).contains(&expected), "{name}: {expected}");
    }
    // Nothing is estimated again.
    let stamp = || std::fs::metadata(out.join("grip.csv")).unwrap().modified().unwrap();
    let before = stamp();
    assert_eq!(serde_json::from_str::<Value>(&run(&args)).unwrap(), first);
    assert_eq!(stamp(), before);
    refused(&["reproduce", "table1", "--methods", "grip,grip"], "grip is there twice");
    refused(&["reproduce", "table1", "--methods", "posecnn"], "NAME=cmd:PROGRAM");
    // What is not there is said before hours of computing.
    let nowhere = folder.path().join("nowhere");
    let late = folder.path().join("late");
    refused(&["reproduce", "table1", "--real", text(&nowhere), "--out", text(&late)], "--real: ");
    assert!(!late.exists());
}
