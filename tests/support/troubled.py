"""Simulators that go wrong in some way, which a worker process can find by name."""

from __future__ import annotations

import errno
import os
import sys
from typing import TYPE_CHECKING

from overtaking.data.recipe import Simulator
from overtaking.sim import engine

if TYPE_CHECKING:
    from overtaking.model.scenario import Scenario
    from overtaking.model.trajectories import Trajectories


def prints(scenario: Scenario) -> Trajectories:
    """Says much on both streams, also past Python, and looks for more to read."""
    print("a word of its own " * 1000)
    os.write(1, b"\x04\x00\x00\x00junk" * 1000)
    print("a complaint " * 10_000, file=sys.stderr)
    assert not sys.stdin.read()
    return engine.simulate(scenario)


def runs_out_of_room(scenario: Scenario) -> Trajectories:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "/data/part")


def is_wrong(scenario: Scenario) -> Trajectories:
    class Unknown(Exception):
        """Nobody else knows this class."""

    raise Unknown("one over nothing")


def ends(scenario: Scenario) -> Trajectories:
    print("out of luck", file=sys.stderr, flush=True)
    os._exit(3)


def troubled(trouble: str) -> Simulator:
    """A simulator by the name of its function."""
    return Simulator(name=trouble, version="1", simulate=globals()[trouble])
