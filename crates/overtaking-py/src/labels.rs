//! Binding of `overtaking_labels`: signals (time series), events and margins of recorded traffic. A slot is the number
//! of a vehicle in its simulation; the ego has slot 0.

use numpy::{
    PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1, PyReadwriteArray2,
    PyUntypedArrayMethods,
};
use overtaking_core::require_level;
use overtaking_labels::{
    ENCOUNTER_NAMES, EVENT_NAMES, EgoSignals, EncounterPair, EventThresholds, FRAME_NAMES,
    LawNumbers, LimitQuery, MOMENT_NAMES, NO_VEHICLE, NUM_ROLES, NeighbourSignals, SPAN_NAMES,
    SUM_NAMES, SpanOutputs, SpanQuery, TargetSignals, VehicleInstant, VisibilityInputs,
    measure_names, with_ego_signals, with_event_thresholds, with_law_numbers,
    with_neighbour_signals, with_target_signals, with_visibility_arrays,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::batch_inputs::ConstantValues;
use crate::inputs::{
    Bytes, Floats, Ints, RecordingArrays, SignalArrays, borrow_output, expect_length, expect_slots,
    simulation_rows,
};

use crate::spread::{SIMULATION_BYTES, reserve, run_in_pool};

macro_rules! visibility_arrays {
    ($($(#[$doc:meta])* $field:ident, $count:expr;)*) => {
        /// Road surface and visibility of each simulation.
        #[derive(FromPyObject)]
        #[pyo3(from_item_all)]
        pub struct VisibilityArrays<'py> {
            $($field: Floats<'py>,)*
            attention_range: f32,
        }

        impl VisibilityArrays<'_> {
            fn inputs<'a>(
                &'a self,
                num_simulations: usize,
                constants: &'a overtaking_core::ModelConstants,
            ) -> PyResult<VisibilityInputs<'a>> {
                $(expect_length(stringify!($field), self.$field.len(), $count * num_simulations)?;)*
                Ok(VisibilityInputs {
                    $($field: self.$field.as_slice()?,)*
                    attention_range: self.attention_range,
                    constants,
                })
            }
        }
    };
}
with_visibility_arrays! { visibility_arrays! }

