//! Trials of all units: trials.jsonl, timings.jsonl, left_out.jsonl, items.parquet, films.

use std::collections::BTreeSet;
use std::fs::File;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use serde::de::DeserializeOwned;

use super::{Output, Sink, copy, lines};
use crate::campaign::manifest::{Arm, Unit};
use crate::campaign::unit::DoneFile;
use crate::experiment::items;
use crate::experiment::merge::files_in;
use crate::experiment::plan::{FILMS, Key, LEFT_OUT, TIMINGS, TRIALS};
use crate::experiment::trials::{LeftOut, TimingLine};
use crate::score::outcome::TrialResult;

pub(super) struct Trials {
    /// In the order of results.
    arms: Vec<Arm>,
    trials: Output,
    timings: Output,
    left_out: Output,
    items: items::Writer<File>,
    out: PathBuf,
}

impl Trials {
    pub(super) fn begin(arms: &[Arm], out: &Path) -> Result<Self> {
        let mut arms = arms.to_vec();
        arms.sort_unstable();
        let films = out.join(FILMS);
        std::fs::create_dir(&films).with_context(|| format!("{}: cannot be made", films.display()))?;
        let items = out.join(items::FILE);
        let items =
            File::create(&items).with_context(|| format!("{}: cannot be written", items.display()))?;
        Ok(Self {
            arms,
            trials: Output::create(out.join(TRIALS))?,
            timings: Output::create(out.join(TIMINGS))?,
            left_out: Output::create(out.join(LEFT_OUT))?,
            items: items::Writer::new(items)?,
            out: out.to_path_buf(),
        })
    }
}

impl Sink for Trials {
    fn add(&mut self, unit: &Unit, done: &DoneFile, folder: &Path) -> Result<()> {
        let mut expected = (unit.first..unit.first + unit.items)
            .flat_map(|seed| self.arms.iter().map(move |arm| arm.key(seed)));
        // Of few trials of a unit, if any.
        let mut left_out = BTreeSet::new();
        let path = folder.join(LEFT_OUT);
        for line in lines(&path)? {
            let line = line?;
            let LeftOut { key, .. } = parse(&line, &path)?;
            ensure!(left_out.insert(key.clone()), "{}: {key:?} is there twice", path.display());
            self.left_out.line(&line)?;
        }
        ensure!(
            left_out.len() as u64 == done.left_out,
            "{}: {} lines, not {}",
            path.display(),
            left_out.len(),
            done.left_out
        );
        let path = folder.join(TRIALS);
        let mut results = 0;
        for line in lines(&path)? {
            let line = line?;
            let trial: TrialResult = parse(&line, &path)?;
            let key = Key::of(&trial);
            let next = expected.find(|key| !left_out.remove(key));
            if next.as_ref() != Some(&key) {
                bail!("{}: {key:?} where there should be {next:?}", path.display());
            }
            let film = folder.join(key.film());
            if film.is_file() {
                copy(&film, &self.out.join(key.film()))?;
            }
            let record = key.record();
            for (name, path) in files_in(&folder.join(&record))? {
                copy(&path, &self.out.join(&record).join(name))?;
            }
            self.trials.line(&line)?;
            self.items.add(trial)?;
            results += 1;
        }
        ensure!(results == done.results, "{}: {results} lines, not {}", path.display(), done.results);
        if let Some(key) = expected.find(|key| !left_out.remove(key)) {
            bail!("{}: {key:?} is not there", path.display());
        }
        if let Some(key) = left_out.first() {
            bail!("{}: {key:?} is no trial of this unit, or has a result", folder.join(LEFT_OUT).display());
        }
        let path = folder.join(TIMINGS);
        for line in lines(&path)? {
            let line = line?;
            let TimingLine { key, .. } = parse(&line, &path)?;
            ensure!(
                (unit.first..unit.first + unit.items).contains(&key.seed),
                "{}: {key:?} is no trial of this unit",
                path.display()
            );
            self.timings.line(&line)?;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.trials.finish()?;
        self.timings.finish()?;
        self.left_out.finish()?;
        self.items.finish()?.sync_all().with_context(|| format!("{}: cannot be written", items::FILE))
    }
}

pub(super) fn parse<T: DeserializeOwned>(line: &str, path: &Path) -> Result<T> {
    serde_json::from_str(line).with_context(|| format!("{}: a line is damaged", path.display()))
}
