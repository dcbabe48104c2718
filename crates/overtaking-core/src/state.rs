//! The state of a block between two steps; see `overtaking.sim.reference.state`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::lanes::{LANES, M, Seats, V, choose, min, splat};
use crate::world::World;

/// Decisions whose kinematics are remembered.
pub const HISTORY: usize = 64;
/// Room for them: one line of the cache more, so that the same decision of sixteen simulations does not fall
/// into the same few sets of the cache.
pub const ROOM: usize = HISTORY + 8;
/// Neighbours of a vehicle by lane and direction.
pub const LEAD: usize = 0;
/// Behind in the own lane.
pub const REAR: usize = 1;
/// Ahead in the next lane to the fast side.
pub const FAST_LEAD: usize = 2;
/// Behind in the next lane to the fast side.
pub const FAST_REAR: usize = 3;
/// Ahead in the next lane to the slow side.
pub const SLOW_LEAD: usize = 4;
/// Behind in the next lane to the slow side.
pub const SLOW_REAR: usize = 5;
/// Number of roles.
pub const ROLES: usize = 6;
/// Slot number of nobody.
pub const NOBODY: f32 = -1.0;
/// In `State::seen_id` before the first decision: nothing was looked at yet.
pub const UNKNOWN: f32 = -2.0;
/// Before the first decision no lane change holds anyone back [s].
const LONG_AGO: f32 = 10.0;
/// On friction nothing depends yet.
const ANY_FRICTION: f32 = 0.8;
const ANY_SPEED: f32 = 1e9;
const ANY_SIGHT: f32 = 1e9;
/// In `State::most_accel` where no lower limit comes [m/s^2].
pub const ANY_ACCEL: f32 = 1e9;

/// Slot of the ego.
pub const EGO: usize = 0;

/// A number of every vehicle of every simulation of a block.
pub type Each<S, const N: usize> = [V<S>; N];

/// Stages of an overtake, as `overtaking.model.trajectories.Stage`.
pub mod stage {
    pub const FOLLOW: f32 = 0.0;
    pub const PULL_OUT: f32 = 1.0;
    pub const PASS: f32 = 2.0;
    pub const RETURN: f32 = 3.0;
    pub const DONE: f32 = 4.0;
    pub const ABORT: f32 = 5.0;
    pub const CRASHED: f32 = 6.0;
}

/// Memory for the history; what is in it before it is written means nothing.
pub struct History<const N: usize>(pub Box<Moments<N>>);

/// Position and speed along the road by vehicle, simulation and decision: what a driver recalls next lies beside
/// what it recalls now.
pub type Moments<const N: usize> = [[[[f32; 2]; ROOM]; LANES]; N];

impl<const N: usize> Default for History<N> {
    fn default() -> Self {
        Self(Box::new([[[[0.0; 2]; ROOM]; LANES]; N]))
    }
}

