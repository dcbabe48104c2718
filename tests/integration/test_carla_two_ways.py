"""Our drivers on CARLA's genuine client, on a road with two directions that bends and rises."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.bends import on
from tests.support.carla import ask, headless_server, needs_wheel, stopped_by_signals
from tests.support.two_way import pair, road
from tests.support.worlds import scenario

import overtaking as ot
from overtaking.simulators.carla.library import SERVER_VARIABLE

pytestmark = [pytest.mark.ci, needs_wheel]

BENDS = ((900.0, 0.0, 0.0), (300.0, 0.0, 1 / 300), (500.0, 1 / 300, 1 / 300))
HILLS = ((800.0, 0.0), (1100.0, 0.04), (1500.0, -0.03))


@pytest.mark.parametrize("grade", [(), HILLS], ids=["level", "hills"])
def test_vehicles_of_both_directions_drive_as_on_the_engine(
    grade: tuple[tuple[float, float], ...], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv(SERVER_VARIABLE, "headless")
    world = scenario(pair(250.0), road=on(road(), *BENDS, grade=grade), horizon=7.0)
    run, ours = (ot.simulate(world, simulator=name) for name in ("carla", "engine"))
    assert run.road.is_two_way
    frames = int(run.num_frames[0])
    assert frames == int(ours.num_frames[0])
    for slot in range(3):
        there, here = (
            {name: getattr(one.states, name)[0, slot, :frames] * 1e-3 for name in "sdxy"}
            for one in (run, ours)
        )
        np.testing.assert_allclose(there["s"], here["s"], atol=2.0)
        np.testing.assert_allclose(there["d"], here["d"], atol=0.5)
        x, y = run.road.to_world(there["s"], there["d"])
        np.testing.assert_allclose(there["x"], x, atol=2e-3)
        np.testing.assert_allclose(there["y"], y, atol=2e-3)
        turned = run.headings_and_origin[0][0, slot, :frames] * 1e-4
        way = np.pi if slot == 2 else 0.0
        assert np.abs(np.remainder(turned - way + np.pi, 2 * np.pi) - np.pi).max() < 0.12
    assert run.states.s[0, 2, -1] < run.states.s[0, 2, 0]
    lanes = run.states.lane[0, :, :frames]
    assert (lanes[1] == 0).all()
    assert (lanes[2] == 1).all()


@stopped_by_signals
def test_a_client_finds_both_directions_of_the_road_that_the_server_loads():
    with headless_server("--map", "rural") as server:
        answer = ask(
            server,
            """
            town = world.get_map()
            sides = [town.get_waypoint(carla.Location(1000.0, y, 0.0)) for y in (1.75, -1.75)]
            ahead = [side.next(50.0)[0].transform.location.x for side in sides]
            points = town.get_spawn_points()
            agree = all(
                abs((town.get_waypoint(point.location).transform.rotation.yaw
                     - point.rotation.yaw + 180.0) % 360.0 - 180.0) < 1.0
                for point in points)
            synchronous()
            manager = client.get_trafficmanager(int(sys.argv[2]))
            manager.set_synchronous_mode(True)
            cars = [
                world.spawn_actor(
                    world.get_blueprint_library().find("vehicle.audi.a2"), side.transform)
                for side in sides]
            for car in cars:
                car.set_autopilot(True, manager.get_port())
            for _ in range(200):
                world.tick()
            places = [car.get_location() for car in cars]
            print(json.dumps({
                "lanes": [side.lane_id for side in sides],
                "ahead": ahead,
                "spawn_points": [len(points), agree],
                "moved": [place.x - 1000.0 for place in places],
                "then": [town.get_waypoint(place).lane_id for place in places],
            }))
            """,
        )
    assert answer["lanes"] == answer["then"] == [-1, 1]
    assert answer["ahead"] == pytest.approx([1050.0, 950.0])
    assert answer["spawn_points"] == [334, True]
    assert answer["moved"][0] > 20.0
    assert answer["moved"][1] < -20.0
