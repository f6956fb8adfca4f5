//! The main job, end to end, as a user runs it.

use crate::common::{self, code, root, stderr, stdout};
use grip::setup::{Setup, SetupOptions};
use grip_sim::objects::ObjectInfo;
use serde_json::Value;

/// Packs with `--json`; returns the result and the run folder's result.json.
fn pack(args: &[&str]) -> (Value, Value) {
    pack_on_threads(args, None)
}

/// The same with a fixed number of threads.
fn pack_on_threads(args: &[&str], threads: Option<usize>) -> (Value, Value) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let mut all = vec!["pack", "--json", "--out", out.to_str().unwrap()];
    all.extend(args);
    let output = common::grip_on_threads(&all, threads);
    assert!(code(&output) < 2, "{}", stderr(&output));
    let printed: Value = serde_json::from_str(&stdout(&output)).expect("stdout is one JSON object");
    let saved = std::fs::read_to_string(out.join("result.json")).unwrap();
    for file in
        ["report.html", "scenario.json", "frames/00_rgb.png", "frames/00_depth.png", "frames/00_overlay.png"]
    {
        assert!(out.join(file).exists(), "{file}");
    }
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(!page.contains("http://") && !page.contains("https://"), "the page needs no network");
    let made = &page[page.find("<p class=kind>One trial</p>").expect("says what it is")..];
    let of = concat!("<td>grip ", env!("CARGO_PKG_VERSION"), ", commit ");
    assert!(
        made.contains(of) && made.contains(" UTC") && made.contains(" pack --json --out "),
        "says where it comes from"
    );
    let all_packed = printed["packed"] == printed["requested"];
    assert_eq!(code(&output), i32::from(!all_packed), "exit code 0 if and only if everything was packed");
    (printed, serde_json::from_str(&saved).unwrap())
}

/// Wall times are the only thing that may differ between equal runs.
fn without_wall_times(mut result: Value) -> Value {
    result["timing"] = Value::Null;
    result
}

#[test]
fn the_same_seed_gives_the_same_trial_and_the_schema_holds() {
    let args = ["--seed", "2", "--items", "2", "--renderer", "cpu"];
    let (first, saved) = pack(&args);
    let (second, _) = pack_on_threads(&args, Some(1));
    assert_eq!(first, saved);
    assert_eq!(without_wall_times(first.clone()), without_wall_times(second));

    assert_eq!(first["schema"], "grip.trial/5");
    assert_eq!(first["seed"], 2);
    assert_eq!(first["scene"], "grocery");
    assert_eq!(first["condition"], "base");
    assert_eq!(first["estimator"], "grip");
    assert_eq!(first["detector"], "pyramid");
    assert_eq!(first["hypotheses"], "cpu");
    assert_eq!(first["object_set"], "built-in");
    assert_eq!(first["requested"], 2);
    assert!(first["packed"].as_u64().unwrap() >= 1, "GRIP's own poses pack something: {first}");
    assert_eq!(first["state_hash"].as_str().unwrap().len(), 64);
    for key in ["packed", "sim_s"] {
        assert!(first[key].is_number(), "{key}");
    }
    assert!(first["timing"]["wall_s"].as_f64().unwrap() > 0.0);
    assert_eq!(first["timing"]["items"].as_array().unwrap().len(), 2);
    assert_eq!(first["scenario"].as_str().unwrap().len(), 64);
    for item in first["items"].as_array().unwrap() {
        for key in ["object", "outcome", "stage"] {
            assert!(item[key].is_string(), "{key}");
        }
        assert!(item["peak_force_n"].is_number());
        // A packed item passed every clause.
        let clauses = item["clauses"].as_object().unwrap();
        let all = clauses.values().all(|v| v == true);
        assert!(item["outcome"] != "packed" || all, "{item}");
        // What the clauses were judged by says the same.
        let value = |key: &str| item["measures"][key].as_f64().unwrap();
        if all {
            assert!(value("pinch_n") >= 1.0 && value("pinch_dot") <= -0.3, "{item}");
            assert!(value("risen_m") >= 0.03 && value("clear_s") >= 0.1, "{item}");
            assert!(value("slip_m") <= 0.02 && value("slip_deg") <= 20.0, "{item}");
            assert!(value("below_edge_m") > 0.0 && value("speed_m_s") < 0.01, "{item}");
        }
    }
    // Four milliseconds a control period, five checks in each, while the robot moved.
    let check = &first["motion_check"];
    assert!(check["checked"].as_u64().unwrap() > 20_000, "{check}");
    assert_eq!(check["collisions"], serde_json::json!([]));
}

