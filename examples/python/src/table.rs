//! Tables: batches of columns as Arrow.

use std::{
    collections::{BTreeMap, HashMap},
    ops::Range,
    sync::Arc,
};

use arrow_array::{
    Array, ArrayRef, BinaryArray, DictionaryArray, Float32Array, Float64Array, Int8Array,
    Int16Array, Int32Array, RecordBatch, RecordBatchIterator, RecordBatchReader, StringArray,
    TimestampMicrosecondArray, UInt8Array, UInt16Array, UInt32Array, UInt64Array,
    ffi::FFI_ArrowSchema, ffi_stream::FFI_ArrowArrayStream, types::Int8Type,
};
use arrow_buffer::{BooleanBuffer, Buffer, NullBuffer, OffsetBuffer, ScalarBuffer};
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef, TimeUnit};
use axle::columns::{Batch, Column, Kind, Values};
use pyo3::{
    exceptions::{PyKeyError, PyValueError},
    prelude::*,
    types::{PyBytes, PyCapsule, PyDict, PyList},
};

/// Which columns there are besides those of the frame.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Units {
    /// None.
    Raw,
    /// Measured values in units of the SI, as `f64`.
    Si,
}

impl Units {
    pub(crate) fn named(name: Option<&str>) -> PyResult<Self> {
        match name {
            None | Some("raw") => Ok(Self::Raw),
            Some("si") => Ok(Self::Si),
            Some(other) => {
                Err(PyValueError::new_err(format!("units {other:?} are neither 'raw' nor 'si'")))
            }
        }
    }
}

/// The unit of the SI, and what one of these is in it.
fn si(unit: &str) -> Option<(&'static str, f64)> {
    const TURN: f64 = std::f64::consts::TAU;
    const DEGREE: f64 = TURN / 360.0;
    const STANDARD_GRAVITY: f64 = 9.806_65;
    Some(match unit {
        "1/16384 g" => ("m/s²", STANDARD_GRAVITY / 16384.0),
        "1/16.4 °/s" => ("rad/s", DEGREE / 16.4),
        "°" => ("rad", DEGREE),
        "1/min" => ("rad/s", TURN / 60.0),
        "1/s" => ("rad/s", TURN),
        "turn" => ("rad", TURN),
        "1/8192 turn" => ("rad", TURN / 8192.0),
        "0.01 A" => ("A", 0.01),
        "0.1 V" => ("V", 0.1),
        "W" => ("W", 1.0),
        "percent" => ("1", 0.01),
        _ => return None,
    })
}

/// The schemas of all tables.
#[derive(Clone)]
pub(crate) struct Schemas {
    units: Units,
    /// In the order of the protocols.
    all: Vec<(String, SchemaRef)>,
}

impl Schemas {
    pub(crate) fn new(empty: &[Batch], units: Units) -> Self {
        let schema = |batch: &Batch| {
            let fields: Vec<_> = batch.columns.iter().map(field).collect();
            let of_si = batch.columns.iter().filter_map(|it| si_field(it, units));
            let metadata = HashMap::from([("axlewire.table".to_owned(), batch.table.clone())]);
            let fields: Vec<_> = fields.into_iter().chain(of_si).collect();
            (batch.table.clone(), Arc::new(Schema::new_with_metadata(fields, metadata)))
        };
        Self { units, all: empty.iter().map(schema).collect() }
    }

    pub(crate) fn schema(&self, name: &str) -> SchemaRef {
        let known = self.all.iter().find(|(table, _)| table == name);
        known.map_or_else(|| Arc::new(Schema::empty()), |(_, schema)| Arc::clone(schema))
    }

    /// The name of a table, of which the protocol may be left out: that of the first which has
    /// rows, or of the first.
    pub(crate) fn full_name(
        &self,
        message: &str,
        has_rows: impl Fn(&str) -> bool,
    ) -> Option<String> {
        let is_it = |name: &&String| {
            *name == message
                || name.split_once('.').is_some_and(|(_, rest)| rest == message)
                || (*name, message) == (&"skipped".to_owned(), "gaps")
        };
        let mut known: Vec<_> = self.all.iter().map(|(name, _)| name).filter(is_it).collect();
        known.sort_by_key(|name| !has_rows(name));
        known.first().map(|name| (*name).clone())
    }

