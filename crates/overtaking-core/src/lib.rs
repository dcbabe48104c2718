//! The overtaking engine: the model of `overtaking.sim.reference`, sixteen simulations at a time.
//!
//! Every module mirrors the Python module of the same name: the same formulas with the same operations
//! in the same order, so that both record the same bits. The sources of the formulas are given there.
//! Arithmetic is `+ - * / sqrt` and comparisons on `f32` only; no fused multiply-add, no libm.

#[macro_use]
mod fields;
#[macro_use]
mod names;

mod block;
mod collisions;
mod control;
pub mod draws;
pub mod driven;
mod dynamics;
mod ego;
pub mod elementary;
mod engine;
mod environment;
mod following;
mod gaps;
mod giving_way;
mod intent;
pub mod lanes;
mod mobil;
mod moment;
mod neighbours;
pub mod observation;
mod oncoming;
pub mod orders;
mod output;
mod passing;
mod perception;
mod philox;
mod plight;
pub mod pool;
mod recording;
mod state;
mod steering;
mod step;
pub mod stepper;
mod tile;
mod trace;
mod traffic;
mod words;
mod world;

pub use engine::{Inputs, Later, available_levels, current_level, simulate, supported};
pub use environment::{at_film, speed_columns};
pub use lanes::LANES;
pub use names::{Constants, SIMULATION_NAMES, VEHICLE_NAMES};
pub use output::{MAX_PERCEPTS, Output};
pub use tile::prefetch;
pub use world::{MAX_STATIONS, Ways};

/// Vehicle slots that the engine is compiled for.
pub const SLOTS: [usize; 3] = [8, 16, 32];

/// Most vehicle slots of a simulation.
pub const MAX_VEHICLES: usize = SLOTS[SLOTS.len() - 1];
