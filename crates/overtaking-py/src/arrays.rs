//! Arrays as slices, refused where they have another shape.

use numpy::{
    Element, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArrayDyn, PyUntypedArrayMethods,
    ndarray::Axis,
};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Refuse an array of another length.
pub fn expect_length(what: &str, got: usize, expected: usize) -> PyResult<()> {
    if got == expected {
        return Ok(());
    }
    Err(PyValueError::new_err(format!(
        "{what}: expected {expected} numbers, got {got}"
    )))
}

/// Places around the ego in a row of neighbours.
pub const PLACES: usize = 6;

/// Refuse neighbours (simulation, place, frame) that are no slots of the recording, in some places.
pub fn expect_slots(
    vehicles: &[u8],
    places: &[usize],
    frames: usize,
    slots: usize,
) -> PyResult<()> {
    // Nobody, 255, becomes 0. The largest of bytes is found many at a time, the first that is wrong is not.
    let rows = vehicles.chunks_exact((PLACES * frames).max(1));
    let asked = rows.flat_map(|row| places.iter().map(|place| &row[place * frames..][..frames]));
    let largest = |row: &[u8]| {
        row.iter()
            .fold(0, |most: u8, slot| most.max(slot.wrapping_add(1)))
    };
    if usize::from(asked.map(largest).max().unwrap_or(0)) <= slots {
        return Ok(());
    }
    Err(PyValueError::new_err(
        "vehicle: expected slots of the recording",
    ))
}

/// Refuse targets that are no slots of the recording.
pub fn expect_targets(targets: &[u8], slots: usize) -> PyResult<()> {
    let missing = |slot: &&u8| **slot != u8::MAX && usize::from(**slot) >= slots;
    match targets.iter().find(missing) {
        Some(slot) => Err(PyValueError::new_err(format!("target: no vehicle {slot}"))),
        None => Ok(()),
    }
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
    let view = array.as_array();
    let mut rows = Vec::with_capacity(simulations * vehicles);
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
