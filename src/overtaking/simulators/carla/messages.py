"""What a worker with CARLA's client and its parent say to each other."""

from dataclasses import dataclass

from overtaking.core.errors import OvertakingError
from overtaking.model.scenario import Scenario
from overtaking.model.trajectory import Trajectories
from overtaking.simulators.carla.limits import Limits
from overtaking.simulators.carla.replay import Replayed, ReplayJob
from overtaking.simulators.carla.stage import SimulationLostError

SILENCE = 30.0
"""A worker without a sign of life for longer is ended [s]."""

LOADING = 180.0
"""The same while a map may be loaded, which takes a real server its time [s]."""


@dataclass(frozen=True, slots=True)
class Job:
    """What a worker is asked to do.

    Attributes:
        driver: `own` or `traffic-manager`.
        scenario: A batch of one.
        ports: Free ports for Traffic Managers.
    """

    driver: str
    scenario: Scenario
    ports: tuple[int, int]


@dataclass(frozen=True, slots=True)
class Alive:
    """A sign of life.

    Attributes:
        patience: Within this time there will be another one, or an answer [s].
    """

    patience: float = SILENCE


@dataclass(frozen=True, slots=True)
class LimitsJob:
    """Measure the limits of the Traffic Manager.

    Attributes:
        port: A free port for it.
    """

    port: int


Result = Trajectories | Limits | Replayed
Request = Job | LimitsJob | ReplayJob
Answer = Alive | Result | OvertakingError


def lost(request: Request, got: str) -> SimulationLostError:
    """The error for a request that came to nothing."""
    match request:
        case Job(scenario=scenario):
            number = f"simulation {int(scenario.index[0])}"
        case ReplayJob(name=name):
            number = f"film {name}"
        case _:
            number = "limits"
    return SimulationLostError.of(
        what=number,
        where="CARLA's client",
        expected="a result",
        got=got,
        next_step="try again",
    )
