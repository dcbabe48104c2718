//! Who comes the other way, and what drivers believe of it; see `overtaking.sim.reference.oncoming`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::decision_context::DriverContext;
use crate::math::elementary::exp;
use crate::math::vectors::{
    F32, Mask, at_least, at_most, at_slot, each_at_slot, min, select, splat,
};
use crate::neighbour_search::{Neighbours, VisibleBody, lane_borders};
use crate::params::{MAX_STATIONS, Params, station_indices};
use crate::perception::{MIN_SIGHT_LINE, recall_motion, sight_range_ratio};
use crate::state::{LEADER, NEVER_LOOKED, NO_SLOT, State};
use crate::vehicle_handle::VehicleHandle;

const FAR: f32 = 1e9;
/// Keeps the time until vehicles meet finite [m/s].
const MIN_SPEED: f32 = 0.1;

/// Where drivers look for oncoming vehicles, in `Attention::oncoming_slot`: in any lane, and in their own.
const IN_ANY_LANE: usize = 0;
const IN_OWN_LANE: usize = 1;

/// The nearest vehicle of the other direction ahead, and what the driver believes of it.
#[derive(Clone, Copy)]
pub struct OncomingVehicle<S: Simd> {
    pub slot: F32<S>,
    pub gap: F32<S>,
    pub is_detected: Mask<S>,
    /// Whether the driver has looked for long enough to know who comes, if anybody.
    pub is_certain: Mask<S>,
    pub believed_gap: F32<S>,
    pub closing_speed: F32<S>,
    /// How far the driver sees the other lane, and what comes there [m].
    pub sight_distance: F32<S>,
}

/// Whom a driver meets on a two-way road.
#[derive(Clone, Copy)]
pub struct OncomingTraffic<S: Simd> {
    /// Who comes in any lane: that is who limits a pass.
    pub nearest: OncomingVehicle<S>,
    /// Whether somebody is seen to come in the driver's lane.
    pub meets_in_own_lane: Mask<S>,
    /// When that one is believed to be met [s].
    pub time_to_meeting: F32<S>,
    /// Whether somebody is passing the driver, as far as that is noticed.
    pub is_being_passed: Mask<S>,
    /// Whether the leader signals that it will pull out itself.
    pub leader_pulls_out: Mask<S>,
}

impl<S: Simd> OncomingVehicle<S> {
    /// An empty road.
    pub fn none(simd: S) -> Self {
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
    /// An empty road.
    pub fn none(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        let never = zero.simd_lt(zero);
        Self {
            nearest: OncomingVehicle::none(simd),
            meets_in_own_lane: never,
            time_to_meeting: zero,
            is_being_passed: never,
            leader_pulls_out: never,
        }
    }
}

/// Update what driver `slot` believes about oncoming vehicles, and for how long it has seen them.
///
/// Without `needs_beliefs`, the beliefs about the nearest vehicle in any lane and about the leader stay as they were,
/// because nothing is decided by them.
#[inline(always)]
pub fn observe_oncoming<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    (bodies, search): (&[VisibleBody<S>; N], &OncomingSearch<S, N>),
    needs_beliefs: bool,
    context: &mut DriverContext<S>,
) {
    let (near, decision) = (&context.neighbours, context.decision_index);
    let oncoming = &mut context.oncoming;
    let [nearest, in_own_lane] = search.nearest_oncoming(state, params, bodies, slot);
    let sight = state.vehicle(params, slot).sight_distance(near);
    let view = state.vehicle(params, slot).sighting(near, nearest, sight);
    let certain = is_certain(state, params, slot, IN_ANY_LANE, nearest.0, &view);
    if needs_beliefs {
        oncoming.nearest = state
            .vehicle(params, slot)
            .believe(nearest.0, sight, &view, certain, decision);
        let leader = near.slot[LEADER];
        let side = at_slot!(params.num_slots_in_use, leader, |j| state
            .controls
            .indicator[j]);
        oncoming.leader_pulls_out = leader.simd_ge(0.0) & side.simd_gt(0.0);
    }
    if in_own_lane.0.simd_ge(0.0).any_true() {
        let range = state.road.sight_distance[slot];
        let view = state
            .vehicle(params, slot)
            .sighting(near, in_own_lane, range);
        let certain = is_certain(state, params, slot, IN_OWN_LANE, in_own_lane.0, &view);
        let other_slot = in_own_lane.0;
        let believed = state
            .vehicle(params, slot)
            .believe(other_slot, range, &view, certain, decision);
        oncoming.meets_in_own_lane = believed.is_detected;
        oncoming.time_to_meeting =
            believed.believed_gap / at_least(believed.closing_speed, MIN_SPEED);
    } else {
        update_time_in_view(state, params, slot, IN_OWN_LANE, in_own_lane.0);
        oncoming.meets_in_own_lane = certain & !certain;
    }
    oncoming.is_being_passed = search.is_being_passed(state, params, slot);
}

