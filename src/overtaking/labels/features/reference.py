"""Measures and sums over frames as a person reads them.

`crates/overtaking-core/src/stretches.rs` is the fast twin, and `labels.features.engine` its Python.
"""

from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32
from overtaking.labels.features.encounters import Side, encounter
from overtaking.labels.features.instants import Instants
from overtaking.labels.features.margins import front_margins
from overtaking.labels.law.frames import Span
from overtaking.model.labels import Case
from overtaking.model.safety import Encounter
from overtaking.model.signals import Around
from overtaking.model.vehicles import Role
from overtaking.world.constants import known
from overtaking.world.measures import is_critical, shortfall

I64 = NDArray[np.int64]

_LARGEST = frozenset(["closing_speed", "drac"])
"""Measures that are the worse the larger they are."""


def worst(case: Case, span: Span) -> dict[str, F32]:
    """The worst of each measure over a span; see `labels.features.engine.worst`."""
    within = span.mask(np.arange(case.signals.num_simulations), case.signals.num_frames)
    led = Instants.of(within & case.signals.has(Around.LEADER))
    chased = Instants.of(within & case.signals.has(Around.FOLLOWER))
    front = encounter(case, Around.LEADER, Side.AHEAD, led.rows, led.frames)
    rear = encounter(case, Around.FOLLOWER, Side.BEHIND, chased.rows, chased.frames)
    margins = front_margins(case, front, led.rows, led.frames)
    limit = known("labels.safety.critical_ttc")
    return {
        **_extremes(front, led, "front"),
        **_extremes(rear, chased, "rear"),
        **{name: led.lowest(values) for name, values in margins.items()},
        "num_close": led.total(margins["lawful_margin"] < 0),
        "num_critical": led.total(is_critical(front.ttc, limit)),
        "shortfall": led.total(shortfall(front.ttc, limit)),
    }


def _extremes(found: Encounter, instants: Instants, side: str) -> dict[str, F32]:
    worse = {"valid": instants.exists.astype(np.float32)}
    for field in fields(Encounter):
        values = getattr(found, field.name)
        if field.name in _LARGEST:
            worse[field.name] = instants.highest(values)
        elif field.name != "valid":
            worse[field.name] = instants.lowest(values)
    return {f"{side}.{name}": values for name, values in worse.items()}


def sums(case: Case, last: NDArray[np.int32]) -> dict[str, I64]:
    """Sums of recorded integers over the frames up to one; see `labels.features.engine.sums`."""
    states, seen = case.trajectories.states, case.signals
    counted = seen.valid & (np.arange(seen.num_frames) <= last[:, None])
    led = counted & seen.has(Around.LEADER)
    slot = np.where(led, seen.vehicle[:, Around.LEADER], Role.EGO).astype(np.intp)[:, None]
    own, other = states.speed[:, Role.EGO], np.take_along_axis(states.speed, slot, axis=1)[:, 0]
    ahead = np.take_along_axis(states.s, slot, axis=1)[:, 0] - states.s[:, Role.EGO]
    of = {
        "frames": (counted, counted),
        "led": (led, led),
        "ego_speed": (own, counted),
        "target_speed": (other, led),
        "speed_difference": (np.abs(own - other), led),
        "distance": (np.abs(ahead), led),
        "left_count": (seen.left_count, counted),
    }
    return {
        name: np.where(where, values, 0).sum(axis=1, dtype=np.int64)
        for name, (values, where) in of.items()
    }
