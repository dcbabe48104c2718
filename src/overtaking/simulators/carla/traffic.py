"""Scenarios on CARLA 0.9.16 with its own Traffic Managers, as the study did (`carla_manager`)."""

from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Trajectories
from overtaking.simulators.carla import processes
from overtaking.simulators.carla.manager import UNKNOWN
from overtaking.world.road_parameters import check_one_direction

__all__ = ["CHUNK_SIZE", "SHARD_SIZE", "UNKNOWN", "simulate", "version"]

CHUNK_SIZE = 4
"""Simulations to ask for at a time; each takes many seconds."""

SHARD_SIZE = 8
"""Simulations that are lost when the work is interrupted, at most."""

DRIVER = "traffic-manager"


def version() -> str:
    """What identifies the results."""
    return processes.version(DRIVER)


def simulate(scenario: Scenario) -> Trajectories:
    """Simulate a batch on CARLA with two Traffic Managers at a third of the speed.

    Args:
        scenario: A batch of scenarios.

    Returns:
        The recorded simulations, converted to true speed; `unknown` names what is missing.

    Raises:
        MissingExtraError: CARLA's client is not installed.
        ConfigError: The server is not there, of another version, or has no such map; or the road
            bends, or its limit changes.
        SimulationLostError: Some could not be run in several attempts; the message names them.
    """
    check_one_direction(scenario, "CARLA")
    scenario.road.check_straight("CARLA")
    scenario.road.check_one_speed_limit("CARLA")
    return processes.simulate(scenario, DRIVER)