/// Whether driver `slot` has looked for long enough to know who comes in some lanes; advances the time in view.
#[inline(always)]
fn is_certain<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    lanes: usize,
    other_slot: F32<S>,
    view: &Sighting<S>,
) -> Mask<S> {
    let (constants, simulation, effort) = (
        &params.constants,
        &params.simulations,
        view.sight_range_ratio,
    );
    let needed =
        simulation.detection_time * (1.0 + constants.detection_growth * (effort * effort * effort));
    let needed = select(view.is_visible, needed, simulation.detection_time);
    let seen = select(view.is_visible, other_slot, splat(params.simd, NO_SLOT));
    update_time_in_view(state, params, slot, lanes, seen);
    state.attention.oncoming_time_in_view[slot][lanes].simd_ge(needed)
}

/// Count for how long driver `slot` has seen whom it sees now in some lanes.
#[inline(always)]
fn update_time_in_view<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    lanes: usize,
    seen: F32<S>,
) {
    let before = state.attention.oncoming_slot[slot][lanes];
    let time = state.attention.oncoming_time_in_view[slot][lanes] + params.constants.decision;
    let longer = select(seen.simd_eq(before), time, splat(params.simd, 0.0));
    let first = before.simd_eq(NEVER_LOOKED);
    state.attention.oncoming_time_in_view[slot][lanes] = select(
        first,
        splat(params.simd, params.constants.initial_time_in_view),
        longer,
    );
    state.attention.oncoming_slot[slot][lanes] = seen;
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Second oncoming vehicle of the ego, and what the driver of the model would believe about it.
    ///
    /// That driver decides by the nearest one alone; only external drivers observe the second. It is detected together with
    /// the nearest one, wherever it is visible.
    #[inline(always)]
    pub fn observe_second_oncoming(self, context: &DriverContext<S>) -> OncomingVehicle<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let first = &context.oncoming.nearest;
        let sight = first.sight_distance;
        let met = OncomingSearch::nearest_except(state, params, slot, first.slot);
        let view = self.sighting(&context.neighbours, met, sight);
        self.believe(
            met.0,
            sight,
            &view,
            first.is_detected,
            context.decision_index,
        )
    }
}

/// Whether an oncomer can be seen.
struct Sighting<S: Simd> {
    /// Half of the lengths of both [m].
    reach: F32<S>,
    gap: F32<S>,
    sight_range_ratio: F32<S>,
    is_visible: Mask<S>,
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// What there is to see of an oncomer, as far as a range.
    #[inline(always)]
    fn sighting(
        self,
        near: &Neighbours<S>,
        (other_slot, distance): (F32<S>, F32<S>),
        range: F32<S>,
    ) -> Sighting<S> {
        let (state, params) = (self.state, self.params);
        let [half, contrast, lamp] = each_at_slot!(params.num_slots_in_use, other_slot, |j| [
            params.vehicles[j].half_length,
            params.vehicles[j].log_contrast,
            params.vehicles[j].inverse_head_lamp
        ]);
        let reach = half + self.vehicle().half_length;
        let gap = distance - reach;
        let leader_speed = at_slot!(params.num_slots_in_use, near.slot[LEADER], |j| state
            .motion
            .vx[j]);
        let depths = self.extinction_ahead(near, leader_speed);
        let effort = sight_range_ratio(params, gap, true, [contrast, lamp], depths);
        let range = at_most(range, params.constants.oncoming_range);
        Sighting {
            reach,
            gap,
            sight_range_ratio: effort,
            is_visible: other_slot.simd_ge(0.0) & effort.simd_le(1.0) & gap.simd_lt(range),
        }
    }

    /// Speed of approach that driver `i` expects of who comes.
    #[inline(always)]
    pub fn expected_closing_speed(self) -> F32<S> {
        let params = self.params;
        self.road_velocity().0 + params.simulations.expected_oncoming_speed
    }

