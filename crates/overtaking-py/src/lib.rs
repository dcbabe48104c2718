//! Thin Python binding of `overtaking-core`: arrays in, arrays filled in place; and of `overtaking-tables`.

mod driven;
mod tables;

use numpy::{
    Element, PyReadonlyArray1, PyReadonlyArray3, PyReadwriteArrayDyn, PyUntypedArrayMethods,
    ndarray,
};
use overtaking_core::signals::{Recording, Signals, Surroundings};
use overtaking_core::{
    Constants, Inputs, Later, MAX_PERCEPTS, MAX_VEHICLES, Output, SIMULATION_NAMES, VEHICLE_NAMES,
};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The road of a batch, lateral axis towards the fast side.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Road {
    num_lanes: usize,
    boundaries: [f32; 9],
    film_path: [f32; 8],
    side: f32,
    pose: [f32; 5],
}

/// The constants of the model.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Numbers {
    values: Vec<f32>,
    friction_new: [[f32; 4]; 3],
    friction_worn: [[f32; 4]; 3],
    friction_speeds: [f32; 3],
    friction_films: [f32; 4],
}

impl Numbers {
    fn constants(&self) -> PyResult<Constants> {
        expect_length("constants", self.values.len(), Constants::NAMES.len())?;
        let mut constants = Constants::default();
        constants.set(&self.values);
        constants.friction_new = self.friction_new;
        constants.friction_worn = self.friction_worn;
        constants.friction_speeds = self.friction_speeds;
        constants.friction_films = self.friction_films;
        Ok(constants)
    }
}

fn expect_length(what: &str, got: usize, expected: usize) -> PyResult<()> {
    if got == expected {
        return Ok(());
    }
    Err(PyValueError::new_err(format!(
        "{what}: expected {expected} numbers, got {got}"
    )))
}

/// A writable array out of the dictionary of outputs, of the expected length.
fn output<'py, T: Element>(
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

/// Borrow every output array, call `$body` with an `Output` over them.
macro_rules! with_outputs {
    ($arrays:expr, $batch:expr, $slots:expr, $frames:expr, $body:expr, $($field:ident: $kind:ty),* $(,)?) => {{
        let sizes: std::collections::HashMap<_, _> = Output::sizes($batch, $slots, $frames).into_iter().collect();
        $(let mut $field = output::<$kind>($arrays, stringify!($field), sizes[stringify!($field)])?;)*
        let out = Output {
            $($field: $field.as_slice_mut()?,)*
            frames: $frames,
            slots: $slots,
        };
        $body(out)
    }};
}

/// Simulate a batch and fill the arrays of `outputs`, a dictionary by field.
#[pyfunction]
#[pyo3(signature = (*, vehicle, simulation, index, slots, frames, seed, record_every, road, constants, outputs, later=None, level=None))]
#[allow(clippy::too_many_arguments)]
fn simulate(
    py: Python<'_>,
    vehicle: PyReadonlyArray1<'_, f32>,
    simulation: PyReadonlyArray1<'_, f32>,
    index: PyReadonlyArray1<'_, u64>,
    slots: usize,
    frames: usize,
    seed: u64,
    record_every: u32,
    road: Road,
    constants: Numbers,
    outputs: &Bound<'_, PyDict>,
    later: Option<(PyReadonlyArray1<'_, f32>, PyReadonlyArray1<'_, f32>, u32)>,
    level: Option<&str>,
) -> PyResult<()> {
    let (vehicle, simulation, index) = (
        vehicle.as_slice()?,
        simulation.as_slice()?,
        index.as_slice()?,
    );
    let batch = index.len();
    if slots == 0 || slots > MAX_VEHICLES || record_every == 0 {
        return Err(PyValueError::new_err(format!(
            "slots: expected 1 to {MAX_VEHICLES}, got {slots}"
        )));
    }
    expect_length(
        "vehicle",
        vehicle.len(),
        VEHICLE_NAMES.len() * slots * batch,
    )?;
    expect_length(
        "simulation",
        simulation.len(),
        SIMULATION_NAMES.len() * batch,
    )?;
    let constants = constants.constants()?;
    let later = match &later {
        Some((vehicle, simulation, switch)) => Some(Later {
            vehicle: vehicle.as_slice()?,
            simulation: simulation.as_slice()?,
            switch: *switch,
        }),
        None => None,
    };
    if let Some(later) = &later {
        expect_length("later vehicle", later.vehicle.len(), vehicle.len())?;
        expect_length("later simulation", later.simulation.len(), simulation.len())?;
    }
    let inputs = Inputs {
        vehicle,
        simulation,
        index,
        slots,
        constants: &constants,
        num_lanes: road.num_lanes.clamp(1, 8),
        boundaries: road.boundaries,
        film_path: road.film_path,
        side: road.side,
        pose: road.pose,
        seed,
        record_every,
    };
    let run = |out: Output<'_>| {
        py.detach(|| overtaking_core::simulate(&inputs, later.as_ref(), level, out))
    };
    let done = with_outputs!(
        outputs, batch, slots, frames, run,
        num_frames: i32, x: i32, y: i32, s: i32, d: i32, speed: i32, heading: i16, wheel_angle: i16,
        accel_lon: i16, accel_lat: i16, yaw_rate: i16, lane: u8, lights: u8, stage: u8, collided_with: u8,
        contact_partner: u8, contact_time: i32, contact_impulse: i32, contact_speed: i32,
        percept_valid: u8, percept_kind: u8, percept_time: i32, percept_vehicle: u8, percept_detected: u8,
        percept_gap: i32, percept_closing_speed: i32, percept_true_gap: i32,
        percept_true_closing_speed: i32, trace_hash: u32,
    );
    done.map_err(PyValueError::new_err)
}

