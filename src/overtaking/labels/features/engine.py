"""Measures and sums over frames by the compiled engine: those of `reference`, bit for bit.

As in `labels.law.engine`, `reference` looks at signals that somebody has changed.
"""

import numpy as np
from numpy.typing import NDArray

from overtaking import _core
from overtaking.core.elementary import F32
from overtaking.labels.features import encounters, reference
from overtaking.labels.features.encounters import Index, Side
from overtaking.labels.features.past import halves
from overtaking.labels.law.engine import around, law_numbers, of_signals, recorded_span
from overtaking.labels.law.frames import Span
from overtaking.labels.signals.arrays import adjacent, flat
from overtaking.model.labels import Case
from overtaking.model.safety import Encounter
from overtaking.model.signals import Around
from overtaking.model.trajectory import NO_VEHICLE
from overtaking.model.vehicles import Role
from overtaking.world.compiled import chosen_level
from overtaking.world.constants import known

I64 = NDArray[np.int64]

_MEASURES = {
    "picud_reaction_time": "labels.safety.picud_reaction_time",
    "picud_decel": "labels.safety.picud_decel",
    "rss_reaction_time": "law.rss.reaction_time",
    "rss_accel": "law.rss.accel",
    "rss_rear_decel": "law.rss.rear_decel",
    "rss_lead_decel": "law.rss.lead_decel",
    "critical_ttc": "labels.safety.critical_ttc",
}


def encounter(
    case: Case, place: Around | Index, side: Side, rows: Index, frames: Index
) -> Encounter:
    """The ego and a neighbour at any instants; see `encounters.encounter`."""
    if not case.signals.is_original:
        return encounters.encounter(case, place, side, rows, frames)
    names, run = _core.encounter_fields(), case.trajectories
    vehicle, out = np.empty(len(rows), np.uint8), np.empty((len(names), len(rows)), np.float32)
    _core.encounters(
        around=around(case),
        accels=adjacent(run.states.accel_lon),
        instants={
            "rows": np.ascontiguousarray(rows, np.int64),
            "places": np.ascontiguousarray(np.broadcast_to(np.int64(place), np.shape(rows))),
            "frames": np.ascontiguousarray(frames, np.int64),
        },
        is_ahead=side is Side.AHEAD,
        vehicle=vehicle,
        out=out,
        level=chosen_level(),
    )
    return Encounter(valid=vehicle != NO_VEHICLE, **dict(zip(names, out, strict=True)))


def first_past(case: Case, rows: Index, slot: Index, begin: NDArray[np.int32]) -> NDArray[np.int32]:
    """First frame in which a vehicle has come where the ego's rear was; see `past.first_past`."""
    run, out = case.trajectories, np.empty(len(rows), np.int32)
    _core.arrivals(
        s=adjacent(run.states.s),
        present=None if run.present is None else adjacent(run.present),
        num_frames=flat(run.num_frames),
        coming={
            "row": np.ascontiguousarray(rows, np.int64),
            "slot": np.ascontiguousarray(slot, np.int64),
            "begin": np.ascontiguousarray(begin, np.int32),
            "place": run.states.s[rows, Role.EGO, begin],
            "halves": halves(case, rows, slot),
        },
        out=out,
    )
    return out


def worst(case: Case, span: Span) -> dict[str, F32]:
    """The worst of each measure of the vehicles ahead and behind over a span.

    Args:
        case: The batch.
        span: From where to where.

    Returns:
        By name, shape (simulation,): `front` and `rear` with the fields of `Encounter`; headway,
        picud, rss_margin and lawful_margin to the vehicle ahead; num_close, num_critical and
        shortfall, the frames under the lawful distance, those with a critical time to collision,
        and the sum of what these lack [s]. 0 where nobody is there.
    """
    if not case.signals.is_original:
        return reference.worst(case, span)
    run, names = case.trajectories, _core.worst_fields()
    out = np.empty((len(names), case.signals.num_simulations), np.float32)
    _core.worst(
        span=recorded_span(case, span),
        seen={
            **of_signals(case, "speed", "friction"),
            "around": around(case),
            "accels": adjacent(run.states.accel_lon),
        },
        law=law_numbers(),
        measures={name: float(known(path)) for name, path in _MEASURES.items()},
        out=out,
    )
    return dict(zip(names, out, strict=True))


def sums(case: Case, last: NDArray[np.int32]) -> dict[str, I64]:
    """Sums of recorded integers over the frames up to one.

    Args:
        case: The batch.
        last: Last frame that counts, shape (simulation,).

    Returns:
        By name, shape (simulation,): frames; led, the frames with a leader; ego_speed [mm/s] and
        left_count over all frames; target_speed, speed_difference [mm/s] and distance [mm] to the
        leader, the latter two without sign, over those with one.
    """
    if not case.signals.is_original:
        return reference.sums(case, last)
    run, names = case.trajectories, _core.mean_fields()
    out = np.empty((len(names), case.signals.num_simulations), np.int64)
    _core.means(
        span=recorded_span(case, Span(start=np.zeros_like(last), stop=last)),
        seen={
            "around": around(case),
            "num_lanes": run.road.num_lanes,
            "valid": flat(run.scenario.vehicles.valid),
            "lane": adjacent(run.states.lane),
            "present": None if run.present is None else adjacent(run.present),
        },
        out=out,
    )
    return dict(zip(names, out, strict=True))
