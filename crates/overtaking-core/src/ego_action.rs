//! Another driver at the ego's wheel; see `overtaking.sim.reference.ego_action`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::gap_acceptance::{Intent, update_indicator};
use crate::math::vectors::{F32, Mask, SIMD_LANES, select, splat};
use crate::names::ego_move;
use crate::params::Params;
use crate::state::{EGO_SLOT, State, stage};
use crate::vehicle_handle::VehicleHandle;

/// Numbers of an action.
pub const MAX_ACTION_PARTS: usize = 3;

macro_rules! declare_action_kinds {
    ($($(#[$parts:meta])* $kind:ident, $name:literal, $scales:expr;)*) => {
        /// Meaning of the numbers of an action, as in `overtaking.model.driver_interface.ACTION_KINDS`.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum ActionKind {
            $($(#[$parts])* $kind,)*
        }

        impl ActionKind {
            /// The kind of a name.
            pub fn from_name(name: &str) -> Option<Self> {
                match name {
                    $($name => Some(Self::$kind),)*
                    _ => None,
                }
            }

            /// Steps to a unit of each number.
            fn scales(self) -> [f32; MAX_ACTION_PARTS] {
                match self {
                    $(Self::$kind => $scales,)*
                }
            }
        }
    };
}
with_action_kinds! { declare_action_kinds! }

impl ActionKind {
    /// Whether the external driver turns the wheels.
    fn steers_wheels(self) -> bool {
        matches!(self, Self::AccelSteer | Self::AccelSteerSignal)
    }
}

/// What another driver did in all simulations of a batch.
#[derive(Clone, Copy)]
pub struct ActionLog<'a> {
    /// What the numbers mean.
    pub kind: ActionKind,
    /// Steps of each number, (simulation, decision, part).
    pub values: &'a [i32],
    /// Decisions of a simulation, one at least; the last goes on.
    pub decisions: usize,
}

impl ActionLog<'_> {
    /// The orders of a decision to the simulations of a block.
    pub(crate) fn action_at<S: Simd>(
        &self,
        simd: S,
        simulations: &[usize; SIMD_LANES],
        decision: usize,
    ) -> EgoAction<S> {
        let at = decision.min(self.decisions - 1);
        let scales = self.kind.scales();
        let values = core::array::from_fn(|part| {
            let steps = simulations.map(|one| {
                self.values[(one * self.decisions + at) * MAX_ACTION_PARTS + part] as f32
            });
            F32::simd_from(simd, steps) / scales[part]
        });
        EgoAction {
            kind: self.kind,
            values,
        }
    }
}

/// What another driver asks for at a decision, in SI units.
#[derive(Clone, Copy)]
pub struct EgoAction<S: Simd> {
    kind: ActionKind,
    values: [F32<S>; MAX_ACTION_PARTS],
}

impl<S: Simd> EgoAction<S> {
    /// The acceleration that is asked for, unless the ego keeps its own pedals.
    #[inline(always)]
    pub fn requested_accel(&self) -> Option<F32<S>> {
        (self.kind != ActionKind::Decision).then_some(self.values[0])
    }

    /// The angle of the front wheels that is asked for, unless the ego steers.
    #[inline(always)]
    pub fn wheel_angle(&self) -> Option<F32<S>> {
        self.kind.steers_wheels().then_some(self.values[1])
    }

    /// Its `Move`, if it has one.
    #[inline(always)]
    fn move_code(&self) -> Option<F32<S>> {
        match self.kind {
            ActionKind::Decision => Some(self.values[0]),
            ActionKind::AccelMove => Some(self.values[1]),
            _ => None,
        }
    }
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Whether there is a faster lane, and no lane change under way.
    #[inline(always)]
    pub fn can_pull_out(self) -> Mask<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let settled = self.is_in_stage(stage::FOLLOW) | self.is_in_stage(stage::PASS);
        settled
            & self.has_finished_lane_change()
            & state.lane_choice.lane[slot].simd_lt((params.road.num_lanes - 1) as f32)
    }

    /// Whether there is a slower lane, and no lane change under way that cannot be given up.
    #[inline(always)]
    pub fn can_return(self) -> Mask<S> {
        let (state, slot) = (self.state, self.slot);
        let follows = self.is_in_stage(stage::FOLLOW) & self.has_finished_lane_change();
        (follows | self.is_in_stage(stage::PASS)) & state.lane_choice.lane[slot].simd_ge(1.0)
    }
}

