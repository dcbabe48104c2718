//! Search for the six neighbours of each vehicle among those that travel in its direction; the twin of
//! `overtaking.sim.reference.neighbour_search`.
//!
//! Lanes and their borders are numbered from the right; left is the overtaking side. During a lane change a vehicle's
//! own lane is the one that it enters. A *role* is one of the six places of a neighbour, such as `LEFT_LEADER`.
//!
//! A vector (`F32`, `Mask`) has one value for each simulation of a block of sixteen; a slot is the number of a vehicle.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::vectors::{F32, Mask, at_most, each_at_slot, select, splat};
use crate::params::Params;
use crate::road_conditions::value_of_lane;
use crate::state::{FAR, NO_SLOT, NUM_ROLES};
use crate::vehicle_handle::VehicleHandle;

/// The vehicle's own lane, the left and the right one, in the order of the roles [lanes].
const LANE_OFFSETS: [f32; 3] = [0.0, 1.0, -1.0];

/// Neighbours that are searched for at a decision: only those that the driver needs, which saves time.
#[derive(Clone, Copy)]
pub enum SearchedNeighbours {
    /// The leader in the own lane.
    Leader,
    /// The leaders in the own lane and in both lanes beside it.
    Leaders,
    /// Leaders and followers in these three lanes.
    All,
}

/// Nearest vehicles of the own direction around one vehicle, by role.
#[derive(Clone, Copy)]
pub struct Neighbours<S: Simd> {
    /// Slot of the neighbour, or `NO_SLOT`.
    pub slot: [F32<S>; NUM_ROLES],
    /// Gap between bumpers, negative when alongside [m].
    pub gap: [F32<S>; NUM_ROLES],
    /// Distance of the centres along the road, never negative [m].
    pub distance: [F32<S>; NUM_ROLES],
    /// Lateral position of the neighbour minus the driver's, positive to the left [m].
    pub lateral_distance: [F32<S>; NUM_ROLES],
    /// Half of the neighbour's length [m].
    pub half_length: [F32<S>; NUM_ROLES],
    /// Right border of the driver's lane [m].
    pub lane_right_edge: F32<S>,
    /// Left border of the driver's lane [m].
    pub lane_left_edge: F32<S>,
}

