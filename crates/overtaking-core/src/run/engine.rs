//! What is simulated, in which order, on which threads, and at the SIMD width of which CPU.

use fearless_simd::{Level, Simd};
use rayon::prelude::*;

use crate::ego_action::ActionLog;
use crate::math::vectors::SIMD_LANES;
use crate::names::{ModelConstants, SIMULATION_NAMES};
use crate::params::RoadDirections;
use crate::recorder::output::Output;
use crate::run::block::{self, ThreadMemory};
use crate::{MAX_VEHICLES, SLOT_CAPACITIES};

/// Blocks that one thread advances together. More of them waste fewer lanes, until their states no
/// longer fit into the cache.
const BLOCKS_PER_SHARE: usize = 4;

/// A simulation and where its results go.
pub(crate) type SimulationOutput<'a> = (usize, Output<'a>);

/// Everything that a batch is simulated from.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// Vehicle parameters, (field, slot, simulation).
    pub vehicle: &'a [f32],
    /// Simulation parameters, (field, simulation).
    pub simulation: &'a [f32],
    /// Simulation numbers.
    pub scenario_index: &'a [u64],
    /// Vehicle slots.
    pub num_slots: usize,
    /// Constants of the model.
    pub constants: &'a ModelConstants,
    /// Driving lanes.
    pub num_lanes: usize,
    /// Lane borders, padded.
    pub boundaries: [f32; 9],
    /// Film factor of each lane, padded.
    pub film_path: [f32; 8],
    /// Driving side.
    pub overtaking_sign: f32,
    /// x, y, heading of the road, cosine and sine.
    pub pose: [f32; 5],
    /// Its directions.
    pub directions: RoadDirections,
    /// Rows of `Road::course`, one after the other.
    pub course_table: &'a [f32],
    /// Key of the random numbers.
    pub seed: u64,
    /// Steps between recorded frames.
    pub steps_per_frame: u32,
    /// What another driver did with the ego.
    pub action_log: Option<ActionLog<'a>>,
}

/// Parameters that take over at a step, for branches.
///
/// Vehicles are displaced and sped up by as much as their starts differ from those before.
#[derive(Clone, Copy)]
pub struct ParameterSwitch<'a> {
    /// Vehicle parameters from then on.
    pub vehicle: &'a [f32],
    /// Simulation parameters from then on.
    pub simulation: &'a [f32],
    /// Simulation numbers from then on: what is drawn at later decisions.
    pub scenario_index: &'a [u64],
    /// The ego's errors of distance and of speed at the step, (2, simulation); `None` leaves them as they are.
    pub judgement_errors: Option<&'a [f32]>,
    /// The step.
    pub step: u32,
}

/// The SIMD level `name`, or the best one; `None` if this CPU lacks it.
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

/// The SIMD level `name`, or the best one.
///
/// # Errors
/// It is unknown or not supported by this CPU.
pub fn require_level(forced: Option<&str>) -> Result<Level, String> {
    let message = || {
        format!(
            "SIMD level {} is not supported by this CPU",
            forced.unwrap_or("?")
        )
    };
    find_level(forced).ok_or_else(message)
}

/// Every SIMD level that the engine has, and whether this CPU can run it.
pub fn simd_levels() -> Vec<(&'static str, bool)> {
    ["avx512", "avx2", "portable"]
        .map(|name| (name, find_level(Some(name)).is_some()))
        .to_vec()
}

/// Name of the SIMD level that is used when none is asked for.
pub fn default_level_name() -> &'static str {
    ["avx512", "avx2", "portable"]
        .into_iter()
        .find(|name| find_level(Some(name)).is_some())
        .unwrap_or("portable")
}

/// Simulate a batch at a SIMD level.
///
/// Generic, so it is compiled where it is called: in `overtaking-avx` and `overtaking-portable`, which
/// two cores compile at the same time.
///
/// # Errors
/// There are too many vehicles, or the room for frames does not consist of whole tiles.
pub fn simulate<S: Simd>(
    simd: S,
    inputs: &Inputs<'_>,
    switches: &[ParameterSwitch<'_>],
    out: Output<'_>,
) -> Result<(), String> {
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

/// Simulate all blocks of a batch, with room for `N` vehicles.
fn run_blocks<S: Simd, const N: usize>(
    simd: S,
    inputs: &Inputs<'_>,
    later: &[ParameterSwitch<'_>],
    out: Output<'_>,
) {
    let order = order_by_similarity(inputs);
    let mut places: Vec<_> = out.into_simulations().into_iter().map(Some).collect();
    let seats: Vec<_> = order
        .into_iter()
        .filter_map(|simulation| Some((simulation, places[simulation].take()?)))
        .collect();
    shares(seats)
        .into_par_iter()
        .for_each_init(ThreadMemory::<N>::default, |scratch, share| {
            block::run(simd, inputs, later, share, scratch);
        });
}

/// The simulations from the fullest to the emptiest, and those with the same weather side by side: a
/// block works on as many vehicles as its fullest has, and on water and gusts if any simulation has them.
pub(crate) fn order_by_similarity(inputs: &Inputs<'_>) -> Vec<usize> {
    let batch = inputs.scenario_index.len();
    let valid = &inputs.vehicle[..inputs.num_slots * batch];
    let vehicles = |simulation: usize| {
        (0..inputs.num_slots)
            .filter(|slot| valid[slot * batch + simulation] > 0.0)
            .count()
    };
    let weather = ["puddle_film", "film_rain_factor", "gust_gain"].map(|name| {
        let row = SIMULATION_NAMES.iter().position(|known| *known == name);
        row.map_or(&[][..], |row| &inputs.simulation[row * batch..][..batch])
    });
    let mut order: Vec<_> = (0..batch).collect();
    order.sort_by_cached_key(|simulation| {
        let has = weather.map(|values| values.get(*simulation).is_some_and(|value| *value > 0.0));
        std::cmp::Reverse((vehicles(*simulation), has))
    });
    order
}

/// Simulations in portions for the threads: several blocks each, so that they can be merged, but
/// enough portions for every thread.
pub(crate) fn shares(mut seats: Vec<SimulationOutput<'_>>) -> Vec<Vec<SimulationOutput<'_>>> {
    let portions = seats.len().div_ceil(SIMD_LANES * BLOCKS_PER_SHARE);
    let wanted = portions.max(rayon::current_num_threads());
    let size = seats
        .len()
        .div_ceil(wanted)
        .next_multiple_of(SIMD_LANES)
        .max(SIMD_LANES);
    let mut shares = Vec::with_capacity(wanted);
    while !seats.is_empty() {
        let rest = seats.split_off(size.min(seats.len()));
        shares.push(std::mem::replace(&mut seats, rest));
    }
    shares
}
