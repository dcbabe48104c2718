//! Simulates a batch: chooses the SIMD level, orders the simulations and distributes them over threads.
//!
//! A *batch* is a number of simulations with the same road and number of vehicle slots. Blocks of sixteen simulations
//! advance together in the lanes of SIMD vectors (`block`). A *share* is the part of a batch that one thread simulates,
//! in several blocks. Array shapes are in row-major order, flat: in (field, slot, simulation), the numbers of one field
//! and slot are adjacent.

use std::sync::Arc;

use fearless_simd::{Level, Simd};
use rayon::prelude::*;

use crate::ego_action::ActionLog;
use crate::math::vectors::SIMD_LANES;
use crate::names::{ModelConstants, SIMULATION_NAMES};
use crate::params::Road;
use crate::recorder::output::Output;
use crate::run::block::{self, ThreadMemory};
use crate::{MAX_VEHICLES, SLOT_CAPACITIES};

/// Largest number of blocks that one thread advances together.
///
/// More blocks leave fewer lanes without a running simulation, but need more cache. Measured at AVX2 with 4 and 8
/// blocks: 8 were 6 to 9 % faster with more than 8 slots, and up to 6 % slower with 8 slots, where the states of 4
/// blocks stay in the cache.
pub(crate) const fn max_blocks_per_share(slots: usize) -> usize {
    if slots > SLOT_CAPACITIES[0] { 8 } else { 4 }
}

/// Least number of shares for each of several threads. A choice.
///
/// Shares take different times. With fewer shares, one thread would wait long for another at the end.
const MIN_SHARES_PER_THREAD: usize = 4;

/// Number of blocks down to which shares shrink for `MIN_SHARES_PER_THREAD`. They shrink further only to give each
/// thread one share.
///
/// A choice: the smaller of the two numbers measured above. It has no effect where no share has more blocks.
const BLOCKS_PER_SMALL_SHARE: usize = 4;

/// Position of a simulation in its batch, and the memory for its results.
pub(crate) type SimulationOutput<'a> = (usize, Output<'a>);

/// All inputs of a batch. `overtaking.world.step_parameters` computes them.
#[derive(Clone)]
pub struct Inputs<'a> {
    /// Parameters of vehicles and drivers, (field, slot, simulation).
    pub vehicle: &'a [f32],
    /// Simulation parameters, (field, simulation).
    pub simulation: &'a [f32],
    /// Scenario index of each simulation, which its random numbers depend on, (simulation).
    pub scenario_index: &'a [u64],
    /// Number of vehicle slots of each simulation.
    pub num_slots: usize,
    /// Constants of the model.
    pub constants: Arc<ModelConstants>,
    /// Road of all simulations.
    pub road: Arc<Road>,
    /// Seed of the data set: the key of the random numbers.
    pub seed: u64,
    /// Number of steps of 10 ms between recorded frames.
    pub steps_per_frame: u32,
    /// Recorded actions of an external driver of the ego; `None` if the model drives.
    pub action_log: Option<ActionLog<'a>>,
}

/// Parameters that replace the earlier ones at a step, for a branch (a simulation that continues differently).
///
/// At that step, station and speed of each vehicle change by the new `start_s` and `start_speed` minus the earlier
/// ones.
#[derive(Clone, Copy)]
pub struct ParameterSwitch<'a> {
    /// Parameters of vehicles and drivers from that step on, (field, slot, simulation).
    pub vehicle: &'a [f32],
    /// Simulation parameters from that step on, (field, simulation).
    pub simulation: &'a [f32],
    /// Scenario index of each simulation from that step on; it determines the random numbers of later decisions.
    pub scenario_index: &'a [u64],
    /// Errors of the ego in judging distance and speed at that step, (2, simulation); `None` keeps the errors.
    pub judgement_errors: Option<&'a [f32]>,
    /// Number of the step of 10 ms at which the parameters change.
    pub step: u32,
}

/// The SIMD level `name`, or the fastest one without a name; `None` if the level is unknown or this CPU lacks it.
pub(crate) fn find_level(name: Option<&str>) -> Option<Level> {
    let best = Level::new();
    match name {
        None => Some(best),
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Some("avx512") => best.as_avx512().map(Level::Avx512),
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Some("avx2") => best.as_avx2().map(Level::Avx2),
        Some("portable") => Some(Level::baseline()),
        Some(_) => None,
    }
}

/// The SIMD level `forced`, or the fastest level of this CPU without a name.
///
/// # Errors
/// The level is unknown or not supported by this CPU.
pub fn require_level(forced: Option<&str>) -> Result<Level, String> {
    let message = || {
        format!(
            "SIMD level {} is not supported by this CPU",
            forced.unwrap_or("?")
        )
    };
    find_level(forced).ok_or_else(message)
}

/// The SIMD levels of the engine, fastest first, each with whether this CPU supports it.
pub fn simd_levels() -> Vec<(&'static str, bool)> {
    ["avx512", "avx2", "portable"]
        .map(|name| (name, find_level(Some(name)).is_some()))
        .to_vec()
}

