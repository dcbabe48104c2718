"""Car following: acceleration of a driver behind a leader."""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F32
from overtaking.core.float32_math import ONE, TWO, ZERO, clamp, exp, log, maximum, minimum
from overtaking.world.constants import ModelConstants
from overtaking.world.step_parameters import VehicleParameters

# Keeps the stopping acceleration of `cah_accel` finite behind a leader at rest [m^2/s^2].
_MIN_STOPPING_TERM = np.float32(1e-3)

# Near the desired speed the free acceleration of `iidm_accel` approaches 0, and the exponent of z,
# the desired gap over the gap, approaches infinity. z^1000 is below 0.0001 for z < 0.99.
_MIN_FREE_ACCEL = np.float32(1e-3)  # [m/s^2]
_MAX_EXPONENT = np.float32(1000.0)

_MIN_GAP_RATIO = np.float32(1e-6)  # Keeps the logarithm of z finite.


@dataclass(frozen=True, slots=True, kw_only=True)
class Follower:
    """Drivers behind a leader: of all vehicles, of some, or of one.

    Attributes:
        vehicle: Parameters of the drivers and their vehicles.
        speed: Speed [m/s].
        desired_speed: Speed on a free road, > 0 [m/s].
        time_gap: Time gap that the driver keeps [s].
    """

    vehicle: VehicleParameters
    speed: F32
    desired_speed: F32
    time_gap: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class Leader:
    """The vehicle ahead of each follower, as it is or as the follower believes.

    Attributes:
        gap: Gap between the bumpers [m].
        closing_speed: Speed of the follower minus the leader's [m/s].
        accel: Acceleration of the leader [m/s^2]. Never positive: `perception` clips the belief.
    """

    gap: F32
    closing_speed: F32
    accel: F32 | np.float32 = ZERO


def desired_gap(vehicle: VehicleParameters, speed: F32, time_gap: F32, closing_speed: F32) -> F32:
    """Desired gap s* of the intelligent driver model [m].

    `vehicle.idm_interaction` is 1 / (2 sqrt(a b)): a is `vehicle.accel` and b `vehicle.decel`.

    Args:
        vehicle: Parameters of the followers.
        speed: Their speed [m/s].
        time_gap: Time gap that they keep [s].
        closing_speed: Their speed minus the leader's [m/s].
    """
    dynamic_part = speed * time_gap + speed * closing_speed * vehicle.idm_interaction
    return vehicle.min_gap + maximum(dynamic_part, ZERO)


def iidm_accel(constants: ModelConstants, follower: Follower, leader: Leader) -> F32:
    """Acceleration of the improved intelligent driver model, IIDM [m/s^2].

    Source:
        Treiber and Kesting, Traffic Flow Dynamics (2013), section 11.3.7.
    """
    vehicle = follower.vehicle
    s_star = desired_gap(vehicle, follower.speed, follower.time_gap, leader.closing_speed)
    # Desired gap over gap.
    z = s_star / maximum(leader.gap, constants.min_effective_gap)
    speed_ratio = follower.speed / follower.desired_speed
    # Below the desired speed the exponent is 4, above it `overspeed_exponent`, which is
    # `following.free_exponent` (`model.toml`) times a / b. As `free_exponent` is 4 as well, both
    # branches have the same slope at the desired speed: change the two numbers together.
    # Other powers are exp(exponent * log(base)), which has the same bits on every machine; `**`
    # depends on the CPU.
    square = speed_ratio * speed_ratio
    free_accel_below = vehicle.accel * (ONE - square * square)
    decay = exp(-vehicle.overspeed_exponent * log(maximum(speed_ratio, ONE)))
    free_accel_above = -vehicle.decel * (ONE - decay)
    interaction = vehicle.accel * (ONE - z * z)
    exponent = minimum(
        TWO * vehicle.accel / maximum(free_accel_below, _MIN_FREE_ACCEL), _MAX_EXPONENT
    )
    blended = free_accel_below * (ONE - exp(exponent * log(clamp(z, _MIN_GAP_RATIO, ONE))))
    accel_below = np.where(z >= ONE, interaction, blended)
    accel_above = np.where(z >= ONE, free_accel_above + interaction, free_accel_above)
    return np.where(speed_ratio <= ONE, accel_below, accel_above)


