//! What labels are made of: signals and events of a recording, its targets, and answers about stretches of frames.

use numpy::{
    PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1, PyReadwriteArray2,
    PyUntypedArrayMethods,
};
use overtaking_core::events::{self as core_events, Limits};
use overtaking_core::signals::{
    self as core, Around, NO_VEHICLE, PLACES, Signals as Outputs, Surroundings, Target,
};
use overtaking_core::stretches::{
    self as core_stretches, Along, Answers, Asked, ENCOUNTERS, FRAMES, MOMENTS, Pair, SPANS, SUMS,
};
use overtaking_core::supported;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::Numbers;
use crate::arrays::{expect_length, output, rows_of_two};
use crate::recorded::{Floats, Ints, Octets, Recorded, Signals, expect_slots};
use crate::spread::{SIMULATION_BYTES, reserved, spread};

/// What signals need beside the states, of each simulation.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Conditions<'py> {
    film: Floats<'py>,
    wear: Floats<'py>,
    truck: Floats<'py>,
    fog: Floats<'py>,
    rain: Floats<'py>,
    contrast_depth: Floats<'py>,
    lamp_depth: Floats<'py>,
    lamp_clear: Floats<'py>,
    unlit_limit: Floats<'py>,
    attention: f32,
}

/// A Python class of numbers, and the struct of the core with the same fields.
macro_rules! numbers {
    ($(#[$about:meta])* $name:ident => $core:ident: $($field:ident: $kind:ty),* $(,)?) => {
        $(#[$about])*
        #[derive(FromPyObject)]
        #[pyo3(from_item_all)]
        pub struct $name {
            $($field: $kind,)*
        }

        impl $name {
            fn core(&self) -> core_stretches::$core {
                core_stretches::$core { $($field: self.$field,)* }
            }
        }
    };
}

numbers! {
    /// Numbers of the law and of the measures.
    LawNumbers => Numbers:
    floor: f32, usable: f32, decel_limit: f32, reaction_time: f32, stop_reaction_time: f32,
    regain: usize, time_gap: f32, free_time: f32, reach: f32,
    lasting: usize, allowed_braking: f32, most_braking: f32,
    picud_reaction_time: f32, picud_decel: f32,
    rss_reaction_time: f32, rss_accel: f32, rss_rear_decel: f32, rss_lead_decel: f32, critical_ttc: f32,
}

/// What makes a movement one, and where the lanes lie.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Thresholds<'py> {
    least_advance: Floats<'py>,
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
    direction: i32,
    spin_angle: i32,
}

impl Thresholds<'_> {
    fn limits(&self, simulations: usize) -> PyResult<Limits<'_>> {
        expect_length("least_advance", self.least_advance.len(), simulations)?;
        expect_length("borders", self.borders.len().max(2), self.borders.len())?;
        Ok(Limits {
            least_advance: self.least_advance.as_slice()?,
            borders: self.borders.clone(),
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
            direction: self.direction,
            spin_angle: self.spin_angle,
        })
    }
}

/// Borrow every array of outputs, call `$body` with a mutable `$name` over them.
macro_rules! with_outputs {
    ($name:ident, $arrays:expr, $cells:expr, |$out:ident| $body:expr, $($field:ident: $kind:ty),* $(,)?) => {{
        let rows: std::collections::HashMap<_, _> = $name::ROWS.iter().copied().collect();
        $(let mut $field = output::<$kind>($arrays, stringify!($field), rows[stringify!($field)] * $cells)?;)*
        let mut $out = $name { $($field: $field.as_slice_mut()?,)* };
        $body
    }};
}

