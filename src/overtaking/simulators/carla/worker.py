"""The process that holds CARLA's client: it runs one scenario after the other for its parent.

The client may hang or crash with a server that dies, so it never runs in the process of a user.
"""

import os
import time
from collections.abc import Callable
from typing import Any

from overtaking.core.errors import OvertakingError
from overtaking.core.parent import Parent
from overtaking.model.trajectory import Trajectories
from overtaking.simulators.carla import limits, manager, own, replay
from overtaking.simulators.carla.library import Address, connect, library
from overtaking.simulators.carla.messages import (
    Alive,
    Job,
    LimitsJob,
    Request,
    Result,
    lost,
)
from overtaking.simulators.carla.replay import ReplayJob
from overtaking.simulators.carla.stage import CarlaStage

SIGN_INTERVAL = 1.0
"""Time between two signs of life [s]."""


def main(parent: Parent, host: str, port: str) -> None:
    """Carry out jobs on the server at an address until there are no more."""
    carla, client = library(), None
    for job in parent:
        try:
            client = client or connect(carla, Address(host, int(port)))
            parent.send(_answer(carla, client, job, _signs(parent)))
        except OvertakingError as error:
            parent.send(error)
        except RuntimeError as error:  # What the client raises, a call that took too long included.
            parent.send(lost(job, str(error)))
    os._exit(0)  # The client's threads do not always end.


def _answer(carla: Any, client: Any, job: Request, sign: Callable[[], None]) -> Result:
    if isinstance(job, LimitsJob):
        return limits.measure(carla, client, job.port, sign)
    if isinstance(job, ReplayJob):
        return replay.replay(carla, client, job, sign)
    return _run(carla, client, job, sign)


def _run(carla: Any, client: Any, job: Job, sign: Callable[[], None]) -> Trajectories:
    """One simulation in a world of its own."""
    slower = manager.SLOWER if job.driver == "traffic-manager" else 1
    stage = CarlaStage.set_up(carla, client, job.scenario, slower=slower)
    sign()
    if job.driver == "traffic-manager":
        run = manager.run(stage, sign, job.ports)
    else:
        run = own.run(stage, sign)
    stage.tear_down()  # Not after an error: the server may be gone, and every call take its time.
    return run


def _signs(parent: Parent) -> Callable[[], None]:
    """Sends a sign of life at most once in `SIGN_INTERVAL`."""
    last = 0.0  # The first one is sent at once.

    def sign() -> None:
        nonlocal last
        if time.monotonic() - last > SIGN_INTERVAL:
            last = time.monotonic()
            parent.send(Alive())

    return sign
