"""How an overtake stood to oncoming traffic.

A new measure is a field here and a formula in `labels.features.oncoming`.
"""

from dataclasses import dataclass
from typing import Annotated

from overtaking.core.elementary import F32
from overtaking.model.batch import Batch
from overtaking.model.values import documented, meant


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Oncoming(Batch):
    """Measures of a batch against the nearest vehicle that comes; arrays have shape (simulation,).

    NaN on one-way roads, where the ego never came to the other side, and where no vehicle came. A
    time to meet is a distance over both speeds.
    """

    distance_out: Annotated[F32, meant("Gap to who comes as the ego comes to the other side", "m")]
    time_out: Annotated[F32, meant("Time to meet then", "s")]
    distance_abreast: Annotated[F32, meant("Gap as ego and target begin to overlap", "m")]
    time_abreast: Annotated[F32, meant("Time to meet then", "s")]
    distance_back: Annotated[F32, meant("Gap as the ego is back on its side", "m")]
    time_back: Annotated[F32, meant("Time to meet then", "s")]
    least_time: Annotated[F32, meant("Least time to meet while on the other side", "s")]
    sight_out: Annotated[F32, meant("Sight of air and road as the ego comes over", "m")]
    time_needed: Annotated[F32, meant("Time on the other side", "s")]
    time_available: Annotated[
        F32,
        meant("Time to meet who comes, or who might come at the limit from beyond sight", "s"),
    ]
