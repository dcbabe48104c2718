//! Parameters by name, in the order in which Python hands them over.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::lanes::{LANES, Seats, V};

/// A struct whose fields are loaded in order from rows of sixteen numbers.
macro_rules! lane_fields {
    ($(#[$doc:meta])* $name:ident, $names:ident { $($field:ident),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub struct $name<S: Simd> { $(pub(crate) $field: V<S>),* }

        /// Names of the fields, in the order in which they are handed over.
        pub const $names: &[&str] = &[$(stringify!($field)),*];

        impl<S: Simd> Seats for $name<S> {
            fn seat(&mut self, lane: usize, from: &Self, other: usize) {
                $(self.$field.seat(lane, &from.$field, other);)*
            }
        }

        impl<S: Simd> $name<S> {
            /// Fill the fields from consecutive rows.
            #[inline(always)]
            pub(crate) fn load(simd: S, mut row: impl FnMut(usize) -> [f32; LANES]) -> Self {
                let mut at = 0;
                $(
                    let $field = V::simd_from(simd, row(at));
                    at += 1;
                )*
                debug_assert_eq!(at, $names.len());
                Self { $($field),* }
            }
        }
    };
}

/// A struct of numbers filled in order from a slice.
macro_rules! number_fields {
    ($(#[$doc:meta])* $name:ident { $($field:ident),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default)]
        pub struct $name {
            $(pub(crate) $field: f32,)*
            /// Peak friction of a new tyre at (speed, film) knots.
            pub friction_new: [[f32; 4]; 3],
            /// The same of a worn one.
            pub friction_worn: [[f32; 4]; 3],
            /// Speed knots [m/s].
            pub friction_speeds: [f32; 3],
            /// Film knots [mm].
            pub friction_films: [f32; 4],
        }

        impl $name {
            /// Names of the numbers, in order.
            pub const NAMES: &'static [&'static str] = &[$(stringify!($field)),*];

            /// Set the numbers from a slice in the order of `NAMES`.
            ///
            /// # Panics
            /// If the slice has another length.
            pub fn set(&mut self, values: &[f32]) {
                assert_eq!(values.len(), Self::NAMES.len());
                let mut rest = values.iter();
                $(if let Some(value) = rest.next() { self.$field = *value; })*
            }
        }
    };
}

lane_fields! {
    /// Parameters of one vehicle slot.
    Vehicle, VEHICLE_NAMES {
        valid, half_length, half_width, tall, mass, inverse_mass, inverse_inertia, cg_front, cg_rear,
        inverse_wheelbase, wheelbase, cg_height, front_stiffness, rear_stiffness, launch_force, power,
        drag, rolling, max_speed, brake_force, front_drive, half_track, understeer, moment_angle, two_wheeler,
        side_wind, wind_centre, wind_arm, wear, truck, shelters, spray, loom_width, contrast,
        inverse_tail_lamp, inverse_head_lamp, lights, desired_speed, pass_speed, time_gap, min_gap,
        accel, decel, interaction, overspeed_exponent, hardest_decel, reaction_ticks, politeness,
        threshold, bias, safe_decel, lane_change_duration, passing_gain, inverse_patience,
        pull_out_time, gap_acceptance, return_time_gap, signal_time, uses_indicator, checks_blind_spot,
        start_s, start_d, start_speed, start_lane,
    }
}

lane_fields! {
    /// Parameters of a simulation.
    Simulation, SIMULATION_NAMES {
        last_step, deadline_step, fog_extinction, rain_extinction, sight_front, sight_rear,
        lamp_threshold, inverse_lit_range, detection_time, distance_error, speed_error, wind_along,
        wind_across, gust_gain, gust_phase, gust_length, least_film, film_rain, texture,
        puddle_reach, puddle_film, puddle_phase_1, puddle_phase_2, side_accel, command, ring, inverse_ring,
    }
}

number_fields! {
    /// Constants of the model.
    Constants {
        step, decision, after_overtake, after_collision, smallest_gap, jerk_up, jerk_down,
        brake_ramp, heed_until, heed_wholly, jerk_release, coolness, signalling_time_gap, corridor_margin, footprint_margin, clear_fraction, clear_margin, visible_fraction, cooldown,
        mobil_interval, close_time_gap, unseen_gap, seen_before, brake_memory, lamp_decel, error_fade_time, most_imposed, abort_imposed, stop_lamp_decel,
        inverse_puddle_wave_1, inverse_puddle_wave_2, puddle_slope,
        no_passing_right_speed, smallest_rear_gap, free_ahead_time, patience_floor, waiting_time_gap, accelerate_gain,
        abort_until, abort_factor, abort_cooldown, give_up_after, stay_time, clear_ahead,
        settled_offset, sight_range, mirror_range, detection_growth, blind_spot, looming_threshold,
        lane_deviation, error_time, lane_time, spray_coefficient, spray_film, spray_speed, spray_reach,
        rain_speed, inverse_stop_lamp, position_gain, velocity_gain, yaw_gain, slip_share, wind_lag,
        steering_lag, steering_rate, steering_limit, slip_speed, abs_share, traction_share,
        governor_band, two_wheeler_lag, standstill, restitution, near_gap,
        near_side, edge_margin, spin_angle, sliding_ratio, friction_floor, truck_dry_factor, truck_loss_factor,
        turbulence_intensity, gust_length_scale, wind_angle_factor, gust_spacing, shelter_factor,
        shelter_reach, shelter_release, gravity, half_air_density,
    }
}