/// Work out the signals and the events of recordings.
#[pyfunction]
#[pyo3(signature = (*, recorded, conditions, limits, constants, signals, filled, events, level=None))]
#[allow(clippy::too_many_arguments)]
pub fn watch(
    py: Python<'_>,
    recorded: Recorded<'_>,
    conditions: Conditions<'_>,
    limits: Thresholds<'_>,
    constants: Numbers,
    signals: &Bound<'_, PyDict>,
    mut filled: PyReadwriteArray1<'_, i32>,
    mut events: PyReadwriteArray2<'_, i32>,
    level: Option<&str>,
) -> PyResult<()> {
    let (recording, level) = (recorded.recording()?, supported(level).map_err(refused)?);
    let count = recording.num_frames.len();
    let of_each = |name: &str, values: &'_ Floats<'_>| expect_length(name, values.len(), count);
    of_each("wear", &conditions.wear)?;
    of_each("truck", &conditions.truck)?;
    of_each("fog", &conditions.fog)?;
    of_each("rain", &conditions.rain)?;
    of_each("contrast_depth", &conditions.contrast_depth)?;
    of_each("lamp_depth", &conditions.lamp_depth)?;
    of_each("lamp_clear", &conditions.lamp_clear)?;
    of_each("unlit_limit", &conditions.unlit_limit)?;
    expect_length("film", conditions.film.len(), count * 8)?;
    expect_length("filled", filled.len(), count)?;
    expect_length("events", events.len(), core_events::NAMES.len() * count)?;
    let (constants, limits) = (constants.constants()?, limits.limits(count)?);
    let given = Surroundings {
        film: conditions.film.as_slice()?,
        wear: conditions.wear.as_slice()?,
        truck: conditions.truck.as_slice()?,
        fog: conditions.fog.as_slice()?,
        rain: conditions.rain.as_slice()?,
        contrast_depth: conditions.contrast_depth.as_slice()?,
        lamp_depth: conditions.lamp_depth.as_slice()?,
        lamp_clear: conditions.lamp_clear.as_slice()?,
        unlit_limit: conditions.unlit_limit.as_slice()?,
        attention: conditions.attention,
        constants: &constants,
    };
    let (filled, events) = (filled.as_slice_mut()?, events.as_slice_mut()?);
    with_outputs!(
        Outputs, signals, count * recording.frames,
        |out| spread(py, count * SIMULATION_BYTES, || {
            core::signals(&recording, &given, level, &mut out, filled);
            core_events::events(&recording, &out.seen(), &limits, events);
        })?,
        lane: u8, lateral_position: f32, lateral_speed: f32, speed: f32, accel: f32, right_edge: f32, left_edge: f32,
        neighbour_slot: u8, friction: f32, sight_lit: f32, sight_unlit: f32,
    );
    Ok(())
}

fn refused(message: String) -> PyErr {
    PyValueError::new_err(message)
}

/// Names of the rows of events, in order.
#[pyfunction]
pub fn event_fields() -> Vec<&'static str> {
    core_events::NAMES.to_vec()
}

/// Work out gaps to the neighbours of the ego and the lane to its left.
#[pyfunction]
#[pyo3(signature = (*, recorded, vehicle, outputs, level=None))]
pub fn around(
    py: Python<'_>,
    recorded: Recorded<'_>,
    vehicle: Octets<'_>,
    outputs: &Bound<'_, PyDict>,
    level: Option<&str>,
) -> PyResult<()> {
    let (recording, level) = (recorded.recording()?, supported(level).map_err(refused)?);
    let (cells, vehicle) = (
        recording.num_frames.len() * recording.frames,
        vehicle.as_slice()?,
    );
    expect_length("vehicle", vehicle.len(), PLACES * cells)?;
    with_outputs!(
        Around, outputs, cells,
        |out| spread(py, cells / recording.frames.max(1) * SIMULATION_BYTES, || core::around(&recording, vehicle, level, &mut out))?,
        gap: f32, closing_speed: f32, lateral_gap: f32, left_occupancy: f32, left_count: u8,
    );
    Ok(())
}

/// Work out the signals of the vehicles that are overtaken.
#[pyfunction]
#[pyo3(signature = (*, recorded, seen, target, outputs, level=None))]
pub fn target(
    py: Python<'_>,
    recorded: Recorded<'_>,
    seen: Signals<'_>,
    target: Octets<'_>,
    outputs: &Bound<'_, PyDict>,
    level: Option<&str>,
) -> PyResult<()> {
    let (recording, level) = (recorded.recording()?, supported(level).map_err(refused)?);
    let (seen, target) = (seen.seen(&recording)?, target.as_slice()?);
    expect_length("target", target.len(), recording.num_frames.len())?;
    expect_slots("target", target, recording.slots)?;
    with_outputs!(
        Target, outputs, target.len() * recording.frames,
        |out| spread(py, target.len() * SIMULATION_BYTES, || core::target(&recording, &seen, target, level, &mut out))?,
        valid: bool, ego_lead: f32, overlaps: bool, gap: f32, lateral_position: f32, lateral_gap: f32, lane: u8,
        speed: f32, accel: f32, lateral_speed: f32,
    );
    Ok(())
}

/// Memory of the answer for a frame in which ego and target overlap, in vectors that double when they are full and
/// are joined in the end: three times 25 bytes, rounded up.
const ALONGSIDE_BYTES: usize = 96;

/// Arrays with a number for each frame in which ego and target overlap.
type Beside<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<u8>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<f32>>,
);