    /// The same of a stream, whose rows are not known yet: there must be one, of this protocol if
    /// it is named.
    pub(crate) fn only(&self, message: &str, protocol: Option<&str>) -> PyResult<String> {
        let is_it = |name: &&str| {
            let (of, rest) = name.split_once('.').unwrap_or(("", name));
            *name == message
                || (*name, message) == ("skipped", "gaps")
                || (rest == message && protocol.is_none_or(|it| it == of))
        };
        let all = self.all.iter().map(|(name, _)| name.as_str());
        match *all.filter(is_it).collect::<Vec<_>>() {
            [only] => Ok(only.to_owned()),
            [] => Err(self.no_message(message)),
            ref several => {
                let several = several.join(" or ");
                Err(PyValueError::new_err(format!("{message:?} may be {several}: say which")))
            }
        }
    }

    pub(crate) fn no_message(&self, message: &str) -> PyErr {
        PyKeyError::new_err(format!("no message {message:?}; there are {}", self.names()))
    }

    fn names(&self) -> String {
        let names: Vec<_> = self.all.iter().map(|(name, _)| name.as_str()).collect();
        names.join(", ")
    }

    pub(crate) fn table(&self, name: &str, batches: Arc<Vec<RecordBatch>>) -> Table {
        Table { name: name.to_owned(), schema: self.schema(name), batches }
    }

    /// The same rows as Arrow.
    pub(crate) fn batch(&self, batch: Batch) -> RecordBatch {
        let schema = self.schema(&batch.table);
        let mut converted: Vec<ArrayRef> = Vec::with_capacity(schema.fields().len());
        if self.units == Units::Si {
            converted.extend(batch.columns.iter().filter_map(si_column));
        }
        let arrays = batch.columns.into_iter().map(column).chain(converted);
        let made = RecordBatch::try_new(Arc::clone(&schema), arrays.collect());
        made.unwrap_or_else(|_| RecordBatch::new_empty(schema))
    }
}

fn data_type(kind: Kind) -> DataType {
    match kind {
        Kind::U8 => DataType::UInt8,
        Kind::I8 => DataType::Int8,
        Kind::U16 => DataType::UInt16,
        Kind::I16 => DataType::Int16,
        Kind::U32 => DataType::UInt32,
        Kind::I32 => DataType::Int32,
        Kind::U64 => DataType::UInt64,
        Kind::F32 => DataType::Float32,
        Kind::Time => DataType::Timestamp(TimeUnit::Microsecond, Some("UTC".into())),
        Kind::Name(_) => DataType::Dictionary(Box::new(DataType::Int8), Box::new(DataType::Utf8)),
        Kind::Bytes => DataType::Binary,
    }
}

fn field(column: &Column) -> Field {
    let field = Field::new(&column.name, data_type(column.kind), column.present.is_some());
    described(field, column.unit, column.meaning, column.source)
}

fn described(field: Field, unit: &str, meaning: &str, source: &str) -> Field {
    let all = [("unit", unit), ("meaning", meaning), ("source", source)];
    let told = all.into_iter().filter(|(_, text)| !text.is_empty() && *text != "none");
    let told = told.map(|(key, text)| (key.to_owned(), text.to_owned()));
    field.with_metadata(told.collect::<HashMap<_, _>>())
}

fn si_field(column: &Column, units: Units) -> Option<Field> {
    let (unit, _) = si(column.unit).filter(|_| units == Units::Si)?;
    let field =
        Field::new(format!("{}_si", column.name), DataType::Float64, column.present.is_some());
    Some(described(field, unit, column.meaning, column.source))
}

/// A value for each row, those that are absent included.
fn spread<T: Copy + Default, U: Default>(
    present: Option<&[bool]>,
    values: &[T],
    convert: impl Fn(T) -> U,
) -> Vec<U> {
    let Some(present) = present else { return values.iter().copied().map(convert).collect() };
    let mut values = values.iter().copied();
    let value = |is_there: &bool| match is_there.then(|| values.next()).flatten() {
        Some(value) => convert(value),
        None => U::default(),
    };
    present.iter().map(value).collect()
}

