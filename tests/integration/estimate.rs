//! `grip estimate` and `grip eval`: the same poses on any number of threads and after any stop, errors that another
//! implementation finds too, and what is wrong with a file said by name.

use std::path::{Path, PathBuf};

use crate::common::{self, code, grip, root, stderr, stdout};

/// A data set of one scene: a spread layout and a heap.
pub fn data_set(folder: &Path) -> PathBuf {
    let out = folder.join("set");
    let scene = root().join("scenes/adversarial.toml");
    let args =
        ["scenes", scene.to_str().unwrap(), "--scenes", "1", "--views", "B,O1", "--seed", "11", "--out"];
    let output = grip(&[&args[..], &[out.to_str().unwrap()]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    out
}

/// Lines of a results file without the time, which is measured.
fn poses(path: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(path).unwrap();
    text.lines().map(|line| line.rsplit_once(',').unwrap().0.to_owned()).collect()
}

fn eval(set: &Path, results: &Path, more: &[&str]) -> serde_json::Value {
    let output =
        grip(&[&["eval", set.to_str().unwrap(), results.to_str().unwrap(), "--json"], more].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    serde_json::from_str(&stdout(&output)).unwrap()
}

/// A results file that says the truth, moved by this much along the camera's x, millimetres.
pub fn truth(set: &Path, shift_mm: f64) -> String {
    let text = std::fs::read_to_string(set.join("test/000001/scene_gt.json")).unwrap();
    let images: serde_json::Value = serde_json::from_str(&text).unwrap();
    let mut lines = "scene_id,im_id,obj_id,score,R,t,time\n".to_owned();
    for (image, truths) in images.as_object().unwrap() {
        for truth in truths.as_array().unwrap() {
            let numbers = |key: &str| -> Vec<f64> {
                truth[key].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
            };
            let join = |n: &[f64]| n.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
            let mut t = numbers("cam_t_m2c");
            t[0] += shift_mm;
            let r = join(&numbers("cam_R_m2c"));
            lines += &format!("1,{image},{},0.5,{r},{},-1\n", truth["obj_id"], join(&t));
        }
    }
    lines
}

#[test]
fn poses_are_the_same_on_any_number_of_threads_and_after_a_stop_and_their_errors_are_right() {
    let folder = tempfile::tempdir().unwrap();
    let set = data_set(folder.path());
    let estimate = |out: &Path, more: &[&str]| {
        let args = ["estimate", set.to_str().unwrap(), "--boxes", "gt", "--out", out.to_str().unwrap()];
        grip(&[&args[..], more].concat())
    };
    let (one, two) = (folder.path().join("one.csv"), folder.path().join("two.csv"));
    let output = estimate(&one, &["--jobs", "1", "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let summary: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!((&summary["schema"], &summary["images"]), (&"grip.estimate/1".into(), &2.into()));
    // With boxes of the truth and the models themselves, geometry is found to millimetres.
    let errors = folder.path().join("errors.csv");
    let json = eval(&set, &one, &["--errors", errors.to_str().unwrap()]);
    let area = json["all"]["auc_adds"][0].as_f64().unwrap();
    println!("{}", json["all"]);
    assert!(area > 0.8, "{area}");
    assert_eq!(json["conditions"].as_object().unwrap().keys().collect::<Vec<_>>(), ["B", "O1"]);
    let figures = folder.path().join("eval.json");
    std::fs::write(&figures, json.to_string()).unwrap();
    common::python("check_errors.py", "numpy, PIL", &[&set, &one, &errors, &figures]);

    // As a kill leaves it: the first image whole, the last line cut off.
    let lines = std::fs::read_to_string(&one).unwrap();
    let output = estimate(&two, &["--jobs", "2"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(poses(&one), poses(&two));
    let described = serde_json::json!({"another": "run"});
    let partial = folder.path().join("two.csv.partial");
    assert!(!partial.exists());
    std::fs::write(&partial, format!("# {described}\n")).unwrap();
    let output = estimate(&two, &["--resume"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("other settings"), "{}", stderr(&output));

    let half: Vec<&str> = lines.lines().skip(1).collect();
    let first = half.iter().filter(|line| line.starts_with("1,0,")).copied().collect::<Vec<_>>().join("\n");
    let settings = format!("# {}", summary["settings"]);
    std::fs::write(&partial, format!("{settings}\n{first}\n# whole 1 0\n1,1,5,0.3")).unwrap();
    let output = estimate(&two, &["--resume", "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let resumed: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!((&resumed["images"], &resumed["kept"]), (&1.into(), &1.into()));
    assert_eq!(poses(&one), poses(&two));

    posteriors_are_written_and_held_against_the_truth(&set, &one);
    a_scene_is_tracked_as_a_whole(&set, &one);
    hard_detections_lose_what_they_are_not_sure_of(&set);

    // The truth has no error, and a shift is its own ADD.
    let given = folder.path().join("given.csv");
    std::fs::write(&given, truth(&set, 0.0)).unwrap();
    let exact = eval(&set, &given, &[]);
    assert!((exact["all"]["auc_add"][0].as_f64().unwrap() - 1.0).abs() < 1e-6);
    let keys = |of: &str| exact[of].as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!(keys("names"), keys("objects"));
    let table = stdout(&grip(&["eval", set.to_str().unwrap(), given.to_str().unwrap()]));
    let mut names = exact["names"].as_object().unwrap().values().map(|name| name.as_str().unwrap());
    assert!(
        names.all(|name| name.contains('_') && table.contains(name)) && !table.contains("object "),
        "{table}"
    );
    std::fs::write(&given, truth(&set, 10.0)).unwrap();
    let json = eval(&set, &given, &["--errors", errors.to_str().unwrap()]);
    assert!((json["all"]["auc_add"][0].as_f64().unwrap() - 0.75).abs() < 1e-6, "{}", json["all"]);
    assert!((json["all"]["auc_add"][1].as_f64().unwrap() - 0.9).abs() < 1e-6);
    assert!(json["all"]["auc_adds"][0].as_f64().unwrap() > 0.75);
    std::fs::write(&figures, json.to_string()).unwrap();
    common::python("check_errors.py", "numpy, PIL", &[&set, &given, &errors, &figures]);

    for (content, expected) in [
        ("1,0,5,0.5\n", "line 1: has 4 fields"),
        ("7,0,5,0.5,1 0 0 0 1 0 0 0 1,0 0 900,-1\n", "another data set"),
    ] {
        std::fs::write(&given, content).unwrap();
        let output = grip(&["eval", set.to_str().unwrap(), given.to_str().unwrap()]);
        assert_eq!(code(&output), 2);
        assert!(stderr(&output).contains(expected), "{}", stderr(&output));
    }
    let output = grip(&["estimate", set.to_str().unwrap(), "--boxes", "guess", "--out", "x.csv"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("--boxes guess"), "{}", stderr(&output));

    // Hypotheses on a graphics adapter, where there is one: found as well, and the outputs say where.
    let settings = folder.path().join("settings.toml");
    std::fs::write(&settings, "[perception.grip.restarts]\nmost = 1").unwrap();
    let gpu = folder.path().join("gpu.csv");
    let output = estimate(&gpu, &["--hypotheses", "gpu", "--json", "--settings", settings.to_str().unwrap()]);
    if code(&output) == 2 && std::env::var_os("GRIP_REQUIRE_ADAPTER").is_none() {
        assert!(stderr(&output).contains("--hypotheses cpu"), "{}", stderr(&output));
        println!("SKIPPED estimating on the GPU: {}", stderr(&output));
    } else {
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let summary: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
        assert!(summary["settings"]["hypotheses"].as_str().unwrap().starts_with("gpu: "), "{summary}");
        let json = eval(&set, &gpu, &[]);
        println!("on the GPU, one search an object: {}", json["all"]);
        assert!(json["all"]["auc_adds"][0].as_f64().unwrap() > 0.7, "{}", json["all"]);
    }
    let output = estimate(&gpu, &["--hypotheses", "gpu", "--estimator", "paper"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("--hypotheses gpu: is for --estimator grip"), "{}", stderr(&output));

    // The paper's filter, by other settings than the published ones.
    let paper = |text: &str, jobs: &str, out: &str| {
        std::fs::write(&settings, format!("[perception.paper_guarded]\n{text}")).unwrap();
        let out = folder.path().join(out);
        let paths = [&set, &settings, &out].map(|path| path.to_str().unwrap());
        let [set, settings, out_text] = paths;
        let output = grip(&[
            "estimate",
            set,
            "--settings",
            settings,
            "--out",
            out_text,
            "--boxes",
            "gt",
            "--jobs",
            jobs,
            "--estimator",
            "paper-guarded",
            "--json",
        ]);
        (out, output)
    };
    let (one, output) = paper("samples = 60\niterations = 20", "1", "paper-1.csv");
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let summary: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let used = &summary["settings"]["settings"];
    assert_eq!((&used["samples"], &used["keep_best"]), (&60.into(), &true.into()));
    let (four, _) = paper("samples = 60\niterations = 20", "4", "paper-4.csv");
    assert_eq!(poses(&one), poses(&four));
    for (text, expected) in [
        ("sample = 60", "perception.paper_guarded.sample: unknown field `sample`"),
        ("samples = \"many\"", "perception.paper_guarded.samples: invalid type"),
        ("samples = 0", "perception.paper_guarded.samples = 0: 1 to 100000"),
        ("alpha_b = 0.5", "with a sum of 1"),
        ("60", "line 2"),
    ] {
        let (out, output) = paper(text, "1", "paper-bad.csv");
        assert_eq!(code(&output), 2, "{text}");
        assert!(stderr(&output).contains(expected), "{text}: {}", stderr(&output));
        assert!(!out.exists());
    }
}

/// One object of each image has a box that is believed, the others have one that is not.
fn hard_detections_lose_what_they_are_not_sure_of(set: &Path) {
    let folder = set.parent().unwrap();
    let truth = std::fs::read_to_string(set.join("test/000001/scene_gt.json")).unwrap();
    let truth: serde_json::Value = serde_json::from_str(&truth).unwrap();
    let (mut boxes, mut believed) = (Vec::new(), Vec::new());
    for (image, instances) in truth.as_object().unwrap() {
        for (i, instance) in instances.as_array().unwrap().iter().enumerate() {
            let (image, object) = (image.parse::<u32>().unwrap(), &instance["obj_id"]);
            let score = if i == 0 { 0.6 } else { 0.4 };
            boxes.push(serde_json::json!({ "scene_id": 1, "image_id": image, "category_id": object,
                "bbox": [0, 0, 640, 480], "score": score }));
            if i == 0 {
                believed.push(format!("1,{image},{object},"));
            }
        }
    }
    let (file, out) = (folder.join("boxes.json"), folder.join("hard.csv"));
    std::fs::write(&file, serde_json::to_string(&boxes).unwrap()).unwrap();
    let [set, file, out_text] = [set, &file, &out].map(|path| path.to_str().unwrap());
    let args = ["estimate", set, "--boxes", file, "--min-confidence", "0.5", "--out", out_text, "--json"];
    let output = grip(&args);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let summary: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(summary["settings"]["min_confidence"], 0.5);
    let found = poses(&out);
    assert_eq!(found.len() - 1, believed.len(), "{found:?}");
    assert!(believed.iter().all(|start| found.iter().any(|line| line.starts_with(start))), "{found:?}");
    let output = grip(&["estimate", set, "--min-confidence", "50"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("must be 0 to 1"), "{}", stderr(&output));
}

/// `one` are the poses of the same run without tracking.
fn a_scene_is_tracked_as_a_whole(set: &Path, one: &Path) {
    let folder = one.parent().unwrap();
    let [out, again] = ["track.csv", "track2.csv"].map(|name| folder.join(name));
    let run = |out: &Path, more: &[&str]| {
        let [set, out] = [set, out].map(|path| path.to_str().unwrap());
        grip(&[&["estimate", set, "--boxes", "gt", "--track", "--out", out, "--json"], more].concat())
    };
    let output = run(&out, &["--jobs", "1"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let summary: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(summary["settings"]["track"], true);
    assert_eq!(code(&run(&again, &["--jobs", "2"])), 0);
    assert_eq!(poses(&out), poses(&again));
    // The first image is like any; what lies elsewhere in the second is found there all the same.
    let of = |path: &Path, image: &str| -> Vec<String> {
        poses(path).into_iter().filter(|line| line.starts_with(image)).collect()
    };
    assert_eq!(of(&out, "1,0,"), of(one, "1,0,"));
    assert!(!of(&out, "1,1,").is_empty());
    let json = eval(set, &out, &[]);
    assert!(json["all"]["auc_adds"][0].as_f64().unwrap() > 0.8, "{}", json["all"]);

    // Stopped after the first image: what was believed there is gone, so the scene begins anew.
    let text = std::fs::read_to_string(&out).unwrap();
    let first: String =
        text.lines().filter(|line| line.starts_with("1,0,")).map(|line| format!("{line}\n")).collect();
    let partial = folder.join("track2.csv.partial");
    std::fs::write(&partial, format!("# {}\n{first}# whole 1 0\n", summary["settings"])).unwrap();
    let output = run(&again, &["--resume"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let resumed: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!((&resumed["images"], &resumed["kept"]), (&2.into(), &0.into()));
    assert_eq!(poses(&out), poses(&again));

    let output = run(&again, &["--estimator", "paper"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("--track"), "{}", stderr(&output));
}

/// `one` are the poses of the same run without them.
fn posteriors_are_written_and_held_against_the_truth(set: &Path, one: &Path) {
    let folder = one.parent().unwrap();
    let [results, posteriors] = ["p.csv", "p.jsonl"].map(|name| folder.join(name));
    let [out, beside] = [&results, &posteriors].map(|path| path.to_str().unwrap());
    let set = set.to_str().unwrap();
    let run = |more: &[&str]| {
        let args = ["estimate", set, "--boxes", "gt", "--out", out, "--posteriors", beside, "--json"];
        let output = grip(&[&args[..], more].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        serde_json::from_str::<serde_json::Value>(&stdout(&output)).unwrap()
    };
    let summary = run(&[]);
    assert_eq!(poses(one), poses(&results));
    let text = std::fs::read_to_string(&posteriors).unwrap();
    let lines: Vec<serde_json::Value> = text.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    // Its first line is a header.
    assert_eq!(lines.len() + 1, poses(&results).len());
    for line in &lines {
        let modes = line["modes"].as_array().unwrap();
        let mass: f64 = modes.iter().map(|mode| mode["mass"].as_f64().unwrap()).sum();
        assert!((mass - 1.0).abs() < 1e-9, "{line}");
        for mode in modes {
            let rows = mode["covariance"].as_array().unwrap();
            let at = |i: usize, j: usize| rows[i][j].as_f64().unwrap();
            assert!((0..6).all(|i| at(i, i) > 0.0 && (0..6).all(|j| (at(i, j) - at(j, i)).abs() < 1e-12)));
        }
    }
    let said = grip(&["eval", set, out, "--posteriors", beside, "--json"]);
    assert_eq!(code(&said), 0, "{}", stderr(&said));
    let said: serde_json::Value = serde_json::from_str(&stdout(&said)).unwrap();
    let all = &said["credibility"]["all"];
    assert_eq!(all["cases"].as_u64().unwrap() as usize, lines.len());
    let ranks: f64 = all["ranks"].as_array().unwrap().iter().map(|share| share.as_f64().unwrap()).sum();
    assert!((ranks - 1.0).abs() < 1e-9, "{all}");
    assert!(
        all["within"][0].as_f64() <= all["within"][1].as_f64() && all["within"][1].as_f64() > Some(0.5),
        "{all}"
    );

    // A stopped run: one image whole in both files, of the other the posteriors are cut off.
    let header = format!("# {}\n", summary["settings"]);
    let csv = std::fs::read_to_string(&results).unwrap();
    let marked = |lines: &[&str], begins: [&str; 2]| -> String {
        let of = |image: usize| {
            let of_image: String = lines
                .iter()
                .filter(|line| line.starts_with(begins[image]))
                .map(|line| format!("{line}\n"))
                .collect();
            of_image + &format!("# whole 1 {image}\n")
        };
        of(0) + &of(1)
    };
    let of_csv = marked(&csv.lines().collect::<Vec<_>>(), ["1,0,", "1,1,"]);
    let begins = ["{\"scene_id\":1,\"im_id\":0,", "{\"scene_id\":1,\"im_id\":1,"];
    let of_jsonl = marked(&text.lines().collect::<Vec<_>>(), begins);
    std::fs::write(folder.join("p.csv.partial"), header.clone() + &of_csv).unwrap();
    std::fs::write(folder.join("p.jsonl.partial"), header + &of_jsonl[..of_jsonl.len() - 60]).unwrap();
    let resumed = run(&["--resume"]);
    assert_eq!((&resumed["images"], &resumed["kept"]), (&1.into(), &1.into()));
    assert_eq!(std::fs::read_to_string(&posteriors).unwrap(), text);
    assert!(!folder.join("p.jsonl.partial").exists());

    // What cannot be right says so.
    std::fs::write(&posteriors, "{\"scene_id\": 1}\n").unwrap();
    let output = grip(&["eval", set, out, "--posteriors", beside]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("p.jsonl, line 1"), "{}", stderr(&output));
    let output = grip(&["eval", set, out, out, "--posteriors", beside]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("one results file"), "{}", stderr(&output));
}

#[test]
fn objects_that_are_not_there_are_looked_for_and_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    let set = data_set(folder.path());
    let out = folder.path().join("absent.csv");
    let args = ["estimate", set.to_str().unwrap(), "--boxes", "jittered", "--absent", "3", "--out"];
    let output = grip(&[&args[..], &[out.to_str().unwrap()]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let json = eval(&set, &out, &[]);
    let presence = &json["presence"];
    // Three in each of the two images; they are no estimates too many.
    assert_eq!((&presence["absent"], &json["ignored"]), (&6.into(), &0.into()));
    assert_eq!(presence["present"], json["all"]["estimated"]);
    assert_eq!(poses(&out).len() as u64, 1 + 6 + presence["present"].as_u64().unwrap());
    let auroc = presence["auroc"].as_f64().unwrap();
    assert!(auroc > 0.9, "{presence}");
    let roc = presence["roc"].as_array().unwrap();
    assert_eq!(roc.last().unwrap(), &serde_json::json!([1.0, 1.0]));

    let output = grip(&[&args[..5], &["101", "--out", out.to_str().unwrap()]].concat());
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("--absent"), "{}", stderr(&output));
}

/// YCB-Video's frame of a real camera: depth in tenths of a millimetre, models in millimetres, objects that hide each other.
#[test]
fn objects_of_a_real_frame_are_found() {
    let set = root().join("../shared/data/ycbv-real-frame");
    if !set.exists() {
        println!("SKIPPED: {} is not there", set.display());
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut adds_mm = Vec::new();
    for seed in ["1", "2", "3"] {
        let out = folder.path().join("results.csv");
        let args = ["estimate", set.to_str().unwrap(), "--boxes", "gt", "--seed", seed, "--out"];
        let output = grip(&[&args[..], &[out.to_str().unwrap()]].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let errors = folder.path().join("errors.csv");
        let json = eval(&set, &out, &["--errors", errors.to_str().unwrap()]);
        println!("seed {seed}: {}", json["all"]);
        let area = json["all"]["auc_adds"][0].as_f64().unwrap();
        assert!(area >= 0.88, "seed {seed}: {area}");
        let text = std::fs::read_to_string(&errors).unwrap();
        let column = text.lines().next().unwrap().split(',').position(|name| name == "adds_mm").unwrap();
        adds_mm.extend(
            text.lines().skip(1).map(|line| line.split(',').nth(column).unwrap().parse::<f64>().unwrap()),
        );
        std::fs::remove_file(&out).unwrap();
    }
    assert_eq!(adds_mm.len(), 15);
    let near = adds_mm.iter().filter(|&&error| error < 10.0).count();
    assert!(near >= 14, "{near} of 15 within a centimetre: {adds_mm:?}");
}

#[test]
fn of_two_of_a_kind_both_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let (set, results) = (folder.path().join("set"), folder.path().join("r.csv"));
    let set_name = set.to_str().unwrap();
    let scenes =
        ["scenes", "scenes/pairs.toml", "--scenes", "1", "--views", "B", "--seed", "5", "--out", set_name];
    let output = grip(&scenes);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let targets = std::fs::read_to_string(set.join("test_targets_bop19.json")).unwrap();
    let targets: serde_json::Value = serde_json::from_str(&targets).unwrap();
    let counts: Vec<u64> =
        targets.as_array().unwrap().iter().map(|t| t["inst_count"].as_u64().unwrap()).collect();
    assert_eq!(counts.iter().sum::<u64>(), 6);
    assert_eq!(counts.iter().filter(|count| **count == 2).count(), 2);

    let output = grip(&["estimate", set_name, "--boxes", "gt", "--out", results.to_str().unwrap()]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(poses(&results).len(), 7);
    let figures = eval(&set, &results, &[]);
    assert_eq!(figures["all"]["instances"], 6);
    assert!(figures["all"]["found"].as_f64().unwrap() > 0.99, "{figures}");
    common::python("check_bop.py", "numpy, PIL", &[&set]);
}

/// Truth that is withheld is not truth without objects.
#[test]
fn a_split_without_truth_is_estimated_but_neither_scored_nor_looked_at_for_boxes() {
    let folder = tempfile::tempdir().unwrap();
    let set = data_set(folder.path());
    let (set_name, results) = (set.to_str().unwrap(), folder.path().join("r.csv"));
    std::fs::write(&results, truth(&set, 0.0)).unwrap();
    for file in ["scene_gt.json", "scene_gt_info.json"] {
        std::fs::remove_file(set.join("test/000001").join(file)).unwrap();
    }
    let out = folder.path().join("e.csv");
    for boxes in ["gt", "jittered"] {
        let output = grip(&["estimate", set_name, "--boxes", boxes, "--out", out.to_str().unwrap()]);
        assert_eq!(code(&output), 2);
        assert!(stderr(&output).contains("scene_gt.json: is missing"), "{}", stderr(&output));
        assert!(!out.exists());
    }
    let output = grip(&["estimate", set_name, "--boxes", "clusters", "--out", out.to_str().unwrap()]);
    assert_eq!(code(&output), 0, "the targets say what to look for: {}", stderr(&output));
    for results in [&out, &results] {
        let output = grip(&["eval", set_name, results.to_str().unwrap()]);
        assert_eq!(code(&output), 2, "{}", stdout(&output));
        assert!(stderr(&output).contains("server alone"), "{}", stderr(&output));
        assert_eq!(stdout(&output), "");
    }
    // Nor does anything say what there is to look for without targets.
    std::fs::remove_file(set.join("test_targets_bop19.json")).unwrap();
    let output = grip(&["estimate", set_name, "--boxes", "none", "--out", out.to_str().unwrap()]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("scene_gt.json: is missing"), "{}", stderr(&output));
}

/// Images that were not downloaded tell nothing about absent objects.
#[test]
fn estimates_of_images_that_the_set_has_not_do_not_count() {
    let folder = tempfile::tempdir().unwrap();
    let set = data_set(folder.path());
    let (alone, more) = (folder.path().join("alone.csv"), folder.path().join("more.csv"));
    let lines = truth(&set, 1.0);
    std::fs::write(&alone, &lines).unwrap();
    // The same of image 7, and of scene 3.
    let (header, rows) = lines.split_once('\n').unwrap();
    let elsewhere = |from: &str, to: &str| -> String {
        rows.lines().filter_map(|row| Some(format!("{to}{}\n", row.strip_prefix(from)?))).collect()
    };
    let added = [elsewhere("1,0,", "1,7,"), elsewhere("1,0,", "3,0,")].concat();
    std::fs::write(&more, format!("{header}\n{rows}{added}")).unwrap();
    let (a, b) = (eval(&set, &alone, &[]), eval(&set, &more, &[]));
    assert_eq!(a["ignored"], 0);
    assert_eq!(b["ignored"], added.lines().count());
    for figures in ["all", "conditions", "presence"] {
        assert!(a[figures] == b[figures], "{figures} differ");
    }
}

/// Targets of 2024 name images and no objects.
#[test]
fn what_the_targets_of_2024_name_is_what_counts() {
    let folder = tempfile::tempdir().unwrap();
    let set = data_set(folder.path());
    std::fs::remove_file(set.join("test_targets_bop19.json")).unwrap();
    let results = folder.path().join("r.csv");
    // Estimates of the second image alone.
    let lines: String =
        truth(&set, 1.0).split_inclusive('\n').filter(|line| !line.starts_with("1,0,")).collect();
    std::fs::write(&results, lines).unwrap();
    let all = eval(&set, &results, &[]);
    std::fs::write(set.join("test_targets_bop24.json"), r#"[{"scene_id": 1, "im_id": 1}]"#).unwrap();
    let of_image = eval(&set, &results, &[]);
    assert!(all["all"]["found"].as_f64().unwrap() < 0.6, "{all}");
    assert_eq!(of_image["all"]["found"], 1.0);
    assert_eq!(of_image["all"]["instances"], of_image["all"]["estimated"]);
}
