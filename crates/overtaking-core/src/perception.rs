//! Beliefs of drivers about their neighbours: detection, gap, closing speed and braking. The twin of
//! `overtaking.sim.reference.perception`, which names the sources.
//!
//! A *role* is one of six places around a driver: the leaders and followers in its own, the left and the right lane.
//! Left is the overtaking side, and lateral distances are positive to the left. A driver *watches* a role at every
//! decision, 20 a second, or *glances* at it when it checks its mirrors. A vehicle *looms* to a driver while its image
//! visibly grows. A reaction delay is a number of decisions.
//!
//! Values of type `F32<S>` and `Mask<S>` have one element for each simulation of a block of sixteen, which are computed
//! together; such an element is a SIMD lane. `VehicleHandle` is a view of one driver in them. `N` is the number of
//! slots, the vehicles that a simulation can have. `at_slot!` and `each_at_slot!` read values of the vehicle whose slot
//! they get, or of slot 0 without a vehicle.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16};

use crate::car_following::Leader;
use crate::decision_context::DriverContext;
use crate::math::elementary::exp;
use crate::math::philox::{GLANCES, uniform, words};
use crate::math::vectors::{
    F32, Mask, SIMD_LANES, assign_where, at_least, at_most, at_slot, clamp_to, each_at_slot, floor,
    max, min, select, splat,
};
use crate::neighbour_search::{Neighbours, VisibleBody, nearest_image};
use crate::params::Params;
use crate::road_conditions::{lane_film, value_of_lane};
use crate::state::{
    HISTORY_LENGTH, HISTORY_STRIDE, LEADER, LEFT_LEADER, NEVER_LOOKED, NUM_ROLES, State,
    is_leader_role,
};
use crate::vehicle_handle::VehicleHandle;

/// A closer vehicle is as visible as at this gap, and looms as much [m].
const NEAREST_GAP: f32 = 1.0;
/// Larger than every range of sight; keeps squares finite [m].
const FARTHEST_GAP: f32 = 1e4;
/// Largest optical depth, through which drivers see no vehicle; the limit bounds the exponent [1].
const MAX_OPTICAL_DEPTH: f32 = 40.0;
/// Smallest logarithm of a contrast over its threshold: the outline of a near vehicle shows even against the sun [1].
const MIN_LOG_CONTRAST: f32 = 0.02;
/// Keeps a quotient finite if the threshold of looming is 0 [rad/s].
const MIN_LOOMING: f32 = 1e-9;
/// Smallest length of a line of sight, which keeps it finite alongside [m].
pub const MIN_SIGHT_LINE: f32 = 0.1;

/// Beliefs of one driver about its neighbours, by role.
#[derive(Clone, Copy)]
pub struct Beliefs<S: Simd> {
    /// Whether the driver has detected the neighbour.
    pub is_detected: [Mask<S>; NUM_ROLES],
    /// Believed gap, `unseen_gap` without a detected neighbour [m].
    pub gap: [F32<S>; NUM_ROLES],
    /// Believed speed at which the gap shrinks, 0 without a detected neighbour [m/s].
    pub closing_speed: [F32<S>; NUM_ROLES],
    /// Believed acceleration of a neighbour ahead, never positive; 0 for one behind [m/s^2].
    pub accel: [F32<S>; NUM_ROLES],
}

impl<S: Simd> Beliefs<S> {
    /// A value before the first decision; `form_beliefs` overwrites it.
    #[inline(always)]
    pub fn without_neighbours(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        Self {
            is_detected: [zero.simd_lt(zero); NUM_ROLES],
            gap: [zero; NUM_ROLES],
            closing_speed: [zero; NUM_ROLES],
            accel: [zero; NUM_ROLES],
        }
    }

    /// The leader in a role, as the driver believes.
    #[inline(always)]
    pub fn leader(&self, role: usize) -> Leader<S> {
        Leader {
            gap: self.gap[role],
            closing_speed: self.closing_speed[role],
            accel: self.accel[role],
        }
    }

