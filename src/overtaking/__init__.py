"""A laboratory for overtaking manoeuvres: simulate, label and explain them, reproducibly.

Every public name is loaded from the module that defines it when it is first used (PEP 562), so
importing the package costs nothing and binds no layer to another. `__init__.pyi` beside this file
tells type checkers and editors the same names.
"""

from importlib import import_module as _import_module

_HOMES = {
    "Balance": "overtaking.datasets.balance",
    "Dataset": "overtaking.datasets.load",
    "Decision": "overtaking.sim.decision",
    "Drivers": "overtaking.model.drivers",
    "Labelled": "overtaking.labelling.label",
    "Lane": "overtaking.model.road",
    "OvertakingError": "overtaking.core.errors",
    "Road": "overtaking.model.road",
    "Scenario": "overtaking.model.scenario",
    "Trajectories": "overtaking.model.trajectory",
    "VehicleSpecs": "overtaking.model.vehicles",
    "Weather": "overtaking.model.weather",
    "ask": "overtaking.api.logic",
    "branch": "overtaking.api.simulating",
    "compare": "overtaking.api.simulating",
    "film": "overtaking.api.results",
    "generate": "overtaking.api.data",
    "label": "overtaking.api.simulating",
    "learn_factors": "overtaking.api.learning",
    "learn_rules": "overtaking.api.learning",
    "load": "overtaking.api.data",
    "plot_validation": "overtaking.api.results",
    "prove": "overtaking.api.logic",
    "query": "overtaking.api.results",
    "relabel": "overtaking.api.data",
    "reproduce": "overtaking.api.results",
    "resume": "overtaking.api.data",
    "sample": "overtaking.api.simulating",
    "simulate": "overtaking.api.simulating",
    "statistics": "overtaking.api.results",
    "validate": "overtaking.api.results",
    "write_report": "overtaking.api.results",
    "write_reproduction": "overtaking.api.results",
}
"""The module that defines each public name."""


def __getattr__(name: str) -> object:
    """Load a public name, once."""
    if name == "__version__":
        value = _import_module("importlib.metadata").version(__name__)
    elif name in _HOMES:
        value = getattr(_import_module(_HOMES[name]), name)
    else:
        message = f"overtaking: no public name {name!r}; dir(overtaking) lists them"
        raise AttributeError(message, name=name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names, loaded or not."""
    return sorted({*globals(), *_HOMES, "__version__"})