/// The frames of each simulation and vehicle of an array (simulation, vehicle, time).
fn rows<'a, T: Element>(array: &'a PyReadonlyArray3<'_, T>) -> PyResult<Vec<&'a [T]>> {
    let (simulations, vehicles) = (array.shape()[0], array.shape()[1]);
    let view = array.as_array();
    let mut rows = Vec::with_capacity(simulations * vehicles);
    for simulation in 0..simulations {
        for vehicle in 0..vehicles {
            let row = view.slice_move(ndarray::s![simulation, vehicle, ..]);
            let row = row.to_slice().ok_or_else(|| {
                PyValueError::new_err("states: expected the frames of a vehicle side by side")
            })?;
            rows.push(row);
        }
    }
    Ok(rows)
}

/// Recorded states, shape (simulation, vehicle, time).
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct States<'py> {
    s: PyReadonlyArray3<'py, i32>,
    d: PyReadonlyArray3<'py, i32>,
    speed: PyReadonlyArray3<'py, i32>,
    heading: PyReadonlyArray3<'py, i16>,
    accel: PyReadonlyArray3<'py, i16>,
    lane: PyReadonlyArray3<'py, u8>,
    present: Option<PyReadonlyArray3<'py, bool>>,
}

impl States<'_> {
    fn check(&self) -> PyResult<()> {
        let shape = self.s.shape();
        let present = self.present.as_ref().map_or(shape, |each| each.shape());
        let others = [self.d.shape(), self.speed.shape(), self.heading.shape()];
        let same = others.iter().all(|each| *each == shape)
            && self.accel.shape() == shape
            && self.lane.shape() == shape
            && present == shape;
        if same && shape[1] > 0 {
            return Ok(());
        }
        Err(PyValueError::new_err(
            "states: expected arrays of one shape",
        ))
    }
}

/// What signals need beside the states.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Around<'py> {
    num_frames: PyReadonlyArray1<'py, i32>,
    valid: PyReadonlyArray1<'py, bool>,
    length: PyReadonlyArray1<'py, f32>,
    width: PyReadonlyArray1<'py, f32>,
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
    side: f32,
    heading: f32,
    num_lanes: usize,
    interval_ms: i32,
    half_window: usize,
}

impl Around<'_> {
    fn check(&self, simulations: usize, slots: usize) -> PyResult<()> {
        let each = [
            ("wear", self.wear.len()),
            ("truck", self.truck.len()),
            ("fog", self.fog.len()),
            ("rain", self.rain.len()),
            ("contrast_depth", self.contrast_depth.len()),
            ("lamp_depth", self.lamp_depth.len()),
            ("lamp_clear", self.lamp_clear.len()),
            ("unlit_limit", self.unlit_limit.len()),
            ("num_frames", self.num_frames.len()),
        ];
        for (name, length) in each {
            expect_length(name, length, simulations)?;
        }
        for (name, length) in [("length", self.length.len()), ("width", self.width.len())] {
            expect_length(name, length, simulations * slots)?;
        }
        expect_length("valid", self.valid.len(), simulations * slots)?;
        expect_length("film", self.film.len(), simulations * 8)?;
        expect_length("lanes", self.num_lanes.clamp(1, 8), self.num_lanes)
    }
}

