"""Props that vehicles hit, and triggers that change the friction under vehicles."""

from __future__ import annotations

import math

import numpy as np
import pytest

from overtaking.knowledge.carla_catalogue import props
from overtaking.simulators.carla_server import rays
from overtaking.simulators.carla_server.actors import Prop, Vehicle, bounding_box
from overtaking.simulators.carla_server.arguments import (
    Attribute,
    Control,
    Description,
    Rotation,
    Transform,
    Vector,
)
from overtaking.simulators.carla_server.calls import CALLS
from overtaking.simulators.carla_server.camera import RoadScene
from overtaking.simulators.carla_server.catalogue import catalogue
from overtaking.simulators.carla_server.maps import Atlas, known_map
from overtaking.simulators.carla_server.physics import physics_control, telemetry
from overtaking.simulators.carla_server.protocol import Refused, Session
from overtaking.simulators.carla_server.streams import Streams
from overtaking.simulators.carla_server.survey import survey
from overtaking.simulators.carla_server.world import World

CAR = "vehicle.audi.a2"
CAR_LENGTH = 3.705
BARRIER = "static.prop.streetbarrier"
CONTAINER = "static.prop.container"
LANE_Y = 1.75
GRAVITY = 9.81
FLOAT, TEXT = 3, 4


def new_world(road: str = "rural") -> World:
    return World(Atlas([known_map(road)], survey), Streams(print), 1)


def pose(x: float, y: float = LANE_Y, *, yaw: float = 0.0, z: float = 0.0) -> Transform:
    return Transform(Vector(x, y, z), Rotation(0.0, yaw, 0.0))


def spawn(world: World, blueprint: str, place: Transform, **attributes: float) -> int:
    values = tuple(Attribute(name, FLOAT, str(value)) for name, value in attributes.items())
    return world.spawn(Description(1, blueprint, values), place).actor_id


def spawn_car(world: World, place: Transform, speed: float = 0.0) -> Vehicle:
    car = world.vehicle(spawn(world, CAR, place))
    yaw = math.radians(place.rotation.yaw)
    world.set_velocity(car.actor_id, Vector(speed * math.cos(yaw), speed * math.sin(yaw), 0.0))
    return car


def trigger(world: World, place: Transform, friction: float, metres: float = 50.0) -> int:
    sides = dict.fromkeys(("extent_x", "extent_y", "extent_z"), 100.0 * metres)
    return spawn(world, "static.trigger.friction", place, friction=friction, **sides)


def braking_distance(world: World, car: Vehicle) -> float:
    start = car.pose.location
    car.drive(Control(brake=1.0))
    for _ in range(1200):
        world.tick()
        if car.velocity == Vector(0.0, 0.0, 0.0):
            return math.dist(start, car.pose.location)
    raise AssertionError("the car did not stop")


# --- friction ---


@pytest.mark.parametrize("friction", [0.1, 0.3])
@pytest.mark.parametrize("yaw", [0.0, 180.0])
def test_friction_of_a_trigger_is_a_factor_on_the_braking_distance(friction: float, yaw: float):
    distances: list[float] = []
    for value in (1.0, friction):
        world = new_world()
        trigger(world, pose(1000.0), value, metres=500.0)
        car = spawn_car(world, pose(1000.0, LANE_Y if yaw == 0.0 else -LANE_Y, yaw=yaw), speed=15.0)
        distances.append(braking_distance(world, car))
    # If grip alone brakes, the distance is inversely proportional to friction. Rolling resistance
    # and drag do not depend on friction and shorten the longer distance more.
    assert 0.8 / friction < distances[1] / distances[0] < 1.05 / friction


def test_friction_acts_only_inside_the_box_in_all_three_dimensions():
    distances: dict[str, float] = {}
    for name, place in {
        "far": pose(1300.0),
        "above": pose(1000.0, z=60.0),
        "here": pose(1000.0),
    }.items():
        world = new_world()
        trigger(world, place, 0.1)
        distances[name] = braking_distance(world, spawn_car(world, pose(1000.0), speed=10.0))
    world = new_world()
    usual = braking_distance(world, spawn_car(world, pose(1000.0), speed=10.0))
    assert distances["far"] == distances["above"] == usual
    assert distances["here"] > 5.0 * usual


@pytest.mark.parametrize("friction", [1.0, 3.5])
def test_friction_of_a_usual_road_changes_nothing(friction: float):
    usual, inside = new_world(), new_world()
    trigger(inside, pose(1000.0), friction)
    braking_distances = [
        braking_distance(world, spawn_car(world, pose(1000.0), 20.0)) for world in (usual, inside)
    ]
    assert braking_distances[0] == braking_distances[1]


