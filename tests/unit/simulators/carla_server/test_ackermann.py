"""CARLA's Ackermann controller, and what clients do to the bodies of vehicles."""

from __future__ import annotations

import math

import pytest

from overtaking.simulators.carla_server.ackermann import Ackermann, Seen
from overtaking.simulators.carla_server.arguments import (
    Attribute,
    Control,
    Description,
    Gains,
    Rotation,
    Target,
    Transform,
    Vector,
)
from overtaking.simulators.carla_server.maps import Atlas, known_map
from overtaking.simulators.carla_server.physics import (
    add_actor_angular_impulse,
    add_actor_force_at_location,
    add_actor_impulse_at_location,
    add_actor_torque,
    apply_physics_control,
    disable_actor_constant_velocity,
    enable_actor_constant_velocity,
    physics_control,
)
from overtaking.simulators.carla_server.protocol import Refused
from overtaking.simulators.carla_server.streams import Streams
from overtaking.simulators.carla_server.survey import survey
from overtaking.simulators.carla_server.world import World

TICK = 0.05
LOCK = math.radians(70.0)
AT_REST = Seen(0.0, 0.0, LOCK)


def car_in_the_calm() -> tuple[World, int]:
    """A world without wind, and a car in it at 20 m/s."""
    world = World(Atlas([known_map("town06")], survey), Streams(lambda _: None), 1)
    weather = list(world.weather)
    weather[3] = 0.0
    world.set_weather(weather)
    colour = Attribute("color", 5, "1,2,3")
    pose = Transform(Vector(300.0, 244.65, 0.3), Rotation(0.0, 0.0, 0.0))
    car = world.spawn(Description(1, "vehicle.audi.a2", (colour,)), pose).actor_id
    world.tick()
    world.set_velocity(car, Vector(20.0, 0.0, 0.0))
    return world, car


def test_a_vehicle_that_stands_and_shall_stand_is_braked():
    control = Ackermann(Target(steer=0.1)).control(AT_REST, Gains(), TICK)
    assert (control.throttle, control.brake, control.reverse) == (0.0, 1.0, False)
    assert control.steer == pytest.approx(0.1 / LOCK)


def test_the_first_pedal_is_that_of_both_proportional_parts():
    control = Ackermann(Target(speed=2.0)).control(AT_REST, Gains(), TICK)
    assert control.throttle == pytest.approx(0.01 * 0.15 * 2.0)
    assert control.brake == 0.0


def test_the_client_bounds_the_acceleration():
    gains = Gains(speed_kp=1.0, accel_kp=1.0)
    control = Ackermann(Target(speed=50.0, acceleration=0.25)).control(AT_REST, gains, TICK)
    assert control.throttle == pytest.approx(0.25)


def test_steering_is_no_faster_than_the_client_wants():
    target = Target(steer=0.5, steer_speed=1.0, speed=1.0)
    control = Ackermann(target).control(AT_REST, Gains(), TICK)
    assert control.steer * LOCK == pytest.approx(1.0 * TICK)


def test_backwards_begins_at_rest_and_a_moving_vehicle_is_stopped_first():
    backwards = Ackermann(Target(speed=-3.0))
    moving = backwards.control(Seen(5.0, 0.0, LOCK), Gains(speed_kd=0.0, accel_kd=0.0), TICK)
    assert moving.brake > 0.0
    assert not moving.reverse
    resting = Ackermann(Target(speed=-3.0)).control(AT_REST, Gains(), TICK)
    assert resting.reverse
    assert resting.throttle > 0.0


@pytest.mark.ci
def test_the_controller_reaches_its_speed_and_a_pedal_ends_it():
    world, car = car_in_the_calm()
    vehicle = world.vehicle(car)
    vehicle.make_for(Target(speed=24.0))
    for _ in range(1200):
        world.tick()
    assert vehicle.velocity.x == pytest.approx(24.0, abs=1.0)
    vehicle.drive(Control(brake=1.0))
    for _ in range(200):
        world.tick()
    assert vehicle.velocity.x == 0.0


def test_a_velocity_is_kept_in_the_axes_of_the_vehicle_until_it_is_released():
    world, car = car_in_the_calm()
    vehicle = world.vehicle(car)
    enable_actor_constant_velocity(world, car, Vector(12.0, 0.5, 0.0))
    vehicle.drive(Control(brake=1.0))
    for _ in range(20):
        world.tick()
    assert vehicle.forward_speed == pytest.approx(12.0, abs=1e-3)
    # Sliding sideways turns it meanwhile.
    assert math.hypot(*vehicle.velocity) == pytest.approx(math.hypot(12.0, 0.5), abs=1e-3)
    disable_actor_constant_velocity(world, car)
    for _ in range(100):
        world.tick()
    assert vehicle.velocity == Vector(0.0, 0.0, 0.0)