    /// What driver `i` believes of an oncomer that it sees, and is `sure` of.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    fn believe(
        self,
        other_slot: F32<S>,
        sight: F32<S>,
        view: &Sighting<S>,
        sure: Mask<S>,
        decision: u32,
    ) -> OncomingVehicle<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, simulation, vehicle) =
            (&params.constants, &params.simulations, self.vehicle());
        let [width, two_wheeler, their_vx] =
            each_at_slot!(params.num_slots_in_use, other_slot, |j| [
                params.vehicles[j].looming_width,
                params.vehicles[j].two_wheeler,
                state.motion.vx[j]
            ]);
        let detected = view.is_visible & sure;
        let (own_speed, _) = self.road_velocity();
        let urgent = view
            .gap
            .simd_lt(constants.urgent_time * (own_speed + their_vx));
        let ticks = select(
            urgent,
            vehicle.urgent_reaction_delay,
            vehicle.reaction_delay,
        );
        let at = splat(params.simd, decision as f32);
        let then = at_least(at - ticks, 0.0);
        let (place, speed) = recall_motion(state, params.simd, then, other_slot);
        let place = place + speed * ((at - then) * constants.decision);
        let gap = (params.road.directions.length - place) - state.motion.s[slot] - view.reach;
        let closing = own_speed + speed;
        let (_, clear, share, sensed) = self.sense_looming(gap, closing, width);
        let small = select(
            two_wheeler.simd_gt(0.0),
            splat(params.simd, constants.two_wheeler_distance_factor),
            splat(params.simd, 1.0),
        );
        let judged = exp(simulation.oncoming_error * state.noise.distance_error[slot]) * small;
        let habit = self.expected_closing_speed();
        let range = splat(params.simd, constants.oncoming_range);
        OncomingVehicle {
            slot: other_slot,
            gap: view.gap,
            is_detected: detected,
            is_certain: sure,
            believed_gap: select(detected, gap + gap * ((judged - 1.0) * share), range),
            closing_speed: select(detected, habit + clear * (sensed - habit), habit),
            sight_distance: sight,
        }
    }

    /// How far driver `i` sees the other lane: by the road, the weather, and past a high leader.
    #[inline(always)]
    fn sight_distance(self, near: &Neighbours<S>) -> F32<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, road) = (&params.constants, &params.road);
        let (place, _) = self.road_position();
        let turned = self.vehicle().travel_sign.simd_lt(0.0);
        let [along, against] = &road.directions.sight;
        let mut by_road = splat(params.simd, 0.0);
        for (table, there) in [(along, !turned), (against, turned)] {
            if there.any_true() {
                by_road = select(there, interpolate_knots(table, place), by_road);
            }
        }
        let lead = near.slot[LEADER];
        let [half_width, tall] = each_at_slot!(params.num_slots_in_use, lead, |j| [
            params.vehicles[j].half_width,
            params.vehicles[j].blocks_view
        ]);
        let reach = at_least(
            near.distance[LEADER] - near.half_length[LEADER],
            MIN_SIGHT_LINE,
        );
        let edge = near.lateral_distance[LEADER] + half_width - constants.eye_offset;
        let middle = 0.5
            * (road.boundaries[road.num_lanes] + road.boundaries[road.directions.num_own_lanes]);
        let beside = middle - state.motion.d[slot] - constants.eye_offset;
        let hides = lead.simd_ge(0.0) & tall.simd_gt(0.0) & edge.simd_gt(0.0) & beside.simd_gt(0.0);
        let past = select(
            hides,
            beside * (reach / at_least(edge, MIN_SIGHT_LINE)),
            splat(params.simd, FAR),
        );
        let by_road = min(by_road, state.road.sight_distance[slot]);
        min(min(by_road, past), params.simulations.oncoming_sight)
    }
}

/// What a table of `Ways::sight` says of places [m].
#[inline(always)]
fn interpolate_knots<S: Simd>(
    [stations, values, slopes]: &[[f32; MAX_STATIONS]; 3],
    place: F32<S>,
) -> F32<S> {
    let mut found = splat(place.simd, 0.0);
    for k in station_indices(stations) {
        let here = values[k] + (place - stations[k]) * slopes[k];
        found = select(place.simd_ge(stations[k]), here, found);
    }
    found
}

/// Slot of an oncomer, and the distance of the centres [m].
type NearestOncoming<S> = (F32<S>, F32<S>);