    /// The leader in a role, as the driver believes, but with an acceleration of 0.
    #[inline(always)]
    pub fn steady_leader(&self, role: usize) -> Leader<S> {
        Leader::steady(self.gap[role], self.closing_speed[role])
    }
}

/// Extinction coefficients [1/m].
#[derive(Clone, Copy)]
pub struct Extinction<S: Simd> {
    /// Extinction by fog and rain around the driver.
    pub air: F32<S>,
    /// Extinction by the spray behind its leader.
    pub spray: F32<S>,
}

/// How well a vehicle can be seen.
pub struct Conspicuity<S: Simd> {
    /// Logarithm of its contrast.
    pub log_contrast: F32<S>,
    /// Reciprocal of the luminous intensity of its lamps towards the driver [1/cd].
    pub inverse_lamp_intensity: F32<S>,
}

/// How an approach looms to a driver.
pub struct Looming<S: Simd> {
    /// Whether the image of the vehicle grows fast enough for the driver to notice.
    pub exceeds_threshold: Mask<S>,
    /// Share of the closing speed that the driver notices, 0 to 1.
    pub noticed_share: F32<S>,
    /// Share of the driver's errors that is left; it falls to 0 before a contact [1].
    pub error_share: F32<S>,
    /// Closing speed with the driver's error [m/s].
    pub closing_speed: F32<S>,
}

/// Past motion of a vehicle, extrapolated to this decision.
pub struct RecalledMotion<S: Simd> {
    /// Station now, if the speed has stayed the same [m].
    pub s: F32<S>,
    /// Speed along the road [m/s].
    pub speed: F32<S>,
    /// Index of the decision at which the driver saw the vehicle.
    pub observed_at: F32<S>,
}

/// Store the motion of all vehicles, which drivers recall after their reaction delay.
#[inline(always)]
pub fn record_history<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    decision_index: u32,
) {
    let row = decision_index as usize % HISTORY_LENGTH;
    for slot in 0..params.num_slots_in_use {
        // Velocity along and across the road.
        let (along, _) = state.vehicle(params, slot).road_velocity();
        // Pairs of station and speed: of the first eight simulations in `low`, of the others in `high`.
        let (low, high) = state.motion.s[slot].interleave(along);
        let (low, high) = (low.to_array(), high.to_array());
        let pairs = low.as_chunks::<2>().0.iter().chain(high.as_chunks().0);
        for (decisions, pair) in state.attention.history[slot].iter_mut().zip(pairs) {
            decisions[row] = *pair;
        }
    }
}

/// Draw whether the driver in `slot` looks over the shoulder before its next lane change, in the simulations of
/// `is_drawn`. `checks_blind_spot` of its vehicle is the probability that it looks.
#[inline(always)]
pub fn draw_shoulder_check<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    is_drawn: Mask<S>,
    decision_index: u32,
) {
    let [word, ..] = words(
        params.key,
        &params.scenario_index_low,
        &params.scenario_index_high,
        GLANCES + slot as u32,
        decision_index,
    );
    let share = params.vehicles[slot].checks_blind_spot;
    let checks = select(
        uniform(params.simd, word).simd_lt(share),
        splat(params.simd, 1.0),
        splat(params.simd, 0.0),
    );
    let checks_blind_spot = &mut state.lane_choice.checks_blind_spot[slot];
    *checks_blind_spot = select(is_drawn, checks, *checks_blind_spot);
}

/// The leader of a driver, which may block the driver's view because it is a tall vehicle.
struct TallLeader<S: Simd> {
    /// Whether the driver has a leader and cannot see over it.
    blocks_view: Mask<S>,
    /// Half the width of the leader [m].
    half_width: F32<S>,
}

impl<S: Simd> TallLeader<S> {
    /// The leader of a driver with these neighbours.
    #[inline(always)]
    fn new<const N: usize>(params: &Params<S, N>, neighbours: &Neighbours<S>) -> Self {
        let leader_slot = neighbours.slot[LEADER];
        let [blocks_view, half_width] = each_at_slot!(params, leader_slot, |j| [
            params.vehicles[j].blocks_view,
            params.vehicles[j].half_width
        ]);
        Self {
            blocks_view: leader_slot.simd_ge(0.0) & blocks_view.simd_gt(0.0),
            half_width,
        }
    }
}

