//! What does not change during a block, as `overtaking.world.step_parameters` gives it.

use fearless_simd::Simd;

use crate::engine::Inputs;
use crate::lanes::{LANES, Seats};
use crate::names::{Constants, Simulation, Vehicle};
use crate::state::EGO;

/// The road as the step sees it, lateral axis towards the fast side.
#[derive(Clone, Copy, Debug)]
pub struct Road<'a> {
    /// Driving lanes.
    pub num_lanes: usize,
    /// Lane borders from slow to fast, padded with the last [m].
    pub boundaries: [f32; 9],
    /// Film factor of each lane's drainage path, padded.
    pub film_path: [f32; 8],
    /// +1 in right-hand traffic, -1 in left-hand traffic.
    pub overtaking_sign: f32,
    /// World x, y of the road's origin [m], heading [rad], its cosine and sine.
    pub pose: [f32; 5],
    /// Its directions.
    pub ways: Ways,
    /// Geometry, sight and limits by station.
    pub course_table: CourseTable<'a>,
}

/// Geometry, sight and limits of a road at equally spaced stations, as `CourseTable` in
/// `overtaking.world.road_parameters` explains. Without stations for a road that is straight and level and has one
/// limit.
#[derive(Clone, Copy, Debug)]
pub struct CourseTable<'a> {
    /// Towards the overtaking side [1/m].
    pub curvature: &'a [f32],
    /// Positive where the road rises.
    pub sine_of_slope: &'a [f32],
    /// Radius by which drivers choose their speed [m].
    pub radius_along: &'a [f32],
    pub radius_against: &'a [f32],
    /// Sight distance from a car [m].
    pub sight_along: &'a [f32],
    pub sight_against: &'a [f32],
    /// Sight distance from a truck [m].
    pub truck_sight_along: &'a [f32],
    pub truck_sight_against: &'a [f32],
    /// Speed that the limits allow [m/s].
    pub allowed_speed_along: &'a [f32],
    pub allowed_speed_against: &'a [f32],
}

/// Rows of a `CourseTable`.
const COURSE_ROWS: usize = 10;

impl<'a> CourseTable<'a> {
    /// Views on the rows of the table of Python, one after the other.
    fn from_rows(table: &'a [f32]) -> Self {
        let stations = table.len() / COURSE_ROWS;
        let row = |k: usize| &table[k * stations..(k + 1) * stations];
        Self {
            curvature: row(0),
            sine_of_slope: row(1),
            radius_along: row(2),
            radius_against: row(3),
            sight_along: row(4),
            sight_against: row(5),
            truck_sight_along: row(6),
            truck_sight_against: row(7),
            allowed_speed_along: row(8),
            allowed_speed_against: row(9),
        }
    }
}

impl<'a> Road<'a> {
    /// That of a batch.
    pub fn of(inputs: &Inputs<'a>) -> Self {
        Self {
            num_lanes: inputs.num_lanes,
            boundaries: inputs.boundaries,
            film_path: inputs.film_path,
            overtaking_sign: inputs.overtaking_sign,
            pose: inputs.pose,
            ways: inputs.ways,
            course_table: CourseTable::from_rows(inputs.course_table),
        }
    }

    /// Whether vehicle `i` overtakes as the ego does: against oncoming traffic everybody.
    pub fn lets_overtake(&self, i: usize) -> bool {
        i == EGO || self.ways.has_oncoming_traffic
    }

    /// Whether it bends or rises anywhere, or has several limits.
    pub fn varies_along_road(&self) -> bool {
        !self.course_table.curvature.is_empty()
    }
}

/// Most stations between which sight, or the line between the directions, changes.
pub const MAX_STATIONS: usize = 64;

/// The directions of a road.
#[derive(Clone, Copy, Debug)]
pub struct Ways {
    /// Lanes of the road's own direction.
    pub num_own_lanes: usize,
    /// Whether others may come the other way.
    pub has_oncoming_traffic: bool,
    /// End of the road, from which oncoming vehicles count their stations [m].
    pub length: f32,
    /// Sum of the edges: what an oncoming vehicle takes its lateral position from [m].
    pub edge_sum: f32,
    /// Along and against the road: stations, how far one sees there [m], and how much more per metre.
    pub sight: [[[f32; MAX_STATIONS]; 3]; 2],
    /// Stations, and 1 from where on the line is not to be crossed by who drives along the road, and by who
    /// comes the other way.
    pub solid_line: [[f32; MAX_STATIONS]; 3],
}

/// The station_indices of a table, without the last one's repetitions.
#[inline(always)]
pub fn station_indices(stations: &[f32; MAX_STATIONS]) -> impl Iterator<Item = usize> + '_ {
    (0..MAX_STATIONS).take_while(|k| *k == 0 || stations[*k] > stations[*k - 1])
}

/// Steps between two decisions.
pub const SUBSTEPS: u32 = 5;

/// A length of step, and what follows from it.
#[derive(Clone, Copy, Debug)]
pub struct Stride {
    /// Its length [s].
    pub length: f32,
    /// Half of it.
    pub half: f32,
    /// One over it [1/s].
    pub per_second: f32,
    /// Share of the way to the wanted wheel angle.
    pub steering: f32,
    /// The same of the lean of a two-wheeler.
    pub leaning: f32,
    /// How far the front wheels turn at most [rad].
    pub most: f32,
}

impl Stride {
    /// A step of this length.
    pub fn of(c: &Constants, length: f32) -> Self {
        let half = 0.5 * length;
        Self {
            length,
            half,
            per_second: 1.0 / length,
            steering: length / (c.steering_lag + half),
            leaning: length / (c.two_wheeler_lag + half),
            most: c.steering_rate * length,
        }
    }
}

/// Quotients of constants: a division costs as much for one number as for sixteen.
#[derive(Clone, Copy, Debug)]
pub struct Rates {
    /// A step of 10 ms.
    pub fine: Stride,
    /// Five at once, from one decision to the next.
    pub coarse: Stride,
    /// Share of the answer to the side wind that is given in a decision.
    pub trimming: f32,
    /// Throttle that is taken back per speed above the limit [s/m].
    pub governing: f32,
    /// One over gravity [s^2/m].
    pub inverse_gravity: f32,
}

impl Rates {
    /// The quotients.
    pub fn of(c: &Constants) -> Self {
        Self {
            fine: Stride::of(c, c.step),
            coarse: Stride::of(c, c.decision),
            trimming: c.decision / c.wind_lag,
            governing: 1.0 / c.governor_band,
            inverse_gravity: 1.0 / c.gravity,
        }
    }
}

/// Everything that does not change during a block, but for a branch.
pub struct World<'a, S: Simd, const N: usize> {
    pub simd: S,
    pub c: &'a Constants,
    pub rates: Rates,
    pub road: &'a Road<'a>,
    pub p: [Vehicle<S>; N],
    pub q: Simulation<S>,
    /// Slots in use by any simulation of the block.
    pub count: usize,
    /// Whether any of its roads is a ring.
    pub is_ring: bool,
    pub key: [u32; 2],
    pub index_low: [u32; LANES],
    pub index_high: [u32; LANES],
}

impl<S: Simd, const N: usize> Seats for World<'_, S, N> {
    fn seat(&mut self, lane: usize, from: &Self, other: usize) {
        self.p.seat(lane, &from.p, other);
        self.q.seat(lane, &from.q, other);
        self.is_ring |= from.is_ring;
        self.index_low.seat(lane, &from.index_low, other);
        self.index_high.seat(lane, &from.index_high, other);
    }
}
