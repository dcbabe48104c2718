//! Vehicles with somebody else at pedals and wheel, for a tick; see `overtaking.sim.reference.driven`.
//!
//! Here the lanes of a vector are not simulations: all of them hold the same one.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::block::load;
use crate::elementary::sincos;
use crate::engine::{Inputs, level};
use crate::lanes::{LANES, V, at_least, choose, clamp, clamp_to, dispatch, min, splat};
use crate::names::Simulation;
use crate::state::{History, State};
use crate::world::{Rates, Road, World};
use crate::{MAX_VEHICLES, SLOTS, dynamics, environment};

/// Take fields out of a table with a row for each, and put them back.
macro_rules! moving_fields {
    ($($field:ident),* $(,)?) => {
        /// What changes while somebody drives, in the order of the rows of a table.
        pub const MOVING: &[&str] = &[$(stringify!($field)),*];

        #[inline(always)]
        fn take<S: Simd, const N: usize>(state: &mut State<'_, S, N>, table: &[f32], simd: S) {
            let mut rows = table.chunks_exact(table.len() / MOVING.len());
            $(for (mine, value) in state.$field.iter_mut().zip(rows.next().unwrap_or_default()) {
                *mine = splat(simd, *value);
            })*
        }

        /// Put back what lane `of` a vehicle says of it.
        #[inline(always)]
        fn give<S: Simd, const N: usize>(
            state: &State<'_, S, N>,
            table: &mut [f32],
            of: impl Fn(usize) -> Option<usize>,
        ) {
            let mut rows = table.chunks_exact_mut(table.len() / MOVING.len());
            $(for (i, value) in rows.next().unwrap_or_default().iter_mut().enumerate() {
                if let Some(lane) = of(i) {
                    *value = state.$field[i][lane];
                }
            })*
        }
    };
}

moving_fields! {
    s, d, psi, vx, vy, r, wheel, accel, a_lon, a_lat, gust, distance_error, speed_error, wander, mu_fast,
    mu_slow, wind_force, wind_moment, tail_wind,
}

/// What drivers do, a number for each vehicle.
#[derive(Clone, Copy)]
pub struct Controls<'a> {
    /// Part of the engine's force.
    pub throttle: &'a [f32],
    /// Part of the braking force.
    pub brake: &'a [f32],
    /// Wanted angle of the front wheels [rad].
    pub angle: &'a [f32],
    /// How fast they turn [rad/s].
    pub wheel_rate: f32,
}

/// What happens to the vehicles of a table.
#[derive(Clone, Copy)]
pub enum Deed<'a> {
    /// Weather: gusts, friction and wind of the decision with this number.
    Weather(u32),
    /// Motion: so many steps.
    Drive(Controls<'a>, u32),
}

/// Room for few vehicles. More have room for the most, as a third size would be compiled for little.
const FEW: usize = SLOTS[0];

/// Let something happen to vehicles.
///
/// # Errors
/// There are too many, arrays are too short, or this CPU lacks the SIMD level.
pub fn act(
    inputs: &Inputs<'_>,
    deed: Deed<'_>,
    forced: Option<&str>,
    table: &mut [f32],
) -> Result<(), String> {
    let Some(level) = level(forced) else {
        return Err(format!(
            "SIMD level {} is not supported by this CPU",
            forced.unwrap_or("?")
        ));
    };
    if table.len() != inputs.slots * MOVING.len() || !controls_fit(deed, inputs.slots) {
        return Err(format!("expected numbers of {} vehicles", inputs.slots));
    }
    if inputs.slots > MAX_VEHICLES {
        return Err(format!(
            "{} vehicles are more than {MAX_VEHICLES}",
            inputs.slots
        ));
    }
    if inputs.slots <= FEW {
        dispatch!(level, |simd| among::<_, FEW>(simd, inputs, deed, table));
    } else {
        dispatch!(level, |simd| among::<_, MAX_VEHICLES>(
            simd, inputs, deed, table
        ));
    }
    Ok(())
}

fn controls_fit(deed: Deed<'_>, vehicles: usize) -> bool {
    match deed {
        Deed::Weather(_) => true,
        Deed::Drive(controls, _) => [controls.throttle, controls.brake, controls.angle]
            .iter()
            .all(|each| each.len() == vehicles),
    }
}

fn among<S: Simd, const N: usize>(simd: S, inputs: &Inputs<'_>, deed: Deed<'_>, table: &mut [f32]) {
    let road = Road::of(inputs);
    let (p, q) = load(simd, inputs.vehicle, inputs.simulation, inputs, &[0; LANES]);
    let world = World::<S, N> {
        simd,
        c: inputs.constants,
        rates: Rates::of(inputs.constants),
        road: &road,
        p,
        q,
        count: inputs.slots,
        is_ring: false,
        key: [inputs.seed as u32, (inputs.seed >> 32) as u32],
        index_low: [inputs.index[0] as u32; LANES],
        index_high: [(inputs.index[0] >> 32) as u32; LANES],
    };
    let mut history = History::default();
    match deed {
        Deed::Weather(decision) => weather(world, decision, &mut history, table),
        Deed::Drive(controls, steps) => drive(&world, controls, steps, &mut history, table),
    }
}

