"""Maps with slopes and levels, and what rays meet on them."""

from __future__ import annotations

import dataclasses
import math
import re
from typing import Any

import pytest
from tests.support.carla import needs_wheel

from overtaking.core.errors import ConfigError
from overtaking.model.road_course import RoadCourse, SpeedLimitSpan
from overtaking.simulators.carla_server.arguments import (
    Control,
    Description,
    Rotation,
    Transform,
    Vector,
)
from overtaking.simulators.carla_server.maps import Atlas, Map, known_map
from overtaking.simulators.carla_server.motion import PlanarMotion
from overtaking.simulators.carla_server.physics import WheelTelemetry, telemetry
from overtaking.simulators.carla_server.rays import ROAD, TERRAIN, cast, project
from overtaking.simulators.carla_server.running import run_server
from overtaking.simulators.carla_server.streams import Streams
from overtaking.simulators.carla_server.survey import survey
from overtaking.simulators.carla_server.world import World

DOWN = Vector(0.0, 0.0, -1.0)
SLOPE = 0.05
TRUCK = "vehicle.carlamotors.european_hgv"
CAR_TAG, TRUCK_TAG = 14, 15


def straight(elevation: str = "") -> str:
    """Our road along the x axis from the origin on, with an elevation."""
    text = known_map("town06").opendrive
    text = re.sub(r'x="[^"]*" y="[^"]*" hdg="[^"]*"', 'x="0" y="0" hdg="0"', text)
    return text.replace('<elevation s="0" a="0" b="0"', elevation) if elevation else text


def sloping() -> Map:
    return survey("hill", straight(f'<elevation s="0" a="2" b="{SLOPE}"'))


def crossing() -> Map:
    """A road, and another at right angles 9 m above it, at x = 500 m."""
    lower = straight()
    road = lower[lower.index("<road ") : lower.index("</road>") + len("</road>")]
    upper = road.replace('id="40"', 'id="41"').replace(
        '<elevation s="0" a="0"', '<elevation s="0" a="9"'
    )
    upper = upper.replace('x="0" y="0" hdg="0"', f'x="500" y="-500" hdg="{math.pi / 2}"')
    return survey("bridge", lower.replace("</OpenDRIVE>", upper + "</OpenDRIVE>"))


def world_on(town: Map) -> World:
    return World(Atlas([town], survey), Streams(lambda _: None), 1)


def put(
    world: World, x: float, y: float, z: float, yaw: float = 0.0, *, name: str = "vehicle.audi.a2"
) -> int:
    pose = Transform(Vector(x, y, z), Rotation(0.0, yaw, 0.0))
    return world.spawn(Description(1, name, ()), pose).actor_id


def drive(world: World, car: int, ticks: int) -> Transform:
    vehicle = world.vehicle(car)
    yaw = math.radians(vehicle.pose.rotation.yaw)
    world.set_velocity(car, Vector(15.0 * math.cos(yaw), 15.0 * math.sin(yaw), 0.0))
    vehicle.drive(Control(throttle=0.3))
    for _ in range(ticks):
        world.tick()
    return vehicle.pose


def wheels_of(world: World, car: int) -> list[WheelTelemetry]:
    wheels: Any = telemetry(world, world.vehicle(car))[-1]
    return wheels


@pytest.mark.ci
@needs_wheel
@pytest.mark.parametrize(("yaw", "sign"), [(0.0, 1.0), (180.0, -1.0), (90.0, 0.0)])
def test_vehicles_pitch_with_the_slope_and_rise_with_it(yaw: float, sign: float):
    world = world_on(sloping())
    pose = drive(world, put(world, 400.0, 5.0, 25.0, yaw), 5)
    assert pose.location.z == pytest.approx(2.0 + SLOPE * pose.location.x, abs=0.01)
    assert pose.rotation.pitch == pytest.approx(sign * math.degrees(math.atan(SLOPE)), abs=0.02)


@pytest.mark.ci
@needs_wheel
def test_spawn_points_lie_in_the_slope():
    point = sloping().spawn_points()[3]
    assert point.rotation.pitch == pytest.approx(math.degrees(math.atan(SLOPE)), abs=1e-3)
    assert point.location.z == pytest.approx(2.3 + SLOPE * point.location.x, abs=0.01)


