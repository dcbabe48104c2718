//! Events of a recording.

use numpy::{
    PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray2, PyUntypedArrayMethods,
};
use overtaking_core::events::{Limits, NAMES, Watched};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{PLACES, expect_length, expect_slots, rows, rows_of_two};

/// What events are looked for in, beside the signals.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Recorded<'py> {
    num_frames: PyReadonlyArray1<'py, i32>,
    valid: PyReadonlyArray1<'py, bool>,
    length: PyReadonlyArray1<'py, f32>,
    least_advance: PyReadonlyArray1<'py, f32>,
    s: PyReadonlyArray3<'py, i32>,
    hit: PyReadonlyArray2<'py, u8>,
    present: Option<PyReadonlyArray3<'py, bool>>,
}

/// Signals of the ego, flat.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Seen<'py> {
    lane: PyReadonlyArray1<'py, u8>,
    lateral: PyReadonlyArray1<'py, f32>,
    lateral_speed: PyReadonlyArray1<'py, f32>,
    right_reach: PyReadonlyArray1<'py, f32>,
    left_reach: PyReadonlyArray1<'py, f32>,
    speed: PyReadonlyArray1<'py, f32>,
    vehicle: PyReadonlyArray1<'py, u8>,
}

/// What makes a movement one.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Numbers {
    borders: Vec<f32>,
    least_frames: usize,
    window: usize,
    least_speed: f32,
    least_shift: f32,
    settled_shift: f32,
    lanes_with_left: usize,
    over_line: f32,
    advance: usize,
    follow_up: usize,
    follow_time_gap: f32,
}

impl Recorded<'_> {
    /// Simulations, vehicles and frames, if all arrays have as many.
    fn check(&self) -> PyResult<(usize, usize, usize)> {
        let shape = self.s.shape();
        let (simulations, slots, frames) = (shape[0], shape[1], shape[2]);
        let present = self.present.as_ref().map_or(shape, |each| each.shape());
        if slots == 0 || present != shape || self.hit.shape() != [simulations, frames] {
            return Err(PyValueError::new_err(
                "recorded: expected arrays of one shape",
            ));
        }
        expect_length("num_frames", self.num_frames.len(), simulations)?;
        expect_length("valid", self.valid.len(), simulations * slots)?;
        expect_length("length", self.length.len(), simulations * slots)?;
        expect_length("least_advance", self.least_advance.len(), simulations)?;
        Ok((simulations, slots, frames))
    }
}

impl Seen<'_> {
    fn check(&self, simulations: usize, slots: usize, frames: usize) -> PyResult<()> {
        let cells = simulations * frames;
        let each = [
            ("lane", self.lane.len(), cells),
            ("lateral", self.lateral.len(), cells),
            ("lateral_speed", self.lateral_speed.len(), cells),
            ("right_reach", self.right_reach.len(), cells),
            ("left_reach", self.left_reach.len(), cells),
            ("speed", self.speed.len(), cells),
            ("vehicle", self.vehicle.len(), PLACES * cells),
        ];
        for (name, length, expected) in each {
            expect_length(name, length, expected)?;
        }
        expect_slots(self.vehicle.as_slice()?, &[0], frames, slots)
    }
}

impl Numbers {
    fn limits(self) -> PyResult<Limits> {
        if self.borders.len() < 2 {
            return Err(PyValueError::new_err("borders: expected two or more"));
        }
        Ok(Limits {
            borders: self.borders,
            least_frames: self.least_frames,
            window: self.window,
            least_speed: self.least_speed,
            least_shift: self.least_shift,
            settled_shift: self.settled_shift,
            lanes_with_left: self.lanes_with_left,
            over_line: self.over_line,
            advance: self.advance,
            follow_up: self.follow_up,
            follow_time_gap: self.follow_time_gap,
        })
    }
}

/// Find the events of a recording: a row of `out` for each of `event_fields`.
#[pyfunction]
#[pyo3(signature = (*, recorded, seen, limits, out))]
pub fn events(
    py: Python<'_>,
    recorded: Recorded<'_>,
    seen: Seen<'_>,
    limits: Numbers,
    mut out: PyReadwriteArray2<'_, i32>,
) -> PyResult<()> {
    let (simulations, slots, frames) = recorded.check()?;
    seen.check(simulations, slots, frames)?;
    expect_length("out", out.len(), NAMES.len() * simulations)?;
    let limits = limits.limits()?;
    let watched = Watched {
        num_frames: recorded.num_frames.as_slice()?,
        slots,
        frames,
        s: rows(&recorded.s)?,
        hit: rows_of_two(&recorded.hit)?,
        present: recorded.present.as_ref().map(rows).transpose()?,
        valid: recorded.valid.as_slice()?,
        length: recorded.length.as_slice()?,
        least_advance: recorded.least_advance.as_slice()?,
        lane: seen.lane.as_slice()?,
        lateral: seen.lateral.as_slice()?,
        lateral_speed: seen.lateral_speed.as_slice()?,
        right_reach: seen.right_reach.as_slice()?,
        left_reach: seen.left_reach.as_slice()?,
        speed: seen.speed.as_slice()?,
        vehicle: seen.vehicle.as_slice()?,
    };
    let out = out.as_slice_mut()?;
    py.detach(|| overtaking_core::events::events(&watched, &limits, out));
    Ok(())
}

/// Names of the rows of events, in order.
#[pyfunction]
pub fn event_fields() -> Vec<&'static str> {
    NAMES.to_vec()
}
