//! The physics of a few trials, to the bit: the hash of the final state, by seed, condition and estimator.
//!
//! A change that is meant to change results mints them anew: `GRIP_UPDATE_GOLDEN=1 cargo test --release golden`, and says so.

use std::collections::BTreeMap;

use crate::common::{code, grip, root, stderr};

/// Other processors may round some functions of the C library otherwise.
#[cfg(target_arch = "x86_64")]
#[test]
fn trials_end_in_the_state_that_they_ended_in_before() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("trials");
    let args = ["trials", "--trials", "1", "--seed", "9001", "--renderer", "cpu"];
    let cells = ["--conditions", "base,dark,clutter-2", "--estimators", "grip,truth", "--out"];
    let output = grip(&[&args[..], &cells, &[out.to_str().unwrap()]].concat());
    assert!(code(&output) < 2, "{}", stderr(&output));
    let lines = std::fs::read_to_string(out.join("trials.jsonl")).unwrap();
    let states: BTreeMap<String, String> = lines
        .lines()
        .map(|line| {
            let trial: serde_json::Value = serde_json::from_str(line).unwrap();
            let text = |field: &str| trial[field].as_str().unwrap().to_owned();
            let key = format!("{}, {}, {}", trial["seed"], text("condition"), text("estimator"));
            (key, text("state_hash"))
        })
        .collect();
    assert_eq!(states.len(), 6);
    let file = root().join("tests/golden/state_hashes.json");
    if std::env::var_os("GRIP_UPDATE_GOLDEN").is_some() {
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(&file, serde_json::to_string_pretty(&states).unwrap() + "\n").unwrap();
    }
    let golden: BTreeMap<String, String> =
        serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    assert_eq!(states, golden);
}