/// Gusts, friction and wind of a decision.
///
/// Vehicles head anywhere, so the wind has other axes for each. Lane `k` has it as one of them feels it,
/// and only that one takes its numbers from there.
fn weather<S: Simd, const N: usize>(
    mut w: World<'_, S, N>,
    decision: u32,
    history: &mut History<N>,
    table: &mut [f32],
) {
    let before = table.to_vec();
    let steady = w.q;
    for first in (0..w.count).step_by(LANES) {
        w.simd.vectorize(
            #[inline(always)]
            || {
                let mut state = State::new(&w, &mut history.0);
                take(&mut state, &before, w.simd);
                turn_wind(&mut w.q, &steady, &state, first);
                environment::move_random_processes(&mut state, &w, decision);
                environment::grip(&mut state, &w);
                environment::wind(&mut state, &w);
                give(&state, table, |i| {
                    i.checked_sub(first).filter(|lane| *lane < LANES)
                });
            },
        );
    }
}

/// The wind in the axes of the vehicles from `first` on, one in each lane.
#[inline(always)]
fn turn_wind<S: Simd, const N: usize>(
    turned: &mut Simulation<S>,
    steady: &Simulation<S>,
    state: &State<'_, S, N>,
    first: usize,
) {
    for (lane, psi) in state.psi[first..].iter().take(LANES).enumerate() {
        let (sine, cosine) = sincos(*psi);
        let along = steady.wind_along * cosine + steady.wind_across * sine;
        let across = steady.wind_across * cosine - steady.wind_along * sine;
        turned.wind_along.as_mut_slice()[lane] = along[lane];
        turned.wind_across.as_mut_slice()[lane] = across[lane];
    }
}

fn drive<S: Simd, const N: usize>(
    w: &World<'_, S, N>,
    controls: Controls<'_>,
    steps: u32,
    history: &mut History<N>,
    table: &mut [f32],
) {
    w.simd.vectorize(
        #[inline(always)]
        || {
            let mut state = State::new(w, &mut history.0);
            take(&mut state, table, w.simd);
            for i in 0..w.count {
                (state.sine[i], state.cosine[i]) = sincos(state.psi[i]);
            }
            for _ in 0..steps {
                for i in 0..w.count {
                    let stride = &w.rates.fine;
                    let speed = at_least(state.vx[i] + stride.half * state.a_lon[i], 0.0);
                    press(&mut state, w, i, controls, speed);
                    let angle = turn(&mut state, w, i, controls, speed);
                    let motion =
                        dynamics::accelerate::<S, N, false>(&mut state, w, i, angle, stride);
                    dynamics::integrate::<S, N, false>(&mut state, w, i, motion, stride);
                }
            }
            give(&state, table, |_| Some(0));
        },
    );
}

/// From pedals, at a speed, to the acceleration that is asked for.
#[inline(always)]
fn press<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    controls: Controls<'_>,
    speed: V<S>,
) {
    let (c, p) = (w.c, &w.p[i]);
    let air = speed - state.tail_wind[i];
    let resistance = p.drag * air * air.abs() + p.rolling;
    let engine = min(p.launch_force, p.power / at_least(speed, c.slip_speed));
    let force = controls.throttle[i] * engine - controls.brake[i] * p.max_brake_force - resistance;
    state.accel[i] = force * p.inverse_mass;
}

/// Turn the front wheels, or lean into the curve that they stand for; the angle in the middle of the step.
#[inline(always)]
fn turn<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    controls: Controls<'_>,
    speed: V<S>,
) -> V<S> {
    let (c, p) = (w.c, &w.p[i]);
    let angle: V<S> = splat(w.simd, controls.angle[i]);
    let most = controls.wheel_rate * c.step;
    let turn = clamp_to(angle - state.wheel[i], -most, most);
    let (sine, cosine) = sincos(angle);
    let curve = speed * speed * sine / (cosine * p.wheelbase);
    let grip = c.gravity * 0.5 * (state.mu_fast[i] + state.mu_slow[i]);
    let lean = (clamp(curve, -grip, grip) - state.wheel[i]) * w.rates.fine.leaning;
    let moved = choose(p.two_wheeler.simd_gt(0.0), lean, turn);
    let before = state.wheel[i];
    state.wheel[i] = before + moved;
    before + 0.5 * moved
}
