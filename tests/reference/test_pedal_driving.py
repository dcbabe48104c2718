"""Vehicles that a program drives by pedals: engine and reference compute the same bits."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from overtaking import _core
from overtaking.core.errors import ConfigError
from overtaking.knowledge.carla_catalogue import carla_vehicles, weather_presets
from overtaking.model.known_roads import known_road
from overtaking.model.pedal_controls import PedalControls
from overtaking.sim.pedal_driving import (
    ContactBodies,
    DrivenVehicles,
    PedalDriving,
    driven_vehicles_at_start,
)
from overtaking.sim.reference import collisions
from overtaking.sim.reference import pedal_driving as reference
from overtaking.sim.reference.state import State
from overtaking.simulators.carla_server.bodies import Nature, body_of, scenario_of
from overtaking.world.step_parameters import StepParameters, step_parameters

GROUPS = {
    "s": "motion", "d": "motion", "heading": "motion", "vx": "motion", "vy": "motion",
    "yaw_rate": "motion", "wheel_angle": "controls", "requested_accel": "controls",
    "accel_lon": "motion", "accel_lat": "motion", "gust": "noise", "distance_error": "noise",
    "speed_error": "noise", "lane_wander": "noise", "mu_left": "friction_and_wind",
    "mu_right": "friction_and_wind", "wind_force": "friction_and_wind",
    "wind_moment": "friction_and_wind", "tail_wind": "friction_and_wind",
}  # fmt: skip
"""The group in the state of the reference, for each row of the table."""

TICK, STEPS = 0.05, 5
LEVELS = [name for name, is_available in _core.simd_levels() if is_available]


def params_for(count: int, weather: str, road: str = "town06") -> StepParameters:
    """Parameters of vehicles of every class."""
    names = sorted(carla_vehicles())
    bodies = [body_of(names[7 * k % len(names)]) for k in range(count)]
    fields = tuple(weather_presets()[weather].carla_fields().values())
    ground, nature = known_road(road), Nature(5, simulation=3, wind_direction=1.1)
    params = step_parameters(scenario_of(ground, bodies, fields, nature))
    constants = params.constants.replace(step=TICK / STEPS, decision=TICK)
    return dataclasses.replace(params, constants=constants)


def scattered(count: int, chance: np.random.Generator) -> np.ndarray:
    """A table of vehicles with random positions and headings; some of them are at rest."""
    table = driven_vehicles_at_start(count)
    ranges = {
        "s": (0.0, 300.0), "d": (-20.0, 4.0), "heading": (-4.0, 4.0), "yaw_rate": (-0.3, 0.3),
        "vx": (0.0, 45.0), "vy": (-1.0, 1.0), "wheel_angle": (-0.1, 0.1), "gust": (-2.0, 2.0),
    }  # fmt: skip
    vehicles = DrivenVehicles(*table)
    for name, (low, high) in ranges.items():
        getattr(vehicles, name)[:] = chance.uniform(low, high, count)
    vehicles.vx[1::5] = vehicles.vy[1::5] = vehicles.yaw_rate[1::5] = 0.0
    return table


def reference_state(table: np.ndarray, params: StepParameters) -> State:
    """The state of the reference with the numbers of a table."""
    state = State.at_start(params)
    for name, row in zip(DrivenVehicles._fields, table.copy(), strict=True):
        setattr(getattr(state, GROUPS[name]), name, row[:, None])
    return state


def pedals(count: int, chance: np.random.Generator) -> PedalControls:
    rows = chance.uniform((0.0, 0.0, -0.3), (1.0, 1.0, 0.3), (count, 3)).astype(np.float32)
    rows[:, :2] *= chance.integers(0, 2, (count, 1)).astype(np.float32)
    return PedalControls(*rows.T.copy())


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize(
    ("count", "weather"), [(1, "SoftRainNoon"), (6, "HardRainNoon"), (29, "WetNight")]
)
def test_engine_and_reference_drive_the_same_way(level: str, count: int, weather: str):
    params = params_for(count, weather)
    chance = np.random.default_rng(count)
    table = scattered(count, np.random.default_rng(7))
    start, state = table.copy(), reference_state(table, params)
    engine = PedalDriving(params, level)
    for decision in range(40):
        controls = pedals(count, chance)
        engine.update_weather(table, decision)
        engine.drive(table, controls, STEPS)
        reference.update_weather(state, params, decision)
        reference.drive(state, params, controls, STEPS)
        for name, row in zip(DrivenVehicles._fields, table, strict=True):
            expected = getattr(getattr(state, GROUPS[name]), name)
            assert expected.dtype == np.float32, name
            assert row.tobytes() == np.ascontiguousarray(expected).tobytes(), (decision, name)
    # The comparison covers wind and motion.
    vehicles = DrivenVehicles(*table)
    assert np.abs(vehicles.wind_force).max() > 0.0
    assert np.abs(vehicles.s - DrivenVehicles(*start).s).max() > 1.0


def test_tables_have_the_rows_of_the_engine():
    assert _core.FIELD_NAMES["pedal_table"] == DrivenVehicles._fields == tuple(GROUPS)
    assert _core.FIELD_NAMES["bodies"] == ContactBodies._fields
    assert DrivenVehicles._fields[:6] == ContactBodies._fields[:6]


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("road", ["town06", "rural"])
@pytest.mark.parametrize("seed", range(4))
def test_engine_and_reference_exchange_the_same_momentum(level: str, road: str, seed: int):
    """Bodies in a heap, so that most touch several others within one step."""
    count = 12
    params = params_for(count, "ClearNoon", road)
    chance = np.random.default_rng(seed)
    table = scattered(count, chance)
    vehicles = DrivenVehicles(*table)
    vehicles.s[:], vehicles.d[:] = chance.uniform(100.0, 118.0, (2, count))
    old_positions = table[:2] - chance.uniform(-1.5, 1.5, (2, count)).astype(np.float32)
    pairs = [(i, j) for i in range(count) for j in range(i + 1, count)]
    shapes = (
        params.vehicles.half_length, params.vehicles.half_width,
        params.vehicles.inverse_mass, params.vehicles.inverse_inertia,
    )  # fmt: skip
    bodies = np.concatenate([table[:6], *(shape.T for shape in shapes)])

    state = reference_state(table, params)
    state.end_step[:] = np.float32(1e9)
    vehicle_pairs = [
        collisions.VehiclePair(
            first=i,
            second=j,
            frame=collisions.pair_frame(params, i, j),
            is_near=np.ones(1, np.bool_),
        )
        for i, j in pairs
    ]
    start = collisions.RoadVector(old_positions[0][:, None], old_positions[1][:, None])
    swept = collisions.SweptStep(index=0, length=params.constants.step, start=start)
    collisions.resolve_contacts(state, params, vehicle_pairs, swept)
    partners = PedalDriving(params, level).resolve_contacts(bodies, old_positions, pairs)
    for name, row in zip(ContactBodies._fields[:6], bodies[:6], strict=True):
        expected = np.ascontiguousarray(getattr(state.motion, name))
        assert row.tobytes() == expected.tobytes(), name
    assert (partners == state.first_contact.partner[:, 0]).all()
    # The comparison covers wind and motion.
    assert (partners >= 0).sum() >= 4
    assert np.abs(bodies[3:6] - table[3:6]).max() > 1.0


def test_two_equal_bodies_exchange_momentum_by_their_restitution():
    """Head-on contact of equal masses: v1' = (1 - e) v / 2, v2' = (1 + e) v / 2."""
    params = params_for(2, "ClearNoon")
    bodies = np.zeros((len(ContactBodies._fields), 2), np.float32)
    named = ContactBodies(*bodies)
    # The step of 10 ms brings the centres from 4.1 m to 3.9 m; the bodies touch at 4 m.
    named.s[:], named.vx[:] = (4.1, 8.0), (20.0, 0.0)
    named.half_length[:], named.half_width[:] = 2.0, 1.0
    named.inverse_mass[:], named.inverse_inertia[:] = 1e-3, 4e-4
    old_positions = np.array([[3.9, 8.0], [0.0, 0.0]], np.float32)
    partners = PedalDriving(params).resolve_contacts(bodies, old_positions, [(0, 1)])
    restitution = float(params.constants.restitution)
    assert partners.tolist() == [1, 0]
    assert named.vx.tolist() == pytest.approx(
        [10.0 * (1.0 - restitution), 10.0 * (1.0 + restitution)], rel=1e-5
    )


def test_a_second_group_of_vehicles_drives_like_a_separate_scenario():
    count = _core.MAX_VEHICLES + 1
    params = params_for(count, "HardRainNoon")
    # Groups do not shelter each other.
    params.vehicles.shelters_wind[:] = 0.0
    table = scattered(count, np.random.default_rng(3))
    last = table[:, -1:].copy()
    controls = pedals(count, np.random.default_rng(4))
    driving = PedalDriving(params)
    alone = dataclasses.replace(
        params,
        vehicle_table=params.vehicle_table[:, -1:],
        scenario_index=params.scenario_index + np.uint64(1 << 32),
    )
    driving_alone = PedalDriving(alone)
    controls_alone = PedalControls(
        controls.throttle[-1:], controls.brake[-1:], controls.wheel_angle[-1:]
    )
    start = table.copy()
    for decision in range(5):
        driving.update_weather(table, decision)
        driving.drive(table, controls, STEPS)
        driving_alone.update_weather(last, decision)
        driving_alone.drive(last, controls_alone, STEPS)
    assert table[:, -1:].tobytes() == last.tobytes()
    gusts = DrivenVehicles(*table).gust
    assert gusts[0] - DrivenVehicles(*start).gust[0] != gusts[-1] - DrivenVehicles(*start).gust[-1]


def test_the_engine_refuses_tables_of_another_length():
    params = params_for(2, "ClearNoon")
    table, driving = driven_vehicles_at_start(2), PedalDriving(params)
    short = np.zeros(1, np.float32)
    with pytest.raises(ValueError, match="controls"):
        driving.drive(table, PedalControls(short, short, short), 1)
    bodies = np.zeros((len(ContactBodies._fields), 2), np.float32)
    old_positions = bodies[:2].copy()
    with pytest.raises(ValueError, match="2 bodies"):
        driving.resolve_contacts(bodies, old_positions, [(0, 2)])
    with pytest.raises(ValueError, match="bodies"):
        driving.resolve_contacts(bodies[1:], old_positions, [(0, 1)])
    with pytest.raises(ConfigError):
        PedalDriving(params, "mmx")
