"""How the headless server's vehicles move: against closed formulas of mechanics."""

from __future__ import annotations

import math

import numpy as np
import pytest

from overtaking._core import MAX_VEHICLES
from overtaking.knowledge.carla_catalogue import carla_vehicles, weather_presets
from overtaking.model.known_roads import known_road
from overtaking.simulators.carla_server.arguments import Control
from overtaking.simulators.carla_server.bodies import Nature, body_of
from overtaking.simulators.carla_server.fleet import MAX_REVERSE_SPEED, Fleet
from overtaking.simulators.carla_server.motion import GroundFrame, PlanarMotion, boxes_overlap
from overtaking.world.constants import model_constants

TICK = 0.05
GRAVITY = 9.81
CAR = "vehicle.audi.a2"
TRUCK = "vehicle.carlamotors.european_hgv"


def fleet_in(**changes: float) -> Fleet:
    """An empty fleet on the road of the study in still, dry air, or what differs."""
    weather = (
        dict(weather_presets()["ClearNoon"].carla_fields()) | {"wind_intensity": 0.0} | changes
    )
    road = known_road("town06").extend_to(3000.0)
    return Fleet(GroundFrame(road, shelters_wind=True), tuple(weather.values()), Nature(1))


def at(s: float, d: float = -12.25, speed: float = 0.0, psi: float = 0.0) -> PlanarMotion:
    return PlanarMotion(s, d, psi, speed * math.cos(psi), speed * math.sin(psi), 0.0)


def drive(fleet: Fleet, seconds: float, **controls: Control) -> None:
    wanted = {int(name[1:]): control for name, control in controls.items()}
    for _ in range(round(seconds / TICK)):
        fleet.advance(TICK, wanted)


def test_full_throttle_gives_the_launch_acceleration_of_the_class():
    fleet = fleet_in()
    fleet.add(1, body_of(TRUCK), at(100.0))
    drive(fleet, 1.0, _1=Control(throttle=1.0))
    body = fleet[1].body
    rolling = body["rolling_resistance"] * GRAVITY
    expected = body["launch_accel"] - rolling
    assert fleet.motion(1).v_s == pytest.approx(expected, rel=0.03)


def test_full_throttle_of_a_car_is_held_back_by_traction_control():
    fleet = fleet_in()
    fleet.add(1, body_of(CAR), at(100.0))
    drive(fleet, 1.0, _1=Control(throttle=1.0))
    body = fleet[1].body
    # Front-wheel drive: the front axle's load less what acceleration moves to the rear.
    front = 1.0 - body["cg_to_front"] / body["wheelbase"]
    lift = body["cg_height"] / body["wheelbase"]
    # On dry roads up to 50 km/h, half-way between new (0.85) and worn tyres (1.0), see Bosch.
    grip = float(model_constants().traction_share) * 0.925
    rolling = body["rolling_resistance"] * GRAVITY
    expected = (grip * GRAVITY * front - rolling) / (1.0 + grip * lift)
    assert fleet.motion(1).v_s == pytest.approx(expected, rel=0.01)
    assert expected < body["launch_accel"] - rolling


def test_coasting_slows_by_drag_and_rolling_resistance():
    fleet = fleet_in()
    fleet.add(1, body_of(CAR), at(100.0, speed=30.0))
    drive(fleet, 1.0, _1=Control())
    body = fleet[1].body
    drag = 0.5 * 1.20 * body["drag_area"] * 29.7**2 / body["mass"]
    lost = drag + body["rolling_resistance"] * GRAVITY
    assert fleet.motion(1).v_s == pytest.approx(30.0 - lost, rel=0.002)


def test_brakes_stop_within_the_distance_of_their_deceleration_and_hold():
    fleet = fleet_in()
    fleet.add(1, body_of(CAR), at(100.0, speed=20.0))
    drive(fleet, 4.0, _1=Control(brake=1.0))
    stopped = fleet.motion(1)
    assert stopped.v_s == stopped.v_d == 0.0
    assert stopped.s - 100.0 == pytest.approx(20.0**2 / (2.0 * 9.0), rel=0.06)
    drive(fleet, 1.0, _1=Control(brake=1.0))
    assert fleet.motion(1) == stopped


def test_rain_makes_brakes_weaker():
    way: list[float] = []
    for rain in (0.0, 100.0):
        fleet = fleet_in(precipitation=rain, precipitation_deposits=rain)
        fleet.add(1, body_of(CAR), at(100.0, speed=30.0))
        drive(fleet, 12.0, _1=Control(brake=1.0))
        way.append(fleet.motion(1).s - 100.0)
    assert way[1] > 1.4 * way[0]


