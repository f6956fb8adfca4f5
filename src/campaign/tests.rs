//! Units that do wrong, and campaigns that were spoilt.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::manifest::{self, Campaign, Job, Manifest, Unit};
use super::merge;
use super::node::Node;
use super::unit::{Busy, DONE, Outcome, Ran, Work, failed, lock, passes, run as run_unit};
use crate::experiment::sweep::GRASPS;
use crate::progress::{Progress, Quiet};
use anyhow::{Context, Result, anyhow};
use serde_json::{Map, Value, json};

/// Grasps of two objects with two errors, a unit a seed; of seed 12 one object has no layout.
fn campaign(folder: &Path) -> Campaign {
    let manifest = Manifest {
        schema: manifest::SCHEMA.into(),
        name: "test".into(),
        program: Value::Null,
        build_sha256: None,
        work: Job::Sweep { objects: vec!["a".into(), "b".into()], cases: 2 },
        options: Map::new(),
        base: "..".into(),
        inputs: Vec::new(),
        shared: Vec::new(),
        units: (10..13).map(|first| Unit { first, items: 1, images: None }).collect(),
    };
    Campaign::begin(&folder.join("campaign"), manifest, |shared| Ok(std::fs::create_dir(shared)?)).unwrap()
}

fn node() -> Node {
    Node { host: "h".into(), cpu: "c".into(), canary: "0".into(), build_sha256: None }
}

fn line(object: &str, seed: u64, case: usize) -> String {
    let line = json!({
        "object": object, "seed": seed, "case": case, "axis": null, "translation": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0],
        "add_m": 0.0, "adds_m": 0.0, "outcome": "held", "opposing_contacts": true, "lifted_clear": true,
        "held_after_shake": true, "slip_within": true, "slip_m": 0.0, "slip_deg": 0.0,
    });
    line.to_string() + "\n"
}

/// Does what a unit's work does, or what goes wrong with it.
struct Fake<F: Fn() -> Result<()>>(F);

impl<F: Fn() -> Result<()>> Work for Fake<F> {
    fn check(&self, _: &Unit) -> Result<()> {
        Ok(())
    }

    fn run(&self, unit: &Unit, folder: &Path, _: usize, _: &dyn Progress) -> Result<Ran> {
        (self.0)()?;
        let seed = unit.first;
        let mut text = line("a", seed, 0) + &line("a", seed, 1);
        if seed != 12 {
            text += &(line("b", seed, 0) + &line("b", seed, 1));
        }
        let results = text.lines().count() as u64;
        std::fs::write(folder.join(GRASPS), text)?;
        Ok(Ran { results, left_out: 4 - results, kept: 0 })
    }
}

fn run(campaign: &Campaign, unit: usize, work: impl Fn() -> Result<()>) -> Result<Outcome> {
    run_unit(campaign, unit, &Fake(work), &node(), 1, &Quiet)
}

fn whole(folder: &Path) -> Campaign {
    let campaign = campaign(folder);
    (0..3).for_each(|unit| assert!(matches!(run(&campaign, unit, || Ok(())), Ok(Outcome::Done(_)))));
    campaign
}

#[test]
fn what_goes_wrong_is_kept_unless_it_passes() {
    let folder = tempfile::tempdir().unwrap();
    let campaign = campaign(folder.path());
    let full = || Err(io::Error::from(io::ErrorKind::StorageFull)).context("cannot be written");
    let error = run(&campaign, 0, full).unwrap_err();
    assert!(passes(&error) && failed(&campaign, 0).is_none(), "{error:#}");
    for (wrong, words) in [(false, "no hand: odd"), (true, "panicked: as asked")] {
        let outcome = run(&campaign, 0, || {
            assert!(!wrong, "as asked");
            Err(anyhow!("odd").context("no hand"))
        });
        let Ok(Outcome::Failed(reason)) = outcome else { panic!("{outcome:?}") };
        assert!(reason.contains(words), "{reason}");
        assert_eq!(failed(&campaign, 0).unwrap().reason, reason);
    }
    // Run again it is done, and nothing says that it has failed; and then it is done once and for all.
    assert!(matches!(run(&campaign, 0, || Ok(())), Ok(Outcome::Done(_))));
    assert!(failed(&campaign, 0).is_none());
    assert_eq!(run(&campaign, 0, || panic!("is not run")).unwrap(), Outcome::WasDone);
}