macro_rules! law_number_values {
    ($($(#[$doc:meta])* $field:ident: $kind:ty,)*) => {
        /// Numbers of traffic law and of the measures.
        #[derive(FromPyObject)]
        #[pyo3(from_item_all)]
        pub struct LawNumberValues {
            $($field: $kind,)*
        }

        impl LawNumberValues {
            fn law(&self) -> LawNumbers {
                LawNumbers { $($field: self.$field,)* }
            }
        }
    };
}
with_law_numbers! { law_number_values! }

macro_rules! event_threshold_values {
    ($($(#[$doc:meta])* $field:ident: $kind:ty,)*) => {
        /// Thresholds of movements across the road, and the borders of the lanes.
        #[derive(FromPyObject)]
        #[pyo3(from_item_all)]
        pub struct EventThresholdValues<'py> {
            min_advance: Floats<'py>,
            borders: Vec<f32>,
            $($field: $kind,)*
        }

        impl EventThresholdValues<'_> {
            fn thresholds(&self, num_simulations: usize) -> PyResult<EventThresholds<'_>> {
                expect_length("min_advance", self.min_advance.len(), num_simulations)?;
                // One lane has two borders: with fewer, the expected length is 2.
                expect_length("borders", self.borders.len().max(2), self.borders.len())?;
                Ok(EventThresholds {
                    min_advance: self.min_advance.as_slice()?,
                    borders: self.borders.clone(),
                    $($field: self.$field,)*
                })
            }
        }
    };
}
with_event_thresholds! { event_threshold_values! }

/// Borrow every array of a struct of outputs, and evaluate `$body` with `$out` over them. Macros such as
/// `with_ego_signals!` call this one, and add the fields of the struct after its first group.
macro_rules! with_outputs {
    (
        { $name:ident, $arrays:expr, $cells:expr, |$out:ident| $body:expr }
        $($field:ident: $kind:ty, $rows:expr;)*
    ) => {{
        $(let mut $field = borrow_output::<$kind>($arrays, stringify!($field), $rows * $cells)?;)*
        let mut $out = $name { $($field: $field.as_slice_mut()?,)* };
        $body
    }};
}

/// Compute the signals and the events of recordings.
///
/// Args:
///     recording: As `labels.signals.pack_recording` makes it: s, d, speed, heading, accel, lane
///         and is_recorded (or None), shape (simulation, vehicle, time), and collided_with, shape
///         (simulation, time), the frames adjacent; num_frames, valid, length and width, flat; and
///         the numbers num_lanes, overtaking_sign, direction, interval_ms, half_window.
///     visibility: As `labels.signals.visibility_inputs` makes it.
///     thresholds: As `labels.event_detection.event_thresholds` makes them.
///     constants: As in `Inputs`.
///     signals: Arrays of shape (simulation, time) or (simulation, 6, time) by name; filled. The 6
///         are the `NeighbourRole`s.
///     zero_from: Frame from which on each row of these arrays holds zeros, shape (simulation,);
///         only earlier frames are cleared. Updated.
///     events: A row for each of `FIELD_NAMES["events"]`; filled.
///     level: SIMD level; None for the best of this CPU.
///
/// Raises:
///     ValueError: An array has another shape, or the SIMD level is unknown or not available.
#[pyfunction]
#[pyo3(signature = (
    *,
    recording: "Mapping[str, Any]",
    visibility: "Mapping[str, Any]",
    thresholds: "Mapping[str, Any]",
    constants: "Mapping[str, Any]",
    signals: "dict[str, NDArray[Any]]",
    zero_from: "NDArray[np.int32]",
    events: "NDArray[np.int32]",
    level: "str | None" = None,
) -> "None")]
#[allow(clippy::too_many_arguments)]
pub fn ego_signals_and_events(
    py: Python<'_>,
    recording: RecordingArrays<'_>,
    visibility: VisibilityArrays<'_>,
    thresholds: EventThresholdValues<'_>,
    constants: ConstantValues,
    signals: &Bound<'_, PyDict>,
    mut zero_from: PyReadwriteArray1<'_, i32>,
    mut events: PyReadwriteArray2<'_, i32>,
    level: Option<&str>,
) -> PyResult<()> {
    let (recording, level) = (
        recording.packed_recording()?,
        require_level(level).map_err(PyValueError::new_err)?,
    );
    let count = recording.num_frames.len();
    let constants = constants.constants()?;
    let visibility = visibility.inputs(count, &constants)?;
    let thresholds = thresholds.thresholds(count)?;
    expect_length("zero_from", zero_from.len(), count)?;
    expect_length("events", events.len(), EVENT_NAMES.len() * count)?;
    let (zero_from, events) = (zero_from.as_slice_mut()?, events.as_slice_mut()?);
    // The second argument of `run_in_pool` is the memory that the work allocates [bytes].
    with_ego_signals! { with_outputs! {
        EgoSignals, signals, count * recording.max_frames,
        |out| run_in_pool(py, count * SIMULATION_BYTES, || {
            overtaking_labels::ego_signals(&recording, &visibility, level, &mut out, zero_from);
            overtaking_labels::events(&recording, &out.views(), &thresholds, events);
        })
    } }
}

