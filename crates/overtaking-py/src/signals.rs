//! Signals of a recording: of the ego, and of the vehicle that it overtakes.

use numpy::{PyReadonlyArray1, PyReadonlyArray3, PyUntypedArrayMethods};
use overtaking_core::signals::{Bodies, Recording, Signals, Surroundings, Target, Targets};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::Numbers;
use crate::arrays::{expect_length, output, rows};

/// Recorded states, shape (simulation, vehicle, time).
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct States<'py> {
    s: PyReadonlyArray3<'py, i32>,
    d: PyReadonlyArray3<'py, i32>,
    speed: PyReadonlyArray3<'py, i32>,
    heading: PyReadonlyArray3<'py, i16>,
    accel: PyReadonlyArray3<'py, i16>,
    lane: PyReadonlyArray3<'py, u8>,
    present: Option<PyReadonlyArray3<'py, bool>>,
}

impl States<'_> {
    /// Simulations, vehicles and frames, if all arrays have as many.
    fn check(&self) -> PyResult<(usize, usize, usize)> {
        let shape = self.s.shape();
        let present = self.present.as_ref().map_or(shape, |each| each.shape());
        let others = [self.d.shape(), self.speed.shape(), self.heading.shape()];
        let same = others.iter().all(|each| *each == shape)
            && self.accel.shape() == shape
            && self.lane.shape() == shape
            && present == shape;
        match shape {
            &[simulations, slots, frames] if same && slots > 0 => Ok((simulations, slots, frames)),
            _ => Err(PyValueError::new_err(
                "states: expected arrays of one shape",
            )),
        }
    }

    fn recording<'a>(
        &'a self,
        vehicles: &'a Vehicles<'_>,
        slots: usize,
    ) -> PyResult<Recording<'a>> {
        Ok(Recording {
            num_frames: vehicles.num_frames.as_slice()?,
            slots,
            s: rows(&self.s)?,
            d: rows(&self.d)?,
            speed: rows(&self.speed)?,
            heading: rows(&self.heading)?,
            accel: rows(&self.accel)?,
            lane: rows(&self.lane)?,
            present: self.present.as_ref().map(rows).transpose()?,
        })
    }
}

/// The vehicles of a recording, and how road and clock measure them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Vehicles<'py> {
    num_frames: PyReadonlyArray1<'py, i32>,
    valid: PyReadonlyArray1<'py, bool>,
    length: PyReadonlyArray1<'py, f32>,
    width: PyReadonlyArray1<'py, f32>,
    side: f32,
    heading: f32,
    interval_ms: i32,
    half_window: usize,
}

impl Vehicles<'_> {
    fn check(&self, simulations: usize, slots: usize) -> PyResult<()> {
        expect_length("num_frames", self.num_frames.len(), simulations)?;
        expect_length("length", self.length.len(), simulations * slots)?;
        expect_length("width", self.width.len(), simulations * slots)?;
        expect_length("valid", self.valid.len(), simulations * slots)
    }

    fn bodies(&self) -> PyResult<Bodies<'_>> {
        Ok(Bodies {
            valid: self.valid.as_slice()?,
            length: self.length.as_slice()?,
            width: self.width.as_slice()?,
            side: self.side,
            heading: self.heading,
            interval_ms: self.interval_ms,
            half_window: self.half_window,
        })
    }
}

/// What signals need beside the states.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Around<'py> {
    film: PyReadonlyArray1<'py, f32>,
    wear: PyReadonlyArray1<'py, f32>,
    truck: PyReadonlyArray1<'py, f32>,
    fog: PyReadonlyArray1<'py, f32>,
    rain: PyReadonlyArray1<'py, f32>,
    contrast_depth: PyReadonlyArray1<'py, f32>,
    lamp_depth: PyReadonlyArray1<'py, f32>,
    lamp_clear: PyReadonlyArray1<'py, f32>,
    unlit_limit: PyReadonlyArray1<'py, f32>,
    attention: f32,
    num_lanes: usize,
}

impl Around<'_> {
    fn check(&self, simulations: usize) -> PyResult<()> {
        let each = [
            ("wear", self.wear.len()),
            ("truck", self.truck.len()),
            ("fog", self.fog.len()),
            ("rain", self.rain.len()),
            ("contrast_depth", self.contrast_depth.len()),
            ("lamp_depth", self.lamp_depth.len()),
            ("lamp_clear", self.lamp_clear.len()),
            ("unlit_limit", self.unlit_limit.len()),
        ];
        for (name, length) in each {
            expect_length(name, length, simulations)?;
        }
        expect_length("film", self.film.len(), simulations * 8)?;
        expect_length("lanes", self.num_lanes.clamp(1, 8), self.num_lanes)
    }
}

