//! Arrays as slices, refused where they have another shape.

use numpy::{
    Element, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArrayDyn, PyUntypedArrayMethods,
    ndarray::Axis,
};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::spread::reserved;

/// Refuse an array of another length.
pub fn expect_length(what: &str, got: usize, expected: usize) -> PyResult<()> {
    if got == expected {
        return Ok(());
    }
    Err(PyValueError::new_err(format!(
        "{what}: expected {expected} numbers, got {got}"
    )))
}

/// A writable array out of the dictionary of outputs, of the expected length.
pub fn output<'py, T: Element>(
    arrays: &Bound<'py, PyDict>,
    name: &str,
    length: usize,
) -> PyResult<PyReadwriteArrayDyn<'py, T>> {
    let found = arrays
        .get_item(name)?
        .ok_or_else(|| PyKeyError::new_err(name.to_owned()))?;
    let array: PyReadwriteArrayDyn<'py, T> = found.extract()?;
    expect_length(name, array.len(), length)?;
    Ok(array)
}

/// The frames of each simulation and vehicle of an array (simulation, vehicle, time).
pub fn rows<'a, T: Element>(array: &'a PyReadonlyArray3<'_, T>) -> PyResult<Vec<&'a [T]>> {
    let (simulations, vehicles) = (array.shape()[0], array.shape()[1]);
    if let (Ok(whole), frames @ 1..) = (array.as_slice(), array.shape()[2]) {
        let mut rows = reserved(simulations * vehicles)?;
        rows.extend(whole.chunks_exact(frames));
        return Ok(rows);
    }
    let view = array.as_array();
    let mut rows = reserved(simulations * vehicles)?;
    for simulation in view.into_outer_iter() {
        for row in simulation.into_outer_iter() {
            let row = row.to_slice().ok_or_else(|| {
                PyValueError::new_err("states: expected the frames of a vehicle side by side")
            })?;
            rows.push(row);
        }
    }
    Ok(rows)
}

/// The frames of each simulation of an array (simulation, time).
pub fn rows_of_two<'a, T: Element>(array: &'a PyReadonlyArray2<'_, T>) -> PyResult<Vec<&'a [T]>> {
    let view = array.as_array();
    let row = |simulation| {
        let row = view.index_axis_move(Axis(0), simulation);
        row.to_slice().ok_or_else(|| {
            PyValueError::new_err("states: expected the frames of a vehicle side by side")
        })
    };
    (0..array.shape()[0]).map(row).collect()
}
