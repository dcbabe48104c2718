"""Measures and sums over frames by the compiled engine: those of `reference`, bit for bit."""

import numpy as np
from numpy.typing import NDArray

from overtaking import _core
from overtaking.core.elementary import F32
from overtaking.model.labels import Case
from overtaking.physics.constants import known
from overtaking.rules.engine import law_numbers, of_signals, recorded_span
from overtaking.rules.frames import Span
from overtaking.signals.arrays import adjacent, flat

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
    run, names = case.trajectories, _core.worst_fields()
    out = np.empty((len(names), case.signals.num_simulations), np.float32)
    signals = ("speed", "accel", "friction", "vehicle", "gap", "closing_speed")
    _core.worst(
        span=recorded_span(case, span),
        seen={
            **of_signals(case, *signals),
            "accels": adjacent(run.states.accel_lon),
            "length": flat(run.scenario.vehicles.length),
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
    run, names = case.trajectories, _core.mean_fields()
    out = np.empty((len(names), case.signals.num_simulations), np.int64)
    _core.means(
        span=recorded_span(case, Span(start=np.zeros_like(last), stop=last)),
        seen={
            **of_signals(case, "vehicle", "left_count"),
            "s": adjacent(run.states.s),
            "speed": adjacent(run.states.speed),
        },
        out=out,
    )
    return dict(zip(names, out, strict=True))