def test_a_vehicle_regains_its_grip_behind_the_box_and_when_the_trigger_is_destroyed():
    world = new_world()
    ice = trigger(world, pose(1000.0), 0.2, metres=10.0)
    car = spawn_car(world, pose(1000.0))
    assert [wheel.tire_friction for wheel in physics_control(world, car).wheels] == [0.2] * 4
    world.tick()
    on_ice = telemetry(world, car)[-1][0].tire_friction  # type: ignore[index]
    world.destroy(ice)
    world.tick()
    assert [wheel.tire_friction for wheel in physics_control(world, car).wheels] == [3.5] * 4
    assert on_ice == pytest.approx(0.2 * telemetry(world, car)[-1][0].tire_friction)  # type: ignore[index]


def test_a_turned_box_acts_where_it_lies():
    world = new_world()
    sides = {"extent_x": 2000.0, "extent_y": 50.0, "extent_z": 500.0}
    spawn(world, "static.trigger.friction", pose(1000.0, yaw=90.0), friction=0.1, **sides)
    assert world.friction_of(spawn_car(world, pose(1000.0))) == 0.1
    assert world.friction_of(spawn_car(world, pose(1010.0))) is None
    assert world.friction_of(spawn_car(world, pose(1000.0, -LANE_Y))) == 0.1


def test_the_smallest_friction_of_several_triggers_acts_and_may_be_zero():
    world = new_world()
    for friction in (0.5, 0.0, 0.8):
        trigger(world, pose(1000.0), friction)
    car = spawn_car(world, pose(1000.0), speed=20.0)
    car.drive(Control(brake=1.0, steer=0.5))
    for _ in range(40):
        world.tick()
    assert world.friction_of(car) == 0.0
    assert np.isfinite([*car.pose.location, *car.velocity]).all()
    assert car.velocity.x > 19.0


@pytest.mark.parametrize(
    "attributes",
    [{"friction": -0.1}, {"friction": math.nan}, {"extent_x": 0.0}, {"extent_z": math.inf}],
)
def test_impossible_triggers_are_refused(attributes: dict[str, float]):
    with pytest.raises(Refused, match=r"static\.trigger\.friction: expected"):
        spawn(new_world(), "static.trigger.friction", pose(0.0), **attributes)


# --- props ---


def test_every_prop_is_listed_and_has_the_box_of_its_blueprint():
    world = new_world()
    assert set(props()) <= set(catalogue())
    for number, (name, prop) in enumerate(props().items()):
        actor = world.actor(spawn(world, name, pose(20.0 * number, 50.0)))
        _, extent, _, _ = bounding_box(actor)
        assert [2.0 * side for side in extent] == pytest.approx(prop.size)  # type: ignore[attr-defined]


@pytest.mark.parametrize(("yaw", "sign"), [(0.0, 1.0), (180.0, -1.0)])
def test_a_fixed_prop_stops_a_vehicle_of_either_direction_with_its_whole_momentum(
    yaw: float, sign: float
):
    world, y = new_world(), sign * LANE_Y
    barrier = spawn(world, BARRIER, pose(1000.0, y, yaw=90.0))
    car = spawn_car(world, pose(1000.0 - 8.0 * sign, y, yaw=yaw), speed=15.0)
    impulses: list[Vector] = []
    for _ in range(40):
        controls = {car.actor_id: car.control}
        for touch in world.fleet.advance(0.05, controls):
            assert (touch.own, touch.other) == (car.actor_id, barrier)
            impulses.append(world.map.to_world(touch.impulse_s, touch.impulse_d))
        world._follow_fleet(0.05)
    (_, width, _), mass = props()[BARRIER].size, car.body["mass"]
    ahead = sign * (1000.0 - car.pose.location.x)
    assert 0.5 * (CAR_LENGTH + width) <= ahead < 0.5 * (CAR_LENGTH + width) + 1.5
    # The car arrives a little slower than 15 m/s, and bounces back by the restitution.
    assert 0.95 * 15.0 * mass < -sign * impulses[0].x < 1.3 * 15.0 * mass
    assert world.actors[barrier].pose == pose(1000.0, y, yaw=90.0)


def test_a_vehicle_under_throttle_does_not_pass_through_a_prop():
    world = new_world()
    spawn(world, CONTAINER, pose(1020.0))
    car = spawn_car(world, pose(1000.0))
    car.drive(Control(throttle=1.0))
    for _ in range(300):
        world.tick()
    assert car.pose.location.x < 1020.0 - 0.5 * CAR_LENGTH


