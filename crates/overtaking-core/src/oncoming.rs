//! Oncoming vehicles on two-way roads: search, visibility and beliefs of drivers; the twin of
//! `overtaking.sim.reference.oncoming`.
//!
//! Each vehicle has a frame of coordinates of its own direction of travel. In it stations grow ahead, lateral positions
//! grow to the left, the overtaking side, lane 0 is the lane of that direction, and the opposing lane is on the left.
//! Each vehicle has a slot, its number in the simulation. A driver's leader is the vehicle ahead of it in its
//! direction.
//!
//! Values of type `F32<S>` and `Mask<S>` have one element for each simulation of a block, the simulations that are
//! computed together; comments call such an element a SIMD lane. `VehicleHandle` is a view of one slot in them. `N` is
//! the number of slots. `at_slot!` and `each_at_slot!` read values of the vehicle whose slot they get, or of slot 0
//! without a vehicle.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::decision_context::DriverContext;
use crate::math::elementary::exp;
use crate::math::vectors::{
    F32, Mask, at_least, at_most, at_slot, each_at_slot, min, select, splat,
};
use crate::neighbour_search::{Neighbours, VisibleBody, lane_borders};
use crate::params::{KnotTable, Params, station_indices};
use crate::perception::{
    Conspicuity, MIN_SIGHT_LINE, detection_time, extrapolate_motion, sight_range_ratio,
};
use crate::state::{EGO_SLOT, FAR, LEADER, NEVER_LOOKED, NO_SLOT, State};
use crate::vehicle_handle::VehicleHandle;

/// Smallest closing speed, which keeps the time until vehicles meet finite [m/s]. A choice, as is the larger one
/// in `passing`.
const MIN_CLOSING_SPEED: f32 = 0.1;

/// Index in `Attention::oncoming_slot` and `oncoming_time_in_view` of the nearest oncoming vehicle in any lane.
const IN_ANY_LANE: usize = 0;
/// The same index of the nearest oncoming vehicle in the driver's own lane.
const IN_OWN_LANE: usize = 1;

/// An oncoming vehicle ahead of a driver, and the driver's beliefs about it.
#[derive(Clone, Copy)]
pub struct OncomingVehicle<S: Simd> {
    /// Slot of the vehicle, or `NO_SLOT`.
    pub slot: F32<S>,
    /// Gap between the front bumpers [m].
    pub gap: F32<S>,
    /// Whether the driver has detected it.
    pub is_detected: Mask<S>,
    /// Whether the driver has looked long enough to know if a vehicle is coming.
    pub is_certain: Mask<S>,
    /// Believed gap, `oncoming_range` without a detected vehicle [m].
    pub believed_gap: F32<S>,
    /// Believed closing speed, the expected one without a detected vehicle [m/s].
    pub closing_speed: F32<S>,
    /// Distance to which the driver sees along the lane of the vehicle, the opposing lane or the driver's own [m].
    pub sight_distance: F32<S>,
}

/// Traffic of the other direction on a two-way road, for one driver.
#[derive(Clone, Copy)]
pub struct OncomingTraffic<S: Simd> {
    /// The nearest oncoming vehicle in any lane, which limits a pass.
    pub nearest: OncomingVehicle<S>,
    /// Whether the driver has detected an oncoming vehicle in its own lane.
    pub meets_in_own_lane: Mask<S>,
    /// Time until the driver meets that vehicle, as it believes [s].
    pub time_to_meeting: F32<S>,
    /// Whether another vehicle passes the driver and the driver notices it.
    pub is_being_passed: Mask<S>,
    /// Whether the leader indicates that it will pull out itself.
    pub leader_pulls_out: Mask<S>,
}

impl<S: Simd> OncomingVehicle<S> {
    /// No vehicle: `NO_SLOT`, zeros and false masks.
    pub fn no_vehicle(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        let never = zero.simd_lt(zero);
        Self {
            slot: splat(simd, NO_SLOT),
            gap: zero,
            is_detected: never,
            is_certain: never,
            believed_gap: zero,
            closing_speed: zero,
            sight_distance: zero,
        }
    }
}

impl<S: Simd> OncomingTraffic<S> {
    /// A road without oncoming vehicles: zeros and false masks.
    pub fn no_vehicles(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        let never = zero.simd_lt(zero);
        Self {
            nearest: OncomingVehicle::no_vehicle(simd),
            meets_in_own_lane: never,
            time_to_meeting: zero,
            is_being_passed: never,
            leader_pulls_out: never,
        }
    }
}

