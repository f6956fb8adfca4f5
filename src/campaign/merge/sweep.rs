//! Grasps of all units. A sweep lists them by object and units are cut by seed, so that each object's grasps are gathered in a file of
//! their own first.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use super::trials::parse;
use super::{Output, Sink, lines};
use crate::campaign::manifest::Unit;
use crate::campaign::unit::DoneFile;
use crate::experiment::sweep::{GRASPS, GraspLine};

pub(super) struct Sweep {
    out: PathBuf,
    cases: usize,
    /// By the object's name.
    gathered: BTreeMap<String, Output>,
}

impl Sweep {
    pub(super) fn begin(objects: &[String], cases: usize, out: &Path) -> Result<Self> {
        let gather = |(i, name): (usize, &String)| {
            Ok((name.clone(), Output::create(out.join(format!(".{i}.jsonl")))?))
        };
        let gathered = objects.iter().enumerate().map(gather).collect::<Result<_>>()?;
        Ok(Self { out: out.to_path_buf(), cases, gathered })
    }
}

impl Sink for Sweep {
    fn add(&mut self, unit: &Unit, done: &DoneFile, folder: &Path) -> Result<()> {
        let path = folder.join(GRASPS);
        let (mut last, mut results) = (None, 0);
        for line in lines(&path)? {
            let line = line?;
            let grasp: GraspLine = parse(&line, &path)?;
            let key = grasp.key();
            let ours = (unit.first..unit.first + unit.items).contains(&grasp.seed) && grasp.case < self.cases;
            let of_object = self.gathered.get_mut(&grasp.object).filter(|_| ours);
            let of_object =
                of_object.with_context(|| format!("{}: {key:?} is no grasp of this unit", path.display()))?;
            ensure!(
                last.is_none_or(|last| last < key),
                "{}: {key:?} is there twice, or out of order",
                path.display()
            );
            of_object.line(&line)?;
            last = Some(key);
            results += 1;
        }
        ensure!(results == done.results, "{}: {results} lines, not {}", path.display(), done.results);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        let mut all = Output::create(self.out.join(GRASPS))?;
        for (object, mut gathered) in self.gathered {
            gathered.file.flush().with_context(|| gathered.cannot())?;
            let path = gathered.path.clone();
            let mut from =
                std::fs::File::open(&path).with_context(|| format!("{}: cannot be read", path.display()))?;
            let copied = std::io::copy(&mut from, &mut all.file).with_context(|| all.cannot())?;
            if copied == 0 {
                log::warn!(
                    "{object}: no seed has a layout with a grasp to try; one run would end with this as an error"
                );
            }
            std::fs::remove_file(&path).with_context(|| path.display().to_string())?;
        }
        all.finish()
    }
}