/// Whether a tall leader stands between the driver and the neighbour ahead in `role`.
#[inline(always)]
fn is_occluded<S: Simd>(
    neighbours: &Neighbours<S>,
    leader: &TallLeader<S>,
    role: usize,
) -> Mask<S> {
    let distance_to_rear = at_least(
        neighbours.distance[LEADER] - neighbours.half_length[LEADER],
        MIN_SIGHT_LINE,
    );
    let distance = neighbours.distance[role];
    // Lateral position, seen from the driver, at which the line of sight passes the leader's rear.
    let crossing =
        neighbours.lateral_distance[role] * (distance_to_rear / at_least(distance, MIN_SIGHT_LINE));
    let offset = (crossing - neighbours.lateral_distance[LEADER]).abs();
    let is_behind_body = distance.simd_gt(distance_to_rear) & offset.simd_lt(leader.half_width);
    // A leader on the line between two lanes has two roles, but does not hide itself.
    let is_other = neighbours.slot[role].simd_ne(neighbours.slot[LEADER]);
    leader.blocks_view & is_behind_body & is_other
}

/// Distance of a vehicle over the range at which it can be seen; up to 1 it can be seen [1].
///
/// The ratio is the smaller of two. By contrast it is the distance over the range of sight. By lamps it is the root of
/// the eye's threshold over the illuminance; in clear air this root is a distance over a range, too.
#[inline(always)]
pub fn sight_range_ratio<S: Simd, const N: usize>(
    params: &Params<S, N>,
    gap: F32<S>,
    is_ahead: bool,
    conspicuity: &Conspicuity<S>,
    extinction: Extinction<S>,
) -> F32<S> {
    let (constants, simulation) = (&params.constants, &params.simulations);
    let distance = clamp_to(gap, NEAREST_GAP, FARTHEST_GAP);
    let mut depth = extinction.air * distance;
    let mut sensitivity = simulation.log_contrast_sensitivity_behind;
    if is_ahead {
        depth += extinction.spray * at_most(distance, constants.spray_reach);
        sensitivity = simulation.log_contrast_sensitivity_ahead;
    }
    // The optical depth at which the vehicle vanishes: the logarithm of its contrast over the eye's threshold.
    let depth_of_sight = at_least(conspicuity.log_contrast + sensitivity, MIN_LOG_CONTRAST);
    // At night the contrast counts within the reach of the driver's low beam only.
    let ratio_by_contrast = max(
        depth / depth_of_sight,
        distance * simulation.inverse_lit_range,
    );
    let ratio_by_lamp = (distance
        * distance
        * (simulation.lamp_threshold * conspicuity.inverse_lamp_intensity)
        * exp(at_most(depth, MAX_OPTICAL_DEPTH)))
    .sqrt();
    min(ratio_by_contrast, ratio_by_lamp)
}

/// Time in view until a driver detects a vehicle [s].
///
/// At the limit of sight, where the ratio is 1, it is longer by the factor 1 + `detection_growth`. The third power is a
/// choice.
#[inline(always)]
pub fn detection_time<S: Simd, const N: usize>(params: &Params<S, N>, ratio: F32<S>) -> F32<S> {
    params.simulations.detection_time
        * (1.0 + params.constants.detection_growth * (ratio * ratio * ratio))
}

/// One driver's look at its neighbour in one role.
struct Gaze<'a, S: Simd> {
    role: usize,
    neighbours: &'a Neighbours<S>,
    /// The leader, if it may hide the neighbour; `None` if the role is the leader's.
    tall_leader: Option<&'a TallLeader<S>>,
    /// Distance of the neighbour over the range at which it can be seen [1].
    sight_range_ratio: F32<S>,
    /// Whether the driver watches this role at every decision.
    watches_role: Mask<S>,
    /// Whether the driver looks at this role now.
    looks_at_role: Mask<S>,
    /// Slot of the vehicle in each role at the last look.
    known_slots: &'a [F32<S>; NUM_ROLES],
    /// Time for which that vehicle had been in view [s].
    known_times: &'a [F32<S>; NUM_ROLES],
}