@pytest.mark.ci
@needs_wheel
def test_who_drives_on_a_bridge_stays_on_it_and_touches_nobody_below():
    world = world_on(crossing())
    below, above = put(world, 490.0, 6.0, 0.3), put(world, 506.0, 16.0, 9.3, -90.0)
    low, high = drive(world, below, 0), drive(world, above, 0)
    vehicles = world.vehicle(below), world.vehicle(above)
    for _ in range(30):
        world.tick()
        low, high = (one.pose for one in vehicles)
        assert low.location.z == pytest.approx(0.0, abs=0.01)
        assert high.location.z == pytest.approx(9.0, abs=0.01)
    assert low.location.x > 505.0
    assert high.location.y < 0.0
    assert vehicles[0].velocity.x > 12.0


def test_who_is_hidden_underground_is_in_nobodys_way():
    world = world_on(known_map("town06"))
    car = put(world, 300.0, 244.65, 0.3)
    hidden = put(world, 320.0, 244.65, -100.0)
    world.fleet[hidden].has_physics = False
    drive(world, car, 60)
    assert world.vehicle(car).velocity.x > 12.0
    assert world.vehicle(hidden).pose.location == Vector(320.0, 244.65, -100.0)


def test_a_ray_meets_vehicles_and_then_the_road():
    world = world_on(known_map("town06"))
    car, truck = put(world, 300.0, 244.65, 0.0), put(world, 320.0, 244.65, 0.0, name=TRUCK)
    hits = cast(world, Vector(290.0, 244.65, 0.5), Vector(330.0, 244.65, -0.1))
    assert [hit.label for hit in hits] == [CAR_TAG, TRUCK_TAG, ROAD]
    halves = [world.vehicle(one).extent.x for one in (car, truck)]
    assert hits[0].location.x == pytest.approx(300.0 - halves[0], abs=1e-6)
    assert hits[1].location.x == pytest.approx(320.0 - halves[1], abs=1e-6)
    assert hits[2].location.z == pytest.approx(0.0, abs=1e-9)
    assert cast(world, Vector(290.0, 241.15, 0.5), Vector(330.0, 241.15, 0.5)) == []


def test_a_turned_box_is_met_where_its_side_is():
    world = world_on(known_map("town06"))
    extent = world.vehicle(put(world, 300.0, 244.65, 0.0, 90.0)).extent
    hit = project(world, Vector(290.0, 244.65, 0.5), Vector(5.0, 0.0, 0.0), 50.0)
    assert hit is not None
    assert hit.location.x == pytest.approx(300.0 - extent.y, abs=1e-6)


def test_downwards_is_the_road_or_what_lies_beside_it():
    world = world_on(known_map("town06"))
    on_lane = project(world, Vector(300.0, 244.65, 5.0), DOWN, 10.0)
    beside = project(world, Vector(300.0, 400.0, 5.0), DOWN, 10.0)
    assert on_lane == (Vector(300.0, 244.65, 0.0), ROAD)
    assert beside == (Vector(300.0, 400.0, 0.0), TERRAIN)
    assert project(world, Vector(300.0, 244.65, 5.0), DOWN, 4.0) is None
    assert project(world, Vector(300.0, 244.65, 5.0), Vector(0.0, 0.0, 1.0), 50.0) is None
    assert project(world, Vector(300.0, 244.65, 5.0), Vector(0.0, 0.0, 0.0), 50.0) is None


@pytest.mark.ci
@needs_wheel
def test_a_ray_finds_the_slope_and_every_level():
    hill = project(world_on(sloping()), Vector(400.0, 5.0, 60.0), DOWN, 100.0)
    assert hill is not None
    assert hill.location.z == pytest.approx(2.0 + SLOPE * 400.0, abs=0.01)
    world = world_on(crossing())
    for start, height in ((20.0, 9.0), (6.0, 0.0)):
        hit = project(world, Vector(506.0, 6.0, start), DOWN, 50.0)
        assert hit is not None
        assert hit.location.z == pytest.approx(height, abs=0.01)
        assert hit.label == ROAD


def test_wheels_carry_the_weight_and_turn_as_the_vehicle_rolls():
    world = world_on(known_map("town06"))
    car = put(world, 300.0, 244.65, 0.0)
    world.tick()
    body = world.vehicle(car).body
    load = sum(one.tire_load for one in wheels_of(world, car))
    assert load == pytest.approx(body["mass"] * 9.81, rel=0.01)
    drive(world, car, 20)
    told: Any = telemetry(world, world.vehicle(car))
    speed, _, throttle, _, _, gear, drag, wheels = told
    assert speed == pytest.approx(world.vehicle(car).velocity.x, rel=1e-3)
    assert (throttle, gear) == (pytest.approx(0.3), 1)
    assert drag == pytest.approx(0.5 * 1.2 * body["drag_area"] * speed**2, rel=0.03)
    assert wheels[0].omega == pytest.approx(speed / 0.35)