def cah_accel(constants: ModelConstants, speed: F32, leader: Leader) -> F32:
    """Acceleration that just avoids a contact if the leader keeps its acceleration [m/s^2].

    Args:
        constants: Constants of the model.
        speed: Speed of the follower [m/s].
        leader: Leader of the follower.

    Source:
        Constant-acceleration heuristic of Kesting, Treiber, Helbing 2010, equation 2.5.
    """
    double_gap = TWO * maximum(leader.gap, constants.min_effective_gap)
    leader_speed = maximum(speed - leader.closing_speed, ZERO)
    closing_speed = maximum(leader.closing_speed, ZERO)
    # The leader still moves when the closing speed has become 0 ...
    moving_accel = leader.accel - (closing_speed * closing_speed) / double_gap
    # ... or it stops first, and the follower stops behind it. If the gap opens and the leader does
    # not brake, `leader_stops_first` is true as well, but both accelerations are 0.
    stopping_term = leader_speed * leader_speed - double_gap * leader.accel
    stopping_accel = speed * speed * leader.accel / maximum(stopping_term, _MIN_STOPPING_TERM)
    leader_stops_first = leader_speed * leader.closing_speed < -(double_gap * leader.accel)
    return np.where(leader_stops_first, stopping_accel, moving_accel)


def blend_iidm_with_cah(
    constants: ModelConstants, vehicle: VehicleParameters, iidm: F32, cah: F32
) -> F32:
    """Acceleration of the IIDM with softer braking at small gaps [m/s^2].

    Where the IIDM brakes harder than the constant-acceleration heuristic (CAH), the excess is
    limited to about the comfortable deceleration. A cut-in by a faster vehicle thus causes no hard
    braking. `coolness` is the weight of the softer braking.

    Args:
        constants: Constants of the model.
        vehicle: Parameters of the drivers.
        iidm: Acceleration by `iidm_accel` [m/s^2].
        cah: Acceleration by `cah_accel` [m/s^2].

    Source:
        Kesting, Treiber, Helbing 2010 (ACC model); Treiber and Kesting (2013), section 11.3.8.
    """
    excess = minimum(iidm - cah, ZERO)
    # tanh(x) is (exp(2 x) - 1) / (exp(2 x) + 1), here with x = excess / decel.
    exp_2x = exp(TWO * excess / vehicle.decel)
    softened = cah + vehicle.decel * ((exp_2x - ONE) / (exp_2x + ONE))
    # At small gaps the braking of the IIDM grows without bound; no vehicle brakes harder than 1 g.
    bounded = maximum(iidm, -constants.gravity)
    blend = (ONE - constants.coolness) * bounded + constants.coolness * softened
    return np.where(iidm >= cah, iidm, blend)


def acc_accel(constants: ModelConstants, follower: Follower, leader: Leader) -> F32:
    """Acceleration behind a leader, with a reaction to its stop lamps [m/s^2].

    The blended IIDM reacts to the gap and its change, so it brakes only after a braking leader has
    become visibly slower. Stop lamps make a driver brake before that, with at least a share of
    `cah_accel`: all of it at short time gaps, nothing at long ones, linear between.
    """
    speed = follower.speed
    cah = cah_accel(constants, speed, leader)
    iidm = iidm_accel(constants, follower, leader)
    accel = blend_iidm_with_cah(constants, follower.vehicle, iidm, cah)
    max_time_gap = constants.stop_lamp_max_time_gap
    # Formulas that divide by the vehicle's speed divide by at least `slip_speed`, 3 m/s.
    time_gap_below_max = max_time_gap - leader.gap / maximum(speed, constants.slip_speed)
    reaction_share = clamp(
        time_gap_below_max / (max_time_gap - constants.stop_lamp_full_time_gap), ZERO, ONE
    )
    stop_lamps_are_on = leader.accel < -constants.stop_lamp_decel
    return np.where(stop_lamps_are_on, minimum(accel, reaction_share * cah), accel)


def imposed_accel(
    constants: ModelConstants,
    vehicle: VehicleParameters,
    speed: F32,
    time_gap: F32,
    leader: Leader,
) -> F32:
    """Acceleration, never positive, that a leader imposes on a follower [m/s^2].

    This is `iidm_accel` at the desired speed, where the free acceleration is 0. It is not blended
    with `cah_accel`: a driver accepts a small gap after a cut-in for itself, but should not impose
    such a gap on another driver.

    Args:
        constants: Constants of the model.
        vehicle: Parameters of the driver that judges the gap: the follower, or a driver ahead of it
            that assumes the follower to be like itself.
        speed: Speed of the follower [m/s].
        time_gap: Time gap behind the leader that the judging driver asks for [s].
        leader: Leader of the follower.

    Source:
        Kesting, Treiber, Helbing 2007, whose safety criterion uses the unblended model.
    """
    # Desired gap over gap.
    z = desired_gap(vehicle, speed, time_gap, leader.closing_speed) / maximum(
        leader.gap, constants.min_effective_gap
    )
    return minimum(vehicle.accel * (ONE - z * z), ZERO)
