//! A recording as one MCAP file.

use std::path::Path;

use crate::common::{self, code, stderr};

#[test]
fn a_trial_is_recorded_as_mcap_and_converted_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let scene = common::small_scene(folder.path());
    let pack = |level: &str, out: &str| {
        let options = ["--estimator", "truth", "--renderer", "cpu", "--items", "1"];
        let args = [&["pack", &scene, "--record", level, "--out", out][..], &options].concat();
        let output = common::grip(&args);
        assert!(code(&output) < 2, "{}", stderr(&output));
    };
    let run = path("run");
    pack("mcap", &run);
    let record = folder.path().join("run/record");
    let made = std::fs::read(record.join("trial.mcap")).unwrap();
    let converted = folder.path().join("deep/other.mcap");
    let convert = |from: &str, to: &Path| common::grip(&["convert", from, "--out", to.to_str().unwrap()]);
    for from in [&run, record.to_str().unwrap()] {
        let output = convert(from, &converted);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        assert!(std::fs::read(&converted).unwrap() == made, "convert makes other bytes than --record mcap");
    }
    // But for the file itself the folder is that of level full.
    let about = std::fs::read_to_string(record.join("record.json")).unwrap();
    assert!(about.contains("\"level\": \"full\""), "{about}");
    common::python(
        "check_mcap.py",
        "mcap, mcap_protobuf, foxglove_schemas_protobuf, numpy, PIL, pyarrow, trimesh",
        &[&converted, &record],
    );

    // What cannot be converted is refused, and what is there stays.
    let refused = |from: &str, to: &Path, says: &[&str]| {
        let output = convert(from, to);
        assert_eq!(code(&output), 2);
        for word in says {
            assert!(stderr(&output).contains(word), "no {word} in {}", stderr(&output));
        }
    };
    let notes = folder.path().join("notes.txt");
    std::fs::write(&notes, "precious").unwrap();
    refused(&run, &notes, &["notes.txt", "no MCAP file"]);
    assert_eq!(std::fs::read_to_string(&notes).unwrap(), "precious");
    refused(&path("deep"), &converted, &["deep", "no recording", "--record full"]);
    let events = path("events");
    pack("events", &events);
    refused(&events, &converted, &["record.json", "level events", "--record full"]);
    let picture = record.join("looks/00_depth.png");
    let saved = std::fs::read(&picture).unwrap();
    std::fs::write(&picture, "no picture").unwrap();
    refused(&run, &converted, &["00_depth.png", "cannot be read as a picture"]);
    std::fs::write(&picture, saved).unwrap();
    let replay = record.join("replay.glb");
    let saved = std::fs::read(&replay).unwrap();
    std::fs::write(&replay, &saved[..saved.len() / 2]).unwrap();
    refused(&run, &converted, &["run", "replay.glb", "record it again"]);
    std::fs::write(&replay, saved).unwrap();
    std::fs::write(record.join("poses.parquet"), "no table").unwrap();
    refused(&run, &converted, &["poses.parquet", "damaged"]);
    std::fs::remove_file(record.join("poses.parquet")).unwrap();
    refused(&run, &converted, &["poses.parquet", "damaged"]);
    assert!(std::fs::read(&converted).unwrap() == made, "the earlier file stays");
}
