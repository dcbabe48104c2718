//! Blocks of sixteen simulations, spread over threads, at the SIMD width of this CPU.

use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd};
use rayon::prelude::*;

use crate::collisions::{Pairs, collide, leave_road, near_pairs};
use crate::fields::{Constants, Simulation, Vehicle};
use crate::lanes::{LANES, dispatch, splat};
use crate::neighbours::{Neighbours, find_neighbours};
use crate::output::Output;
use crate::perception::Beliefs;
use crate::recording::Recorder;
use crate::state::{EGO, History, Road, State, World};
use crate::tile::Tile;
use crate::{MAX_VEHICLES, SLOTS};
use crate::{control, dynamics, ego, environment, mobil, perception, steering};

/// Evaluate an expression in a function of its own that may use the SIMD features of the CPU.
macro_rules! outlined {
    ($simd:expr, $body:expr) => {
        $simd.vectorize(
            #[inline(always)]
            || $body,
        )
    };
}

/// Steps between two decisions.
const SUBSTEPS: u32 = 5;

/// Everything that a batch is simulated from.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// Vehicle parameters, (field, slot, simulation).
    pub vehicle: &'a [f32],
    /// Simulation parameters, (field, simulation).
    pub simulation: &'a [f32],
    /// Simulation numbers.
    pub index: &'a [u64],
    /// Vehicle slots.
    pub slots: usize,
    /// Constants of the model.
    pub constants: &'a Constants,
    /// Driving lanes.
    pub num_lanes: usize,
    /// Lane borders, padded.
    pub boundaries: [f32; 9],
    /// Film factor of each lane, padded.
    pub film_path: [f32; 8],
    /// Driving side.
    pub side: f32,
    /// x, y, heading of the road, cosine and sine.
    pub pose: [f32; 5],
    /// Key of the random numbers.
    pub seed: u64,
    /// Steps between recorded frames.
    pub record_every: u32,
}

/// Parameters that take over at a step, for branches.
#[derive(Clone, Copy)]
pub struct Later<'a> {
    /// Vehicle parameters from then on.
    pub vehicle: &'a [f32],
    /// Simulation parameters from then on.
    pub simulation: &'a [f32],
    /// The step.
    pub switch: u32,
}

/// The SIMD level `name`, or the best one; `None` if this CPU lacks it.
pub(crate) fn level(name: Option<&str>) -> Option<Level> {
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

/// Every SIMD level that the engine has, and whether this CPU can run it.
pub fn available_levels() -> Vec<(&'static str, bool)> {
    ["avx512", "avx2", "portable"]
        .map(|name| (name, level(Some(name)).is_some()))
        .to_vec()
}

/// Name of the SIMD level that is used when none is asked for.
pub fn current_level() -> &'static str {
    ["avx512", "avx2", "portable"]
        .into_iter()
        .find(|name| level(Some(name)).is_some())
        .unwrap_or("portable")
}

/// Simulate a batch.
///
/// # Errors
/// The SIMD level is unknown or not supported by this CPU.
pub fn simulate(
    inputs: &Inputs<'_>,
    later: Option<&Later<'_>>,
    forced: Option<&str>,
    out: Output<'_>,
) -> Result<(), String> {
    if !out.frames.is_multiple_of(LANES) {
        return Err(format!(
            "room for {} frames is not a multiple of {LANES}",
            out.frames
        ));
    }
    let Some(level) = level(forced) else {
        return Err(format!(
            "SIMD level {} is not supported by this CPU",
            forced.unwrap_or("?")
        ));
    };
    match SLOTS.into_iter().find(|slots| inputs.slots <= *slots) {
        Some(8) => run_blocks::<8>(level, inputs, later, out),
        Some(16) => run_blocks::<16>(level, inputs, later, out),
        Some(32) => run_blocks::<32>(level, inputs, later, out),
        _ => {
            return Err(format!(
                "{} slots are more than {MAX_VEHICLES}",
                inputs.slots
            ));
        }
    }
    Ok(())
}