/// Update the time in view of the neighbour in the role of `gaze`.
///
/// Returns whether the driver in `slot` looks at the neighbour now and has had it in view for the detection time, which
/// grows towards the limit of sight.
#[inline(always)]
fn detect<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    gaze: &Gaze<'_, S>,
) -> Mask<S> {
    let (constants, role) = (&params.constants, gaze.role);
    let neighbour_slot = gaze.neighbours.slot[role];
    let is_visible = is_visible(state.vehicle(params, slot), gaze);
    // A glance adds half a second, so a driver needs several glances for a vehicle that is hard to see. A watched
    // vehicle gains the 50 ms of each decision.
    let added_time = select(
        gaze.watches_role,
        splat(params.simd, constants.decision),
        splat(params.simd, constants.glance_time),
    );
    // The vehicle may have been in another role before: passing it, or changing lanes, does not restart its detection.
    let zero = splat(params.simd, 0.0);
    let mut time_so_far = zero;
    for (known_slot, known_time) in gaze.known_slots.iter().zip(gaze.known_times) {
        let is_known = neighbour_slot.simd_eq(*known_slot);
        time_so_far = select(is_known, max(time_so_far, *known_time), time_so_far);
    }
    // Drivers have watched the traffic before the first frame.
    let is_first_look = gaze.known_slots[role].simd_eq(NEVER_LOOKED);
    let time_in_view = select(
        is_first_look,
        splat(params.simd, constants.initial_time_in_view),
        time_so_far + added_time,
    );
    let time_in_view = select(is_visible, time_in_view, zero);
    let attention = &mut state.attention;
    assign_where(
        &mut attention.time_in_view[slot][role],
        gaze.looks_at_role,
        time_in_view,
    );
    assign_where(
        &mut attention.slot_in_view[slot][role],
        gaze.looks_at_role,
        neighbour_slot,
    );
    let needed_time = detection_time(params, gaze.sight_range_ratio);
    gaze.looks_at_role & is_visible & attention.time_in_view[slot][role].simd_ge(needed_time)
}

/// Whether the driver can see the neighbour in the role of `gaze`: in range, not occluded, not in a blind spot.
#[inline(always)]
fn is_visible<S: Simd, const N: usize>(
    driver: VehicleHandle<'_, S, N>,
    gaze: &Gaze<'_, S>,
) -> Mask<S> {
    let (params, role, neighbours) = (driver.params, gaze.role, gaze.neighbours);
    let (constants, vehicle) = (&params.constants, driver.vehicle());
    let (neighbour_slot, gap) = (neighbours.slot[role], neighbours.gap[role]);
    let is_ahead = is_leader_role(role);
    let range = if is_ahead {
        vehicle.attention_range
    } else {
        splat(params.simd, constants.mirror_range)
    };
    let mut is_visible =
        neighbour_slot.simd_ge(0.0) & gaze.sight_range_ratio.simd_le(1.0) & gap.simd_lt(range);
    if let Some(leader) = gaze
        .tall_leader
        .filter(|leader| is_ahead && leader.blocks_view.any_true())
    {
        is_visible &= !is_occluded(neighbours, leader, role);
    }
    // The blind spot reaches from the driver's rear bumper backwards; a leader is in it only alongside, where the gap
    // is negative. A look over the shoulder shows what is in it, and from the corner of the eye the driver sees a
    // vehicle at a lateral gap up to `alongside`.
    let may_be_hidden = gap.simd_lt(if is_ahead { 0.0 } else { constants.blind_spot })
        & driver.state.lane_choice.checks_blind_spot[driver.slot].simd_eq(0.0);
    if may_be_hidden.any_true() {
        let half_width = at_slot!(params, neighbour_slot, |j| params.vehicles[j].half_width);
        let lateral_gap =
            neighbours.lateral_distance[role].abs() - (vehicle.half_width + half_width);
        is_visible &= !(may_be_hidden & lateral_gap.simd_gt(constants.alongside));
    }
    is_visible
}