/// A vehicle as who comes the other way sees it.
#[derive(Clone, Copy)]
struct OppositeView<S: Simd> {
    s: F32<S>,
    right_side: F32<S>,
    left_side: F32<S>,
    lane: F32<S>,
    /// Whether it is on the road, in any lane.
    on_road: Mask<S>,
}

impl<S: Simd> OppositeView<S> {
    /// Whether it is in a lane, or on a road, between edges.
    #[inline(always)]
    fn overlaps(&self, (low, high): (F32<S>, F32<S>)) -> Mask<S> {
        self.left_side.simd_gt(low) & self.right_side.simd_lt(high)
    }
}

/// What everybody on a two-way road looks for in everybody else; sets of slots have a bit for each.
#[derive(Clone, Copy)]
pub struct OncomingSearch<S: Simd, const N: usize> {
    as_seen_by_oncoming: [OppositeView<S>; N],
    /// Who drives along the road, and who against it, in any simulation.
    directions: [u32; 2],
    /// Who may be in the lane that those who come drive in, in any simulation.
    off_lane_slots: u32,
    /// Who overtakes, in which simulations and in any.
    pub overtakes: [Mask<S>; N],
    overtaking_slots: u32,
}

impl<S: Simd, const N: usize> OncomingSearch<S, N> {
    /// An empty road.
    pub fn none(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        let never = zero.simd_lt(zero);
        let turned = OppositeView {
            s: zero,
            right_side: zero,
            left_side: zero,
            lane: zero,
            on_road: never,
        };
        Self {
            as_seen_by_oncoming: [turned; N],
            directions: [0; 2],
            off_lane_slots: 0,
            overtakes: [never; N],
            overtaking_slots: 0,
        }
    }

    /// Look at everybody.
    #[inline(always)]
    pub fn update(
        &mut self,
        state: &State<S, N>,
        params: &Params<S, N>,
        bodies: &[VisibleBody<S>; N],
    ) {
        let (constants, road) = (&params.constants, &params.road);
        let low = splat(params.simd, road.boundaries[0] + constants.corridor_margin);
        let home = (
            low,
            splat(params.simd, road.boundaries[1] - constants.corridor_margin),
        );
        let edge = road.boundaries[road.num_lanes] - constants.corridor_margin;
        let whole = (low, splat(params.simd, edge));
        (self.directions, self.off_lane_slots, self.overtaking_slots) = ([0; 2], 0, 0);
        for j in 0..params.num_slots_in_use {
            let other = &params.vehicles[j];
            let valid = other.valid.simd_gt(0.0);
            let d = road.directions.edge_sum - state.motion.d[j];
            let turned = OppositeView {
                s: road.directions.length - state.motion.s[j],
                right_side: d - other.half_width,
                left_side: d + other.half_width,
                lane: (road.num_lanes - 1) as f32 - state.lane_choice.lane[j],
                on_road: valid,
            };
            let strays =
                turned.overlaps(home) | (bodies[j].visibly_changes_lane & turned.lane.simd_eq(0.0));
            let along = other.travel_sign.simd_gt(0.0);
            self.directions[0] |= u32::from((valid & along).any_true()) << j;
            self.directions[1] |= u32::from((valid & !along).any_true()) << j;
            self.off_lane_slots |= u32::from((valid & strays).any_true()) << j;
            self.overtakes[j] = state.vehicle(params, j).is_overtaking();
            self.overtaking_slots |= u32::from(self.overtakes[j].any_true()) << j;
            self.as_seen_by_oncoming[j] = OppositeView {
                on_road: valid & turned.overlaps(whole),
                ..turned
            };
        }
    }

