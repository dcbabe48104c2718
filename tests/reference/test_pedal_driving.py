"""Vehicles that somebody else drives: the engine moves them as the reference does, bit for bit."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from overtaking import _core
from overtaking.core.errors import ConfigError
from overtaking.knowledge.carla_catalogue import carla_vehicles, weather_presets
from overtaking.model.known_roads import known_road
from overtaking.sim.pedal_driving import EnginePedalDriving, ReferencePedalDriving, pedal_driving
from overtaking.sim.reference.pedal_driving import TABLE_FIELDS, PedalControls
from overtaking.sim.reference.state import State
from overtaking.simulators.carla_server.bodies import Nature, body_of, scenario_of
from overtaking.world.step_parameters import StepParameters, step_parameters

TICK, STEPS = 0.05, 5
LEVELS = [name for name, is_available in _core.simd_levels() if is_available]


def given_for(count: int, weather: str) -> StepParameters:
    """Parameters of vehicles of every class on the road of the study."""
    names = sorted(carla_vehicles())
    bodies = [body_of(names[7 * k % len(names)]) for k in range(count)]
    fields = tuple(weather_presets()[weather].carla_fields().values())
    road = known_road("town06").extend_to(3000.0)
    scene = scenario_of(road, bodies, fields, Nature(5, simulation=3, wind_direction=1.1))
    given = step_parameters(scene)
    c = given.constants.replace(step=TICK / STEPS, decision=TICK)
    return dataclasses.replace(given, constants=c)


def scattered(given: StepParameters, chance: np.random.Generator) -> State:
    """Vehicles here and there, heading anywhere, some at rest and one of them a wreck."""
    state = State.at_start(given)
    shape = state.motion.s.shape

    def drawn(low: float, high: float) -> np.ndarray:
        return chance.uniform(low, high, shape).astype(np.float32)

    state.motion.s, state.motion.d = drawn(0.0, 300.0), drawn(-20.0, 4.0)
    state.motion.heading, state.motion.yaw_rate = drawn(-4.0, 4.0), drawn(-0.3, 0.3)
    state.motion.vx, state.motion.vy = drawn(0.0, 45.0), drawn(-1.0, 1.0)
    state.motion.vx[1::5] = state.motion.vy[1::5] = state.motion.yaw_rate[1::5] = 0.0
    state.controls.wheel_angle, state.noise.gust = drawn(-0.1, 0.1), drawn(-2.0, 2.0)
    return state


def pedals(count: int, chance: np.random.Generator) -> PedalControls:
    rows = chance.uniform((0.0, 0.0, -0.3), (1.0, 1.0, 0.3), (count, 3)).astype(np.float32)
    rows[:, :2] *= chance.integers(0, 2, (count, 1)).astype(np.float32)
    throttle, brake, angle = (rows[:, k : k + 1] for k in range(3))
    return PedalControls(throttle, brake, angle)


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize(
    ("count", "weather"), [(1, "SoftRainNoon"), (6, "HardRainNoon"), (29, "WetNight")]
)
def test_engine_and_reference_drive_the_same_way(level: str, count: int, weather: str):
    given = given_for(count, weather)
    chance = np.random.default_rng(count)
    ours, theirs = (scattered(given, np.random.default_rng(7)) for _ in range(2))
    engine, reference = EnginePedalDriving(given, level), ReferencePedalDriving(given)
    for decision in range(40):
        wanted = pedals(count, chance)
        for by, state in ((engine, ours), (reference, theirs)):
            by.weather(state, decision)
            by.drive(state, wanted, STEPS)
        for group, name in TABLE_FIELDS:
            one, other = (getattr(getattr(each, group), name) for each in (ours, theirs))
            assert other.dtype == np.float32, name
            assert one.tobytes() == np.ascontiguousarray(other).tobytes(), (decision, name)
    # There was something to agree about.
    assert np.abs(ours.friction_and_wind.wind_force).max() > 0.0
    assert np.abs(ours.motion.s - scattered(given, np.random.default_rng(7)).motion.s).max() > 1.0


def test_engine_and_reference_know_the_same_fields():
    assert _core.FIELD_NAMES["pedal_table"] == tuple(name for _, name in TABLE_FIELDS)


def test_more_vehicles_than_the_engine_has_slots_for_are_left_to_the_reference():
    assert isinstance(pedal_driving(given_for(_core.MAX_VEHICLES, "ClearNoon")), EnginePedalDriving)
    assert isinstance(
        pedal_driving(given_for(_core.MAX_VEHICLES + 1, "ClearNoon")), ReferencePedalDriving
    )


def test_the_engine_refuses_tables_of_another_length():
    given = given_for(2, "ClearNoon")
    state, by = State.at_start(given), EnginePedalDriving(given)
    short = np.zeros((1, 1), np.float32)
    with pytest.raises(ValueError, match="controls"):
        by.drive(state, PedalControls(short, short, short), 1)
    with pytest.raises(ConfigError):
        EnginePedalDriving(given, "mmx")