#[test]
fn strict_prints_every_clause_with_its_value() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let args = ["pack", "--estimator", "truth", "--items", "1", "--renderer", "cpu", "--strict", "--out"];
    let output = common::grip(&[&args[..], &[out.to_str().unwrap()]].concat());
    let text = stdout(&output);
    for clause in
        ["opposing contacts", "lifted clear", "held after carry", "slip within bounds", "at rest in the bin"]
    {
        let line =
            text.lines().find(|line| line.contains(clause)).unwrap_or_else(|| panic!("no {clause}: {text}"));
        assert!(
            line.contains("yes") && line.contains("at ") && line.chars().any(|c| c.is_ascii_digit()),
            "{line}"
        );
    }
}

#[test]
fn with_true_poses_nearly_everything_is_packed() {
    let mut packed = 0;
    let mut requested = 0;
    for seed in ["1", "2"] {
        let (result, _) = pack(&["--seed", seed, "--estimator", "truth", "--renderer", "cpu"]);
        assert_eq!(result["estimator"], "truth", "a ceiling is marked as one");
        packed += result["packed"].as_u64().unwrap();
        requested += result["requested"].as_u64().unwrap();
    }
    assert_eq!(requested, 10);
    assert!(packed >= 8, "{packed} of {requested}");
}

#[test]
fn grasps_that_one_command_saves_the_other_uses_and_a_replay_shows_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let (sets, out) = (path("grasps"), path("run"));
    let pack = ["pack", "--estimator", "truth", "--items", "1", "--seed", "3", "--animation", "--out", &out];
    let with_sets = [&pack[..], &["--grasps", &sets]].concat();
    let missing = common::grip(&with_sets);
    assert_eq!(code(&missing), 2);
    assert!(stderr(&missing).contains("004_sugar_box.json"), "{}", stderr(&missing));
    assert!(stderr(&missing).contains("grip grasps 004_sugar_box"), "{}", stderr(&missing));

    let scene = grip_sim::scene::Scene::load(&root().join("scenes/grocery.toml")).unwrap();
    let names: Vec<&str> = scene.objects.names.iter().map(String::as_str).collect();
    let made = common::grip(&[&["grasps", "--json", "--out", &sets][..], &names].concat());
    assert_eq!(code(&made), 0, "{}", stderr(&made));
    let printed: Value = serde_json::from_str(&stdout(&made)).unwrap();
    assert_eq!(printed[0]["schema"], "grip.grasps/1");
    assert!(printed.as_array().unwrap().iter().all(|set| set["grasps"].as_array().unwrap().len() > 100));

    let packed = common::grip(&with_sets);
    assert_eq!(code(&packed), 0, "{}", stdout(&packed));
    let result: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("run/result.json")).unwrap())
            .unwrap();
    let score = &result["score"];
    assert_eq!((&score["attempts"], &score["lost_in_transit"]), (&1.into(), &0.into()), "{score}");
    assert!((0.3..1.3).contains(&score["density"].as_f64().unwrap()), "{score}");
    assert!(score["drift_m"].as_f64().unwrap() < 1e-3, "{score}");
    let item = &result["items"][0];
    let (blow, harmless) = (&item["peak_impulse_n_s"], &item["harmless_impulse_n_s"]);
    assert!(blow.as_f64().unwrap() > 0.0 && blow.as_f64() < harmless.as_f64(), "{item}");
    // A title, four pictures of the attempt in one row with captions, and some fifteen seconds four times as fast.
    let strip = image::open(folder.path().join("run/film.jpg")).unwrap();
    assert_eq!((strip.width(), strip.height()), (4 * 480 + 3 * 6, 30 + 6 + 360 + 30));
    let file = std::io::BufReader::new(std::fs::File::open(folder.path().join("run/replay.png")).unwrap());
    let replay = png::Decoder::new(file).read_info().unwrap();
    let frames = replay.info().animation_control.unwrap().num_frames;
    assert_eq!((replay.info().width, replay.info().height), (640, 480));
    assert!((20..80).contains(&frames), "{frames}");
    let page = std::fs::read_to_string(folder.path().join("run/report.html")).unwrap();
    assert!(page.contains("data:image/png") && page.contains("004_sugar_box: packed"));
    // Both fingers press when the hand has closed, and the picture says how much.
    let (_, contact) = page.split_once("<figcaption>contact: ").unwrap();
    let forces: Vec<f64> = contact
        .split_once("</figcaption>")
        .unwrap()
        .0
        .split(", ")
        .map(|force| force.trim_end_matches(" N").parse().unwrap())
        .collect();
    assert!(forces.len() == 2 && forces.iter().all(|newtons| (1.0..200.0).contains(newtons)), "{forces:?}");
}

