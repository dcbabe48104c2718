//! The overtaking engine: the model of `overtaking.sim.reference`, sixteen simulations at a time.
//!
//! The modules at the top level mirror the Python modules of the same name: the same formulas with the same operations
//! in the same order, so that both record the same bits. The Python modules name the sources of the formulas. `math`
//! has vectors, elementary functions and random numbers; `run` has the loop over time. Arithmetic is `+ - * / sqrt`
//! and comparisons on `f32` only: fused multiply-add and the mathematical functions of the system round differently on
//! different machines.

#[macro_use]
mod params;
#[macro_use]
mod names;

mod acceleration;
mod car_following;
mod collisions;
mod decision_context;
pub mod ego_action;
pub mod external_motion;
mod gap_acceptance;
mod lane_change;
pub mod math;
mod neighbour_search;
pub mod observation_table;
mod oncoming;
mod overtake;
mod pass_continuation;
mod passing;
pub mod pedal_driving;
mod perception;
pub mod pool;
mod recorder;
mod road_conditions;
pub mod run;
mod state;
mod steering;
mod vehicle_dynamics;
mod vehicle_handle;

pub use math::vectors::SIMD_LANES;
pub use names::{ModelConstants, SIMULATION_NAMES, VEHICLE_NAMES, neighbour_role};
pub use params::{CourseTable, MAX_STATIONS, Road, RoadDirections, RoadPose};
pub use recorder::frame_tiles::prefetch;
pub use recorder::output::{MAX_PERCEPTS, Output};
pub use road_conditions::{friction_at_film, friction_at_speed};
pub use run::engine::{
    Inputs, ParameterSwitch, default_level_name, require_level, simd_levels, simulate,
};

/// Numbers of vehicle slots that the engine is compiled for; a batch uses the smallest that holds its vehicles.
pub const SLOT_CAPACITIES: [usize; 3] = [8, 16, 32];

/// Largest number of vehicle slots of a simulation.
pub const MAX_VEHICLES: usize = SLOT_CAPACITIES[SLOT_CAPACITIES.len() - 1];
