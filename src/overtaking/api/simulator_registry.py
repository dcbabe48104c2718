"""The simulators by name, and types of arguments that several public functions share.

A simulator is a module with a function from scenarios (road, weather, vehicles and drivers before
the first instant) to trajectories (recorded motion). The modules are imported when a user first
names them, because SUMO and CARLA need packages that may be missing.

To add a simulator, add its name to `SIMULATORS` and its module to `_SIMULATOR_MODULES`. The module
needs the functions `simulate` and `version` and the constants `UNKNOWN`, `CHUNK_SIZE` and
`SHARD_SIZE`.
"""

import importlib
import os
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

from overtaking.core.errors import ConfigError
from overtaking.data.recipe import Simulator
from overtaking.model.batch import FieldSpec
from overtaking.model.driver_interface import Actions
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Trajectories
from overtaking.scenarios.specification import Specification
from overtaking.sim import MODEL_VERSION
from overtaking.world.step_parameters import step_parameters

ProfileSource = str | Path | Mapping[str, Any] | Specification
"""Source of a specification, the description from which scenarios are sampled.

The name of a profile of the package, the path of a TOML file, the mapping that the manifest of a
data set holds, or a specification itself.
"""


Seed = Annotated[int, FieldSpec(low=0, high=2**64 - 1)]
"""Seed of all random numbers; `check_arguments` checks the range."""


Count = Annotated[int, FieldSpec(low=1, high=1_000_000)]
"""Number of simulations of a function that keeps only their results, not the trajectories.

The limit is a choice.
"""


SIMULATORS = ("engine", "reference", "sumo", "carla", "carla-traffic-manager")
"""Names of the simulators.

`engine` is this package's own model, compiled; `reference` the same model in readable Python, with
the same results bit for bit. `sumo` has SUMO's drivers and motion, `carla` CARLA's motion with the
drivers of this package, and `carla-traffic-manager` CARLA's motion and drivers.
"""


_SIMULATOR_MODULES = {
    "engine": "overtaking.sim.engine",
    "reference": "overtaking.sim.reference",
    "sumo": "overtaking.simulators.sumo.run",
    "carla": "overtaking.simulators.carla.run",
    "carla-traffic-manager": "overtaking.simulators.carla.traffic",
}
"""The module of each simulator."""


MODEL_SIMULATORS = ("engine", "reference")
"""The simulators of this package's own model.

Only they can change a simulation in the middle, or let a driver of the user control the ego (the
vehicle whose overtaking is studied): their modules have a function `run`, which takes such changes
and the driver's actions.
"""


SERVER_SIMULATORS = ("carla", "carla-traffic-manager")
"""The simulators that run in a server. Several processes would share one server and disturb each
other."""


def get_simulator(name: str) -> Simulator:
    """The simulator with a name, with its version and the batch sizes that suit its speed.

    Args:
        name: A name in `SIMULATORS`.

    Raises:
        ConfigError: There is no such simulator.
        MissingExtraError: The package of the simulator is not installed.
    """
    module = simulator_module(name)
    if name in MODEL_SIMULATORS:
        # The trajectories have all quantities, and the default sizes suit a fast simulator.
        return Simulator(
            name=name,
            version=MODEL_VERSION,
            simulate=module.simulate,
            # The other simulators have one world per process, so they keep the default: one thread.
            threads=os.cpu_count() or 1,
            # A data set that stored the actions of a driver but no positions computes them with it.
            replay=partial(replay_actions, simulator=name),
        )
    return Simulator(
        name=name,
        version=module.version(),
        simulate=module.simulate,
        unknown=module.UNKNOWN,  # Quantities that its trajectories do not state.
        chunk_size=module.CHUNK_SIZE,  # Simulations in one call of `simulate`.
        shard_size=module.SHARD_SIZE,  # Simulations in one file of a data set.
        shares_world=name in SERVER_SIMULATORS,
    )


def replay_actions(
    scenario: Scenario, actions: Actions, *, simulator: str = "engine"
) -> Trajectories:
    """Repeat simulations in which a driver of the user controlled the ego, without the driver.

    Args:
        scenario: The scenarios of the original simulations.
        actions: The recorded actions of the driver, one for each decision.
        simulator: A name in `MODEL_SIMULATORS`.
    """
    run = simulator_module(simulator, MODEL_SIMULATORS).run
    # `run` takes the numbers that the model computes with, which `step_parameters` derives.
    return run(scenario, step_parameters(scenario), actions=actions)


def simulator_module(name: str, among: tuple[str, ...] = SIMULATORS) -> ModuleType:
    """Import the module of a simulator.

    Args:
        name: Name of the simulator.
        among: The names that the caller accepts.

    Raises:
        ConfigError: The name is not among them.
        MissingExtraError: The package of the simulator is not installed.
    """
    if name not in among:
        raise ConfigError.unknown_choice(
            what="simulator", where="simulate", choices=among, got=name
        )
    return importlib.import_module(_SIMULATOR_MODULES[name])