/// Compute gaps to the neighbours of the ego and the occupancy of the lane to its left.
///
/// Args:
///     recording: As in `ego_signals_and_events`.
///     neighbour_slot: Slots of the neighbours, flat (simulation, 6, time).
///     outputs: gap, closing_speed and lateral_gap, shape (simulation, 6, time); left_occupancy
///         and left_count, shape (simulation, time); filled.
///     level: As in `ego_signals_and_events`.
///
/// Raises:
///     ValueError: As in `ego_signals_and_events`.
#[pyfunction]
#[pyo3(signature = (
    *,
    recording: "Mapping[str, Any]",
    neighbour_slot: "NDArray[np.uint8]",
    outputs: "dict[str, NDArray[Any]]",
    level: "str | None" = None,
) -> "None")]
pub fn neighbour_signals(
    py: Python<'_>,
    recording: RecordingArrays<'_>,
    neighbour_slot: Bytes<'_>,
    outputs: &Bound<'_, PyDict>,
    level: Option<&str>,
) -> PyResult<()> {
    let (recording, level) = (
        recording.packed_recording()?,
        require_level(level).map_err(PyValueError::new_err)?,
    );
    let count = recording.num_frames.len();
    let cells = count * recording.max_frames;
    let neighbour_slot = neighbour_slot.as_slice()?;
    expect_length("neighbour_slot", neighbour_slot.len(), NUM_ROLES * cells)?;
    with_neighbour_signals! { with_outputs! {
        NeighbourSignals, outputs, cells,
        |out| run_in_pool(py, count * SIMULATION_BYTES, || {
            overtaking_labels::neighbour_signals(&recording, neighbour_slot, level, &mut out);
        })
    } }
}

/// Compute the signals of the overtaken vehicles.
///
/// Args:
///     recording: As in `ego_signals_and_events`.
///     signals: Signals of the ego, as `labels.signals.pack_signals` makes them.
///     target_slot: Slot of the overtaken vehicle, 255 without one, shape (simulation,).
///     outputs: Arrays of shape (simulation, time) by name; filled.
///     level: As in `ego_signals_and_events`.
///
/// Raises:
///     ValueError: As in `ego_signals_and_events`, or a slot does not exist.
#[pyfunction]
#[pyo3(signature = (
    *,
    recording: "Mapping[str, Any]",
    signals: "Mapping[str, NDArray[Any]]",
    target_slot: "NDArray[np.uint8]",
    outputs: "dict[str, NDArray[Any]]",
    level: "str | None" = None,
) -> "None")]
pub fn target_signals(
    py: Python<'_>,
    recording: RecordingArrays<'_>,
    signals: SignalArrays<'_>,
    target_slot: Bytes<'_>,
    outputs: &Bound<'_, PyDict>,
    level: Option<&str>,
) -> PyResult<()> {
    let (recording, level) = (
        recording.packed_recording()?,
        require_level(level).map_err(PyValueError::new_err)?,
    );
    let (signals, target_slot) = (signals.views(&recording)?, target_slot.as_slice()?);
    let count = recording.num_frames.len();
    expect_length("target_slot", target_slot.len(), count)?;
    expect_slots("target_slot", target_slot, recording.num_slots)?;
    with_target_signals! { with_outputs! {
        TargetSignals, outputs, count * recording.max_frames,
        |out| run_in_pool(py, count * SIMULATION_BYTES, || {
            overtaking_labels::target_signals(&recording, &signals, target_slot, level, &mut out);
        })
    } }
}

/// Upper limit of the memory for one frame in which ego and target overlap [bytes]: its 25 bytes lie in vectors that
/// double when they are full (up to 50), and the vectors of the threads are then joined into new ones (25 more). The
/// sum, 75, is rounded up.
const ALONGSIDE_BYTES: usize = 96;

/// For each frame in which ego and target overlap: simulation, frame, lane of the target, gap between the sides, and
/// acceleration of the target.
type AlongsideArrays<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<u8>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<f32>>,
);

