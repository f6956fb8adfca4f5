//! The machine that runs a unit: its processor, and what the canary says, so that a cluster of unlike machines is seen.

use std::path::Path;
use std::time::UNIX_EPOCH;

use anyhow::{Context, Result};
use grip_sim::bop;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::{Campaign, canary};
use crate::experiment::plan;

/// The folder of what is known of machines, in a campaign's.
pub const NODES: &str = "nodes";

/// A machine.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Node {
    /// Its name, as it says; in a container the container's.
    pub host: String,
    /// Model of its processor.
    pub cpu: String,
    /// SHA-256 of what the canary comes to there, by the program that ran the unit.
    pub canary: String,
    /// SHA-256 of that program's file.
    pub build_sha256: Option<String>,
}

/// This machine, by this program. What takes seconds is written down in the campaign's folder, once a machine and program.
///
/// # Errors
/// When the canary fails, or the folder cannot be written.
pub fn this(campaign: &Campaign) -> Result<Node> {
    let (host, cpu) = (host(), cpu());
    let folder = campaign.folder.join(NODES);
    let path = folder.join(format!("{}.json", key(&cpu)));
    if let Some(known) = read(&path) {
        if let Some(build) = &known.build_sha256 {
            plan::know_build(build.clone());
        }
        return Ok(Node { host, ..known });
    }
    let node = Node { host, cpu, canary: canary::hash()?, build_sha256: plan::build() };
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("{}: cannot be made; check permissions", folder.display()))?;
    bop::write_atomic(&path, (serde_json::to_string_pretty(&node)? + "\n").as_bytes())?;
    Ok(node)
}

fn read(path: &Path) -> Option<Node> {
    serde_json::from_slice(&std::fs::read(path).ok()?).ok()
}

/// What tells this machine, as it was started, and this program from others: containers on one machine share what one of them found.
fn key(cpu: &str) -> String {
    let boot = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_else(|_| host());
    let program = plan::program_file().and_then(|path| {
        let about = std::fs::metadata(&path).ok()?;
        let changed = about.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
        Some((path, about.len(), changed))
    });
    format!("{:x}", Sha256::digest(format!("{boot} {cpu} {program:?}")))[..16].to_owned()
}

fn host() -> String {
    let said = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let name = said.or_else(|| std::env::var("HOSTNAME").ok()).unwrap_or_default();
    if name.trim().is_empty() { "unknown".into() } else { name.trim().to_owned() }
}

/// As the system calls it; where it does not, the architecture.
pub(crate) fn cpu() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    model(&text).unwrap_or_else(|| std::env::consts::ARCH.to_owned())
}

/// The model in Linux' /proc/cpuinfo; ARM's kernels give numbers alone.
fn model(text: &str) -> Option<String> {
    let field = |name: &str| {
        let line = text.lines().find(|line| line.split(':').next().is_some_and(|key| key.trim() == name))?;
        Some(line.split_once(':')?.1.trim().to_owned()).filter(|value| !value.is_empty())
    };
    field("model name").or_else(|| {
        Some(format!(
            "{} implementer {} part {}",
            std::env::consts::ARCH,
            field("CPU implementer")?,
            field("CPU part")?
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn processors_are_named_as_linux_names_them() {
        let intel =
            "processor\t: 0\nmodel\t\t: 85\nmodel name\t: Some Processor @ 2 GHz\nmodel name\t: other\n";
        assert_eq!(model(intel).as_deref(), Some("Some Processor @ 2 GHz"));
        let arm = "processor\t: 0\nCPU implementer\t: 0x41\nCPU part\t: 0xd0c\n";
        assert!(model(arm).unwrap().ends_with("implementer 0x41 part 0xd0c"));
        assert_eq!(model(""), None);
        assert!(!cpu().is_empty() && !host().is_empty());
    }
}