/// What the ego sets out to do: what another driver asks for, where that is possible.
#[inline(always)]
pub fn intent_from_action<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    orders: &EgoAction<S>,
) -> Intent<S> {
    if orders.kind.steers_wheels() {
        return intent_from_position(state, params);
    }
    let zero = splat(params.simd, 0.0);
    let side = requested_side(orders);
    let turned = (state.lane_choice.wanted_side[EGO_SLOT] * side).simd_lt(0.0);
    state.overtake.time_indicating[EGO_SLOT] =
        select(turned, zero, state.overtake.time_indicating[EGO_SLOT]);
    let start = state.vehicle(params, EGO_SLOT).can_pull_out() & side.simd_gt(0.0);
    let back = state.vehicle(params, EGO_SLOT).can_return() & side.simd_lt(0.0);
    update_indicator(state, params, EGO_SLOT, start, back);
    let [now, drops_out, drops_back] = if let Some(code) = orders.move_code() {
        let is = |which: f32| code.simd_eq(which);
        let cancels = is(ego_move::CANCEL);
        [
            is(ego_move::PULL_OUT) | is(ego_move::RETURN),
            cancels,
            cancels,
        ]
    } else {
        let shown = state.overtake.time_indicating[EGO_SLOT]
            .simd_gt(params.vehicles[EGO_SLOT].indicator_lead_time);
        [shown, side.simd_lt(0.0), side.simd_gt(0.0)]
    };
    let mut gives_up = state.vehicle(params, EGO_SLOT).can_cancel_pull_out();
    if params.road.directions.has_oncoming_traffic && orders.move_code().is_some() {
        gives_up |= state.vehicle(params, EGO_SLOT).can_abort_pass();
    }
    Intent {
        wants_to_pull_out: start,
        wants_to_return: back,
        starts_pull_out: start & now,
        starts_return: back & now,
        cancels_pull_out: gives_up & drops_out,
        cancels_return: state.vehicle(params, EGO_SLOT).can_cancel_return() & drops_back,
        has_passed_target: state.vehicle(params, EGO_SLOT).has_passed_target(),
        has_finished_lane_change: state.vehicle(params, EGO_SLOT).has_finished_lane_change(),
    }
}

/// Light the indicator that another driver asks for, if that is a part of its action.
#[inline(always)]
pub fn set_requested_indicator<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    orders: &EgoAction<S>,
) {
    if !matches!(
        orders.kind,
        ActionKind::AccelMove | ActionKind::AccelSteerSignal
    ) {
        return;
    }
    let side = requested_side(orders);
    let sound = state.motion.is_wreck[EGO_SLOT].simd_eq(0.0);
    let told = if orders.kind.steers_wheels() {
        sound
    } else {
        sound & side.simd_ne(0.0)
    };
    state.controls.indicator[EGO_SLOT] = select(told, side, state.controls.indicator[EGO_SLOT]);
}

/// Where the ego is to go: 1 towards the fast side, -1 towards the slow side, 0 nowhere.
#[inline(always)]
fn requested_side<S: Simd>(orders: &EgoAction<S>) -> F32<S> {
    let Some(code) = orders.move_code() else {
        let wish = if orders.kind.steers_wheels() { 2 } else { 1 };
        return orders.values[wish];
    };
    let (zero, one) = (splat(code.simd, 0.0), splat(code.simd, 1.0));
    let is = |which: f32| code.simd_eq(which);
    select(
        is(ego_move::INDICATE_PULL_OUT) | is(ego_move::PULL_OUT),
        one,
        select(
            is(ego_move::INDICATE_RETURN) | is(ego_move::RETURN),
            -one,
            zero,
        ),
    )
}

/// What the ego has set out to do, told from the lane that it is in: nothing is shown before.
#[inline(always)]
fn intent_from_position<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
) -> Intent<S> {
    let mut lane = splat(params.simd, 0.0);
    for k in 1..params.road.num_lanes {
        let beyond = state.motion.d[EGO_SLOT].simd_ge(params.road.boundaries[k]);
        lane = select(beyond, splat(params.simd, k as f32), lane);
    }
    let faster = lane.simd_gt(state.lane_choice.lane[EGO_SLOT]);
    let slower = lane.simd_lt(state.lane_choice.lane[EGO_SLOT]);
    let out = state.vehicle(params, EGO_SLOT).is_in_stage(stage::PULL_OUT);
    let comes_back = state.vehicle(params, EGO_SLOT).is_in_stage(stage::RETURN)
        | state.vehicle(params, EGO_SLOT).is_in_stage(stage::ABORT);
    let never = lane.simd_ne(lane);
    update_indicator(state, params, EGO_SLOT, never, never);
    Intent {
        wants_to_pull_out: never,
        wants_to_return: never,
        starts_pull_out: faster & !comes_back,
        starts_return: slower & !out,
        cancels_pull_out: slower & out,
        cancels_return: faster & comes_back,
        has_passed_target: state.vehicle(params, EGO_SLOT).has_passed_target(),
        has_finished_lane_change: state.vehicle(params, EGO_SLOT).has_finished_lane_change(),
    }
}
