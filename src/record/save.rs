//! The folder of a recording.

use std::path::Path;

use anyhow::{Context, Result};
use grip_sim::camera::Intrinsics;
use grip_sim::unfinished::Unfinished;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::recorder::{Event, Recorder};
use super::rows::{Attempt, Estimate, Look, Plan, Rest, Row, Step};
use super::{Level, mcap, replay};
use crate::experiment::items;
use crate::pictures;
use crate::score::outcome::TrialResult;
use crate::table::{self, Column, Columns};

/// The animated scene's file.
pub const REPLAY: &str = "replay.glb";
/// Version of a recording; changes with every change that could break a reader.
pub const SCHEMA: &str = "grip.record/1";

/// record.json: what was recorded, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RecordFile {
    /// [`SCHEMA`].
    pub schema: String,
    /// `events` or `full`.
    pub level: String,
    /// Samples a simulated second.
    pub rate_hz: f64,
    /// SHA-256 of all that the trial depends on.
    pub scenario: String,
    /// The trial's seed.
    pub seed: u64,
    /// Its scene.
    pub scene: String,
    /// Its condition.
    pub condition: String,
    /// Who estimated.
    pub estimator: String,
    /// Who planned grasps.
    pub grasper: String,
    /// The robot's movable joints, in the order of the tables' columns.
    pub joints: Vec<String>,
    /// The objects of the world: name, and which of several of that name.
    pub objects: Vec<(String, i64)>,
    /// Of the camera that looked.
    pub intrinsics: Intrinsics,
}

/// What was recorded of a trial.
#[derive(Debug)]
pub struct Recording {
    recorder: Recorder,
    result: TrialResult,
    intrinsics: Intrinsics,
    replay: Option<Vec<u8>>,
}

impl Recording {
    /// Of a trial that has ended with this result.
    ///
    /// # Errors
    /// When the animated scene cannot be encoded.
    pub fn new(recorder: Recorder, result: &TrialResult, intrinsics: Intrinsics) -> Result<Self> {
        let replay = recorder.drawn.as_ref().map(|drawn| replay::glb(&recorder, drawn)).transpose()?;
        Ok(Self { recorder, result: TrialResult { timing: None, ..result.clone() }, intrinsics, replay })
    }

    /// The trial as an animated scene, glTF 2.0; at level `full` alone.
    pub fn replay(&self) -> Option<&[u8]> {
        self.replay.as_deref()
    }

    fn about(&self) -> RecordFile {
        let TrialResult { scenario, seed, scene, condition, estimator, grasper, .. } = &self.result;
        let level = if self.recorder.is_full() { "full" } else { "events" };
        RecordFile {
            schema: SCHEMA.to_owned(),
            level: level.to_owned(),
            rate_hz: self.recorder.options.rate_hz,
            scenario: scenario.clone(),
            seed: *seed,
            scene: scene.clone(),
            condition: condition.clone(),
            estimator: estimator.clone(),
            grasper: grasper.clone(),
            joints: self.recorder.joints.clone(),
            objects: self.recorder.objects.clone(),
            intrinsics: self.intrinsics,
        }
    }

    /// Its files: names, which may have folders, and contents.
    ///
    /// # Errors
    /// When one cannot be encoded.
    pub fn files(&self) -> Result<Vec<(String, Vec<u8>)>> {
        let recorder = &self.recorder;
        let mut files = vec![
            ("record.json".to_owned(), serde_json::to_vec_pretty(&self.about())?),
            ("events.jsonl".to_owned(), lines(&recorder.events)?),
        ];
        macro_rules! of_events {
            ($($kind:ident),+) => {$(
                let rows: Vec<_> = recorder.events.iter().filter_map(|event| match event {
                    Event::$kind(row) => Some($kind::clone(row)),
                    _ => None,
                }).collect();
                files.push(self.table(&rows, Columns::new())?);
            )+};
        }
        of_events!(Look, Estimate, Plan, Attempt, Step, Rest);
        files.push(("items.parquet".to_owned(), items::bytes(std::slice::from_ref(&self.result))?));
        files.push(self.table(&recorder.planned.0, self.joints(&recorder.planned.1))?);
        files.push(self.table(&recorder.samples.0, self.joints(&recorder.samples.1))?);
        files.push(self.table(&recorder.times, Columns::new())?);
        if recorder.is_full() {
            files.push(self.table(&recorder.moved, Columns::new())?);
            files.push(self.table(&recorder.contacts, Columns::new())?);
        }
        files.extend(self.replay.iter().map(|glb| (REPLAY.to_owned(), glb.clone())));
        for (i, picture) in recorder.pictures.iter().enumerate() {
            files.push((format!("looks/{i:02}_rgb.png"), pictures::rgb_png(&picture.rgb)?));
            files.push((format!("looks/{i:02}_depth.png"), pictures::depth_png_mm(&picture.depth)?));
        }
        Ok(files)
    }

