"""The paper's fifteen features of a simulation."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask
from overtaking.knowledge import terms
from overtaking.model.batch import Batch
from overtaking.model.values import documented, meant
from overtaking.model.vehicles import VehicleKind

U8 = NDArray[np.uint8]
I32 = NDArray[np.int32]


def _paper(code: str, unit: str = "1", **declared: Any) -> Mapping[str, Any]:
    """Metadata of a feature; its words are those of `knowledge/data/terms.toml`."""
    return meant(terms("features")[code].meaning, unit, column=code, **declared)


_weather = partial(_paper, needs=["weather"])
_of_target = partial(_paper, present="has_target")
_KINDS = tuple(kind.name for kind in VehicleKind)


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Features(Batch):
    """Seven static and eight dynamic features; every array has shape (simulation,).

    Without a vehicle to overtake its features are 0 and `has_target` is false. Waiting time,
    overtaking time and distance are NaN where the attempt began before the recording; features of
    the target are NaN where it is not recorded in that frame. The column of a feature has the name
    that the paper gives it.
    """

    policy: str = field(metadata=meant("How they were measured, `paper` or `matched`", column=None))
    night: Mask = field(metadata=_weather("DN", names=["Day", "Night"]))
    horizon_line: Mask = field(metadata=_weather("HL", names=["No", "Yes"]))
    ego_kind: U8 = field(metadata=_paper("TE", names=_KINDS))
    target_kind: U8 = field(metadata=_of_target("TP", names=_KINDS))
    has_target: Mask = field(metadata=meant("Whether there is a target", column=None))
    waiting_time: F32 = field(metadata=_paper("WT", "s"))
    overtaking_time: F32 = field(metadata=_paper("OT", "s"))
    num_vehicles: U8 = field(metadata=_paper("NV"))
    ego_speed: F32 = field(metadata=_paper("SE", "m/s"))
    target_speed: F32 = field(metadata=_of_target("SP", "m/s"))
    speed_difference: F32 = field(metadata=_of_target("DSEP", "m/s"))
    distance: F32 = field(metadata=_of_target("D", "m"))
    left_occupancy: F32 = field(metadata=_paper("OLR"))
    rain: F32 = field(metadata=_weather("PREC", "%"))
    wind: F32 = field(metadata=_weather("WIND", "%"))
    fog: F32 = field(metadata=_weather("FOG", "%"))
    frame: I32 = field(
        metadata=meant(
            "Frame at which they were measured, `NEVER` for means over all frames", column=None
        )
    )