/// Name of the fastest SIMD level of this CPU, which the engine uses by default.
pub fn default_level_name() -> &'static str {
    ["avx512", "avx2", "portable"]
        .into_iter()
        .find(|name| find_level(Some(name)).is_some())
        .unwrap_or("portable")
}

/// Simulate a batch at a SIMD level, and write the results to `out`.
///
/// The function is generic, so it is compiled in the crates that call it, `overtaking-avx` and `overtaking-portable`.
/// Two cores can compile these at the same time.
///
/// # Errors
/// There are more than `MAX_VEHICLES` slots, or the number of frames in `out` is not a multiple of sixteen.
pub fn simulate<S: Simd>(
    simd: S,
    inputs: &Inputs<'_>,
    switches: &[ParameterSwitch<'_>],
    out: Output<'_>,
) -> Result<(), String> {
    // The recorder writes sixteen frames at once.
    if !out.frames.is_multiple_of(SIMD_LANES) {
        return Err(format!(
            "room for {} frames is not a multiple of {SIMD_LANES}",
            out.frames
        ));
    }
    match SLOT_CAPACITIES
        .into_iter()
        .find(|slots| inputs.num_slots <= *slots)
    {
        Some(8) => run_blocks::<S, 8>(simd, inputs, switches, out),
        Some(16) => run_blocks::<S, 16>(simd, inputs, switches, out),
        Some(32) => run_blocks::<S, 32>(simd, inputs, switches, out),
        _ => {
            return Err(format!(
                "{} slots are more than {MAX_VEHICLES}",
                inputs.num_slots
            ));
        }
    }
    Ok(())
}

/// Simulate all blocks of a batch, compiled for `N` vehicle slots.
fn run_blocks<S: Simd, const N: usize>(
    simd: S,
    inputs: &Inputs<'_>,
    switches: &[ParameterSwitch<'_>],
    out: Output<'_>,
) {
    let order = order_by_similarity(inputs);
    let mut outputs: Vec<_> = out.into_simulations().into_iter().map(Some).collect();
    let simulations: Vec<_> = order
        .into_iter()
        .filter_map(|simulation| Some((simulation, outputs[simulation].take()?)))
        .collect();
    divide_into_shares(simulations, max_blocks_per_share(N))
        .into_par_iter()
        .for_each_init(ThreadMemory::<N>::default, |memory, share| {
            block::run(simd, inputs, switches, share, memory);
        });
}

/// Order the simulations by number of vehicles, most first, then by weather, so that similar simulations share a block.
///
/// A block computes as many vehicles as its simulation with most vehicles has, and water and gusts if any of its
/// simulations has them.
pub(crate) fn order_by_similarity(inputs: &Inputs<'_>) -> Vec<usize> {
    let batch = inputs.scenario_index.len();
    // `valid`, 1 for a slot with a vehicle, is the first field of vehicles.
    let valid = &inputs.vehicle[..inputs.num_slots * batch];
    let num_vehicles = |simulation: usize| {
        (0..inputs.num_slots)
            .filter(|slot| valid[slot * batch + simulation] > 0.0)
            .count()
    };
    let weather = ["puddle_film", "film_rain_factor", "gust_gain"].map(|name| {
        let row = SIMULATION_NAMES.iter().position(|field| *field == name);
        row.map_or(&[][..], |row| &inputs.simulation[row * batch..][..batch])
    });
    let mut order: Vec<_> = (0..batch).collect();
    order.sort_by_cached_key(|simulation| {
        let has_weather =
            weather.map(|values| values.get(*simulation).is_some_and(|value| *value > 0.0));
        std::cmp::Reverse((num_vehicles(*simulation), has_weather))
    });
    order
}

/// Divide simulations into shares of at most `max_blocks` blocks, each simulated by one thread.
///
/// The blocks of a share are merged when simulations end. A small batch is divided into smaller shares of at least one
/// block, so that every thread has work.
pub(crate) fn divide_into_shares<T>(mut simulations: Vec<T>, max_blocks: usize) -> Vec<Vec<T>> {
    let num_shares_of = |blocks: usize| simulations.len().div_ceil(SIMD_LANES * blocks);
    let num_threads = rayon::current_num_threads();
    // A single thread waits for no other thread.
    let num_balanced_shares = if num_threads > 1 {
        num_shares_of(BLOCKS_PER_SMALL_SHARE).min(MIN_SHARES_PER_THREAD * num_threads)
    } else {
        1
    };
    let num_shares = num_shares_of(max_blocks)
        .max(num_balanced_shares)
        .max(num_threads);
    let size = simulations
        .len()
        .div_ceil(num_shares)
        .next_multiple_of(SIMD_LANES)
        .max(SIMD_LANES);
    let mut shares = Vec::with_capacity(num_shares);
    while !simulations.is_empty() {
        let remaining = simulations.split_off(size.min(simulations.len()));
        shares.push(std::mem::replace(&mut simulations, remaining));
    }
    shares
}
