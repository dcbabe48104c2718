"""Parameters of the step that depend on the driver, and the speed adapted to the conditions."""

from typing import NamedTuple

import numpy as np

from overtaking.core.arrays import F32
from overtaking.core.elementary import clamp, exp, maximum, minimum
from overtaking.model.scenario import Scenario
from overtaking.model.vehicles import Role
from overtaking.world import friction, visibility
from overtaking.world.bodies import Rows
from overtaking.world.clock import DECISIONS_PER_SECOND
from overtaking.world.conditions import World, acting, world_of
from overtaking.world.constants import Constants, constants, known
from overtaking.world.effects import Effects
from overtaking.world.lanes import road_parameters

_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)

_NEVER = np.float32(1e9)
"""A threshold that no incentive to change lanes reaches [m/s^2]."""

_NO_LIMIT = np.float32(10.0)
"""A friction coefficient that no tyre reaches."""

_FAINTEST = np.float32(1e-12)
"""Keeps the range of lamps finite where light has no limit [lx]."""

_QUINTIC_PEAK = np.float32(5.77)
"""Largest acceleration of a quintic path from rest to rest, 10 / sqrt(3), in D / T^2."""


def driver_parameters(scenario: Scenario, c: Constants, world: World, effects: Effects) -> Rows:
    """The parameters of the step that people decide, but for those that are traits as they are.

    Args:
        scenario: A batch of scenarios.
        c: Constants.
        world: Its weather and light.
        effects: Ablations.
    """
    return (
        _speeds(scenario, world, c)
        | _following(scenario, c, world)
        | _reaction(scenario, world, effects)
        | _limits(scenario, c)
        | _lane_changes(scenario, world, effects)
        | {"inverse_patience": _ONE / scenario.drivers.patience}
    )


def wanted_speed(scenario: Scenario) -> F32:
    """Speed that each driver wants in its weather and vehicle, (simulation, vehicle) [m/s]."""
    adapted = adapted_speed(wishes(scenario), np.float32(scenario.road.speed_limit))
    return minimum(adapted, scenario.vehicles.max_speed)


def _speeds(scenario: Scenario, world: World, c: Constants) -> Rows:
    """What drivers want under the limit of the road; with `Course.limits` the highest one."""
    top, limit = scenario.vehicles.max_speed, np.float32(scenario.road.speed_limit)
    desired = minimum(adapted_speed(_wishes(scenario, c, world), limit), top)
    return {
        "desired_speed": desired,
        "pass_speed": minimum(desired * c.pass_speed_factor, top),
        "free_speed": scenario.drivers.desired_speed,
    }


def _following(scenario: Scenario, c: Constants, world: World) -> Rows:
    """Parameters of the intelligent driver model.

    Source:
        Treiber and Kesting, Traffic Flow Dynamics (2013), chapter 11: the factor of v dv in s* is
        1 / (2 sqrt(a b)), the exponent above the desired speed 4 a / b.
    """
    p = scenario.drivers
    usable = known("model.following.grip_share") * c.gravity * world.grip[:, None]
    return {
        "interaction": np.float32(0.5) / np.sqrt(p.accel * p.decel),
        "overspeed_exponent": known("model.following.free_exponent") * p.accel / p.decel,
        "hardest_decel": minimum(scenario.vehicles.peak_decel, usable),
    }


def _reaction(scenario: Scenario, world: World, effects: Effects) -> Rows:
    """Reaction times in whole decisions, longer at night and in haze, and when it is urgent."""
    night = known("model.perception.reaction_night_factor")
    haze = known("model.perception.reaction_haze_factor")
    fog = visibility.extinction_of_range(known("model.perception.fog_range"))
    hazy = (world.step.fog_extinction > fog) | (
        world.rain_rate > known("model.perception.heavy_rain_mmph")
    )
    slower = np.where(scenario.weather.night, night, _ONE)[:, None]
    usual = scenario.drivers.reaction_time * slower * np.where(hazy, haze, _ONE)[:, None]
    return {
        "reaction_ticks": _ticks(usual, effects),
        "urgent_ticks": _ticks(scenario.drivers.reaction_time, effects),
    }


def _ticks(reaction: F32, effects: Effects) -> F32:
    """A reaction time in whole decisions, as far back as is remembered; none without delay."""
    ticks = minimum(np.rint(reaction * DECISIONS_PER_SECOND), known("model.perception.history"))
    return ticks if effects.delay else np.zeros_like(ticks)


def _limits(scenario: Scenario, c: Constants) -> Rows:
    """How far ahead each driver attends to, and the most friction that its tyres find.

    Alike for all; `benchmarks/nets.py` lowers them for an ego that does not know of it.
    """
    shape = scenario.drivers.reaction_time
    return {
        "attention": np.full_like(shape, c.sight_range),
        "most_friction": np.full_like(shape, _NO_LIMIT),
    }