/// A struct whose fields, listed once, can all be seated.
macro_rules! state_fields {
    ($($(#[$doc:meta])* $field:ident: $kind:ty,)*) => {
        /// Everything that changes.
        pub struct State<'a, S: Simd, const N: usize> {
            $($(#[$doc])* pub $field: $kind,)*
            /// Where everybody was, and how fast.
            pub history: &'a mut Moments<N>,
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
    s: Each<S, N>,
    d: Each<S, N>,
    psi: Each<S, N>,
    vx: Each<S, N>,
    vy: Each<S, N>,
    r: Each<S, N>,
    wheel: Each<S, N>,
    trim: Each<S, N>,
    accel: Each<S, N>,
    a_lon: Each<S, N>,
    a_lat: Each<S, N>,
    yaw_accel: Each<S, N>,
    crashed: Each<S, N>,
    path: [[V<S>; 6]; N],
    path_time: Each<S, N>,
    path_duration: Each<S, N>,
    lane: Each<S, N>,
    since_change: Each<S, N>,
    indicator: Each<S, N>,
    wanted: Each<S, N>,
    wanted_time: Each<S, N>,
    checks: Each<S, N>,
    gust: Each<S, N>,
    distance_error: Each<S, N>,
    speed_error: Each<S, N>,
    wander: Each<S, N>,
    mu_fast: Each<S, N>,
    mu_slow: Each<S, N>,
    wind_force: Each<S, N>,
    wind_moment: Each<S, N>,
    tail_wind: Each<S, N>,
    seen_id: [[V<S>; ROLES]; N],
    seen_time: [[V<S>; ROLES]; N],
    contact_partner: Each<S, N>,
    contact_time: Each<S, N>,
    contact_impulse: Each<S, N>,
    contact_speed: Each<S, N>,
    stage: Each<S, N>,
    target: Each<S, N>,
    waited: Each<S, N>,
    signalled: Each<S, N>,
    stage_time: Each<S, N>,
    attempted: V<S>,
    end_step: V<S>,
    num_percepts: V<S>,
    oncoming_id: [[V<S>; 2]; N],
    oncoming_time: [[V<S>; 2]; N],
    aside: Each<S, N>,
    flashes: Each<S, N>,
    yields: Each<S, N>,
    hurries: Each<S, N>,
    curve: Each<S, N>,
    curve_ahead: Each<S, N>,
    stretch: Each<S, N>,
    slope: Each<S, N>,
    bend_speed: Each<S, N>,
    /// What limits allow, and what drivers want by them, alone and while they pass; on roads that vary.
    allowed_speed: Each<S, N>,
    wanted_speed: Each<S, N>,
    wanted_pass_speed: Each<S, N>,
    most_accel: Each<S, N>,
    shown: Each<S, N>,
    /// Sine and cosine of `psi`.
    sine: Each<S, N>,
    cosine: Each<S, N>,
    /// How far the front wheels turn from the slip angle at most: on this friction, until the next decision.
    reach: Each<S, N>,
}

/// A place in the frame of the other direction, where the mask holds.
#[inline(always)]
pub fn turned_round<S: Simd, const N: usize>(
    w: &World<'_, S, N>,
    turned: M<S>,
    s: V<S>,
    d: V<S>,
) -> (V<S>, V<S>) {
    let ways = &w.road.ways;
    (
        choose(turned, ways.length - s, s),
        choose(turned, ways.edge_sum - d, d),
    )
}

impl<'a, S: Simd, const N: usize> State<'a, S, N> {
    /// The state at the first frame.
    #[inline(always)]
    pub fn new(w: &World<'_, S, N>, history: &'a mut Moments<N>) -> Self {
        let zero = splat(w.simd, 0.0);
        let each = |value: f32| [splat(w.simd, value); N];
        let mut path = [[zero; 6]; N];
        for (row, p) in path.iter_mut().zip(&w.p) {
            row[0] = p.start_d;
        }
        Self {
            s: w.p.map(|p| p.start_s),
            d: w.p.map(|p| p.start_d),
            psi: each(0.0),
            vx: w.p.map(|p| p.start_speed),
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
            lane: w.p.map(|p| p.start_lane),
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
            seen_id: [[splat(w.simd, -2.0); ROLES]; N],
            seen_time: [[zero; ROLES]; N],
            contact_partner: each(NOBODY),
            contact_time: each(0.0),
            contact_impulse: each(0.0),
            contact_speed: each(0.0),
            stage: each(stage::FOLLOW),
            target: each(NOBODY),
            waited: each(0.0),
            signalled: each(0.0),
            stage_time: each(0.0),
            attempted: zero,
            end_step: w.q.last_step,
            num_percepts: zero,
            oncoming_id: [[splat(w.simd, UNKNOWN); 2]; N],
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
            most_accel: each(ANY_ACCEL),
            shown: each(ANY_SIGHT),
            sine: each(0.0),
            cosine: each(1.0),
            reach: each(0.0),
            history,
        }
    }

    /// Move a vehicle of one simulation, as if it had always been there and as fast; everybody remembers it so.
    pub fn displace(&mut self, slot: usize, lane: usize, ahead: f32, faster: f32) {
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
    pub fn seen_from<const TWO_WAY: bool>(
        &self,
        w: &World<'_, S, N>,
        i: usize,
        j: usize,
    ) -> (V<S>, V<S>) {
        let (s, d) = (self.s[j], self.d[j]);
        if !TWO_WAY {
            return (s, d);
        }
        let turned = w.p[j].travel_sign.simd_ne(w.p[i].travel_sign);
        turned_round(w, turned, s, d)
    }

    /// Where vehicle `i` is in the frame of the road.
    #[inline(always)]
    pub fn on_the_road(&self, w: &World<'_, S, N>, i: usize) -> (V<S>, V<S>) {
        let (s, d) = (self.s[i], self.d[i]);
        if !w.road.ways.has_oncoming_traffic {
            return (s, d);
        }
        turned_round(w, w.p[i].travel_sign.simd_lt(0.0), s, d)
    }

    /// Speed that driver `i` wants where it is.
    #[inline(always)]
    pub fn desired_speed(&self, w: &World<'_, S, N>, i: usize) -> V<S> {
        if w.road.varies_along_road() {
            self.wanted_speed[i]
        } else {
            w.p[i].desired_speed
        }
    }

    /// The same while it passes.
    #[inline(always)]
    pub fn pass_speed(&self, w: &World<'_, S, N>, i: usize) -> V<S> {
        if w.road.varies_along_road() {
            self.wanted_pass_speed[i]
        } else {
            w.p[i].passing_speed
        }
    }

    /// The limit that driver `i` heeds where it is.
    #[inline(always)]
    pub fn limit(&self, w: &World<'_, S, N>, i: usize) -> V<S> {
        if w.road.varies_along_road() {
            self.allowed_speed[i]
        } else {
            w.p[i].speed_limit
        }
    }

    /// An acceleration of driver `i` in whatever lane, and no more than it goes to on the way to a lower limit.
    #[inline(always)]
    pub fn eased(&self, w: &World<'_, S, N>, i: usize, accel: V<S>) -> V<S> {
        if w.road.varies_along_road() {
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
