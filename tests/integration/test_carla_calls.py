"""Calls of the scripts of others through the genuine client of CARLA 0.9.16."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import pytest
from tests.support.carla import Address, answer_of, ask, headless_server, needs_wheel

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = [
    needs_wheel,
    pytest.mark.skipif(sys.platform == "win32", reason="the server is stopped by signals here"),
]


@pytest.fixture(scope="module")
def server() -> Iterator[Address]:
    with headless_server() as address:
        yield address


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