#[test]
fn in_the_dark_there_is_a_picture_for_people_beside_the_true_one() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let args = ["--estimator", "truth", "--items", "1", "--condition", "dark", "--renderer", "cpu", "--out"];
    let output = common::grip(&[&["pack"], &args[..], &[out.to_str().unwrap()]].concat());
    assert!(code(&output) < 2, "{}", stderr(&output));
    let mean = |name: &str| {
        let picture = image::open(out.join(name)).unwrap().into_rgb8();
        picture.iter().map(|&c| f64::from(c)).sum::<f64>() / picture.len() as f64
    };
    let [dark, bright] = ["frames/00_rgb.png", "frames/00_bright.png"].map(mean);
    assert!(dark < 20.0 && bright > 4.0 * dark, "{dark} {bright}");
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("times for people"));
}

#[test]
fn scenes_of_the_project_are_valid() {
    let mut scenes = 0;
    for entry in std::fs::read_dir(root().join("scenes")).unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        if text.contains("schema = \"grip.scene/1\"") {
            grip_sim::scene::Scene::load(&path).unwrap();
            scenes += 1;
        }
    }
    assert!(scenes > 0);
    let conditions = root().join("scenes/conditions");
    let names = grip_sim::condition::ConditionSpec::names(&conditions).unwrap();
    for name in
        ["base", "dark", "light-left", "light-right", "clutter-1", "clutter-2", "clutter-3", "slippery"]
    {
        assert!(names.iter().any(|n| n == name), "{name}");
    }
    for name in names {
        grip_sim::condition::ConditionSpec::load_named(&conditions, &name).unwrap();
    }
}

#[test]
fn objects_may_be_other_than_the_robot_knows_and_the_same_seed_gives_the_same_ones() {
    let load = |condition: &str| {
        let options = SetupOptions { condition: condition.into(), ..SetupOptions::default() };
        let setup = Setup::load(&options).unwrap();
        let placed = setup.drop_objects().unwrap().0.placed();
        let of = |info: &ObjectInfo| (info.name.clone(), info.mass_kg, info.friction);
        let known: Vec<_> = setup.models.iter().map(|model| of(&model.info)).collect();
        (known, placed.iter().map(|(model, _)| of(&model.info)).collect::<Vec<_>>())
    };
    let (known, real) = load("base");
    assert_eq!(known, real);
    let (still_known, others) = load("slippery");
    assert_eq!(known, still_known, "the table is what the robot knows");
    for ((name, mass, friction), (other, true_mass, true_friction)) in known.iter().zip(&others) {
        assert_eq!(name, other);
        assert!((0.5..=1.5).contains(&(true_mass / mass)), "{name}: {true_mass} kg");
        assert!((0.5..=1.0).contains(&(true_friction / friction)), "{name}: {true_friction}");
    }
    let shares: Vec<f64> = known.iter().zip(&others).map(|(known, other)| other.1 / known.1).collect();
    assert!(shares.windows(2).all(|pair| (pair[0] - pair[1]).abs() > 1e-6), "each has its own: {shares:?}");
    assert_eq!(others, load("slippery").1);
}

#[test]
fn two_of_a_kind_are_packed_each_once() {
    let (result, _) =
        pack(&["scenes/pairs.toml", "--estimator", "truth", "--seed", "3", "--renderer", "cpu"]);
    let items = result["items"].as_array().unwrap();
    let names: Vec<_> =
        items.iter().map(|item| (item["object"].as_str().unwrap(), item["instance"].as_u64())).collect();
    let cans = [("005_tomato_soup_can", None), ("005_tomato_soup_can", Some(2))];
    assert_eq!(names[..2], cans, "{names:?}");
    assert_eq!(result["requested"], 6);
    assert_eq!(result["packed"], 6, "{result}");
}