/// Borrow every array of signals, call `$body` with a `Signals` over them.
macro_rules! with_signals {
    ($arrays:expr, $cells:expr, $body:expr, $($field:ident: $kind:ty),* $(,)?) => {{
        let rows: std::collections::HashMap<_, _> = Signals::ROWS.iter().copied().collect();
        $(let mut $field = output::<$kind>($arrays, stringify!($field), rows[stringify!($field)] * $cells)?;)*
        let out = Signals { $($field: $field.as_slice_mut()?,)* };
        $body(out)
    }};
}

/// Work out the signals of a recording and fill the arrays of `outputs`, a dictionary by field.
#[pyfunction]
#[pyo3(signature = (*, states, around, constants, outputs, level=None))]
fn signals(
    py: Python<'_>,
    states: States<'_>,
    around: Around<'_>,
    constants: Numbers,
    outputs: &Bound<'_, PyDict>,
    level: Option<&str>,
) -> PyResult<()> {
    states.check()?;
    let &[simulations, slots, frames] = states.s.shape() else {
        unreachable!("the arrays have three axes")
    };
    around.check(simulations, slots)?;
    let constants = constants.constants()?;
    let recording = Recording {
        num_frames: around.num_frames.as_slice()?,
        slots,
        s: rows(&states.s)?,
        d: rows(&states.d)?,
        speed: rows(&states.speed)?,
        heading: rows(&states.heading)?,
        accel: rows(&states.accel)?,
        lane: rows(&states.lane)?,
        present: states.present.as_ref().map(rows).transpose()?,
    };
    let given = Surroundings {
        valid: around.valid.as_slice()?,
        length: around.length.as_slice()?,
        width: around.width.as_slice()?,
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
        side: around.side,
        heading: around.heading,
        interval_ms: around.interval_ms,
        half_window: around.half_window,
    };
    let run = |out: Signals<'_>| {
        py.detach(|| overtaking_core::signals::signals(&recording, &given, frames, level, out))
    };
    let done = with_signals!(
        outputs, simulations * frames, run,
        lane: u8, s: f32, lateral: f32, lateral_speed: f32, speed: f32, accel: f32, right_reach: f32,
        left_reach: f32, vehicle: u8, gap: f32, closing_speed: f32, lateral_gap: f32,
        left_occupancy: f32, left_count: u8, friction: f32, sight_lit: f32, sight_unlit: f32,
    );
    done.map_err(PyValueError::new_err)
}

/// Names of the vehicle parameters, in order.
#[pyfunction]
fn vehicle_fields() -> Vec<&'static str> {
    VEHICLE_NAMES.to_vec()
}

/// Names of the simulation parameters, in order.
#[pyfunction]
fn simulation_fields() -> Vec<&'static str> {
    SIMULATION_NAMES.to_vec()
}

/// Names of the constants, in order.
#[pyfunction]
fn constant_fields() -> Vec<&'static str> {
    Constants::NAMES.to_vec()
}

/// Every SIMD level that the engine has, and whether this CPU can run it.
#[pyfunction]
fn simd_levels() -> Vec<(&'static str, bool)> {
    overtaking_core::available_levels()
}

/// The SIMD level that is used when none is asked for.
#[pyfunction]
fn simd_level() -> &'static str {
    overtaking_core::current_level()
}

/// Threads of the pool that simulations are spread over.
#[pyfunction]
fn num_threads() -> usize {
    rayon::current_num_threads()
}

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("MAX_VEHICLES", MAX_VEHICLES)?;
    module.add("MAX_PERCEPTS", MAX_PERCEPTS)?;
    module.add("LANES", overtaking_core::LANES)?;
    module.add("VERSION", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(simulate, module)?)?;
    module.add_function(wrap_pyfunction!(signals, module)?)?;
    module.add_function(wrap_pyfunction!(driven::weather_driven, module)?)?;
    module.add_function(wrap_pyfunction!(driven::drive, module)?)?;
    module.add_function(wrap_pyfunction!(driven::moving_fields, module)?)?;
    module.add_function(wrap_pyfunction!(vehicle_fields, module)?)?;
    module.add_function(wrap_pyfunction!(simulation_fields, module)?)?;
    module.add_function(wrap_pyfunction!(constant_fields, module)?)?;
    module.add_function(wrap_pyfunction!(simd_levels, module)?)?;
    module.add_function(wrap_pyfunction!(simd_level, module)?)?;
    module.add_function(wrap_pyfunction!(num_threads, module)?)?;
    module.add_function(wrap_pyfunction!(tables::compact, module)?)?;
    module.add_class::<tables::ParquetFile>()?;
    module.add_class::<tables::Hash>()?;
    Ok(())
}
