//! Measures at single frames.

use numpy::{
    PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray1, PyReadwriteArray2,
    PyUntypedArrayMethods,
};
use overtaking_core::stretches::{self as core, Announced, ENCOUNTERS, Encounters};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{PLACES, expect_length, expect_targets, rows, rows_of_two};
use crate::stretches::Neighbours;

/// Simulations, places around the ego, and frames.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Instants<'py> {
    rows: PyReadonlyArray1<'py, i64>,
    places: PyReadonlyArray1<'py, i64>,
    frames: PyReadonlyArray1<'py, i64>,
}

impl Instants<'_> {
    /// Each of them, if it is within a recording of this size.
    fn within(&self, simulations: usize, num_frames: usize) -> PyResult<Vec<[usize; 3]>> {
        expect_length("places", self.places.len(), self.rows.len())?;
        expect_length("frames", self.frames.len(), self.rows.len())?;
        let below = |each: i64, end: usize| usize::try_from(each).ok().filter(|&each| each < end);
        let pairs = self.rows.as_slice()?.iter().zip(self.places.as_slice()?);
        pairs
            .zip(self.frames.as_slice()?)
            .map(|((&row, &place), &frame)| {
                let row = below(row, simulations)?;
                Some([row, below(place, PLACES)?, below(frame, num_frames)?])
            })
            .collect::<Option<_>>()
            .ok_or_else(|| PyValueError::new_err("instants: expected recorded frames"))
    }
}

/// Encounters with neighbours at single frames: a row of `out` for each of `encounter_fields`.
#[pyfunction]
#[pyo3(signature = (*, around, accels, instants, is_ahead, vehicle, out, level=None))]
#[allow(clippy::too_many_arguments)]
pub fn encounters(
    around: Neighbours<'_>,
    accels: PyReadonlyArray3<'_, i16>,
    instants: Instants<'_>,
    is_ahead: bool,
    mut vehicle: PyReadwriteArray1<'_, u8>,
    mut out: PyReadwriteArray2<'_, f32>,
    level: Option<&str>,
) -> PyResult<()> {
    let &[simulations, slots, frames] = accels.shape() else {
        return Err(PyValueError::new_err("accels: expected three axes"));
    };
    let instants = instants.within(simulations, frames)?;
    expect_length("vehicle", vehicle.len(), instants.len())?;
    expect_length("out", out.len(), ENCOUNTERS.len() * instants.len())?;
    let given = Encounters {
        around: around.around(simulations, slots, frames, &[])?,
        accels: rows(&accels)?,
        frames,
        instants,
        is_ahead,
    };
    let who = |[row, place, frame]: &[usize; 3]| {
        given.around.vehicle[(row * PLACES + place) * frames + frame]
    };
    let each: Vec<u8> = given.instants.iter().map(who).collect();
    expect_targets(&each, slots)?;
    core::encounters(&given, level, vehicle.as_slice_mut()?, out.as_slice_mut()?)
        .map_err(PyValueError::new_err)
}

/// Names of the rows of `encounters`, in order.
#[pyfunction]
pub fn encounter_fields() -> Vec<&'static str> {
    ENCOUNTERS.to_vec()
}

/// Frames around a crossing without a lamp: rows of `out` for their number, the first and the last.
#[pyfunction]
#[pyo3(signature = (*, lights, crossed, first, last, before, after, bit, out))]
#[allow(clippy::too_many_arguments)]
pub fn dark(
    lights: PyReadonlyArray2<'_, u8>,
    crossed: PyReadonlyArray1<'_, i32>,
    first: PyReadonlyArray1<'_, i32>,
    last: PyReadonlyArray1<'_, i32>,
    before: u16,
    after: u16,
    bit: u8,
    mut out: PyReadwriteArray2<'_, i32>,
) -> PyResult<()> {
    let count = crossed.len();
    expect_length("lights", lights.shape()[0], count)?;
    expect_length("first", first.len(), count)?;
    expect_length("last", last.len(), count)?;
    expect_length("out", out.len(), 3 * count)?;
    let given = Announced {
        lights: rows_of_two(&lights)?,
        crossed: crossed.as_slice()?,
        first: first.as_slice()?,
        last: last.as_slice()?,
        before: i32::from(before),
        after: i32::from(after),
        bit,
    };
    expect_frames(given.crossed, lights.shape()[1])?;
    let out = out.as_slice_mut()?;
    for simulation in 0..count {
        for (row, value) in given.dark(simulation).into_iter().enumerate() {
            out[row * count + simulation] = value;
        }
    }
    Ok(())
}

/// Refuse frames that there is no room for; negative ones are none.
fn expect_frames(frames: &[i32], room: usize) -> PyResult<()> {
    let beyond = |frame: &&i32| usize::try_from(**frame).is_ok_and(|frame| frame >= room);
    match frames.iter().find(beyond) {
        Some(frame) => Err(PyValueError::new_err(format!("frames: no frame {frame}"))),
        None => Ok(()),
    }
}

/// A vehicle that comes to a place.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Coming<'py> {
    row: PyReadonlyArray1<'py, i64>,
    slot: PyReadonlyArray1<'py, i64>,
    begin: PyReadonlyArray1<'py, i32>,
    place: PyReadonlyArray1<'py, i32>,
    halves: PyReadonlyArray1<'py, f32>,
}

/// First frame, not before `begin`, in which each of some vehicles has come to a place, -1 without one.
#[pyfunction]
#[pyo3(signature = (*, s, present, num_frames, coming, out))]
pub fn arrivals(
    s: PyReadonlyArray3<'_, i32>,
    present: Option<PyReadonlyArray3<'_, bool>>,
    num_frames: PyReadonlyArray1<'_, i32>,
    coming: Coming<'_>,
    mut out: PyReadwriteArray1<'_, i32>,
) -> PyResult<()> {
    let shape = s.shape();
    let recorded = num_frames.as_slice()?;
    expect_length("num_frames", recorded.len(), shape[0])?;
    let count = coming.row.len();
    expect_length("slot", coming.slot.len(), count)?;
    expect_length("begin", coming.begin.len(), count)?;
    expect_length("place", coming.place.len(), count)?;
    expect_length("halves", coming.halves.len(), count)?;
    expect_length("out", out.len(), count)?;
    if present.as_ref().is_some_and(|each| each.shape() != shape) {
        return Err(PyValueError::new_err("present: expected the shape of s"));
    }
    let (rows_of_s, rows_of_present) = (rows(&s)?, present.as_ref().map(rows).transpose()?);
    let (row, slot) = (coming.row.as_slice()?, coming.slot.as_slice()?);
    let (begin, place) = (coming.begin.as_slice()?, coming.place.as_slice()?);
    let (halves, out) = (coming.halves.as_slice()?, out.as_slice_mut()?);
    for i in 0..count {
        let (row, slot) = (row[i].max(0) as usize, slot[i].max(0) as usize);
        if row >= shape[0] || slot >= shape[1] {
            return Err(PyValueError::new_err(format!("slot: no vehicle {slot}")));
        }
        let end = (recorded[row].max(0) as usize).min(shape[2]);
        let which = row * shape[1] + slot;
        let present = rows_of_present.as_ref().map(|rows| &rows[which][..end]);
        let begin = begin[i].max(0) as usize;
        out[i] = core::arrival(
            &rows_of_s[which][..end],
            present,
            begin,
            place[i],
            halves[i],
        );
    }
    Ok(())
}
