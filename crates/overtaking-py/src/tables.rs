//! Binding of `overtaking-tables`.

use bytes::Bytes;
use numpy::{Element, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use overtaking_tables::{Column, FileWriter, Values};
use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// What a column holds, as Python says it of a schema.
#[derive(Clone, Copy)]
enum Kind {
    Long,
    Int,
    Short,
    Byte,
    Float,
    Double,
    Flag,
    Name,
    Text,
    Fixed(usize),
}

/// What is the same for all pieces of a column.
struct Known {
    name: String,
    kind: Kind,
    names: Vec<String>,
    is_key: bool,
    is_few: bool,
}

/// The values of a column, by the type of their array.
enum Array<'py> {
    Long(PyReadonlyArray1<'py, i64>),
    Int(PyReadonlyArray1<'py, i32>),
    Short(PyReadonlyArray1<'py, i16>),
    Byte(PyReadonlyArray1<'py, u8>),
    Float(PyReadonlyArray1<'py, f32>),
    Double(PyReadonlyArray1<'py, f64>),
    Flag(PyReadonlyArray1<'py, bool>),
    Name(PyReadonlyArray1<'py, i8>),
    Text(PyReadonlyArray1<'py, i32>),
}

/// A column as Python gives it: values, where there are none, and the texts that values are places in.
type Given<'py> = (
    Bound<'py, PyAny>,
    Option<PyReadonlyArray1<'py, bool>>,
    Vec<String>,
);

fn bad(error: impl ToString) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// A Parquet file that is written piece by piece.
#[pyclass]
pub struct ParquetFile {
    file: FileWriter,
    columns: Vec<Known>,
}

#[pymethods]
impl ParquetFile {
    #[new]
    fn new(template: &[u8], columns: Vec<Known>, is_packed: bool) -> PyResult<Self> {
        let keyed = columns.iter().enumerate().filter(|(_, one)| one.is_key);
        let keys: Vec<usize> = keyed.map(|(place, _)| place).collect();
        let template = Bytes::copy_from_slice(template);
        let file = FileWriter::new(template, &keys, is_packed).map_err(bad)?;
        Ok(Self { file, columns })
    }

    /// The bytes that the file grows by when some rows are added.
    fn append<'py>(
        &mut self,
        py: Python<'py>,
        columns: Vec<Given<'py>>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let (expected, got) = (self.columns.len(), columns.len());
        if got != expected {
            return Err(bad(format!("{got} columns instead of {expected}")));
        }
        let arrays = (self.columns.iter().zip(&columns))
            .map(|(known, given)| known.array(&given.0))
            .collect::<PyResult<Vec<_>>>()?;
        let columns = (self.columns.iter().zip(&columns).zip(&arrays))
            .map(|((known, given), array)| known.column(array, given))
            .collect::<PyResult<Vec<_>>>()?;
        let file = &mut self.file;
        let bytes = py.detach(|| file.append(&columns)).map_err(bad)?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Hashes over the values and over the gaps of each column so far.
    fn digests(&self) -> Vec<(String, String)> {
        self.file.digests()
    }

    /// The bytes that end the file.
    fn finish<'py>(
        &mut self,
        py: Python<'py>,
        notes: Vec<(String, String)>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = self.file.finish(notes).map_err(bad)?;
        Ok(PyBytes::new(py, &bytes))
    }
}

impl<'py> FromPyObject<'_, 'py> for Known {
    type Error = PyErr;

    /// From its name, its kind, the names that it may hold, whether it is a key and whether they are few.
    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let (name, kind, names, is_key, is_few): (String, String, Vec<String>, bool, bool) =
            given.extract()?;
        let kind = match kind.as_str() {
            "long" => Kind::Long,
            "int" => Kind::Int,
            "short" => Kind::Short,
            "byte" => Kind::Byte,
            "float" => Kind::Float,
            "double" => Kind::Double,
            "flag" => Kind::Flag,
            "name" => Kind::Name,
            "text" => Kind::Text,
            other => {
                let width = other
                    .strip_prefix("fixed ")
                    .and_then(|width| width.parse().ok());
                let width = width.filter(|&width| width > 0);
                Kind::Fixed(width.ok_or_else(|| bad(format!("column {name}: unknown kind")))?)
            }
        };
        Ok(Self {
            name,
            kind,
            names,
            is_key,
            is_few,
        })
    }
}

impl Known {
    /// The values, if their array is of the kind of the column.
    fn array<'py>(&self, given: &Bound<'py, PyAny>) -> PyResult<Array<'py>> {
        macro_rules! of {
            ($kind:ident) => {
                given.extract().map(Array::$kind).ok()
            };
        }
        let found = match self.kind {
            Kind::Long => of!(Long),
            Kind::Int => of!(Int),
            Kind::Short => of!(Short),
            Kind::Byte | Kind::Fixed(_) => of!(Byte),
            Kind::Float => of!(Float),
            Kind::Double => of!(Double),
            Kind::Flag => of!(Flag),
            Kind::Name => of!(Name),
            Kind::Text => of!(Text),
        };
        found.ok_or_else(|| bad(format!("column {} is not as in the schema", self.name)))
    }

    fn column<'a>(&'a self, array: &'a Array<'_>, given: &'a Given<'_>) -> PyResult<Column<'a>> {
        let values = match array {
            Array::Long(values) => Values::Long(values.as_slice()?),
            Array::Int(values) => Values::Int(values.as_slice()?),
            Array::Short(values) => Values::Short(values.as_slice()?),
            Array::Byte(values) => match self.kind {
                Kind::Fixed(width) => Values::Fixed(values.as_slice()?, width),
                _ => Values::Byte(values.as_slice()?),
            },
            Array::Float(values) => Values::Float(values.as_slice()?),
            Array::Double(values) => Values::Double(values.as_slice()?),
            Array::Flag(values) => Values::Flag(values.as_slice()?),
            Array::Name(values) => Values::Name(values.as_slice()?, &self.names),
            Array::Text(values) => Values::Text(values.as_slice()?, &given.2),
        };
        let missing = given.1.as_ref().map(PyReadonlyArray1::as_slice);
        Ok(Column {
            values,
            missing: missing.transpose()?,
            is_key: self.is_key,
            is_few: self.is_few,
        })
    }
}

/// A hash over bytes: BLAKE3.
#[pyclass]
#[derive(Default)]
pub struct Hash(blake3::Hasher);

#[pymethods]
impl Hash {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// Adds the bytes of a contiguous array.
    fn update(&mut self, py: Python<'_>, data: PyBuffer<u8>) -> PyResult<()> {
        self.0.update(&data.to_vec(py)?);
        Ok(())
    }

    /// The hash over all bytes so far, 64 hexadecimal digits.
    fn hexdigest(&self) -> String {
        self.0.finalize().to_hex().to_string()
    }
}

/// The first values of each row of a table, one after another.
#[pyfunction]
pub fn compact<'py>(
    py: Python<'py>,
    values: Table<'py>,
    counts: PyReadonlyArray1<'py, i64>,
) -> PyResult<Bound<'py, PyAny>> {
    match values {
        Table::Int(values) => compacted(py, &values, &counts),
        Table::Short(values) => compacted(py, &values, &counts),
        Table::Byte(values) => compacted(py, &values, &counts),
    }
}

/// Recorded values, shape (row, place).
#[derive(FromPyObject)]
pub enum Table<'py> {
    Int(PyReadonlyArray2<'py, i32>),
    Short(PyReadonlyArray2<'py, i16>),
    Byte(PyReadonlyArray2<'py, u8>),
}

fn compacted<'py, T: Element + Copy>(
    py: Python<'py>,
    values: &PyReadonlyArray2<'py, T>,
    counts: &PyReadonlyArray1<'py, i64>,
) -> PyResult<Bound<'py, PyAny>> {
    let (values, counts) = (values.as_array(), counts.as_slice()?);
    if counts.len() != values.nrows() {
        return Err(bad("counts: expected one for each row"));
    }
    let mut found = Vec::with_capacity(values.len());
    for (row, &count) in values.rows().into_iter().zip(counts) {
        let row = row
            .to_slice()
            .ok_or_else(|| bad("values: a row is not contiguous"))?;
        let first = row.get(..count as usize);
        found.extend_from_slice(first.ok_or_else(|| bad("counts: more than a row has"))?);
    }
    Ok(PyArray1::from_vec(py, found).into_any())
}