    /// The nearest oncomer of vehicle `i` in any lane, and in its own. One that is visibly on its way into the own
    /// lane is there.
    #[inline(always)]
    pub fn nearest_oncoming(
        &self,
        state: &State<S, N>,
        params: &Params<S, N>,
        bodies: &[VisibleBody<S>; N],
        i: usize,
    ) -> [NearestOncoming<S>; 2] {
        let nobody = (splat(params.simd, NO_SLOT), splat(params.simd, FAR));
        let [mut coming, mut facing] = [nobody; 2];
        let [along, against] = self.directions;
        let mut opposed = 0;
        for (own, other) in [(along, against), (against, along)] {
            if own >> i & 1 == 1 {
                opposed |= other;
            }
        }
        for j in (0..params.num_slots_in_use).filter(|j| opposed >> *j & 1 == 1) {
            let other = &self.as_seen_by_oncoming[j];
            let ahead = other.s - state.motion.s[i];
            let there = params.vehicles[j]
                .travel_sign
                .simd_ne(params.vehicles[i].travel_sign)
                & ahead.simd_ge(0.0);
            let nearer = there & other.on_road & ahead.simd_lt(coming.1);
            coming.0 = select(nearer, splat(params.simd, j as i32 as f32), coming.0);
            coming.1 = select(nearer, ahead, coming.1);
        }
        // Who keeps to its lane meets those alone who have left theirs.
        let at_home = state.lane_choice.lane[i].simd_eq(0.0).all_true();
        let opposed = if at_home {
            opposed & self.off_lane_slots
        } else {
            opposed
        };
        if opposed == 0 {
            return [
                state.vehicle(params, i).where_vehicle_exists(coming),
                facing,
            ];
        }
        let (low, high) = lane_borders(params, state.lane_choice.lane[i], 0.0);
        let (low, high) = (
            low + params.constants.corridor_margin,
            high - params.constants.corridor_margin,
        );
        for j in (0..params.num_slots_in_use).filter(|j| opposed >> *j & 1 == 1) {
            let other = &self.as_seen_by_oncoming[j];
            let ahead = other.s - state.motion.s[i];
            let there = params.vehicles[j].valid.simd_gt(0.0)
                & params.vehicles[j]
                    .travel_sign
                    .simd_ne(params.vehicles[i].travel_sign)
                & ahead.simd_ge(0.0);
            let comes =
                bodies[j].visibly_changes_lane & other.lane.simd_eq(state.lane_choice.lane[i]);
            let nearer = there & (comes | other.overlaps((low, high))) & ahead.simd_lt(facing.1);
            facing.0 = select(nearer, splat(params.simd, j as i32 as f32), facing.0);
            facing.1 = select(nearer, ahead, facing.1);
        }
        [
            state.vehicle(params, i).where_vehicle_exists(coming),
            state.vehicle(params, i).where_vehicle_exists(facing),
        ]
    }

    /// The nearest oncomer of vehicle `i` in any lane, but for who is in a slot.
    #[inline(always)]
    pub fn nearest_except(
        state: &State<S, N>,
        params: &Params<S, N>,
        i: usize,
        slot: F32<S>,
    ) -> NearestOncoming<S> {
        let bodies = core::array::from_fn(|j| {
            if j < params.num_slots_in_use {
                VisibleBody::new(state, params, j)
            } else {
                VisibleBody::none(params.simd)
            }
        });
        let mut traffic = Self::none(params.simd);
        traffic.update(state, params, &bodies);
        for j in 0..params.num_slots_in_use {
            traffic.as_seen_by_oncoming[j].on_road &= slot.simd_ne(j as i32 as f32);
        }
        let [coming, _] = traffic.nearest_oncoming(state, params, &bodies, i);
        coming
    }

    /// Whether somebody is passing vehicle `i`, as its driver notices it.
    #[inline(always)]
    pub fn is_being_passed(&self, state: &State<S, N>, params: &Params<S, N>, i: usize) -> Mask<S> {
        let vehicle = &params.vehicles[i];
        let mut passed = self.overtakes[i] & !self.overtakes[i];
        for j in (0..params.num_slots_in_use).filter(|j| self.overtaking_slots >> *j & 1 == 1) {
            let other = &params.vehicles[j];
            let apart = (state.motion.s[i] - state.motion.s[j]).abs()
                - (vehicle.half_length + other.half_length);
            let same = vehicle.travel_sign.simd_eq(other.travel_sign) & self.overtakes[j];
            let beside = apart.simd_lt(params.constants.passed_awareness_margin) & same;
            passed |= beside & state.lane_choice.lane[j].simd_gt(state.lane_choice.lane[i]);
        }
        passed & state.motion.is_wreck[i].simd_eq(0.0)
    }
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Whom vehicle `i` meets, where there is a vehicle `i`.
    #[inline(always)]
    fn where_vehicle_exists(
        self,
        (other_slot, distance): NearestOncoming<S>,
    ) -> NearestOncoming<S> {
        let params = self.params;
        let valid = self.vehicle().valid.simd_gt(0.0);
        (
            select(valid, other_slot, splat(params.simd, NO_SLOT)),
            select(valid, distance, splat(params.simd, FAR)),
        )
    }
}