/// Update the beliefs of a driver about oncoming vehicles in `context.oncoming`, and the time for which they are in
/// view.
///
/// The time in view is updated at every decision. To save time, the belief about the nearest vehicle in any lane is
/// updated only at decisions at which the driver decides by it in a simulation of the block.
#[inline(always)]
pub fn observe_oncoming<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    bodies: &[VisibleBody<S>; N],
    search: &OncomingSearch<S, N>,
    context: &mut DriverContext<S>,
) {
    let (slot, decision_index) = (context.slot, context.decision_index);
    // Only the ego, the vehicle under study, may have an external driver, which observes the nearest vehicle at every
    // decision. Other drivers decide by it only when they check their mirrors, or while they overtake.
    let needs_beliefs =
        slot == EGO_SLOT || (context.checks_mirrors | search.overtakes[slot]).any_true();
    let neighbours = &context.neighbours;
    let oncoming = &mut context.oncoming;
    let driver = state.vehicle(params, slot);
    let [nearest, nearest_in_own_lane] = search.nearest_oncoming(driver, bodies);
    let sight_distance = driver.sight_distance(neighbours);
    let sighting = driver.sighting(neighbours, nearest, sight_distance);
    let certain = is_certain(state, params, slot, IN_ANY_LANE, &sighting);
    if needs_beliefs {
        oncoming.nearest = state
            .vehicle(params, slot)
            .believe(&sighting, certain, decision_index);
        let leader_slot = neighbours.slot[LEADER];
        // Positive to the left.
        let indicator = at_slot!(params, leader_slot, |j| state.controls.indicator[j]);
        oncoming.leader_pulls_out = leader_slot.simd_ge(0.0) & indicator.simd_gt(0.0);
    }
    if nearest_in_own_lane.slot.simd_ge(0.0).any_true() {
        // Bends and crests limit the view along the driver's own lane. That a leader does not hide it is a choice of
        // this model.
        let sight_distance = state.road.sight_distance[slot];
        let sighting =
            state
                .vehicle(params, slot)
                .sighting(neighbours, nearest_in_own_lane, sight_distance);
        let certain = is_certain(state, params, slot, IN_OWN_LANE, &sighting);
        let in_own_lane = state
            .vehicle(params, slot)
            .believe(&sighting, certain, decision_index);
        oncoming.meets_in_own_lane = in_own_lane.is_detected;
        oncoming.time_to_meeting =
            in_own_lane.believed_gap / at_least(in_own_lane.closing_speed, MIN_CLOSING_SPEED);
    } else {
        // No simulation has a vehicle in the driver's own lane, so the slot is `NO_SLOT` in each.
        update_time_in_view(state, params, slot, IN_OWN_LANE, nearest_in_own_lane.slot);
        oncoming.meets_in_own_lane = certain & !certain; // False in every SIMD lane.
    }
    oncoming.is_being_passed = search.is_being_passed(state.vehicle(params, slot));
}

/// Whether the driver in `slot` has looked long enough to know if a vehicle is coming; updates the time in view.
///
/// `lanes` is `IN_ANY_LANE` or `IN_OWN_LANE`. The time in view counts for the vehicle in view, or for the view without
/// a vehicle. Recognising an empty road takes as long as detecting a clearly visible vehicle, so no driver pulls out
/// the moment a bend or a truck stops hiding the road.
#[inline(always)]
fn is_certain<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    lanes: usize,
    sighting: &Sighting<S>,
) -> Mask<S> {
    let no_slot = splat(params.simd, NO_SLOT);
    let needed_time = select(
        sighting.is_visible,
        detection_time(params, sighting.sight_range_ratio),
        params.simulations.detection_time,
    );
    let slot_in_view = select(sighting.is_visible, sighting.slot, no_slot);
    update_time_in_view(state, params, slot, lanes, slot_in_view);
    state.attention.oncoming_time_in_view[slot][lanes].simd_ge(needed_time)
}

