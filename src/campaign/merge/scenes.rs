//! Scenes of all units: one data set.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use super::{Sink, copy};
use crate::campaign::manifest::{Unit, names_below};
use crate::campaign::unit::DoneFile;
use crate::dataset;

pub(super) struct Scenes {
    out: PathBuf,
    split: String,
}

impl Scenes {
    pub(super) fn begin(split: &str, out: &Path) -> Result<Self> {
        Ok(Self { out: out.to_path_buf(), split: split.to_owned() })
    }
}

impl Sink for Scenes {
    fn add(&mut self, unit: &Unit, _: &DoneFile, folder: &Path) -> Result<()> {
        let names = names_below(folder)?;
        let of_scene = |number: u64| format!("{}/{number:06}/", self.split);
        for number in unit.first..unit.first + unit.items {
            let scene = of_scene(number);
            ensure!(
                names.iter().any(|name| name.starts_with(&scene)),
                "{}: is not there",
                folder.join(scene).display()
            );
        }
        for name in &names {
            let ours =
                (unit.first..unit.first + unit.items).any(|number| name.starts_with(&of_scene(number)));
            if !ours {
                ensure!(!name.contains('/'), "{}: is of no scene of this unit", folder.join(name).display());
                continue;
            }
            let (from, to) = (folder.join(name), self.out.join(name));
            if let Some(parent) = to.parent() {
                std::fs::create_dir_all(parent)
                    .with_context(|| format!("{}: cannot be made", parent.display()))?;
            }
            // The same file under another name where that is possible: a data set is large.
            if std::fs::hard_link(&from, &to).is_err() {
                copy(&from, &to)?;
            }
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        dataset::write_index(&self.split, &self.out)
    }
}
