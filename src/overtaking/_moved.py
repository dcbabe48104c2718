"""Import paths of version 0.1 before its packages were joined. They work in 0.1, with a warning."""

import sys
import warnings
from importlib import import_module
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import ModuleType

_PACKAGES = {
    "carla_server": "simulators.carla_server",
    "database": "analysis.database",
    "datasets": "data",
    "exchange": "recordings",
    "explain": "labels.explain",
    "features": "labels.features",
    "learning": "analysis.learning",
    "literature": "analysis.literature",
    "logic": "analysis.logic",
    "physics": "world",
    "plots": "show.plots",
    "report": "show.report",
    "reproduction": "analysis.reproduction",
    "rules": "labels.law",
    "signals": "labels.signals",
    "stats": "analysis.stats",
    "tables": "data.tables",
    "validation": "analysis.validation",
    "video": "show.video",
}
_MODULES = {
    "carla_server.places": "simulators.carla_server.maps",
    "datasets.card_header": "data.card",
    "datasets.contents": "data.tables.encode_labels",
    "datasets.crews": "data.executors",
    "datasets.datasheet": "data.card",
    "datasets.elsewhere": "data.work",
    "datasets.features": "data.views",
    "datasets.orders": "data.work",
    "datasets.process_crew": "data.processes",
    "datasets.process_worker": "data.processes",
    "datasets.ray_crew": "data.ray_executor",
    "datasets.refusals": "data.interruption",
    "datasets.shard_files": "data.shards",
    "datasets.verdict": "data.views",
    "datasets.wide": "data.views",
    "datasets.write": "data.shards",
    "learning.derived": "analysis.learning.attributes",
    "learning.extra": "analysis.learning.models",
    "learning.splits": "analysis.learning.models",
    "learning.tables_of_factors": "analysis.learning.tables",
    "learning.tables_of_rules": "analysis.learning.tables",
    "literature.selection": "analysis.literature.answers",
    "logic.header": "analysis.logic.facts",
    "logic.rounding": "analysis.logic.integers",
    "logic.runs": "analysis.logic.integers",
    "plots.boxes": "show.plots.distributions",
    "plots.classes": "show.plots.distributions",
    "plots.histograms": "show.plots.distributions",
    "plots.matrices": "show.plots.pairs",
    "plots.reproduction": "show.plots.comparison",
    "plots.validation": "show.plots.comparison",
    "plots.waiting": "show.plots.distributions",
    "sim.decision": "model.decision",
    "sim.effects": "world.effects",
    "stats.association_tables": "analysis.stats.associations",
    "tables.decision_columns": "data.tables.schemas",
    "tables.label_schemas": "data.tables.schemas",
    "tables.measured": "data.tables.columns",
    "tables.safety_columns": "data.tables.schemas",
    "tables.surroundings": "data.tables.lanes",
    "tables.unknown": "data.tables.schemas",
}


def _home(old: str) -> str | None:
    """The present name of a module, without `overtaking.`; None for one that never was."""
    package, _, rest = old.partition(".")
    if old in _MODULES or package not in _PACKAGES:
        return _MODULES.get(old)
    return f"{_PACKAGES[package]}.{rest}" if rest else _PACKAGES[package]


class _Finder:
    """Finds a module under its old name; asked only if there is none of that name."""

    @staticmethod
    def find_spec(name: str, *_: object) -> ModuleSpec | None:
        """The specification of an old name."""
        root, old = name.partition(".")[::2]
        home = _home(old) if root == __package__ else None
        if home is None or find_spec(f"{root}.{home}") is None:
            return None
        return ModuleSpec(name, _Loader(), is_package=old in _PACKAGES)  # pyright: ignore[reportArgumentType]


class _Loader:
    """Makes a module that passes every name on to the present one."""

    @staticmethod
    def create_module(spec: ModuleSpec) -> None:
        """An empty module."""

    @staticmethod
    def exec_module(module: ModuleType) -> None:
        """Pass names on, with a warning to the caller."""
        old = module.__name__
        new = f"{__package__}.{_home(old.partition('.')[2])}"

        def passed_on(name: str) -> object:
            if name.startswith("__"):  # Python asks for these by itself.
                raise AttributeError(name)
            message = f"{old} is {new} now; the old name is gone in overtaking 0.2"
            warnings.warn(message, DeprecationWarning, stacklevel=2)
            return getattr(import_module(new), name)

        module.__dict__["__getattr__"] = passed_on


sys.meta_path.append(_Finder())  # pyright: ignore[reportArgumentType]
