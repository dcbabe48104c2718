//! The state of a block between two steps; see `overtaking.sim.reference.state`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::vectors::{LANES, M, Seats, V, choose, min, splat};
pub use crate::names::neighbour_role::{
    FOLLOWER, LEADER, LEFT_FOLLOWER, LEFT_LEADER, RIGHT_FOLLOWER, RIGHT_LEADER,
};
pub use crate::names::stage;
use crate::params::Params;

/// Decisions whose kinematics are remembered.
pub const HISTORY_LENGTH: usize = 64;
/// Room for them: one line of the cache more, so that the same decision of sixteen simulations does not fall
/// into the same few sets of the cache.
pub const HISTORY_STRIDE: usize = HISTORY_LENGTH + 8;
/// Number of roles.
pub const NUM_ROLES: usize = 6;
/// Slot number of nobody.
pub const NO_SLOT: f32 = -1.0;
/// In `State::seen_id` before the first decision: nothing was looked at yet.
pub const NEVER_LOOKED: f32 = -2.0;
/// Before the first decision no lane change holds anyone back [s].
const LONG_AGO: f32 = 10.0;
/// On friction nothing depends yet.
const ANY_FRICTION: f32 = 0.8;
const ANY_SPEED: f32 = 1e9;
const ANY_SIGHT: f32 = 1e9;
/// In `State::most_accel` where no lower limit comes [m/s^2].
pub const NO_ACCEL_LIMIT: f32 = 1e9;

/// Slot of the ego.
pub const EGO_SLOT: usize = 0;

/// A number of every vehicle of every simulation of a block.
pub type PerVehicle<S, const N: usize> = [V<S>; N];

/// Memory for the history; what is in it before it is written means nothing.
pub struct History<const N: usize>(pub Box<HistoryRows<N>>);

/// Position and speed along the road by vehicle, simulation and decision: what a driver recalls next lies beside
/// what it recalls now.
pub type HistoryRows<const N: usize> = [[[[f32; 2]; HISTORY_STRIDE]; LANES]; N];

impl<const N: usize> Default for History<N> {
    fn default() -> Self {
        Self(Box::new([[[[0.0; 2]; HISTORY_STRIDE]; LANES]; N]))
    }
}

