//! Binding of `overtaking-tables`.

use bytes::Bytes;
use numpy::{Element, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use overtaking_tables::{Column, FileWriter, Values};
use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// The values of a column, by the type of their array.
#[derive(FromPyObject)]
enum Array<'py> {
    Long(PyReadonlyArray1<'py, i64>),
    Int(PyReadonlyArray1<'py, i32>),
    Short(PyReadonlyArray1<'py, i16>),
    Byte(PyReadonlyArray1<'py, u8>),
    Code(PyReadonlyArray1<'py, i8>),
}

/// A column as Python gives it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Given<'py> {
    values: Array<'py>,
    missing: Option<PyReadonlyArray1<'py, bool>>,
    names: Vec<String>,
    is_key: bool,
    is_few: bool,
}

fn bad(error: impl ToString) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// A Parquet file that is written piece by piece.
#[pyclass]
pub struct ParquetFile(FileWriter);

#[pymethods]
impl ParquetFile {
    #[new]
    fn new(template: &[u8], keys: Vec<usize>) -> PyResult<Self> {
        let file = FileWriter::new(Bytes::copy_from_slice(template), &keys);
        file.map(Self).map_err(bad)
    }

    /// The bytes that the file grows by when some rows are added.
    fn append<'py>(
        &mut self,
        py: Python<'py>,
        columns: Vec<Given<'py>>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let missing: Vec<Option<Vec<u8>>> = columns
            .iter()
            .map(|given| {
                let mask = given.missing.as_ref().map(PyReadonlyArray1::as_slice);
                Ok(mask
                    .transpose()?
                    .map(|mask| mask.iter().map(|&none| none.into()).collect()))
            })
            .collect::<PyResult<_>>()?;
        let columns = columns
            .iter()
            .zip(&missing)
            .map(|(given, missing)| given.column(missing.as_deref()))
            .collect::<PyResult<Vec<_>>>()?;
        let bytes = py.detach(|| self.0.append(&columns)).map_err(bad)?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Hashes over the values and over the gaps of each column so far.
    fn digests(&self) -> Vec<(String, String)> {
        self.0.digests()
    }

    /// The bytes that end the file.
    fn finish<'py>(
        &mut self,
        py: Python<'py>,
        notes: Vec<(String, String)>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = self.0.finish(notes).map_err(bad)?;
        Ok(PyBytes::new(py, &bytes))
    }
}

impl Given<'_> {
    fn column<'a>(&'a self, missing: Option<&'a [u8]>) -> PyResult<Column<'a>> {
        let values = match &self.values {
            Array::Long(values) => Values::Long(values.as_slice()?),
            Array::Int(values) => Values::Int(values.as_slice()?),
            Array::Short(values) if self.is_few => Values::FewShort(values.as_slice()?),
            Array::Short(values) => Values::Short(values.as_slice()?),
            Array::Byte(values) => Values::FewByte(values.as_slice()?),
            Array::Code(values) => Values::Name(values.as_slice()?, &self.names),
        };
        Ok(Column {
            values,
            missing,
            is_key: self.is_key,
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