/// The frames within a stretch in which ego and target overlap along the road: simulation, frame, and lane, lateral gap
/// and acceleration of the target.
#[pyfunction]
#[pyo3(signature = (*, recorded, seen, target, span, level=None))]
pub fn alongside<'py>(
    py: Python<'py>,
    recorded: Recorded<'py>,
    seen: Signals<'py>,
    target: Octets<'py>,
    span: Ints<'py>,
    level: Option<&str>,
) -> PyResult<Beside<'py>> {
    let (recording, level) = (recorded.recording()?, supported(level).map_err(refused)?);
    let (seen, target) = (seen.seen_alone(&recording)?, target.as_slice()?);
    expect_length("target", target.len(), recording.num_frames.len())?;
    expect_length("span", span.len(), 2 * target.len())?;
    expect_slots("target", target, recording.slots)?;
    let span = span.as_slice()?;
    let (first, last) = span.split_at(target.len());
    let frames: usize = first
        .iter()
        .zip(last)
        .map(|(first, last)| (last - first.max(&0) + 1).clamp(0, recording.frames as i32) as usize)
        .sum();
    let found = spread(py, frames * ALONGSIDE_BYTES, || {
        core::alongside(&recording, &seen, target, span, level)
    })?;
    Ok((
        PyArray1::from_vec(py, found.simulation),
        PyArray1::from_vec(py, found.frame),
        PyArray1::from_vec(py, found.lane),
        PyArray1::from_vec(py, found.lateral_gap),
        PyArray1::from_vec(py, found.accel),
    ))
}

/// Where the answers about stretches go, (row, simulation).
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct AnswerArrays<'py> {
    measures: PyReadwriteArray2<'py, f32>,
    frames: PyReadwriteArray2<'py, i32>,
    sums: PyReadwriteArray2<'py, i64>,
}

/// Margins, measures and sums over stretches of frames of each simulation.
#[pyfunction]
#[pyo3(signature = (*, recorded, seen, spans, moments, numbers, out, level=None))]
#[allow(clippy::too_many_arguments)]
pub fn stretches(
    py: Python<'_>,
    recorded: Recorded<'_>,
    seen: Signals<'_>,
    spans: Ints<'_>,
    moments: Ints<'_>,
    numbers: LawNumbers,
    mut out: AnswerArrays<'_>,
    level: Option<&str>,
) -> PyResult<()> {
    let (recording, level) = (recorded.recording()?, supported(level).map_err(refused)?);
    let (seen, count) = (seen.seen(&recording)?, recording.num_frames.len());
    expect_length("spans", spans.len(), 2 * SPANS.len() * count)?;
    expect_length("moments", moments.len(), MOMENTS.len() * count)?;
    expect_length(
        "measures",
        out.measures.len(),
        core_stretches::measures().len() * count,
    )?;
    expect_length("frames", out.frames.len(), FRAMES.len() * count)?;
    expect_length("sums", out.sums.len(), SUMS.len() * count)?;
    let asked = Asked {
        spans: spans.as_slice()?,
        moments: moments.as_slice()?,
    };
    let (frames, slots) = asked.moments.split_at(2 * count);
    if let Some(frame) = frames.iter().find(|&&each| each >= recording.frames as i32) {
        return Err(PyValueError::new_err(format!("frames: no frame {frame}")));
    }
    let targets: Vec<u8> = slots[..count].iter().map(|&slot| slot as u8).collect();
    expect_slots("target", &targets, recording.slots)?;
    let (numbers, answers) = (
        numbers.core(),
        Answers {
            measures: out.measures.as_slice_mut()?,
            frames: out.frames.as_slice_mut()?,
            sums: out.sums.as_slice_mut()?,
        },
    );
    spread(py, count * SIMULATION_BYTES, || {
        core_stretches::stretches(&recording, &seen, &numbers, &asked, level, answers);
    })
}

/// What is asked of stretches, and the rows of the answers, by name of the array, in order.
#[pyfunction]
pub fn stretch_fields() -> [(&'static str, Vec<&'static str>); 5] {
    [
        ("spans", SPANS.to_vec()),
        ("moments", MOMENTS.to_vec()),
        ("measures", core_stretches::measures()),
        ("frames", FRAMES.to_vec()),
        ("sums", SUMS.to_vec()),
    ]
}

