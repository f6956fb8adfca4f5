//! The items of all trials as one table, an item a row: items.parquet, for pandas, polars and DuckDB.

use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result};
use grip_sim::bop;
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use crate::score::outcome::{ItemResult, Outcome, TrialResult};

/// The table's name in an experiment's folder.
pub const FILE: &str = "items.parquet";

/// A column's values, a row each.
enum Column {
    Text(Vec<String>),
    Whole(Vec<i64>),
    Yes(Vec<bool>),
    /// Empty where there is no value.
    Number(Vec<Option<f64>>),
}

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
    file: SerializedFileWriter<W>,
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
        let file = schema(&columns(&[]))
            .and_then(|schema| SerializedFileWriter::new(to, schema, Arc::new(WriterProperties::default())))
            .with_context(cannot)?;
        Ok(Self { file, held: Vec::new(), rows: 0, group, empty: true })
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
        self.file.into_inner().with_context(cannot)
    }

    fn flush(&mut self) -> Result<()> {
        write_group(&mut self.file, &columns(&self.held)).with_context(cannot)?;
        self.held.clear();
        (self.rows, self.empty) = (0, false);
        Ok(())
    }
}

fn cannot() -> String {
    format!("{FILE}: cannot be made")
}

fn columns(trials: &[TrialResult]) -> Vec<(&'static str, Column)> {
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
    vec![
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
    ]
}

fn schema(columns: &[(&str, Column)]) -> parquet::errors::Result<Arc<Type>> {
    let fields = columns
        .iter()
        .map(|(name, column)| {
            let (physical, logical, repetition) = match column {
                Column::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String), Repetition::REQUIRED),
                Column::Whole(_) => (Physical::INT64, None, Repetition::REQUIRED),
                Column::Yes(_) => (Physical::BOOLEAN, None, Repetition::REQUIRED),
                Column::Number(_) => (Physical::DOUBLE, None, Repetition::OPTIONAL),
            };
            let field = Type::primitive_type_builder(name, physical)
                .with_logical_type(logical)
                .with_repetition(repetition)
                .build()?;
            Ok(Arc::new(field))
        })
        .collect::<parquet::errors::Result<Vec<_>>>()?;
    Ok(Arc::new(Type::group_type_builder("items").with_fields(fields).build()?))
}

fn write_group<W: Write + Send>(
    writer: &mut SerializedFileWriter<W>,
    columns: &[(&str, Column)],
) -> parquet::errors::Result<()> {
    let mut group = writer.next_row_group()?;
    for (_, column) in columns {
        let Some(mut next) = group.next_column()? else { break };
        match column {
            Column::Text(values) => {
                let values: Vec<ByteArray> = values.iter().map(|v| ByteArray::from(v.as_str())).collect();
                next.typed::<ByteArrayType>().write_batch(&values, None, None)?;
            }
            Column::Whole(values) => {
                next.typed::<Int64Type>().write_batch(values, None, None)?;
            }
            Column::Yes(values) => {
                next.typed::<BoolType>().write_batch(values, None, None)?;
            }
            Column::Number(values) => {
                let there: Vec<f64> = values.iter().flatten().copied().collect();
                let levels: Vec<i16> = values.iter().map(|v| i16::from(v.is_some())).collect();
                next.typed::<DoubleType>().write_batch(&there, Some(&levels), None)?;
            }
        }
        next.close()?;
    }
    group.close()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::{Field, RowAccessor};

    #[test]
    fn what_is_written_is_read_back() {
        let columns = [
            ("name", Column::Text(vec!["a".into(), "ü, \"b\"".into()])),
            ("n", Column::Whole(vec![-1, 7])),
            ("yes", Column::Yes(vec![true, false])),
            ("x", Column::Number(vec![None, Some(0.1)])),
        ];
        let mut bytes = Vec::new();
        let properties = Arc::new(WriterProperties::default());
        let mut writer =
            SerializedFileWriter::new(&mut bytes, schema(&columns).unwrap(), properties).unwrap();
        write_group(&mut writer, &columns).unwrap();
        writer.close().unwrap();
        assert_eq!((&bytes[..4], &bytes[bytes.len() - 4..]), (&b"PAR1"[..], &b"PAR1"[..]));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        std::fs::write(&path, bytes).unwrap();
        let reader = SerializedFileReader::new(std::fs::File::open(path).unwrap()).unwrap();
        let rows: Vec<Vec<Field>> = reader
            .get_row_iter(None)
            .unwrap()
            .map(|row| row.unwrap().get_column_iter().map(|(_, field)| field.clone()).collect())
            .collect();
        let text = |s: &str| Field::Str(s.into());
        assert_eq!(rows[0], [text("a"), Field::Long(-1), Field::Bool(true), Field::Null]);
        assert_eq!(rows[1], [text("ü, \"b\""), Field::Long(7), Field::Bool(false), Field::Double(0.1)]);
    }

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