/// A vector with the numbers of its SIMD lanes, 0 to 15.
#[inline(always)]
fn lane_numbers<S: Simd>(simd: S) -> F32<S> {
    let numbers: [f32; SIMD_LANES] = [
        0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0,
    ];
    F32::simd_from(simd, numbers)
}

/// Station [m] and speed along the road [m/s] of the vehicles in `slot` at past decisions.
///
/// Slot and decision may differ between the simulations of the block. The index into the history is computed in
/// float32, which is exact for whole numbers of this size.
#[inline(always)]
fn recall_motion<S: Simd, const N: usize>(
    state: &State<S, N>,
    simd: S,
    decision_index: F32<S>,
    slot: F32<S>,
) -> (F32<S>, F32<S>) {
    // Each slot has one ring of `HISTORY_LENGTH` rows for each SIMD lane. A ring begins `HISTORY_STRIDE` rows after the
    // one before.
    let periods = floor(decision_index * (1.0 / HISTORY_LENGTH as f32));
    let row = decision_index - HISTORY_LENGTH as f32 * periods;
    // `NO_SLOT` reads the history of slot 0; callers ignore the result.
    let slot_and_lane = at_least(slot, 0.0) * SIMD_LANES as f32 + lane_numbers(simd);
    let index: i32x16<S> = (row + slot_and_lane * HISTORY_STRIDE as f32).to_int();
    let index = index.to_array();
    let history = state.attention.history.as_flattened().as_flattened();
    let (mut low, mut high) = ([0.0; SIMD_LANES], [0.0; SIMD_LANES]);
    for (lane, pair) in low
        .as_chunks_mut::<2>()
        .0
        .iter_mut()
        .chain(high.as_chunks_mut::<2>().0)
        .enumerate()
    {
        // No index exceeds the limit; with it the compiler drops the check of the bounds.
        let last = (N * SIMD_LANES * HISTORY_STRIDE - 1) as u32;
        *pair = history[(index[lane] as u32).min(last) as usize];
    }
    // From pairs of station and speed to a vector of stations and one of speeds.
    F32::simd_from(simd, low).deinterleave(F32::simd_from(simd, high))
}

