//! What another driver of the ego observes; see `overtaking.sim.reference.observation`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::ego::{can_abort, can_remain, faster, has_arrived, has_passed, is_behind, is_told};
use crate::lanes::{M, V, choose, pick_each, splat};
use crate::orders::{can_go_back, can_go_out};
use crate::state::{EGO, LEAD, ROLES, State, World};
use crate::step::Mind;

/// Whether another driver sees what the model's driver believes, or how it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Percepts of the model.
    Human,
    /// The state of the world.
    Truth,
}

/// A struct of arrays whose fields are listed once.
macro_rules! columns {
    ($(#[$doc:meta])* $names:ident, $name:ident { $($field:ident),* $(,)? }) => {
        $(#[$doc])*
        pub const $names: &[&str] = &[$(stringify!($field)),*];

        struct $name<S: Simd> { $($field: V<S>),* }

        impl<S: Simd> $name<S> {
            #[inline(always)]
            fn write(self, out: &mut [V<S>]) {
                for (to, from) in out.iter_mut().zip([$(self.$field),*]) {
                    *to = from;
                }
            }
        }
    };
}

columns! {
    /// What a driver knows of itself, in order.
    OWN_NAMES, Own {
        speed, accel, position, lateral, offset, heading, yaw_rate, lane, stage, stage_time, waited, signalled,
        wanted, since_change, arrived, looks, contested, passed, behind_target, can_go_out,
        can_go_back, can_abort,
    }
}

columns! {
    /// What a driver knows of a neighbour, in order.
    AROUND_NAMES, Around {
        detected, gap, closing, accel, aside, indicator, brake_lamp, length, truck, two_wheeler,
    }
}

/// Roles that there is room for; two of them are empty as long as no traffic comes the other way.
pub const ROLES_OBSERVED: usize = 8;

/// Numbers of a simulation.
pub const WIDTH: usize = OWN_NAMES.len() + ROLES_OBSERVED * AROUND_NAMES.len();

/// The numbers of every simulation of a block.
pub type Table<S> = [V<S>; WIDTH];

/// What the ego of every simulation of a block observes.
#[inline(always)]
pub fn observe<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: Mind<'_, S>,
    source: Source,
) -> Table<S> {
    let mut table = [splat(w.simd, 0.0); WIDTH];
    let (own, around) = table.split_at_mut(OWN_NAMES.len());
    own_columns(state, w, mind).write(own);
    for (role, columns) in around.chunks_exact_mut(AROUND_NAMES.len()).enumerate() {
        let seen = if role < ROLES {
            match source {
                Source::Human => believed(state, w, mind, role),
                Source::Truth => real(state, w, mind, role),
            }
        } else {
            no_neighbour(w)
        };
        neighbour(state, w, mind, role.min(ROLES - 1), seen).write(columns);
    }
    table
}

#[inline(always)]
fn own_columns<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: Mind<'_, S>,
) -> Own<S> {
    let flag = |mask| flag(w.simd, mask);
    let centre = 0.5 * (mind.near.lane_low + mind.near.lane_high);
    Own {
        speed: state.vx[EGO],
        accel: state.accel[EGO],
        position: state.s[EGO],
        lateral: state.d[EGO],
        offset: state.d[EGO] - centre,
        heading: state.psi[EGO],
        yaw_rate: state.r[EGO],
        lane: state.lane[EGO],
        stage: state.stage,
        stage_time: state.stage_time,
        waited: state.waited,
        signalled: state.signalled,
        wanted: state.wanted[EGO],
        since_change: state.since_change[EGO],
        arrived: flag(has_arrived(state)),
        looks: flag(mind.looks),
        contested: flag(mind.waits),
        passed: flag(has_passed(state, w)),
        behind_target: flag(is_behind(state, w)),
        can_go_out: flag(can_go_out(state, w)),
        can_go_back: flag(can_go_back(state)),
        can_abort: flag(can_abort(state, w) | can_remain(state, w)),
    }
}

/// What there is to know of the motion of a neighbour.
struct Seen<S: Simd> {
    detected: M<S>,
    gap: V<S>,
    closing: V<S>,
    accel: V<S>,
}

/// What the model's driver decides by: its beliefs, and the true speed of approach where it is told.
#[inline(always)]
fn believed<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: Mind<'_, S>,
    role: usize,
) -> Seen<S> {
    let detected = mind.believed.detected[role];
    let mut closing = mind.believed.closing[role];
    if role == LEAD {
        closing = choose(is_told(w) & detected, faster(state, w, mind.near), closing);
    }
    Seen {
        detected,
        gap: mind.believed.gap[role],
        closing,
        accel: mind.believed.accel[role],
    }
}

#[inline(always)]
fn real<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: Mind<'_, S>,
    role: usize,
) -> Seen<S> {
    let (zero, unseen) = (splat(w.simd, 0.0), splat(w.simd, w.c.unseen_gap));
    let slot = mind.near.slot[role];
    let there = slot.simd_ge(0.0);
    let (own, _) = state.road_velocity(EGO);
    let [speed, accel] = pick_each!(w.count, slot, |j| [
        state.road_velocity(j).0,
        state.a_lon[j]
    ]);
    let closing = if role.is_multiple_of(2) {
        own - speed
    } else {
        speed - own
    };
    Seen {
        detected: there,
        gap: choose(there, mind.near.gap[role], unseen),
        closing: choose(there, closing, zero),
        accel: choose(there, accel, zero),
    }
}

#[inline(always)]
fn no_neighbour<S: Simd, const N: usize>(w: &World<'_, S, N>) -> Seen<S> {
    let zero = splat(w.simd, 0.0);
    Seen {
        detected: zero.simd_ne(zero),
        gap: splat(w.simd, w.c.unseen_gap),
        closing: zero,
        accel: zero,
    }
}

/// What is seen of whoever is in a role, with its looks.
#[inline(always)]
fn neighbour<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: Mind<'_, S>,
    role: usize,
    seen: Seen<S>,
) -> Around<S> {
    let zero = splat(w.simd, 0.0);
    let [indicator, asked, crashed, truck, two_wheeler] =
        pick_each!(w.count, mind.near.slot[role], |j| [
            state.indicator[j],
            state.accel[j],
            state.crashed[j],
            w.p[j].truck,
            w.p[j].two_wheeler
        ]);
    let brakes = asked.simd_lt(-w.c.stop_lamp_decel) | crashed.simd_gt(0.0);
    let known = |value| choose(seen.detected, value, zero);
    Around {
        detected: flag(w.simd, seen.detected),
        gap: seen.gap,
        closing: seen.closing,
        accel: seen.accel,
        aside: known(mind.near.aside[role]),
        indicator: known(indicator),
        brake_lamp: known(flag(w.simd, brakes)),
        length: known(2.0 * mind.near.half_length[role]),
        truck: known(truck),
        two_wheeler: known(two_wheeler),
    }
}

/// 1 where something holds, else 0.
#[inline(always)]
fn flag<S: Simd>(simd: S, mask: M<S>) -> V<S> {
    choose(mask, splat(simd, 1.0), splat(simd, 0.0))
}