def test_in_a_curve_to_the_right_the_left_wheels_carry_more_and_all_push_to_the_right():
    world = world_on(known_map("town06"))
    car = put(world, 300.0, 244.65, 0.0)
    drive(world, car, 1)
    vehicle = world.vehicle(car)
    vehicle.drive(Control(steer=0.03))
    for _ in range(10):
        world.tick()
    wheels = wheels_of(world, car)
    assert wheels[0].tire_load > wheels[1].tire_load
    turning = math.radians(vehicle.turning) * vehicle.velocity.x
    across = sum(one.lat_force for one in wheels)
    assert across == pytest.approx(vehicle.body["mass"] * turning, rel=0.1)


def test_an_unknown_map_names_those_there_are_and_the_option():
    atlas = Atlas([known_map("town06")], survey)
    assert atlas.names() == ["Town06", "motorway", "rural"]
    with pytest.raises(
        ConfigError, match=r"Town06 or motorway or rural, got 'Town01'.*--map Town01\.xodr"
    ):
        atlas.find("Town01")


def test_two_maps_of_one_name_are_refused():
    with pytest.raises(ConfigError, match="each with a name of its own, got Town06, Town06"):
        run_server(port=0, maps=["town06", "TOWN06"], ready=print, log=print)


def test_a_vehicle_reads_the_limit_where_it_is():
    base = known_map("motorway")
    course = RoadCourse(speed_limit_spans=(SpeedLimitSpan(start=100.0, stop=200.0, speed=20.0),))
    road = dataclasses.replace(base.ground.road, course=course)
    found = dataclasses.replace(base, ground=dataclasses.replace(base.ground, road=road))
    still = PlanarMotion(150.0, -2.0, 0.0, 0.0, 0.0, 0.0)
    poses = (found.pose(dataclasses.replace(still, s=s), 0.0) for s in (99.0, 150.0, 201.0))
    limits = [found.limit(pose) for pose in poses]
    assert limits == [road.speed_limit, 20.0, road.speed_limit]
    assert base.limit(found.pose(still, 0.0)) == road.speed_limit


def test_a_two_way_road_has_spawn_points_lanes_and_limits_of_both_directions():
    base = known_map("rural")
    points = base.spawn_points()
    along = [point for point in points if abs(point.rotation.yaw) < 1.0]
    against = [point for point in points if abs(abs(point.rotation.yaw) - 180.0) < 1.0]
    assert len(along) == len(against) == len(points) / 2 > 100
    # CARLA's y axis points to the right.
    assert {point.location.y for point in along} == {1.75}
    assert {point.location.y for point in against} == {-1.75}
    assert [base.is_lane(1000.0, y, 0.0) for y in (-3.6, -3.4, 3.4, 3.6)] == [
        False,
        True,
        True,
        False,
    ]
    course = RoadCourse(
        speed_limit_spans=(
            SpeedLimitSpan(start=0.0, stop=900.0, speed=20.0),
            SpeedLimitSpan(start=900.0, stop=2000.0, speed=10.0, direction=-1),
        )
    )
    road = dataclasses.replace(base.ground.road, course=course)
    limited_map = dataclasses.replace(base, ground=dataclasses.replace(base.ground, road=road))
    limits = [limited_map.limit(point) for point in (along[50], against[-50])]
    assert 900.0 < along[50].location.x < 2000.0
    assert 900.0 < against[-50].location.x < 2000.0
    assert limits == [road.speed_limit, 10.0]


def test_both_directions_have_the_same_marks_on_the_line_between_them():
    lanes = known_map("rural").lanes
    half = len(lanes.station) // 2
    along, against = lanes.marks[:half], lanes.marks[half:][::-1]
    assert (lanes.position[:half, 0] == lanes.position[half:, 0][::-1]).all()
    assert (along[:, 0] == against[:, 0]).all()
    assert {1, 2} <= set(along[:, 0].tolist())
    assert (along[:, 1] == 1).all()
    assert (against[:, 1] == 1).all()