def _lane_changes(scenario: Scenario, world: World, effects: Effects) -> Rows:
    p = scenario.drivers
    threshold = p.lane_change_threshold
    quickest = quickest_change(scenario, world)[:, None]
    gain = p.passing_gain
    if not effects.mobil:
        threshold = np.full_like(threshold, _NEVER)
        gain = np.where(np.arange(gain.shape[1]) == Role.EGO, gain, _NEVER)
    return {
        "threshold": threshold,
        "passing_gain": gain,
        "bias": p.right_bias,
        "lane_change_duration": maximum(p.lane_change_duration, quickest),
    }


def quickest_change(scenario: Scenario, world: World) -> F32:
    """Shortest lane change that the believed grip allows, shape (simulation,) [s]."""
    borders = road_parameters(scenario.road).boundaries
    width = borders[1] - borders[0]
    share = known("model.lane_change.accel_share")
    return np.sqrt(_QUINTIC_PEAK * width / (share * world.step.side_accel))


class Wish(NamedTuple):
    """What the speed that a driver wants follows from; arrays of shapes that go together.

    Attributes:
        free: Wanted on a free road in good weather, without a limit [m/s].
        limit_respect: Share of the excess over a limit that is given up [1].
        caution: Share of what weather and light take off [1].
        rain_slowing: By how much a fully cautious driver slows for rain [m/s].
        stoppable: Speed from which one stops within sight of a lit vehicle [m/s].
    """

    free: F32
    limit_respect: F32
    caution: F32
    rain_slowing: F32
    stoppable: F32


def adapted_speed(wish: Wish, limit: F32 | np.float32) -> F32:
    """Speed that drivers want under a limit in their weather and light [m/s].

    A cautious driver slows for heavy rain as measured on motorways, and to a speed from which the
    vehicle stops within sight of a lit one; a careless one does not.
    """
    wanted = wish.free - wish.limit_respect * maximum(wish.free - limit, _ZERO)
    excess = maximum(wanted - wish.rain_slowing - wish.stoppable, _ZERO)
    return wanted - wish.caution * (wish.rain_slowing + excess)


def wishes(scenario: Scenario) -> Wish:
    """Those of all drivers, each array of shape (simulation, vehicle) or (simulation, 1)."""
    c = constants()
    return _wishes(acting(scenario), c, world_of(scenario, c, Effects()))


def _wishes(scenario: Scenario, c: Constants, world: World) -> Wish:
    p, each = scenario.drivers, slowing_parameters(scenario, c, world)
    slowing, stoppable = (each[name][:, None] for name in ("rain_slowing", "stoppable_speed"))
    return Wish(p.desired_speed, p.limit_respect, p.caution, slowing, stoppable)


def slowing_parameters(scenario: Scenario, c: Constants, world: World) -> dict[str, F32]:
    """The fields of `SimulationParameters` by which drivers slow down, each (simulation,).

    Args:
        scenario: A batch of scenarios.
        c: Constants.
        world: Its weather and light.
    """
    return {
        "rain_slowing": _rain_slowing(world),
        "stoppable_speed": _stoppable_speed(scenario, c, world),
    }


def _rain_slowing(world: World) -> F32:
    """By how much a fully cautious driver slows for rain, shape (simulation,) [m/s]."""
    heavy = known("model.speed_choice.rain_from_mmph")
    beyond = (world.rain_rate - heavy) / known("model.speed_choice.rain_span_mmph")
    least = known("model.speed_choice.rain_least_slowing")
    more = known("model.speed_choice.rain_more_slowing") * clamp(beyond, _ZERO, _ONE)
    return np.where(world.rain_rate > heavy, least + more, _ZERO)


def _stoppable_speed(scenario: Scenario, c: Constants, world: World) -> F32:
    """Speed from which one stops within sight of a lit vehicle, shape (simulation,) [m/s]."""
    sight = world.step
    rain_factor = known("model.speed_choice.rain_sight_factor")
    extinction = sight.fog_extinction + rain_factor * sight.rain_extinction
    contrast = exp(sight.sight_front) * known("model.speed_choice.contrast")
    by_contrast = visibility.contrast_range(extinction, contrast, np.ones_like(extinction))
    tail = np.full_like(extinction, known("weather.lamps.rear_position"))
    by_lamp = visibility.lamp_range(extinction, tail, maximum(sight.lamp_threshold, _FAINTEST))
    seen = np.where(scenario.weather.night, by_lamp, maximum(by_contrast, by_lamp))
    reaction = np.full_like(seen, known("model.speed_choice.reaction_time"))
    decel = known("model.speed_choice.grip_share") * c.gravity * world.grip
    return friction.stoppable_speed(seen, reaction, decel)
