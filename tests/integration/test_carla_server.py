"""The genuine client of CARLA 0.9.16 on the headless server."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest
from tests.support.carla import (
    PROLOGUE,
    Address,
    ask,
    free_port,
    headless_server,
    needs_wheel,
    stopped_by_signals,
)

pytestmark = [
    needs_wheel,
    stopped_by_signals,
]


@pytest.mark.ci
def test_it_is_ready_within_five_seconds():
    before = os.times()
    with headless_server():
        pass
    after = os.times()
    # Processor time of the process that has ended: other work on the machine does not lengthen it.
    spent = after.children_user + after.children_system
    assert 0.1 < spent - before.children_user - before.children_system < 5.0


def test_a_client_finds_its_own_version_and_the_road_of_the_study(server: Address):
    found = ask(
        server,
        """
        place = world.get_map()
        here = place.get_waypoint(carla.Location(351.0, 251.6, 0.0))
        print(json.dumps({
            "versions": [client.get_client_version(), client.get_server_version()],
            "map": place.name, "spawn_points": len(place.get_spawn_points()),
            "lane": here.lane_id, "width": here.lane_width, "road": here.road_id,
            "marks": [str(here.left_lane_marking.type), str(here.right_lane_marking.type)],
            "vehicles": len(world.get_blueprint_library().filter("vehicle.*")),
        }))
        """,
    )
    # Frame 70 of the study: lane -7 of road 40, a solid line right and a broken one left.
    assert found == {
        "versions": ["0.9.16", "0.9.16"],
        "map": "Carla/Maps/Town06",
        "spawn_points": 500,
        "lane": -7,
        "width": 3.5,
        "road": 40,
        "marks": ["Broken", "Solid"],
        "vehicles": 41,
    }


def test_time_stands_still_between_ticks_and_advances_by_them(server: Address):
    found = ask(
        server,
        """
        synchronous(0.04)
        first = world.tick()
        before = world.get_snapshot().timestamp
        frames = [world.tick() for _ in range(5)]
        after = world.get_snapshot().timestamp
        print(json.dumps([first, frames, after.elapsed_seconds - before.elapsed_seconds,
                          after.delta_seconds]))
        """,
    )
    first, frames, elapsed, delta = found
    assert frames == [first + k for k in range(1, 6)]
    assert elapsed == pytest.approx(0.2)
    assert delta == pytest.approx(0.04)


def test_weather_presets_come_back_as_they_were_set(server: Address):
    found = ask(
        server,
        """
        same = {}
        for name in ("HardRainNight", "ClearSunset", "SoftRainNoon"):
            wanted = getattr(carla.WeatherParameters, name)
            world.set_weather(wanted)
            same[name] = world.get_weather() == wanted
        print(json.dumps(same))
        """,
    )
    assert all(found.values())


@pytest.mark.ci
def test_rain_makes_the_way_to_a_stop_longer(server: Address):
    found = ask(
        server,
        """
        found = []
        for name in ("ClearNoon", "HardRainNoon"):
            world = client.reload_world()
            synchronous()
            weather = getattr(carla.WeatherParameters, name)
            weather.wind_intensity = 0.0
            world.set_weather(weather)
            car = spawn("vehicle.audi.a2", 300.0, 244.65)
            world.tick()
            car.set_target_velocity(carla.Vector3D(x=30.0))
            car.apply_control(carla.VehicleControl(brake=1.0))
            start = car.get_location().x
            for _ in range(300):
                world.tick()
                if car.get_velocity().length() == 0.0:
                    break
            found.append(car.get_location().x - start)
        print(json.dumps(found))
        """,
    )
    dry, wet = found
    # A braking force of mass times 9 m/s^2 stops from 30 m/s within 50 m.
    assert dry == pytest.approx(30.0**2 / (2.0 * 9.0), abs=3.0)
    assert wet > 1.4 * dry


@pytest.mark.ci
def test_vehicles_that_collide_tell_both_sensors_and_exchange_momentum(server: Address):
    found = ask(
        server,
        """
        import time
        synchronous()
        front = spawn("vehicle.audi.a2", 360.0, 244.65)
        rear = spawn("vehicle.audi.tt", 330.0, 244.65)
        library, events, sensors = world.get_blueprint_library(), [], []
        for car in (front, rear):
            sensor = world.spawn_actor(
                library.find("sensor.other.collision"), carla.Transform(), attach_to=car)
            sensors.append(sensor)
            sensor.listen(lambda event: events.append(
                [event.actor.id, event.other_actor.id, event.frame, event.normal_impulse.x]))
        world.tick()
        rear.set_target_velocity(carla.Vector3D(x=20.0))
        for _ in range(60):
            world.tick()
        time.sleep(0.3)
        print(json.dumps({"events": events, "ids": [front.id, rear.id],
                          "speeds": [front.get_velocity().x, rear.get_velocity().x]}))
        """,
    )
    front, rear = found["ids"]
    own: dict[tuple[int, int], list[float]] = {}
    for event in sorted(found["events"], key=lambda one: one[2]):
        own.setdefault((event[0], event[1]), event)
    assert set(own) == {(front, rear), (rear, front)}
    assert own[front, rear][2] == own[rear, front][2]  # In the same frame,
    assert own[front, rear][3] == pytest.approx(-own[rear, front][3], rel=1e-4)  # equal, opposite.
    assert own[front, rear][3] > 5_000.0
    assert found["speeds"][0] > found["speeds"][1]


def test_what_overlaps_is_not_spawned_and_what_is_destroyed_is_gone(server: Address):
    found = ask(
        server,
        """
        synchronous()
        car = spawn("vehicle.audi.a2", 360.0, 244.65)
        try:
            spawn("vehicle.audi.tt", 362.0, 244.65)
            refused = ""
        except RuntimeError as error:
            refused = str(error)
        world.tick()
        there = len(world.get_actors().filter("vehicle.*"))
        car.destroy()
        world.tick()
        print(json.dumps([refused, there, len(world.get_actors().filter("vehicle.*"))]))
        """,
    )
    assert "collision at spawn" in found[0]
    assert found[1:] == [1, 0]


def test_a_camera_sends_a_picture_of_each_tick_with_the_cars_in_it(server: Address):
    found = ask(
        server,
        """
        import queue
        synchronous()
        car = spawn("vehicle.audi.a2", 330.0, 244.65)
        red = world.get_blueprint_library().find("vehicle.tesla.model3")
        red.set_attribute("color", "255,0,0")
        world.spawn_actor(red, at(342.0, 244.65))
        lens = world.get_blueprint_library().find("sensor.camera.rgb")
        lens.set_attribute("image_size_x", "320")
        lens.set_attribute("image_size_y", "180")
        eye = carla.Transform(carla.Location(x=2.0, z=1.6))
        camera, pictures = world.spawn_actor(lens, eye, attach_to=car), queue.Queue()
        camera.listen(pictures.put)
        frames = []
        for _ in range(3):
            frame = world.tick()
            picture = pictures.get(timeout=10.0)
            frames.append(picture.frame == frame)
        data = bytes(picture.raw_data)
        reddish = sum(data[k + 2] > 120 and data[k] < 40 and data[k + 1] < 40
                      for k in range(0, len(data), 4))
        print(json.dumps([frames, picture.width, picture.height, len(data), reddish]))
        camera.stop()
        """,
    )
    frames, width, height, size, reddish = found
    assert frames == [True] * 3
    assert (width, height, size) == (320, 180, 320 * 180 * 4)
    assert reddish > 200


@pytest.mark.ci
def test_crossing_a_line_is_noticed_by_the_sensor_in_the_client(server: Address):
    found = ask(
        server,
        """
        import time
        synchronous()
        car, crossed = spawn("vehicle.audi.a2", 330.0, 244.65), []
        sensor = world.spawn_actor(
            world.get_blueprint_library().find("sensor.other.lane_invasion"),
            carla.Transform(), attach_to=car)
        sensor.listen(
            lambda event: crossed.extend(str(x.type) for x in event.crossed_lane_markings))
        world.tick()
        car.set_target_velocity(carla.Vector3D(x=20.0))
        car.apply_control(carla.VehicleControl(throttle=0.4, steer=0.02))
        for _ in range(60):
            world.tick()
        time.sleep(0.3)
        print(json.dumps(crossed))
        sensor.stop()
        """,
    )
    assert "Broken" in found


MANAGERS = """
    import hashlib
    synchronous()
    managers = [client.get_trafficmanager(int(sys.argv[2]) + k) for k in (0, 1)]
    for each in managers:
        each.set_synchronous_mode(True)
        each.set_random_device_seed(7)
    names = ["vehicle.tesla.model3", "vehicle.mini.cooper_s", "vehicle.carlamotors.european_hgv",
             "vehicle.yamaha.yzf", "vehicle.diamondback.century", "vehicle.mercedes.sprinter"]
    cars = [spawn(name, 200.0 + 25.0 * k, 237.65 + 3.5 * (k % 5)) for k, name in enumerate(names)]
    world.tick()
    for k, car in enumerate(cars):
        car.set_autopilot(True, managers[k % 2].get_port())
        managers[k % 2].set_desired_speed(car, 25.0 + 6.0 * k)
        managers[k % 2].auto_lane_change(car, k % 3 == 0)
    trace = hashlib.sha256()
    for step in range(200):
        if step == 60:
            managers[0].force_lane_change(cars[0], True)
        world.tick()
        snapshot = world.get_snapshot()
        for car in cars:
            seen = snapshot.find(car.id)
            where, speed = seen.get_transform(), seen.get_velocity()
            trace.update(repr((where.location.x, where.location.y, where.rotation.yaw,
                               speed.x)).encode())
    lane = world.get_map().get_waypoint(cars[0].get_location()).lane_id
    print(json.dumps([trace.hexdigest(), lane, cars[1].get_velocity().length() * 3.6]))
    for each in managers:
        each.shut_down()
