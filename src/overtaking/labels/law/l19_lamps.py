"""L19: lamps that are needed, and none that dazzle."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import Mask
from overtaking.labels.law.air import optical_range
from overtaking.labels.law.frames import Span, conduct, ends_in, reduced
from overtaking.labels.law.others import others_at
from overtaking.labels.law.rule import Check, Grade, Rule, decided
from overtaking.labels.signals.engine import neighbours_at
from overtaking.labels.signals.frames import seconds_of
from overtaking.model.labels import Case
from overtaking.model.signals import Around
from overtaking.model.trajectory import Lights
from overtaking.model.vehicles import Role
from overtaking.world.constants import known

_HIGH = int(Lights.HIGH_BEAM)
_BEAMS = int(Lights.LOW_BEAM) | _HIGH
_FOG = int(Lights.REAR_FOG)


def check(case: Case) -> Check:
    """Low beam by night and in thick fog, fog lamps in that alone, no high beam that dazzles."""
    span, thick = conduct(case), optical_range(case) < known("law.lamps.sight")
    lights = case.trajectories.states.lights[:, Role.EGO]
    needed = case.trajectories.scenario.weather.night | thick
    rows = np.flatnonzero(span.exists & _suspect(lights, span, needed, thick))
    wrong = needed[rows, None] & ((lights[rows] & _BEAMS) == 0)
    wrong |= ((lights[rows] & _FOG) != 0) != thick[rows, None]
    row, frames = np.nonzero((lights[rows] & _HIGH) != 0)
    if row.size:
        wrong[row, frames] |= _dazzles(case, rows[row], frames)
    first, last = ends_in(span, rows, wrong)
    breach = np.zeros(len(thick), np.int32)
    breach[rows] = (wrong & span.mask(rows, lights.shape[1])).sum(axis=1, dtype=np.int32)
    return decided(span.exists, -seconds_of(case, breach), first, last)


def _suspect(lights: NDArray[np.uint8], span: Span, needed: Mask, thick: Mask) -> Mask:
    """Whether a frame may be wrong, from what is on ever and always, shape (simulation,)."""
    ever, always_on = (reduced(by, lights, span) for by in (np.bitwise_or, np.bitwise_and))
    dark = needed & ((always_on & _BEAMS) == 0)
    fog = np.where(thick, (always_on & _FOG) == 0, (ever & _FOG) != 0)
    return dark | fog | ((ever & _HIGH) != 0)


def _dazzles(case: Case, rows: NDArray[np.intp], frames: NDArray[np.intp]) -> Mask:
    """Whether high beam would dazzle somebody ahead or oncoming, at single frames."""
    run = case.trajectories
    ahead = neighbours_at(run, case.signals, Around.LEADER, rows, frames)
    behind = ahead.exists & (ahead.gap < known("law.lamps.high_beam_behind"))
    others = others_at(case, frames.astype(np.int32), rows)
    meets = others.valid & others.oncoming & (others.lead < 0)
    near = others.gap < known("law.lamps.high_beam_oncoming")
    return behind | (meets & near).any(axis=1)


RULE = Rule(
    id="pt.ce.61@2013",
    code="L19",
    law="Articles 60 and 61",
    title="Lamps",
    gloss="Low beam from dusk to dawn and wherever visibility asks for it; no high beam when "
    "meeting or less than 100 m behind another; rear fog lamps when required and only then.",
    predicate="At every frame: low or high beam at night and where the meteorological range is "
    "below 100 m; rear fog lamps exactly there; no high beam under 100 m behind the leader or "
    "under 200 m from an oncoming vehicle. The margin is the time in breach.",
    unit="s",
    grade=Grade.LIGHT,
    needs=frozenset(["lamps", "weather"]),
    without_attempt=True,
    check=check,
)
