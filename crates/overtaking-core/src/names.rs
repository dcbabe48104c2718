// Made by crates/engine_names.py from world/step_parameters.py, world/weather_parameters.py,
// world/constants.py, model/trajectories.py, model/scenario.py, model/neighbours.py and
// model/driver_interface.py; do not edit.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::vectors::{CopyLane, F32, SIMD_LANES};

parameter_rows! {
    /// Parameters of one vehicle slot.
    VehicleParams, VEHICLE_NAMES {
        valid, half_length, half_width, blocks_view, mass, inverse_mass, inverse_inertia, cg_front,
        cg_rear, inverse_wheelbase, wheelbase, cg_height, front_stiffness, rear_stiffness,
        launch_force, power, drag, rolling, max_speed, max_brake_force, front_drive, half_track,
        understeer, moment_angle, side_lag, two_wheeler, side_wind, wind_centre, wind_arm,
        tyre_wear, has_truck_tyres, shelters_wind, spray, looming_width, log_contrast,
        inverse_tail_lamp, inverse_head_lamp, initial_lights, desired_speed, passing_speed,
        time_gap, min_gap, accel, decel, idm_interaction, overspeed_exponent, max_assumed_decel,
        reaction_delay, urgent_reaction_delay, attention_range, max_friction, politeness,
        lane_change_threshold, keep_right_bias, safe_decel, lane_change_duration, min_speed_gain,
        inverse_patience, pull_out_ttc, gap_demand_factor, return_time_gap, indicator_lead_time,
        uses_indicator, checks_blind_spot, start_s, start_d, start_speed, start_lane, travel_sign,
        edge_shift_when_passed, speed_factor_when_passed, passing_time_factor, assumed_sight_factor,
        time_reserve_share, heeds_solid_lines, speed_limit, free_speed, speed_limit_compliance,
        caution,
    }
}

parameter_rows! {
    /// Parameters of a simulation.
    SimulationParams, SIMULATION_NAMES {
        last_step, deadline_step, fog_extinction, rain_extinction, log_contrast_sensitivity_ahead,
        log_contrast_sensitivity_behind, lamp_threshold, inverse_lit_range, detection_time,
        distance_error, speed_error, wind_along, wind_across, gust_gain, gust_phase, gust_length,
        push_accel, push_rate, push_duty_cycle, push_phase, min_wet_film, film_rain_factor,
        texture_depth, puddle_threshold, puddle_film, puddle_phase_1, puddle_phase_2,
        max_lateral_accel, forced_decision, ring_length, inverse_ring_length, oncoming_error,
        oncoming_sight, expected_oncoming_speed, urgent_change_duration, rain_slowing,
        stoppable_speed,
    }
}