/// The frames within a span in which ego and target overlap along the road, in order.
///
/// Args:
///     recording: As in `ego_signals_and_events`.
///     signals: As in `target_signals`.
///     target_slot: As in `target_signals`.
///     span: First and last frame of the span, flat (end, simulation).
///     level: As in `ego_signals_and_events`.
///
/// Returns:
///     Five arrays with an entry for each such frame: simulation, frame, lane of the target, gap
///     between the sides of both [m], and acceleration of the target [m/s^2].
///
/// Raises:
///     ValueError: As in `target_signals`.
#[pyfunction]
#[pyo3(signature = (
    *,
    recording: "Mapping[str, Any]",
    signals: "Mapping[str, NDArray[Any]]",
    target_slot: "NDArray[np.uint8]",
    span: "NDArray[np.int32]",
    level: "str | None" = None,
) -> "tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.uint8], NDArray[np.float32], NDArray[np.float32]]")]
pub fn frames_alongside<'py>(
    py: Python<'py>,
    recording: RecordingArrays<'py>,
    signals: SignalArrays<'py>,
    target_slot: Bytes<'py>,
    span: Ints<'py>,
    level: Option<&str>,
) -> PyResult<AlongsideArrays<'py>> {
    let (recording, level) = (
        recording.packed_recording()?,
        require_level(level).map_err(PyValueError::new_err)?,
    );
    let signals = signals.views_without_neighbours(&recording)?;
    let (target_slot, span) = (target_slot.as_slice()?, span.as_slice()?);
    expect_length("target_slot", target_slot.len(), recording.num_frames.len())?;
    expect_length("span", span.len(), 2 * target_slot.len())?;
    expect_slots("target_slot", target_slot, recording.num_slots)?;
    let (first, last) = span.split_at(target_slot.len());
    let max_frames = recording.max_frames as i32;
    // The largest number of frames that can be found.
    let frames: usize = first
        .iter()
        .zip(last)
        .map(|(first, last)| (last - first.max(&0) + 1).clamp(0, max_frames) as usize)
        .sum();
    let alongside = run_in_pool(py, frames * ALONGSIDE_BYTES, || {
        overtaking_labels::frames_alongside(&recording, &signals, target_slot, span, level)
    })?;
    Ok((
        PyArray1::from_vec(py, alongside.simulation),
        PyArray1::from_vec(py, alongside.frame),
        PyArray1::from_vec(py, alongside.lane),
        PyArray1::from_vec(py, alongside.lateral_gap),
        PyArray1::from_vec(py, alongside.accel),
    ))
}

/// Arrays for the results of `scan_spans`, (row, simulation).
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct SpanOutputArrays<'py> {
    measures: PyReadwriteArray2<'py, f32>,
    frames: PyReadwriteArray2<'py, i32>,
    sums: PyReadwriteArray2<'py, i64>,
}

/// Compute margins, measures and sums over spans of frames of each simulation.
///
/// Args:
///     recording: As in `ego_signals_and_events`.
///     signals: As in `target_signals`.
///     spans: First and last frame, flat (span, end, simulation); cut to the recorded frames.
///     moments: The frames in which the line is crossed and the return ends (-1: no event), the
///         slot of the target (255: no vehicle) and its original lane, flat (moment, simulation).
///     law: Numbers of the law, as `labels.law.margins` makes them.
///     outputs: measures, frames and sums, each with a row for each of its names; filled.
///     level: As in `ego_signals_and_events`.
///
/// Raises:
///     ValueError: As in `ego_signals_and_events`, or a frame or a slot of `moments` does not
///         exist.
#[pyfunction]
#[pyo3(signature = (
    *,
    recording: "Mapping[str, Any]",
    signals: "Mapping[str, NDArray[Any]]",
    spans: "NDArray[np.int32]",
    moments: "NDArray[np.int32]",
    law: "Mapping[str, Any]",
    outputs: "Mapping[str, NDArray[Any]]",
    level: "str | None" = None,
) -> "None")]
#[allow(clippy::too_many_arguments)]
pub fn scan_spans(
    py: Python<'_>,
    recording: RecordingArrays<'_>,
    signals: SignalArrays<'_>,
    spans: Ints<'_>,
    moments: Ints<'_>,
    law: LawNumberValues,
    mut outputs: SpanOutputArrays<'_>,
    level: Option<&str>,
) -> PyResult<()> {
    let (recording, level) = (
        recording.packed_recording()?,
        require_level(level).map_err(PyValueError::new_err)?,
    );
    let (signals, count) = (signals.views(&recording)?, recording.num_frames.len());
    let SpanOutputArrays {
        measures,
        frames,
        sums,
    } = &mut outputs;
    expect_length("spans", spans.len(), 2 * SPAN_NAMES.len() * count)?;
    expect_length("moments", moments.len(), MOMENT_NAMES.len() * count)?;
    expect_length("measures", measures.len(), measure_names().len() * count)?;
    expect_length("frames", frames.len(), FRAME_NAMES.len() * count)?;
    expect_length("sums", sums.len(), SUM_NAMES.len() * count)?;
    let law = law.law();
    let query = SpanQuery {
        spans: spans.as_slice()?,
        moments: moments.as_slice()?,
        law: &law,
    };
    // In the order of `MOMENT_NAMES`: two rows of frames, a row of slots and a row of lanes.
    let (moment_frames, slots_and_lanes) = query.moments.split_at(2 * count);
    let max_frames = recording.max_frames as i32;
    if let Some(frame) = moment_frames.iter().find(|&&frame| frame >= max_frames) {
        return Err(PyValueError::new_err(format!("moments: no frame {frame}")));
    }
    let target_slot: Vec<u8> = slots_and_lanes[..count]
        .iter()
        .map(|&slot| slot as u8)
        .collect();
    expect_slots("target_slot", &target_slot, recording.num_slots)?;
    let outputs = SpanOutputs {
        measures: measures.as_slice_mut()?,
        frames: frames.as_slice_mut()?,
        sums: sums.as_slice_mut()?,
    };
    run_in_pool(py, count * SIMULATION_BYTES, || {
        overtaking_labels::scan_spans(&recording, &signals, &query, level, outputs);
    })
}

