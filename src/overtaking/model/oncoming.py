"""How an overtake stood to oncoming traffic.

A new measure is a field here and a formula in `labels.features.oncoming`. The columns of the table
`safety` follow.
"""

from dataclasses import dataclass
from functools import partial
from typing import Annotated

from overtaking.core.arrays import F32, Mask
from overtaking.model.batch import Batch
from overtaking.model.values import documented, meant

_measure = partial(meant, present=".exists")


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Oncoming(Batch):
    """Measures of a batch against the nearest vehicle that comes; arrays have shape (simulation,).

    Where `exists` is false the others mean nothing: on one-way roads, and where the ego never came
    to the other side. NaN where no vehicle came. A time to meet is a distance over both speeds.
    """

    exists: Annotated[Mask, meant("Whether the ego came to the other side", column=None)]
    distance_out: Annotated[
        F32, _measure("Gap to who comes as the ego comes to the other side", "m")
    ]
    time_out: Annotated[
        F32, _measure("Time to meet who comes as the ego comes to the other side", "s")
    ]
    distance_abreast: Annotated[
        F32, _measure("Gap to who comes as ego and target begin to overlap", "m")
    ]
    time_abreast: Annotated[
        F32, _measure("Time to meet who comes as ego and target begin to overlap", "s")
    ]
    distance_back: Annotated[
        F32, _measure("Gap to who comes as the ego is back on its side, or collides", "m")
    ]
    time_back: Annotated[
        F32, _measure("Time to meet who comes as the ego is back on its side, or collides", "s")
    ]
    least_time: Annotated[F32, _measure("Least time to meet while on the other side", "s")]
    sight_out: Annotated[
        F32,
        _measure(
            "Sight of air and road as the ego comes to the other side", "m", needs=["weather"]
        ),
    ]
    time_needed: Annotated[F32, _measure("Time on the other side", "s")]
    time_available: Annotated[
        F32,
        _measure(
            "Time to meet who comes, or who might come at the limit from beyond sight",
            "s",
            needs=["weather", "speed_limit"],
        ),
    ]
    given_up: Annotated[Mask, _measure("Whether the ego fell back behind its target")]
