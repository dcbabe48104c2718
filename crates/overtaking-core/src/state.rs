//! The state of a block between two steps; see `overtaking.sim.reference.state`.
//!
//! A block is a set of simulations that run side by side, one in each lane of a SIMD vector: an `F32` has one number
//! for each simulation. `N` is the number of vehicle slots. A step is 10 ms, a decision comes every 50 ms. Left is the
//! overtaking side, and angles, lateral positions and their derivatives are positive to the left.

use fearless_simd::Simd;

use crate::math::vectors::{CopyLane, F32, Mask, SIMD_LANES, select, splat};
pub use crate::names::neighbour_role::{
    FOLLOWER, LEADER, LEFT_FOLLOWER, LEFT_LEADER, RIGHT_FOLLOWER, RIGHT_LEADER,
};
pub use crate::names::stage;
use crate::params::Params;

/// Number of past decisions whose motion is remembered: enough for the longest reaction delay (58 decisions) and the
/// four decisions before it, by which drivers judge braking. A power of two, because `perception` computes the row of a
/// decision, its number modulo this length, by a float32 division and floor, which is exact only then.
pub const HISTORY_LENGTH: usize = 64;
/// Number of entries from the history of one simulation to the next in memory. It is one cache line, 8 entries, more
/// than the history needs, so that the same decision of sixteen simulations does not fall into the same few sets of the
/// cache.
pub const HISTORY_STRIDE: usize = HISTORY_LENGTH + 8;
/// Number of roles of neighbours.
pub const NUM_ROLES: usize = 6;

/// Whether the vehicle of a role is ahead of the driver. Each leader role has an even number, and the follower role of
/// the same lane the next one.
#[inline(always)]
pub const fn is_leader_role(role: usize) -> bool {
    role.is_multiple_of(2)
}

/// Slot of a neighbour, a target or a partner that does not exist.
pub const NO_SLOT: f32 = -1.0;
/// Value of `Attention::slot_in_view` and `Attention::oncoming_slot` before the first decision.
pub const NEVER_LOOKED: f32 = -2.0;
/// Speeds of `LocalRoad` at the first frame, before the road at the vehicle is read: no limit [m/s].
const ANY_SPEED: f32 = 1e9;
/// Sight distance of `LocalRoad` at the first frame: no limit [m].
const ANY_SIGHT: f32 = 1e9;
/// Distance [m] or time [s] to a vehicle that does not exist.
pub const FAR: f32 = 1e9;
/// An acceleration that limits nothing [m/s^2].
pub const NO_ACCEL_LIMIT: f32 = 1e9;

/// Slot of the ego.
pub const EGO_SLOT: usize = 0;

/// One number for each vehicle of each simulation of a block.
pub type PerVehicle<S, const N: usize> = [F32<S>; N];

/// Station [m] and speed along the road [m/s] at the last decisions, (vehicle, simulation, decision, 2).
///
/// Drivers recall successive decisions, so these are adjacent. A history is boxed, because a thread uses the memory of
/// an ended block for the next one. Each decision is written before it is read, so old numbers need not be cleared.
pub type History<const N: usize> = Box<[[[[f32; 2]; HISTORY_STRIDE]; SIMD_LANES]; N]>;

/// Allocate a history.
pub fn new_history<const N: usize>() -> History<N> {
    Box::new([[[[0.0; 2]; HISTORY_STRIDE]; SIMD_LANES]; N])
}