/// Count the time for which the driver in `slot` has had the same vehicle, or no vehicle, in view.
///
/// `lanes` is `IN_ANY_LANE` or `IN_OWN_LANE`; `slot_in_view` is the vehicle in view there, or `NO_SLOT`.
#[inline(always)]
fn update_time_in_view<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    lanes: usize,
    slot_in_view: F32<S>,
) {
    let constants = &params.constants;
    let slot_at_last_look = &mut state.attention.oncoming_slot[slot][lanes];
    let time_in_view = &mut state.attention.oncoming_time_in_view[slot][lanes];
    let is_unchanged = slot_in_view.simd_eq(*slot_at_last_look);
    // `decision` is the time between two decisions [s].
    let time = select(
        is_unchanged,
        *time_in_view + constants.decision,
        splat(params.simd, 0.0),
    );
    // Drivers have watched the traffic before the first frame.
    let is_first_look = slot_at_last_look.simd_eq(NEVER_LOOKED);
    let initial_time = splat(params.simd, constants.initial_time_in_view);
    *time_in_view = select(is_first_look, initial_time, time);
    *slot_at_last_look = slot_in_view;
}

/// Visibility of one oncoming vehicle for a driver.
struct Sighting<S: Simd> {
    /// Slot of the vehicle, or `NO_SLOT`.
    slot: F32<S>,
    /// Half of the lengths of both vehicles [m].
    half_lengths: F32<S>,
    /// Gap between the front bumpers [m].
    gap: F32<S>,
    /// Distance over the range at which light and weather show the vehicle [1].
    sight_range_ratio: F32<S>,
    /// Whether the driver can see the vehicle.
    is_visible: Mask<S>,
    /// Distance to which the driver sees along the lane of the vehicle [m].
    sight_distance: F32<S>,
}

/// The nearest vehicle of the other direction ahead of a driver.
#[derive(Clone, Copy)]
pub struct NearestOncoming<S: Simd> {
    /// Slot of the vehicle, or `NO_SLOT`.
    slot: F32<S>,
    /// Distance of the centres along the road; `FAR` without a vehicle [m].
    distance: F32<S>,
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// The oncoming vehicle behind the nearest one, and the driver's beliefs about it.
    ///
    /// The model's drivers decide by the nearest vehicle alone; external drivers also observe the second. A driver
    /// detects the second together with the nearest, if it can see the second.
    #[inline(always)]
    pub fn observe_second_oncoming(self, context: &DriverContext<S>) -> OncomingVehicle<S> {
        let nearest = &context.oncoming.nearest;
        let second = OncomingSearch::nearest_except(self, nearest.slot);
        let sighting = self.sighting(&context.neighbours, second, nearest.sight_distance);
        self.believe(&sighting, nearest.is_detected, context.decision_index)
    }

    /// Visibility of an oncoming vehicle for a driver that sees as far as `sight_distance` [m].
    #[inline(always)]
    fn sighting(
        self,
        neighbours: &Neighbours<S>,
        oncoming: NearestOncoming<S>,
        sight_distance: F32<S>,
    ) -> Sighting<S> {
        let (vx, params) = (&self.state.motion.vx, self.params);
        // An oncoming vehicle shows its headlamps.
        let [half_length, log_contrast, inverse_lamp_intensity] =
            each_at_slot!(params, oncoming.slot, |j| [
                params.vehicles[j].half_length,
                params.vehicles[j].log_contrast,
                params.vehicles[j].inverse_head_lamp
            ]);
        let half_lengths = half_length + self.vehicle().half_length;
        let gap = oncoming.distance - half_lengths;
        let leader_slot = neighbours.slot[LEADER];
        let leader_speed = at_slot!(params, leader_slot, |j| vx[j]);
        let extinction = self.extinction_ahead(neighbours, leader_speed);
        let conspicuity = Conspicuity {
            log_contrast,
            inverse_lamp_intensity,
        };
        let is_ahead = true;
        let ratio = sight_range_ratio(params, gap, is_ahead, &conspicuity, extinction);
        let range = at_most(sight_distance, params.constants.oncoming_range);
        Sighting {
            slot: oncoming.slot,
            half_lengths,
            gap,
            sight_range_ratio: ratio,
            is_visible: oncoming.slot.simd_ge(0.0) & ratio.simd_le(1.0) & gap.simd_lt(range),
            sight_distance,
        }
    }

    /// Closing speed if oncoming vehicles drive as fast as usual [m/s].
    #[inline(always)]
    pub fn expected_closing_speed(self) -> F32<S> {
        let (own_speed, _) = self.road_velocity(); // Along and across the road [m/s].
        own_speed + self.params.simulations.expected_oncoming_speed
    }

