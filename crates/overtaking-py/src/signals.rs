//! Signals of a recording: of the ego, and of the vehicle that it overtakes.

use std::ops::Range;

use numpy::{
    PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray1, PyUntypedArrayMethods,
};
use overtaking_core::signals::{
    self as core, Along, Bodies, Instants, LeftLane, Neighbours, Recording, Signals, Surroundings,
    Target, Targets,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::Numbers;
use crate::arrays::{PLACES, expect_length, expect_targets, output, rows};

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
        expect_targets(self.target.as_slice()?, slots)?;
        let cells = simulations * frames;
        expect_length("lateral", self.lateral.len(), cells)?;
        expect_length("right_reach", self.right_reach.len(), cells)?;
        expect_length("left_reach", self.left_reach.len(), cells)
    }

    fn targets(&self) -> PyResult<Targets<'_>> {
        Ok(Targets {
            vehicle: self.target.as_slice()?,
            lateral: self.lateral.as_slice()?,
            right_reach: self.right_reach.as_slice()?,
            left_reach: self.left_reach.as_slice()?,
        })
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
    let run =
        |out: Signals<'_>| py.detach(|| core::signals(&recording, &given, frames, level, out));
    let done = with_signals!(
        Signals, outputs, simulations * frames, run,
        lane: u8, lateral: f32, lateral_speed: f32, speed: f32, accel: f32, right_reach: f32, left_reach: f32,
        vehicle: u8, friction: f32, sight_lit: f32, sight_unlit: f32,
    );
    done.map_err(PyValueError::new_err)
}

/// Work out the gaps to neighbours, slots by (simulation, place, frame), and fill the arrays of `outputs`.
#[pyfunction]
#[pyo3(signature = (*, states, vehicles, vehicle, outputs, level=None))]
pub fn neighbours(
    py: Python<'_>,
    states: States<'_>,
    vehicles: Vehicles<'_>,
    vehicle: PyReadonlyArray1<'_, u8>,
    outputs: &Bound<'_, PyDict>,
    level: Option<&str>,
) -> PyResult<()> {
    let (simulations, slots, frames) = states.check()?;
    vehicles.check(simulations, slots)?;
    expect_length("vehicle", vehicle.len(), PLACES * simulations * frames)?;
    let recording = states.recording(&vehicles, slots)?;
    let (bodies, vehicle) = (vehicles.bodies()?, vehicle.as_slice()?);
    let run = |out: Neighbours<'_>| {
        py.detach(|| core::neighbours(&recording, &bodies, vehicle, frames, level, out))
    };
    let done = with_signals!(
        Neighbours, outputs, simulations * frames, run,
        gap: f32, closing_speed: f32, lateral_gap: f32,
    );
    done.map_err(PyValueError::new_err)
}

/// Recorded states that say how far and how fast others are, and who is around the ego.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Near<'py> {
    s: PyReadonlyArray3<'py, i32>,
    speed: PyReadonlyArray3<'py, i32>,
    length: PyReadonlyArray2<'py, f32>,
    vehicle: PyReadonlyArray3<'py, u8>,
}

impl Near<'_> {
    /// A vehicle at one frame, if it was recorded.
    fn along(&self, simulation: usize, slot: usize, frame: usize) -> Option<Along> {
        let place = [simulation, slot, frame];
        Some(Along {
            s: *self.s.get(place)?,
            speed: *self.speed.get(place)?,
            half_length: self.length.get([simulation, slot])? * 0.5,
        })
    }

    /// Slot of a neighbour, gap and closing speed; 0 where there is nobody.
    fn at(&self, simulation: usize, place: usize, frame: usize) -> Option<(u8, f32, f32)> {
        let vehicle = *self.vehicle.get([simulation, place, frame])?;
        if vehicle == u8::MAX {
            return Some((vehicle, 0.0, 0.0));
        }
        let own = self.along(simulation, 0, frame)?;
        let other = self.along(simulation, usize::from(vehicle), frame)?;
        let (gap, closing) = core::neighbour_at(own, other, place.is_multiple_of(2));
        Some((vehicle, gap, closing))
    }
}

/// Where neighbours at single frames go.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct NearArrays<'py> {
    vehicle: PyReadwriteArray1<'py, u8>,
    gap: PyReadwriteArray1<'py, f32>,
    closing_speed: PyReadwriteArray1<'py, f32>,
}

/// Neighbours at single frames, in a place each; fills the arrays of `out`.
#[pyfunction]
#[pyo3(signature = (*, near, rows, places, frames, out))]
pub fn neighbours_at(
    near: Near<'_>,
    rows: PyReadonlyArray1<'_, i64>,
    places: PyReadonlyArray1<'_, i64>,
    frames: PyReadonlyArray1<'_, i64>,
    mut out: NearArrays<'_>,
) -> PyResult<()> {
    let count = rows.len();
    expect_length("places", places.len(), count)?;
    expect_length("frames", frames.len(), count)?;
    expect_length("out", out.vehicle.len(), count)?;
    expect_length("out", out.gap.len(), count)?;
    expect_length("out", out.closing_speed.len(), count)?;
    let (vehicle, gap) = (out.vehicle.as_slice_mut()?, out.gap.as_slice_mut()?);
    let closing = out.closing_speed.as_slice_mut()?;
    let instants = rows.as_slice()?.iter().zip(places.as_slice()?);
    for (i, ((&row, &place), &frame)) in instants.zip(frames.as_slice()?).enumerate() {
        let index = |each: i64| usize::try_from(each).ok();
        let found = index(row).zip(index(place)).zip(index(frame));
        let found = found.and_then(|((row, place), frame)| near.at(row, place, frame));
        (vehicle[i], gap[i], closing[i]) =
            found.ok_or_else(|| PyValueError::new_err("instants: expected recorded frames"))?;
    }
    Ok(())
}

