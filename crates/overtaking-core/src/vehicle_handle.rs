//! One vehicle slot of a block with state and parameters: the argument of functions that only read.
//!
//! A block is sixteen simulations in the lanes of vectors. A slot is the number of a vehicle in its simulation.
//! Stations and lateral positions of an oncoming vehicle count in its own direction of travel; `in_opposite_frame`
//! converts them.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::vectors::{F32, Mask, each_at_slot, min};
use crate::names::VehicleParams;
use crate::params::Params;
use crate::state::{State, in_opposite_frame, stage};

/// One vehicle slot in every simulation of a block, for reading.
///
/// In the modules of the step, functions that only read are methods of this handle. Functions that change the state
/// take `(state, params, slot)` and call these methods through `state.vehicle(params, slot)`. The methods take the
/// handle by value and are inlined, so the compiled code only passes its two pointers.
#[derive(Clone, Copy)]
pub struct VehicleHandle<'a, S: Simd, const N: usize> {
    pub state: &'a State<S, N>,
    pub params: &'a Params<S, N>,
    pub slot: usize,
}

impl<S: Simd, const N: usize> State<S, N> {
    /// The vehicle in a slot, for reading.
    #[inline(always)]
    pub fn vehicle<'a>(&'a self, params: &'a Params<S, N>, slot: usize) -> VehicleHandle<'a, S, N> {
        VehicleHandle {
            state: self,
            params,
            slot,
        }
    }

    /// Speed along the road of one vehicle of each simulation, in its direction of travel [m/s]. `slot` holds the slot
    /// of that vehicle, simulation by simulation.
    ///
    /// `each_at_slot` only looks up four numbers; the speed is then computed once for the whole block. Within
    /// `each_at_slot` it could be computed sixteen times, once for each simulation.
    #[inline(always)]
    pub fn road_speed_at(&self, params: &Params<S, N>, slot: F32<S>) -> F32<S> {
        let motion = &self.motion;
        let [vx, vy, sine, cosine] = each_at_slot!(params, slot, |j| [
            motion.vx[j],
            motion.vy[j],
            motion.sin_heading[j],
            motion.cos_heading[j]
        ]);
        vx * cosine - vy * sine
    }
}

impl<'a, S: Simd, const N: usize> VehicleHandle<'a, S, N> {
    /// Parameters of the vehicle and its driver.
    #[inline(always)]
    pub fn vehicle(self) -> &'a VehicleParams<S> {
        &self.params.vehicles[self.slot]
    }

    /// The vehicle in another slot of the same simulations.
    #[inline(always)]
    pub fn at_slot(self, slot: usize) -> Self {
        Self { slot, ..self }
    }

    /// Station and lateral position of vehicle `other_slot` in this vehicle's direction of travel [m].
    ///
    /// `TWO_WAY` states whether the road has oncoming traffic. It is a constant, so that loops over pairs of vehicles
    /// on one-way roads do not test the direction of each pair.
    #[inline(always)]
    pub fn position_of<const TWO_WAY: bool>(self, other_slot: usize) -> (F32<S>, F32<S>) {
        let motion = &self.state.motion;
        let (s, d) = (motion.s[other_slot], motion.d[other_slot]);
        if !TWO_WAY {
            return (s, d);
        }
        // 1 along the road, -1 for oncoming vehicles.
        let travel_sign = self.params.vehicles[other_slot].travel_sign;
        let is_oncoming = travel_sign.simd_ne(self.vehicle().travel_sign);
        in_opposite_frame(self.params, is_oncoming, s, d)
    }

    /// Station and lateral position in the coordinates of the road, also of an oncoming vehicle [m].
    #[inline(always)]
    pub fn road_position(self) -> (F32<S>, F32<S>) {
        let motion = &self.state.motion;
        let (s, d) = (motion.s[self.slot], motion.d[self.slot]);
        if !self.params.road.directions.has_oncoming_traffic {
            return (s, d);
        }
        in_opposite_frame(self.params, self.vehicle().travel_sign.simd_lt(0.0), s, d)
    }

    /// Velocity along the road and towards the overtaking side, in the vehicle's direction of travel [m/s].
    #[inline(always)]
    pub fn road_velocity(self) -> (F32<S>, F32<S>) {
        let (motion, slot) = (&self.state.motion, self.slot);
        let (sine, cosine) = (motion.sin_heading[slot], motion.cos_heading[slot]);
        (
            motion.vx[slot] * cosine - motion.vy[slot] * sine,
            motion.vx[slot] * sine + motion.vy[slot] * cosine,
        )
    }

    /// Speed that the driver desires at this place [m/s].
    #[inline(always)]
    pub fn desired_speed(self) -> F32<S> {
        if self.params.road.varies_along_road() {
            self.state.road.desired_speed[self.slot]
        } else {
            self.vehicle().desired_speed
        }
    }

    /// Speed that the driver desires at this place while it overtakes [m/s].
    #[inline(always)]
    pub fn desired_passing_speed(self) -> F32<S> {
        if self.params.road.varies_along_road() {
            self.state.road.passing_speed[self.slot]
        } else {
            self.vehicle().passing_speed
        }
    }

    /// Speed limit at this place [m/s].
    #[inline(always)]
    pub fn speed_limit(self) -> F32<S> {
        if self.params.road.varies_along_road() {
            self.state.road.speed_limit[self.slot]
        } else {
            self.vehicle().speed_limit
        }
    }

    /// `accel`, limited where the driver slows down for a lower speed limit ahead [m/s^2].
    #[inline(always)]
    pub fn limit_accel(self, accel: F32<S>) -> F32<S> {
        if self.params.road.varies_along_road() {
            min(accel, self.state.road.accel_limit[self.slot])
        } else {
            accel
        }
    }

    /// Whether the driver is in a stage of an overtake; false for wrecks.
    #[inline(always)]
    pub fn is_in_stage(self, stage: f32) -> Mask<S> {
        let is_sound = self.state.motion.is_wreck[self.slot].simd_eq(0.0);
        is_sound & self.state.overtake.stage[self.slot].simd_eq(stage)
    }

    /// Whether the driver pulls out or passes, before it begins to return; false for wrecks.
    #[inline(always)]
    pub fn is_before_return(self) -> Mask<S> {
        self.is_in_stage(stage::PULL_OUT) | self.is_in_stage(stage::PASS)
    }

    /// Whether the driver overtakes, which includes the return; false for wrecks.
    #[inline(always)]
    pub fn is_overtaking(self) -> Mask<S> {
        let stage = self.state.overtake.stage[self.slot];
        let is_sound = self.state.motion.is_wreck[self.slot].simd_eq(0.0);
        stage.simd_ne(stage::FOLLOW) & stage.simd_ne(stage::DONE) & is_sound
    }

    /// Whether a lane change is under way.
    #[inline(always)]
    pub fn is_changing_lane(self) -> Mask<S> {
        let path = &self.state.path;
        path.elapsed[self.slot].simd_lt(path.duration[self.slot])
    }

    /// Whether no lane change is under way.
    #[inline(always)]
    pub fn has_finished_lane_change(self) -> Mask<S> {
        let path = &self.state.path;
        path.elapsed[self.slot].simd_ge(path.duration[self.slot])
    }
}