/// Motion of vehicles as drivers saw it a reaction delay ago, extrapolated at constant speed.
///
/// `slot` has the slots of the vehicles, and `delay` the reaction delay as a number of decisions.
#[inline(always)]
pub fn extrapolate_motion<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    slot: F32<S>,
    delay: F32<S>,
    decision_index: u32,
) -> RecalledMotion<S> {
    let now = splat(params.simd, decision_index as f32);
    let observed_at = at_least(now - delay, 0.0);
    let (s, speed) = recall_motion(state, params.simd, observed_at, slot);
    let elapsed = (now - observed_at) * params.constants.decision;
    RecalledMotion {
        s: s + speed * elapsed,
        speed,
        observed_at,
    }
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Whether the driver checks mirrors and adjacent lanes now.
    ///
    /// Drivers look once in each interval, once more when they have indicated for long enough, before they move over,
    /// and more often in the first part of a lane change. The caller adds the looks in the opposing lane.
    #[inline(always)]
    pub fn checks_mirrors_now(self, decision_index: u32) -> Mask<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, vehicle) = (&params.constants, self.vehicle());
        let interval = constants.glance_interval as u32;
        // The drivers of a simulation look one after the other: the stagger of 7 and the interval of 20 decisions have
        // no common factor. A slot looks at the same decisions in all sixteen simulations of a block, which saves time
        // at decisions without a look; with looks at random times one of the sixteen would look at more than half of
        // the decisions. Without looks in the first interval, no driver indicates or changes lanes in it.
        let staggered_index = decision_index + slot as u32 * constants.glance_stagger as u32;
        if decision_index >= interval && staggered_index.is_multiple_of(interval) {
            return vehicle.valid.simd_eq(vehicle.valid); // True in every SIMD lane.
        }
        // Drivers that overtake by gap acceptance count `time_indicating`, those that change lanes by MOBIL
        // `time_wanted`. Each model starts its lane changes by this comparison, > or >=.
        let has_indicated = if params.road.can_overtake(slot) {
            state.overtake.time_indicating[slot].simd_gt(vehicle.indicator_lead_time)
        } else {
            state.lane_choice.time_wanted[slot].simd_ge(vehicle.indicator_lead_time)
        };
        let moves_over_soon = state.lane_choice.wanted_side[slot].simd_ne(0.0) & has_indicated;
        if !decision_index.is_multiple_of(constants.glance_moving as u32) {
            return moves_over_soon;
        }
        // As long as a driver may still cancel its lane change.
        let (elapsed, duration) = (state.path.elapsed[slot], state.path.duration[slot]);
        moves_over_soon | elapsed.simd_lt(constants.abort_until * duration)
    }

    /// Extinction around the driver and in the spray ahead of it.
    #[inline(always)]
    pub fn extinction_ahead(
        self,
        neighbours: &Neighbours<S>,
        leader_speed: F32<S>,
    ) -> Extinction<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, simulation) = (&params.constants, &params.simulations);
        // A moving driver meets more rain drops.
        let air = simulation.fog_extinction
            + simulation.rain_extinction * (1.0 + state.motion.vx[slot] / constants.rain_speed);
        let path_factor = value_of_lane(
            &params.road.film_path[..params.road.num_lanes],
            state.lane_choice.lane[slot],
        );
        // Depth of the water on the driver's lane.
        let film = lane_film(params, path_factor);
        let zero = splat(params.simd, 0.0);
        if film.simd_le(0.0).all_true() {
            return Extinction { air, spray: zero };
        }
        // Spray grows with the film of water, up to a limit, and with the square of the leader's speed.
        let speed_ratio = leader_speed / constants.spray_speed;
        let wetness = at_most(film / constants.spray_film, 1.0);
        let leader_slot = neighbours.slot[LEADER];
        let leader_spray = at_slot!(params, leader_slot, |j| params.vehicles[j].spray);
        let spray =
            constants.spray_coefficient * wetness * (speed_ratio * speed_ratio) * leader_spray;
        let is_in_spray =
            leader_slot.simd_ge(0.0) & neighbours.gap[LEADER].simd_lt(constants.spray_reach);
        Extinction {
            air,
            spray: select(is_in_spray, spray, zero),
        }
    }

    /// Looming of an approaching vehicle: the growth of its image, and what the driver notices of it.
    ///
    /// `gap` [m] is the gap to the vehicle, `closing_speed` [m/s] is positive while it shrinks, and `width` [m] is the
    /// width of the vehicle, at night the distance between its lamps.
    #[inline(always)]
    pub fn sense_looming(self, gap: F32<S>, closing_speed: F32<S>, width: F32<S>) -> Looming<S> {
        let (constants, simulation) = (&self.params.constants, &self.params.simulations);
        let distance = at_least(gap, NEAREST_GAP);
        // Rate of change of the visual angle w / s of a width w at a distance s.
        let expansion_rate = width * closing_speed.abs() / (distance * distance);
        let excess = expansion_rate - constants.looming_threshold;
        // From the threshold to this much above it, drivers notice a growing share of the approach. If they noticed all
        // at once, they would brake hard at the threshold, release below it, and brake again.
        let span = (constants.looming_growth * constants.looming_threshold).max(MIN_LOOMING);
        // Nearer than this, errors fade: there the time to contact is below `error_fade_time`.
        let fading_distance = at_least(closing_speed * constants.error_fade_time, NEAREST_GAP);
        let error_share = at_most(distance / fading_distance, 1.0);
        // The coefficient of variation times a random process of unit variance.
        let speed_error = simulation.speed_error * self.state.noise.speed_error[self.slot];
        Looming {
            exceeds_threshold: excess.simd_gt(0.0),
            noticed_share: clamp_to(excess / span, 0.0, 1.0),
            error_share,
            closing_speed: closing_speed * (1.0 + error_share * speed_error),
        }
    }
}