    /// Beliefs of a driver about an oncoming vehicle, and its assumptions without one.
    ///
    /// The driver extrapolates the motion that it saw a reaction delay ago. It misjudges the distance by a slowly
    /// varying factor; `looming.error_share`, the share of the error that is left, falls from 1 to 0 as contact comes
    /// near. It expects the usual speed until the vehicle looms, that is until its image visibly grows; then
    /// `looming.noticed_share`, which grows to 1 with the looming, weights the speed that looming shows. A driver that
    /// has detected no vehicle assumes one at the range to which drivers look.
    #[inline(always)]
    fn believe(
        self,
        sighting: &Sighting<S>,
        is_certain: Mask<S>,
        decision_index: u32,
    ) -> OncomingVehicle<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, vehicle) = (&params.constants, self.vehicle());
        let [width, two_wheeler, oncoming_vx] = each_at_slot!(params, sighting.slot, |j| [
            params.vehicles[j].looming_width,
            params.vehicles[j].two_wheeler,
            state.motion.vx[j]
        ]);
        let is_detected = sighting.is_visible & is_certain;
        let (own_speed, _) = self.road_velocity(); // Along and across the road [m/s].
        // The true motion now, because what the driver believes depends on the delay that this selects. The speed of
        // the oncoming vehicle along its own axis is nearly that along the road.
        let is_imminent = sighting
            .gap
            .simd_lt(constants.urgent_time * (own_speed + oncoming_vx));
        // In decisions.
        let delay = select(
            is_imminent,
            vehicle.urgent_reaction_delay,
            vehicle.reaction_delay,
        );
        // Station and speed that the driver saw a reaction delay ago, the station extrapolated to now.
        let recalled = extrapolate_motion(state, params, sighting.slot, delay, decision_index);
        // The frame of the oncoming vehicle counts stations from the other end of the road.
        let distance = (params.road.directions.length - recalled.s) - state.motion.s[slot];
        let gap = distance - sighting.half_lengths;
        let looming = self.sense_looming(gap, own_speed + recalled.speed, width);
        // Two-wheelers look farther away.
        let size_factor = select(
            two_wheeler.simd_gt(0.0),
            splat(params.simd, constants.two_wheeler_distance_factor),
            splat(params.simd, 1.0),
        );
        // The coefficient of variation times a random process of unit variance.
        let distance_error = params.simulations.oncoming_error * state.noise.distance_error[slot];
        let distance_factor = exp(distance_error) * size_factor;
        let believed_gap = gap + gap * ((distance_factor - 1.0) * looming.error_share);
        let expected = self.expected_closing_speed();
        let believed_closing_speed =
            expected + looming.noticed_share * (looming.closing_speed - expected);
        let range = splat(params.simd, constants.oncoming_range);
        OncomingVehicle {
            slot: sighting.slot,
            gap: sighting.gap,
            is_detected,
            is_certain,
            believed_gap: select(is_detected, believed_gap, range),
            closing_speed: select(is_detected, believed_closing_speed, expected),
            sight_distance: sighting.sight_distance,
        }
    }

    /// Sight distance along the opposing lane [m].
    ///
    /// The smallest of the distances that the road, the weather and a tall leader leave.
    #[inline(always)]
    fn sight_distance(self, neighbours: &Neighbours<S>) -> F32<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, road) = (&params.constants, &params.road);
        let (s, _) = self.road_position(); // Counted from the start of the road for both directions.
        let is_against_road = self.vehicle().travel_sign.simd_lt(0.0);
        let mut stated_by_map = splat(params.simd, 0.0);
        let directions = &road.directions;
        for (table, applies) in [
            (&directions.sight_along, !is_against_road),
            (&directions.sight_against, is_against_road),
        ] {
            if applies.any_true() {
                stated_by_map = select(applies, interpolate_knots(table, s), stated_by_map);
            }
        }
        let leader_slot = neighbours.slot[LEADER];
        let [half_width, blocks_view] = each_at_slot!(params, leader_slot, |j| [
            params.vehicles[j].half_width,
            params.vehicles[j].blocks_view
        ]);
        let distance_to_rear = at_least(
            neighbours.distance[LEADER] - neighbours.half_length[LEADER],
            MIN_SIGHT_LINE,
        );
        // The line of sight begins at the driver's eye, which is `eye_offset` to the left of the vehicle's centre, and
        // passes the leader's left rear corner. Offsets are lateral distances from the eye, positive to the left.
        let corner_offset = neighbours.lateral_distance[LEADER] + half_width - constants.eye_offset;
        let opposing_lane_d = 0.5
            * (road.boundaries[road.num_lanes] + road.boundaries[road.directions.num_own_lanes]);
        let lane_offset = opposing_lane_d - state.motion.d[slot] - constants.eye_offset;
        let hides_lane = leader_slot.simd_ge(0.0)
            & blocks_view.simd_gt(0.0)
            & corner_offset.simd_gt(0.0)
            & lane_offset.simd_gt(0.0);
        // By similar triangles the line of sight meets the middle of the opposing lane at this distance.
        let distance = lane_offset * (distance_to_rear / at_least(corner_offset, MIN_SIGHT_LINE));
        let past_leader = select(hides_lane, distance, splat(params.simd, FAR));
        // `state.road.sight_distance` follows from bends and crests; it limits nothing if the map states sight
        // distances. `oncoming_sight` is the limit by the weather.
        let by_road = min(stated_by_map, state.road.sight_distance[slot]);
        min(min(by_road, past_leader), params.simulations.oncoming_sight)
    }

    /// `oncoming`, but no vehicle in simulations in which the driver's slot is empty.
    #[inline(always)]
    fn where_vehicle_exists(self, oncoming: NearestOncoming<S>) -> NearestOncoming<S> {
        let (simd, exists) = (self.params.simd, self.vehicle().valid.simd_gt(0.0));
        NearestOncoming {
            slot: select(exists, oncoming.slot, splat(simd, NO_SLOT)),
            distance: select(exists, oncoming.distance, splat(simd, FAR)),
        }
    }
}

