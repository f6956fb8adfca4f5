//! `grip campaign plan`: from the file to the manifest.

use std::path::Path;

use anyhow::{Context, Result};

use super::Within;
use super::work::Opened;
use crate::campaign::file::CampaignFile;
use crate::campaign::manifest::{self, Campaign, Manifest, named_files, way};
use crate::cli::CampaignPlanArgs;
use crate::commands::{Done, output};
use crate::scenario::program;

/// Writes the campaign's folder.
pub fn run(args: &CampaignPlanArgs) -> Result<Done> {
    let file = CampaignFile::load(&args.file)?;
    let (verb, options) = file.work()?;
    let out = std::path::absolute(&args.out)?;
    let base = match args.file.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let base = base.canonicalize().with_context(|| base.display().to_string())?;
    let _within = Within::folder(&base)?;

    let which = || args.file.display().to_string();
    let work = Opened::open(verb, options, file.campaign.films).with_context(which)?;
    let units = work.units(&file.campaign).with_context(which)?;
    let mut inputs = named_files(options, &base)?;
    inputs.extend(work.inputs()?);
    // Where the folder will really be, so that the way from it is one of real folders.
    let real = |folder: &Path| -> Result<std::path::PathBuf> {
        let parent = folder.parent().context("--out: is no name of a folder")?;
        std::fs::create_dir_all(parent).with_context(|| format!("{}: cannot be made", parent.display()))?;
        Ok(parent.canonicalize()?.join(folder.file_name().context("--out: is no name of a folder")?))
    };
    let manifest = Manifest {
        schema: manifest::SCHEMA.into(),
        name: file.campaign.name.clone(),
        program: serde_json::to_value(program())?,
        build_sha256: crate::experiment::plan::build(),
        work: work.job(),
        options: options.clone(),
        base: way(&real(&out)?, &base).to_string_lossy().into_owned(),
        inputs,
        shared: Vec::new(),
        units,
    };
    let campaign = Campaign::begin(&out, manifest, |folder| work.share(folder))?;
    let Manifest { name, units, .. } = &campaign.manifest;
    if args.json {
        output::json(&campaign.manifest)?;
    } else {
        let items: u64 = units.iter().map(|unit| unit.items).sum();
        output::data(format_args!(
            "{name}: {} units of {items} items ({}): {}\nnext: grip campaign run {} --shard 1/1, or a task for each of the units 0-{} (docs/campaigns.md)",
            units.len(),
            verb.items(),
            args.out.display(),
            args.out.display(),
            units.len() - 1
        ))?;
    }
    Ok(Done::Fully)
}