def test_an_angular_impulse_turns_by_impulse_over_inertia():
    world, car = car_in_the_calm()
    inertia = world.vehicle(car).body["yaw_inertia"]
    # 10 degrees/s clockwise, in CARLA's kg cm^2.
    add_actor_angular_impulse(world, car, Vector(0.0, 0.0, 10.0 * inertia * 1e4))
    assert math.degrees(world.fleet.motion(car).yaw_rate) == pytest.approx(-10.0, rel=1e-4)


def test_a_torque_acts_in_the_next_tick_and_not_after():
    turned: list[float] = []
    for torque in (0.0, 4e8):
        world, car = car_in_the_calm()
        add_actor_torque(world, car, Vector(0.0, 0.0, torque))
        world.tick()
        turned.append(world.vehicle(car).turning)
        assert world.fleet[car].torque == 0.0
    assert turned[1] > turned[0] + 0.5


@pytest.mark.parametrize("push", [add_actor_impulse_at_location, add_actor_force_at_location])
def test_what_acts_on_the_right_rear_corner_forwards_turns_to_the_left(push: object):
    world, car = car_in_the_calm()
    where = world.vehicle(car).pose.location
    push(world, car, Vector(2000.0, 0.0, 0.0), where._replace(y=where.y + 0.8))  # type: ignore[operator]
    if push is add_actor_force_at_location:
        assert world.fleet[car].torque == pytest.approx(0.8 * 2000.0, rel=1e-3)
    else:
        inertia = world.vehicle(car).body["yaw_inertia"]
        assert world.fleet.motion(car).yaw_rate == pytest.approx(0.8 * 2000.0 / inertia, rel=1e-3)


def test_a_heavier_car_with_the_same_engine_gains_speed_more_slowly():
    gained: list[float] = []
    for times in (1.0, 2.0):
        world, car = car_in_the_calm()
        vehicle = world.vehicle(car)
        now = physics_control(world, vehicle)
        apply_physics_control(world, car, now._replace(mass=times * now.mass))
        assert physics_control(world, vehicle).mass == pytest.approx(times * now.mass)
        world.set_velocity(car, Vector(25.0, 0.0, 0.0))
        vehicle.drive(Control(throttle=1.0))
        for _ in range(20):
            world.tick()
        drag = 0.5 * 1.2 * vehicle.body["drag_area"] * 25.5**2 / vehicle.body["mass"]
        gained.append(vehicle.velocity.x - 25.0 + drag)
    assert gained[1] == pytest.approx(0.5 * gained[0], rel=0.15)


def test_drag_and_steering_come_back_as_they_were_set():
    world, car = car_in_the_calm()
    now = physics_control(world, world.vehicle(car))
    wheels = tuple(
        one._replace(max_steer_angle=35.0 if k < 2 else 0.0) for k, one in enumerate(now.wheels)
    )
    curve = ((0.0, 1.0), (100.0, 0.5))
    wanted = now._replace(drag_coefficient=0.9, wheels=wheels, steering_curve=curve)
    apply_physics_control(world, car, wanted)
    found = physics_control(world, world.vehicle(car))
    assert found.drag_coefficient == pytest.approx(0.9)
    assert found.steering_curve == curve
    assert [one.max_steer_angle for one in found.wheels] == pytest.approx([35.0, 35.0, 0.0, 0.0])


def test_what_our_bodies_do_not_have_is_named_and_the_rest_is_done():
    world, car = car_in_the_calm()
    now = physics_control(world, world.vehicle(car))
    wheels = tuple(one._replace(tire_friction=1.0) for one in now.wheels)
    wanted = now._replace(mass=2000.0, max_rpm=9000.0, wheels=wheels)
    with pytest.raises(Refused, match="max_rpm, tire_friction"):
        apply_physics_control(world, car, wanted)
    assert world.vehicle(car).body["mass"] == 2000.0


@pytest.mark.parametrize("change", [{"mass": -1.0}, {"mass": 1e9}, {"steering_curve": ()}])
def test_bodies_that_cannot_be_are_refused(change: dict[str, object]):
    world, car = car_in_the_calm()
    before = dict(world.vehicle(car).body)
    now = physics_control(world, world.vehicle(car))
    with pytest.raises(Refused, match="out of range"):
        apply_physics_control(world, car, now._replace(**change))  # type: ignore[arg-type]
    assert world.vehicle(car).body == before
