//! What the program writes, and what it ships, is what the schemas in `docs/schemas` say.

use std::path::{Path, PathBuf};

use crate::common::{self, code, edited_scene, grip, root, stderr, stdout};
use crate::plan::{REQUEST, problem};

/// A tour of everything that writes a file or prints JSON, in one folder.
struct Tour {
    folder: PathBuf,
    files: Vec<String>,
}

impl Tour {
    /// A file and the schema it must keep to.
    fn has(&mut self, schema: &str, file: &Path) {
        assert!(file.is_file(), "{}", file.display());
        self.files.push(format!("{schema}={}", file.display()));
    }

    fn path(&self, name: &str) -> String {
        self.folder.join(name).to_str().unwrap().to_owned()
    }

    /// Runs a command, which must do its work; not all of a trial's objects need to be packed.
    fn run(&self, args: &[&str]) -> String {
        let output = grip(args);
        assert!(code(&output) < 2, "{args:?}: {}", stderr(&output));
        stdout(&output)
    }

    /// What a command prints with `--json`.
    fn prints(&mut self, schema: &str, args: &[&str]) {
        let text = self.run(&[args, &["--json"]].concat());
        let file = self.folder.join(format!("{schema}-printed.json"));
        std::fs::write(&file, text).unwrap();
        self.has(schema, &file);
    }
}

