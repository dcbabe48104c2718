//! Another driver at the ego's wheel; see `overtaking.sim.reference.orders`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::intent::{Intent, can_abort, can_remain, has_arrived, has_passed, in_stage, signal};
use crate::lanes::{LANES, M, V, choose, splat};
use crate::plight::can_fall_in;
use crate::state::{EGO, State, stage};
use crate::world::World;

/// Numbers of an action.
pub const PARTS: usize = 3;

/// What the numbers of an action mean, as in `overtaking.model.driver_interface.ACTION_KINDS`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A `Move`.
    Decision,
    /// Acceleration, and side to change lanes to.
    AccelLane,
    /// Acceleration, and angle of the front wheels.
    AccelSteer,
    /// Acceleration, and a `Move` that shows its side.
    AccelMove,
    /// Acceleration, angle of the front wheels, and side of the indicator.
    AccelSteerSignal,
}

impl Kind {
    /// The kind of this name.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "decision" => Some(Self::Decision),
            "accel_lane" => Some(Self::AccelLane),
            "accel_steer" => Some(Self::AccelSteer),
            "accel_move" => Some(Self::AccelMove),
            "accel_steer_signal" => Some(Self::AccelSteerSignal),
            _ => None,
        }
    }

    /// Steps of a unit of each number.
    fn scales(self) -> [f32; PARTS] {
        match self {
            Self::Decision => [1.0, 1.0, 1.0],
            Self::AccelLane | Self::AccelMove => [1000.0, 1.0, 1.0],
            Self::AccelSteer | Self::AccelSteerSignal => [1000.0, 10000.0, 1.0],
        }
    }

    /// Whether the other driver turns the wheels itself.
    fn steers(self) -> bool {
        matches!(self, Self::AccelSteer | Self::AccelSteerSignal)
    }
}

/// Decisions of an external driver, as `overtaking.model.driver_interface.Move`; 0 keeps on.
mod ego_move {
    pub const INDICATE_PULL_OUT: f32 = 1.0;
    pub const PULL_OUT: f32 = 2.0;
    pub const INDICATE_RETURN: f32 = 3.0;
    pub const RETURN: f32 = 4.0;
    pub const CANCEL: f32 = 5.0;
}

/// What another driver did in all simulations of a batch.
#[derive(Clone, Copy)]
pub struct Script<'a> {
    /// What the numbers mean.
    pub kind: Kind,
    /// Steps of each number, (simulation, decision, part).
    pub values: &'a [i32],
    /// Decisions of a simulation, one at least; the last goes on.
    pub decisions: usize,
}

impl Script<'_> {
    /// The orders of a decision to the simulations of a block.
    pub(crate) fn orders<S: Simd>(
        &self,
        simd: S,
        simulations: &[usize; LANES],
        decision: usize,
    ) -> Orders<S> {
        let at = decision.min(self.decisions - 1);
        let scales = self.kind.scales();
        let values = core::array::from_fn(|part| {
            let steps = simulations
                .map(|one| self.values[(one * self.decisions + at) * PARTS + part] as f32);
            V::simd_from(simd, steps) / scales[part]
        });
        Orders {
            kind: self.kind,
            values,
        }
    }
}

/// What another driver asks for at a decision, in SI units.
#[derive(Clone, Copy)]
pub struct Orders<S: Simd> {
    kind: Kind,
    values: [V<S>; PARTS],
}

impl<S: Simd> Orders<S> {
    /// The acceleration that is asked for, unless the ego keeps its own pedals.
    #[inline(always)]
    pub fn accel(&self) -> Option<V<S>> {
        (self.kind != Kind::Decision).then_some(self.values[0])
    }

    /// The angle of the front wheels that is asked for, unless the ego steers.
    #[inline(always)]
    pub fn wheel(&self) -> Option<V<S>> {
        self.kind.steers().then_some(self.values[1])
    }

    /// Its `Move`, if it has one.
    #[inline(always)]
    fn code(&self) -> Option<V<S>> {
        match self.kind {
            Kind::Decision => Some(self.values[0]),
            Kind::AccelMove => Some(self.values[1]),
            _ => None,
        }
    }
}

/// Whether there is a faster lane, and no lane change under way.
#[inline(always)]
pub fn can_go_out<S: Simd, const N: usize>(state: &State<'_, S, N>, w: &World<'_, S, N>) -> M<S> {
    let settled = in_stage(state, EGO, stage::FOLLOW) | in_stage(state, EGO, stage::PASS);
    settled & has_arrived(state, EGO) & state.lane[EGO].simd_lt((w.road.num_lanes - 1) as f32)
}

