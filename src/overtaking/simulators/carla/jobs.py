"""Messages between a worker with CARLA's client and its parent: jobs, signs of life, results."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from overtaking.model.scenario import Scenario
from overtaking.model.trajectory import Trajectories
from overtaking.simulators.carla import manager, own
from overtaking.simulators.carla.limits import Limits, LimitsJob
from overtaking.simulators.carla.replay import Replayed, ReplayJob
from overtaking.simulators.carla.stage import CarlaStage
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
    """A simulation to run.

    Attributes:
        driver: `own` or `traffic-manager`.
        scenario: A batch of one.
        ports: Free ports for Traffic Managers.
    """

    driver: str
    scenario: Scenario
    ports: tuple[int, int]

    def do(self, carla: Any, client: Any, sign: Callable[[], None]) -> Trajectories:
        """Run it in a world of its own.

        Args:
            carla: The module.
            client: A connected client.
            sign: Called after every tick.
        """
        has_manager = self.driver == "traffic-manager"
        slower = manager.SLOWER if has_manager else 1
        stage = CarlaStage.set_up(carla, client, self.scenario, slower=slower)
        sign()
        found = manager.run(stage, sign, self.ports) if has_manager else own.run(stage, sign)
        stage.tear_down()  # Not after an error: the server may be gone, each call takes its time.
        return found

    def __str__(self) -> str:
        """Its name in messages."""
        return f"simulation {int(self.scenario.index[0])}"


Request = Job | LimitsJob | ReplayJob
Result = Trajectories | Limits | Replayed


def lost(request: Request, got: str) -> SimulationLostError:
    """The error for a request that came to nothing."""
    return SimulationLostError.because("CARLA's client", str(request), "a result", got)