#[test]
fn files_keep_to_their_schemas() {
    let folder = tempfile::tempdir().unwrap();
    let mut tour = Tour { folder: folder.path().to_owned(), files: Vec::new() };

    for scene in ["adversarial", "bag", "crate", "grocery", "tote"] {
        tour.has("scene", &root().join(format!("scenes/{scene}.toml")));
    }
    for condition in std::fs::read_dir(root().join("scenes/conditions")).unwrap() {
        tour.has("condition", &condition.unwrap().path());
    }
    tour.has("object-table", &root().join("scenes/objects.toml"));
    tour.has("robot-config", &root().join("robots/fetch/fetch.toml"));
    let settings = folder.path().join("settings.toml");
    std::fs::write(&settings, tour.run(&["settings"])).unwrap();
    tour.has("settings", &settings);
    tour.has("detector", &root().join("perception/models/pyramid-varied.json"));

    tour.prints("objects", &["objects"]);
    let (mesh, own) = (root().join("robots/fetch/meshes/gripper_palm.obj"), tour.path("own.toml"));
    let mesh = mesh.to_str().unwrap();
    tour.prints("object-report", &["objects", "add", mesh, "--table", &own, "--density", "1200"]);
    tour.has("object-table", Path::new(&own));
    tour.prints("robot", &["robot"]);
    let grasps = tour.path("grasps");
    tour.run(&["grasps", "005_tomato_soup_can", "--out", &grasps]);
    tour.has("grasps", &Path::new(&grasps).join("005_tomato_soup_can.json"));
    let shot = tour.path("shot");
    tour.run(&["render", "--renderer", "cpu", "--out", &shot]);
    tour.has("camera", &Path::new(&shot).join("camera.json"));

    // A trial, an experiment with one, a sweep of two grasps.
    let pack = tour.path("pack");
    tour.run(&["pack", "--estimator", "truth", "--renderer", "cpu", "--out", &pack]);
    tour.has("trial", &Path::new(&pack).join("result.json"));
    tour.has("record", &Path::new(&pack).join("record/record.json"));
    tour.has("record-event", &Path::new(&pack).join("record/events.jsonl"));
    tour.has("scenario", &Path::new(&pack).join("scenario.json"));
    // What an estimator of others is told and says, overheard.
    if common::has_python() {
        let [told, said] = ["told.jsonl", "said.jsonl"].map(|name| tour.path(name));
        let template = root().join("examples/estimators/template.py");
        let command = format!("cmd:sh -c 'tee {told} | python3 {} | tee {said}'", template.display());
        let more = ["--estimator", &command, "--renderer", "cpu", "--out", &tour.path("asked")];
        tour.run(&[&["pack"], &more[..]].concat());
        tour.has("estimator-request", Path::new(&told));
        tour.has("estimator-reply", Path::new(&said));
        let [told, said] = ["asked.jsonl", "gripped.jsonl"].map(|name| tour.path(name));
        let template = root().join("examples/graspers/template.py");
        let command = format!("cmd:sh -c 'tee {told} | python3 {} | tee {said}'", template.display());
        let more =
            ["--estimator", "truth", "--grasper", &command, "--renderer", "cpu", "--out", &tour.path("held")];
        tour.run(&[&["pack", "--items", "1"], &more[..]].concat());
        tour.has("grasper-request", Path::new(&told));
        tour.has("grasper-reply", Path::new(&said));
    }
    // In base light there is no room for its objects, and the trial is left out.
    let scene =
        edited_scene(&tour.folder, |text| text.replace("\nsize = [0.30, 0.42]", "\nsize = [0.15, 0.20]"));
    let trials = tour.path("trials");
    let args =
        ["trials", "--scene", scene.to_str().unwrap(), "--trials", "1", "--seed", "5", "--out", &trials];
    let args = [&args[..], &["--conditions", "base,clutter-1", "--estimators", "truth"]].concat();
    tour.prints("experiment-summary", &args);
    for (schema, file) in [
        ("experiment", "experiment.json"),
        ("trial", "trials.jsonl"),
        ("experiment-timing", "timings.jsonl"),
        ("experiment-left-out", "left_out.jsonl"),
    ] {
        tour.has(schema, &Path::new(&trials).join(file));
    }
    let sweep = tour.path("sweep");
    let few = ["--mode", "isotropic", "--samples", "2", "--seeds", "1"];
    let args = [&["sweep", "036_wood_block", "--out", &sweep], &few[..]].concat();
    tour.prints("sweep-summary", &args);
    tour.has("sweep", &Path::new(&sweep).join("sweep.json"));
    tour.has("sweep-grasp", &Path::new(&sweep).join("grasps.jsonl"));

    // A campaign of two units, one of which cannot be done.
    let (file, campaign) = (tour.folder.join("campaign.toml"), tour.path("campaign"));
    let few = "names = [\"036_wood_block\"]\nmode = \"isotropic\"\nsamples = 2\nseeds = 2\n";
    std::fs::write(&file, format!("[campaign]\nname = \"tour\"\nunits = 2\n[sweep]\n{few}")).unwrap();
    tour.has("campaign-file", &file);
    tour.run(&["campaign", "plan", file.to_str().unwrap(), "--out", &campaign]);
    tour.has("campaign", &Path::new(&campaign).join("campaign.json"));
    let unit = |number: usize| Path::new(&campaign).join(format!("units/{number:06}"));
    std::fs::create_dir_all(unit(1).join("grasps.jsonl")).unwrap();
    tour.run(&["campaign", "run", &campaign, "--shard", "1/1"]);
    tour.has("campaign-unit", &unit(0).join("done.json"));
    // It goes when the unit is done after all.
    let failed = tour.folder.join("failed.json");
    std::fs::copy(unit(1).join("failed.json"), &failed).unwrap();
    tour.has("campaign-failed", &failed);
    tour.prints("campaign-status", &["campaign", "status", &campaign]);
    std::fs::remove_dir(unit(1).join("grasps.jsonl")).unwrap();
    tour.run(&["campaign", "run", &campaign, "--shard", "1/1", "--again"]);
    tour.prints("campaign-merge", &["campaign", "merge", &campaign, "--out", &tour.path("merged")]);

    problem(&tour.folder, "0001", [0.75, 0.0], REQUEST);
    let problems = tour.folder.to_str().unwrap().to_owned();
    let planned = tour.path("planned");
    tour.prints("plan", &["plan", &problems, "--out", &planned]);
    tour.has("plan", &Path::new(&planned).join("plan.json"));
    let of_set = Path::new(&planned).join(tour.folder.file_name().unwrap());
    tour.has("trajectory", &of_set.join("0001.json"));

    // A data set and what is made of it.
    let set = tour.path("set");
    tour.prints(
        "scenes",
        &["scenes", "--scenes", "1", "--views", "B=base", "--renderer", "cpu", "--out", &set],
    );
    let (set_path, scene) = (PathBuf::from(&set), Path::new(&set).join("test/000001"));
    for (schema, file) in [
        ("dataset", set_path.join("dataset.json")),
        ("bop-camera", set_path.join("camera.json")),
        ("bop-targets", set_path.join("test_targets_bop19.json")),
        ("bop-models-info", set_path.join("models/models_info.json")),
        ("bop-models-info", set_path.join("models_eval/models_info.json")),
        ("coco", set_path.join("coco.json")),
        ("coco", scene.join("scene_gt_coco.json")),
        ("dataset-scene", scene.join("scene_info.json")),
        ("bop-scene-camera", scene.join("scene_camera.json")),
        ("bop-scene-gt", scene.join("scene_gt.json")),
        ("bop-scene-gt-info", scene.join("scene_gt_info.json")),
    ] {
        tour.has(schema, &file);
    }
    let boxes = tour.path("boxes.json");
    tour.prints("detect", &["detect", &set, "--out", &boxes]);
    tour.has("boxes", Path::new(&boxes));
    let picture = scene.join("rgb/000000.png");
    tour.prints("detect-image", &["detect", picture.to_str().unwrap()]);
    let results = tour.path("grip_set-test.csv");
    let posteriors = tour.path("posteriors.jsonl");
    let beside = ["--posteriors", &posteriors];
    tour.prints(
        "estimate",
        &[&["estimate", &set, "--boxes", &boxes, "--out", &results], &beside[..]].concat(),
    );
    tour.has("posteriors", Path::new(&posteriors));
    tour.prints("eval", &[&["eval", &set, &results], &beside[..]].concat());
    let explained = tour.path("explained.png");
    let image = ["--scene", "1", "--image", "0", "--truth", "--out", &explained];
    tour.prints("explain", &[&["explain", &set, &results], &image[..]].concat());
    let figure = tour.path("convergence.svg");
    let search = ["--scene", "1", "--image", "0", "--seeds", "1", "--boxes", "gt", "--out", &figure];
    tour.prints("convergence", &[&["convergence", &set], &search[..]].concat());
    let table = ["--scenes", "1", "--methods", "grip", "--out", &tour.path("table1")];
    tour.prints("table1", &[&["reproduce", "table1"], &table[..]].concat());

    let given: Vec<&Path> = tour.files.iter().map(Path::new).collect();
    common::python("check_schemas.py", "jsonschema", &given);
}
