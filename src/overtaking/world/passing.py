"""Parameters of passing against oncoming traffic: what is believed, wanted and granted.

What drivers do while being passed is drawn from a stream of its own and is no column of a data set.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32
from overtaking.core.elementary import exp, maximum, minimum
from overtaking.core.philox import Draws, Stream
from overtaking.model.scenario import Scenario
from overtaking.world import visibility
from overtaking.world.bodies import Rows
from overtaking.world.conditions import World, acting
from overtaking.world.constants import known
from overtaking.world.effects import Effects
from overtaking.world.lanes import refuse_oncoming, road_parameters
from overtaking.world.people import quickest_change

_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)
_BY_DRIVER = (
    "unseen_trust",
    "spare",
    "limit",
    "makes_room",
    "passed_factor",
)
"""What `passing_parameters` gives each vehicle."""

_LEAST_DEMAND = np.float32(0.1)  # Keeps the trust of who demands no gap finite.
_FAINTEST = np.float32(1e-12)  # Keeps the range of lamps finite where light has no limit [lx].


def passing_parameters(
    scenario: Scenario, world: World, effects: Effects
) -> tuple[dict[str, NDArray[Any]], Rows]:
    """The fields of `SimulationParameters` and of `VehicleParameters` for two directions.

    Args:
        scenario: A batch of scenarios.
        world: Its weather and light.
        effects: Ablations.
    """
    if not road_parameters(scenario.road).two_way:
        refuse_oncoming(
            scenario, "a road that is not two equally wide lanes, one in each direction"
        )
        return {}, dict.fromkeys(_BY_DRIVER, np.zeros_like(scenario.start_s))
    return _of_all(scenario, world, effects), _passing(scenario) | _passed(scenario)


def _of_all(scenario: Scenario, world: World, effects: Effects) -> dict[str, NDArray[Any]]:
    """How drivers judge the distance and the speed of who comes.

    Source:
        Attwood 1976 (more scatter in the dark).
    """
    night = scenario.weather.night
    day, dark = known("model.oncoming.distance_cv_day"), known("model.oncoming.distance_cv_night")
    limit = known("model.oncoming.usual_share") * np.float32(scenario.road.speed_limit)
    return {
        "oncoming_error": np.where(night, dark, day)
        if effects.distance_error
        else np.zeros(night.shape),
        "oncoming_sight": _sight(scenario, world),
        "usual_speed": np.full(night.shape, limit),
        "hasty_change": maximum(
            quickest_change(scenario, world), known("model.oncoming.hasty_change")
        ),
    }


def _passing(scenario: Scenario) -> Rows:
    """What each driver wants to spare, and how far it trusts the unseen road to be free."""
    demand = scenario.drivers.gap_acceptance
    return {
        "unseen_trust": known("model.oncoming.unseen_trust")
        / np.sqrt(maximum(demand, _LEAST_DEMAND)),
        "spare": known("model.oncoming.spare_asked") * demand,
        "limit": np.full_like(scenario.start_s, scenario.road.speed_limit),
    }


def _sight(scenario: Scenario, world: World) -> F32:
    """How far an oncoming car of middling colour with low beams is seen, (simulation,) [m]."""
    step = world.step
    rain = known("model.speed_choice.rain_sight_factor") * step.rain_extinction
    extinction = step.fog_extinction + rain
    contrast = exp(step.sight_front) * known("model.speed_choice.contrast")
    by_contrast = visibility.contrast_range(extinction, contrast, np.ones_like(extinction))
    lamps = np.full_like(extinction, known("model.lights.headlamp"))
    by_lamp = visibility.lamp_range(extinction, lamps, maximum(step.lamp_threshold, _FAINTEST))
    lit = acting(scenario).weather.night | (world.rain_rate > 0)
    by_day = np.where(lit, maximum(by_contrast, by_lamp), by_contrast)
    seen = np.where(scenario.weather.night, by_lamp, by_day)
    return minimum(seen, known("model.oncoming.range"))


def _passed(scenario: Scenario) -> Rows:
    """Behaviour of each driver while being passed: makes room, yields, or speeds up."""
    # A separate stream, so that these draws change no other draw and no column of a data set.
    slots = np.uint32(Stream.PASSED) + np.arange(scenario.num_slots, dtype=np.uint32)
    draws = Draws(scenario.seed, scenario.index[:, None], slots)
    moves = draws.uniform() < known("model.oncoming.makes_room_share")
    manner = draws.uniform()
    yields = manner < known("model.oncoming.yields_share")
    races = manner > _ONE - known("model.oncoming.races_share")
    yielding, racing = known("model.oncoming.yields_factor"), known("model.oncoming.races_factor")
    return {
        "makes_room": np.where(moves, known("model.oncoming.makes_room"), _ZERO),
        "passed_factor": np.where(yields, yielding, np.where(races, racing, _ONE)),
    }
