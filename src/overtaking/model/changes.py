"""What is different in a branch of a simulation, as values that can be written down."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np

from overtaking.core.checks import convert_integers
from overtaking.model.batch import Batch
from overtaking.model.decision import Decision
from overtaking.model.scenario import MAX_VEHICLES, Scenario
from overtaking.model.values import within
from overtaking.model.vehicles import Role
from overtaking.model.weather import Weather


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """What is different from a frame on; what is left out stays.

    Attributes:
        frame: First frame that it can affect; at 0 the start itself is another one.
        decision: Forced on every ego until another change says something else.
        weather: Weather from then on, shape (simulation,) or of one simulation for all.
        without: What is taken away from the weather: names in `world.skies.WITHOUT`.
        vehicle: Slot of the vehicle that the rest is about.
        traits: Traits of its driver, names in `model.drivers.Drivers`, SI units.
        ahead: How much further along the road it is, also in the memory of all drivers [m].
        faster: How much faster it drives and wants to drive [m/s].
        removed: Whether it is taken away. Drivers who have noticed it look anew at once.
    """

    frame: Annotated[int, within(0, 2**31 - 1)] = 0
    decision: Decision | None = None
    weather: Weather | None = None
    without: tuple[str, ...] = ()
    vehicle: Annotated[int, within(0, MAX_VEHICLES - 1)] = Role.EGO
    traits: Mapping[str, float] = field(default_factory=dict[str, float])
    ahead: Annotated[float, within(-1e4, 1e4, "m")] = 0.0
    faster: Annotated[float, within(-100.0, 100.0, "m/s")] = 0.0
    removed: bool = False

    def __post_init__(self) -> None:
        """Accept integers of NumPy."""
        convert_integers(self, "frame", "vehicle")

    def as_json(self) -> dict[str, Any]:
        """Plain values of what is different, from which `from_json` makes an equal change."""
        found: dict[str, Any] = {"frame": self.frame}
        if self.decision is not None:
            found["decision"] = self.decision.name
        if self.weather is not None:
            rows = dataclasses.fields(self.weather)
            found["weather"] = {one.name: getattr(self.weather, one.name).tolist() for one in rows}
        for name in ("without", "traits", "ahead", "faster", "removed"):
            if value := getattr(self, name):
                found[name] = list(value) if isinstance(value, tuple) else value
        if self.about_vehicle:
            found["vehicle"] = self.vehicle
        return found

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> "Change":
        """The change that `as_json` has written.

        Raises:
            KeyError, TypeError, ValueError: It is none.
        """
        given = dict(values)
        if "decision" in given:
            given["decision"] = Decision[given["decision"]]
        if "weather" in given:
            given["weather"] = Weather(**_arrays(given["weather"]))
        given["without"] = tuple(given.get("without", ()))
        return cls(**given)

    @property
    def about_vehicle(self) -> bool:
        """Whether it is about a single vehicle."""
        return bool(self.traits or self.ahead or self.faster or self.removed)


@dataclass(frozen=True, slots=True, kw_only=True)
class Branched(Batch):
    """What a batch branches from, and by what.

    Attributes:
        scenario: The scenarios before any change.
        changes: All changes, in the order of their frames.
    """

    scenario: Scenario
    changes: tuple[Change, ...]


def _arrays(columns: Mapping[str, list[Any]]) -> dict[str, Any]:
    """Columns of a weather with the types of its fields."""
    kinds = {"preset": np.uint8, "night": np.bool_, "horizon_line": np.bool_}
    return {name: np.array(one, kinds.get(name, np.float32)) for name, one in columns.items()}