/// Declare a group of the state: a struct of arrays by vehicle, each with its value at the first frame.
///
/// The fields are listed once, so that none can be forgotten when a simulation moves to another SIMD lane.
macro_rules! state_group {
    ($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident = $start:expr,)* }) => {
        $(#[$doc])*
        pub struct $name<S: Simd, const N: usize> {
            $($(#[$field_doc])* pub $field: PerVehicle<S, N>,)*
        }

        impl<S: Simd, const N: usize> $name<S, N> {
            /// The group at the first frame.
            #[inline(always)]
            fn at_start(simd: S) -> Self {
                Self { $($field: [splat(simd, $start); N],)* }
            }
        }

        impl<S: Simd, const N: usize> CopyLane for $name<S, N> {
            fn copy_lane(&mut self, lane: usize, source: &Self, source_lane: usize) {
                $(self.$field.copy_lane(lane, &source.$field, source_lane);)*
            }
        }
    };
}

state_group! {
    /// Where vehicles are and how they move, each in its own direction of travel.
    Motion {
        /// Station of the body's centre [m].
        s = 0.0,
        /// Lateral position of the centre, growing to the left [m].
        d = 0.0,
        /// Angle to the road, positive to the left [rad].
        heading = 0.0,
        /// Velocity ahead, in the vehicle's axes [m/s].
        vx = 0.0,
        /// Velocity to the left, in the vehicle's axes [m/s].
        vy = 0.0,
        /// Yaw rate [rad/s]. A two-wheeler turns by its lean, and its value is the yaw rate in the middle of the last
        /// step.
        yaw_rate = 0.0,
        /// Mean acceleration ahead by tyre and wind forces, without contacts, over the last step, in the vehicle's axes
        /// [m/s^2].
        accel_lon = 0.0,
        /// The same to the left [m/s^2].
        accel_lat = 0.0,
        /// Mean yaw acceleration over the last step [rad/s^2].
        yaw_accel = 0.0,
        /// 1 if the vehicle has collided or has left the road, else 0.
        is_wreck = 0.0,
        /// Sine of `heading`.
        sin_heading = 0.0,
        /// Cosine of `heading`.
        cos_heading = 1.0,
    }
}

state_group! {
    /// Pedals, wheels and lamps that drivers operate.
    Controls {
        /// Acceleration that the driver requests by its pedals [m/s^2].
        requested_accel = 0.0,
        /// Front wheel angle [rad], or lateral acceleration of a two-wheeler [m/s^2].
        wheel_angle = 0.0,
        /// Part of the wheel angle that holds against the wind, in the same unit.
        wind_trim = 0.0,
        /// Indicator: 1 to the left, -1 to the right, 0 off.
        indicator = 0.0,
        /// 1 while the driver flashes at a vehicle in its lane, else 0.
        flashes_high_beam = 0.0,
        /// Largest slip angle of the front wheels that the driver requests on this friction [rad].
        slip_reach = 0.0,
    }
}

/// The lateral path of the last lane change, a polynomial of time.
pub struct LateralPath<S: Simd, const N: usize> {
    /// Lateral position as a polynomial of `elapsed`, by vehicle: entry k is the coefficient of its power k [m/s^k].
    pub coefficients: [[F32<S>; 6]; N],
    /// Time since the path began [s].
    pub elapsed: PerVehicle<S, N>,
    /// Time after which the lateral position stays [s].
    pub duration: PerVehicle<S, N>,
}

impl<S: Simd, const N: usize> CopyLane for LateralPath<S, N> {
    fn copy_lane(&mut self, lane: usize, source: &Self, source_lane: usize) {
        self.coefficients
            .copy_lane(lane, &source.coefficients, source_lane);
        self.elapsed.copy_lane(lane, &source.elapsed, source_lane);
        self.duration.copy_lane(lane, &source.duration, source_lane);
    }
}

state_group! {
    /// The lane of each vehicle, and the change that its driver wants.
    LaneChoice {
        /// Index of the lane that the vehicle drives in or changes to, counted from the right.
        lane = 0.0,
        /// Time since the last lane change began [s]. It starts at the longest pause after a lane change, `cooldown`,
        /// so that no driver waits for it.
        time_since_lane_change = 10.0,
        /// Side of the lane change that the driver wants, as `Controls::indicator`.
        wanted_side = 0.0,
        /// Time for which a MOBIL driver has wanted that lane change [s].
        time_wanted = 0.0,
        /// 1 if the driver looks over the shoulder before the next lane change.
        checks_blind_spot = 0.0,
        /// How far the driver keeps to the edge of its lane for another vehicle [m].
        edge_shift = 0.0,
    }
}

state_group! {
    /// Where drivers are in an overtake.
    OvertakeState {
        /// Code of the stage, a constant of `stage`.
        stage = stage::FOLLOW,
        /// Time in this stage [s].
        time_in_stage = 0.0,
        /// Slot of the target, the vehicle that is overtaken, or `NO_SLOT`.
        target_slot = NO_SLOT,
        /// Time spent behind a slower leader [s].
        time_waiting = 0.0,
        /// Time for which the driver has wanted its next manoeuvre, which it indicates if it uses its indicator [s].
        time_indicating = 0.0,
        /// 1 while the driver falls back behind its target, else 0.
        must_abort = 0.0,
        /// 1 while the driver must return urgently, else 0.
        must_return_urgently = 0.0,
    }
}

state_group! {
    /// Ornstein-Uhlenbeck processes of unit variance.
    RandomProcesses {
        /// Gusts of the wind.
        gust = 0.0,
        /// Error of the driver's judgement of distances.
        distance_error = 0.0,
        /// Error of the driver's judgement of speeds.
        speed_error = 0.0,
        /// Wander of the vehicle within its lane.
        lane_wander = 0.0,
    }
}

state_group! {
    /// Effects of the weather on a vehicle until the next decision; overwritten at the first one. A friction above
    /// zero keeps divisions finite until then.
    FrictionAndWind {
        /// Friction coefficient under the left wheels [1].
        mu_left = 0.8,
        /// Friction coefficient under the right wheels [1].
        mu_right = 0.8,
        /// Lateral force of the wind, positive to the left [N].
        wind_force = 0.0,
        /// Yaw moment of the wind, positive to the left [N m].
        wind_moment = 0.0,
        /// Wind along the vehicle's direction of travel [m/s].
        tail_wind = 0.0,
    }
}

state_group! {
    /// The road at each vehicle until the next decision.
    LocalRoad {
        /// Curvature of the vehicle's path along the road, positive to the left [1/m].
        curvature = 0.0,
        /// Curvature at the place that the vehicle reaches by the time it responds to its steering [1/m].
        curvature_ahead = 0.0,
        /// Stations passed for each metre driven along the road [1].
        station_per_metre = 1.0,
        /// Sine of the slope, positive uphill.
        sin_slope = 0.0,
        /// Largest speed that the driver chooses for the bends ahead [m/s].
        bend_speed = ANY_SPEED,
        /// Speed limit here [m/s]. This and the two speeds below are read only on roads that vary along their length;
        /// on other roads they are parameters of the vehicle.
        speed_limit = ANY_SPEED,
        /// Speed that the driver desires by this limit [m/s].
        desired_speed = ANY_SPEED,
        /// Speed that the driver desires by this limit while it overtakes [m/s].
        passing_speed = ANY_SPEED,
        /// Largest acceleration on the way to a lower speed limit [m/s^2].
        accel_limit = NO_ACCEL_LIMIT,
        /// How far bends and crests let the driver see [m].
        sight_distance = ANY_SIGHT,
    }
}

/// Attention and memory of drivers.
pub struct Attention<S: Simd, const N: usize> {
    /// Slot of the neighbour in each role at the last look; `NEVER_LOOKED` at first.
    pub slot_in_view: [[F32<S>; NUM_ROLES]; N],
    /// Time for which that neighbour has been in view [s].
    pub time_in_view: [[F32<S>; NUM_ROLES]; N],
    /// Slot of the oncoming vehicle in view, in any lane and in the driver's own lane; `NEVER_LOOKED` at first,
    /// `NO_SLOT` without a vehicle.
    pub oncoming_slot: [[F32<S>; 2]; N],
    /// Time for which `oncoming_slot` has been the same [s].
    pub oncoming_time_in_view: [[F32<S>; 2]; N],
    /// Station and speed along the road of all vehicles at the last decisions.
    pub history: History<N>,
}

impl<S: Simd, const N: usize> CopyLane for Attention<S, N> {
    fn copy_lane(&mut self, lane: usize, source: &Self, source_lane: usize) {
        self.slot_in_view
            .copy_lane(lane, &source.slot_in_view, source_lane);
        self.time_in_view
            .copy_lane(lane, &source.time_in_view, source_lane);
        self.oncoming_slot
            .copy_lane(lane, &source.oncoming_slot, source_lane);
        self.oncoming_time_in_view
            .copy_lane(lane, &source.oncoming_time_in_view, source_lane);
        for (target, from_source) in self.history.iter_mut().zip(source.history.iter()) {
            target[lane] = from_source[source_lane];
        }
    }
}

state_group! {
    /// The first contact of each vehicle.
    FirstContact {
        /// Slot of the vehicle that is touched, `NO_SLOT` before a contact.
        partner = NO_SLOT,
        /// Time of the contact [s].
        time = 0.0,
        /// Size of the impulse [N s].
        impulse = 0.0,
        /// Closing speed along the normal of the contact [m/s].
        closing_speed = 0.0,
    }
}

/// Everything that changes between two steps, in groups.
///
/// The groups that a step touches come first and next to each other.
pub struct State<S: Simd, const N: usize> {
    pub motion: Motion<S, N>,
    pub controls: Controls<S, N>,
    pub path: LateralPath<S, N>,
    pub road: LocalRoad<S, N>,
    pub friction_and_wind: FrictionAndWind<S, N>,
    pub noise: RandomProcesses<S, N>,
    pub lane_choice: LaneChoice<S, N>,
    pub overtake: OvertakeState<S, N>,
    pub attention: Attention<S, N>,
    pub first_contact: FirstContact<S, N>,
    /// 1 once the ego has begun an overtake, else 0.
    pub has_attempted: F32<S>,
    /// Last step of each simulation.
    pub end_step: F32<S>,
    /// Number of recorded percepts of each simulation; a percept is a record of the ego's beliefs at a manoeuvre.
    pub num_percepts: F32<S>,
}

impl<S: Simd, const N: usize> CopyLane for State<S, N> {
    fn copy_lane(&mut self, lane: usize, source: &Self, source_lane: usize) {
        self.motion.copy_lane(lane, &source.motion, source_lane);
        self.controls.copy_lane(lane, &source.controls, source_lane);
        self.path.copy_lane(lane, &source.path, source_lane);
        self.road.copy_lane(lane, &source.road, source_lane);
        self.friction_and_wind
            .copy_lane(lane, &source.friction_and_wind, source_lane);
        self.noise.copy_lane(lane, &source.noise, source_lane);
        self.lane_choice
            .copy_lane(lane, &source.lane_choice, source_lane);
        self.overtake.copy_lane(lane, &source.overtake, source_lane);
        self.attention
            .copy_lane(lane, &source.attention, source_lane);
        self.first_contact
            .copy_lane(lane, &source.first_contact, source_lane);
        self.has_attempted
            .copy_lane(lane, &source.has_attempted, source_lane);
        self.end_step.copy_lane(lane, &source.end_step, source_lane);
        self.num_percepts
            .copy_lane(lane, &source.num_percepts, source_lane);
    }
}

/// Station and lateral position in the coordinates of the other direction where `is_reversed`, else unchanged [m].
///
/// The coordinates of opposite directions differ by half a turn; `edge_sum` is the sum of the lateral positions of both
/// road edges.
#[inline(always)]
pub fn in_opposite_frame<S: Simd, const N: usize>(
    params: &Params<S, N>,
    is_reversed: Mask<S>,
    s: F32<S>,
    d: F32<S>,
) -> (F32<S>, F32<S>) {
    let directions = &params.road.directions;
    (
        select(is_reversed, directions.length - s, s),
        select(is_reversed, directions.edge_sum - d, d),
    )
}

impl<S: Simd, const N: usize> State<S, N> {
    /// The state at the first frame. `history` is only memory: its numbers are not read.
    #[inline(always)]
    pub fn at_start(params: &Params<S, N>, history: History<N>) -> Self {
        let simd = params.simd;
        let mut state = Self {
            motion: Motion::at_start(simd),
            controls: Controls::at_start(simd),
            path: LateralPath {
                // A path of one second that has ended: the vehicle keeps its lateral position.
                coefficients: [[splat(simd, 0.0); 6]; N],
                elapsed: [splat(simd, 1.0); N],
                duration: [splat(simd, 1.0); N],
            },
            road: LocalRoad::at_start(simd),
            friction_and_wind: FrictionAndWind::at_start(simd),
            noise: RandomProcesses::at_start(simd),
            lane_choice: LaneChoice::at_start(simd),
            overtake: OvertakeState::at_start(simd),
            attention: Attention {
                slot_in_view: [[splat(simd, NEVER_LOOKED); NUM_ROLES]; N],
                time_in_view: [[splat(simd, 0.0); NUM_ROLES]; N],
                oncoming_slot: [[splat(simd, NEVER_LOOKED); 2]; N],
                oncoming_time_in_view: [[splat(simd, 0.0); 2]; N],
                history,
            },
            first_contact: FirstContact::at_start(simd),
            has_attempted: splat(simd, 0.0),
            end_step: params.simulations.last_step,
            num_percepts: splat(simd, 0.0),
        };
        for (slot, vehicle) in params.vehicles.iter().enumerate() {
            state.motion.s[slot] = vehicle.start_s;
            state.motion.d[slot] = vehicle.start_d;
            state.motion.vx[slot] = vehicle.start_speed;
            state.lane_choice.lane[slot] = vehicle.start_lane;
            state.path.coefficients[slot][0] = vehicle.start_d;
        }
        state
    }

    /// Add `shift` [m] to the station of a vehicle in one SIMD lane, and `speed_change` [m/s] to its speed.
    ///
    /// The history changes by the same. Otherwise drivers would recall the vehicle at its old place and see it jump.
    pub fn displace_vehicle(&mut self, slot: usize, lane: usize, shift: f32, speed_change: f32) {
        if shift == 0.0 && speed_change == 0.0 {
            return;
        }
        self.motion.s[slot][lane] += shift;
        self.motion.vx[slot][lane] += speed_change;
        for [past_s, past_speed] in &mut self.attention.history[slot][lane] {
            *past_s += shift;
            *past_speed += speed_change;
        }
    }
}