named_constants! {
    /// Constants of the model.
    ModelConstants {
        step, decision, after_overtake, after_collision, min_effective_gap, jerk_up, jerk_down,
        brake_ramp, stop_lamp_max_time_gap, stop_lamp_full_time_gap, jerk_release, coolness,
        signalling_time_gap, corridor_margin, footprint_margin, lane_cleared_share,
        lane_clearance_time, visible_fraction, cooldown, min_lane_change_duration,
        abort_duration_share, claim_time, foresight, foresight_accel, no_passing_right_speed,
        min_rear_gap, free_ahead_time, max_imposed_decel, abort_imposed_factor, patience_floor,
        close_time_gap, waiting_time_gap, accelerate_gain, abort_until, abort_factor,
        abort_cooldown, give_up_after, stay_time, return_clearance, settled_offset, sight_range,
        mirror_range, unseen_gap, initial_time_in_view, lamp_decel, error_fade_time, urgent_time,
        brake_memory, stop_lamp_decel, detection_growth, blind_spot, alongside, glance_interval,
        glance_moving, glance_stagger, glance_time, looming_threshold, looming_growth,
        lane_deviation, error_time, lane_time, inverse_puddle_wave_1, inverse_puddle_wave_2,
        puddle_slope, spray_coefficient, spray_film, spray_speed, spray_reach, rain_speed,
        inverse_stop_lamp, position_gain, velocity_gain, yaw_gain, slip_share, wind_lag,
        steering_lag, steering_rate, steering_limit, bend_accel, per_station, per_approach,
        passing_speed_factor, slip_speed, abs_share, traction_share, stability_threshold,
        stability_time, governor_band, two_wheeler_lag, standstill, restitution, near_gap,
        near_side, edge_margin, spin_angle, sliding_ratio, friction_floor, truck_dry_factor,
        truck_loss_factor, turbulence_intensity, gust_length_scale, wind_angle_factor, gust_spacing,
        shelter_factor, shelter_reach, shelter_release, oncoming_range, two_wheeler_distance_factor,
        passing_speed_surplus, min_change_distance, min_return_gap, min_return_space,
        return_time_gap_share, urgent_return_margin, min_time_reserve_share, abort_margin,
        tall_vehicle_gap_factor, urgent_speed_factor, urgent_accel_factor, abort_speed_difference,
        abort_decel_share, eye_offset, line_lookahead, oncoming_flash_time, oncoming_lift_decel,
        oncoming_brake_time, oncoming_min_decel, oncoming_max_decel, edge_shift,
        edge_shift_duration, passed_awareness_margin, gravity, half_air_density,
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

/// Members of `overtaking.model.trajectories.Stage`.
#[allow(missing_docs, dead_code)]
pub mod stage {
    pub const FOLLOW: f32 = 0.0;
    pub const PULL_OUT: f32 = 1.0;
    pub const PASS: f32 = 2.0;
    pub const RETURN: f32 = 3.0;
    pub const DONE: f32 = 4.0;
    pub const ABORT: f32 = 5.0;
    pub const CRASHED: f32 = 6.0;
}

/// Members of `overtaking.model.scenario.ForcedDecision`.
#[allow(missing_docs, dead_code)]
pub mod forced_decision {
    pub const FREE: f32 = 0.0;
    pub const PULL_OUT: f32 = 1.0;
    pub const CANCEL: f32 = 2.0;
    pub const RETURN: f32 = 3.0;
    pub const STAY: f32 = 4.0;
}

/// Members of `overtaking.model.driver_interface.Move`.
#[allow(missing_docs, dead_code)]
pub mod ego_move {
    pub const KEEP: f32 = 0.0;
    pub const INDICATE_PULL_OUT: f32 = 1.0;
    pub const PULL_OUT: f32 = 2.0;
    pub const INDICATE_RETURN: f32 = 3.0;
    pub const RETURN: f32 = 4.0;
    pub const CANCEL: f32 = 5.0;
}

/// Members of `overtaking.model.trajectories.Lights`.
#[allow(missing_docs, dead_code)]
pub mod lights {
    pub const INDICATOR_LEFT: i32 = 1;
    pub const INDICATOR_RIGHT: i32 = 2;
    pub const BRAKE: i32 = 4;
    pub const LOW_BEAM: i32 = 8;
    pub const HIGH_BEAM: i32 = 16;
    pub const REAR_FOG: i32 = 32;
}

/// Members of `overtaking.model.neighbours.NeighbourRole`.
#[allow(missing_docs, dead_code)]
pub mod neighbour_role {
    pub const LEADER: usize = 0;
    pub const FOLLOWER: usize = 1;
    pub const LEFT_LEADER: usize = 2;
    pub const LEFT_FOLLOWER: usize = 3;
    pub const RIGHT_LEADER: usize = 4;
    pub const RIGHT_FOLLOWER: usize = 5;
}

/// Hand the kinds of action to a macro: parts, name, and steps to a unit of each part.
macro_rules! with_action_kinds {
    ($then:ident!) => {
        $then! {
            /// Move [Move].
            Decision, "decision", [1.0, 1.0, 1.0];
            /// Accel [m/s^2], lane_change [lanes towards the overtaking side].
            AccelLane, "accel_lane", [1000.0, 1.0, 1.0];
            /// Accel [m/s^2], wheel_angle [rad towards the overtaking side].
            AccelSteer, "accel_steer", [1000.0, 10000.0, 1.0];
            /// Accel [m/s^2], move [Move].
            AccelMove, "accel_move", [1000.0, 1.0, 1.0];
            /// Accel [m/s^2], wheel_angle [rad towards the overtaking side], lane_change [lanes towards the overtaking side].
            AccelSteerSignal, "accel_steer_signal", [1000.0, 10000.0, 1.0];
        }
    };
}
