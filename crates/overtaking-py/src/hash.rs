//! The hash of what a table holds.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

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
        let bytes = data.to_vec(py)?; // Others may change the array once Python's lock is released.
        py.detach(|| self.0.update(&bytes));
        Ok(())
    }

    /// The hash over all bytes so far, 64 hexadecimal digits.
    fn hexdigest(&self) -> String {
        self.0.finalize().to_hex().to_string()
    }
}