/// Simulate all blocks of a batch, with room for `N` vehicles.
fn run_blocks<const N: usize>(
    level: Level,
    inputs: &Inputs<'_>,
    later: Option<&Later<'_>>,
    out: Output<'_>,
) {
    out.into_blocks().into_par_iter().enumerate().for_each_init(
        Scratch::<N>::default,
        |scratch, (block, out)| {
            dispatch!(level, |simd| run(simd, inputs, later, block, out, scratch));
        },
    );
}

/// Row of sixteen numbers of a block; lanes beyond the batch repeat its last simulation.
#[inline(always)]
fn row(values: &[f32], batch: usize, row: usize, block: usize) -> [f32; LANES] {
    let start = block * LANES;
    let values = &values[row * batch..(row + 1) * batch];
    match values[start..].first_chunk() {
        Some(whole) => *whole,
        None => core::array::from_fn(|lane| values[(start + lane).min(batch - 1)]),
    }
}

#[inline(always)]
fn load<S: Simd, const N: usize>(
    simd: S,
    vehicle: &[f32],
    simulation: &[f32],
    inputs: &Inputs<'_>,
    block: usize,
) -> ([Vehicle<S>; N], Simulation<S>) {
    let batch = inputs.index.len();
    let slots = inputs.slots;
    let p = core::array::from_fn(|slot| {
        if slot < slots {
            Vehicle::load(simd, |field| {
                row(vehicle, batch, field * slots + slot, block)
            })
        } else {
            Vehicle::load(simd, |_| [0.0; LANES])
        }
    });
    (
        p,
        Simulation::load(simd, |field| row(simulation, batch, field, block)),
    )
}

/// Memory that a thread uses again for each of its blocks.
#[derive(Default)]
struct Scratch<const N: usize> {
    tile: Tile<N>,
    history: History<N>,
}

/// Who drives around each vehicle and what its driver believes: written anew at every decision, and
/// kept in one place, as moving it costs more than some of what is computed from it.
struct Minds<S: Simd, const N: usize> {
    near: [Neighbours<S>; N],
    believed: [Beliefs<S>; N],
}

impl<S: Simd, const N: usize> Minds<S, N> {
    fn new(simd: S) -> Self {
        Self {
            near: [Neighbours::nobody(simd); N],
            believed: [Beliefs::nothing(simd); N],
        }
    }
}

/// Simulate one block.
fn run<S: Simd, const N: usize>(
    simd: S,
    inputs: &Inputs<'_>,
    later: Option<&Later<'_>>,
    block: usize,
    out: Output<'_>,
    scratch: &mut Scratch<N>,
) {
    let batch = inputs.index.len();
    let lanes = (batch - block * LANES).min(LANES);
    let index: [u64; LANES] =
        core::array::from_fn(|lane| inputs.index[(block * LANES + lane).min(batch - 1)]);
    let road = Road {
        num_lanes: inputs.num_lanes,
        boundaries: inputs.boundaries,
        film_path: inputs.film_path,
        side: inputs.side,
        pose: inputs.pose,
    };
    let (p, q) = load(simd, inputs.vehicle, inputs.simulation, inputs, block);
    let used = |slot: &usize| (0..LANES).any(|lane| p[*slot].valid[lane] > 0.0);
    let count = (0..N).filter(used).max().map_or(1, |last| last + 1);
    let mut world = World {
        simd,
        c: inputs.constants,
        road: &road,
        p,
        q,
        count,
        key: [inputs.seed as u32, (inputs.seed >> 32) as u32],
        index_low: index.map(|number| number as u32),
        index_high: index.map(|number| (number >> 32) as u32),
    };
    let mut state = State::new(&world, &mut scratch.history);
    let mut recorder = Recorder::new(out, lanes, &mut scratch.tile);
    let mut minds = Minds::new(simd);
    let mut pairs: Pairs<S, N> = [[None; N]; N];
    let mut step = 0;
    while runs(&state, simd, step) {
        if let Some(later) = later.filter(|later| later.switch == step) {
            (world.p, world.q) = load(simd, later.vehicle, later.simulation, inputs, block);
        }
        if step.is_multiple_of(SUBSTEPS) {
            pairs = decide(&mut state, &world, &mut minds, &mut recorder, step);
        }
        if step.is_multiple_of(inputs.record_every) {
            simd.vectorize(
                #[inline(always)]
                || {
                    let active = splat(simd, step as f32).simd_le(state.end_step);
                    recorder.frame(
                        &state,
                        &world,
                        active,
                        (step / inputs.record_every) as usize,
                    );
                },
            );
        }
        advance(&mut state, &world, &pairs, step);
        step += 1;
    }
    simd.vectorize(
        #[inline(always)]
        || recorder.finish(&state, &world),
    );
}

