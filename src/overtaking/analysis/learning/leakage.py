"""What is known only afterwards: refused to a model of a decision, and shown on request."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from overtaking.analysis.learning.attributes import BY_NAME, FACTORS
from overtaking.core.errors import ConfigError
from overtaking.model.vehicles import Role

if TYPE_CHECKING:
    from overtaking.data.load import Dataset

F64 = NDArray[np.float64]

OF_WHOLE_RUN = ("SE", "SP", "DSEP", "D", "OLR", "WT")
"""Features that the paper takes as means over the whole run where nothing was attempted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Leak:
    """Something that a model of a decision must not see.

    Attributes:
        name: What it is called.
        why: Why not.
        others: Other names that are refused for the same reason.
    """

    name: str
    why: str
    others: tuple[str, ...] = ()


LEAKS = (
    Leak(name="OT", why="how long the overtake took is known when it is over", others=("OT_s",)),
    Leak(
        name="C",
        why="whom the ego collided with is the outcome itself",
        others=("collision", "collided_with", "partner"),
    ),
    Leak(
        name="OV",
        why="how often the ego changed lanes is known when it is over",
        others=("overtaking", "ov_count", "num_lane_changes"),
    ),
    Leak(
        name="max|a|",
        why="the largest acceleration comes after the decision",
        others=("max_a", "maxa", "max_accel", "max |a|", "a_max"),
    ),
    Leak(
        name="means of the run",
        why="a mean over the whole run holds what came after the decision",
        others=tuple(f"mean_{name}".lower() for name in OF_WHOLE_RUN)
        + tuple(f"mean {name}".lower() for name in OF_WHOLE_RUN)
        + ("mean", "average", "averages", "paper"),
    ),
)
"""The features of the source paper that tell the outcome, with reasons."""


def chosen_factors(names: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """The factors that were asked for.

    Args:
        names: Names of factors or attributes; none for all factors.

    Returns:
        The attributes of each factor; an attribute that was named alone is its own factor.

    Raises:
        ConfigError: One of them is known only afterwards, or there is no such thing.
    """
    found: dict[str, tuple[str, ...]] = {}
    for name in names or tuple(FACTORS):
        if name in FACTORS:
            found[name] = FACTORS[name]
        elif name in BY_NAME:
            found[name] = (name,)
        else:
            raise _refusal(name)
    return found


def _refusal(name: str) -> ConfigError:
    """Why a feature is not taken."""
    told = name.strip().lower()
    for leak in LEAKS:
        if told in (leak.name.lower(), *(one.lower() for one in leak.others)):
            return ConfigError.of(
                what=f"feature {name}",
                where="learn factors",
                expected="what is known when the overtake begins",
                got=leak.why,
                next_step="leave it out, or see with --show-leakage what it would fake",
            )
    return ConfigError.of(
        what=f"feature {name}",
        where="learn factors",
        expected=f"a factor or attribute, such as {', '.join(list(FACTORS)[:3])}",
        got="no such name",
        next_step="see docs/explanation/learning.md for all",
    )


def leaks_of(data: "Dataset") -> dict[str, tuple[str, F64]]:
    """Why each leak leaks, and its numbers of each simulation, shape (simulation, column).

    Simulations that were not kept are simulated again, for their largest acceleration.

    Args:
        data: The data set.
    """
    events, rows = data.events(), pd.RangeIndex(len(data))
    overtaking_time = data.features("paper", reading="matched")["OT"].reindex(rows)
    averages = data.features("paper", reading="paper").reindex(rows)[list(OF_WHOLE_RUN)]
    is_contact = events["event"] == "collision"
    is_change = events["event"].isin(["line_crossed", "return_end"])
    values = (
        overtaking_time.to_numpy(dtype=np.float64)[:, None],
        rows.isin(events.loc[is_contact, "simulation"]).astype(np.float64)[:, None],
        np.bincount(events.loc[is_change, "simulation"], minlength=len(rows))[:, None],
        _largest_acceleration(data, len(rows)),
        averages.to_numpy(dtype=np.float64),
    )
    return {
        leak.name: (leak.why, np.nan_to_num(found.astype(np.float64)))
        for leak, found in zip(LEAKS, values, strict=True)
    }


def _largest_acceleration(data: "Dataset", count: int) -> F64:
    """Largest acceleration of the ego, forwards or sideways [m/s^2], shape (simulation, 1)."""
    found = np.zeros((count, 1))
    for numbers, run in data.batches():
        states = run.states
        axes = (states.accel_lon[:, Role.EGO], states.accel_lat[:, Role.EGO])
        size = np.maximum(*(abs(one.astype(np.int32)) for one in axes))
        found[numbers, 0] = size.max(axis=-1) / 1000.0  # Recorded in mm/s^2.
    return found