/// Compute the smallest margin of a signal to a limit over a span of frames of each simulation.
///
/// Args:
///     signal: Shape (simulation, time), the frames adjacent.
///     span: First and last frame, flat (end, simulation).
///     limit: Shape (simulation,).
///     is_maximum: Whether the limit is the largest allowed value, and not the smallest.
///     min_margin: The smallest margins, 3e38 without a frame, shape (simulation,); filled.
///     frames: First and last frame with a negative margin, -1 without one, and the length of the
///         longest run of such frames, shape (3, simulation); filled.
///     level: As in `ego_signals_and_events`.
///
/// Raises:
///     ValueError: As in `ego_signals_and_events`.
#[pyfunction]
#[pyo3(signature = (
    *,
    signal: "NDArray[np.float32]",
    span: "NDArray[np.int32]",
    limit: "NDArray[np.float32]",
    is_maximum: "bool",
    min_margin: "NDArray[np.float32]",
    frames: "NDArray[np.int32]",
    level: "str | None" = None,
) -> "None")]
#[allow(clippy::too_many_arguments)]
pub fn limit_margins(
    py: Python<'_>,
    signal: PyReadonlyArray2<'_, f32>,
    span: Ints<'_>,
    limit: Floats<'_>,
    is_maximum: bool,
    mut min_margin: PyReadwriteArray1<'_, f32>,
    mut frames: PyReadwriteArray2<'_, i32>,
    level: Option<&str>,
) -> PyResult<()> {
    let (signal, level) = (
        simulation_rows(&signal)?,
        require_level(level).map_err(PyValueError::new_err)?,
    );
    let count = signal.len();
    expect_length("span", span.len(), 2 * count)?;
    expect_length("limit", limit.len(), count)?;
    expect_length("min_margin", min_margin.len(), count)?;
    expect_length("frames", frames.len(), 3 * count)?;
    let query = LimitQuery {
        signal,
        span: span.as_slice()?,
        limit: limit.as_slice()?,
        is_maximum,
    };
    let (min_margin, frames) = (min_margin.as_slice_mut()?, frames.as_slice_mut()?);
    run_in_pool(py, count * SIMULATION_BYTES, || {
        overtaking_labels::limit_margins(&query, level, min_margin, frames);
    })
}

/// Find the bits that are set in any frame of a span of each simulation, and in all of them.
///
/// Args:
///     values: Shape (simulation, time), the frames adjacent.
///     span: As in `limit_margins`.
///     out: The bits of any frame, then the bits of all frames, shape (2, simulation); filled. A
///         span without frames gives 0 and 255.
///
/// Raises:
///     ValueError: An array has another shape.
#[pyfunction]
#[pyo3(signature = (
    *,
    values: "NDArray[np.uint8]",
    span: "NDArray[np.int32]",
    out: "NDArray[np.uint8]",
) -> "None")]
pub fn flag_bits(
    values: PyReadonlyArray2<'_, u8>,
    span: Ints<'_>,
    mut out: PyReadwriteArray2<'_, u8>,
) -> PyResult<()> {
    let rows = simulation_rows(&values)?;
    expect_length("span", span.len(), 2 * rows.len())?;
    expect_length("out", out.len(), 2 * rows.len())?;
    overtaking_labels::flag_bits(&rows, span.as_slice()?, out.as_slice_mut()?);
    Ok(())
}

