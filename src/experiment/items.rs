//! The items of all trials as one table, an item a row: items.parquet, for pandas, polars and DuckDB.

use std::io::Write;
use std::path::Path;

use anyhow::Result;
use grip_sim::bop;

use crate::score::outcome::{ItemResult, Outcome, TrialResult};
use crate::table::{self, Column, Columns};

/// The table's name in an experiment's folder.
pub const FILE: &str = "items.parquet";

/// Writes items.parquet into an experiment's folder.
///
/// # Errors
/// When it cannot be written.
pub fn write(trials: &[TrialResult], folder: &Path) -> Result<()> {
    Ok(bop::write_atomic(&folder.join(FILE), &bytes(trials)?)?)
}

/// The content of items.parquet.
///
/// # Errors
/// When it cannot be encoded.
pub fn bytes(trials: &[TrialResult]) -> Result<Vec<u8>> {
    let mut writer = Writer::new(Vec::new())?;
    trials.iter().try_for_each(|trial| writer.add(trial.clone()))?;
    writer.finish()
}

/// Rows that are held before they are written: as many and those of one more trial make a row group.
const GROUP: usize = 1 << 16;

/// Writes the table trial by trial. Its bytes depend on the trials and their order alone.
pub struct Writer<W: Write + Send> {
    table: table::Writer<W>,
    held: Vec<TrialResult>,
    rows: usize,
    /// Rows of a group.
    group: usize,
    empty: bool,
}

impl<W: Write + Send> Writer<W> {
    /// Begins a table.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn new(to: W) -> Result<Self> {
        Self::grouped(to, GROUP)
    }

    fn grouped(to: W, group: usize) -> Result<Self> {
        let table = table::Writer::new(to, "items", &columns(&[]))?;
        Ok(Self { table, held: Vec::new(), rows: 0, group, empty: true })
    }

    /// Adds the items of a trial.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn add(&mut self, trial: TrialResult) -> Result<()> {
        self.rows += trial.items.len();
        self.held.push(trial);
        if self.rows >= self.group {
            self.flush()?;
        }
        Ok(())
    }

    /// Ends the table, and gives back where it was written to.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn finish(mut self) -> Result<W> {
        if self.rows > 0 || self.empty {
            self.flush()?;
        }
        self.table.finish()
    }

    fn flush(&mut self) -> Result<()> {
        self.table.group(&columns(&self.held))?;
        self.held.clear();
        (self.rows, self.empty) = (0, false);
        Ok(())
    }
}

fn columns(trials: &[TrialResult]) -> Columns {
    let rows: Vec<(&TrialResult, &ItemResult)> =
        trials.iter().flat_map(|trial| trial.items.iter().map(move |item| (trial, item))).collect();
    let text = |of: fn(&TrialResult, &ItemResult) -> String| {
        Column::Text(rows.iter().map(|(trial, item)| of(trial, item)).collect())
    };
    let whole = |of: fn(&TrialResult, &ItemResult) -> i64| {
        Column::Whole(rows.iter().map(|(trial, item)| of(trial, item)).collect())
    };
    let number =
        |of: fn(&ItemResult) -> Option<f64>| Column::Number(rows.iter().map(|(_, item)| of(item)).collect());
    let yes = |of: fn(&ItemResult) -> bool| Column::Yes(rows.iter().map(|(_, item)| of(item)).collect());
    let columns = vec![
        // As text: not every reader has 64 bits without a sign.
        ("seed", text(|t, _| t.seed.to_string())),
        ("scene", text(|t, _| t.scene.clone())),
        ("condition", text(|t, _| t.condition.clone())),
        ("estimator", text(|t, _| t.estimator.clone())),
        ("grasper", text(|t, _| t.grasper.clone())),
        ("detector", text(|t, _| t.detector.clone())),
        ("object_set", text(|t, _| t.object_set.clone())),
        ("scenario", text(|t, _| t.scenario.clone())),
        ("object", text(|_, i| i.object.clone())),
        ("instance", whole(|_, i| i64::from(i.instance))),
        ("packed", yes(|i| i.outcome == Outcome::Packed)),
        ("outcome", text(|_, i| i.outcome.words().to_owned())),
        ("stage", text(|_, i| format!("{:?}", i.stage).to_lowercase())),
        ("reason", text(|_, i| i.reason.clone())),
        ("attempts", whole(|_, i| i64::from(i.attempts))),
        ("add_m", number(|i| i.add_m)),
        ("adds_m", number(|i| i.adds_m)),
        ("slip_m", number(|i| i.slip_m)),
        ("peak_force_n", number(|i| Some(i.peak_force_n))),
        ("peak_impulse_n_s", number(|i| Some(i.peak_impulse_n_s))),
        ("harmless_impulse_n_s", number(|i| Some(i.harmless_impulse_n_s))),
        ("others_moved_m", number(|i| Some(i.others_moved_m))),
        ("opposing_contacts", yes(|i| i.clauses.opposing_contacts)),
        ("lifted_clear", yes(|i| i.clauses.lifted_clear)),
        ("held_after_carry", yes(|i| i.clauses.held_after_carry)),
        ("slip_within", yes(|i| i.clauses.slip_within)),
        ("in_bin", yes(|i| i.clauses.in_bin)),
        ("upright", yes(|i| i.clauses.upright)),
        ("set_down", yes(|i| i.clauses.set_down)),
        ("unharmed", yes(|i| i.clauses.unharmed)),
        ("nothing_knocked_out", yes(|i| i.clauses.nothing_knocked_out)),
    ];
    columns.into_iter().map(|(name, column)| (name.to_owned(), column)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;

    #[test]
    fn no_trials_make_an_empty_table() {
        assert!(bytes(&[]).is_ok());
    }

    #[test]
    fn groups_of_rows_end_with_a_trial() {
        let trial =
            |seed| crate::experiment::summary::tests::trial(seed, "base", "grip", &[("can", true, None); 3]);
        let mut writer = Writer::grouped(Vec::new(), 4).unwrap();
        (1..=5).for_each(|seed| writer.add(trial(seed)).unwrap());
        let bytes = writer.finish().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FILE);
        std::fs::write(&path, bytes).unwrap();
        let reader = SerializedFileReader::new(std::fs::File::open(path).unwrap()).unwrap();
        let rows: Vec<i64> = reader.metadata().row_groups().iter().map(|group| group.num_rows()).collect();
        assert_eq!(rows, [6, 6, 3]);
        let seeds: Vec<String> = reader
            .get_row_iter(None)
            .unwrap()
            .map(|row| row.unwrap().get_string(0).unwrap().clone())
            .collect();
        assert_eq!(seeds.join(""), "111222333444555");
    }
}
