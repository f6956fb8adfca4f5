//! Tables in Parquet, written column by column and read back: for pandas, polars and DuckDB.

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, FloatType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::record::Field;
use parquet::schema::types::Type;

/// A column's values, a row each.
#[derive(Debug, Clone, PartialEq)]
pub enum Column {
    /// Text.
    Text(Vec<String>),
    /// Whole numbers.
    Whole(Vec<i64>),
    /// Yes or no.
    Yes(Vec<bool>),
    /// Numbers; empty where there is no value.
    Number(Vec<Option<f64>>),
    /// Numbers of single precision.
    Single(Vec<f32>),
}

impl Column {
    /// How many values it has.
    pub fn len(&self) -> usize {
        match self {
            Self::Text(values) => values.len(),
            Self::Whole(values) => values.len(),
            Self::Yes(values) => values.len(),
            Self::Number(values) => values.len(),
            Self::Single(values) => values.len(),
        }
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Columns by name, in their order.
pub type Columns = Vec<(String, Column)>;

/// Writes a table group of rows by group of rows. Its bytes depend on those alone.
pub struct Writer<W: Write + Send> {
    file: SerializedFileWriter<W>,
    name: String,
}

impl<W: Write + Send> Writer<W> {
    /// Begins the table `name` with columns like these.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn new(to: W, name: &str, like: &Columns) -> Result<Self> {
        let file = schema(name, like)
            .and_then(|schema| SerializedFileWriter::new(to, schema, Arc::new(WriterProperties::default())))
            .with_context(|| cannot(name))?;
        Ok(Self { file, name: name.to_owned() })
    }

    /// Adds a group of rows.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn group(&mut self, columns: &Columns) -> Result<()> {
        write_group(&mut self.file, columns).with_context(|| cannot(&self.name))
    }

    /// Ends the table, and gives back where it was written to.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn finish(self) -> Result<W> {
        self.file.into_inner().with_context(|| cannot(&self.name))
    }
}

/// The content of a file of one group of rows.
///
/// # Errors
/// When it cannot be encoded.
pub fn bytes(name: &str, columns: &Columns) -> Result<Vec<u8>> {
    let mut writer = Writer::new(Vec::new(), name, columns)?;
    writer.group(columns)?;
    writer.finish()
}

fn cannot(name: &str) -> String {
    format!("{name}.parquet: cannot be made")
}

fn schema(name: &str, columns: &Columns) -> parquet::errors::Result<Arc<Type>> {
    let fields = columns
        .iter()
        .map(|(name, column)| {
            let (physical, logical, repetition) = match column {
                Column::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String), Repetition::REQUIRED),
                Column::Whole(_) => (Physical::INT64, None, Repetition::REQUIRED),
                Column::Yes(_) => (Physical::BOOLEAN, None, Repetition::REQUIRED),
                Column::Number(_) => (Physical::DOUBLE, None, Repetition::OPTIONAL),
                Column::Single(_) => (Physical::FLOAT, None, Repetition::REQUIRED),
            };
            let field = Type::primitive_type_builder(name, physical)
                .with_logical_type(logical)
                .with_repetition(repetition)
                .build()?;
            Ok(Arc::new(field))
        })
        .collect::<parquet::errors::Result<Vec<_>>>()?;
    Ok(Arc::new(Type::group_type_builder(name).with_fields(fields).build()?))
}

fn write_group<W: Write + Send>(
    writer: &mut SerializedFileWriter<W>,
    columns: &Columns,
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
            Column::Single(values) => {
                next.typed::<FloatType>().write_batch(values, None, None)?;
            }
        }
        next.close()?;
    }
    group.close()?;
    Ok(())
}

/// Reads a table that was written here.
///
/// # Errors
/// When the file cannot be read, or has columns of other kinds.
pub fn read(path: &Path) -> Result<Columns> {
    let which = || format!("{}: cannot be read as a table", path.display());
    let file = File::open(path).with_context(which)?;
    let reader = SerializedFileReader::new(file).with_context(which)?;
    let fields = reader.metadata().file_metadata().schema().get_fields();
    let mut columns: Columns = Vec::with_capacity(fields.len());
    for field in fields {
        let column = match field.get_physical_type() {
            Physical::BYTE_ARRAY => Column::Text(Vec::new()),
            Physical::INT64 => Column::Whole(Vec::new()),
            Physical::BOOLEAN => Column::Yes(Vec::new()),
            Physical::DOUBLE => Column::Number(Vec::new()),
            Physical::FLOAT => Column::Single(Vec::new()),
            other => {
                bail!("{}: column {} is {other}, which is never written here", path.display(), field.name())
            }
        };
        columns.push((field.name().to_owned(), column));
    }
    for row in reader.get_row_iter(None).with_context(which)? {
        let row = row.with_context(which)?;
        for ((name, column), (_, field)) in columns.iter_mut().zip(row.get_column_iter()) {
            match (column, field) {
                (Column::Text(values), Field::Str(value)) => values.push(value.clone()),
                (Column::Whole(values), Field::Long(value)) => values.push(*value),
                (Column::Yes(values), Field::Bool(value)) => values.push(*value),
                (Column::Number(values), Field::Double(value)) => values.push(Some(*value)),
                (Column::Number(values), Field::Null) => values.push(None),
                (Column::Single(values), Field::Float(value)) => values.push(*value),
                _ => bail!("{}: column {name} has a value of another kind", path.display()),
            }
        }
    }
    Ok(columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_back() {
        let columns: Columns = [
            ("name", Column::Text(vec!["a".into(), "ü, \"b\"".into()])),
            ("n", Column::Whole(vec![-1, 7])),
            ("yes", Column::Yes(vec![true, false])),
            ("x", Column::Number(vec![None, Some(0.1)])),
            ("y", Column::Single(vec![0.1, -0.0])),
        ]
        .map(|(name, column)| (name.to_owned(), column))
        .into();
        let bytes = bytes("t", &columns).unwrap();
        assert_eq!((&bytes[..4], &bytes[bytes.len() - 4..]), (&b"PAR1"[..], &b"PAR1"[..]));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        std::fs::write(&path, bytes).unwrap();
        assert_eq!(read(&path).unwrap(), columns);
        std::fs::write(&path, "no table").unwrap();
        assert!(format!("{:#}", read(&path).unwrap_err()).contains("t.parquet: cannot be read"));
    }
}
