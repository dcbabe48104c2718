"""The calls that scripts of others make, through the genuine client of CARLA 0.9.16.

Each test makes the calls of one kind of script, in its order: CARLA's example of traffic, scenarios
of ScenarioRunner, and scripts that overtake on their own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.support.carla import Address, ask, headless_server, needs_wheel, stopped_by_signals

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = [
    needs_wheel,
    stopped_by_signals,
]


@pytest.fixture(scope="module")
def server() -> Iterator[Address]:
    with headless_server("--map", "town06", "--map", "motorway") as address:
        yield address


def test_a_script_that_fills_an_asynchronous_world_with_traffic(server: Address):
    found = ask(
        server,
        """
        from carla.command import DestroyActor, FutureActor, SetAutopilot, SpawnActor
        manager = client.get_trafficmanager(int(sys.argv[2]))
        manager.set_global_distance_to_leading_vehicle(2.5)
        manager.set_random_device_seed(3)
        world.apply_settings(world.get_settings())
        library = world.get_blueprint_library()
        walkers = [one for one in library.filter("walker.pedestrian.*")
                   if int(one.get_attribute("generation")) == 2]
        library.find("controller.ai.walker")
        cars = [one for one in library.filter("vehicle.*")
                if one.get_attribute("base_type") == "car"]
        batch = []
        for k, point in enumerate(world.get_map().get_spawn_points()[::20][:20]):
            blueprint = cars[k % len(cars)]
            blueprint.set_attribute("color", blueprint.get_attribute("color").recommended_values[0])
            blueprint.set_attribute("role_name", "autopilot")
            batch.append(SpawnActor(blueprint, point).then(
                SetAutopilot(FutureActor, True, manager.get_port())))
        answers = client.apply_batch_sync(batch, True)
        ids = [answer.actor_id for answer in answers if not answer.error]
        for actor in world.get_actors(ids):
            manager.update_vehicle_lights(actor, True)
        places = [world.get_random_location_from_navigation() for _ in range(3)]
        nobody = client.apply_batch_sync([SpawnActor(walkers[0], carla.Transform())], True)
        manager.global_percentage_speed_difference(30.0)
        actors, fastest = world.get_actors(ids), 0.0
        for _ in range(1000):
            world.wait_for_tick()
            fastest = max(actor.get_velocity().length() for actor in actors)
            if fastest > 2.0:
                break
        client.apply_batch([DestroyActor(one) for one in ids[:10]])
        for _ in range(20):
            world.wait_for_tick()
        left = len(world.get_actors().filter("vehicle.*"))
        client.apply_batch_sync([DestroyActor(one) for one in ids[10:]])
        print(json.dumps([len(ids), places, nobody[0].error, fastest, left]))
        manager.shut_down()
        """,
    )
    spawned, places, walker, fastest, left = found
    assert (spawned, places, left) == (20, [None] * 3, 10)
    assert walker == "this headless server has no walkers"
    assert fastest > 2.0


def test_a_scenario_whose_actors_wait_underground_and_are_then_put_on_the_road(server: Address):
    found = ask(
        server,
        """
        world = client.load_world("motorway")
        synchronous()
        manager = client.get_trafficmanager(int(sys.argv[2]))
        manager.set_random_device_seed(0)
        manager.set_synchronous_mode(True)
        place, library = world.get_map(), world.get_blueprint_library()
        world.set_weather(carla.WeatherParameters(sun_altitude_angle=75.0))
        world.get_actors().filter("*traffic_light*")
        world.get_lightmanager().get_all_lights()
        start = place.get_spawn_points()[3]
        hero = library.filter("vehicle.lincoln.mkz_2017")[0]
        hero.set_attribute("role_name", "hero")
        ego = world.try_spawn_actor(hero, start)
        ahead = place.get_waypoint(start.location).next(40.0)[0].transform
        hidden = carla.Transform(carla.Location(ahead.location.x, ahead.location.y, -500.0),
                                 ahead.rotation)
        other = world.try_spawn_actor(library.find("vehicle.tesla.model3"), hidden)
        other.set_simulate_physics(False)
        events = []
        sensor = world.spawn_actor(
            library.find("sensor.other.collision"), carla.Transform(), attach_to=ego)
        sensor.listen(events.append)
        world.tick()
        depth = other.get_location().z
        ahead.location.z += 1.0
        other.set_transform(ahead)
        other.set_simulate_physics(True)
        other.set_target_velocity(carla.Vector3D())
        other.set_target_angular_velocity(carla.Vector3D())
        world.tick()
        ego.enable_constant_velocity(carla.Vector3D(x=12.0))
        other.apply_control(carla.VehicleControl(throttle=0.7))
        boxes = [one.bounding_box.extent.x for one in (ego, other)]
        for step in range(100):
            if step == 20:
                other.set_autopilot(True, manager.get_port())
                manager.force_lane_change(other, True)
            world.tick()
        ego.disable_constant_velocity()
        gap = ego.get_location().distance(other.get_location())
        ego.apply_control(carla.VehicleControl(brake=1.0))
        for _ in range(40):
            world.tick()
        speed = ego.get_velocity().length()
        sensor.stop()
        gone = [one.destroy() for one in (sensor, other, ego)]
        world.tick()
        print(json.dumps([depth, min(boxes), gap, speed, gone, len(events)]))
        manager.shut_down()
        """,
    )
    depth, box, gap, speed, gone, _ = found
    assert depth == -500.0
    assert box > 1.0
    assert gap < 200.0
    assert speed == 0.0
    assert gone == [True] * 3


@pytest.mark.ci
def test_a_script_that_overtakes_by_itself_and_changes_its_camera_in_every_step(server: Address):
    found = ask(
        server,
        """
        world = client.load_world("Town06")
        synchronous()
        library, place = world.get_blueprint_library(), world.get_map()
        slow = world.spawn_actor(library.filter("bmw")[0], at(330.0, 244.65))
        ego = world.spawn_actor(library.filter("model3")[0], at(300.0, 244.65))
        slow.set_light_state(carla.VehicleLightState.LowBeam)
        slow.set_autopilot(False, int(sys.argv[2]))
        physics = ego.get_physics_control()
        physics.use_sweep_wheel_collision = True
        ego.apply_physics_control(physics)
        lens = library.find("sensor.camera.rgb")
        lens.set_attribute("image_size_x", "64")
        lens.set_attribute("image_size_y", "36")
        behind, pictures = carla.Transform(carla.Location(x=-5.0, z=3.0)), []
        camera = world.spawn_actor(lens, behind, attach_to=ego)
        camera.listen(pictures.append)
        world.tick()
        slow.set_target_velocity(carla.Vector3D(x=6.0))
        ego.set_target_velocity(carla.Vector3D(x=14.0))
        lanes = []
        for step in range(240):
            world.tick()
            slow.enable_constant_velocity(carla.Vector3D(x=6.0))
            lead = ego.get_location().x - slow.get_location().x
            here = place.get_waypoint(ego.get_location())
            lanes.append(here.lane_id)
            lane = 241.15 if -25.0 < lead < 12.0 else 244.65
            where, yaw = ego.get_location(), ego.get_transform().rotation.yaw
            wanted = max(min(1.5 * (lane - where.y), 12.0), -12.0)
            speed = ego.get_velocity().length()
            ego.apply_control(carla.VehicleControl(
                throttle=max(min(0.3 * (14.0 - speed), 1.0), 0.0), steer=0.015 * (wanted - yaw)))
            world.debug.draw_line(where, where, thickness=0.1, life_time=0.1)
            if step % 20 == 0:
                camera.stop()
                camera.destroy()
                camera = world.spawn_actor(lens, behind, attach_to=ego)
                camera.listen(pictures.append)
        print(json.dumps([lead, sorted(set(lanes)), lanes[0] == lanes[-1], len(pictures) > 100]))
        """,
    )
    lead, lanes, is_back, has_pictures = found
    assert lead > 20.0
    assert len(lanes) == 2
    assert is_back
    assert has_pictures
