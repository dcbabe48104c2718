//! Actions of an external driver, a program that drives the ego in place of the model's driver; the twin of
//! `overtaking.sim.reference.ego_action`.
//!
//! The parts of an action, in their order, depend on its kind (`ActionKind`):
//! - `Decision`: move
//! - `AccelLane`: acceleration, lane change
//! - `AccelSteer`: acceleration, wheel angle
//! - `AccelMove`: acceleration, move
//! - `AccelSteerSignal`: acceleration, wheel angle, lane change
//!
//! A move is a constant of `ego_move`. A lane change is 1 to the left, -1 to the right, 0 for no change; left is the
//! overtaking side. The model operates pedals and steering where the action has no part for them. A request that is
//! impossible now has no effect.
//!
//! A vector (`F32`, `Mask`) has one value for each simulation of a block of sixteen; a slot is the number of a vehicle.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::gap_acceptance::{Intent, store_wanted_side};
use crate::math::vectors::{F32, Mask, SIMD_LANES, select, splat};
use crate::names::ego_move;
use crate::params::Params;
use crate::state::{EGO_SLOT, State, stage};
use crate::vehicle_handle::VehicleHandle;

/// Largest number of parts of an action.
pub const MAX_ACTION_PARTS: usize = 3;

/// Declare `ActionKind` from the list in `names`: each kind with its name and the scales of its parts, the numbers by
/// which recorded integers are divided.
macro_rules! declare_action_kinds {
    ($($(#[$parts:meta])* $kind:ident, $name:literal, $scales:expr;)*) => {
        /// Meaning of the numbers of an action, as in `overtaking.model.driver_interface.ACTION_KINDS`.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum ActionKind {
            $($(#[$parts])* $kind,)*
        }

        impl ActionKind {
            /// The kind with this name.
            pub fn from_name(name: &str) -> Option<Self> {
                match name {
                    $($name => Some(Self::$kind),)*
                    _ => None,
                }
            }

            /// Number by which the recorded integer is divided to get SI units, for each part of the action.
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
    /// Whether the external driver sets the wheel angle.
    fn steers_wheels(self) -> bool {
        matches!(self, Self::AccelSteer | Self::AccelSteerSignal)
    }
}

/// Recorded actions of an external driver in all simulations of a batch.
#[derive(Clone, Copy)]
pub struct ActionLog<'a> {
    /// Meaning of the numbers.
    pub kind: ActionKind,
    /// Each part in SI units times its scale (`ActionKind::scales`), (simulation, decision, part).
    pub values: &'a [i32],
    /// Number of decisions of each simulation, at least one. After them the last action holds.
    pub decisions: usize,
}

impl ActionLog<'_> {
    /// The actions at a decision in some simulations of the batch; after the last recorded actions, those again.
    pub(crate) fn action_at<S: Simd>(
        &self,
        simd: S,
        simulations: &[usize; SIMD_LANES],
        decision_index: usize,
    ) -> EgoAction<S> {
        let recorded_index = decision_index.min(self.decisions - 1);
        let scales = self.kind.scales();
        let values = core::array::from_fn(|part| {
            let steps = simulations.map(|simulation| {
                let row = simulation * self.decisions + recorded_index;
                self.values[row * MAX_ACTION_PARTS + part] as f32
            });
            F32::simd_from(simd, steps) / scales[part]
        });
        EgoAction {
            kind: self.kind,
            values,
        }
    }
}

/// Action of an external driver at a decision, in SI units.
#[derive(Clone, Copy)]
pub struct EgoAction<S: Simd> {
    kind: ActionKind,
    values: [F32<S>; MAX_ACTION_PARTS],
}

/// Manoeuvres that the external driver cancels.
struct RequestedCancels<S: Simd> {
    /// Whether it cancels a pull-out.
    pull_out: Mask<S>,
    /// Whether it cancels a return.
    return_: Mask<S>,
    /// Whether it aborts a pass in the opposing lane.
    passing: Mask<S>,
}

impl<S: Simd> EgoAction<S> {
    /// Requested acceleration [m/s^2]; `None` if the model operates the pedals.
    #[inline(always)]
    pub fn requested_accel(&self) -> Option<F32<S>> {
        (self.kind != ActionKind::Decision).then_some(self.values[0])
    }

    /// Requested angle of the front wheels [rad]; `None` if the model steers.
    #[inline(always)]
    pub fn wheel_angle(&self) -> Option<F32<S>> {
        self.steers_wheels().then_some(self.values[1])
    }

    /// Whether the external driver sets the wheel angle.
    #[inline(always)]
    fn steers_wheels(&self) -> bool {
        self.kind.steers_wheels()
    }

    /// The requested move, a constant of `ego_move`; `None` if the kind of action has no move.
    #[inline(always)]
    fn move_code(&self) -> Option<F32<S>> {
        match self.kind {
            ActionKind::Decision => Some(self.values[0]),
            ActionKind::AccelMove => Some(self.values[1]),
            _ => None,
        }
    }

    /// Side of the requested lane change: 1 to the left, -1 to the right, 0 for no change.
    #[inline(always)]
    fn requested_side(&self) -> F32<S> {
        let Some(code) = self.move_code() else {
            // Parts are the acceleration, the wheel angle if the driver steers, and the lane change.
            let lane_change_part = if self.steers_wheels() { 2 } else { 1 };
            return self.values[lane_change_part];
        };
        let (zero, one) = (splat(code.simd, 0.0), splat(code.simd, 1.0));
        let to_left = code.simd_eq(ego_move::INDICATE_PULL_OUT) | code.simd_eq(ego_move::PULL_OUT);
        let to_right = code.simd_eq(ego_move::INDICATE_RETURN) | code.simd_eq(ego_move::RETURN);
        select(to_left, one, select(to_right, -one, zero))
    }

    /// Manoeuvres that the action cancels if they are under way.
    ///
    /// A lane change as a part of the action cancels one to the other side. Only a move can cancel a pass.
    #[inline(always)]
    fn requested_cancels(&self) -> RequestedCancels<S> {
        if let Some(code) = self.move_code() {
            let cancels = code.simd_eq(ego_move::CANCEL);
            return RequestedCancels {
                pull_out: cancels,
                return_: cancels,
                passing: cancels,
            };
        }
        let side = self.requested_side();
        RequestedCancels {
            pull_out: side.simd_lt(0.0),
            return_: side.simd_gt(0.0),
            passing: side.simd_ne(side), // False in each simulation.
        }
    }
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Whether the ego follows or passes, is not changing lanes, and has a lane on its left.
    ///
    /// A passing ego may change to yet another lane on its left.
    #[inline(always)]
    pub fn can_pull_out(self) -> Mask<S> {
        let is_ready = self.is_in_stage(stage::FOLLOW) | self.is_in_stage(stage::PASS);
        let lane = self.state.lane_choice.lane[self.slot];
        let has_left_lane = lane.simd_lt((self.params.road.num_lanes - 1) as f32);
        is_ready & self.has_finished_lane_change() & has_left_lane
    }

    /// Whether the ego follows or passes and has a lane on its right.
    ///
    /// An ego that follows may change to the right without an overtake. A passing ego need not have finished its lane
    /// change: after it has cancelled a return, it may return again at once.
    #[inline(always)]
    pub fn can_return(self) -> Mask<S> {
        let follows = self.is_in_stage(stage::FOLLOW) & self.has_finished_lane_change();
        let has_right_lane = self.state.lane_choice.lane[self.slot].simd_ge(1.0);
        (follows | self.is_in_stage(stage::PASS)) & has_right_lane
    }

    /// Whether the ego starts a wanted lane change now: by its move, else after its indicator lead time.
    #[inline(always)]
    fn moves_over_now(self, action: &EgoAction<S>) -> Mask<S> {
        if let Some(code) = action.move_code() {
            return code.simd_eq(ego_move::PULL_OUT) | code.simd_eq(ego_move::RETURN);
        }
        let time_indicating = self.state.overtake.time_indicating[self.slot];
        time_indicating.simd_gt(self.vehicle().indicator_lead_time)
    }
}

/// Intent of the ego: the request of the external driver, where it is possible.
///
/// The function also updates the wanted side and the time of indicating.
#[inline(always)]
pub fn intent_from_action<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    action: &EgoAction<S>,
) -> Intent<S> {
    if action.steers_wheels() {
        return intent_from_position(state, params);
    }
    let side = action.requested_side();
    // A driver that now wants the other side must indicate for the whole lead time again.
    let wants_other_side = (state.lane_choice.wanted_side[EGO_SLOT] * side).simd_lt(0.0);
    let time_indicating = &mut state.overtake.time_indicating[EGO_SLOT];
    *time_indicating = select(wants_other_side, splat(params.simd, 0.0), *time_indicating);
    let ego = state.vehicle(params, EGO_SLOT);
    let wants_to_pull_out = ego.can_pull_out() & side.simd_gt(0.0);
    let wants_to_return = ego.can_return() & side.simd_lt(0.0);
    store_wanted_side(state, params, EGO_SLOT, wants_to_pull_out, wants_to_return);
    let ego = state.vehicle(params, EGO_SLOT);
    let starts_now = ego.moves_over_now(action);
    let cancels = action.requested_cancels();
    // An aborted pass counts as a cancelled pull-out: both go back to the right.
    let mut cancels_pull_out = ego.can_cancel_pull_out() & cancels.pull_out;
    if params.road.directions.has_oncoming_traffic {
        cancels_pull_out |= ego.can_abort_pass() & cancels.passing;
    }
    Intent {
        wants_to_pull_out,
        wants_to_return,
        starts_pull_out: wants_to_pull_out & starts_now,
        starts_return: wants_to_return & starts_now,
        cancels_pull_out,
        cancels_return: ego.can_cancel_return() & cancels.return_,
        has_passed_target: ego.has_passed_target(),
        has_finished_lane_change: ego.has_finished_lane_change(),
    }
}

/// Set the ego's indicator, whether or not the model's driver uses its indicator.
///
/// Only two kinds of action contain the indicator; with the others `overtake` sets it. In `AccelMove` a move with a
/// side sets it. In `AccelSteerSignal` the lane change only sets the indicator, because the wheel angle changes lanes;
/// 0 switches it off.
#[inline(always)]
pub fn set_requested_indicator<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    action: &EgoAction<S>,
) {
    if !matches!(
        action.kind,
        ActionKind::AccelMove | ActionKind::AccelSteerSignal
    ) {
        return;
    }
    let side = action.requested_side();
    let is_sound = state.motion.is_wreck[EGO_SLOT].simd_eq(0.0);
    let sets_indicator = if action.steers_wheels() {
        is_sound
    } else {
        is_sound & side.simd_ne(0.0)
    };
    let indicator = &mut state.controls.indicator[EGO_SLOT];
    *indicator = select(sets_indicator, side, *indicator);
}

/// Intent of an ego that is steered by a wheel angle, from the lane that its centre is in.
///
/// The model knows of a lane change only once the centre has crossed a line. So the ego wants no lane change in
/// advance; the change starts at the first decision after the crossing.
#[inline(always)]
fn intent_from_position<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
) -> Intent<S> {
    let mut present_lane = splat(params.simd, 0.0);
    for index in 1..params.road.num_lanes {
        // `boundaries[index]` is the right border of lane `index`.
        let is_beyond = state.motion.d[EGO_SLOT].simd_ge(params.road.boundaries[index]);
        present_lane = select(is_beyond, splat(params.simd, index as f32), present_lane);
    }
    // `lane_choice.lane` is the lane at the last decision; lanes are numbered from the right.
    let has_crossed_left_line = present_lane.simd_gt(state.lane_choice.lane[EGO_SLOT]);
    let has_crossed_right_line = present_lane.simd_lt(state.lane_choice.lane[EGO_SLOT]);
    let no_wish = present_lane.simd_ne(present_lane); // False in each simulation.
    store_wanted_side(state, params, EGO_SLOT, no_wish, no_wish);
    let ego = state.vehicle(params, EGO_SLOT);
    let pulls_out = ego.is_in_stage(stage::PULL_OUT);
    let goes_back = ego.is_in_stage(stage::RETURN) | ego.is_in_stage(stage::ABORT);
    Intent {
        wants_to_pull_out: no_wish,
        wants_to_return: no_wish,
        starts_pull_out: has_crossed_left_line & !goes_back,
        starts_return: has_crossed_right_line & !pulls_out,
        cancels_pull_out: has_crossed_right_line & pulls_out,
        cancels_return: has_crossed_left_line & goes_back,
        has_passed_target: ego.has_passed_target(),
        has_finished_lane_change: ego.has_finished_lane_change(),
    }
}
