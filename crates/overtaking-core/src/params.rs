//! Parameters of a block of sixteen simulations: road, vehicles, drivers, weather and constants of the model.
//!
//! `overtaking.world.step_parameters` computes them in Python before the simulation starts. Only a branch (a simulation
//! that continues differently) replaces them during a simulation. Station `s` is the position along the road [m]. The
//! lateral position `d` is positive towards the overtaking side [m]. *Along* means in the road's own direction,
//! *against* in the direction of oncoming traffic. Each lane of a vector belongs to one simulation of the block.

use std::sync::Arc;

use fearless_simd::Simd;

use crate::math::vectors::{CopyLane, SIMD_LANES};
use crate::names::{ModelConstants, SimulationParams, VehicleParams};
use crate::state::EGO_SLOT;

/// The road of all simulations of a batch, with the lateral axis towards the overtaking side.
#[derive(Clone, Debug)]
pub struct Road {
    /// Number of lanes that vehicles use, including the opposing lane if there is oncoming traffic.
    pub num_lanes: usize,
    /// Lane borders of at most eight lanes, from the kerb side to the overtaking side, padded with copies of the last
    /// one [m].
    pub boundaries: [f32; 9],
    /// Factor on the thickness of the water film in each lane. It grows with the lane's distance from the crown of the
    /// road, from which the water drains; padded [1].
    pub film_path: [f32; 8],
    /// +1 in right-hand traffic, -1 in left-hand traffic.
    pub overtaking_sign: f32,
    /// Place of the road in the world.
    pub pose: RoadPose,
    /// Own direction and oncoming traffic.
    pub directions: RoadDirections,
    /// Geometry, sight distances and speed limits by station.
    pub course_table: CourseTable,
}

/// Place of a road in the plane of the world.
#[derive(Clone, Copy, Debug)]
pub struct RoadPose {
    /// World coordinate x of the point (s, d) = (0, 0) [m]. It is 0 for a road that bends, as are `y0` and `heading`:
    /// Python then converts the recorded positions to the world, after the simulation.
    pub x0: f32,
    /// World coordinate y of this point [m].
    pub y0: f32,
    /// Heading of the road, anticlockwise from the x axis [rad].
    pub heading: f32,
    /// Cosine of the heading [1].
    pub cosine: f32,
    /// Sine of the heading [1].
    pub sine: f32,
}

impl From<[f32; 5]> for RoadPose {
    fn from([x0, y0, heading, cosine, sine]: [f32; 5]) -> Self {
        Self {
            x0,
            y0,
            heading,
            cosine,
            sine,
        }
    }
}

/// Geometry, sight distances and speed limits of a road at stations 2 m apart, from s = 0.
///
/// The rows are empty if the road is straight and level and has one speed limit. `CourseTable` in
/// `overtaking.world.road_parameters` has the formulas.
#[derive(Clone, Debug, Default)]
pub struct CourseTable {
    /// Curvature, positive where the road bends towards the overtaking side [1/m].
    pub curvature: Box<[f32]>,
    /// Sine of the slope, positive where the road rises along `s` [1].
    pub sine_of_slope: Box<[f32]>,
    /// Radius by which drivers choose their speed; large where bends are wide or far ahead [m].
    pub radius_along: Box<[f32]>,
    /// The same for traffic against the road.
    pub radius_against: Box<[f32]>,
    /// Length of road that a car driver sees past bends and over crests [m].
    pub sight_along: Box<[f32]>,
    /// The same for traffic against the road.
    pub sight_against: Box<[f32]>,
    /// Length of road that a truck driver sees, whose eyes are higher [m].
    pub truck_sight_along: Box<[f32]>,
    /// The same for traffic against the road.
    pub truck_sight_against: Box<[f32]>,
    /// Largest speed from which a driver can slow down in time for each speed limit here and ahead [m/s].
    pub allowed_speed_along: Box<[f32]>,
    /// The same for traffic against the road.
    pub allowed_speed_against: Box<[f32]>,
}

/// Number of rows of a `CourseTable`.
const COURSE_ROWS: usize = 10;