/// Where the ego is across the road, and whom it overtakes.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Own<'py> {
    target: PyReadonlyArray1<'py, u8>,
    lateral: PyReadonlyArray1<'py, f32>,
    right_reach: PyReadonlyArray1<'py, f32>,
    left_reach: PyReadonlyArray1<'py, f32>,
}

impl Own<'_> {
    fn check(&self, simulations: usize, slots: usize, frames: usize) -> PyResult<()> {
        expect_length("target", self.target.len(), simulations)?;
        for &slot in self.target.as_slice()? {
            if slot != u8::MAX && usize::from(slot) >= slots {
                return Err(PyValueError::new_err(format!("target: no vehicle {slot}")));
            }
        }
        let cells = simulations * frames;
        expect_length("lateral", self.lateral.len(), cells)?;
        expect_length("right_reach", self.right_reach.len(), cells)?;
        expect_length("left_reach", self.left_reach.len(), cells)
    }
}

/// Borrow every array of signals, call `$body` with a `Signals` or a `Target` over them.
macro_rules! with_signals {
    ($name:ident, $arrays:expr, $cells:expr, $body:expr, $($field:ident: $kind:ty),* $(,)?) => {{
        let rows: std::collections::HashMap<_, _> = $name::ROWS.iter().copied().collect();
        $(let mut $field = output::<$kind>($arrays, stringify!($field), rows[stringify!($field)] * $cells)?;)*
        let out = $name { $($field: $field.as_slice_mut()?,)* };
        $body(out)
    }};
}

/// Work out the signals of a recording and fill the arrays of `outputs`, a dictionary by field.
#[pyfunction]
#[pyo3(signature = (*, states, vehicles, around, constants, outputs, level=None))]
pub fn signals(
    py: Python<'_>,
    states: States<'_>,
    vehicles: Vehicles<'_>,
    around: Around<'_>,
    constants: Numbers,
    outputs: &Bound<'_, PyDict>,
    level: Option<&str>,
) -> PyResult<()> {
    let (simulations, slots, frames) = states.check()?;
    vehicles.check(simulations, slots)?;
    around.check(simulations)?;
    let constants = constants.constants()?;
    let recording = states.recording(&vehicles, slots)?;
    let given = Surroundings {
        bodies: vehicles.bodies()?,
        film: around.film.as_slice()?,
        wear: around.wear.as_slice()?,
        truck: around.truck.as_slice()?,
        fog: around.fog.as_slice()?,
        rain: around.rain.as_slice()?,
        contrast_depth: around.contrast_depth.as_slice()?,
        lamp_depth: around.lamp_depth.as_slice()?,
        lamp_clear: around.lamp_clear.as_slice()?,
        unlit_limit: around.unlit_limit.as_slice()?,
        attention: around.attention,
        constants: &constants,
        num_lanes: around.num_lanes,
    };
    let run = |out: Signals<'_>| {
        py.detach(|| overtaking_core::signals::signals(&recording, &given, frames, level, out))
    };
    let done = with_signals!(
        Signals, outputs, simulations * frames, run,
        lane: u8, s: f32, lateral: f32, lateral_speed: f32, speed: f32, accel: f32, right_reach: f32,
        left_reach: f32, vehicle: u8, gap: f32, closing_speed: f32, lateral_gap: f32,
        left_occupancy: f32, left_count: u8, friction: f32, sight_lit: f32, sight_unlit: f32,
    );
    done.map_err(PyValueError::new_err)
}

/// Work out the signals of the targets of a recording and fill the arrays of `outputs`.
#[pyfunction]
#[pyo3(signature = (*, states, vehicles, own, outputs, level=None))]
pub fn target(
    py: Python<'_>,
    states: States<'_>,
    vehicles: Vehicles<'_>,
    own: Own<'_>,
    outputs: &Bound<'_, PyDict>,
    level: Option<&str>,
) -> PyResult<()> {
    let (simulations, slots, frames) = states.check()?;
    vehicles.check(simulations, slots)?;
    own.check(simulations, slots, frames)?;
    let recording = states.recording(&vehicles, slots)?;
    let bodies = vehicles.bodies()?;
    let targets = Targets {
        vehicle: own.target.as_slice()?,
        lateral: own.lateral.as_slice()?,
        right_reach: own.right_reach.as_slice()?,
        left_reach: own.left_reach.as_slice()?,
    };
    let run = |out: Target<'_>| {
        py.detach(|| {
            overtaking_core::signals::target(&recording, &bodies, &targets, frames, level, out)
        })
    };
    let done = with_signals!(
        Target, outputs, simulations * frames, run,
        valid: bool, lead: f32, overlaps: bool, gap: f32, lateral: f32, lateral_gap: f32, lane: u8,
        speed: f32, accel: f32, lateral_speed: f32,
    );
    done.map_err(PyValueError::new_err)
}
