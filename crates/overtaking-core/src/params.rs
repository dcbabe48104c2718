//! What does not change during a block, as `overtaking.world.step_parameters` gives it.

use fearless_simd::Simd;

use crate::math::vectors::{CopyLane, SIMD_LANES};
use crate::names::{ModelConstants, SimulationParams, VehicleParams};
use crate::run::engine::Inputs;
use crate::state::EGO_SLOT;

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
    pub directions: RoadDirections,
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
            directions: inputs.directions,
            course_table: CourseTable::from_rows(inputs.course_table),
        }
    }

    /// Whether vehicle `i` overtakes as the ego does: against oncoming traffic everybody.
    pub fn can_overtake(&self, i: usize) -> bool {
        i == EGO_SLOT || self.directions.has_oncoming_traffic
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
pub struct RoadDirections {
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
pub struct StepLength {
    /// Its length [s].
    pub length: f32,
    /// Half of it.
    pub half: f32,
    /// One over it [1/s].
    pub inverse: f32,
    /// Share of the way to the wanted wheel angle.
    pub steering: f32,
    /// The same of the lean of a two-wheeler.
    pub leaning: f32,
    /// How far the front wheels turn at most [rad].
    pub max_wheel_turn: f32,
}

impl StepLength {
    /// A step of this length.
    pub fn of(constants: &ModelConstants, length: f32) -> Self {
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

/// Quotients of constants: a division costs as much for one number as for sixteen.
#[derive(Clone, Copy, Debug)]
pub struct DerivedConstants {
    /// A step of 10 ms.
    pub fine: StepLength,
    /// Five at once, from one decision to the next.
    pub coarse: StepLength,
    /// Share of the answer to the side wind that is given in a decision.
    pub wind_trim_share: f32,
    /// Throttle that is taken back per speed above the limit [s/m].
    pub per_governor_band: f32,
    /// One over gravity [s^2/m].
    pub inverse_gravity: f32,
}

impl DerivedConstants {
    /// The quotients.
    pub fn of(constants: &ModelConstants) -> Self {
        Self {
            fine: StepLength::of(constants, constants.step),
            coarse: StepLength::of(constants, constants.decision),
            wind_trim_share: constants.decision / constants.wind_lag,
            per_governor_band: 1.0 / constants.governor_band,
            inverse_gravity: 1.0 / constants.gravity,
        }
    }
}

/// Everything that does not change during a block, but for a branch.
pub struct Params<'a, S: Simd, const N: usize> {
    pub simd: S,
    pub constants: &'a ModelConstants,
    pub derived: DerivedConstants,
    pub road: &'a Road<'a>,
    pub vehicles: [VehicleParams<S>; N],
    pub simulations: SimulationParams<S>,
    /// Slots in use by any simulation of the block.
    pub num_slots_in_use: usize,
    /// Whether any of its roads is a ring.
    pub is_ring: bool,
    pub key: [u32; 2],
    pub scenario_index_low: [u32; SIMD_LANES],
    pub scenario_index_high: [u32; SIMD_LANES],
}

impl<S: Simd, const N: usize> CopyLane for Params<'_, S, N> {
    fn copy_lane(&mut self, lane: usize, from: &Self, other: usize) {
        self.vehicles.copy_lane(lane, &from.vehicles, other);
        self.simulations.copy_lane(lane, &from.simulations, other);
        self.is_ring |= from.is_ring;
        self.scenario_index_low
            .copy_lane(lane, &from.scenario_index_low, other);
        self.scenario_index_high
            .copy_lane(lane, &from.scenario_index_high, other);
    }
}
/// A struct whose fields are loaded in order from rows of sixteen numbers.
macro_rules! parameter_rows {
    ($(#[$doc:meta])* $name:ident, $names:ident { $($field:ident),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub struct $name<S: Simd> { $(pub(crate) $field: F32<S>),* }

        /// Names of the fields, in the order in which they are handed over.
        pub const $names: &[&str] = &[$(stringify!($field)),*];

        impl<S: Simd> CopyLane for $name<S> {
            fn copy_lane(&mut self, lane: usize, from: &Self, other: usize) {
                $(self.$field.copy_lane(lane, &from.$field, other);)*
            }
        }

        impl<S: Simd> $name<S> {
            /// Fill the fields from consecutive rows.
            #[inline(always)]
            pub(crate) fn load(simd: S, mut row: impl FnMut(usize) -> [f32; SIMD_LANES]) -> Self {
                let mut at = 0;
                $(
                    let $field = F32::simd_from(simd, row(at));
                    at += 1;
                )*
                debug_assert_eq!(at, $names.len());
                Self { $($field),* }
            }
        }
    };
}

/// A struct of numbers filled in order from a slice.
macro_rules! named_constants {
    ($(#[$doc:meta])* $name:ident { $($field:ident),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default)]
        pub struct $name {
            $(
                #[allow(missing_docs)] // `overtaking.world.constants` documents them.
                pub $field: f32,
            )*
            /// Peak friction of a new tyre at (speed, film) station_indices.
            pub friction_new: [[f32; 4]; 3],
            /// The same of a worn one.
            pub friction_worn: [[f32; 4]; 3],
            /// Speed station_indices [m/s].
            pub friction_speeds: [f32; 3],
            /// Film station_indices [mm].
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
                let mut rest = values.iter();
                $(if let Some(value) = rest.next() { self.$field = *value; })*
            }
        }
    };
}