impl CourseTable {
    /// Split a flat array of Python, (row, station), into its rows.
    pub fn from_rows(table: &[f32]) -> Self {
        let stations = table.len() / COURSE_ROWS;
        let row = |index: usize| table[index * stations..(index + 1) * stations].into();
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

impl Road {
    /// Whether the driver in `slot` overtakes through the stages of the ego's model.
    ///
    /// With oncoming traffic all drivers do. Otherwise only the ego does, and other drivers change lanes by MOBIL: a
    /// simplification of the model.
    pub fn can_overtake(&self, slot: usize) -> bool {
        slot == EGO_SLOT || self.directions.has_oncoming_traffic
    }

    /// Whether the road bends, rises or has several speed limits.
    pub fn varies_along_road(&self) -> bool {
        !self.course_table.curvature.is_empty()
    }
}

/// Number of stations in a `KnotTable` and in `LineMarks`. Chosen; `overtaking.world.road_parameters` has the same
/// number. Tables of fewer stations are padded with copies of the last one.
pub const MAX_STATIONS: usize = 64;

/// A quantity that is linear between stations of a road.
#[derive(Clone, Copy, Debug)]
pub struct KnotTable {
    /// Stations [m].
    pub stations: [f32; MAX_STATIONS],
    /// The quantity at each station.
    pub values: [f32; MAX_STATIONS],
    /// Change of the quantity per metre from each station to the next.
    pub slopes: [f32; MAX_STATIONS],
}

impl From<[[f32; MAX_STATIONS]; 3]> for KnotTable {
    fn from([stations, values, slopes]: [[f32; MAX_STATIONS]; 3]) -> Self {
        Self {
            stations,
            values,
            slopes,
        }
    }
}

/// Marks of the line between the two directions of a road.
#[derive(Clone, Copy, Debug)]
pub struct LineMarks {
    /// Stations [m].
    pub stations: [f32; MAX_STATIONS],
    /// 1 if traffic along the road must not cross the line from this station to the next, else 0.
    pub is_solid_along: [f32; MAX_STATIONS],
    /// The same for oncoming traffic.
    pub is_solid_against: [f32; MAX_STATIONS],
}

impl From<[[f32; MAX_STATIONS]; 3]> for LineMarks {
    fn from([stations, is_solid_along, is_solid_against]: [[f32; MAX_STATIONS]; 3]) -> Self {
        Self {
            stations,
            is_solid_along,
            is_solid_against,
        }
    }
}

/// The two directions of a road, and the line between them.
#[derive(Clone, Copy, Debug)]
pub struct RoadDirections {
    /// Number of lanes of the road's own direction.
    pub num_own_lanes: usize,
    /// Whether oncoming vehicles may use the opposing lane.
    pub has_oncoming_traffic: bool,
    /// End of the road, from which oncoming vehicles count their stations [m].
    pub length: f32,
    /// Sum of the lateral positions of both edges; an oncoming vehicle at `d` is at `edge_sum - d`
    /// in the coordinates of its own direction [m].
    pub edge_sum: f32,
    /// Sight distance that a map states along the road; the sight of `CourseTable` then limits nothing [m].
    pub sight_along: KnotTable,
    /// Sight distance that a map states for oncoming traffic [m].
    pub sight_against: KnotTable,
    /// Line between the directions.
    pub line_marks: LineMarks,
}

/// Indices of the stations of a table, without the copies of the last station that pad it.
#[inline(always)]
pub fn station_indices(stations: &[f32; MAX_STATIONS]) -> impl Iterator<Item = usize> + '_ {
    (0..MAX_STATIONS).take_while(|index| *index == 0 || stations[*index] > stations[*index - 1])
}

/// Number of steps of 10 ms between two decisions of drivers, which are 50 ms apart.
pub const SUBSTEPS: u32 = 5;

/// The length of an integration step, and numbers that depend on it and on constants alone.
#[derive(Clone, Copy, Debug)]
pub struct StepLength {
    /// Length of the step [s].
    pub length: f32,
    /// Half the length [s].
    pub half: f32,
    /// Reciprocal of the length [1/s].
    pub inverse: f32,
    /// Share of the remaining difference to the requested wheel angle that the wheels turn in a step [1]. It is a
    /// first-order lag, integrated by the trapezoidal rule.
    pub steering: f32,
    /// The same share for the lean of a two-wheeler [1].
    pub leaning: f32,
    /// Largest turn of the front wheels in a step [rad].
    pub max_wheel_turn: f32,
}

impl StepLength {
    /// A step of `length` seconds.
    pub(crate) fn new(constants: &ModelConstants, length: f32) -> Self {
        let half = 0.5 * length;
        Self {
            length,
            half,
            inverse: 1.0 / length,
            steering: length / (constants.steering_lag + half),
            leaning: length / (constants.two_wheeler_lag + half),
            max_wheel_turn: constants.steering_rate * length,
        }
    }
}

/// Quotients of constants, computed once: each division of a single number costs as much as one of sixteen.
#[derive(Clone, Copy, Debug)]
pub struct DerivedConstants {
    /// A step of 10 ms, for recordings with frames between decisions and for vehicles that pedals drive.
    pub fine: StepLength,
    /// A step of 50 ms, from one decision to the next.
    pub coarse: StepLength,
    /// Share of the remaining difference to the steering that balances crosswind, which a driver corrects at each
    /// decision [1].
    pub wind_trim_share: f32,
    /// Reciprocal of the speed range in which the governor of a vehicle closes the throttle [s/m].
    pub per_governor_band: f32,
    /// Reciprocal of the acceleration of gravity [s^2/m].
    pub inverse_gravity: f32,
}

impl DerivedConstants {
    /// Compute the quotients of the constants of the model.
    pub fn from_constants(constants: &ModelConstants) -> Self {
        Self {
            fine: StepLength::new(constants, constants.step),
            coarse: StepLength::new(constants, constants.decision),
            wind_trim_share: constants.decision / constants.wind_lag,
            per_governor_band: 1.0 / constants.governor_band,
            inverse_gravity: 1.0 / constants.gravity,
        }
    }
}

/// All parameters of a block. Only a branch, by a `ParameterSwitch`, changes their values.
pub struct Params<S: Simd, const N: usize> {
    /// Token of the SIMD level, from which vectors are made.
    pub simd: S,
    /// Constants of the model.
    pub constants: Arc<ModelConstants>,
    /// Quotients of these constants.
    pub derived: DerivedConstants,
    /// Road of all simulations.
    pub road: Arc<Road>,
    /// Parameters of vehicle and driver in each slot. A slot is the number of a vehicle in its simulation.
    pub vehicles: [VehicleParams<S>; N],
    /// Parameters of each simulation, such as its weather.
    pub simulations: SimulationParams<S>,
    /// Number of slots up to the last one that a running simulation of the block uses.
    pub num_slots_in_use: usize,
    /// Whether any simulation of the block has a `ring_length`, after which its road begins again.
    pub is_ring: bool,
    /// Lower and upper 32 bits of the seed.
    pub key: [u32; 2],
    /// Lower 32 bits of the scenario index of each simulation, which its random numbers depend on.
    pub scenario_index_low: [u32; SIMD_LANES],
    /// Upper 32 bits of the scenario index of each simulation.
    pub scenario_index_high: [u32; SIMD_LANES],
}

impl<S: Simd, const N: usize> CopyLane for Params<S, N> {
    fn copy_lane(&mut self, lane: usize, source: &Self, source_lane: usize) {
        self.vehicles.copy_lane(lane, &source.vehicles, source_lane);
        self.simulations
            .copy_lane(lane, &source.simulations, source_lane);
        self.is_ring |= source.is_ring;
        // The caller updates `num_slots_in_use`, which depends on all lanes.
        self.scenario_index_low
            .copy_lane(lane, &source.scenario_index_low, source_lane);
        self.scenario_index_high
            .copy_lane(lane, &source.scenario_index_high, source_lane);
    }
}

/// Declare a struct of vectors, whose fields are loaded in order from rows of sixteen numbers.
macro_rules! parameter_rows {
    ($(#[$doc:meta])* $name:ident, $names:ident { $($field:ident),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub struct $name<S: Simd> { $(pub(crate) $field: F32<S>),* }

        /// Names of the fields, in the order of the rows that Python passes.
        pub const $names: &[&str] = &[$(stringify!($field)),*];

        impl<S: Simd> CopyLane for $name<S> {
            fn copy_lane(&mut self, lane: usize, source: &Self, source_lane: usize) {
                $(self.$field.copy_lane(lane, &source.$field, source_lane);)*
            }
        }

        impl<S: Simd> $name<S> {
            /// Fill the fields in order: field number `k` from `row(k)`, one number per simulation.
            #[inline(always)]
            pub(crate) fn load(simd: S, mut row: impl FnMut(usize) -> [f32; SIMD_LANES]) -> Self {
                let mut index = 0;
                $(
                    let $field = F32::simd_from(simd, row(index));
                    index += 1;
                )*
                debug_assert_eq!(index, $names.len());
                Self { $($field),* }
            }
        }
    };
}

/// Declare the struct of constants of the model: numbers that are filled in order from a slice, and friction tables.
macro_rules! named_constants {
    ($(#[$doc:meta])* $name:ident { $($field:ident),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default)]
        pub struct $name {
            $(
                #[allow(missing_docs)] // `overtaking.world.constants` documents them.
                pub $field: f32,
            )*
            /// Peak friction of a new tyre, (speed, thickness of the water film) [1].
            pub friction_new: [[f32; 4]; 3],
            /// Peak friction of a worn tyre, same shape [1].
            pub friction_worn: [[f32; 4]; 3],
            /// Speeds of the rows of both tables [m/s].
            pub friction_speeds: [f32; 3],
            /// Film thicknesses of the columns of both tables [mm].
            pub friction_films: [f32; 4],
        }

        impl $name {
            /// Names of the numbers, in order.
            pub const NAMES: &'static [&'static str] = &[$(stringify!($field)),*];

            /// Set the numbers from a slice in the order of `NAMES`.
            ///
            /// # Panics
            /// If the slice has another length.
            pub fn set(&mut self, values: &[f32]) {
                assert_eq!(values.len(), Self::NAMES.len());
                let mut remaining = values.iter();
                $(if let Some(value) = remaining.next() { self.$field = *value; })*
            }
        }
    };
}
