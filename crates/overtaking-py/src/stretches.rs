//! Margins and measures over stretches of frames.

use numpy::{
    Element, PyReadonlyArray1, PyReadonlyArray3, PyReadwriteArray1, PyReadwriteArray2,
    PyUntypedArrayMethods,
};
use overtaking_core::stretches::{
    self as core, Around, Duty, Extreme, Follow, Found, Grip, Law, MEANS, Means, Measures,
    Obstruction, Spans, Stops, WORST, Worst,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{PLACES, expect_length, expect_slots, expect_targets, rows};

type Floats<'py> = PyReadonlyArray1<'py, f32>;
type Octets<'py> = PyReadonlyArray1<'py, u8>;

/// From one frame of each simulation to another.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Span<'py> {
    start: PyReadonlyArray1<'py, i32>,
    stop: PyReadonlyArray1<'py, i32>,
    frames: usize,
    level: Option<String>,
}

impl Span<'_> {
    fn spans(&self) -> PyResult<Spans<'_>> {
        expect_length("stop", self.stop.len(), self.start.len())?;
        if self.frames == 0 {
            return Err(PyValueError::new_err("frames: expected 1 or more, got 0"));
        }
        let (start, stop) = (self.start.as_slice()?, self.stop.as_slice()?);
        Spans::new(start, stop, self.frames, self.level.as_deref()).map_err(PyValueError::new_err)
    }

    /// An array (simulation, frame) as a slice.
    fn own<'a, T: Element>(&self, values: &'a PyReadonlyArray1<'_, T>) -> PyResult<&'a [T]> {
        expect_length("values", values.len(), self.start.len() * self.frames)?;
        Ok(values.as_slice()?)
    }

    /// Neighbours (simulation, place, frame) that are slots of the recording in some places, and these.
    fn around<'a>(&self, given: &'a Neighbours<'_>, places: &[usize]) -> PyResult<Around<'a>> {
        let slots = given.s.shape()[1];
        given.around(self.start.len(), slots, self.frames, places)
    }
}

/// Who is around the ego, and the recorded states that say how far and how fast.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Neighbours<'py> {
    vehicle: Octets<'py>,
    s: PyReadonlyArray3<'py, i32>,
    speed: PyReadonlyArray3<'py, i32>,
    length: Floats<'py>,
}

impl Neighbours<'_> {
    /// The same, if it is of a recording of this size and the neighbours in some places are slots of it.
    pub fn around(
        &self,
        simulations: usize,
        slots: usize,
        frames: usize,
        places: &[usize],
    ) -> PyResult<Around<'_>> {
        let (shape, vehicle) = ([simulations, slots, frames], self.vehicle.as_slice()?);
        if self.s.shape() != shape || self.speed.shape() != shape || slots == 0 {
            return Err(PyValueError::new_err(
                "states: expected arrays of one shape",
            ));
        }
        expect_length("vehicle", vehicle.len(), PLACES * simulations * frames)?;
        expect_length("length", self.length.len(), simulations * slots)?;
        expect_slots(vehicle, places, frames, slots)?;
        Ok(Around {
            vehicle,
            s: rows(&self.s)?,
            speed: rows(&self.speed)?,
            length: self.length.as_slice()?,
            slots,
        })
    }
}

/// The frames of each simulation and vehicle, of as many as there are in a span.
fn slots_of<'a, T: Element>(
    array: &'a PyReadonlyArray3<'_, T>,
    span: &Span<'_>,
) -> PyResult<(usize, Vec<&'a [T]>)> {
    let shape = array.shape();
    if shape[0] == span.start.len() && shape[2] == span.frames && shape[1] > 0 {
        return Ok((shape[1], rows(array)?));
    }
    Err(PyValueError::new_err(
        "states: expected arrays of one shape",
    ))
}

/// Smallest margins, and the frames in which they are negative.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Lowest<'py> {
    low: PyReadwriteArray1<'py, f32>,
    first: PyReadwriteArray1<'py, i32>,
    last: PyReadwriteArray1<'py, i32>,
}

impl Lowest<'_> {
    fn found(&mut self, count: usize) -> PyResult<Found<'_>> {
        expect_length("low", self.low.len(), count)?;
        expect_length("first", self.first.len(), count)?;
        expect_length("last", self.last.len(), count)?;
        Ok(Found {
            low: self.low.as_slice_mut()?,
            first: self.first.as_slice_mut()?,
            last: self.last.as_slice_mut()?,
        })
    }
}

/// Numbers of the law and of the measures.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct LawNumbers {
    floor: f32,
    usable: f32,
    decel_limit: f32,
    reaction_time: f32,
}

impl LawNumbers {
    fn law(&self) -> Law {
        let grip = Grip {
            floor: self.floor,
            usable: self.usable,
        };
        Law {
            grip,
            decel_limit: self.decel_limit,
            reaction_time: self.reaction_time,
        }
    }
}