/// Compute the measures between the ego and neighbours in single frames.
///
/// Args:
///     recording: As in `ego_signals_and_events`.
///     neighbour_slot: Slots of the neighbours, flat (simulation, 6, time).
///     instants: Simulations, roles and frames, flat (3, instant).
///     slot: Slot of each neighbour, 255 without one; filled.
///     out: A row for each of `FIELD_NAMES["encounters"]`; filled.
///     level: As in `ego_signals_and_events`.
///
/// Raises:
///     ValueError: As in `ego_signals_and_events`, or an instant or a slot does not exist.
#[pyfunction]
#[pyo3(signature = (
    *,
    recording: "Mapping[str, Any]",
    neighbour_slot: "NDArray[np.uint8]",
    instants: "NDArray[np.int64]",
    slot: "NDArray[np.uint8]",
    out: "NDArray[np.floating[Any]]",
    level: "str | None" = None,
) -> "None")]
pub fn encounter_measures(
    recording: RecordingArrays<'_>,
    neighbour_slot: Bytes<'_>,
    instants: PyReadonlyArray1<'_, i64>,
    mut slot: PyReadwriteArray1<'_, u8>,
    mut out: PyReadwriteArray2<'_, f32>,
    level: Option<&str>,
) -> PyResult<()> {
    let level = require_level(level).map_err(PyValueError::new_err)?;
    let [simulations, num_slots, frames] = recording.shape()?;
    let count = slot.len();
    expect_length(
        "neighbour_slot",
        neighbour_slot.len(),
        NUM_ROLES * simulations * frames,
    )?;
    expect_length("instants", instants.len(), 3 * count)?;
    expect_length("out", out.len(), ENCOUNTER_NAMES.len() * count)?;
    let (neighbour_slot, length) = (neighbour_slot.as_slice()?, recording.length.as_slice()?);
    let (s, speed, accel) = (
        recording.s.as_array(),
        recording.speed.as_array(),
        recording.accel.as_array(),
    );
    let vehicle_at = |simulation: usize, slot: usize, frame: usize| VehicleInstant {
        s: s[[simulation, slot, frame]],
        speed: speed[[simulation, slot, frame]],
        accel: accel[[simulation, slot, frame]],
        half_length: length[simulation * num_slots + slot] * 0.5,
    };
    let (instants, slots) = (instants.as_slice()?, slot.as_slice_mut()?);
    let index_below = |row: usize, instant: usize, end: usize| {
        let index = usize::try_from(instants[row * count + instant]).ok();
        index.filter(|&index| index < end)
    };
    let mut pairs = reserve(count)?;
    for (instant, slot) in slots.iter_mut().enumerate() {
        let (Some(simulation), Some(role), Some(frame)) = (
            index_below(0, instant, simulations),
            index_below(1, instant, NUM_ROLES),
            index_below(2, instant, frames),
        ) else {
            return Err(PyValueError::new_err("instants: expected recorded frames"));
        };
        *slot = neighbour_slot[(simulation * NUM_ROLES + role) * frames + frame];
        let neighbour = match *slot {
            NO_VEHICLE => None,
            slot if usize::from(slot) < num_slots => {
                Some(vehicle_at(simulation, usize::from(slot), frame))
            }
            slot => {
                let message = format!("neighbour_slot: no vehicle {slot}");
                return Err(PyValueError::new_err(message));
            }
        };
        pairs.push(EncounterPair {
            ego: vehicle_at(simulation, 0, frame),
            neighbour,
            // The roles of leaders are even.
            is_ahead: role.is_multiple_of(2),
        });
    }
    overtaking_labels::encounter_measures(&pairs, level, out.as_slice_mut()?);
    Ok(())
}
