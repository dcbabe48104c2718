"""The parts of the CARLA simulator that need no CARLA."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from tests.support.worlds import Vehicle, scenario, wide_road

import overtaking as ot
from overtaking.core.errors import ConfigError
from overtaking.knowledge.carla_catalogue import carla_vehicles, weather_presets
from overtaking.knowledge.vehicle_classes import VEHICLE_CLASS_NAMES
from overtaking.model.road import DrivingSide
from overtaking.simulators.carla import manager, replay, world
from overtaking.simulators.carla.library import Address, parse_address
from overtaking.simulators.carla.own import (
    MAX_TYRE_ACCEL,
    check_frame_interval,
    motion_from_reading,
)
from overtaking.simulators.carla.processes import joined
from overtaking.simulators.carla.stage import MotionReading
from overtaking.simulators.carla_server.world import SCENARIO_NAME


@pytest.mark.parametrize("kind", VEHICLE_CLASS_NAMES)
def test_every_class_is_played_by_a_vehicle_of_its_own(kind: str):
    given = scenario([Vehicle(kind=kind)])
    name = world.blueprint_for(given, 0)
    assert carla_vehicles()[name].vehicle_class == kind
    length = float(given.vehicles.length[0, 0])
    assert carla_vehicles()[name].size[0] == pytest.approx(length, abs=1.2)


def test_a_preset_goes_to_carla_as_it_is_there():
    given = ot.sample("pinto2023-physical", num_simulations=8, seed=1)
    for row in range(8):
        one = given.select(slice(row, row + 1))
        base = list(weather_presets().values())[int(one.weather.preset[0])].carla_fields()
        fields = world.weather_fields(one)
        assert {k: v for k, v in fields.items() if k != "sun_azimuth_angle"} == {
            k: v for k, v in base.items() if k != "sun_azimuth_angle"
        }


def test_a_sampled_weather_fills_what_means_something():
    one = scenario([Vehicle()], weather={"rain": 40.0, "fog": 7.0, "sun_altitude": -0.5})
    fields = world.weather_fields(one)
    assert fields["precipitation"] == 40.0
    assert fields["fog_density"] == 7.0
    assert fields["sun_altitude_angle"] == pytest.approx(-28.65, abs=0.01)


@pytest.mark.parametrize("direction", [0.0, -3.1415927, 3.1415927, 0.07976437, 1e-7, -1e-9])
def test_the_headless_server_understands_where_the_wind_blows(direction: float):
    one = scenario([Vehicle()], weather={"wind_direction": direction}, index=[7])
    match = re.fullmatch(SCENARIO_NAME, world.nature(one))
    assert match is not None
    assert int(match[2]) == 7
    apart = math.remainder(float(match[3]) - direction, math.tau)
    assert apart == pytest.approx(0.0, abs=1e-6)


def reading(slots: int, **values: float) -> MotionReading:
    names = ("s", "d", "heading", "vx", "vy", "yaw_rate", "accel_lon", "accel_lat")
    return MotionReading(1, *(np.full(slots, values.get(name, 0.0)) for name in names))


def test_speeds_times_three_are_accelerations_times_nine():
    motion_reading = reading(8, s=100.0, d=-12.0, vx=10.0, yaw_rate=0.1, accel_lon=0.5)
    motion = motion_from_reading(motion_reading, scenario([Vehicle()]), time_scale=3)
    names = ("s", "d", "vx", "yaw_rate", "accel_lon")
    values = [float(getattr(motion, name)[0]) for name in names]
    assert values == pytest.approx([100.0, -12.0, 30.0, 0.3, 4.5])


def test_a_contact_is_no_acceleration_of_driving():
    batch = scenario([Vehicle()])
    motion_reading = reading(8, accel_lon=-MAX_TYRE_ACCEL - 1.0, accel_lat=1.0)
    motion = motion_from_reading(motion_reading, batch)
    assert motion.accel_lon[0] == motion.accel_lat[0] == 0.0
    assert motion_from_reading(reading(8, accel_lon=-9.0), batch).accel_lon[0] == -9.0


def test_in_left_hand_traffic_the_lateral_axis_is_turned():
    road = wide_road().mirror()
    assert road.driving_side is DrivingSide.LEFT
    motion_reading = reading(8, d=4.0, heading=0.1, vy=1.0, accel_lat=2.0)
    motion = motion_from_reading(motion_reading, scenario([Vehicle()], road=road))
    names = ("d", "heading", "vy", "accel_lat")
    values = [float(getattr(motion, name)[0]) for name in names]
    assert values == pytest.approx([-4.0, -0.1, -1.0, -2.0])


def test_simulations_of_different_lengths_become_one_batch():
    given = scenario([Vehicle()], [Vehicle(s=50.0)])
    horizons = np.array([1.0, 2.0], np.float32)
    parts = [
        ot.simulate(given.select(slice(k, k + 1)).replace(horizon=horizons[k : k + 1]))
        for k in range(2)
    ]
    both = joined(parts)
    assert both.num_frames.tolist() == [21, 41]
    assert both.states.s.shape == (2, 8, 41)
    assert (both.states.s[0, :, 21:] == 0).all()
    assert (both.states.s[1, 0] == parts[1].states.s[0, 0]).all()
    assert (both.trace_hash == np.concatenate([part.trace_hash for part in parts])).all()


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("localhost:2000", Address("localhost", 2000)),
        ("10.0.0.7", Address("10.0.0.7", 2000)),
        (":3000", Address("127.0.0.1", 3000)),
    ],
)
def test_servers_are_named_by_host_and_port(text: str, address: Address):
    assert parse_address(text) == address


@pytest.mark.parametrize("text", ["host:", "host:x", "host:70000", "host:0"])
def test_what_is_no_address_is_refused(text: str):
    with pytest.raises(ConfigError, match="HOST:PORT"):
        parse_address(text)


def test_frames_between_two_ticks_are_refused():
    check_frame_interval(scenario([Vehicle()], frame_interval_ms=100))
    with pytest.raises(ConfigError, match="multiple of 50"):
        check_frame_interval(scenario([Vehicle()], frame_interval_ms=40))


def test_vision_is_cut_under_clouds_and_towards_a_low_sun():
    def sight(**weather: float) -> float:
        return manager.leader_range(scenario([Vehicle()], weather=weather))

    assert sight() == sight(cloudiness=60.0) == manager.STUDY_LEADER_RANGE
    assert sight(cloudiness=61.0) == sight(low_sun=1.0) == manager.STUDY_LEADER_RANGE_POOR_SIGHT


def test_pushes_grow_with_the_worse_of_rain_and_wind():
    def push(**weather: float) -> float:
        return manager.push_accel(scenario([Vehicle()], weather=weather))

    assert push() == 0.0
    assert push(rain=30.0, wind=50.0) == pytest.approx(0.5 * manager.WEATHER_PUSH_ACCEL)
    assert push(rain=100.0) == manager.WEATHER_PUSH_ACCEL


@pytest.mark.parametrize("size", [(801, 450), (800, 8), (4000, 2000), (-2, 450)])
def test_pictures_that_cannot_be_are_refused(size: tuple[int, int]):
    with pytest.raises(ConfigError, match="size"):
        replay.check_size(size)
