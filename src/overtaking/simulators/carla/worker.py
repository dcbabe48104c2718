"""The process that holds CARLA's client: it runs one scenario after the other for its parent.

The client may hang or crash with a server that dies, so it never runs in the process of a user.
"""

import os
import time
from collections.abc import Callable

from overtaking.core.errors import OvertakingError
from overtaking.core.parent import Parent
from overtaking.simulators.carla.jobs import Alive
from overtaking.simulators.carla.library import Address, connect, library

SIGN_INTERVAL = 1.0
"""Time between two signs of life [s]."""


def main(parent: Parent, host: str, port: str) -> None:
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


def _signs(parent: Parent) -> Callable[[], None]:
    """Sends a sign of life at most once in `SIGN_INTERVAL`."""
    last = 0.0  # The first one is sent at once.

    def sign() -> None:
        nonlocal last
        if time.monotonic() - last > SIGN_INTERVAL:
            last = time.monotonic()
            parent.send(Alive())

    return sign
