"""Vehicles and people by SUMO's names."""

from __future__ import annotations

import dataclasses
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from tests.support.worlds import Vehicle, scenario

from overtaking.model.vehicles import VehicleKind
from overtaking.simulators.sumo.network import BEHIND
from overtaking.simulators.sumo.traffic import (
    CLASSES,
    Traffic,
    lateral_limits,
    routes,
    speed_factor,
)


def read(world, row=0):
    root = ET.fromstring(routes(Traffic.of(world), row))
    return root.findall("vType"), root.findall("vehicle")


def test_bodies_and_drivers_arrive_unchanged():
    driver = {"time_gap": 1.3, "min_gap": 2.5, "accel": 1.4, "decel": 1.9, "reaction_time": 0.7}
    world = scenario([Vehicle(kind="T", driver=driver)])
    (one,), _ = read(world)
    names = ("tau", "minGap", "accel", "decel", "treaction")
    assert [float(one.get(name)) for name in names] == pytest.approx(list(driver.values()))
    for name in ("length", "width", "height", "mass"):
        assert float(one.get(name)) == getattr(world.vehicles, name)[0, 0]
    assert (one.get("vClass"), one.get("carFollowModel")) == ("truck", "EIDM")
    assert one.get("laneChangeModel") == "SL2015"


def test_cars_are_passenger_cars_on_sumo_and_others_have_classes_of_their_own():
    named = ("passenger", "passenger", "passenger", "delivery", "truck", "motorcycle", "bicycle")
    assert tuple(CLASSES[kind] for kind in list(VehicleKind)[: len(named)]) == named


def test_starts_are_those_of_the_scenario_at_the_front_bumper():
    world = scenario([Vehicle(s=320.0, lane=1, speed=25.5), Vehicle(s=371.0, lane=0)])
    _, (ego, other) = read(world)
    half = float(world.vehicles.length[0, 0]) / 2
    assert float(ego.get("departPos")) == pytest.approx(320.0 + half + BEHIND)
    assert (ego.get("departLane"), other.get("departLane")) == ("1", "0")
    assert float(ego.get("departSpeed")) == 25.5


def test_empty_slots_have_no_vehicle():
    types, vehicles = read(scenario([Vehicle()], num_slots=8))
    assert len(types) == len(vehicles) == 1


def test_a_driver_who_respects_the_limit_gives_up_that_share_of_the_excess():
    limit = scenario([Vehicle()]).road.speed_limit
    drivers = (
        {"desired_speed": limit + 10.0, "speed_limit_compliance": share}
        for share in (0.0, 0.4, 1.0)
    )
    traffic = Traffic.of(scenario(*[[Vehicle(driver=one)] for one in drivers]))
    factors = [speed_factor(traffic, row, 0, 0) for row in range(3)]
    assert factors == pytest.approx([(limit + 10) / limit, (limit + 6) / limit, 1.0])


def test_impatient_and_greedy_drivers_are_more_eager():
    calm = {
        "min_speed_gain": 3.0,
        "gap_demand_factor": 1.25,
        "patience": 30.0,
        "indicator_lead_time": 2.0,
    }
    rash = {
        "min_speed_gain": 0.5,
        "gap_demand_factor": 0.5,
        "patience": 5.0,
        "indicator_lead_time": 0.0,
    }
    (one, other), _ = read(scenario([Vehicle(driver=calm), Vehicle(driver=rash)]))
    for name in ("lcSpeedGain", "lcAssertive"):
        assert float(one.get(name)) < float(other.get(name))
    assert float(one.get("lcAssertive")) == pytest.approx(0.8)
    assert float(one.get("lcTimeToImpatience")) == 30.0
    # Who would gain exactly what it asks for reaches SUMO's threshold of 0.2 in a second.
    gained = calm["min_speed_gain"] / 30.0
    assert float(one.get("lcSpeedGain")) * gained == pytest.approx(0.2)


def test_a_lower_limit_on_the_way_lowers_the_speed_wanted_by_the_same_share():
    limit = scenario([Vehicle()]).road.speed_limit
    drivers = (
        {"desired_speed": limit + 10.0, "speed_limit_compliance": share}
        for share in (0.0, 0.4, 1.0)
    )
    traffic = Traffic.of(scenario(*[[Vehicle(driver=one)] for one in drivers]))
    factors = [speed_factor(traffic, row, 0, 0, np.float32(limit - 5.0)) for row in range(3)]
    wanted = [limit + 10.0, limit + 4.0, limit - 5.0]
    assert factors == pytest.approx([one / limit for one in wanted], rel=1e-6)


def test_a_wet_lane_lowers_the_desired_speed_by_the_published_share():
    """Values of the polynomial on SUMO's page about friction, worked out by hand."""
    traffic = Traffic.of(scenario([Vehicle()], [Vehicle()], weather=[{}, {"rain": 60.0}]))
    dry = speed_factor(traffic, 0, 0, 2)
    friction = np.array([[1.0] * 5, [0.2, 0.4, 0.5, 0.6, 0.8]], np.float32)
    told = dataclasses.replace(traffic, friction=friction)
    shares = [speed_factor(told, 1, 0, lane) / dry for lane in range(5)]
    assert shares == pytest.approx([0.613776, 0.750324, 0.808125, 0.858944, 0.939636])
    assert speed_factor(told, 0, 0, 0) == dry


def test_errors_of_judgement_have_the_size_and_the_time_of_ours():
    ((one,), _) = read(scenario([Vehicle()], weather={"night": 1.0}))
    assert float(one.attrib["sigmagap"]) == pytest.approx(0.18)
    assert float(one.attrib["tPersEstimate"]) == pytest.approx(20.0)


def test_brakes_are_no_better_than_the_road():
    world = scenario([Vehicle(kind="M")], [Vehicle(kind="M")], weather=[{}, {"rain": 100.0}])
    (dry,), _ = read(world, 0)
    (wet,), _ = read(world, 1)
    grip = float(Traffic.of(world).friction[1].mean()) * 9.81
    assert float(wet.get("emergencyDecel")) == pytest.approx(grip, rel=1e-5)
    assert float(wet.get("emergencyDecel")) < float(dry.get("emergencyDecel"))


@pytest.mark.parametrize("duration", [2.5, 5.0, 9.0])
def test_a_trapezoid_of_lateral_speed_covers_a_lane_in_the_drivers_time(duration):
    world = scenario([Vehicle(driver={"lane_change_duration": duration})])
    speed, accel = lateral_limits(world, 0, 0)
    time = np.linspace(0.0, duration, 20_001)
    profile = np.minimum(np.minimum(accel * time, speed), accel * (duration - time))
    covered = np.trapezoid(profile, time)
    assert covered == pytest.approx(world.road.lanes[0].width, rel=1e-4)
    assert profile.max() == pytest.approx(speed)