fn nulls(present: Option<&[bool]>) -> Option<NullBuffer> {
    present.map(|present| NullBuffer::new(BooleanBuffer::from(present)))
}

fn column(column: Column) -> ArrayRef {
    let Column { kind, names, values, present, .. } = column;
    let (present, nulls) = (present.as_deref(), nulls(present.as_deref()));
    macro_rules! small {
        ($array:ty, $number:ty, $values:expr) => {
            Arc::new(<$array>::new(spread(present, &$values, |it| it as $number).into(), nulls))
        };
    }
    // Without a copy, if no row is without a value.
    macro_rules! exact {
        ($array:ty, $values:expr) => {
            match present {
                None => Arc::new(<$array>::from($values)),
                Some(_) => {
                    Arc::new(<$array>::new(spread(present, &$values, |it| it).into(), nulls))
                }
            }
        };
    }
    match (values, kind) {
        (Values::U8(values), _) => exact!(UInt8Array, values),
        (Values::U16(values), _) => exact!(UInt16Array, values),
        (Values::I16(values), _) => exact!(Int16Array, values),
        (Values::Small(values), Kind::I8) => small!(Int8Array, i8, values),
        (Values::Small(values), Kind::U32) => small!(UInt32Array, u32, values),
        (Values::Small(values), _) => exact!(Int32Array, values),
        (Values::Large(values), Kind::Time) => {
            let values = spread(present, &values, |it| it as i64);
            Arc::new(TimestampMicrosecondArray::new(values.into(), nulls).with_timezone("UTC"))
        }
        (Values::Large(values), _) => exact!(UInt64Array, values),
        (Values::Float(values), _) => exact!(Float32Array, values),
        (Values::Name(values), _) => {
            let keys = Int8Array::new(spread(present, &values, |it| it as i8).into(), nulls);
            let names: ArrayRef = Arc::new(StringArray::from(names));
            match DictionaryArray::<Int8Type>::try_new(keys, Arc::clone(&names)) {
                Ok(named) => Arc::new(named),
                Err(_) => arrow_array::new_empty_array(&data_type(kind)),
            }
        }
        (Values::Bytes(ends, bytes), _) => {
            let mut offsets = Vec::with_capacity(ends.len() + 1);
            offsets.push(0);
            match present {
                None => offsets.extend(ends.iter().map(|end| *end as i32)),
                Some(present) => {
                    let (mut ends, mut last) = (ends.iter(), 0);
                    offsets.extend(present.iter().map(|is_there| {
                        last =
                            is_there.then(|| ends.next()).flatten().map_or(last, |it| *it as i32);
                        last
                    }));
                }
            }
            let offsets = OffsetBuffer::new(ScalarBuffer::from(offsets));
            Arc::new(BinaryArray::new(offsets, Buffer::from_vec(bytes), nulls))
        }
    }
}

/// The measured values in the unit of the SI, if it has such a unit.
fn si_column(column: &Column) -> Option<ArrayRef> {
    let (_, factor) = si(column.unit)?;
    let present = column.present.as_deref();
    let values = match &column.values {
        Values::U8(values) => spread(present, values, |it| f64::from(it) * factor),
        Values::U16(values) => spread(present, values, |it| f64::from(it) * factor),
        Values::I16(values) => spread(present, values, |it| f64::from(it) * factor),
        Values::Small(values) if column.kind == Kind::U32 => {
            spread(present, values, |it| f64::from(it as u32) * factor)
        }
        Values::Small(values) => spread(present, values, |it| f64::from(it) * factor),
        Values::Float(values) => spread(present, values, |it| f64::from(it) * factor),
        _ => return None,
    };
    Some(Arc::new(Float64Array::new(values.into(), nulls(present))))
}

/// Rows of one message, as columns of Arrow.
///
/// pyarrow, Polars, pandas, DuckDB and nanoarrow take it without a copy:
/// `pyarrow.table(table)`, `polars.DataFrame(table)`, `pandas.DataFrame.from_arrow(table)`.
#[pyclass(frozen, module = "axlewire")]
pub(crate) struct Table {
    pub(crate) name: String,
    pub(crate) schema: SchemaRef,
    pub(crate) batches: Arc<Vec<RecordBatch>>,
}

