// Made by crates/fields.py from world/step_parameters.py, world/weather_parameters.py,
// world/constants.py and model/trajectories.py; do not edit.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::lanes::{LANES, Seats, V};

lane_fields! {
    /// Parameters of one vehicle slot.
    Vehicle, VEHICLE_NAMES {
        valid, half_length, half_width, tall, mass, inverse_mass, inverse_inertia, cg_front,
        cg_rear, inverse_wheelbase, wheelbase, cg_height, front_stiffness, rear_stiffness,
        launch_force, power, drag, rolling, max_speed, brake_force, front_drive, half_track,
        understeer, moment_angle, side_lag, two_wheeler, side_wind, wind_centre, wind_arm, wear,
        truck, shelters, spray, loom_width, contrast, inverse_tail_lamp, inverse_head_lamp, lights,
        desired_speed, pass_speed, time_gap, min_gap, accel, decel, interaction, overspeed_exponent,
        hardest_decel, reaction_ticks, urgent_ticks, attention, most_friction, politeness,
        threshold, bias, safe_decel, lane_change_duration, min_speed_gain, inverse_patience,
        pull_out_ttc, gap_demand_factor, return_time_gap, indicator_lead_time, uses_indicator,
        checks_blind_spot, start_s, start_d, start_speed, start_lane, direction, makes_room,
        passed_factor, passing_time_factor, unseen_trust, spare, heeds_solid_lines, limit,
        free_speed, speed_limit_compliance, caution,
    }
}

lane_fields! {
    /// Parameters of a simulation.
    Simulation, SIMULATION_NAMES {
        last_step, deadline_step, fog_extinction, rain_extinction, sight_front, sight_rear,
        lamp_threshold, inverse_lit_range, detection_time, distance_error, speed_error, wind_along,
        wind_across, gust_gain, gust_phase, gust_length, push_accel, push_rate, push_share,
        push_phase, least_film, film_rain, texture, puddle_reach, puddle_film, puddle_phase_1,
        puddle_phase_2, side_accel, command, ring, inverse_ring, oncoming_error, oncoming_sight,
        usual_speed, hasty_change, rain_slowing, stoppable_speed,
    }
}

number_fields! {
    /// Constants of the model.
    Constants {
        step, decision, after_overtake, after_collision, smallest_gap, jerk_up, jerk_down,
        brake_ramp, heed_until, heed_wholly, jerk_release, coolness, signalling_time_gap,
        corridor_margin, footprint_margin, clear_fraction, clear_margin, visible_fraction, cooldown,
        quickest_change, retreat_share, claim_time, foresight, foresight_accel,
        no_passing_right_speed, smallest_rear_gap, free_ahead_time, most_imposed, abort_imposed,
        patience_floor, close_time_gap, waiting_time_gap, accelerate_gain, abort_until,
        abort_factor, abort_cooldown, give_up_after, stay_time, clear_ahead, settled_offset,
        sight_range, mirror_range, unseen_gap, seen_before, lamp_decel, error_fade_time,
        urgent_time, brake_memory, stop_lamp_decel, detection_growth, blind_spot, alongside,
        glance_interval, glance_moving, glance_stagger, glance_time, looming_threshold,
        looming_growth, lane_deviation, error_time, lane_time, inverse_puddle_wave_1,
        inverse_puddle_wave_2, puddle_slope, spray_coefficient, spray_film, spray_speed,
        spray_reach, rain_speed, inverse_stop_lamp, position_gain, velocity_gain, yaw_gain,
        slip_share, wind_lag, steering_lag, steering_rate, steering_limit, bend_accel, per_station,
        per_approach, pass_speed_factor, slip_speed, abs_share, traction_share, stability_threshold,
        stability_time, governor_band, two_wheeler_lag, standstill, restitution, near_gap,
        near_side, edge_margin, spin_angle, sliding_ratio, friction_floor, truck_dry_factor,
        truck_loss_factor, turbulence_intensity, gust_length_scale, wind_angle_factor, gust_spacing,
        shelter_factor, shelter_reach, shelter_release, oncoming_range, small_oncomer,
        passing_surplus, turning_way, squeeze_gap, least_room, fit_share, calm_margin, spare_kept,
        abort_margin, tall_room, hurry_speed, hurry_gain, fall_back_speed, fall_back_share,
        eye_offset, line_ahead, head_on_flash, head_on_lift, head_on_time, head_on_least,
        head_on_most, aside_way, aside_duration, beside_margin, gravity, half_air_density,
    }
}

/// Hand the recorded states of a vehicle to a macro, in order: meaning, name and type.
#[macro_export]
macro_rules! with_states {
    ($then:ident! { $($given:tt)* }) => {
        $then! {
            { $($given)* }
            /// OpenDRIVE x of the bounding-box centre [mm].
            x: i32,
            /// OpenDRIVE y of the bounding-box centre, right-handed [mm].
            y: i32,
            /// Position along the road [mm].
            s: i32,
            /// Position across the road, positive to the left [mm].
            d: i32,
            /// Speed, never negative [mm/s].
            speed: i32,
            /// Heading, anticlockwise from world x [0.1 mrad].
            heading: i16,
            /// Front wheels, positive to the left [0.1 mrad].
            wheel_angle: i16,
            /// Acceleration forwards, contacts excluded [mm/s^2].
            accel_lon: i16,
            /// Acceleration to the left [mm/s^2].
            accel_lat: i16,
            /// Turning rate, anticlockwise [0.1 mrad/s].
            yaw_rate: i16,
            /// Lane index, 0 the slowest; `num_lanes` beyond the fast edge, 255 beyond the slow edge.
            lane: u8,
            /// `Lights` bits.
            lights: u8,
        }
    };
}
