"""Simulators by name, and types of arguments that many public functions share."""

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
from overtaking.sim.version import MODEL_VERSION
from overtaking.world.step_parameters import step_parameters

ProfileSource = str | Path | Mapping[str, Any] | Specification
"""A profile of the package, a TOML file, what a manifest recorded, or a specification."""


Seed = Annotated[int, FieldSpec(low=0, high=2**64 - 1)]
"""Key of all random numbers."""


Count = Annotated[int, FieldSpec(low=1, high=1_000_000)]
"""A number of simulations that are not written down."""


SIMULATORS = ("engine", "reference", "sumo", "carla", "carla-traffic-manager")
"""The simulators: the compiled engine, its readable twin with the same results, SUMO, and CARLA
with our drivers or with its own."""


_SIMULATOR_MODULES = {
    "engine": "overtaking.sim.engine",
    "reference": "overtaking.sim.reference",
    "sumo": "overtaking.simulators.sumo.run",
    "carla": "overtaking.simulators.carla.run",
    "carla-traffic-manager": "overtaking.simulators.carla.traffic",
}
"""The module of each simulator, loaded when a user first names it."""


MODEL_SIMULATORS = ("engine", "reference")
"""The simulators of our own model, which can go on from the middle of a simulation."""


SERVER_SIMULATORS = ("carla", "carla-traffic-manager")
"""The simulators in which a server holds the world."""


def get_simulator(name: str) -> Simulator:
    """A simulator by its name."""
    module = simulator_module(name)
    if name in MODEL_SIMULATORS:
        return Simulator(
            name=name,
            version=MODEL_VERSION,
            simulate=module.simulate,
            threads=os.cpu_count() or 1,
            replay=partial(replay_actions, simulator=name),
        )
    return Simulator(
        name=name,
        version=module.version(),
        simulate=module.simulate,
        unknown=module.UNKNOWN,
        chunk_size=module.CHUNK_SIZE,
        shard_size=module.SHARD_SIZE,
        shares_world=name in SERVER_SIMULATORS,
    )


def replay_actions(
    scenario: Scenario, actions: Actions, *, simulator: str = "engine"
) -> Trajectories:
    """Simulate a batch in which another driver did something; it is not needed again."""
    run = simulator_module(simulator, MODEL_SIMULATORS).run
    return run(scenario, step_parameters(scenario), actions=actions)


def simulator_module(name: str, among: tuple[str, ...] = SIMULATORS) -> ModuleType:
    """The module of a simulator."""
    if name not in among:
        raise ConfigError.unknown_choice(
            what="simulator", where="simulate", choices=among, got=name
        )
    return importlib.import_module(_SIMULATOR_MODULES[name])
