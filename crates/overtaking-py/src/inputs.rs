//! Recordings and signals (time series of the ego) of Python as the slices that `overtaking_labels` reads, with checks
//! of their shapes.

use numpy::{
    Element, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArrayDyn,
    PyUntypedArrayMethods, ndarray::Axis,
};
use overtaking_labels::{MAX_LANES, NO_VEHICLE, PackedRecording, SignalViews, with_signal_views};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::spread::reserve;

pub type Ints<'py> = PyReadonlyArray1<'py, i32>;
pub type Floats<'py> = PyReadonlyArray1<'py, f32>;
pub type Bytes<'py> = PyReadonlyArray1<'py, u8>;

/// Reject an array of another length.
pub fn expect_length(name: &str, length: usize, expected_length: usize) -> PyResult<()> {
    if length == expected_length {
        return Ok(());
    }
    Err(PyValueError::new_err(format!(
        "{name}: expected {expected_length} numbers, got {length}"
    )))
}

/// Borrow a writable array of the expected length from the dictionary of outputs.
pub fn borrow_output<'py, T: Element>(
    arrays: &Bound<'py, PyDict>,
    name: &str,
    length: usize,
) -> PyResult<PyReadwriteArrayDyn<'py, T>> {
    let value = arrays
        .get_item(name)?
        .ok_or_else(|| PyKeyError::new_err(name.to_owned()))?;
    let array: PyReadwriteArrayDyn<'py, T> = value.extract()?;
    expect_length(name, array.len(), length)?;
    Ok(array)
}

/// The frames of each simulation and vehicle of an array (simulation, vehicle, time).
pub fn rows<'a, T: Element>(array: &'a PyReadonlyArray3<'_, T>) -> PyResult<Vec<&'a [T]>> {
    let (simulations, vehicles) = (array.shape()[0], array.shape()[1]);
    // The fast way for one contiguous block; `chunks_exact` takes no length of 0.
    if let (Ok(whole), frames @ 1..) = (array.as_slice(), array.shape()[2]) {
        let mut rows = reserve(simulations * vehicles)?;
        rows.extend(whole.chunks_exact(frames));
        return Ok(rows);
    }
    let view = array.as_array();
    let mut rows = reserve(simulations * vehicles)?;
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
pub fn simulation_rows<'a, T: Element>(
    array: &'a PyReadonlyArray2<'_, T>,
) -> PyResult<Vec<&'a [T]>> {
    let view = array.as_array();
    let row = |simulation| {
        let row = view.index_axis_move(Axis(0), simulation);
        row.to_slice().ok_or_else(|| {
            PyValueError::new_err("states: expected the frames of a vehicle side by side")
        })
    };
    (0..array.shape()[0]).map(row).collect()
}

/// A batch of recordings: states (simulation, vehicle, time), vehicles (simulation, vehicle) flat, and numbers.
/// `PackedRecording` describes the fields.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct RecordingArrays<'py> {
    pub s: PyReadonlyArray3<'py, i32>,
    d: PyReadonlyArray3<'py, i32>,
    pub speed: PyReadonlyArray3<'py, i32>,
    heading: PyReadonlyArray3<'py, i16>,
    pub accel: PyReadonlyArray3<'py, i16>,
    lane: PyReadonlyArray3<'py, u8>,
    is_recorded: Option<PyReadonlyArray3<'py, bool>>,
    collided_with: PyReadonlyArray2<'py, u8>,
    num_frames: Ints<'py>,
    valid: PyReadonlyArray1<'py, bool>,
    pub length: Floats<'py>,
    width: Floats<'py>,
    num_lanes: usize,
    overtaking_sign: f32,
    direction: f32,
    interval_ms: i32,
    half_window: usize,
}