def test_a_side_wind_pushes_and_still_air_does_not():
    offset: list[float] = []
    for wind in (0.0, 100.0):
        fleet = fleet_in(wind_intensity=wind)
        fleet.add(1, body_of("vehicle.carlamotors.european_hgv"), at(100.0, speed=20.0))
        drive(fleet, 2.0, _1=Control(throttle=0.3))
        offset.append(fleet.motion(1).d + 12.25)
    assert offset[0] == pytest.approx(0.0, abs=1e-3)
    assert offset[1] > 0.05  # It blows to the left.


def test_steering_to_the_right_turns_on_the_circle_of_the_wheelbase():
    fleet = fleet_in()
    fleet.add(1, body_of(CAR), at(100.0, speed=4.0))
    control = Control(steer=0.1)
    drive(fleet, 0.5, _1=control)
    now = fleet.motion(1)
    speed = math.hypot(now.v_s, now.v_d)
    # Ackermann: yaw rate = v tan(delta) / wheelbase; the lock shrinks with speed.
    lock = math.radians(70.0) * np.interp(3.6 * speed, (0.0, 20.0), (1.0, 0.9))
    expected = speed * math.tan(0.1 * lock) / fleet[1].body["wheelbase"]
    assert now.yaw_rate == pytest.approx(-expected, rel=0.08)
    assert now.heading < 0.0


def test_a_motorcycle_leans_into_the_same_circle():
    fleet = fleet_in()
    fleet.add(1, body_of("vehicle.yamaha.yzf"), at(100.0, speed=10.0))
    drive(fleet, 3.0, _1=Control(steer=-0.02, throttle=0.1))
    now = fleet.motion(1)
    speed = math.hypot(now.v_s, now.v_d)
    lock = math.radians(70.0) * np.interp(3.6 * speed, (20.0, 60.0), (0.9, 0.8))
    expected = speed * math.tan(0.02 * lock) / fleet[1].body["wheelbase"]
    assert now.yaw_rate == pytest.approx(expected, rel=0.05)


def test_reverse_goes_backwards_slowly_and_only_from_rest():
    fleet = fleet_in()
    fleet.add(1, body_of(CAR), at(100.0, speed=5.0))
    back = Control(throttle=1.0, reverse=True)
    drive(fleet, 0.2, _1=back)
    assert fleet.motion(1).v_s > 0.0
    drive(fleet, 10.0, _1=back)
    assert fleet.motion(1).v_s == pytest.approx(-MAX_REVERSE_SPEED)
    drive(fleet, 3.0, _1=Control(brake=1.0))
    assert fleet.motion(1).v_s == 0.0


def test_a_contact_keeps_the_momentum_and_loses_energy():
    fleet = fleet_in()
    fleet.add(1, body_of(CAR), at(100.0, speed=20.0))
    fleet.add(2, body_of("vehicle.carlamotors.european_hgv"), at(115.0))
    masses = [fleet[k].body["mass"] for k in (1, 2)]
    before, touches = [0.0, 0.0], []
    while not touches:
        before = [fleet.motion(k).v_s for k in (1, 2)]
        touches = fleet.advance(TICK, {})
    after = [fleet.motion(k).v_s for k in (1, 2)]
    momentum = [sum(m * v for m, v in zip(masses, vs, strict=True)) for vs in (before, after)]
    energy = [sum(m * v * v for m, v in zip(masses, vs, strict=True)) for vs in (before, after)]
    assert momentum[1] == pytest.approx(momentum[0], rel=0.01)
    assert energy[1] < 0.6 * energy[0]
    assert {(t.own, t.other) for t in touches} == {(1, 2), (2, 1)}
    assert sum(t.impulse_s for t in touches) == pytest.approx(0.0, abs=1.0)


def test_contacts_are_found_between_vehicles_of_different_groups_of_the_engine():
    fleet = fleet_in()
    last = MAX_VEHICLES
    for k in range(last):
        fleet.add(k, body_of(CAR), at(100.0 + 20.0 * k))
    fleet.add(last, body_of(CAR), at(100.0 + 20.0 * (last - 1) - 8.0, speed=20.0))
    touches = []
    for _ in range(10):
        touches += fleet.advance(TICK, {})
    assert {(touch.own, touch.other) for touch in touches} == {(last - 1, last), (last, last - 1)}
    assert fleet.motion(last - 1).v_s > 5.0