#[pymethods]
impl Table {
    /// Protocol and message, such as `ucp.report`.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// The names of the columns.
    #[getter]
    fn column_names(&self) -> Vec<&str> {
        self.schema.fields().iter().map(|field| field.name().as_str()).collect()
    }

    /// What each column is: its unit, its meaning, and the ruling that decides it.
    #[getter]
    fn columns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for field in self.schema.fields() {
            let about = PyDict::new(py);
            for key in ["unit", "meaning", "source"] {
                about.set_item(key, field.metadata().get(key).map_or("", String::as_str))?;
            }
            all.set_item(field.name(), about)?;
        }
        Ok(all)
    }

    fn __len__(&self) -> usize {
        self.batches.iter().map(RecordBatch::num_rows).sum()
    }

    /// The values of a column as a list.
    fn __getitem__<'py>(&self, py: Python<'py>, column: &str) -> PyResult<Bound<'py, PyList>> {
        let (at, _) = self.schema.column_with_name(column).ok_or_else(|| {
            let names = self.column_names().join(", ");
            PyKeyError::new_err(format!("no column {column:?}; there are {names}"))
        })?;
        let all = PyList::empty(py);
        for batch in self.batches.iter() {
            append(&all, batch.column(at))?;
        }
        Ok(all)
    }

    /// All columns as lists.
    #[pyo3(signature = () -> "dict[str, list[Any]]")]
    fn to_pydict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for name in self.column_names() {
            all.set_item(name, self.__getitem__(py, name)?)?;
        }
        Ok(all)
    }

    /// For whatever takes a stream of Arrow.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // Best effort, as the interface allows: the columns are what they are.
        drop(requested_schema);
        let batches: Vec<Result<_, ArrowError>> = self.batches.iter().cloned().map(Ok).collect();
        let reader = RecordBatchIterator::new(batches, Arc::clone(&self.schema));
        stream(py, Box::new(reader))
    }

    /// The schema alone.
    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        let schema = FFI_ArrowSchema::try_from(&*self.schema)
            .map_err(|error| PyValueError::new_err(error.to_string()))?;
        PyCapsule::new_with_value(py, schema, c"arrow_schema")
    }

    fn __repr__(&self) -> String {
        let names = self.column_names().join(", ");
        format!("<axlewire.Table {}: {} rows of {names}>", self.name, self.__len__())
    }
}

/// Batches as a capsule that the interface of Arrow asks for.
pub(crate) fn stream<'py>(
    py: Python<'py>,
    batches: Box<dyn RecordBatchReader + Send>,
) -> PyResult<Bound<'py, PyCapsule>> {
    PyCapsule::new_with_value(py, FFI_ArrowArrayStream::new(batches), c"arrow_array_stream")
}

/// Appends the values of an array to a list.
fn append(to: &Bound<'_, PyList>, array: &ArrayRef) -> PyResult<()> {
    macro_rules! numbers {
        ($array:ty) => {
            if let Some(array) = array.as_any().downcast_ref::<$array>() {
                return array.iter().try_for_each(|value| to.append(value));
            }
        };
    }
    numbers!(UInt8Array);
    numbers!(Int8Array);
    numbers!(UInt16Array);
    numbers!(Int16Array);
    numbers!(UInt32Array);
    numbers!(Int32Array);
    numbers!(UInt64Array);
    numbers!(Float32Array);
    numbers!(Float64Array);
    numbers!(StringArray);
    if let Some(array) = array.as_any().downcast_ref::<TimestampMicrosecondArray>() {
        return times(to, array);
    }
    if let Some(array) = array.as_any().downcast_ref::<BinaryArray>() {
        let bytes = |value| PyBytes::new(to.py(), value);
        return array.iter().try_for_each(|value| to.append(value.map(bytes)));
    }
    if let Some(array) = array.as_any().downcast_ref::<DictionaryArray<Int8Type>>() {
        let named = array.downcast_dict::<StringArray>();
        let Some(named) = named else { return Ok(()) };
        return named.into_iter().try_for_each(|value: Option<&str>| to.append(value));
    }
    Ok(())
}