/// A struct whose fields, listed once, can all be seated.
macro_rules! state_fields {
    ($($(#[$doc:meta])* $field:ident: $kind:ty,)*) => {
        /// Everything that changes.
        pub struct State<'a, S: Simd, const N: usize> {
            $($(#[$doc])* pub $field: $kind,)*
            /// Where everybody was, and how fast.
            pub history: &'a mut HistoryRows<N>,
        }

        impl<S: Simd, const N: usize> Seats for State<'_, S, N> {
            fn seat(&mut self, lane: usize, from: &Self, other: usize) {
                $(self.$field.seat(lane, &from.$field, other);)*
                for (mine, theirs) in self.history.iter_mut().zip(from.history.iter()) {
                    mine[lane] = theirs[other];
                }
            }
        }
    };
}

state_fields! {
    s: PerVehicle<S, N>,
    d: PerVehicle<S, N>,
    psi: PerVehicle<S, N>,
    vx: PerVehicle<S, N>,
    vy: PerVehicle<S, N>,
    r: PerVehicle<S, N>,
    wheel: PerVehicle<S, N>,
    trim: PerVehicle<S, N>,
    accel: PerVehicle<S, N>,
    a_lon: PerVehicle<S, N>,
    a_lat: PerVehicle<S, N>,
    yaw_accel: PerVehicle<S, N>,
    crashed: PerVehicle<S, N>,
    path: [[V<S>; 6]; N],
    path_time: PerVehicle<S, N>,
    path_duration: PerVehicle<S, N>,
    lane: PerVehicle<S, N>,
    since_change: PerVehicle<S, N>,
    indicator: PerVehicle<S, N>,
    wanted: PerVehicle<S, N>,
    wanted_time: PerVehicle<S, N>,
    checks: PerVehicle<S, N>,
    gust: PerVehicle<S, N>,
    distance_error: PerVehicle<S, N>,
    speed_error: PerVehicle<S, N>,
    wander: PerVehicle<S, N>,
    mu_fast: PerVehicle<S, N>,
    mu_slow: PerVehicle<S, N>,
    wind_force: PerVehicle<S, N>,
    wind_moment: PerVehicle<S, N>,
    tail_wind: PerVehicle<S, N>,
    seen_id: [[V<S>; NUM_ROLES]; N],
    seen_time: [[V<S>; NUM_ROLES]; N],
    contact_partner: PerVehicle<S, N>,
    contact_time: PerVehicle<S, N>,
    contact_impulse: PerVehicle<S, N>,
    contact_speed: PerVehicle<S, N>,
    stage: PerVehicle<S, N>,
    target: PerVehicle<S, N>,
    waited: PerVehicle<S, N>,
    signalled: PerVehicle<S, N>,
    stage_time: PerVehicle<S, N>,
    attempted: V<S>,
    end_step: V<S>,
    num_percepts: V<S>,
    oncoming_id: [[V<S>; 2]; N],
    oncoming_time: [[V<S>; 2]; N],
    aside: PerVehicle<S, N>,
    flashes: PerVehicle<S, N>,
    yields: PerVehicle<S, N>,
    hurries: PerVehicle<S, N>,
    curve: PerVehicle<S, N>,
    curve_ahead: PerVehicle<S, N>,
    stretch: PerVehicle<S, N>,
    slope: PerVehicle<S, N>,
    bend_speed: PerVehicle<S, N>,
    /// What limits allow, and what drivers want by them, alone and while they pass; on roads that vary.
    allowed_speed: PerVehicle<S, N>,
    wanted_speed: PerVehicle<S, N>,
    wanted_pass_speed: PerVehicle<S, N>,
    most_accel: PerVehicle<S, N>,
    shown: PerVehicle<S, N>,
    /// Sine and cosine of `psi`.
    sine: PerVehicle<S, N>,
    cosine: PerVehicle<S, N>,
    /// How far the front wheels turn from the slip angle at most: on this friction, until the next decision.
    reach: PerVehicle<S, N>,
}

/// A place in the frame of the other direction, where the mask holds.
#[inline(always)]
pub fn in_opposite_frame<S: Simd, const N: usize>(
    params: &Params<'_, S, N>,
    turned: M<S>,
    s: V<S>,
    d: V<S>,
) -> (V<S>, V<S>) {
    let ways = &params.road.directions;
    (
        choose(turned, ways.length - s, s),
        choose(turned, ways.edge_sum - d, d),
    )
}

impl<'a, S: Simd, const N: usize> State<'a, S, N> {
    /// The state at the first frame.
    #[inline(always)]
    pub fn at_start(params: &Params<'_, S, N>, history: &'a mut HistoryRows<N>) -> Self {
        let zero = splat(params.simd, 0.0);
        let each = |value: f32| [splat(params.simd, value); N];
        let mut path = [[zero; 6]; N];
        for (row, p) in path.iter_mut().zip(&params.vehicles) {
            row[0] = p.start_d;
        }
        Self {
            s: params.vehicles.map(|p| p.start_s),
            d: params.vehicles.map(|p| p.start_d),
            psi: each(0.0),
            vx: params.vehicles.map(|p| p.start_speed),
            vy: each(0.0),
            r: each(0.0),
            wheel: each(0.0),
            trim: each(0.0),
            accel: each(0.0),
            a_lon: each(0.0),
            a_lat: each(0.0),
            yaw_accel: each(0.0),
            crashed: each(0.0),
            path,
            path_time: each(1.0),
            path_duration: each(1.0),
            lane: params.vehicles.map(|p| p.start_lane),
            since_change: each(LONG_AGO),
            indicator: each(0.0),
            wanted: each(0.0),
            wanted_time: each(0.0),
            checks: each(0.0),
            gust: each(0.0),
            distance_error: each(0.0),
            speed_error: each(0.0),
            wander: each(0.0),
            mu_fast: each(ANY_FRICTION),
            mu_slow: each(ANY_FRICTION),
            wind_force: each(0.0),
            wind_moment: each(0.0),
            tail_wind: each(0.0),
            seen_id: [[splat(params.simd, -2.0); NUM_ROLES]; N],
            seen_time: [[zero; NUM_ROLES]; N],
            contact_partner: each(NO_SLOT),
            contact_time: each(0.0),
            contact_impulse: each(0.0),
            contact_speed: each(0.0),
            stage: each(stage::FOLLOW),
            target: each(NO_SLOT),
            waited: each(0.0),
            signalled: each(0.0),
            stage_time: each(0.0),
            attempted: zero,
            end_step: params.simulations.last_step,
            num_percepts: zero,
            oncoming_id: [[splat(params.simd, NEVER_LOOKED); 2]; N],
            oncoming_time: [[zero; 2]; N],
            aside: each(0.0),
            flashes: each(0.0),
            yields: each(0.0),
            hurries: each(0.0),
            curve: each(0.0),
            curve_ahead: each(0.0),
            stretch: each(1.0),
            slope: each(0.0),
            bend_speed: each(ANY_SPEED),
            allowed_speed: each(ANY_SPEED),
            wanted_speed: each(ANY_SPEED),
            wanted_pass_speed: each(ANY_SPEED),
            most_accel: each(NO_ACCEL_LIMIT),
            shown: each(ANY_SIGHT),
            sine: each(0.0),
            cosine: each(1.0),
            reach: each(0.0),
            history,
        }
    }

    /// Move a vehicle of one simulation, as if it had always been there and as fast; everybody remembers it so.
    pub fn displace_vehicle(&mut self, slot: usize, lane: usize, ahead: f32, faster: f32) {
        if ahead == 0.0 && faster == 0.0 {
            return;
        }
        self.s[slot][lane] += ahead;
        self.vx[slot][lane] += faster;
        for moment in &mut self.history[slot][lane] {
            moment[0] += ahead;
            moment[1] += faster;
        }
    }

    /// Where vehicle `j` is in the frame of vehicle `i`: that of oncoming vehicles is turned by half a turn.
    ///
    /// `TWO_WAY` is for loops over pairs, which roads of one direction go through without a question for each.
    #[inline(always)]
    pub fn position_of<const TWO_WAY: bool>(
        &self,
        params: &Params<'_, S, N>,
        i: usize,
        j: usize,
    ) -> (V<S>, V<S>) {
        let (s, d) = (self.s[j], self.d[j]);
        if !TWO_WAY {
            return (s, d);
        }
        let turned = params.vehicles[j]
            .travel_sign
            .simd_ne(params.vehicles[i].travel_sign);
        in_opposite_frame(params, turned, s, d)
    }

    /// Where vehicle `i` is in the frame of the road.
    #[inline(always)]
    pub fn road_position(&self, params: &Params<'_, S, N>, i: usize) -> (V<S>, V<S>) {
        let (s, d) = (self.s[i], self.d[i]);
        if !params.road.directions.has_oncoming_traffic {
            return (s, d);
        }
        in_opposite_frame(params, params.vehicles[i].travel_sign.simd_lt(0.0), s, d)
    }

    /// Speed that driver `i` wants where it is.
    #[inline(always)]
    pub fn desired_speed(&self, params: &Params<'_, S, N>, i: usize) -> V<S> {
        if params.road.varies_along_road() {
            self.wanted_speed[i]
        } else {
            params.vehicles[i].desired_speed
        }
    }

    /// The same while it passes.
    #[inline(always)]
    pub fn passing_speed(&self, params: &Params<'_, S, N>, i: usize) -> V<S> {
        if params.road.varies_along_road() {
            self.wanted_pass_speed[i]
        } else {
            params.vehicles[i].passing_speed
        }
    }

    /// The limit that driver `i` heeds where it is.
    #[inline(always)]
    pub fn speed_limit(&self, params: &Params<'_, S, N>, i: usize) -> V<S> {
        if params.road.varies_along_road() {
            self.allowed_speed[i]
        } else {
            params.vehicles[i].speed_limit
        }
    }

    /// An acceleration of driver `i` in whatever lane, and no more than it goes to on the way to a lower limit.
    #[inline(always)]
    pub fn limit_accel(&self, params: &Params<'_, S, N>, i: usize, accel: V<S>) -> V<S> {
        if params.road.varies_along_road() {
            min(accel, self.most_accel[i])
        } else {
            accel
        }
    }

    /// Velocity of vehicle `i` along and across the road [m/s].
    #[inline(always)]
    pub fn road_velocity(&self, i: usize) -> (V<S>, V<S>) {
        let (sine, cosine) = (self.sine[i], self.cosine[i]);
        (
            self.vx[i] * cosine - self.vy[i] * sine,
            self.vx[i] * sine + self.vy[i] * cosine,
        )
    }
}
