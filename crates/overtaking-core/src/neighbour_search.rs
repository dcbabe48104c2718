//! Who drives around each vehicle; see `overtaking.sim.reference.neighbour_search`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::vectors::{F32, Mask, at_most, each_at_slot, select, splat};
use crate::params::Params;
use crate::road_conditions::value_of_lane;
use crate::state::{NO_SLOT, NUM_ROLES, State};
use crate::vehicle_handle::VehicleHandle;

const FAR: f32 = 1e9;
/// The own, the faster and the slower lane, from the own.
const LANE_OFFSETS: [f32; 3] = [0.0, 1.0, -1.0];

/// Nearest vehicles of one vehicle by role.
#[derive(Clone, Copy)]
pub struct Neighbours<S: Simd> {
    pub slot: [F32<S>; NUM_ROLES],
    pub gap: [F32<S>; NUM_ROLES],
    /// Distance of the centres along the road [m].
    pub distance: [F32<S>; NUM_ROLES],
    /// How far it is towards the fast side [m].
    pub lateral_distance: [F32<S>; NUM_ROLES],
    /// Half of its length [m].
    pub half_length: [F32<S>; NUM_ROLES],
    pub lane_right_edge: F32<S>,
    pub lane_left_edge: F32<S>,
}

impl<S: Simd> Neighbours<S> {
    /// An empty road.
    pub fn none(simd: S) -> Self {
        let (none, far, zero) = (splat(simd, NO_SLOT), splat(simd, FAR), splat(simd, 0.0));
        Self {
            slot: [none; NUM_ROLES],
            gap: [far; NUM_ROLES],
            distance: [far; NUM_ROLES],
            lateral_distance: [zero; NUM_ROLES],
            half_length: [zero; NUM_ROLES],
            lane_right_edge: zero,
            lane_left_edge: zero,
        }
    }
}

/// What everybody else sees of a vehicle, whoever looks.
#[derive(Clone, Copy)]
pub struct VisibleBody<S: Simd> {
    valid: Mask<S>,
    right_side: F32<S>,
    left_side: F32<S>,
    /// Whether it changes lanes and can be seen to.
    pub visibly_changes_lane: Mask<S>,
    /// Its lane, and to which side it signals without moving over yet.
    pub lane: F32<S>,
    pub claimed_side: F32<S>,
    /// One over the intensity of the lamps that a follower sees: tail lamps, or stop lamps [1/cd].
    pub inverse_rear_lamp: F32<S>,
}

impl<S: Simd> VisibleBody<S> {
    /// Nobody.
    pub fn none(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        let never = zero.simd_lt(zero);
        Self {
            valid: never,
            right_side: zero,
            left_side: zero,
            visibly_changes_lane: never,
            lane: zero,
            claimed_side: zero,
            inverse_rear_lamp: zero,
        }
    }

    /// Vehicle `j`.
    #[inline(always)]
    pub fn new<const N: usize>(state: &State<S, N>, params: &Params<S, N>, j: usize) -> Self {
        let (constants, vehicle) = (&params.constants, &params.vehicles[j]);
        let moves =
            state.path.elapsed[j].simd_gt(constants.visible_fraction * state.path.duration[j]);
        let (sound, zero) = (
            state.motion.is_wreck[j].simd_eq(0.0),
            splat(params.simd, 0.0),
        );
        let changing = state.path.elapsed[j].simd_lt(state.path.duration[j]);
        let waits = sound & !changing;
        let changing = sound & changing;
        let braking = state.controls.requested_accel[j].simd_lt(-constants.stop_lamp_decel);
        let lamp = vehicle.inverse_tail_lamp;
        Self {
            valid: vehicle.valid.simd_gt(0.0),
            right_side: state.motion.d[j] - vehicle.half_width,
            left_side: state.motion.d[j] + vehicle.half_width,
            lane: state.lane_choice.lane[j],
            claimed_side: select(waits, state.controls.indicator[j], zero),
            visibly_changes_lane: changing & (state.controls.indicator[j].simd_ne(0.0) | moves),
            inverse_rear_lamp: select(braking, at_most(lamp, constants.inverse_stop_lamp), lamp),
        }
    }
}

/// Borders of the lane `shift` lanes from a vehicle's own [m].
#[inline(always)]
pub fn lane_borders<S: Simd, const N: usize>(
    params: &Params<S, N>,
    lane: F32<S>,
    shift: f32,
) -> (F32<S>, F32<S>) {
    let borders = &params.road.boundaries[..=params.road.num_lanes];
    (
        value_of_lane(borders, lane + shift),
        value_of_lane(borders, lane + (shift + 1.0)),
    )
}

