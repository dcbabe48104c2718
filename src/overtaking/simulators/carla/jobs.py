"""The process that holds CARLA's client: it carries out one job after the other for its parent.

The client may hang or crash with a server that dies, so it never runs in the process of a user.
"""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from overtaking.core.errors import OvertakingError
from overtaking.core.worker_process import ParentConnection
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Trajectories
from overtaking.simulators.carla import manager, own
from overtaking.simulators.carla.library import Address, connect, library
from overtaking.simulators.carla.stage import CarlaScene
from overtaking.simulators.carla.world import SimulationLostError

SILENCE = 30.0
"""A worker without a sign of life for longer is ended [s]."""

LOADING = 180.0
"""The same while a map may be loaded, which takes a real server its time [s]."""


@dataclass(frozen=True, slots=True)
class Alive:
    """A sign of life.

    Attributes:
        patience: Within this time another one follows, or a result [s].
    """

    patience: float = SILENCE


@dataclass(frozen=True, slots=True)
class Job:
    """What a worker shall do.

    Attributes:
        name: Its name in messages.
        run: Gives the result. It is called with the module `carla`, a connected client, and what
            has to be called after every tick, as a sign of life.
    """

    name: str
    run: Callable[[Any, Any, own.HeartbeatCallback], Any]

    def lost(self, got: str) -> SimulationLostError:
        """The error for a job that came to nothing."""
        return SimulationLostError.because("CARLA's client", self.name, "a result", got)


def drive(
    carla: Any,
    client: Any,
    send_heartbeat: own.HeartbeatCallback,
    *,
    driver: str,
    scenario: Scenario,
    ports: list[int],
) -> Trajectories:
    """Run a simulation in a world of its own.

    Args:
        carla: The module.
        client: A connected client.
        send_heartbeat: Called after every tick.
        driver: `own` or `traffic-manager`.
        scenario: A batch of one.
        ports: Two free ports for Traffic Managers.
    """
    has_manager = driver == "traffic-manager"
    time_scale = manager.TIME_SCALE if has_manager else 1
    scene = CarlaScene.set_up(carla, client, scenario, time_scale=time_scale)
    send_heartbeat()
    found = (
        manager.run_study(scene, send_heartbeat, ports)
        if has_manager
        else own.run_model_drivers(scene, send_heartbeat)
    )
    scene.tear_down()  # Not after an error: the server may be gone, each call takes its time.
    return found


SIGN_INTERVAL = 1.0
"""Time between two signs of life [s]."""


def main(parent: ParentConnection, host: str, port: str) -> None:
    """Carry out jobs on the server at an address until there are no more."""
    carla, client = library(), None
    for job in parent:
        try:
            client = client or connect(carla, Address(host, int(port)))
            parent.send(job.run(carla, client, _signs(parent)))
        except OvertakingError as error:
            parent.send(error)
        except RuntimeError as error:  # What the client raises, a call that took too long included.
            parent.send(job.lost(str(error)))
    os._exit(0)  # The client's threads do not always end.


def _signs(parent: ParentConnection) -> Callable[[], None]:
    """Sends a sign of life at most once in `SIGN_INTERVAL`."""
    last = 0.0  # The first one is sent at once.

    def send_heartbeat() -> None:
        nonlocal last
        if time.monotonic() - last > SIGN_INTERVAL:
            last = time.monotonic()
            parent.send(Alive())

    return send_heartbeat