#[test]
fn one_process_runs_a_unit() {
    let folder = tempfile::tempdir().unwrap();
    let wait = Duration::from_millis(60);
    let held = lock(wait, folder.path()).unwrap();
    let error = lock(wait, folder.path()).unwrap_err();
    assert!(passes(&error) && error.is::<Busy>(), "{error:#}");
    drop(held);
    lock(wait, folder.path()).unwrap();
    let strange = [anyhow!("odd"), io::Error::from(io::ErrorKind::NotFound).into()];
    assert!(!strange.iter().any(passes));
}

fn merged(campaign: &Campaign, out: &Path) -> Result<merge::Merged> {
    merge::merge(campaign, out, &Quiet)
}

#[test]
fn units_become_one_sweep_by_object() {
    let folder = tempfile::tempdir().unwrap();
    let (campaign, out) = (whole(folder.path()), folder.path().join("out"));
    let merged = merged(&campaign, &out).unwrap();
    assert_eq!((merged.units, merged.results, merged.left_out), (3, 10, 2));
    let all: String = [("a", 10..13), ("b", 10..12)]
        .into_iter()
        .flat_map(|(object, seeds)| seeds.flat_map(move |seed| [0, 1].map(|case| line(object, seed, case))))
        .collect();
    assert_eq!(std::fs::read_to_string(out.join(GRASPS)).unwrap(), all);
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), 1, "nothing is left behind");
}

/// The folder of a unit.
type At<'a> = &'a dyn Fn(usize) -> PathBuf;

/// What is missing, changed, moved or there twice is found, and nothing is written.
#[test]
fn a_merge_proves_that_each_unit_is_there_once() {
    let spoil = |spoil: &dyn Fn(At<'_>), words: &str| {
        let folder = tempfile::tempdir().unwrap();
        let (campaign, out) = (whole(folder.path()), folder.path().join("out"));
        spoil(&|unit| campaign.unit_folder(unit));
        let error = format!("{:#}", merged(&campaign, &out).unwrap_err());
        assert!(error.contains(words), "{words}: {error}");
        assert!(!out.exists());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left behind");
    };
    let edit = |path: PathBuf, from: &str, to: &str| {
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains(from));
        std::fs::write(path, text.replacen(from, to, 1)).unwrap();
    };
    spoil(&|at| std::fs::remove_file(at(1).join(DONE)).unwrap(), "1 of 3 units are not done: 1");
    spoil(&|at| std::fs::remove_dir_all(at(2)).unwrap(), "not done: 2");
    spoil(&|at| edit(at(0).join(GRASPS), "held", "lost"), "is not what it was");
    spoil(&|at| std::fs::remove_file(at(0).join(GRASPS)).unwrap(), "cannot be read");
    spoil(&|at| std::fs::write(at(0).join("more.txt"), "x").unwrap(), "was not there");
    spoil(&|at| std::fs::create_dir(at(3)).unwrap(), "is no unit");
    spoil(&|at| std::fs::create_dir(at(0).with_file_name("000000-copy")).unwrap(), "is no unit");
    spoil(&|at| edit(at(0).join(DONE), "\"campaign\": \"", "\"campaign\": \"0"), "of another campaign");
    // A unit in the place of another.
    spoil(
        &|at| {
            std::fs::remove_dir_all(at(1)).unwrap();
            std::fs::rename(at(0), at(1)).unwrap();
        },
        "is of unit 0",
    );
    // One that says that it is another unit, hashes and all.
    spoil(
        &|at| {
            std::fs::copy(at(0).join(GRASPS), at(1).join(GRASPS)).unwrap();
            std::fs::copy(at(0).join(DONE), at(1).join(DONE)).unwrap();
            edit(at(1).join(DONE), "\"unit\": 0", "\"unit\": 1");
        },
        "is no grasp of this unit",
    );
}