/// A distance along the road; on a ring that to the nearest image [m].
#[inline(always)]
pub fn nearest_image<S: Simd, const N: usize>(params: &Params<S, N>, distance: F32<S>) -> F32<S> {
    if !params.is_ring {
        return distance;
    }
    distance
        - params.simulations.ring_length
            * (distance * params.simulations.inverse_ring_length).round_ties_even()
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// The nearest vehicle ahead and behind of vehicle `i`, in the own, the faster and the slower lane; if the
    /// number of lanes `WATCHED` is 1, only the one ahead in the own lane: no driver looks at the others.
    #[inline(always)]
    pub fn find_neighbours<const WATCHED: usize, const TWO_WAY: bool>(
        self,
        bodies: &[VisibleBody<S>; N],
        near: &mut Neighbours<S>,
    ) {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let lane = state.lane_choice.lane[slot];
        let (low, high) = lane_borders(params, lane, 0.0);
        let (slower, _) = lane_borders(params, lane, -1.0);
        let (_, faster) = lane_borders(params, lane, 1.0);
        let bands = [(low, high), (high, faster), (slower, low)];
        near.slot = [splat(params.simd, NO_SLOT); NUM_ROLES];
        for k in 0..WATCHED {
            let ends = self.nearest_in_lane::<WATCHED, TWO_WAY>(bodies, bands[k], LANE_OFFSETS[k]);
            for (end, (other_slot, distance)) in ends.into_iter().enumerate().take(WATCHED.min(2)) {
                let role = 2 * k + end;
                let [half_length, place] =
                    each_at_slot!(params.num_slots_in_use, other_slot, |j| [
                        params.vehicles[j].half_length,
                        state.motion.d[j]
                    ]);
                let zero = splat(params.simd, 0.0);
                near.slot[role] = other_slot;
                near.gap[role] = distance - (half_length + self.vehicle().half_length);
                near.distance[role] = distance;
                near.lateral_distance[role] =
                    select(other_slot.simd_ge(0.0), place - state.motion.d[slot], zero);
                near.half_length[role] = half_length;
            }
        }
        (near.lane_right_edge, near.lane_left_edge) = (low, high);
    }

    /// Slot and distance of the nearest vehicle ahead and behind of vehicle `i` in one lane, between these borders and
    /// `shift` lanes from its own; only ahead if `WATCHED` is 1.
    ///
    /// The search takes one lane at a time: AVX2 has enough registers for the state of one lane, but not of three.
    #[inline(always)]
    fn nearest_in_lane<const WATCHED: usize, const TWO_WAY: bool>(
        self,
        bodies: &[VisibleBody<S>; N],
        (low, high): (F32<S>, F32<S>),
        shift: f32,
    ) -> [(F32<S>, F32<S>); 2] {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (low, high) = (
            low + params.constants.corridor_margin,
            high - params.constants.corridor_margin,
        );
        let lane = state.lane_choice.lane[slot] + shift;
        let (nobody, far) = (splat(params.simd, NO_SLOT), splat(params.simd, FAR));
        let [mut ahead, mut behind] = [(nobody, far); 2];
        for j in 0..params.num_slots_in_use {
            if slot == j {
                continue;
            }
            let (other, number) = (&bodies[j], splat(params.simd, j as i32 as f32));
            let way = nearest_image(params, state.motion.s[j] - state.motion.s[slot]);
            let overlaps = other.left_side.simd_gt(low) & other.right_side.simd_lt(high);
            let shows = other.visibly_changes_lane & state.lane_choice.lane[j].simd_eq(lane);
            let mut inside = other.valid & (overlaps | shows);
            if TWO_WAY {
                inside &= params.vehicles[j]
                    .travel_sign
                    .simd_eq(self.vehicle().travel_sign);
            }
            let is_ahead = way.simd_ge(0.0);
            let front = inside & is_ahead & way.simd_lt(ahead.1);
            ahead = (select(front, number, ahead.0), select(front, way, ahead.1));
            if WATCHED > 1 {
                let back = inside & !is_ahead & (-way).simd_lt(behind.1);
                behind = (select(back, number, behind.0), select(back, -way, behind.1));
            }
        }
        [ahead, behind]
    }
}