/// The value of a table at stations, linear between its knots.
///
/// The first knot is far before the road, so every `s` has a knot behind it.
#[inline(always)]
fn interpolate_knots<S: Simd>(table: &KnotTable, s: F32<S>) -> F32<S> {
    let KnotTable {
        stations,
        values,
        slopes,
    } = table;
    let mut result = splat(s.simd, 0.0);
    for index in station_indices(stations) {
        let value = values[index] + (s - stations[index]) * slopes[index];
        result = select(s.simd_ge(stations[index]), value, result);
    }
    result
}

/// A vehicle in the frame of the other direction of travel, in which the drivers that it meets count positions.
#[derive(Clone, Copy)]
struct OppositeView<S: Simd> {
    /// Station of the centre [m].
    s: F32<S>,
    /// Lateral position of the right side [m].
    right_side: F32<S>,
    /// Lateral position of the left side [m].
    left_side: F32<S>,
    /// Index of the lane, from the right.
    lane: F32<S>,
    /// Whether a part of the vehicle is on the road, in any lane.
    on_road: Mask<S>,
}

impl<S: Simd> OppositeView<S> {
    /// Whether a part of the body lies between two edges [m] of a lane or a road, in the frame of the other direction.
    #[inline(always)]
    fn overlaps(&self, (right_edge, left_edge): (F32<S>, F32<S>)) -> Mask<S> {
        self.left_side.simd_gt(right_edge) & self.right_side.simd_lt(left_edge)
    }
}

/// The vehicles of a two-way road in the frame of the other direction, and sets of slots that shorten the search.
///
/// A set is a number of 32 bits: bit k is set if the condition holds for slot k in any simulation of the block.
#[derive(Clone, Copy)]
pub struct OncomingSearch<S: Simd, const N: usize> {
    /// Each vehicle in the frame of the other direction.
    as_seen_by_oncoming: [OppositeView<S>; N],
    /// Slots of vehicles that drive along the road.
    slots_along: u32,
    /// Slots of vehicles that drive against the direction of the road.
    slots_against: u32,
    /// Slots of vehicles that are in lane 0 of the other direction, which for them is the opposing lane, or visibly
    /// change to it.
    opposing_lane_slots: u32,
    /// Whether the vehicle in each slot overtakes.
    overtakes: [Mask<S>; N],
    /// Slots of vehicles that overtake.
    overtaking_slots: u32,
}

