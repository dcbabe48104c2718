//! Recordings and signals as Python packs them, refused where arrays do not fit each other.

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use overtaking_core::signals::{NO_VEHICLE, PLACES, Recording, Seen};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{expect_length, rows, rows_of_two};

pub type Ints<'py> = PyReadonlyArray1<'py, i32>;
pub type Floats<'py> = PyReadonlyArray1<'py, f32>;
pub type Octets<'py> = PyReadonlyArray1<'py, u8>;

/// A batch of recordings: states (simulation, vehicle, time), vehicles (simulation, vehicle) flat, and numbers.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Recorded<'py> {
    pub s: PyReadonlyArray3<'py, i32>,
    d: PyReadonlyArray3<'py, i32>,
    pub speed: PyReadonlyArray3<'py, i32>,
    heading: PyReadonlyArray3<'py, i16>,
    pub accel: PyReadonlyArray3<'py, i16>,
    lane: PyReadonlyArray3<'py, u8>,
    present: Option<PyReadonlyArray3<'py, bool>>,
    hit: PyReadonlyArray2<'py, u8>,
    num_frames: Ints<'py>,
    valid: PyReadonlyArray1<'py, bool>,
    pub length: Floats<'py>,
    width: Floats<'py>,
    num_lanes: usize,
    side: f32,
    direction: f32,
    interval_ms: i32,
    half_window: usize,
}

impl Recorded<'_> {
    /// Simulations, vehicles and frames, if all arrays have as many.
    pub fn shape(&self) -> PyResult<[usize; 3]> {
        let states = [
            self.d.shape(),
            self.speed.shape(),
            self.heading.shape(),
            self.accel.shape(),
            self.lane.shape(),
        ];
        let shape = self.s.shape();
        let present = self.present.as_ref().map_or(shape, |each| each.shape());
        let &[simulations, slots, frames] = shape else {
            return Err(PyValueError::new_err("states: expected three axes"));
        };
        let same = states.iter().all(|each| *each == shape) && present == shape;
        if !same || slots == 0 || self.hit.shape() != [simulations, frames] {
            return Err(PyValueError::new_err(
                "states: expected arrays of one shape",
            ));
        }
        expect_length("num_frames", self.num_frames.len(), simulations)?;
        expect_length("length", self.length.len(), simulations * slots)?;
        expect_length("width", self.width.len(), simulations * slots)?;
        expect_length("valid", self.valid.len(), simulations * slots)?;
        expect_length("lanes", self.num_lanes.clamp(1, 8), self.num_lanes)?;
        Ok([simulations, slots, frames])
    }

    pub fn recording(&self) -> PyResult<Recording<'_>> {
        let [_, slots, frames] = self.shape()?;
        Ok(Recording {
            num_frames: self.num_frames.as_slice()?,
            slots,
            frames,
            s: rows(&self.s)?,
            d: rows(&self.d)?,
            speed: rows(&self.speed)?,
            heading: rows(&self.heading)?,
            accel: rows(&self.accel)?,
            lane: rows(&self.lane)?,
            hit: rows_of_two(&self.hit)?,
            present: self.present.as_ref().map(rows).transpose()?,
            valid: self.valid.as_slice()?,
            length: self.length.as_slice()?,
            width: self.width.as_slice()?,
            num_lanes: self.num_lanes,
            side: self.side,
            direction: self.direction,
            interval_ms: self.interval_ms,
            half_window: self.half_window,
        })
    }
}

/// Signals of the ego, flat (simulation, time), and its neighbours, flat (simulation, place, time).
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Signals<'py> {
    lane: Octets<'py>,
    lateral_position: Floats<'py>,
    lateral_speed: Floats<'py>,
    speed: Floats<'py>,
    right_edge: Floats<'py>,
    left_edge: Floats<'py>,
    neighbour_slot: Octets<'py>,
    friction: Floats<'py>,
    sight_lit: Floats<'py>,
    sight_unlit: Floats<'py>,
}

impl Signals<'_> {
    /// The same, if they are of a recording and its neighbours are vehicles of it.
    pub fn seen(&self, recording: &Recording<'_>) -> PyResult<Seen<'_>> {
        let seen = self.seen_alone(recording)?;
        expect_slots("neighbour_slot", seen.neighbour_slot, recording.slots)?;
        Ok(seen)
    }

    /// The same for who asks nothing of neighbours: it takes a while to look at them all.
    pub fn seen_alone(&self, recording: &Recording<'_>) -> PyResult<Seen<'_>> {
        let cells = recording.num_frames.len() * recording.frames;
        let seen = Seen {
            lane: self.lane.as_slice()?,
            lateral_position: self.lateral_position.as_slice()?,
            lateral_speed: self.lateral_speed.as_slice()?,
            speed: self.speed.as_slice()?,
            right_edge: self.right_edge.as_slice()?,
            left_edge: self.left_edge.as_slice()?,
            neighbour_slot: self.neighbour_slot.as_slice()?,
            friction: self.friction.as_slice()?,
            sight_lit: self.sight_lit.as_slice()?,
            sight_unlit: self.sight_unlit.as_slice()?,
        };
        expect_length("lane", seen.lane.len(), cells)?;
        let floats = [
            seen.lateral_position,
            seen.lateral_speed,
            seen.speed,
            seen.right_edge,
            seen.left_edge,
            seen.friction,
            seen.sight_lit,
            seen.sight_unlit,
        ];
        for each in floats {
            expect_length("signals", each.len(), cells)?;
        }
        expect_length("neighbour_slot", seen.neighbour_slot.len(), PLACES * cells)?;
        Ok(seen)
    }
}

/// Refuse vehicles that are no slots of a recording; 255 is nobody.
pub fn expect_slots(what: &str, vehicles: &[u8], slots: usize) -> PyResult<()> {
    // Nobody, 255, becomes 0. The largest of bytes is found many at a time, the first that is wrong is not.
    let most = vehicles
        .iter()
        .fold(0, |most: u8, slot| most.max(slot.wrapping_add(1)));
    if usize::from(most) <= slots {
        return Ok(());
    }
    let missing = |slot: &&u8| **slot != NO_VEHICLE && usize::from(**slot) >= slots;
    let slot = vehicles.iter().find(missing).copied().unwrap_or(0);
    Err(PyValueError::new_err(format!("{what}: no vehicle {slot}")))
}