/// Margins of a signal (simulation, time) to a limit of each simulation, over a stretch of frames.
///
/// `low` gets the smallest of each simulation, the rows of `frames` the first and the last frame with a negative one, and
/// the longest run of them.
#[pyfunction]
#[pyo3(signature = (*, signal, span, limit, is_most, low, frames, level=None))]
#[allow(clippy::too_many_arguments)]
pub fn limited(
    py: Python<'_>,
    signal: PyReadonlyArray2<'_, f32>,
    span: Ints<'_>,
    limit: Floats<'_>,
    is_most: bool,
    mut low: PyReadwriteArray1<'_, f32>,
    mut frames: PyReadwriteArray2<'_, i32>,
    level: Option<&str>,
) -> PyResult<()> {
    let (rows, level) = (rows_of_two(&signal)?, supported(level).map_err(refused)?);
    let count = rows.len();
    expect_length("span", span.len(), 2 * count)?;
    expect_length("limit", limit.len(), count)?;
    expect_length("low", low.len(), count)?;
    expect_length("frames", frames.len(), 3 * count)?;
    let asked = core_stretches::Limited {
        signal: rows,
        span: span.as_slice()?,
        limit: limit.as_slice()?,
        is_most,
    };
    let (low, frames) = (low.as_slice_mut()?, frames.as_slice_mut()?);
    spread(py, count * SIMULATION_BYTES, || {
        core_stretches::limited(&asked, level, low, frames);
    })
}

/// Bits of an array (simulation, time) that are set in any frame of a stretch, and in all: two rows of `out`.
#[pyfunction]
#[pyo3(signature = (*, values, span, out))]
pub fn bits(
    values: PyReadonlyArray2<'_, u8>,
    span: Ints<'_>,
    mut out: PyReadwriteArray2<'_, u8>,
) -> PyResult<()> {
    let rows = rows_of_two(&values)?;
    expect_length("span", span.len(), 2 * rows.len())?;
    expect_length("out", out.len(), 2 * rows.len())?;
    core_stretches::bits(&rows, span.as_slice()?, out.as_slice_mut()?);
    Ok(())
}

/// Encounters with neighbours at single frames: a row of `out` for each of `encounter_fields`.
///
/// `instants` are simulation, place around the ego and frame of each.
#[pyfunction]
#[pyo3(signature = (*, recorded, neighbours, instants, vehicle, out, level=None))]
pub fn encounters(
    recorded: Recorded<'_>,
    neighbours: Octets<'_>,
    instants: PyReadonlyArray1<'_, i64>,
    mut vehicle: PyReadwriteArray1<'_, u8>,
    mut out: PyReadwriteArray2<'_, f32>,
    level: Option<&str>,
) -> PyResult<()> {
    let (shape, level) = (recorded.shape()?, supported(level).map_err(refused)?);
    let [simulations, slots, frames] = shape;
    let count = vehicle.len();
    expect_length("vehicle", neighbours.len(), PLACES * simulations * frames)?;
    expect_length("instants", instants.len(), 3 * count)?;
    expect_length("out", out.len(), ENCOUNTERS.len() * count)?;
    let (neighbours, lengths) = (neighbours.as_slice()?, recorded.length.as_slice()?);
    let (s, speed, accel) = (
        recorded.s.as_array(),
        recorded.speed.as_array(),
        recorded.accel.as_array(),
    );
    let along = |simulation: usize, slot: usize, frame: usize| Along {
        s: s[[simulation, slot, frame]],
        speed: speed[[simulation, slot, frame]],
        accel: accel[[simulation, slot, frame]],
        half_length: lengths[simulation * slots + slot] * 0.5,
    };
    let (instants, found) = (instants.as_slice()?, vehicle.as_slice_mut()?);
    let index = |row: usize, i: usize, end: usize| {
        let number = usize::try_from(instants[row * count + i]).ok();
        number.filter(|&number| number < end)
    };
    let mut pairs = reserved(count)?;
    for i in 0..count {
        let at = (
            index(0, i, simulations),
            index(1, i, PLACES),
            index(2, i, frames),
        );
        let (Some(simulation), Some(place), Some(frame)) = at else {
            return Err(PyValueError::new_err("instants: expected recorded frames"));
        };
        found[i] = neighbours[(simulation * PLACES + place) * frames + frame];
        if found[i] != NO_VEHICLE && usize::from(found[i]) >= slots {
            let message = format!("vehicle: no vehicle {}", found[i]);
            return Err(PyValueError::new_err(message));
        }
        let other =
            (found[i] != NO_VEHICLE).then(|| along(simulation, usize::from(found[i]), frame));
        pairs.push(Pair {
            own: along(simulation, 0, frame),
            other,
            is_ahead: place.is_multiple_of(2),
        });
    }
    core_stretches::encounters(&pairs, level, out.as_slice_mut()?);
    Ok(())
}

/// Names of the rows of `encounters`, in order.
#[pyfunction]
pub fn encounter_fields() -> Vec<&'static str> {
    ENCOUNTERS.to_vec()
}