impl RecordingArrays<'_> {
    /// Numbers of simulations, vehicle slots and frames.
    ///
    /// # Errors
    /// `ValueError`: The arrays have different shapes, or the number of lanes is out of range.
    pub fn shape(&self) -> PyResult<[usize; 3]> {
        let states = [
            self.d.shape(),
            self.speed.shape(),
            self.heading.shape(),
            self.accel.shape(),
            self.lane.shape(),
        ];
        let shape = self.s.shape();
        let is_recorded = self
            .is_recorded
            .as_ref()
            .map_or(shape, |array| array.shape());
        let &[simulations, slots, frames] = shape else {
            return Err(PyValueError::new_err("states: expected three axes"));
        };
        let have_one_shape =
            states.iter().all(|state_shape| *state_shape == shape) && is_recorded == shape;
        if !have_one_shape || slots == 0 || self.collided_with.shape() != [simulations, frames] {
            return Err(PyValueError::new_err(
                "states: expected arrays of one shape",
            ));
        }
        expect_length("num_frames", self.num_frames.len(), simulations)?;
        expect_length("length", self.length.len(), simulations * slots)?;
        expect_length("width", self.width.len(), simulations * slots)?;
        expect_length("valid", self.valid.len(), simulations * slots)?;
        // An error unless the number is in the range 1 to `MAX_LANES`.
        expect_length("lanes", self.num_lanes.clamp(1, MAX_LANES), self.num_lanes)?;
        Ok([simulations, slots, frames])
    }

    /// The recording as slices.
    pub fn packed_recording(&self) -> PyResult<PackedRecording<'_>> {
        let [_, num_slots, max_frames] = self.shape()?;
        Ok(PackedRecording {
            num_frames: self.num_frames.as_slice()?,
            num_slots,
            max_frames,
            s: rows(&self.s)?,
            d: rows(&self.d)?,
            speed: rows(&self.speed)?,
            heading: rows(&self.heading)?,
            accel: rows(&self.accel)?,
            lane: rows(&self.lane)?,
            collided_with: simulation_rows(&self.collided_with)?,
            is_recorded: self.is_recorded.as_ref().map(rows).transpose()?,
            valid: self.valid.as_slice()?,
            length: self.length.as_slice()?,
            width: self.width.as_slice()?,
            num_lanes: self.num_lanes,
            overtaking_sign: self.overtaking_sign,
            direction: self.direction,
            interval_ms: self.interval_ms,
            half_window: self.half_window,
        })
    }
}

macro_rules! signal_arrays {
    ($($field:ident: $kind:ty, $rows:expr;)*) => {
        /// Signals of the ego, flat (simulation, time), and its neighbours, flat (simulation, role, time).
        #[derive(FromPyObject)]
        #[pyo3(from_item_all)]
        pub struct SignalArrays<'py> {
            $($field: PyReadonlyArray1<'py, $kind>,)*
        }

        impl SignalArrays<'_> {
            /// The signals as slices, for scans that do not read neighbours. The slots of neighbours are not checked,
            /// because the check would take as long as such a scan.
            pub fn views_without_neighbours(
                &self,
                recording: &PackedRecording<'_>,
            ) -> PyResult<SignalViews<'_>> {
                let cells = recording.num_frames.len() * recording.max_frames;
                $(expect_length(stringify!($field), self.$field.len(), $rows * cells)?;)*
                Ok(SignalViews { $($field: self.$field.as_slice()?,)* })
            }
        }
    };
}
with_signal_views! { signal_arrays! }

impl SignalArrays<'_> {
    /// The signals as slices, if they have the shape of a recording and their neighbours are vehicles of it.
    pub fn views(&self, recording: &PackedRecording<'_>) -> PyResult<SignalViews<'_>> {
        let signals = self.views_without_neighbours(recording)?;
        expect_slots(
            "neighbour_slot",
            signals.neighbour_slot,
            recording.num_slots,
        )?;
        Ok(signals)
    }
}

/// Reject slots that a recording does not have; `NO_VEHICLE` is allowed.
pub fn expect_slots(name: &str, slots: &[u8], num_slots: usize) -> PyResult<()> {
    // `NO_VEHICLE`, 255, wraps to 0. The compiler vectorizes the search for the largest byte. It does not vectorize the
    // search for the first invalid slot, which runs only for the message.
    let largest = slots
        .iter()
        .fold(0, |largest: u8, slot| largest.max(slot.wrapping_add(1)));
    if usize::from(largest) <= num_slots {
        return Ok(());
    }
    let is_missing = |slot: &&u8| **slot != NO_VEHICLE && usize::from(**slot) >= num_slots;
    let slot = slots.iter().find(is_missing).copied().unwrap_or(0);
    Err(PyValueError::new_err(format!("{name}: no vehicle {slot}")))
}
