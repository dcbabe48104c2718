"""Scenarios on CARLA 0.9.16, through the genuine client: `simulate`, with our drivers.

The server is the one that `OVERTAKING_CARLA` names, or a headless one of ours that is started for
as long as this process lives. The client lives in a process of its own (`jobs`): where it
hangs or dies, it is ended and the simulation tried again in a fresh world.
"""

from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Trajectories
from overtaking.simulators.carla import processes

__all__ = ["CHUNK_SIZE", "SHARD_SIZE", "UNKNOWN", "simulate", "version"]

CHUNK_SIZE = 4
"""Simulations to ask for at a time; each takes seconds."""

UNKNOWN: frozenset[str] = frozenset()
"""Our drivers and CARLA together say everything."""

SHARD_SIZE = 8
"""Simulations that are lost when the work is interrupted, at most."""

DRIVER = "own"


def version() -> str:
    """What identifies the results."""
    return processes.version(DRIVER)


def simulate(scenario: Scenario) -> Trajectories:
    """Simulate a batch on CARLA with our drivers.

    Args:
        scenario: A batch of scenarios.

    Returns:
        The recorded simulations; lengths, widths, lanes and marks are those of CARLA.

    Raises:
        MissingExtraError: CARLA's client is not installed.
        ConfigError: The server is not there, of another version, or has no such map.
        SimulationLostError: Some could not be run in several attempts; the message names them.
    """
    return processes.simulate(scenario, DRIVER)