"""


@pytest.mark.ci
def test_two_traffic_managers_drive_the_same_way_twice(server: Address):
    first, second = ask(server, MANAGERS), ask(server, MANAGERS)
    assert first == second
    _, lane, speed = first
    assert lane == -4  # It began in the leftmost lane, -3, and was sent to the right.
    assert speed == pytest.approx(31.0, abs=1.5)


@pytest.mark.ci
def test_a_client_that_is_killed_leaves_its_traffic_manager_port_to_the_next(server: Address):
    port = str(free_port())
    code = PROLOGUE + (
        "manager = client.get_trafficmanager(int(sys.argv[2]))\n"
        "print('here', flush=True)\nimport time; time.sleep(60)"
    )
    command = [sys.executable, "-c", code, str(server.port), port]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "here\n"
        process.send_signal(signal.SIGKILL)
    begin = time.monotonic()
    script = f"client.get_trafficmanager({port}); print(1)"
    assert ask(server, script) == 1
    assert time.monotonic() - begin < 5.0


@pytest.mark.ci
def test_maps_are_loaded_by_name_and_unknown_ones_refused(server: Address):
    found = ask(
        server,
        """
        names = client.get_available_maps()
        motorway = client.load_world("motorway").get_map().name
        try:
            client.load_world("Town99")
            refused = ""
        except RuntimeError as error:
            refused = str(error)
        print(json.dumps([names, motorway, refused, client.load_world("Town06").get_map().name]))
        """,
    )
    names, motorway, refused, back = found
    assert names == [f"/Game/Carla/Maps/{name}" for name in ("Town06", "motorway", "rural")]
    assert motorway.endswith("motorway")
    assert "Town99" in refused
    assert back.endswith("Town06")


@pytest.mark.ci
def test_an_opendrive_file_can_be_the_map(shared_data):
    path = shared_data / "opendrive" / "esmini_curve_r100.xodr"
    with headless_server("--map", str(path)) as address:
        found = ask(
            address,
            """
            synchronous()
            place = world.get_map()
            start = place.get_spawn_points()[0]
            car = world.spawn_actor(world.get_blueprint_library().find("vehicle.audi.a2"), start)
            for _ in range(5):
                world.tick()
            print(json.dumps([place.name, car.get_location().distance(start.location)]))
            """,
        )
    assert found[0].endswith("esmini_curve_r100")
    assert found[1] < 0.5


@pytest.mark.ci
def test_a_map_can_be_sent_by_the_client(server: Address, shared_data):
    path = shared_data / "opendrive" / "esmini_straight_500m.xodr"
    found = ask(
        server,
        f"""
        text = open({str(path)!r}, encoding="utf-8").read()
        other = client.generate_opendrive_world(text)
        name = other.get_map().name
        print(json.dumps([name, client.load_world("Town06").get_map().name]))
        """,
    )
    assert found == ["Carla/Maps/OpenDriveMap", "Carla/Maps/Town06"]