/// Work out who is in the lane to the left, and fill the arrays of `outputs`.
#[pyfunction]
#[pyo3(signature = (*, states, vehicles, num_lanes, outputs, level=None))]
pub fn left_lane(
    py: Python<'_>,
    states: States<'_>,
    vehicles: Vehicles<'_>,
    num_lanes: usize,
    outputs: &Bound<'_, PyDict>,
    level: Option<&str>,
) -> PyResult<()> {
    let (simulations, slots, frames) = states.check()?;
    vehicles.check(simulations, slots)?;
    let (recording, bodies) = (states.recording(&vehicles, slots)?, vehicles.bodies()?);
    let run = |out: LeftLane<'_>| {
        py.detach(|| core::left_lane(&recording, &bodies, num_lanes, frames, level, out))
    };
    let done = with_signals!(
        LeftLane, outputs, simulations * frames, run, left_occupancy: f32, left_count: u8,
    );
    done.map_err(PyValueError::new_err)
}

/// What is asked of targets in some frames of each simulation, one after the other.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct InstantArrays<'py> {
    overlaps: PyReadwriteArray1<'py, bool>,
    lane: PyReadwriteArray1<'py, u8>,
    lateral_gap: PyReadwriteArray1<'py, f32>,
    accel: PyReadwriteArray1<'py, f32>,
}

impl InstantArrays<'_> {
    fn instants(&mut self, count: usize) -> PyResult<Instants<'_>> {
        expect_length("overlaps", self.overlaps.len(), count)?;
        expect_length("lane", self.lane.len(), count)?;
        expect_length("lateral_gap", self.lateral_gap.len(), count)?;
        expect_length("accel", self.accel.len(), count)?;
        Ok(Instants {
            overlaps: self.overlaps.as_slice_mut()?,
            lane: self.lane.as_slice_mut()?,
            lateral_gap: self.lateral_gap.as_slice_mut()?,
            accel: self.accel.as_slice_mut()?,
        })
    }
}

/// The frames from `start` to `stop` of each simulation, both within, where they are recorded ones.
fn frames_of(start: &[i32], stop: &[i32], num_frames: &[i32]) -> PyResult<Vec<Range<usize>>> {
    let each = start.iter().zip(stop).zip(num_frames);
    each.map(|((&start, &stop), &recorded)| {
        if stop < start {
            return Ok(0..0);
        }
        if start < 0 || stop >= recorded {
            return Err(PyValueError::new_err("span: expected recorded frames"));
        }
        Ok(start as usize..stop as usize + 1)
    })
    .collect()
}

/// Work out what the signals of targets say of some frames of each simulation, and fill the arrays of `out`.
#[pyfunction]
#[pyo3(signature = (*, states, vehicles, own, start, stop, out, level=None))]
#[allow(clippy::too_many_arguments)]
pub fn alongside(
    py: Python<'_>,
    states: States<'_>,
    vehicles: Vehicles<'_>,
    own: Own<'_>,
    start: PyReadonlyArray1<'_, i32>,
    stop: PyReadonlyArray1<'_, i32>,
    mut out: InstantArrays<'_>,
    level: Option<&str>,
) -> PyResult<()> {
    let (simulations, slots, frames) = states.check()?;
    vehicles.check(simulations, slots)?;
    own.check(simulations, slots, frames)?;
    expect_length("start", start.len(), simulations)?;
    expect_length("stop", stop.len(), simulations)?;
    let recorded = vehicles.num_frames.as_slice()?;
    expect_length(
        "num_frames",
        recorded
            .iter()
            .filter(|&&each| each as usize > frames)
            .count(),
        0,
    )?;
    let spans = frames_of(start.as_slice()?, stop.as_slice()?, recorded)?;
    let count = spans.iter().map(Range::len).sum();
    let (recording, bodies) = (states.recording(&vehicles, slots)?, vehicles.bodies()?);
    let (targets, out) = (own.targets()?, out.instants(count)?);
    let done =
        py.detach(|| core::alongside(&recording, &bodies, &targets, &spans, frames, level, out));
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
    let targets = own.targets()?;
    let run = |out: Target<'_>| {
        py.detach(|| core::target(&recording, &bodies, &targets, frames, level, out))
    };
    let done = with_signals!(
        Target, outputs, simulations * frames, run,
        valid: bool, lead: f32, overlaps: bool, gap: f32, lateral: f32, lateral_gap: f32, lane: u8,
        speed: f32, accel: f32, lateral_speed: f32,
    );
    done.map_err(PyValueError::new_err)
}
