"""L12: the speed limit."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask
from overtaking.labels.law.engine import above
from overtaking.labels.law.frames import conduct
from overtaking.labels.law.limits import class_of, speed_limits
from overtaking.labels.law.rule import Check, Grade, Rule, decided
from overtaking.model.labels import Case, Severity, Verdict
from overtaking.model.vehicles import Role
from overtaking.world.constants import known

_ROUNDING = np.float32(5e-4)
"""Half of the step in which speeds are recorded: 25 m/s must not be more than 90 km/h [m/s]."""


def check(case: Case) -> Check:
    """Speed never exceeds the posted limit and that of the class of vehicle on this road."""
    seen, span = case.signals, conduct(case)
    least, most = limits(case)
    fast = above(seen.speed, most, span)
    margin, doubtful = most - fast.low, fast.low > least
    found = decided(span.exists, margin, fast.first, fast.last, doubtful=doubtful)
    return found.replace(severity=_severity(case, found))


def limits(case: Case) -> tuple[F32, F32]:
    """The lowest and the highest limit that may hold, rounding allowed for; (simulation,) [m/s]."""
    least, most = speed_limits(case)
    return least + _ROUNDING, most + _ROUNDING


def _severity(case: Case, found: Check) -> NDArray[np.uint8]:
    """By the excess: light, serious, or very serious."""
    light = class_of(case.trajectories.scenario.vehicles.kind[:, Role.EGO]) < 2
    excess = -found.margin
    serious = _more(excess, light, "serious")
    very = _more(excess, light, "very_serious")
    severity = np.uint8(Severity.LIGHT) + serious.astype(np.uint8) + very.astype(np.uint8)
    return np.where(found.verdict == Verdict.ILLEGAL, severity, np.uint8(Severity.NONE))


def _more(excess: F32, light: Mask, grade: str) -> Mask:
    """Whether the excess is above the threshold of a grade."""
    of_light, of_other = known(f"law.excess.light_{grade}"), known(f"law.excess.other_{grade}")
    return excess > np.where(light, of_light, of_other)


RULE = Rule(
    id="pt.ce.27@2013",
    code="L12",
    law="Article 27",
    title="Speed limit",
    gloss="Keep to the limit that is posted and to the general limit of road and vehicle: on "
    "motorways 120 km/h for light vehicles, 110 for vans, 90 for heavy goods vehicles.",
    predicate="At every frame: speed <= min(posted limit, limit of the class on this kind of "
    "road). No tolerance. Severe by excess: over 30 km/h serious, over 60 very serious; heavy "
    "vehicles over 20 and 40.",
    unit="m/s",
    grade=Grade.BY_BREACH,
    partly=frozenset(["speed_limit", "kinds", "road_kind"]),
    without_attempt=True,
    check=check,
)