impl<S: Simd> Neighbours<S> {
    /// An empty road.
    pub fn no_vehicles(simd: S) -> Self {
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

/// The body of a vehicle as other drivers see it.
#[derive(Clone, Copy)]
pub struct VisibleBody<S: Simd> {
    /// Whether the slot holds a vehicle.
    exists: Mask<S>,
    /// Lateral position of the body's right side [m].
    right_side: F32<S>,
    /// Lateral position of the body's left side [m].
    left_side: F32<S>,
    /// Whether it changes lanes and other drivers can see that.
    pub visibly_changes_lane: Mask<S>,
    /// Lane that it drives in or changes to.
    pub lane: F32<S>,
    /// Side to which it indicates before it moves over: 1 left, -1 right, 0 for neither.
    pub claimed_side: F32<S>,
    /// One over the intensity of the brightest lamps that a follower sees, tail or stop lamps [1/cd].
    pub inverse_rear_lamp: F32<S>,
}

impl<S: Simd> VisibleBody<S> {
    /// No vehicle.
    pub fn no_vehicle(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        let never = zero.simd_lt(zero); // False in every simulation.
        Self {
            exists: never,
            right_side: zero,
            left_side: zero,
            visibly_changes_lane: never,
            lane: zero,
            claimed_side: zero,
            inverse_rear_lamp: zero,
        }
    }

    /// The body of a vehicle.
    #[inline(always)]
    pub fn new<const N: usize>(handle: VehicleHandle<'_, S, N>) -> Self {
        let (state, slot) = (handle.state, handle.slot);
        let (constants, vehicle) = (&handle.params.constants, handle.vehicle());
        let (elapsed, duration) = (state.path.elapsed[slot], state.path.duration[slot]);
        let has_visibly_moved = elapsed.simd_gt(constants.visible_fraction * duration);
        let is_sound = state.motion.is_wreck[slot].simd_eq(0.0);
        let is_changing_lane = handle.is_changing_lane();
        let indicator = state.controls.indicator[slot];
        let indicates = indicator.simd_ne(0.0);
        let brakes = state.controls.requested_accel[slot].simd_lt(-constants.stop_lamp_decel);
        let (d, lamp) = (state.motion.d[slot], vehicle.inverse_tail_lamp);
        Self {
            exists: vehicle.valid.simd_gt(0.0),
            right_side: d - vehicle.half_width,
            left_side: d + vehicle.half_width,
            lane: state.lane_choice.lane[slot],
            claimed_side: select(
                is_sound & !is_changing_lane,
                indicator,
                splat(handle.params.simd, 0.0),
            ),
            // A wreck counts only where its body is. Without this rule a wreck with its indicator on counted in its new
            // lane however far away it slid, and drivers braked in a free lane.
            visibly_changes_lane: (is_sound & is_changing_lane) & (indicates | has_visibly_moved),
            // The smaller inverse belongs to the brighter lamp.
            inverse_rear_lamp: select(brakes, at_most(lamp, constants.inverse_stop_lamp), lamp),
        }
    }
}

/// Right and left border of the lane `offset` lanes to the left of `lane` [m].
///
/// Outside the road both borders are the edge of the road.
#[inline(always)]
pub fn lane_borders<S: Simd, const N: usize>(
    params: &Params<S, N>,
    lane: F32<S>,
    offset: f32,
) -> (F32<S>, F32<S>) {
    let borders = &params.road.boundaries[..=params.road.num_lanes];
    (
        value_of_lane(borders, lane + offset),
        value_of_lane(borders, lane + (offset + 1.0)),
    )
}

/// A signed distance along the road; on a ring road the shorter way round [m].
#[inline(always)]
pub fn nearest_image<S: Simd, const N: usize>(params: &Params<S, N>, distance: F32<S>) -> F32<S> {
    if !params.is_ring {
        return distance;
    }
    let simulation = &params.simulations;
    let rounds = (distance * simulation.inverse_ring_length).round_ties_even();
    distance - simulation.ring_length * rounds
}

/// The nearest vehicle on one side of a vehicle in one lane.
#[derive(Clone, Copy)]
struct NearestVehicle<S: Simd> {
    /// Its slot, or `NO_SLOT`.
    slot: F32<S>,
    /// Distance of the centres along the road, never negative [m].
    distance: F32<S>,
}

impl<S: Simd> NearestVehicle<S> {
    /// The result of a search that finds no vehicle.
    #[inline(always)]
    fn no_vehicle(simd: S) -> Self {
        Self {
            slot: splat(simd, NO_SLOT),
            distance: splat(simd, FAR),
        }
    }

    /// Take over the vehicle in `slot` where it `is_candidate` and nearer.
    #[inline(always)]
    fn consider(&mut self, slot: F32<S>, distance: F32<S>, is_candidate: Mask<S>) {
        let is_nearer = is_candidate & distance.simd_lt(self.distance);
        self.slot = select(is_nearer, slot, self.slot);
        self.distance = select(is_nearer, distance, self.distance);
    }
}

/// The part of a lane that a body must overlap to count in that lane.
struct LaneStrip<S: Simd> {
    /// Right border of the lane plus `corridor_margin` [m].
    right_edge: F32<S>,
    /// Left border of the lane minus `corridor_margin` [m].
    left_edge: F32<S>,
    /// Index of the lane.
    lane: F32<S>,
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Find the leaders in the first `NUM_LANES` of `LANE_OFFSETS`, and if `FINDS_FOLLOWERS` also the followers there.
    ///
    /// All other roles get `NO_SLOT`, and their gaps keep old values. `TWO_WAY` is whether the road has oncoming
    /// traffic. Both directions of travel have coordinates of their own, so only vehicles of one direction are
    /// compared.
    ///
    /// A vehicle counts in every lane that its body overlaps by more than `corridor_margin`; one that straddles a line
    /// counts in both lanes. It also counts in the lane to which it changes: at once if it indicates, otherwise when it
    /// visibly moves over. Without this rule, two drivers that move to one gap from both sides see each other too late.
    #[inline(always)]
    pub fn find_neighbours<
        const NUM_LANES: usize,
        const FINDS_FOLLOWERS: bool,
        const TWO_WAY: bool,
    >(
        self,
        bodies: &[VisibleBody<S>; N],
        neighbours: &mut Neighbours<S>,
    ) {
        let (motion, params) = (&self.state.motion, self.params);
        let lane = self.state.lane_choice.lane[self.slot];
        let (right_edge, left_edge) = lane_borders(params, lane, 0.0);
        let (right_edge_beside, _) = lane_borders(params, lane, -1.0);
        let (_, left_edge_beside) = lane_borders(params, lane, 1.0);
        let edges = [
            (right_edge, left_edge),
            (left_edge, left_edge_beside),
            (right_edge_beside, right_edge),
        ];
        neighbours.slot = [splat(params.simd, NO_SLOT); NUM_ROLES];
        let num_roles_per_lane = if FINDS_FOLLOWERS { 2 } else { 1 };
        for index in 0..NUM_LANES {
            let nearest = self.nearest_in_lane::<FINDS_FOLLOWERS, TWO_WAY>(
                bodies,
                edges[index],
                LANE_OFFSETS[index],
            );
            for (role_in_lane, vehicle) in nearest.into_iter().enumerate().take(num_roles_per_lane)
            {
                // Roles come in pairs of leader and follower, in the order of the lanes.
                let role = 2 * index + role_in_lane;
                let NearestVehicle { slot, distance } = vehicle;
                // Without a neighbour these are the values of slot 0, and the gap stays at about `FAR`.
                let [half_length, d] = each_at_slot!(params, slot, |j| [
                    params.vehicles[j].half_length,
                    motion.d[j]
                ]);
                let zero = splat(params.simd, 0.0);
                let lateral_distance = d - motion.d[self.slot];
                neighbours.slot[role] = slot;
                neighbours.gap[role] = distance - (half_length + self.vehicle().half_length);
                neighbours.distance[role] = distance;
                neighbours.lateral_distance[role] =
                    select(slot.simd_ge(0.0), lateral_distance, zero);
                neighbours.half_length[role] = half_length;
            }
        }
        (neighbours.lane_right_edge, neighbours.lane_left_edge) = (right_edge, left_edge);
    }

    /// The nearest vehicle ahead and, if `FINDS_FOLLOWERS`, the nearest one behind in the lane between these edges,
    /// `offset` lanes to the left of the vehicle's own lane.
    ///
    /// The search takes one lane at a time: AVX2 has enough registers for the state of one lane, but not of three.
    #[inline(always)]
    fn nearest_in_lane<const FINDS_FOLLOWERS: bool, const TWO_WAY: bool>(
        self,
        bodies: &[VisibleBody<S>; N],
        (right_edge, left_edge): (F32<S>, F32<S>),
        offset: f32,
    ) -> [NearestVehicle<S>; 2] {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let lane_strip = LaneStrip {
            right_edge: right_edge + params.constants.corridor_margin,
            left_edge: left_edge - params.constants.corridor_margin,
            lane: state.lane_choice.lane[slot] + offset,
        };
        let mut nearest = [NearestVehicle::no_vehicle(params.simd); 2];
        // Two loops leave out the vehicle itself without a branch for each vehicle. `other_slot` is `j` as a vector:
        // counting it up saves a conversion. `min(N)` lets the compiler drop the checks of the bounds. The lower slot
        // wins a tie.
        let mut other_slot = splat(params.simd, 0.0);
        for j in 0..slot.min(N) {
            let candidate = (j, other_slot, &bodies[j]);
            self.compare_distance::<FINDS_FOLLOWERS, TWO_WAY>(candidate, &lane_strip, &mut nearest);
            other_slot += 1.0;
        }
        other_slot += 1.0;
        for j in slot + 1..params.num_slots_in_use.min(N) {
            let candidate = (j, other_slot, &bodies[j]);
            self.compare_distance::<FINDS_FOLLOWERS, TWO_WAY>(candidate, &lane_strip, &mut nearest);
            other_slot += 1.0;
        }
        nearest
    }

    /// Take over another vehicle as the nearest one ahead or behind where it is in the lane and nearer.
    #[inline(always)]
    fn compare_distance<const FINDS_FOLLOWERS: bool, const TWO_WAY: bool>(
        self,
        (j, other_slot, body): (usize, F32<S>, &VisibleBody<S>),
        lane_strip: &LaneStrip<S>,
        [ahead, behind]: &mut [NearestVehicle<S>; 2],
    ) {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let distance_ahead = nearest_image(params, state.motion.s[j] - state.motion.s[slot]);
        let overlaps_lane = body.left_side.simd_gt(lane_strip.right_edge)
            & body.right_side.simd_lt(lane_strip.left_edge);
        let changes_to_lane =
            body.visibly_changes_lane & state.lane_choice.lane[j].simd_eq(lane_strip.lane);
        let mut counts_in_lane = body.exists & (overlaps_lane | changes_to_lane);
        if TWO_WAY {
            let travel_sign = params.vehicles[j].travel_sign;
            counts_in_lane &= travel_sign.simd_eq(self.vehicle().travel_sign);
        }
        let is_ahead = distance_ahead.simd_ge(0.0);
        ahead.consider(other_slot, distance_ahead, counts_in_lane & is_ahead);
        if FINDS_FOLLOWERS {
            behind.consider(other_slot, -distance_ahead, counts_in_lane & !is_ahead);
        }
    }
}