def test_a_prop_with_physics_is_pushed_with_the_momentum_that_the_vehicle_loses():
    world = new_world()
    prop = spawn(world, CONTAINER, pose(1000.0))
    CALLS["set_actor_simulate_physics"].answer(
        Session(world, {}), "set_actor_simulate_physics", [prop, True]
    )
    car = spawn_car(world, pose(990.0), speed=15.0)
    speed = impulse = 0.0
    for _ in range(200):
        speed_before = world.fleet.motion(car.actor_id).v_s
        touches = world.fleet.advance(0.05, {car.actor_id: car.control})
        if touches:
            speed, impulse = speed_before, touches[0].impulse_s
            car.drive(Control(brake=1.0))
        world._follow_fleet(0.05)
    gained = -impulse / world.actors[prop].mass  # type: ignore[attr-defined]
    # After an impact with restitution the light box is faster than the heavy car.
    assert speed < gained < 2.0 * speed
    moved = world.actors[prop].pose.location.x - 1000.0
    assert moved == pytest.approx(gained**2 / (2.0 * 5.0), rel=0.2)
    assert not world.fleet.moved_obstacles()


def test_a_pushed_prop_slides_on_when_the_last_vehicle_is_destroyed():
    world = new_world()
    prop = world.actors[spawn(world, CONTAINER, pose(1000.0))]
    assert isinstance(prop, Prop)
    world.set_prop_physics(prop, has_physics=True)
    car = spawn_car(world, pose(996.0), speed=15.0)
    while not world.fleet.moved_obstacles():
        world.tick()
    world.destroy(car.actor_id)
    place = prop.pose.location.x
    for _ in range(200):
        world.tick()
    assert prop.pose.location.x > place + 5.0
    assert not world.fleet.moved_obstacles()


@pytest.mark.parametrize("z", [5.0, -3.0])
def test_vehicles_pass_under_and_over_props_on_other_levels(z: float):
    world = new_world()
    spawn(world, BARRIER, pose(1010.0, z=z))
    car = spawn_car(world, pose(1000.0), speed=15.0)
    for _ in range(30):
        world.tick()
    assert car.pose.location.x > 1015.0


def test_vehicles_drive_over_flat_debris():
    world = new_world()
    spawn(world, "static.prop.dirtdebris01", pose(1010.0))
    car = spawn_car(world, pose(1000.0), speed=15.0)
    for _ in range(30):
        world.tick()
    assert car.velocity.x > 14.0


def test_a_prop_blocks_the_spawning_of_a_vehicle_but_not_a_vehicle_in_which_it_is_spawned():
    world = new_world()
    spawn(world, CONTAINER, pose(1000.0))
    with pytest.raises(Refused, match="collision at spawn position"):
        spawn_car(world, pose(1001.0))
    car = spawn_car(world, pose(1100.0))
    prop = spawn(world, CONTAINER, pose(1101.0))
    for _ in range(20):
        world.tick()
    assert car.pose.location.x == pytest.approx(1100.0, abs=0.1)
    world.place_actor(prop, pose(1200.0, 30.0))
    car.drive(Control(throttle=1.0))
    for _ in range(60):
        world.tick()
    assert car.pose.location.x > 1103.0


def test_a_prop_that_is_moved_or_destroyed_leaves_the_way_free():
    world = new_world()
    prop, destroyed_prop = (spawn(world, CONTAINER, pose(x)) for x in (1010.0, 1020.0))
    world.place_actor(prop, pose(1010.0, 30.0))
    world.destroy(destroyed_prop)
    car = spawn_car(world, pose(1000.0), speed=15.0)
    for _ in range(60):
        world.tick()
    assert car.pose.location.x > 1030.0


def test_a_prop_attached_to_a_vehicle_does_not_hit_it():
    world = new_world()
    car = spawn_car(world, pose(1000.0), speed=10.0)
    world.spawn(Description(1, CONTAINER, ()), pose(0.0, 0.0, z=1.0), car.actor_id)
    for _ in range(20):
        world.tick()
    assert car.pose.location.x > 1009.0


def test_rays_hit_props_and_cameras_show_them():
    world = new_world()
    spawn(world, CONTAINER, pose(1010.0))
    hit = rays.project(world, Vector(1000.0, LANE_Y, 1.0), Vector(1.0, 0.0, 0.0), 50.0)
    assert hit is not None
    assert hit.location.x == pytest.approx(1010.0 - 0.5 * props()[CONTAINER].size[0], abs=1e-3)
    assert hit.label == 21
    bodies = [world.actors[max(world.actors)]]
    scene, lens = RoadScene(world.map), pose(1000.0, z=1.0)
    empty, full = (
        scene.draw(lens, (160, 90), 90.0, bodies_in_view, world.weather)  # type: ignore[arg-type]
        for bodies_in_view in ([], bodies)
    )
    assert (empty != full).any(axis=2).sum() > 50