def test_who_was_hit_can_still_be_driven():
    fleet = fleet_in()
    fleet.add(1, body_of(CAR), at(100.0, speed=5.0))
    fleet.add(2, body_of(CAR), at(105.0))
    drive(fleet, 5.0, _1=Control(brake=1.0), _2=Control(brake=1.0))
    place = fleet.motion(2).s
    drive(fleet, 3.0, _1=Control(brake=1.0), _2=Control(throttle=1.0))
    assert fleet.motion(2).s > place + 10.0


def test_a_vehicle_without_physics_stays_where_it_is_put():
    fleet = fleet_in(wind_intensity=100.0)
    fleet.add(1, body_of(CAR), at(100.0, speed=20.0))
    fleet[1].has_physics = False
    drive(fleet, 1.0, _1=Control(throttle=1.0))
    now = fleet.motion(1)
    assert (now.s, now.d, now.heading) == (100.0, -12.25, 0.0)


def test_a_force_acts_for_one_tick():
    fleet = fleet_in()
    fleet.add(1, body_of(CAR), at(100.0))
    fleet.force(1, 10_000.0, 0.0)
    fleet.advance(TICK, {})
    gained = fleet.motion(1).v_s
    assert gained == pytest.approx(10_000.0 / fleet[1].body["mass"] * TICK, rel=0.05)
    fleet.advance(TICK, {})
    assert fleet.motion(1).v_s < gained


def test_an_impulse_changes_the_velocity_at_once():
    fleet = fleet_in()
    fleet.add(1, body_of(CAR), at(100.0, speed=10.0))
    fleet.push(1, 0.0, 2_000.0)
    now = fleet.motion(1)
    assert now.v_d == pytest.approx(2_000.0 / fleet[1].body["mass"], rel=1e-3)
    assert now.v_s == pytest.approx(10.0, rel=1e-3)


def test_removing_one_leaves_the_others_as_they_are():
    fleet = fleet_in()
    for k in range(4):
        fleet.add(k, body_of(CAR), at(100.0 + 20.0 * k, speed=10.0 + k))
    drive(fleet, 0.5)
    before = fleet.motions()
    fleet.remove(1)
    assert list(fleet.motions()) == [0, 2, 3]
    assert fleet.motions() == {k: before[k] for k in (0, 2, 3)}


def test_the_same_commands_give_the_same_motion():
    found = []
    for _ in range(2):
        fleet = fleet_in(wind_intensity=80.0, precipitation=60.0)
        fleet.add(1, body_of(CAR), at(100.0, speed=25.0))
        fleet.add(2, body_of("vehicle.mercedes.sprinter"), at(130.0, speed=20.0))
        drive(fleet, 5.0, _1=Control(throttle=0.7, steer=0.01), _2=Control(throttle=0.3))
        found.append(fleet.motions())
    assert found[0] == found[1]


@pytest.mark.parametrize("delta", [0.01, 0.033, 0.05, 0.1])
def test_the_length_of_a_tick_changes_little(delta: float):
    fleet = fleet_in()
    fleet.add(1, body_of(CAR), at(100.0, speed=20.0))
    for _ in range(round(3.0 / delta)):
        fleet.advance(delta, {1: Control(throttle=0.5)})
    seconds = round(3.0 / delta) * delta
    assert fleet.motion(1).s - 100.0 == pytest.approx(20.0 * seconds + 4.0, abs=3.0)


def test_boxes_overlap_when_corners_do():
    body = body_of(CAR)
    length, width = body["length"], body["width"]
    here = at(0.0, 0.0)
    assert boxes_overlap(body, here, body, at(0.99 * length, 0.0))
    assert not boxes_overlap(body, here, body, at(1.01 * length, 0.0))
    assert not boxes_overlap(body, here, body, at(0.0, 1.01 * width))
    turned = at(0.5 * (length + width) + 0.1, 0.0, psi=math.pi / 2.0)
    assert not boxes_overlap(body, here, body, turned)


def test_every_blueprint_drives():
    fleet = fleet_in()
    for k, name in enumerate(carla_vehicles()):
        fleet.add(k, body_of(name), at(100.0 + 30.0 * k))
    fleet.advance(TICK, {k: Control(throttle=1.0) for k in fleet.motions()})
    for k in range(20):
        fleet.advance(TICK, {k: Control(throttle=1.0) for k in fleet.motions()})
    speeds = [motion.v_s for motion in fleet.motions().values()]
    assert min(speeds) > 0.5
    assert np.isfinite(speeds).all()
