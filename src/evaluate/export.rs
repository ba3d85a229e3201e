//! The runs of an experiment in formats for other programs, besides the CSV of its folder.

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{Type, TypePtr};
use serde_json::{Map as JsonMap, Value as Json, json};

use super::folder::{Runs, columns};
use super::{Experiment, Run};

/// How runs are written, besides CSV.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// What is written always.
    Csv,
    /// A list of objects.
    Json,
    /// Columns, for pandas, Polars, R or DuckDB.
    Parquet,
}

/// The runs as a list of objects, a line each.
#[must_use]
pub fn json(it: &Experiment, runs: &Runs) -> String {
    let factors: Vec<Option<Vec<f64>>> = (0..it.factors.len()).map(|at| it.numbers(at)).collect();
    let object = |run: &Run| {
        let mut object = JsonMap::new();
        object.insert("experiment".into(), json!(it.name));
        for (at, name) in it.factors.iter().enumerate() {
            let value = match &factors[at] {
                Some(numbers) => json!(numbers[run.case]),
                None => json!(it.cases[run.case][at]),
            };
            object.insert(name.clone(), value);
        }
        object.insert("variant".into(), json!(it.variants[run.variant].name));
        object.insert("seed".into(), json!(run.seed));
        object.insert("status".into(), json!(run.status));
        object.insert("success".into(), json!(run.success));
        object.insert("why".into(), json!(run.why));
        for (name, number) in it.measures.iter().zip(&run.numbers) {
            object.insert(name.clone(), json!(number));
        }
        Json::Object(object).to_string()
    };
    let lines: Vec<String> = runs.values().map(object).collect();
    format!("[\n{}\n]\n", lines.join(",\n"))
}

/// The runs as columns: texts, a number for the seed, a truth value, and numbers that may be missing. A factor is a column of
/// numbers if all its values are.
///
/// # Errors
/// None that can be thought of.
pub fn parquet(it: &Experiment, runs: &Runs) -> Result<Vec<u8>, String> {
    let said = |error: parquet::errors::ParquetError| error.to_string();
    let names = columns(it);
    let column = |name: &String| {
        let is_measure = it.measures.contains(name);
        let factor = it.factors.iter().position(|factor| factor == name);
        let is_number = is_measure || factor.is_some_and(|at| it.numbers(at).is_some());
        let (physical, logical) = match name.as_str() {
            "seed" => (Physical::INT64, None),
            "success" => (Physical::BOOLEAN, None),
            _ if is_number => (Physical::DOUBLE, None),
            _ => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        };
        let repetition = if is_measure { Repetition::OPTIONAL } else { Repetition::REQUIRED };
        let column = Type::primitive_type_builder(name, physical).with_repetition(repetition);
        column.with_logical_type(logical).build().map(TypePtr::new)
    };
    let fields: Vec<TypePtr> = names.iter().map(column).collect::<Result<_, _>>().map_err(said)?;
    let schema = Type::group_type_builder("runs").with_fields(fields).build().map_err(said)?;
    let properties = WriterProperties::builder().set_created_by("pleach".into()).build();
    let mut bytes = Vec::new();
    let mut writer =
        SerializedFileWriter::new(&mut bytes, TypePtr::new(schema), properties.into()).map_err(said)?;
    let mut group = writer.next_row_group().map_err(said)?;
    let runs: Vec<&Run> = runs.values().collect();
    let texts = |group: &mut SerializedRowGroupWriter<'_, _>, texts: Vec<&str>| {
        let values: Vec<ByteArray> = texts.into_iter().map(ByteArray::from).collect();
        put::<ByteArrayType, _>(group, &values, None)
    };
    texts(&mut group, vec![&it.name; runs.len()])?;
    for factor in 0..it.factors.len() {
        if let Some(numbers) = it.numbers(factor) {
            let values: Vec<f64> = runs.iter().map(|run| numbers[run.case]).collect();
            put::<DoubleType, _>(&mut group, &values, None)?;
            continue;
        }
        texts(&mut group, runs.iter().map(|run| it.cases[run.case][factor].as_str()).collect())?;
    }
    texts(&mut group, runs.iter().map(|run| it.variants[run.variant].name.as_str()).collect())?;
    let seeds: Vec<i64> = runs.iter().map(|run| i64::try_from(run.seed).unwrap_or(i64::MAX)).collect();
    put::<Int64Type, _>(&mut group, &seeds, None)?;
    texts(&mut group, runs.iter().map(|run| run.status.as_str()).collect())?;
    let successes: Vec<bool> = runs.iter().map(|run| run.success).collect();
    put::<BoolType, _>(&mut group, &successes, None)?;
    texts(&mut group, runs.iter().map(|run| run.why.as_str()).collect())?;
    for at in 0..it.measures.len() {
        let numbers: Vec<Option<f64>> =
            runs.iter().map(|run| run.numbers.get(at).copied().flatten()).collect();
        let there: Vec<i16> = numbers.iter().map(|it| i16::from(it.is_some())).collect();
        let values: Vec<f64> = numbers.into_iter().flatten().collect();
        put::<DoubleType, _>(&mut group, &values, Some(&there))?;
    }
    group.close().map_err(said)?;
    writer.close().map_err(said)?;
    Ok(bytes)
}

/// Writes the next column.
fn put<T: parquet::data_type::DataType, W: std::io::Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    values: &[T::T],
    there: Option<&[i16]>,
) -> Result<(), String> {
    let said = |error: parquet::errors::ParquetError| error.to_string();
    let column = group.next_column().map_err(said)?;
    let mut column = column.ok_or("the table has fewer columns than values")?;
    column.typed::<T>().write_batch(values, there, None).map_err(said)?;
    column.close().map_err(said)
}
