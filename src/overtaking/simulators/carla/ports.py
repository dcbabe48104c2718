"""Ports for Traffic Managers, which the client opens and shares with nobody."""

import contextlib
import os
import socket

from overtaking.simulators.carla.stage import SimulationLostError

_PORTS = range(8000, 20_000)
_HANDED_OUT: list[int] = []


def free_port() -> int:
    """A port that nobody uses, outside the range from which outgoing connections get theirs."""
    start = os.getpid() % len(_PORTS)
    for k in range(len(_PORTS)):
        port = _PORTS[(start + k) % len(_PORTS)]
        if port in _HANDED_OUT:
            continue
        with contextlib.suppress(OSError), socket.socket() as plug:
            plug.bind(("", port))
            _HANDED_OUT.append(port)
            del _HANDED_OUT[: -len(_PORTS) // 2]
            return port
    raise SimulationLostError.of(
        what="port for a Traffic Manager",
        where="this machine",
        expected=f"a free one from {_PORTS.start} to {_PORTS.stop - 1}",
        got="none",
        next_step="end what uses them",
    )
