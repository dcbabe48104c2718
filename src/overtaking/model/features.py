"""The paper's fifteen features of a simulation."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

from overtaking.core.arrays import F32, I32, U8, Mask
from overtaking.knowledge import terms
from overtaking.model.batch import Batch, FieldSpec
from overtaking.model.values import documented, meant
from overtaking.model.vehicles import VehicleKind


def _paper(code: str, unit: str = "1", **declared: Any) -> FieldSpec:
    """Declaration of a feature; its words are those of `knowledge/data/terms.toml`."""
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

    policy: Annotated[str, meant("How they were measured, `paper` or `matched`", column=None)]
    night: Annotated[Mask, _weather("DN", names=["Day", "Night"])]
    horizon_line: Annotated[Mask, _weather("HL", names=["No", "Yes"])]
    ego_kind: Annotated[U8, _paper("TE", names=_KINDS)]
    target_kind: Annotated[U8, _of_target("TP", names=_KINDS)]
    has_target: Annotated[Mask, meant("Whether there is a target", column=None)]
    waiting_time: Annotated[F32, _paper("WT", "s")]
    overtaking_time: Annotated[F32, _paper("OT", "s")]
    num_vehicles: Annotated[U8, _paper("NV")]
    ego_speed: Annotated[F32, _paper("SE", "m/s")]
    target_speed: Annotated[F32, _of_target("SP", "m/s")]
    speed_difference: Annotated[F32, _of_target("DSEP", "m/s")]
    distance: Annotated[F32, _of_target("D", "m")]
    left_occupancy: Annotated[F32, _paper("OLR")]
    rain: Annotated[F32, _weather("PREC", "%")]
    wind: Annotated[F32, _weather("WIND", "%")]
    fog: Annotated[F32, _weather("FOG", "%")]
    frame: Annotated[
        I32,
        meant("Frame at which they were measured, `NEVER` for means over all frames", column=None),
    ]