/// Sight minus stopping distance over a stretch.
#[pyfunction]
#[pyo3(signature = (*, span, speed, friction, sight, floor, usable, reaction_time, out))]
#[allow(clippy::too_many_arguments)]
pub fn stops(
    py: Python<'_>,
    span: Span<'_>,
    speed: Floats<'_>,
    friction: Floats<'_>,
    sight: Floats<'_>,
    floor: f32,
    usable: f32,
    reaction_time: f32,
    mut out: Lowest<'_>,
) -> PyResult<()> {
    let given = Stops {
        speed: span.own(&speed)?,
        friction: span.own(&friction)?,
        sight: span.own(&sight)?,
        grip: Grip { floor, usable },
        reaction_time,
    };
    let (spans, found) = (span.spans()?, out.found(span.start.len())?);
    py.detach(|| core::stops(&given, &spans, found));
    Ok(())
}

/// What the distance to the vehicle ahead is judged by.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct FollowInputs<'py> {
    speed: Floats<'py>,
    friction: Floats<'py>,
    lane: Octets<'py>,
    around: Neighbours<'py>,
    lanes: PyReadonlyArray3<'py, u8>,
    present: Option<PyReadonlyArray3<'py, bool>>,
    regain: usize,
}

/// Gap minus lawful gap over a stretch, but for the time after a cut-in.
#[pyfunction]
#[pyo3(signature = (*, span, seen, law, out))]
pub fn follow(
    py: Python<'_>,
    span: Span<'_>,
    seen: FollowInputs<'_>,
    law: LawNumbers,
    mut out: Lowest<'_>,
) -> PyResult<()> {
    let (around, (slots, lanes)) = (
        span.around(&seen.around, &[0])?,
        slots_of(&seen.lanes, &span)?,
    );
    expect_length("lanes", slots, around.slots)?;
    let present = seen.present.as_ref().map(|each| slots_of(each, &span));
    let given = Follow {
        speed: span.own(&seen.speed)?,
        friction: span.own(&seen.friction)?,
        lane: span.own(&seen.lane)?,
        around,
        lanes,
        present: present.transpose()?.map(|(_, rows)| rows),
        regain: seen.regain,
        law: law.law(),
    };
    let (spans, found) = (span.spans()?, out.found(span.start.len())?);
    py.detach(|| core::follow(&given, &spans, found));
    Ok(())
}

/// The smallest or largest of an array (simulation, frame) in each stretch.
#[pyfunction]
#[pyo3(signature = (*, span, values, greatest, out))]
pub fn extreme_float(
    py: Python<'_>,
    span: Span<'_>,
    values: Floats<'_>,
    greatest: bool,
    mut out: PyReadwriteArray1<'_, f32>,
) -> PyResult<()> {
    expect_length("out", out.len(), span.start.len())?;
    let kind = if greatest {
        Extreme::Greatest
    } else {
        Extreme::Least
    };
    let (spans, values, out) = (span.spans()?, span.own(&values)?, out.as_slice_mut()?);
    py.detach(|| core::extreme_float(values, kind, &spans, out));
    Ok(())
}

/// The same, and the first and the last frame with a number beyond a limit of its simulation.
#[pyfunction]
#[pyo3(signature = (*, span, values, limits, greatest, out))]
pub fn beyond(
    py: Python<'_>,
    span: Span<'_>,
    values: Floats<'_>,
    limits: Floats<'_>,
    greatest: bool,
    mut out: Lowest<'_>,
) -> PyResult<()> {
    expect_length("limits", limits.len(), span.start.len())?;
    let kind = if greatest {
        Extreme::Greatest
    } else {
        Extreme::Least
    };
    let (spans, values, limits) = (span.spans()?, span.own(&values)?, limits.as_slice()?);
    let found = out.found(span.start.len())?;
    py.detach(|| core::beyond(values, limits, kind, &spans, found));
    Ok(())
}

/// What the duty to return is judged by.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct DutyInputs<'py> {
    lane: Octets<'py>,
    original_lane: Octets<'py>,
    num_lanes: usize,
    speed: Floats<'py>,
    friction: Floats<'py>,
    around: Neighbours<'py>,
    target: Octets<'py>,
    time_gap: f32,
    free_time: f32,
    reach: f32,
}

/// The longest run of frames in which the ego could have returned.
#[pyfunction]
#[pyo3(signature = (*, span, seen, law, first, length))]
pub fn duty(
    py: Python<'_>,
    span: Span<'_>,
    seen: DutyInputs<'_>,
    law: LawNumbers,
    mut first: PyReadwriteArray1<'_, i32>,
    mut length: PyReadwriteArray1<'_, i32>,
) -> PyResult<()> {
    let count = span.start.len();
    expect_length("first", first.len(), count)?;
    expect_length("length", length.len(), count)?;
    expect_length("original_lane", seen.original_lane.len(), count)?;
    expect_length("target", seen.target.len(), count)?;
    let (around, target) = (span.around(&seen.around, &[4, 5])?, seen.target.as_slice()?);
    expect_targets(target, around.slots)?;
    let given = Duty {
        lane: span.own(&seen.lane)?,
        original_lane: seen.original_lane.as_slice()?,
        num_lanes: seen.num_lanes,
        speed: span.own(&seen.speed)?,
        friction: span.own(&seen.friction)?,
        around,
        target,
        law: law.law(),
        time_gap: seen.time_gap,
        free_time: seen.free_time,
        reach: seen.reach,
    };
    let spans = span.spans()?;
    let (first, length) = (first.as_slice_mut()?, length.as_slice_mut()?);
    py.detach(|| core::duty(&given, &spans, first, length));
    Ok(())
}