impl<S: Simd, const N: usize> OncomingSearch<S, N> {
    /// An empty road, until `update` fills the search.
    pub fn no_vehicles(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        let never = zero.simd_lt(zero);
        let view = OppositeView {
            s: zero,
            right_side: zero,
            left_side: zero,
            lane: zero,
            on_road: never,
        };
        Self {
            as_seen_by_oncoming: [view; N],
            slots_along: 0,
            slots_against: 0,
            opposing_lane_slots: 0,
            overtakes: [never; N],
            overtaking_slots: 0,
        }
    }

    /// Compute the views and the sets of slots at this decision.
    ///
    /// A vehicle is in a lane that its body overlaps by more than `corridor_margin`. `bodies` say whether each vehicle
    /// visibly changes lanes.
    #[inline(always)]
    pub fn update(
        &mut self,
        state: &State<S, N>,
        params: &Params<S, N>,
        bodies: &[VisibleBody<S>; N],
    ) {
        let (constants, road) = (&params.constants, &params.road);
        let simd = params.simd;
        // Edges of lane 0 and of the road, moved inwards by the margin.
        let right_edge = splat(simd, road.boundaries[0] + constants.corridor_margin);
        let lane_0 = (
            right_edge,
            splat(simd, road.boundaries[1] - constants.corridor_margin),
        );
        let left_edge = splat(
            simd,
            road.boundaries[road.num_lanes] - constants.corridor_margin,
        );
        let whole_road = (right_edge, left_edge);
        (self.slots_along, self.slots_against) = (0, 0);
        (self.opposing_lane_slots, self.overtaking_slots) = (0, 0);
        for j in 0..params.num_slots_in_use {
            let vehicle = &params.vehicles[j];
            // Whether the simulation has a vehicle in this slot.
            let valid = vehicle.valid.simd_gt(0.0);
            // `edge_sum`, the sum of the lateral positions of both edges, mirrors a lateral position.
            let d = road.directions.edge_sum - state.motion.d[j];
            let view = OppositeView {
                s: road.directions.length - state.motion.s[j],
                right_side: d - vehicle.half_width,
                left_side: d + vehicle.half_width,
                // Both directions count lanes from their own right.
                lane: (road.num_lanes - 1) as f32 - state.lane_choice.lane[j],
                on_road: valid, // Set below, by the sides of this view.
            };
            let is_in_opposing_lane =
                view.overlaps(lane_0) | (bodies[j].visibly_changes_lane & view.lane.simd_eq(0.0));
            let drives_along = vehicle.travel_sign.simd_gt(0.0);
            self.slots_along |= u32::from((valid & drives_along).any_true()) << j;
            self.slots_against |= u32::from((valid & !drives_along).any_true()) << j;
            self.opposing_lane_slots |= u32::from((valid & is_in_opposing_lane).any_true()) << j;
            self.overtakes[j] = state.vehicle(params, j).is_overtaking();
            self.overtaking_slots |= u32::from(self.overtakes[j].any_true()) << j;
            self.as_seen_by_oncoming[j] = OppositeView {
                on_road: valid & view.overlaps(whole_road),
                ..view
            };
        }
    }