/// Times as `datetime` with their zone.
fn times(to: &Bound<'_, PyList>, array: &TimestampMicrosecondArray) -> PyResult<()> {
    let module = to.py().import("datetime")?;
    let zone = module.getattr("timezone")?.getattr("utc")?;
    let epoch = module.getattr("datetime")?.call1((1970, 1, 1, 0, 0, 0, 0, zone))?;
    let delta = module.getattr("timedelta")?;
    array.iter().try_for_each(|value| match value {
        // Days, seconds, microseconds.
        Some(micros) => to.append(epoch.add(delta.call1((0, 0, micros))?)?),
        None => to.append(to.py().None()),
    })
}

/// All frames in their order.
pub(crate) fn frames(
    tables: &BTreeMap<String, Arc<Vec<RecordBatch>>>,
    numbers: &BTreeMap<String, Vec<Vec<Range<u64>>>>,
) -> Table {
    let mut rows = Vec::new();
    for (name, batches) in tables.iter().filter(|(name, _)| name.contains('.')) {
        let numbers = numbers.get(name).map(Vec::as_slice).unwrap_or_default();
        for (batch, numbers) in batches.iter().zip(numbers) {
            rows.extend(
                numbers
                    .iter()
                    .cloned()
                    .flatten()
                    .enumerate()
                    .map(|(row, number)| (number, name, batch, row)),
            );
        }
    }
    rows.sort_by_key(|(number, ..)| *number);
    let number = UInt64Array::from_iter_values(rows.iter().map(|(number, ..)| *number));
    let split = |name: &str| {
        let (protocol, message) = name.split_once('.').unwrap_or(("", name));
        (protocol.to_owned(), message.to_owned())
    };
    let protocols = StringArray::from_iter_values(rows.iter().map(|(_, name, ..)| split(name).0));
    let messages = StringArray::from_iter_values(rows.iter().map(|(_, name, ..)| split(name).1));
    let of = |batch: &RecordBatch, name: &str| batch.column_by_name(name).cloned();
    let times: TimestampMicrosecondArray = rows
        .iter()
        .map(|(_, _, batch, row)| {
            let all = of(batch, "t")?;
            let all = all.as_any().downcast_ref::<TimestampMicrosecondArray>()?;
            all.is_valid(*row).then(|| all.value(*row))
        })
        .collect();
    let whole = |name: &str| -> UInt64Array {
        rows.iter()
            .map(|(_, _, batch, row)| {
                let all = of(batch, name)?;
                let all = all.as_any().downcast_ref::<UInt64Array>()?;
                all.is_valid(*row).then(|| all.value(*row))
            })
            .collect()
    };
    let bytes: BinaryArray = rows
        .iter()
        .map(|(_, _, batch, row)| {
            let all = of(batch, "bytes")?;
            let all = all.as_any().downcast_ref::<BinaryArray>()?;
            Some(all.value(*row).to_vec())
        })
        .collect();
    let (offset, interface) = (whole("offset"), whole("interface"));
    let directions: StringArray = rows
        .iter()
        .map(|(_, _, batch, row)| {
            let all = of(batch, "direction")?;
            let all = all.as_any().downcast_ref::<DictionaryArray<Int8Type>>()?;
            let names = all.values().as_any().downcast_ref::<StringArray>()?;
            Some(names.value(all.key(*row)?).to_owned())
        })
        .collect();
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("number", Arc::new(number)),
        ("offset", Arc::new(offset)),
        ("t", Arc::new(times.with_timezone("UTC"))),
        ("interface", Arc::new(interface)),
        ("direction", Arc::new(directions)),
        ("protocol", Arc::new(protocols)),
        ("message", Arc::new(messages)),
        ("bytes", Arc::new(bytes)),
    ];
    let fields: Vec<_> = columns
        .iter()
        .map(|(name, array)| Field::new(*name, array.data_type().clone(), array.is_nullable()))
        .collect();
    let schema = Arc::new(Schema::new(fields));
    let arrays = columns.into_iter().map(|(_, array)| array).collect();
    let batch = RecordBatch::try_new(Arc::clone(&schema), arrays);
    let batch = batch.unwrap_or_else(|_| RecordBatch::new_empty(Arc::clone(&schema)));
    Table { name: "frames".to_owned(), schema, batches: Arc::new(vec![batch]) }
}
