//! What another driver of the ego observes; see `overtaking.sim.reference.observation`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::gaps::{faster, is_told};
use crate::intent::{can_abort, can_remain, has_arrived, has_passed, in_stage, is_behind};
use crate::lanes::{M, V, at_most, choose, pick_each, splat};
use crate::moment::Mind;
use crate::oncoming::{Oncoming, look_beyond, usual_closing};
use crate::orders::{can_go_back, can_go_out};
use crate::passing::{is_solid, room_ahead, room_left};
use crate::plight::{can_fall_in, weigh};
use crate::state::{EGO, LEAD, ROLES, State, stage};
use crate::world::World;

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

columns! {
    /// What a driver knows about oncoming traffic, in order; zero on roads of one direction.
    MEETING_NAMES, Meeting {
        sight, sure, expected, room, room_left, solid, hurries, yields, can_fall_in,
    }
}

/// Roles that there is room for; the last two are of who comes the other way.
pub const ROLES_OBSERVED: usize = 8;

const AROUND_WIDTH: usize = ROLES_OBSERVED * AROUND_NAMES.len();

/// Numbers of a simulation.
pub const WIDTH: usize = OWN_NAMES.len() + AROUND_WIDTH + MEETING_NAMES.len();

/// The numbers of every simulation of a block.
pub type Table<S> = [V<S>; WIDTH];

/// What the ego of every simulation of a block observes.
#[inline(always)]
pub fn observe<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: Mind<'_, S>,
    source: Source,
    decision: usize,
) -> Table<S> {
    let mut table = [splat(w.simd, 0.0); WIDTH];
    let (own, rest) = table.split_at_mut(OWN_NAMES.len());
    let (around, meeting) = rest.split_at_mut(AROUND_WIDTH);
    own_columns(state, w, mind).write(own);
    let (beside, ahead) = around.split_at_mut(ROLES * AROUND_NAMES.len());
    for (role, columns) in beside.chunks_exact_mut(AROUND_NAMES.len()).enumerate() {
        let seen = match source {
            Source::Human => believed(state, w, mind, role),
            Source::Truth => real(state, w, mind, role),
        };
        neighbour(state, w, mind, role, seen).write(columns);
    }
    let (near, first) = (mind.near, &mind.met.coming);
    let mut who = [Oncoming::nobody(w.simd); 2];
    if w.road.ways.two_way {
        who = [*first, look_beyond(state, w, near, first, decision)];
        meets(state, w, mind).write(meeting);
    }
    for (who, columns) in who.iter().zip(ahead.chunks_exact_mut(AROUND_NAMES.len())) {
        comes(state, w, who, source).write(columns);
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
        stage: state.stage[EGO],
        stage_time: state.stage_time[EGO],
        waited: state.waited[EGO],
        signalled: state.signalled[EGO],
        wanted: state.wanted[EGO],
        since_change: state.since_change[EGO],
        arrived: flag(has_arrived(state, EGO)),
        looks: flag(mind.looks),
        contested: flag(mind.waits),
        passed: flag(has_passed(state, w, EGO)),
        behind_target: flag(is_behind(state, w, EGO)),
        can_go_out: flag(can_go_out(state, w)),
        can_go_back: flag(can_go_back(state)),
        can_abort: flag(can_abort(state, w, EGO) | can_remain(state, w, EGO)),
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

/// What there is to know of somebody who comes the other way.
#[inline(always)]
fn comes<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    who: &Oncoming<S>,
    source: Source,
) -> Around<S> {
    let zero = splat(w.simd, 0.0);
    let [
        speed,
        accel,
        lateral,
        indicator,
        half_length,
        truck,
        two_wheeler,
    ] = pick_each!(w.count, who.slot, |j| [
        state.road_velocity(j).0,
        state.a_lon[j],
        state.d[j],
        state.indicator[j],
        w.p[j].half_length,
        w.p[j].truck,
        w.p[j].two_wheeler
    ]);
    let own = state.road_velocity(EGO).0;
    let (detected, gap, closing, accel) = match source {
        Source::Human => (who.detected, who.believed_gap, who.closing, zero),
        Source::Truth => (who.slot.simd_ge(0.0), who.gap, own + speed, accel),
    };
    let known = |value| choose(detected, value, zero);
    Around {
        detected: flag(w.simd, detected),
        gap: choose(detected, gap, splat(w.simd, w.c.unseen_gap)),
        closing: known(closing),
        accel: known(accel),
        aside: known((w.road.ways.across - lateral) - state.d[EGO]),
        indicator: known(-indicator),
        brake_lamp: zero,
        length: known(2.0 * half_length),
        truck: known(truck),
        two_wheeler: known(two_wheeler),
    }
}

/// How the ego stands to oncoming traffic.
#[inline(always)]
fn meets<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: Mind<'_, S>,
) -> Meeting<S> {
    let flag = |mask| flag(w.simd, mask);
    let coming = &mind.met.coming;
    let plight = weigh(state, w, EGO, &mind);
    let lead = mind.near.slot[LEAD];
    let passed = choose(in_stage(state, EGO, stage::FOLLOW), lead, state.target[EGO]);
    Meeting {
        sight: coming.sight,
        sure: flag(coming.sure),
        expected: usual_closing(state, w, EGO),
        room: at_most(room_ahead(state, w, EGO, lead), w.c.unseen_gap),
        room_left: room_left(w, passed),
        solid: flag(is_solid(state, w, EGO, splat(w.simd, w.c.line_ahead))),
        hurries: 0.5 * flag(plight.hurries) + 0.5 * flag(plight.pressed),
        yields: 0.5 * flag(plight.yields) + 0.5 * flag(plight.yields & plight.fits),
        can_fall_in: flag(can_fall_in(state, w)),
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