/// Whether there is a slower lane, and no lane change under way that cannot be given up.
#[inline(always)]
pub fn can_go_back<S: Simd, const N: usize>(state: &State<'_, S, N>) -> M<S> {
    let follows = in_stage(state, EGO, stage::FOLLOW) & has_arrived(state, EGO);
    (follows | in_stage(state, EGO, stage::PASS)) & state.lane[EGO].simd_ge(1.0)
}

/// What the ego sets out to do: what another driver asks for, where that is possible.
#[inline(always)]
pub fn obey<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    orders: &Orders<S>,
) -> Intent<S> {
    if orders.kind.steers() {
        return drift(state, w);
    }
    let zero = splat(w.simd, 0.0);
    let side = side(orders);
    let turned = (state.wanted[EGO] * side).simd_lt(0.0);
    state.signalled[EGO] = choose(turned, zero, state.signalled[EGO]);
    let start = can_go_out(state, w) & side.simd_gt(0.0);
    let back = can_go_back(state) & side.simd_lt(0.0);
    signal(state, w, EGO, start, back);
    let [now, drops_out, drops_back] = if let Some(code) = orders.code() {
        let is = |which: f32| code.simd_eq(which);
        let cancels = is(ego_move::CANCEL);
        [
            is(ego_move::PULL_OUT) | is(ego_move::RETURN),
            cancels,
            cancels,
        ]
    } else {
        let shown = state.signalled[EGO].simd_gt(w.p[EGO].indicator_lead_time);
        [shown, side.simd_lt(0.0), side.simd_gt(0.0)]
    };
    let mut gives_up = can_abort(state, w, EGO);
    if w.road.ways.has_oncoming_traffic && orders.code().is_some() {
        gives_up |= can_fall_in(state, w);
    }
    Intent {
        start,
        back,
        go_out: start & now,
        go_back: back & now,
        abort: gives_up & drops_out,
        remain: can_remain(state, w, EGO) & drops_back,
        passed: has_passed(state, w, EGO),
        arrived: has_arrived(state, EGO),
    }
}

/// Light the indicator that another driver asks for, if that is a part of its action.
#[inline(always)]
pub fn show<S: Simd, const N: usize>(state: &mut State<'_, S, N>, orders: &Orders<S>) {
    if !matches!(orders.kind, Kind::AccelMove | Kind::AccelSteerSignal) {
        return;
    }
    let side = side(orders);
    let sound = state.crashed[EGO].simd_eq(0.0);
    let told = if orders.kind.steers() {
        sound
    } else {
        sound & side.simd_ne(0.0)
    };
    state.indicator[EGO] = choose(told, side, state.indicator[EGO]);
}

/// Where the ego is to go: 1 towards the fast side, -1 towards the slow side, 0 nowhere.
#[inline(always)]
fn side<S: Simd>(orders: &Orders<S>) -> V<S> {
    let Some(code) = orders.code() else {
        let wish = if orders.kind.steers() { 2 } else { 1 };
        return orders.values[wish];
    };
    let (zero, one) = (splat(code.simd, 0.0), splat(code.simd, 1.0));
    let is = |which: f32| code.simd_eq(which);
    choose(
        is(ego_move::INDICATE_PULL_OUT) | is(ego_move::PULL_OUT),
        one,
        choose(
            is(ego_move::INDICATE_RETURN) | is(ego_move::RETURN),
            -one,
            zero,
        ),
    )
}

/// What the ego has set out to do, told from the lane that it is in: nothing is shown before.
#[inline(always)]
fn drift<S: Simd, const N: usize>(state: &mut State<'_, S, N>, w: &World<'_, S, N>) -> Intent<S> {
    let mut lane = splat(w.simd, 0.0);
    for k in 1..w.road.num_lanes {
        let beyond = state.d[EGO].simd_ge(w.road.boundaries[k]);
        lane = choose(beyond, splat(w.simd, k as f32), lane);
    }
    let faster = lane.simd_gt(state.lane[EGO]);
    let slower = lane.simd_lt(state.lane[EGO]);
    let out = in_stage(state, EGO, stage::PULL_OUT);
    let comes_back = in_stage(state, EGO, stage::RETURN) | in_stage(state, EGO, stage::ABORT);
    let never = lane.simd_ne(lane);
    signal(state, w, EGO, never, never);
    Intent {
        start: never,
        back: never,
        go_out: faster & !comes_back,
        go_back: slower & !out,
        abort: slower & out,
        remain: faster & comes_back,
        passed: has_passed(state, w, EGO),
        arrived: has_arrived(state, EGO),
    }
}