/// What forced braking is judged by.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct ObstructionInputs<'py> {
    lane: Octets<'py>,
    around: Neighbours<'py>,
    lasting: usize,
    allowed: f32,
    most: f32,
}

/// Allowed braking minus what is forced on the follower after each change of lane.
#[pyfunction]
#[pyo3(signature = (*, span, seen, out))]
pub fn obstruction(
    py: Python<'_>,
    span: Span<'_>,
    seen: ObstructionInputs<'_>,
    mut out: Lowest<'_>,
) -> PyResult<()> {
    let given = Obstruction {
        lane: span.own(&seen.lane)?,
        around: span.around(&seen.around, &[1])?,
        lasting: seen.lasting,
        allowed: seen.allowed,
        most: seen.most,
    };
    let (spans, found) = (span.spans()?, out.found(span.start.len())?);
    py.detach(|| core::obstruction(&given, &spans, found));
    Ok(())
}

/// What the worst of the measures is looked for in.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct WorstInputs<'py> {
    speed: Floats<'py>,
    friction: Floats<'py>,
    around: Neighbours<'py>,
    accels: PyReadonlyArray3<'py, i16>,
}

/// Numbers of measures of safety.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct MeasureNumbers {
    picud_reaction_time: f32,
    picud_decel: f32,
    rss_reaction_time: f32,
    rss_accel: f32,
    rss_rear_decel: f32,
    rss_lead_decel: f32,
    critical_ttc: f32,
}

impl MeasureNumbers {
    fn measures(&self) -> Measures {
        Measures {
            picud_reaction_time: self.picud_reaction_time,
            picud_decel: self.picud_decel,
            rss_reaction_time: self.rss_reaction_time,
            rss_accel: self.rss_accel,
            rss_rear_decel: self.rss_rear_decel,
            rss_lead_decel: self.rss_lead_decel,
            critical_ttc: self.critical_ttc,
        }
    }
}

/// The worst of each measure over a stretch: a row of `out` for each of `worst_fields`.
#[pyfunction]
#[pyo3(signature = (*, span, seen, law, measures, out))]
pub fn worst(
    py: Python<'_>,
    span: Span<'_>,
    seen: WorstInputs<'_>,
    law: LawNumbers,
    measures: MeasureNumbers,
    mut out: PyReadwriteArray2<'_, f32>,
) -> PyResult<()> {
    let count = span.start.len();
    let (around, (slots, accels)) = (
        span.around(&seen.around, &[0, 1])?,
        slots_of(&seen.accels, &span)?,
    );
    expect_length("accels", slots, around.slots)?;
    expect_length("out", out.len(), WORST.len() * count)?;
    let given = Worst {
        speed: span.own(&seen.speed)?,
        friction: span.own(&seen.friction)?,
        around,
        accels,
        law: law.law(),
        measures: measures.measures(),
    };
    let (spans, out) = (span.spans()?, out.as_slice_mut()?);
    py.detach(|| core::worst(&given, &spans, out));
    Ok(())
}

/// Names of the rows of `worst`, in order.
#[pyfunction]
pub fn worst_fields() -> Vec<&'static str> {
    WORST.to_vec()
}

/// What means are taken of.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct MeansInputs<'py> {
    around: Neighbours<'py>,
    num_lanes: usize,
    valid: PyReadonlyArray1<'py, bool>,
    lane: PyReadonlyArray3<'py, u8>,
    present: Option<PyReadonlyArray3<'py, bool>>,
}

/// Sums over the first frames of each simulation: a row of `out` for each of `mean_fields`.
#[pyfunction]
#[pyo3(signature = (*, span, seen, out))]
pub fn means(
    py: Python<'_>,
    span: Span<'_>,
    seen: MeansInputs<'_>,
    mut out: PyReadwriteArray2<'_, i64>,
) -> PyResult<()> {
    let (around, (slots, lane)) = (
        span.around(&seen.around, &[0])?,
        slots_of(&seen.lane, &span)?,
    );
    let present = seen.present.as_ref().map(|each| slots_of(each, &span));
    expect_length("lane", slots, around.slots)?;
    expect_length("valid", seen.valid.len(), slots * span.start.len())?;
    expect_length("out", out.len(), MEANS.len() * span.start.len())?;
    let given = Means {
        last: span.stop.as_slice()?,
        frames: span.frames,
        around,
        num_lanes: seen.num_lanes,
        valid: seen.valid.as_slice()?,
        present: present.transpose()?.map(|(_, rows)| rows),
        lane,
    };
    let out = out.as_slice_mut()?;
    py.detach(|| core::means(&given, out));
    Ok(())
}

/// Names of the rows of `means`, in order.
#[pyfunction]
pub fn mean_fields() -> Vec<&'static str> {
    MEANS.to_vec()
}