    /// The nearest oncoming vehicle of a driver in any lane, and the nearest in its own lane.
    ///
    /// A vehicle is in each lane that its body overlaps by more than a margin, and in the lane to which it visibly
    /// changes.
    #[inline(always)]
    fn nearest_oncoming(
        &self,
        driver: VehicleHandle<'_, S, N>,
        bodies: &[VisibleBody<S>; N],
    ) -> [NearestOncoming<S>; 2] {
        let (state, params, slot) = (driver.state, driver.params, driver.slot);
        let s = state.motion.s[slot];
        let (lane, travel_sign) = (state.lane_choice.lane[slot], driver.vehicle().travel_sign);
        let no_vehicle = NearestOncoming {
            slot: splat(params.simd, NO_SLOT),
            distance: splat(params.simd, FAR),
        };
        let [mut nearest, mut in_own_lane] = [no_vehicle; 2];
        // The vehicle in a slot may drive along the road in one simulation and against it in another.
        let mut oncoming_slots = 0;
        for (own_slots, opposite_slots) in [
            (self.slots_along, self.slots_against),
            (self.slots_against, self.slots_along),
        ] {
            if own_slots >> slot & 1 == 1 {
                oncoming_slots |= opposite_slots;
            }
        }
        for j in (0..params.num_slots_in_use).filter(|j| oncoming_slots >> *j & 1 == 1) {
            let view = &self.as_seen_by_oncoming[j];
            let distance = view.s - s;
            let is_oncoming =
                params.vehicles[j].travel_sign.simd_ne(travel_sign) & distance.simd_ge(0.0);
            let is_nearer = is_oncoming & view.on_road & distance.simd_lt(nearest.distance);
            let other_slot = splat(params.simd, j as i32 as f32);
            nearest.slot = select(is_nearer, other_slot, nearest.slot);
            nearest.distance = select(is_nearer, distance, nearest.distance);
        }
        // In lane 0 a driver meets only vehicles that are in this lane or change to it; skipping the others saves time.
        if lane.simd_eq(0.0).all_true() {
            oncoming_slots &= self.opposing_lane_slots;
        }
        if oncoming_slots == 0 {
            return [driver.where_vehicle_exists(nearest), in_own_lane];
        }
        let (right_edge, left_edge) = lane_borders(params, lane, 0.0); // 0 selects the driver's own lane.
        let edges = (
            right_edge + params.constants.corridor_margin,
            left_edge - params.constants.corridor_margin,
        );
        for j in (0..params.num_slots_in_use).filter(|j| oncoming_slots >> *j & 1 == 1) {
            let view = &self.as_seen_by_oncoming[j];
            let distance = view.s - s;
            let is_oncoming = params.vehicles[j].valid.simd_gt(0.0)
                & params.vehicles[j].travel_sign.simd_ne(travel_sign)
                & distance.simd_ge(0.0);
            let changes_to_lane = bodies[j].visibly_changes_lane & view.lane.simd_eq(lane);
            let is_nearer = is_oncoming
                & (changes_to_lane | view.overlaps(edges))
                & distance.simd_lt(in_own_lane.distance);
            let other_slot = splat(params.simd, j as i32 as f32);
            in_own_lane.slot = select(is_nearer, other_slot, in_own_lane.slot);
            in_own_lane.distance = select(is_nearer, distance, in_own_lane.distance);
        }
        [
            driver.where_vehicle_exists(nearest),
            driver.where_vehicle_exists(in_own_lane),
        ]
    }

    /// The nearest oncoming vehicle of a driver in any lane, without the vehicle in `excluded_slot`.
    #[inline(always)]
    fn nearest_except(
        driver: VehicleHandle<'_, S, N>,
        excluded_slot: F32<S>,
    ) -> NearestOncoming<S> {
        let (state, params) = (driver.state, driver.params);
        let bodies = core::array::from_fn(|j| {
            if j < params.num_slots_in_use {
                VisibleBody::new(state.vehicle(params, j))
            } else {
                VisibleBody::no_vehicle(params.simd)
            }
        });
        let mut search = Self::no_vehicles(params.simd);
        search.update(state, params, &bodies);
        for j in 0..params.num_slots_in_use {
            search.as_seen_by_oncoming[j].on_road &= excluded_slot.simd_ne(j as i32 as f32);
        }
        let [nearest, _] = search.nearest_oncoming(driver, &bodies);
        nearest
    }

    /// Whether another vehicle passes the driver on the left, near enough for the driver to notice.
    ///
    /// The gap to the vehicle, which may be behind or ahead, is less than `passed_awareness_margin`.
    #[inline(always)]
    fn is_being_passed(&self, driver: VehicleHandle<'_, S, N>) -> Mask<S> {
        let (state, params, slot) = (driver.state, driver.params, driver.slot);
        let vehicle = driver.vehicle();
        let mut is_being_passed = self.overtakes[slot] & !self.overtakes[slot]; // False in every SIMD lane.
        for j in (0..params.num_slots_in_use).filter(|j| self.overtaking_slots >> *j & 1 == 1) {
            let overtaker = &params.vehicles[j];
            let gap = (state.motion.s[slot] - state.motion.s[j]).abs()
                - (vehicle.half_length + overtaker.half_length);
            let overtakes_here =
                vehicle.travel_sign.simd_eq(overtaker.travel_sign) & self.overtakes[j];
            let is_near = gap.simd_lt(params.constants.passed_awareness_margin) & overtakes_here;
            is_being_passed |=
                is_near & state.lane_choice.lane[j].simd_gt(state.lane_choice.lane[slot]);
        }
        is_being_passed & state.motion.is_wreck[slot].simd_eq(0.0)
    }
}
