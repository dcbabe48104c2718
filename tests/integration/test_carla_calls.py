"""Calls of the scripts of others through the genuine client of CARLA 0.9.16."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.support.carla import (
    Address,
    answer_of,
    ask,
    headless_server,
    needs_wheel,
    stopped_by_signals,
)

from overtaking.simulators.carla_server.maps import known_map

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = [
    needs_wheel,
    stopped_by_signals,
]


# --- actors that are gone ---


def test_the_box_of_an_actor_that_is_gone_is_empty(server: Address):
    zeros = [0.0, 0.0, 0.0]
    answer = answer_of(server.port, "get_actor_bounding_box", [[False], 9999])
    assert answer == [1, 1, None, [[1, [zeros, zeros, zeros, 0]]]]


def test_destroying_an_actor_twice_is_false_the_second_time(server: Address):
    found = ask(
        server,
        """
        car = spawn("vehicle.audi.a2", 360.0, 244.65)
        again = world.get_actor(car.id)
        print(json.dumps([car.destroy(), again.destroy()]))
        """,
    )
    assert found == [True, False]


@pytest.mark.ci
def test_a_traffic_manager_outlives_vehicles_that_come_and_go(server: Address):
    found = ask(
        server,
        """
        manager = client.get_trafficmanager(int(sys.argv[2]))
        car = spawn("vehicle.tesla.model3", 300.0, 241.15)
        car.set_autopilot(True, manager.get_port())
        blueprint = world.get_blueprint_library().find("vehicle.audi.a2")
        spawns = [carla.command.SpawnActor(blueprint, at(320.0 + 10.0 * k, 251.65))
                  for k in range(40)]
        for _ in range(10):
            others = [one.actor_id for one in client.apply_batch_sync(spawns)]
            world.wait_for_tick()
            # The manager still has them in its snapshot when they are gone.
            client.apply_batch_sync([carla.command.DestroyActor(one) for one in others])
            world.wait_for_tick()
        print(json.dumps([len(others), car.is_alive]))
        manager.shut_down()
        """,
    )
    assert found == [40, True]


# --- calls that the client sends without waiting ---


def test_a_constant_velocity_is_kept_and_let_go_of(server: Address):
    found = ask(
        server,
        """
        synchronous()
        car = spawn("vehicle.audi.a2", 300.0, 244.65)
        world.tick()
        car.enable_constant_velocity(carla.Vector3D(x=14.0))
        start = car.get_location().x
        for _ in range(40):
            world.tick()
        kept = [car.get_velocity().x, car.get_location().x - start]
        car.disable_constant_velocity()
        car.apply_control(carla.VehicleControl(brake=1.0))
        for _ in range(80):
            world.tick()
        print(json.dumps([*kept, car.get_velocity().length()]))
        """,
    )
    speed, way, rest = found
    assert speed == pytest.approx(14.0, abs=0.01)
    assert way == pytest.approx(28.0, abs=0.3)
    assert rest == 0.0


@pytest.mark.ci
def test_ackermann_control_makes_for_its_speed_with_the_gains_of_the_client(server: Address):
    found = ask(
        server,
        """
        synchronous()
        car = spawn("vehicle.tesla.model3", 300.0, 244.65)
        world.tick()
        defaults = car.get_ackermann_controller_settings()
        gains = carla.AckermannControllerSettings(
            speed_kp=0.3, speed_ki=0.0, speed_kd=0.25, accel_kp=0.02, accel_ki=0.0, accel_kd=0.01)
        car.apply_ackermann_controller_settings(gains)
        car.apply_ackermann_control(carla.VehicleAckermannControl(speed=8.0, acceleration=2.0))
        for _ in range(400):
            world.tick()
        same = car.get_ackermann_controller_settings() == gains
        print(json.dumps([defaults.speed_kp, defaults.accel_kp, same, car.get_velocity().x]))
        """,
    )
    assert found[:3] == [pytest.approx(0.15), pytest.approx(0.01), True]
    assert found[3] == pytest.approx(8.0, abs=1.0)


def test_physics_control_comes_back_as_far_as_the_server_drives_with_it(server: Address):
    found = ask(
        server,
        """
        synchronous()
        car = spawn("vehicle.audi.a2", 300.0, 244.65)
        world.tick()
        physics = car.get_physics_control()
        before = physics.mass
        physics.mass, physics.max_rpm = 2.0 * before, 9000.0
        wheels = physics.wheels
        for wheel in wheels[:2]:
            wheel.max_steer_angle = 40.0
        physics.wheels = wheels
        car.apply_physics_control(physics)
        now = car.get_physics_control()
        print(json.dumps([now.mass / before, now.wheels[0].max_steer_angle, now.max_rpm]))
        """,
    )
    assert found == [pytest.approx(2.0), pytest.approx(40.0), 5800.0]


def test_pushes_and_torques_turn_a_car(server: Address):
    found = ask(
        server,
        """
        synchronous()
        turned, moment = [], carla.Vector3D(z=6e8)
        # `Actor.add_torque` of this client sends an angular impulse; the command sends a torque.
        for deed in (lambda: car.add_angular_impulse(moment), lambda: car.add_torque(moment),
                     lambda: client.apply_batch([carla.command.ApplyTorque(car, moment)])):
            car = spawn("vehicle.audi.a2", 300.0 + 50.0 * len(turned), 244.65)
            world.tick()
            car.set_target_velocity(carla.Vector3D(x=10.0))
            deed()
            world.tick()
            turned.append(car.get_angular_velocity().z)
        print(json.dumps(turned))
        """,
    )
    assert found[0] == pytest.approx(found[1], rel=0.01)
    assert found[0] > 10.0
    assert 0.1 < found[2] < 0.2 * found[0]


def test_a_call_that_is_not_offered_says_so_where_the_client_waits(server: Address):
    found = ask(
        server,
        """
        car, errors = spawn("vehicle.audi.a2", 300.0, 244.65), []
        for deed in (lambda: car.set_collisions(False), car.get_component_names):
            try:
                deed()
            except RuntimeError as error:
                errors.append(str(error))
        print(json.dumps(errors))
        """,
    )
    assert found == [
        "set_actor_collisions: the headless server does not offer this call",
        "get_actor_component_names: the headless server does not offer this call",
    ]


# --- towns, rays and telemetry ---


@pytest.mark.ci
def test_several_maps_are_offered_and_loaded_by_their_names(tmp_path: Path):
    road = known_map("town06").opendrive
    for name in ("Town98", "Town99"):
        (tmp_path / f"{name}.xodr").write_text(road, encoding="utf-8")
    maps = [part for name in ("Town98", "Town99") for part in ("--map", f"{tmp_path / name}.xodr")]
    with headless_server(*maps, "--map", "motorway") as address:
        found = ask(
            address,
            """
            first, names = world.get_map().name, client.get_available_maps()
            second = client.load_world("Town99").get_map().name
            third = client.load_world("motorway").get_map().name
            try:
                refused = client.load_world("Town01")
            except RuntimeError as error:
                refused = str(error)
            print(json.dumps([first, names, second, third, refused]))
            """,
        )
    first, names, second, third, refused = found
    assert [one.rsplit("/", 1)[-1] for one in (first, second, third)] == [
        "Town98",
        "Town99",
        "motorway",
    ]
    assert {name.rsplit("/", 1)[-1] for name in names} == {
        "Town06",
        "Town98",
        "Town99",
        "motorway",
        "rural",
    }
    assert "Town98 or Town99 or motorway or rural, got 'Town01'" in refused


@pytest.mark.ci
def test_rays_and_telemetry_reach_the_genuine_client(server: Address):
    found = ask(
        server,
        """
        synchronous()
        car = spawn("vehicle.audi.a2", 300.0, 244.65)
        world.tick()
        car.set_target_velocity(carla.Vector3D(x=15.0))
        car.apply_control(carla.VehicleControl(throttle=0.4, steer=0.1))
        for _ in range(10):
            world.tick()
        where, told = car.get_location(), car.get_telemetry_data()
        ground = world.ground_projection(carla.Location(200.0, 244.65, 5.0), 10.0)
        hits = world.cast_ray(carla.Location(where.x - 9.0, where.y, 0.5),
                              carla.Location(where.x + 9.0, where.y, 0.5))
        nothing = world.project_point(
            carla.Location(200.0, 244.65, 5.0), carla.Vector3D(z=1.0), 10.0)
        wheels = [car.get_wheel_steer_angle(getattr(carla.VehicleWheelLocation, name))
                  for name in ("FL_Wheel", "FR_Wheel", "BL_Wheel", "BR_Wheel")]
        print(json.dumps({
            "ground": [ground.location.z, str(ground.label)], "hits": [str(x.label) for x in hits],
            "nothing": nothing is None, "wheels": wheels, "throttle": told.throttle,
            "speed": told.speed - car.get_velocity().length(), "loads": len(told.wheels)}))
        """,
    )
    assert found["ground"] == [0.0, "Roads"]
    assert found["hits"] == ["Car"]
    assert found["nothing"]
    assert found["throttle"] == pytest.approx(0.4)
    assert found["speed"] == pytest.approx(0.0, abs=0.2)
    assert found["loads"] == 4
    front, also_front, *rear = found["wheels"]
    # A tenth of the lock, which is 70 degrees at rest and 0.85 of it at 40 km/h or more.
    assert 5.5 < front == also_front < 7.0
    assert rear == [0.0, 0.0]