    /// Writes the folder, whole or not at all, in place of one that is there.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let cannot = || format!("{}: cannot be written; check permissions and free space", folder.display());
        let files = self.files()?;
        if let Some(parent) = folder.parent() {
            std::fs::create_dir_all(parent).with_context(cannot)?;
        }
        let building = Unfinished::beside(folder).with_context(cannot)?;
        for (name, content) in files {
            let path = building.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap_or(building.path())).with_context(cannot)?;
            std::fs::write(path, content).with_context(cannot)?;
        }
        self.add_mcap(building.path())?;
        building.move_to(folder).with_context(cannot)
    }

    /// Adds the same as one file to the folder where all files are, if that is to be kept.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn add_mcap(&self, folder: &Path) -> Result<()> {
        if self.recorder.options.level < Level::Mcap {
            return Ok(());
        }
        mcap::write(folder, &folder.join(mcap::FILE))
    }

    /// A table with the trial before its own columns and `more` behind them.
    fn table<R: Row>(&self, rows: &[R], more: Columns) -> Result<(String, Vec<u8>)> {
        let TrialResult { seed, scene, condition, estimator, grasper, .. } = &self.result;
        // As text: not every reader has 64 bits without a sign.
        let key = [
            ("seed", seed.to_string()),
            ("scene", scene.clone()),
            ("condition", condition.clone()),
            ("estimator", estimator.clone()),
            ("grasper", grasper.clone()),
        ];
        let mut columns: Columns =
            key.map(|(name, value)| (name.to_owned(), Column::Text(vec![value; rows.len()]))).into();
        columns.extend(R::columns(rows));
        columns.extend(more);
        Ok((format!("{}.parquet", R::TABLE), table::bytes(R::TABLE, &columns)?))
    }

    /// A column a joint.
    fn joints(&self, rows: &[Vec<f32>]) -> Columns {
        let of = |k: usize| Column::Single(rows.iter().map(|row| row[k]).collect());
        let names = self.recorder.joints.iter().enumerate();
        names.map(|(k, name)| (format!("q_{name}"), of(k))).collect()
    }
}

fn lines(events: &[Event]) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    for event in events {
        serde_json::to_writer(&mut bytes, event)?;
        bytes.push(b'\n');
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::*;
    use crate::record::rows::{Contact, Moved, Planned, Sample, Time};

    /// Every table and column, in Markdown.
    fn columns_page() -> String {
        fn table<R: Row>(page: &mut String) {
            let _ = write!(
                page,
                "### {}.parquet\n\n{}\n\n| column | kind | what it is |\n|---|---|---|\n",
                R::TABLE,
                R::ABOUT.trim()
            );
            for field in R::fields() {
                let names: Vec<String> = field.columns.iter().map(|name| format!("`{name}`")).collect();
                let _ = writeln!(page, "| {} | {} | {} |", names.join(", "), field.kind, field.about.trim());
            }
            page.push('\n');
        }
        let mut page = String::new();
        table::<Look>(&mut page);
        table::<Estimate>(&mut page);
        table::<Plan>(&mut page);
        table::<Attempt>(&mut page);
        table::<Step>(&mut page);
        table::<Rest>(&mut page);
        table::<Planned>(&mut page);
        table::<Sample>(&mut page);
        table::<Time>(&mut page);
        table::<Moved>(&mut page);
        table::<Contact>(&mut page);
        page
    }

    /// docs/recordings.md, from here on made of the tables themselves; `GRIP_UPDATE_DOCS=1` writes that part anew.
    #[test]
    fn the_page_lists_every_column() {
        const FROM: &str = "## Columns\n\n";
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/recordings.md");
        let written = std::fs::read_to_string(&path).unwrap();
        let (by_hand, made) = written.split_once(FROM).unwrap();
        let (about, made) = made.split_once("\n\n").unwrap();
        let page = columns_page();
        if std::env::var_os("GRIP_UPDATE_DOCS").is_some() {
            std::fs::write(&path, format!("{by_hand}{FROM}{about}\n\n{}\n", page.trim_end())).unwrap();
            return;
        }
        assert_eq!(made.trim_end(), page.trim_end(), "GRIP_UPDATE_DOCS=1 writes docs/recordings.md anew");
        // No column without a meaning, and none twice in a table.
        for (table, fields) in
            [("plans", Plan::fields()), ("samples", Sample::fields()), ("estimates", Estimate::fields())]
        {
            let names: Vec<&String> = fields.iter().flat_map(|field| &field.columns).collect();
            let mut known = std::collections::BTreeSet::new();
            assert!(names.iter().all(|name| known.insert(*name)), "{table}: {names:?}");
            assert!(fields.iter().all(|field| field.about.len() > 3), "{table}");
        }
    }
}
