//! `grip campaign`: plan, run, status, merge.

mod merge;
mod plan;
mod run;
mod status;
mod work;

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use anyhow::{Context, Result};

use super::Done;
use crate::cli::{CampaignArgs, CampaignCommand};

/// Does what is asked for.
pub fn run(args: &CampaignArgs) -> Result<Done> {
    match &args.command {
        CampaignCommand::Plan(args) => plan::run(args),
        CampaignCommand::Run(args) => run::run(args),
        CampaignCommand::Status(args) => status::run(args),
        CampaignCommand::Merge(args) => merge::run(args),
    }
}

/// The process is in another folder while this lives: that of a campaign's file, from where its options are meant. A program that has
/// called a verb is back in its own afterwards. Of several threads one after the other is.
struct Within {
    before: Option<PathBuf>,
    _one: MutexGuard<'static, ()>,
}

static ONE: Mutex<()> = Mutex::new(());

impl Within {
    fn folder(folder: &Path) -> Result<Self> {
        let one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
        let before = std::env::current_dir().ok();
        std::env::set_current_dir(folder).with_context(|| {
            format!("{}: the folder of the campaign file cannot be reached", folder.display())
        })?;
        Ok(Self { before, _one: one })
    }
}

impl Drop for Within {
    fn drop(&mut self) {
        if let Some(before) = &self.before {
            let _ = std::env::set_current_dir(before);
        }
    }
}