/// Update the beliefs of the driver in `slot` about its six neighbours, in `context.beliefs`.
///
/// `inverse_rear_lamp` of `bodies` is one over the intensity of the brighter rear lamp that is on, tail or stop lamp
/// [1/cd].
///
/// Drivers watch the leader, and while they change lanes also the vehicles ahead on either side. They glance at the
/// other neighbours when they check mirrors and adjacent lanes, and ignore them between two glances.
///
/// Drivers extrapolate the motion that they saw a reaction delay ago. They misjudge distance and closing speed by
/// slowly varying factors. They believe in a closing speed of 0 below the threshold of looming, and in a growing share
/// of the true one above it. The errors fade as contact comes near, because the growth of the image shows the time to
/// contact.
#[inline(always)]
pub fn form_beliefs<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    bodies: &[VisibleBody<S>; N],
    context: &mut DriverContext<S>,
) {
    let (neighbours, beliefs) = (&context.neighbours, &mut context.beliefs);
    let checks_mirrors = context.checks_mirrors;
    let (constants, simulation, vehicle) = (
        &params.constants,
        &params.simulations,
        &params.vehicles[slot],
    );
    let zero = splat(params.simd, 0.0);
    let unseen_gap = splat(params.simd, constants.unseen_gap);
    let leader_speed = at_slot!(params, neighbours.slot[LEADER], |j| state.motion.vx[j]);
    let driver = state.vehicle(params, slot);
    let extinction = driver.extinction_ahead(neighbours, leader_speed);
    let always = vehicle.valid.simd_eq(vehicle.valid); // True in every SIMD lane.
    let is_changing_lane = driver.is_changing_lane();
    // Beliefs about a role are not computed if the driver looks at it in no simulation of the block.
    let is_needed = |role: usize| {
        role == LEADER
            || checks_mirrors.any_true()
            || (is_leader_role(role) && is_changing_lane.any_true())
    };
    // Drivers react faster if contact with the leader is near, but not to the other roles, which they do not always
    // watch. By the true motion now, because what the driver believes depends on the delay that this selects.
    let is_imminent = neighbours.gap[LEADER]
        .simd_lt(constants.urgent_time * (state.motion.vx[slot] - leader_speed));
    let (own_speed, _) = driver.road_velocity(); // Along and across the road.
    let distance_factor = exp(simulation.distance_error * state.noise.distance_error[slot]);
    *beliefs = Beliefs::without_neighbours(params.simd);
    // Only leaders in other lanes can be hidden. Both are needed at the same decisions, so `LEFT_LEADER` serves.
    let tall_leader = is_needed(LEFT_LEADER).then(|| TallLeader::new(params, neighbours));
    let known_slots = state.attention.slot_in_view[slot];
    let known_times = state.attention.time_in_view[slot];
    // A separate loop, so that the CPU works on the exponentials and roots of several roles at once.
    let mut sight_range_ratios = [zero; NUM_ROLES];
    for role in (0..NUM_ROLES).filter(|role| is_needed(*role)) {
        let (neighbour_slot, is_ahead) = (neighbours.slot[role], is_leader_role(role));
        // The driver sees the rear lamps of vehicles ahead and the headlamps of vehicles behind.
        let [log_contrast, inverse_lamp_intensity] = if is_ahead {
            each_at_slot!(params, neighbour_slot, |j| [
                params.vehicles[j].log_contrast,
                bodies[j].inverse_rear_lamp
            ])
        } else {
            each_at_slot!(params, neighbour_slot, |j| [
                params.vehicles[j].log_contrast,
                params.vehicles[j].inverse_head_lamp
            ])
        };
        let conspicuity = Conspicuity {
            log_contrast,
            inverse_lamp_intensity,
        };
        let gap = neighbours.gap[role];
        sight_range_ratios[role] =
            sight_range_ratio(params, gap, is_ahead, &conspicuity, extinction);
    }
    for role in 0..NUM_ROLES {
        let (neighbour_slot, is_ahead) = (neighbours.slot[role], is_leader_role(role));
        beliefs.gap[role] = unseen_gap;
        if !is_needed(role) {
            continue;
        }
        let watches_role = match role {
            LEADER => always,
            _ if is_ahead => is_changing_lane,
            _ => !always,
        };
        let looks_at_role = checks_mirrors | watches_role;
        // Without a neighbour in any simulation of the block, only the attention changes.
        if neighbour_slot.simd_lt(0.0).all_true() {
            let attention = &mut state.attention;
            assign_where(
                &mut attention.slot_in_view[slot][role],
                looks_at_role,
                neighbour_slot,
            );
            assign_where(&mut attention.time_in_view[slot][role], looks_at_role, zero);
            continue;
        }
        // A function of its own, compiled for the SIMD features of the CPU.
        let is_detected = params.simd.vectorize(
            #[inline(always)]
            || {
                let gaze = Gaze {
                    role,
                    neighbours,
                    tall_leader: tall_leader.as_ref().filter(|_| role != LEADER),
                    sight_range_ratio: sight_range_ratios[role],
                    watches_role,
                    looks_at_role,
                    known_slots: &known_slots,
                    known_times: &known_times,
                };
                detect(state, params, slot, &gaze)
            },
        );
        let delay = match role {
            LEADER => select(
                is_imminent,
                vehicle.urgent_reaction_delay,
                vehicle.reaction_delay,
            ),
            _ => vehicle.reaction_delay,
        };
        let recalled =
            extrapolate_motion(state, params, neighbour_slot, delay, context.decision_index);
        let (distance, closing_speed) = if is_ahead {
            (
                recalled.s - state.motion.s[slot],
                own_speed - recalled.speed,
            )
        } else {
            (
                state.motion.s[slot] - recalled.s,
                recalled.speed - own_speed,
            )
        };
        let half_lengths = neighbours.half_length[role] + vehicle.half_length;
        // On a ring road `nearest_image` takes the shorter way round.
        let gap = nearest_image(params, distance) - half_lengths;
        let looming_width = at_slot!(params, neighbour_slot, |j| params.vehicles[j].looming_width);
        let looming = state
            .vehicle(params, slot)
            .sense_looming(gap, closing_speed, looming_width);
        if is_ahead {
            let accel = believed_braking(state, params, neighbour_slot, &recalled, &looming);
            beliefs.accel[role] = select(is_detected, accel, zero);
        }
        let relative_gap_error = (distance_factor - 1.0) * looming.error_share;
        let noticed_closing_speed = looming.noticed_share * looming.closing_speed;
        beliefs.is_detected[role] = is_detected;
        beliefs.gap[role] = select(is_detected, gap + gap * relative_gap_error, unseen_gap);
        beliefs.closing_speed[role] = select(is_detected, noticed_closing_speed, zero);
    }
}

/// Believed acceleration of vehicles ahead a reaction delay ago, never positive [m/s^2].
///
/// The mean over `brake_memory` decisions. While stop lamps show that a vehicle brakes, but no looming shows how hard,
/// drivers assume at least the deceleration `lamp_decel`.
#[inline(always)]
fn believed_braking<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    slot: F32<S>,
    recalled: &RecalledMotion<S>,
    looming: &Looming<S>,
) -> F32<S> {
    let constants = &params.constants;
    let earlier = at_least(recalled.observed_at - constants.brake_memory, 0.0);
    let (_, earlier_speed) = recall_motion(state, params.simd, earlier, slot);
    let accel = at_most(
        (recalled.speed - earlier_speed) / (constants.brake_memory * constants.decision),
        0.0,
    );
    // The history holds motion only, so lamps count as lit beyond the deceleration that lights them.
    let sees_lamps_only = accel.simd_lt(-constants.stop_lamp_decel) & !looming.exceeds_threshold;
    select(
        sees_lamps_only,
        at_most(accel, -constants.lamp_decel),
        accel,
    )
}