fn runs<S: Simd, const N: usize>(state: &State<'_, S, N>, simd: S, step: u32) -> bool {
    outlined!(
        simd,
        splat(simd, step as f32).simd_le(state.end_step).any_true()
    )
}

/// Everything that happens 20 times a second: weather, perception, decisions.
///
/// Each part is a function of its own with the features of the CPU switched on; inlining them all into
/// one makes the compiler slow and the code no faster.
fn decide<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    minds: &mut Minds<S, N>,
    recorder: &mut Recorder<'_, N>,
    step: u32,
) -> Pairs<S, N> {
    let decision = step / SUBSTEPS;
    surroundings(state, w, step);
    let Minds { near, believed } = minds;
    for i in 0..w.count {
        near[i] = outlined!(w.simd, find_neighbours(state, w, i));
        believed[i] = outlined!(
            w.simd,
            perception::perceive(state, w, &near[i], i, decision as usize)
        );
    }
    let mut leader = [splat(w.simd, 0.0); N];
    for i in 0..w.count {
        leader[i] = outlined!(w.simd, control::behind_leader(state, w, i, &believed[i]));
    }
    for i in 0..w.count {
        outlined!(
            w.simd,
            control::set_acceleration(state, w, i, &near[i], &believed[i], leader[i])
        );
    }
    if mobil::is_due(w.c, decision as usize) {
        for i in 1..w.count {
            outlined!(
                w.simd,
                mobil::change_lanes(state, w, i, &believed[i], leader[i])
            );
        }
    }
    outlined!(
        w.simd,
        ego::decide(state, w, &near[EGO], &believed[EGO], recorder, step)
    );
    outlined!(w.simd, near_pairs(state, w))
}

/// Time, memory, weather and wind of a decision.
fn surroundings<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    step: u32,
) {
    let decision = step / SUBSTEPS;
    outlined!(w.simd, {
        for i in 0..w.count {
            state.since_change[i] += w.c.decision;
        }
        leave_road(state, w, step);
    });
    outlined!(w.simd, perception::remember(state, w, decision as usize));
    outlined!(
        w.simd,
        environment::move_random_processes(state, w, decision)
    );
    outlined!(w.simd, environment::grip(state, w));
    outlined!(w.simd, environment::wind(state, w));
    for i in 0..w.count {
        outlined!(w.simd, steering::hold_against_wind(state, w, i, step));
    }
}

/// One step of 10 ms: steer, move, collide.
fn advance<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    pairs: &Pairs<S, N>,
    step: u32,
) {
    let before = (state.s, state.d);
    outlined!(w.simd, {
        // Short passes over all vehicles, so that the CPU works on several of them at once.
        for i in 0..w.count {
            steering::steer(state, w, i);
        }
        let mut turned = before.0;
        for i in 0..w.count {
            turned[i] = dynamics::accelerate(state, w, i);
        }
        for i in 0..w.count {
            dynamics::integrate(state, w, i, turned[i]);
        }
    });
    outlined!(w.simd, collide(state, w, pairs, &before, step));
}
